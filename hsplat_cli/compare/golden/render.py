"""The frames of a scene as files, for the moment: drawn in the one way of the program, as `hsplat render` does it."""

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
from renderer.scene import AccuracyGoal, Scene, TimeBudget

_TEMPLATE = Path("frame-{frame}.png")


@dataclass(frozen=True)
class RenderedFrames:
    """Frames that were drawn. files: by number. origin: as in Provenance. notes: what the user should know."""

    files: Mapping[int, Path]
    origin: Mapping[str, Any]
    notes: Sequence[str]


def load_reproducible_job(scene: Path, *, overrides: Sequence[str] = (), volume: Path | None = None) -> Job:
    """The job of a scene or of a film's sidecar, with all frames that it has, as `load_job`.

    Raises InputError where a frame is not the same each time and whatever other frames are drawn, or too large to be
    read again.
    """
    job = load_job(scene, overrides=overrides, volume=volume, output=_TEMPLATE, draws="nothing")
    _require_reproducible(job.scene, scene)
    width, height = job.scene.output.size
    if width * height > MAX_PIXELS:
        got, expected = f"{width} x {height}", f"at most {MAX_PIXELS} pixels, as 8192 x 4096"
        raise InputError("too large to be compared", where=f"{scene}: output.size", got=got, expected=expected)
    return job


def _require_reproducible(scene: Scene, path: Path) -> None:
    goal = scene.error.goal
    if isinstance(goal, TimeBudget):
        what, where = "frames on a budget of time are others each time", "error.seconds"
    elif isinstance(goal, AccuracyGoal):
        what, where = "what is drawn for an accuracy depends on which frames are drawn", f"error.{goal.metric}"
    else:
        return
    raise InputError(
        f"{what}, and cannot be golden",
        where=f"{path}: {where}",
        hint="render a film, and give the JSON file beside it in place of the scene: it has tolerances",
    )


@contextlib.contextmanager
def rendered_frames(
    job: Job, frames: Sequence[int], executor: ExecutorSpec, *, quiet: bool
) -> Iterator[RenderedFrames]:
    """These frames of a job of `load_reproducible_job`, in a folder that is gone after the block. Raises HsplatError.

    Nothing is said but how far the work is, and not even that when `quiet`.
    """
    # Imported here: who compares files needs neither numba nor GL.
    from hsplat_cli.films import render_film

    with _temporary_folder() as folder:
        output = replace(job.scene.output, file=folder / _TEMPLATE)
        job = replace(job, scene=replace(job.scene, output=output), frames=frames)
        film = render_film(job, executor, Reporter(quiet), is_auxiliary=True)
        assert film.shortfall is None, "there is no goal that could be missed"
        files = {frame: folder / _TEMPLATE.name.format(frame=frame) for frame in frames}
        yield RenderedFrames(files, origin_from_sidecar(film.record), film.notes)


@contextlib.contextmanager
def _temporary_folder() -> Iterator[Path]:
    try:
        folder = tempfile.TemporaryDirectory(prefix="hsplat-golden-")
    except OSError as error:
        hint = "the environment variable TMPDIR names another place"
        raise RenderError("no folder for frames can be made", got=error.strerror or str(error), hint=hint) from error
    with folder as name:
        yield Path(name)
