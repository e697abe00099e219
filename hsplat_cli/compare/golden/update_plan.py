"""Plan the update of a folder of goldens from newly rendered frames."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hsplat_cli.compare.golden.provenance import PROVENANCE_FILE, Golden, Provenance, describe_changes
from hsplat_cli.compare.golden.render import RenderedFrames
from hsplat_cli.compare.picture_file import read_picture
from hsplat_cli.terminal import counted, first_few, format_table
from renderer.errors import InputError
from renderer.film import file_digest, translate_os_errors
from renderer.study import COMPARISON_METRICS, FrameDifference

# Metrics that need only numpy; changes are sorted by the first, then by the next.
_FIGURES = ("largest", "densest", "p99", "bias")
_MAX_LINES = 20
_MAX_NAMES = 5


@dataclass(frozen=True)
class GoldenChange:
    """A golden to write.

    why: `is new`, or why it cannot be compared with the existing one. figures: errors against the existing one, by the
    names of COMPARISON_METRICS; empty with a `why`.
    """

    file: str
    why: str = ""
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class GoldenUpdate:
    """The update of a folder.

    before, after: content of golden.json; no `before` for the first goldens.
    sources: rendered picture of each golden to write, by its file name. changes: of the same files, worst first.
    removed: goldens to remove. unrequested: goldens that are kept although their frames are not requested.
    num_requested: number of rendered frames.
    """

    before: Provenance | None
    after: Provenance
    sources: Mapping[str, Path]
    changes: Sequence[GoldenChange]
    removed: Sequence[Golden]
    unrequested: Sequence[Golden]
    num_requested: int

    @property
    def changes_anything(self) -> bool:
        """Whether anything is written. A new date, version or driver alone is not: the pictures' origin stays."""
        return bool(self.changes or self._scene_changes()) or self._previous_goldens != self.after.goldens

    def require_one_origin(self, folder: Path) -> None:
        """Raise InputError if goldens of another scene or volume would stay: golden.json has one origin for all."""
        if self.unrequested and (other := self._scene_changes()):
            raise InputError(
                f"goldens of another origin would stay, and {PROVENANCE_FILE} has one origin for all",
                where=str(folder),
                got=other,
                hint=f"update all frames, or remove the others by --prune: {_names(self.unrequested)}",
            )

    def _scene_changes(self) -> str:
        """Describe changes of the scene or the volume."""
        return "" if self.before is None else describe_changes(self.before.origin, self.after.origin, "volume", "scene")

    @property
    def _previous_goldens(self) -> tuple[Golden, ...]:
        return () if self.before is None else self.before.goldens


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
    listed = {} if before is None else {golden.frame: golden for golden in before.goldens}
    found = {
        frame: _compare(folder / name, rendered.files[frame], is_new=frame not in listed)
        for frame, name in names.items()
    }
    sources = {names[frame]: rendered.files[frame] for frame, change in found.items() if change is not None}
    goldens = []
    for frame, name in names.items():
        source = sources.get(name, folder / name)
        with translate_os_errors(source):
            drawn_on = date if name in sources else listed[frame].date
            goldens.append(Golden(frame, name, file_digest(source), drawn_on))
    others = [golden for frame, golden in listed.items() if frame not in names]
    stays = {golden: not prune and os.path.lexists(folder / golden.file) for golden in others}
    unrequested = [golden for golden in others if stays[golden]]
    removed = [golden for golden in others if not stays[golden]]
    listed_after = tuple(sorted([*goldens, *unrequested], key=lambda golden: golden.frame))
    after = Provenance(rendered.origin, listed_after)
    worst_first = sorted(
        (change for change in found.values() if change is not None), key=_change_sort_key, reverse=True
    )
    return GoldenUpdate(before, after, sources, worst_first, removed, unrequested, len(names))


def _compare(path: Path, source: Path, *, is_new: bool) -> GoldenChange | None:
    """Compare a rendered picture with the existing golden; return None if all pixels are equal."""
    if is_new or not os.path.lexists(path):
        return GoldenChange(path.name, "is new" if is_new else "is missing")
    try:
        golden = read_picture(path)
    except InputError as error:
        return GoldenChange(path.name, f"cannot be read: {error.what}")
    actual = read_picture(source)
    if golden.shape != actual.shape:
        return GoldenChange(path.name, f"changes from {_shape(golden.shape)} to {_shape(actual.shape)}")
    if np.array_equal(golden, actual):
        return None
    return GoldenChange(path.name, figures=FrameDifference(golden, actual).metrics(_FIGURES))


def _shape(shape: tuple[int, ...]) -> str:
    height, width, channels = shape
    return f"{width} x {height} {'RGB' if channels == 3 else 'RGBA'}"


def _change_sort_key(change: GoldenChange) -> tuple[bool, list[float]]:
    return bool(change.why), [change.figures.get(name, 0.0) for name in _FIGURES]


def describe_update(plan: GoldenUpdate) -> Iterator[str]:
    """Return lines for the terminal: changes and their size, removed and kept goldens, and the probable cause."""
    assert plan.before is not None, "first goldens are not an update"
    num_changes, num_requested = len(plan.changes), plan.num_requested
    frames = counted(num_requested, "frame")
    if num_changes:
        yield f"{num_changes} of {frames} change{'s' * (num_changes == 1)}:"
        yield from _lines_of(plan.changes)
    else:
        yield f"no pixel of {frames} changes"
    if plan.removed:
        yield f"to be removed, because not requested: {_names(plan.removed)}"
    yield from unrequested_lines(plan)
    if not (num_changes or plan.removed) and plan.before.goldens != plan.after.goldens:
        yield f"{PROVENANCE_FILE} changes: the files differ from those it lists"
    cause = describe_changes(plan.before.origin, plan.after.origin)
    if cause:
        yield f"changed since they were rendered: {cause}"


def unrequested_lines(plan: GoldenUpdate) -> Iterator[str]:
    """Return a line on goldens that are not requested and stay."""
    if plan.unrequested:
        yield f"not requested, and kept (--prune removes them): {_names(plan.unrequested)}"


def _lines_of(all_changes: Sequence[GoldenChange]) -> Iterator[str]:
    shown = all_changes[:_MAX_LINES]
    yield from (f"  {change.file} {change.why}" for change in shown if change.why)
    measured = [change for change in shown if change.figures]
    if measured:
        header = ["levels, worst first", *(f"{name:>8}" for name in _FIGURES)]
        rows = [[change.file, *(f"{change.figures[name]:.3g}" for name in _FIGURES)] for change in measured]
        table = format_table([header, *rows], right_aligned=range(1, len(header)))
        yield from (f"  {line}" for line in table.splitlines())
    if len(all_changes) > len(shown):
        yield f"  and {len(all_changes) - len(shown)} more, none of which changes more"
    if not all(any(change.figures.values()) for change in measured):
        yield "  0 everywhere: only colours at an alpha of 0 differ"
    if measured:
        yield from (f"  {name}: {COMPARISON_METRICS[name].label}" for name in _FIGURES)


def _names(goldens: Sequence[Golden]) -> str:
    return first_few([golden.file for golden in goldens], _MAX_NAMES)
