"""Plan the update of a folder of goldens from newly rendered frames."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hsplat_cli.compare.golden.provenance import PROVENANCE_FILE, Golden, Provenance, describe_changes
from hsplat_cli.compare.golden.render import RenderedFrames
from hsplat_cli.compare.outcome import Outcome, Pair, compare_pair
from hsplat_cli.compare.picture_file import read_picture
from hsplat_cli.terminal import counted, first_few, format_table
from renderer.errors import InputError
from renderer.film import file_digest, translate_os_errors
from renderer.study import COMPARISON_METRICS

# Metrics that need only numpy. No change is allowed.
_LIMITS = {"largest": 0.0, "densest": 0.0, "p99": 0.0, "bias": 0.0}
_MAX_LINES = 20
_MAX_NAMES = 5


@dataclass(frozen=True)
class GoldenUpdate:
    """The update of a folder.

    before, after: content of golden.json; no `before` for the first goldens. changes: goldens to write, worst first.
    sources: their pictures, by the name of the golden. removed: goldens to remove. unrequested: goldens that are kept
    although their frames are not requested.
    """

    before: Provenance | None
    after: Provenance
    changes: Sequence[Outcome]
    sources: Mapping[str, Path]
    removed: Sequence[Golden]
    unrequested: Sequence[Golden]

    @property
    def changes_anything(self) -> bool:
        """Return whether anything is written. A new date, version or driver alone is not: the pictures keep theirs."""
        is_listed = self.before is not None and self.before.goldens == self.after.goldens
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
        """Return the changes of the scene or the volume, in words."""
        return "" if self.before is None else describe_changes(self.before.origin, self.after.origin, "volume", "scene")


def plan_update(
    folder: Path,
    before: Provenance | None,
    names: Mapping[int, str],
    rendered: RenderedFrames,
    *,
    date: str | None,
    prune: bool,
) -> GoldenUpdate:
    """Plan to give `folder` the rendered frames.

    names: file names of all requested frames. date: of changed pictures; the others keep theirs. prune: remove goldens
    of other frames.
    """
    listed = {golden.frame: golden for golden in before.goldens} if before else {}
    changes: list[Outcome] = []
    sources: dict[str, Path] = {}
    goldens: list[Golden] = []
    for frame, name in names.items():
        change = _compare(folder / name, rendered.files[frame], is_new=frame not in listed)
        path = folder / name
        if change.status != "same":
            changes.append(change)
            path = sources[name] = rendered.files[frame]
        with translate_os_errors(path):
            goldens.append(Golden(frame, name, file_digest(path), date if name in sources else listed[frame].date))
    others = [golden for frame, golden in listed.items() if frame not in names]
    removed = [golden for golden in others if prune or not os.path.lexists(folder / golden.file)]
    unrequested = [golden for golden in others if golden not in removed]
    after = Provenance(rendered.origin, tuple(sorted([*goldens, *unrequested], key=lambda golden: golden.frame)))
    changes.sort(key=lambda change: [-change.figures.get(name, math.inf) for name in _LIMITS])
    return GoldenUpdate(before, after, changes, sources, removed, unrequested)


def _compare(path: Path, source: Path, *, is_new: bool) -> Outcome:
    """Compare a rendered picture with the existing golden."""
    if is_new or not os.path.lexists(path):
        return Outcome(path.name, "extra", "is new" if is_new else "is missing")
    try:
        golden = read_picture(path)
    except InputError as error:
        return Outcome(path.name, "missing", f"cannot be read: {error.what}")
    return compare_pair(Pair(path.name, golden, read_picture(source)), _LIMITS)


def describe_update(plan: GoldenUpdate) -> Iterator[str]:
    """Return lines for the terminal: changes and their size, removed and kept goldens, and the probable cause."""
    kept = [f"not requested, and kept (--prune removes them): {_names(plan.unrequested)}"] * bool(plan.unrequested)
    if plan.before is None or not plan.changes_anything:
        yield from kept
        return
    num_changes, frames = len(plan.changes), counted(len(plan.after.goldens) - len(plan.unrequested), "frame")
    if num_changes:
        yield f"{num_changes} of {frames} change{'s' * (num_changes == 1)}:"
        yield from _lines_of(plan.changes)
    else:
        yield f"no pixel of {frames} changes"
    if plan.removed:
        yield f"to be removed, because not requested: {_names(plan.removed)}"
    yield from kept
    if not (num_changes or plan.removed) and plan.before.goldens != plan.after.goldens:
        yield f"{PROVENANCE_FILE} changes: the files differ from those it lists"
    cause = describe_changes(plan.before.origin, plan.after.origin)
    if cause:
        yield f"changed since they were rendered: {cause}"


def _lines_of(all_changes: Sequence[Outcome]) -> Iterator[str]:
    shown = all_changes[:_MAX_LINES]
    measured = [change for change in shown if change.figures]
    yield from (f"  {change.name}: {change.why}" for change in shown if not change.figures)
    if measured:
        header = ["levels, worst first", *(f"{name:>8}" for name in _LIMITS)]
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
