"""`hsplat render SCENE`: a film or numbered frames, and a sidecar that says how they were made."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hsplat_cli.first_run import tell_first_run
from hsplat_cli.frame_range import parse_frames
from hsplat_cli.interrupts import terminated_as_interrupted
from hsplat_cli.progress import progress
from hsplat_cli.scene_file import load_scene
from hsplat_cli.versions import package_versions
from renderer.output_files import sidecar_path
from renderer.scene import Scene
from renderer.scene_schema import scene_to_dict

if TYPE_CHECKING:
    from renderer.pipeline import Frame, Stage


@click.command()
@click.argument("scene", type=click.Path(path_type=Path))
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value: --set error.tolerance=0.2"
)
@click.option(
    "--output", type=click.Path(path_type=Path), metavar="FILE", help="Write to this .mp4, .gif or {frame}.png."
)
@click.option("--frames", metavar="A:B:STEP", help="Draw only these frames, as Python slices them: 0:30, ::10, 7.")
@click.option("--volume", type=click.Path(path_type=Path), metavar="FILE", help="Take the volume from this file.")
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
def render(
    scene: Path, overrides: tuple[str, ...], output: Path | None, frames: str | None, volume: Path | None, quiet: bool
) -> None:
    """Render a scene to a film or to numbered frames.

    SCENE is a YAML file. Beside the output comes a JSON file that says how it was made.
    """
    job = load_scene(scene, overrides=overrides, volume=volume, output=output)
    numbers = parse_frames(frames, job.camera.path.frames)
    with terminated_as_interrupted():
        _render(job, numbers, quiet=quiet)


def _render(scene: Scene, numbers: Sequence[int], *, quiet: bool) -> None:
    # Imported here: numpy, numba and GL take longer to load than --help may take to answer.
    from renderer.film import open_film  # noqa: PLC0415
    from renderer.pipeline import prepare, render_frames  # noqa: PLC0415
    from renderer.raster_gl import GLRasterizer  # noqa: PLC0415
    from renderer.sidecar import write_sidecar  # noqa: PLC0415
    from renderer.staging import require_writable  # noqa: PLC0415

    tell_first_run(quiet=quiet)
    start, records = time.perf_counter(), []
    # What can fail early does: the outputs and the GL context are tried before a voxel is read.
    with open_film(scene.output, numbers) as film, GLRasterizer() as rasterizer:
        sidecar = sidecar_path(scene.output.file)
        require_writable(sidecar)
        stage = prepare(scene, clock=time.perf_counter, num_threads=os.cpu_count() or 1)
        with progress(len(numbers), label=scene.output.file.name, quiet=quiet) as bar:
            for frame in render_frames(stage, numbers, rasterizer, clock=time.perf_counter):
                before = time.perf_counter()
                film.write(frame.number, frame.image)
                records.append(_frame_record(frame, time.perf_counter() - before))
                bar.advance(f"{frame.num_splats} splats")
        made_by = rasterizer.renderer_name
    seconds = time.perf_counter() - start
    notes = [*film.notes, *_notes(records)]
    write_sidecar(sidecar, _record(stage, made_by, records, notes, seconds))
    if not quiet:
        _report(stage, records, notes, seconds, sidecar)


def _frame_record(frame: Frame, encode_seconds: float) -> dict[str, Any]:
    return {
        "frame": frame.number,
        "tolerance": frame.tolerance,
        "cells": frame.num_cells,
        "splats": frame.num_splats,
        "seconds": frame.seconds | {"encode": encode_seconds},
    }


def _record(
    stage: Stage, made_by: str, frames: list[dict[str, Any]], notes: Sequence[str], seconds: float
) -> dict[str, Any]:
    """The sidecar: the scene with all defaults, what it met, and what it cost."""
    from renderer.pipeline import finest_level_at  # noqa: PLC0415

    volume, pyramid = stage.volume, stage.pyramid
    finest_level = min(finest_level_at(stage, frame["tolerance"]) for frame in frames)
    return {
        "scene": scene_to_dict(stage.scene),
        "volume": {
            "name": volume.name,
            "fingerprint": volume.fingerprint,
            "dtype": str(volume.values.dtype),
            "shape": volume.shape_xyz,
            "world_from_index": volume.world_from_index,
        },
        "camera": {"target": stage.target, "distance": stage.distance},
        "pyramid": {"levels": pyramid.num_levels, "bytes": pyramid.num_bytes, "finest_level_drawn": finest_level},
        "gl": made_by,
        "versions": package_versions(),
        "notes": list(notes),
        "seconds": stage.seconds | {"total": seconds},
        "frames": frames,
    }


def _notes(frames: list[dict[str, Any]]) -> list[str]:
    """What the user should know about the pictures."""
    if all(frame["cells"] == 0 for frame in frames):
        return [
            "nothing is visible: the transfer function hides every voxel; `hsplat info` shows which values there are"
        ]
    empty = [frame["frame"] for frame in frames if frame["splats"] == 0]
    if not empty:
        return []
    return [f"nothing is in view on {len(empty)} of {len(frames)} frames, the first of them frame {empty[0]}"]


def _report(stage: Stage, records: list[dict[str, Any]], notes: Sequence[str], seconds: float, sidecar: Path) -> None:
    """What was made and what it cost, in a few lines."""
    num = len(records)
    counts = sorted({record["splats"] for record in records})
    splats = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    click.echo(f"{stage.scene.output.file}: {num} frame{'s' * (num > 1)} in {seconds:.1f} s, {splats} splats a frame")
    for note in notes:
        click.echo(f"note: {note}")
    click.echo(f"how it was made: {sidecar}")
