"""Render frames of a scene to temporary files, as `hsplat render` does."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hsplat_cli.compare.golden.provenance import origin_from_sidecar
from hsplat_cli.compare.picture_file import MAX_PIXELS
from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.scenes import Job, load_job
from hsplat_cli.terminal import Reporter
from renderer.errors import InputError, RenderError
from renderer.scene import MetricTarget, TimeBudget, schedule_to_dict

_TEMPLATE = Path("frame-{frame}.png")


@dataclass(frozen=True)
class RenderedFrames:
    """Rendered frames. files: by number. origin: as in Provenance. notes: for the user."""

    files: Mapping[int, Path]
    origin: Mapping[str, Any]
    notes: Sequence[str]


def load_numbered_job(scene: Path, *, overrides: Sequence[str] = (), volume: Path | None = None) -> Job:
    """Load the job of a scene, or of a film's sidecar, with all frames, as numbered pictures."""
    return load_job(scene, overrides=overrides, volume=volume, output=_TEMPLATE, draws="nothing")


def load_reproducible_job(scene: Path, *, overrides: Sequence[str] = (), volume: Path | None = None) -> Job:
    """Load a job as `load_numbered_job`.

    Raises InputError if frames depend on the machine's speed or on other frames, or are too large to be read again.
    """
    job = load_numbered_job(scene, overrides=overrides, volume=volume)
    reasons = {
        TimeBudget: "frames within a time budget differ from run to run",
        MetricTarget: "frames for an accuracy depend on the other frames",
    }
    why = reasons.get(type(job.scene.error.goal))
    if why:
        (key,) = schedule_to_dict(job.scene.error)
        raise InputError(
            f"{why}, and cannot be golden",
            where=f"{scene}: error.{key}",
            hint="render a film, and give the JSON file beside it in place of the scene: it has tolerances",
        )
    width, height = job.scene.output.size
    if width * height > MAX_PIXELS:
        got, expected = f"{width} x {height}", f"at most {MAX_PIXELS} pixels, as 8192 x 4096"
        raise InputError("too large to be compared", where=f"{scene}: output.size", got=got, expected=expected)
    return job


@contextlib.contextmanager
def rendered_frames(
    job: Job, frames: Sequence[int], executor: ExecutorSpec, reporter: Reporter
) -> Iterator[RenderedFrames]:
    """Render frames of a job of `load_reproducible_job` to a folder that lasts for the block. Raises HsplatError."""
    # Imported here: comparing files needs neither numba nor GL.
    from hsplat_cli.films import render_film

    try:
        temporary_folder = tempfile.TemporaryDirectory(prefix="hsplat-golden-")
    except OSError as error:
        hint = "set the environment variable TMPDIR to another folder"
        raise RenderError(
            "cannot create a temporary folder for frames", got=error.strerror or str(error), hint=hint
        ) from error
    with temporary_folder as folder:
        template = Path(folder) / _TEMPLATE
        output = replace(job.scene.output, file=template)
        job = replace(job, scene=replace(job.scene, output=output), frames=frames)
        film = render_film(job, executor, reporter, is_auxiliary=True)
        assert film.shortfall is None, "a reproducible job has no goal to miss"
        files = {frame: template.with_name(template.name.format(frame=frame)) for frame in frames}
        yield RenderedFrames(files, origin_from_sidecar(film.record), film.record["notes"])
