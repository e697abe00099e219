"""Goldens are written: the first ones, or others in their place once the user has seen what changes.

Files change together at the end, in an order in which a kill at any moment leaves what the next update repairs:
goldens that go are removed first, then golden.json tells of the new ones, then these get their names. So golden.json
may tell of a golden that is not there or not what it should be, but there is never one that it does not tell of, which
no update would touch.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from hsplat_cli.compare.golden.provenance import (
    PROVENANCE_FILE,
    Golden,
    Provenance,
    golden_file_name,
    provenance_bytes,
    read_provenance,
)
from hsplat_cli.compare.golden.render import RenderedFrames, rendered_frames
from hsplat_cli.compare.golden.update_plan import GoldenUpdate, describe_update, plan_update, unrequested_lines
from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import counted, deferrable_interrupts
from renderer.errors import InputError
from renderer.film import lock_slots, staged_files, translate_os_errors
from renderer.scene import MAX_SCENE_BYTES

_STAGING_FOLDER = "golden.unfinished"
_LIMITS = "compare.yaml"  # read by `hsplat compare`, which goldens do without


@dataclass(frozen=True)
class GoldenOptions:
    """What the user asks for: goldens of these frames in this folder. The rest is as on the command line.

    frames: None for those that are golden already, or where there are none for all that the scene has.
    """

    folder: Path
    frames: Sequence[int] | None = None
    date: str | None = None
    update: bool = False
    prune: bool = False
    yes: bool = False
    quiet: bool = False


def update_goldens(job: Job, golden_options: GoldenOptions, executor: ExecutorSpec, ask: Callable[[], bool]) -> None:
    """Draw the frames and keep them; where there are goldens already, only once `ask` says so.

    Raises InputError where there are goldens and nobody wants an update, other files of their names, or goldens that
    would stay though the scene is another; what drawing and writing raise; and click's Exit with 1 where the user does
    not want what changes.
    """
    folder = golden_options.folder
    with lock_slots(folder / _STAGING_FOLDER, [0], folder / PROVENANCE_FILE):
        provenance = read_provenance(folder) if os.path.lexists(folder / PROVENANCE_FILE) else None
        if provenance is not None and not golden_options.update:
            raise InputError(
                "there are goldens already",
                where=str(folder),
                got=counted(len(provenance.goldens), "frame"),
                hint="--update says what has changed, and writes it over them; `hsplat compare SCENE FOLDER` compares",
            )
        frames = golden_options.frames or _default_frames(provenance, job.frames)
        names = _names(frames, provenance, job.scene.camera.path.frames)
        _require_free(folder, names.values(), provenance)
        with rendered_frames(job, frames, executor, quiet=golden_options.quiet) as drawing:
            plan = plan_update(folder, provenance, names, drawing, date=golden_options.date, prune=golden_options.prune)
            plan.require_one_origin(folder)
            must_ask = provenance is not None and plan.changes_anything and not golden_options.yes
            if must_ask or not golden_options.quiet:
                _tell(_report(plan, drawing, folder))
            if not plan.changes_anything:
                return
            if must_ask and not ask():
                _tell(["nothing was written"])
                raise click.exceptions.Exit(1)
            _apply(plan, folder)
    if not golden_options.quiet:
        num_written, num_all = len(plan.sources), len(plan.after.goldens)
        goldens = counted(num_all, "golden")
        num = goldens if num_written == num_all else f"{num_written} of {goldens} written"
        _tell([f"{folder}: {num}", f"what they were drawn from: {folder / PROVENANCE_FILE}"])


def _report(plan: GoldenUpdate, drawing: RenderedFrames, folder: Path) -> Iterator[str]:
    """What there is to say before anything is written."""
    yield from (f"note: {note}" for note in drawing.notes)
    if not plan.changes_anything:
        yield f"{folder}: nothing changes"
        yield from unrequested_lines(plan)
    elif plan.before is not None:
        yield from describe_update(plan)
        yield from _stale_limit_notes(plan.removed, folder)


def _stale_limit_notes(removed: Sequence[Golden], folder: Path) -> Iterator[str]:
    """What is said about goldens that go, and that the file of limits still names."""
    path = folder / _LIMITS
    if not path.is_file():
        return
    with translate_os_errors(path), path.open("rb") as file:
        content = file.read(MAX_SCENE_BYTES)
    named = [golden.file for golden in removed if golden.file.encode() in content]
    if named:
        yield f"{path} names them, too, and `hsplat compare` will refuse that: {', '.join(named)}"


def _apply(plan: GoldenUpdate, folder: Path) -> None:
    with deferrable_interrupts() as defer_interrupts, staged_files(folder / _STAGING_FOLDER) as write:
        write(folder / PROVENANCE_FILE, provenance_bytes(plan.after))
        for name, source in plan.sources.items():
            with translate_os_errors(source):
                content = source.read_bytes()
            write(folder / name, content)
        defer_interrupts()
        for golden in plan.removed:
            with translate_os_errors(folder / golden.file):
                (folder / golden.file).unlink(missing_ok=True)


def _tell(lines: Iterable[str]) -> None:
    for line in lines:
        click.echo(line)


def _default_frames(provenance: Provenance | None, drawable: Sequence[int]) -> Sequence[int]:
    """Those that are golden and that the scene still has; all that it has where there are none."""
    golden = frozenset() if provenance is None else frozenset(each.frame for each in provenance.goldens)
    return [frame for frame in drawable if frame in golden] or drawable


def _names(frames: Sequence[int], provenance: Provenance | None, num_frames: int) -> dict[int, str]:
    """Of the files of these frames; a golden that is there keeps the name that it has."""
    listed = {} if provenance is None else {golden.frame: golden.file for golden in provenance.goldens}
    return {frame: listed.get(frame) or golden_file_name(frame, num_frames) for frame in frames}


def _require_free(folder: Path, names: Iterable[str], provenance: Provenance | None) -> None:
    """Raise InputError where a golden would take the place of a file of somebody else."""
    own = set() if provenance is None else {golden.file for golden in provenance.goldens}
    foreign = [name for name in names if name not in own and os.path.lexists(folder / name)]
    if foreign:
        raise InputError(
            f"a golden would take the place of a file of which no {PROVENANCE_FILE} tells",
            where=str(folder / foreign[0]),
            got=f"{len(foreign)} such files" if len(foreign) > 1 else None,
            hint="move it away, or choose another folder",
        )
