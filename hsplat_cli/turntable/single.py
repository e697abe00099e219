"""One volume: its scene, written beside its film, and the film, made from that scene as `hsplat render` does it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from hsplat_cli.crew_options import CrewSpec
from hsplat_cli.first_run import tell_first_run
from hsplat_cli.job import Job, load_job
from hsplat_cli.scene_text import FilmOptions, volume_file
from hsplat_cli.suggested_scene import SuggestedScene, suggest_scene
from renderer.errors import HsplatError, InputError
from renderer.output_files import sidecar_path
from renderer.scene import VolumeSpec
from renderer.staging import explained, require_writable, write_staged

Record = dict[str, Any]


@dataclass(frozen=True)
class Order:
    """A film to be made. scene: the file that it is described in.

    force: an edited scene there may be lost, and what was drawn is drawn again.
    """

    volume: VolumeSpec
    film: FilmOptions
    colormap: str | None
    scene: Path
    output: Path
    crew: CrewSpec
    force: bool

    def record(self, status: str) -> Record:
        """What the report says about it in any case."""
        return {
            "volume": str(volume_file(self.volume)),
            "scene": str(self.scene),
            "film": str(self.output),
            "status": status,
        }

    def failed(self, error: HsplatError) -> Record:
        """The record of a film that could not be made."""
        return self.record("failed") | {"exit_code": exit_code(error), "error": str(error)}


def exit_code(error: HsplatError) -> int:
    """2 where the input was wrong, else 1."""
    return 2 if isinstance(error, InputError) else 1


def make_film(order: Order, *, quiet: bool) -> Record:
    """Write the scene, render it, and say what came of it. Raises HsplatError."""
    # Before the volume is read, as that may take long.
    require_writable(order.scene)
    suggested = suggest_scene(order.volume, order.film, colormap=order.colormap, scene=order.scene, output=order.output)
    if not quiet:
        click.echo(f"{volume_file(order.volume)}: {suggested.kind}; {suggested.reason}", err=True)
    write_scene(order, suggested)
    tell_first_run(quiet=quiet)
    # Imported here: numba and GL take longer to load than --help may take to answer.
    from hsplat_cli.render.film import render_once  # noqa: PLC0415

    job = load_job(order.scene)
    shortfall = render_once(job, order.crew, force=order.force, quiet=quiet)
    if shortfall is not None:
        raise shortfall
    return order.record("done") | {"kind": suggested.kind, "reason": suggested.reason} | _cost(job)


def write_scene(order: Order, suggested: SuggestedScene) -> None:
    """Write the scene's file, unless there is one already that somebody has changed; then raise InputError."""
    content = suggested.text.encode()
    with explained(order.scene):
        there = order.scene.read_bytes() if order.scene.exists() else None
    if there == content:
        return
    if there is not None and not order.force:
        raise InputError(
            "there is another scene of this name, perhaps one that was changed by hand",
            where=str(order.scene),
            hint=f"`hsplat render {order.scene}` renders it as it is; --force writes over it",
        )
    write_staged(order.scene, content)


def _cost(job: Job) -> Record:
    """Frames, the mean number of splats and seconds, from the file beside the film."""
    told = json.loads(sidecar_path(job.scene, job.frames).read_text(encoding="utf-8"))
    frames = told["frames"]
    return {
        "frames": len(frames),
        "splats": round(sum(frame["splats"] for frame in frames) / max(1, len(frames))),
        "seconds": round(told["seconds"]["total"], 3),
    }


def tell_result(order: Order, *, quiet: bool) -> None:
    """Make the film on behalf of a batch, and print its record as a last line of JSON, also where it failed."""
    try:
        record = make_film(order, quiet=quiet)
    except HsplatError as error:
        record = order.failed(error)
    click.echo(json.dumps(record))
