"""What becomes of a folder of goldens when a scene is drawn again: new ones, others, the same, and nobody's."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hsplat_cli.compare.golden.provenance import PROVENANCE_FILE, Golden, Provenance, describe_changes
from hsplat_cli.compare.golden.render import RenderedFrames
from hsplat_cli.compare.picture_file import read_picture
from hsplat_cli.terminal import counted, first_few
from renderer.errors import InputError
from renderer.film import file_digest, translate_os_errors
from renderer.study import COMPARISON_METRICS, FrameDifference

# Those that need no more than numpy; the worst is the one whose first figure is, then by the next.
_FIGURES = ("largest", "densest", "p99", "bias")
_MAX_LINES = 20
_MAX_NAMES = 5


@dataclass(frozen=True)
class GoldenChange:
    """A golden that is to be written.

    why: that it is new, or cannot be compared with the one that is there: `is new`.
    figures: how far it is from the one that is there, by the names of COMPARISON_METRICS; none with a `why`.
    """

    file: str
    why: str = ""
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class GoldenUpdate:
    """before, after: what golden.json tells; nothing before the first goldens.

    sources: where the pictures that are to be written are, by the names that they get.
    changes: of the same files, worst first. removed: goldens that go; unasked: those that nobody asks for, and stay.
    num_asked: frames that were drawn.
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
        """Whether there is something to write.

        Where no picture changes, another date, version or driver is nothing: goldens were drawn when golden.json says,
        and by what.
        """
        return bool(self.changes or self._scene_changes()) or self._previous_goldens != self.after.goldens

    def require_one_origin(self, folder: Path) -> None:
        """Raise InputError where goldens stay that were drawn from another scene or volume than golden.json would say:
        it has one origin for all of them."""
        if self.unrequested and (other := self._scene_changes()):
            raise InputError(
                f"goldens would stay that were not drawn from what {PROVENANCE_FILE} would say",
                where=str(folder),
                got=other,
                hint=f"update all frames; or --prune removes the others: {_names(self.unrequested)}",
            )

    def _scene_changes(self) -> str:
        """In what the scene or the volume is not what it was."""
        return "" if self.before is None else describe_changes(self.before.origin, self.after.origin, "volume", "scene")

    @property
    def _previous_goldens(self) -> tuple[Golden, ...]:
        return () if self.before is None else self.before.goldens


def plan_update(
    folder: Path,
    before: Provenance | None,
    names: Mapping[int, str],
    drawing: RenderedFrames,
    *,
    date: str | None,
    prune: bool,
) -> GoldenUpdate:
    """What is to be done so that `folder` has the frames that were drawn.

    names: of the files of all frames that are asked for. date: of those whose pictures change; the others keep theirs.
    prune: remove goldens of other frames.
    """
    listed = {} if before is None else {golden.frame: golden for golden in before.goldens}
    found = {
        frame: _change(folder / name, drawing.files[frame], is_new=frame not in listed) for frame, name in names.items()
    }
    sources = {names[frame]: drawing.files[frame] for frame, change in found.items() if change is not None}
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
    after = Provenance(drawing.origin, listed_after)
    worst_first = sorted(
        (change for change in found.values() if change is not None), key=_change_sort_key, reverse=True
    )
    return GoldenUpdate(before, after, sources, worst_first, removed, unrequested, len(names))


def _change(path: Path, source: Path, *, is_new: bool) -> GoldenChange | None:
    """What distinguishes a picture that was drawn from the golden that is there; None if no pixel does."""
    if is_new or not os.path.lexists(path):
        return GoldenChange(path.name, "is new" if is_new else "is not there any more")
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


# In words


def describe_update(plan: GoldenUpdate) -> Iterator[str]:
    """Lines for the terminal: what changes and how much, what goes, what stays, and what may be the cause."""
    assert plan.before is not None, "first goldens are no change"
    num_changes, num_requested = len(plan.changes), plan.num_requested
    frames = counted(num_requested, "frame")
    if num_changes:
        yield f"{num_changes} of {frames} change{'s' * (num_changes == 1)}:"
        yield from _lines_of(plan.changes)
    else:
        yield f"no pixel of {frames} changes"
    if plan.removed:
        yield f"to be removed, for nobody asks for {_them(plan.removed)}: {_names(plan.removed)}"
    yield from unrequested_lines(plan)
    if not (num_changes or plan.removed) and plan.before.goldens != plan.after.goldens:
        yield f"{PROVENANCE_FILE} changes: the files are others than it tells of"
    cause = describe_changes(plan.before.origin, plan.after.origin)
    if cause:
        yield f"what has changed since they were drawn: {cause}"


def unrequested_lines(plan: GoldenUpdate) -> Iterator[str]:
    """What is said about goldens that nobody asks for and that stay, if there are any."""
    if plan.unrequested:
        yield f"not asked for, and left as they are (--prune removes them): {_names(plan.unrequested)}"


def _lines_of(all_changes: Sequence[GoldenChange]) -> Iterator[str]:
    shown = all_changes[:_MAX_LINES]
    yield from (f"  {change.file} {change.why}" for change in shown if change.why)
    measured = [change for change in shown if change.figures]
    if measured:
        rows = [_FIGURES, *([f"{change.figures[name]:.3g}" for name in _FIGURES] for change in measured)]
        files = ["levels, worst first", *(change.file for change in measured)]
        width = max(map(len, files))
        for file, row in zip(files, rows, strict=True):
            yield f"  {file:<{width}}" + "".join(f"  {cell:>8}" for cell in row)
    if len(all_changes) > len(shown):
        yield f"  and {len(all_changes) - len(shown)} more, none of which changes more"
    if not all(any(change.figures.values()) for change in measured):
        yield "  0 in all: only colours at an alpha of 0 differ"
    if measured:
        yield from (f"  {name}: {COMPARISON_METRICS[name].label}" for name in _FIGURES)


def _names(goldens: Sequence[Golden]) -> str:
    return first_few([golden.file for golden in goldens], _MAX_NAMES)


def _them(goldens: Sequence[Golden]) -> str:
    return "it" if len(goldens) == 1 else "them"
