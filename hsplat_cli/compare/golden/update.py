"""Write goldens: the first ones, or new ones after the user has seen the changes.

All files change together at the end, in an order that survives a kill at any moment: removed goldens first, then
golden.json, then the new goldens. After a kill golden.json may list a golden that is missing or outdated, which the
next update repairs. It never lacks a golden that is in the folder: no update would touch an unlisted file.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from hsplat_cli.compare.frame_difference import COMPARISON_METRICS
from hsplat_cli.compare.golden.provenance import (
    PROVENANCE,
    PROVENANCE_FILE,
    Golden,
    GoldenOrigin,
    Provenance,
    golden_file_name,
    origin_from_record,
)
from hsplat_cli.compare.outcome import Outcome, Pair, compare_pair
from hsplat_cli.compare.picture_file import read_picture
from hsplat_cli.compare.scene_pairs import rendered_frames
from hsplat_cli.terminal import Reporter, format_table
from renderer.errors import InputError
from renderer.film import WrittenFiles, file_digest, lock_slots, staged_files, translate_os_errors
from renderer.job import FilmJob
from renderer.scene import counted, first_few
from renderer.system import deferrable_interrupts

_STAGING_FOLDER = "golden.unfinished"
# The metrics that show how much a golden changes, all of which need only numpy. Their limits of 0 report every change.
_LIMITS = {"largest": 0.0, "densest": 0.0, "p99": 0.0, "bias": 0.0}
# Largest number of changed goldens that the terminal lists.
_MAX_LINES = 20
# Largest number of file names that one message lists.
_MAX_NAMES = 5


@dataclass(frozen=True)
class GoldenOptions:
    """The values of the options of `hsplat golden`.

    folder: the folder of the goldens. frames: the numbers of the requested frames; None for the frames that have
    goldens, or for all frames if there are no goldens. date: the date of goldens whose pictures change; unchanged
    goldens keep their dates. update: existing goldens may change. prune: goldens of frames that are not requested are
    removed. yes: existing goldens change without a question.
    """

    folder: Path
    frames: Sequence[int] | None = None
    date: str | None = None
    update: bool = False
    prune: bool = False
    yes: bool = False


def update_goldens(job: FilmJob, options: GoldenOptions, reporter: Reporter, ask: Callable[[], bool]) -> None:
    """Render the frames and keep them as goldens; existing goldens change only if `yes` is set or `ask` returns True.

    Raises InputError if goldens exist and no update is requested, if a golden would overwrite an input or another file,
    or if goldens of another scene would stay; the errors of rendering and writing; and click's Exit with 1 if the user
    declines.
    """
    folder = options.folder
    with lock_slots(folder / _STAGING_FOLDER, [0], folder / PROVENANCE_FILE):
        provenance = PROVENANCE.read(folder / PROVENANCE_FILE) if os.path.lexists(folder / PROVENANCE_FILE) else None
        if provenance is not None and not options.update:
            raise InputError(
                "the folder has goldens",
                where=str(folder),
                got=counted(len(provenance.frames), "frame"),
                hint="--update shows what has changed and overwrites them; `hsplat compare SCENE FOLDER` compares",
            )
        listed = {golden.frame: golden.file for golden in provenance.frames} if provenance else {}
        frames = options.frames or [frame for frame in job.frames if frame in listed] or job.frames
        num_frames = job.scene.num_frames
        names = {frame: listed.get(frame) or golden_file_name(frame, num_frames) for frame in frames}
        all_names = {PROVENANCE_FILE, *names.values(), *listed.values()}
        outputs = WrittenFiles([folder / name for name in sorted(all_names)], [folder / _STAGING_FOLDER])
        outputs.require_harmless(job.input_files())
        _require_free(folder, [name for name in names.values() if name not in listed.values()])
        with rendered_frames(job, frames, reporter) as (files, record):
            plan = plan_update(options, provenance, names, files, origin_from_record(record))
            plan.require_one_origin(folder)
            must_ask = provenance is not None and plan.changes_anything and not options.yes
            for line in (*(f"note: {note}" for note in record.notes), *describe_update(plan)):
                (reporter.result if must_ask else reporter.line)(line)
            if not plan.changes_anything:
                reporter.line(f"{folder}: nothing changes")
                return
            if must_ask and not ask():
                reporter.result("nothing was written")
                raise click.exceptions.Exit(1)
            _apply(plan, folder)
    num_written, num_goldens = len(plan.changes), len(plan.after.frames)
    goldens = counted(num_goldens, "golden")
    written = goldens if num_written == num_goldens else f"{num_written} of {goldens} written"
    reporter.line(f"{folder}: {written}")
    reporter.line(f"origin: {folder / PROVENANCE_FILE}")


def _apply(plan: GoldenUpdate, folder: Path) -> None:
    with deferrable_interrupts() as defer_interrupts, staged_files(folder / _STAGING_FOLDER) as write:
        write(folder / PROVENANCE_FILE, PROVENANCE.content(plan.after))
        for name, source in sorted(plan.sources.items()):
            with translate_os_errors(source):
                content = source.read_bytes()
            write(folder / name, content)
        defer_interrupts()
        for golden in plan.removed:
            with translate_os_errors(folder / golden.file):
                (folder / golden.file).unlink(missing_ok=True)


def _require_free(folder: Path, new_names: Iterable[str]) -> None:
    """Raise InputError if a new golden would overwrite a file that golden.json does not list."""
    foreign = [name for name in new_names if os.path.lexists(folder / name)]
    if foreign:
        raise InputError(
            f"a golden would overwrite a file that {PROVENANCE_FILE} does not list",
            where=str(folder / foreign[0]),
            got=f"{len(foreign)} such files" if len(foreign) > 1 else None,
            hint="move it elsewhere, or choose another folder",
        )


# The plan of an update


@dataclass(frozen=True)
class GoldenUpdate:
    """The plan of an update of a folder of goldens.

    before, after: the content of golden.json before and after the update; `before` is None for the first goldens.
    changes: the goldens that are written, the largest change first. sources: the rendered picture of each golden that
    is written, by the golden's file name. removed: goldens that leave golden.json, with their files. unrequested:
    goldens that are kept although their frames are not requested.
    """

    before: Provenance | None
    after: Provenance
    changes: Sequence[Outcome]
    sources: Mapping[str, Path]
    removed: Sequence[Golden]
    unrequested: Sequence[Golden]

    @property
    def changes_anything(self) -> bool:
        """Return whether the update writes or removes any file.

        A new date, version or driver alone is not written: unchanged goldens keep the recorded ones.
        """
        is_listed = self.before is not None and self.before.frames == self.after.frames
        return not is_listed or bool(self.changes or self._scene_changes)

    def require_one_origin(self, folder: Path) -> None:
        """Raise InputError if goldens of another scene or volume would stay: golden.json has one origin for all."""
        if self.unrequested and self._scene_changes:
            raise InputError(
                f"goldens of another origin would stay, and {PROVENANCE_FILE} has one origin for all",
                where=str(folder),
                got=self._scene_changes,
                hint=f"update all frames, or remove the others by --prune: {_names(self.unrequested)}",
            )

    @property
    def _scene_changes(self) -> str:
        """Return how scene and volume changed since the goldens were rendered, in words; empty if they did not."""
        return "" if self.before is None else self.before.changes(self.after, "volume", "scene")


def plan_update(
    options: GoldenOptions,
    before: Provenance | None,
    names: Mapping[int, str],
    files: Mapping[int, Path],
    origin: GoldenOrigin,
) -> GoldenUpdate:
    """Return the plan that makes rendered frames the goldens of a folder.

    before: the content of golden.json; None for the first goldens. names: the file name of the golden of each requested
    frame, by frame number. files: the rendered pictures, by frame number. origin: the origin of the rendered pictures.
    """
    listed = {golden.frame: golden for golden in before.frames} if before else {}
    changes: list[Outcome] = []
    sources: dict[str, Path] = {}
    goldens: list[Golden] = []
    for frame, name in names.items():
        path = options.folder / name
        change = _compare(path, files[frame], is_new=frame not in listed)
        if change.status != "same":
            changes.append(change)
            path = sources[name] = files[frame]
        date = options.date if name in sources else listed[frame].date
        with translate_os_errors(path):
            goldens.append(Golden(frame, name, file_digest(path), date))
    others = [golden for frame, golden in listed.items() if frame not in names]
    removed = [golden for golden in others if options.prune or not os.path.lexists(options.folder / golden.file)]
    unrequested = [golden for golden in others if golden not in removed]
    after = Provenance(**vars(origin), frames=tuple(sorted([*goldens, *unrequested], key=lambda golden: golden.frame)))
    changes.sort(key=lambda change: [-change.figures.get(name, math.inf) for name in _LIMITS])
    return GoldenUpdate(before, after, changes, sources, removed, unrequested)


def _compare(path: Path, source: Path, *, is_new: bool) -> Outcome:
    """Compare the rendered picture `source` with the golden `path`, which may be new, missing or unreadable."""
    if is_new or not os.path.lexists(path):
        return Outcome(path.name, "extra", "is new" if is_new else "is missing")
    try:
        golden = read_picture(path)
    except InputError as error:
        return Outcome(path.name, "missing", f"cannot be read: {error.what}")
    return compare_pair(Pair(path.name, golden, read_picture(source)), _LIMITS)


def describe_update(plan: GoldenUpdate) -> Iterator[str]:
    """Yield lines for the terminal: changes and their size, removed and kept goldens, and the probable cause."""
    kept = [f"not requested, and kept (--prune removes them): {_names(plan.unrequested)}"] * bool(plan.unrequested)
    if plan.before is None or not plan.changes_anything:
        yield from kept
        return
    num_changes, frames = len(plan.changes), counted(len(plan.after.frames) - len(plan.unrequested), "frame")
    if num_changes:
        yield f"{num_changes} of {frames} change{'s' * (num_changes == 1)}:"
        yield from _lines_of(plan.changes)
    else:
        yield f"no pixel of {frames} changes"
    if plan.removed:
        yield f"to be removed, because not requested: {_names(plan.removed)}"
    yield from kept
    if not (num_changes or plan.removed) and plan.before.frames != plan.after.frames:
        yield f"{PROVENANCE_FILE} changes: the files differ from those it lists"
    cause = plan.before.changes(plan.after)
    if cause:
        yield f"changed since they were rendered: {cause}"


def _lines_of(all_changes: Sequence[Outcome]) -> Iterator[str]:
    shown = all_changes[:_MAX_LINES]
    measured = [change for change in shown if change.figures]
    yield from (f"  {change.name}: {change.why}" for change in shown if not change.figures)
    if measured:
        header = ["steps, worst first", *(f"{name:>8}" for name in _LIMITS)]
        rows = [[change.name, *(f"{change.figures[name]:.3g}" for name in _LIMITS)] for change in measured]
        table = format_table([header, *rows], right_aligned=range(1, len(header)))
        yield from (f"  {line}" for line in table.splitlines())
    if len(all_changes) > len(shown):
        yield f"  and {len(all_changes) - len(shown)} more, none of which changes more"
    if any(change.passes for change in measured):
        yield "  0 everywhere: only colours at an alpha of 0 differ"
    if measured:
        yield from (f"  {name}: {COMPARISON_METRICS[name].label}" for name in _LIMITS)


def _names(goldens: Sequence[Golden]) -> str:
    return first_few([golden.file for golden in goldens], _MAX_NAMES)
