"""Write goldens: the first ones, or new ones after the user has seen what changes.

All files change together at the end, in an order that survives a kill at any moment: removed goldens first, then
golden.json, then the new goldens. After a kill golden.json may list a missing or outdated golden, which the next update
repairs, but it never misses one, which no update would touch.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import click

from hsplat_cli.compare.golden.provenance import (
    PROVENANCE_FILE,
    golden_file_name,
    provenance_bytes,
    read_provenance,
)
from hsplat_cli.compare.golden.render import rendered_frames
from hsplat_cli.compare.golden.update_plan import GoldenUpdate, describe_update, plan_update
from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import Reporter, counted, deferrable_interrupts
from renderer.errors import InputError
from renderer.film import folder_files, lock_slots, require_no_input, staged_files, translate_os_errors

_STAGING_FOLDER = "golden.unfinished"


@dataclass(frozen=True)
class GoldenOptions:
    """Holds the options of `hsplat golden`.

    frames: None for those that are golden already, or for all frames at first.
    """

    folder: Path
    frames: Sequence[int] | None = None
    date: str | None = None
    update: bool = False
    prune: bool = False
    yes: bool = False


def update_goldens(
    job: Job, golden_options: GoldenOptions, executor: ExecutorSpec, reporter: Reporter, ask: Callable[[], bool]
) -> None:
    """Render the frames and keep them; existing goldens change only if `ask` returns True.

    Raises InputError if goldens exist and no update is requested, if inputs or other files have their names, or if
    goldens of another scene would stay; the errors of rendering and writing; and click's Exit with 1 if the user
    declines.
    """
    folder = golden_options.folder
    with lock_slots(folder / _STAGING_FOLDER, [0], folder / PROVENANCE_FILE):
        provenance = read_provenance(folder) if os.path.lexists(folder / PROVENANCE_FILE) else None
        if provenance is not None and not golden_options.update:
            raise InputError(
                "the folder has goldens",
                where=str(folder),
                got=counted(len(provenance.goldens), "frame"),
                hint="--update shows what has changed and overwrites them; `hsplat compare SCENE FOLDER` compares",
            )
        listed = {golden.frame: golden.file for golden in provenance.goldens} if provenance else {}
        frames = golden_options.frames or [frame for frame in job.frames if frame in listed] or job.frames
        num_frames = job.scene.camera.path.frames
        names = {frame: listed.get(frame) or golden_file_name(frame, num_frames) for frame in frames}
        outputs = (folder / name for name in (PROVENANCE_FILE, *names.values(), *listed.values()))
        require_no_input(chain(outputs, folder_files(folder / _STAGING_FOLDER)), job.input_files())
        _require_free(folder, [name for name in names.values() if name not in listed.values()])
        with rendered_frames(job, frames, executor, reporter) as rendered:
            plan = plan_update(
                folder, provenance, names, rendered, date=golden_options.date, prune=golden_options.prune
            )
            plan.require_one_origin(folder)
            must_ask = provenance is not None and plan.changes_anything and not golden_options.yes
            for line in (*(f"note: {note}" for note in rendered.notes), *describe_update(plan)):
                (reporter.result if must_ask else reporter.line)(line)
            if not plan.changes_anything:
                reporter.line(f"{folder}: nothing changes")
                return
            if must_ask and not ask():
                reporter.result("nothing was written")
                raise click.exceptions.Exit(1)
            _apply(plan, folder)
    num_written, num_goldens = len(plan.changes), len(plan.after.goldens)
    goldens = counted(num_goldens, "golden")
    written = goldens if num_written == num_goldens else f"{num_written} of {goldens} written"
    reporter.line(f"{folder}: {written}")
    reporter.line(f"origin: {folder / PROVENANCE_FILE}")


def _apply(plan: GoldenUpdate, folder: Path) -> None:
    with deferrable_interrupts() as defer_interrupts, staged_files(folder / _STAGING_FOLDER) as write:
        write(folder / PROVENANCE_FILE, provenance_bytes(plan.after))
        for name, source in sorted(plan.sources.items()):
            with translate_os_errors(source):
                content = source.read_bytes()
            write(folder / name, content)
        defer_interrupts()
        for golden in plan.removed:
            with translate_os_errors(folder / golden.file):
                (folder / golden.file).unlink(missing_ok=True)


def _require_free(folder: Path, new_names: Iterable[str]) -> None:
    """Raise InputError if a new golden would overwrite a file."""
    foreign = [name for name in new_names if os.path.lexists(folder / name)]
    if foreign:
        raise InputError(
            f"a golden would overwrite a file that {PROVENANCE_FILE} does not list",
            where=str(folder / foreign[0]),
            got=f"{len(foreign)} such files" if len(foreign) > 1 else None,
            hint="move it elsewhere, or choose another folder",
        )
