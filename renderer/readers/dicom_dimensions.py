"""Sort frames into volumes: by their places, and frames at one place by time, echo, stack or segment.

Places decide first: frames at evenly spaced places are one volume, whatever their fields say. Frames at one place are
distinguished by the first field of a table (`dicom_fields.py`) that divides the frames of every place alike. More
fields may divide them further: all fields of time count as one axis, and all other fields as another. Where some places
have fewer frames than others, the last volume, or the last place, was not finished: it is left out.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.readers.dicom_fields import CLOCKS, SEGMENT, STACK, Dimension
from renderer.readers.dicom_frames import Frame
from renderer.readers.dicom_places import are_one_volume, by_place, distances
from renderer.readers.steps_in_time import TimeSteps, steps_at
from renderer.scene import counted

# The index of a time, or of a component: a number for each dimension that distinguishes times, or components.
Index = tuple[int, ...]

# The frames of each volume, under the index of its time and the index of its component.
_Volumes = dict[tuple[Index, Index], list[Frame]]

# The largest number of slices of a segment, empty ones included, as a multiple of the places at which the segmentation
# has a slice. If a segment would have more slices, no empty ones are added.
_MAX_EMPTY = 64


class Sorted(NamedTuple):
    """Frames that are sorted into volumes.

    volumes: `volumes[time][component]` is a list of frames, in ascending order along their normal. by_axis: the names
    of the dimensions that distinguish times, under `t`, and components, under `c`. note: a remark on frames that are
    left out, or None.
    """

    volumes: list[list[list[Frame]]]
    by_axis: dict[str, str]
    note: str | None


def sort_frames(frames: Sequence[Frame]) -> Sorted:
    """Sort frames into volumes; raises InputError if no field distinguishes frames at one place."""
    part = SEGMENT if any(SEGMENT in frame.marks for frame in frames) else STACK
    parts = _parted(frames, part)
    if part is STACK and len(parts) > 1 and are_one_volume(frames):
        parts = [list(frames)]
    volumes: _Volumes = {}
    notes: list[str] = []
    for k, own in enumerate(parts):
        found, told_apart, note = _sort_part(_with_empty(own, frames) if part is SEGMENT else own)
        volumes |= {(time, (k, *component)): volume for (time, component), volume in found.items()}
        notes += [note] if note else []
    times, components = (sorted(set(indices)) for indices in zip(*volumes, strict=True))
    if len(volumes) < len(times) * len(components):  # segments or stacks differ in times: each time is a component
        volumes = {((), (*component, *time)): volume for (time, component), volume in volumes.items()}
        times, components = [()], sorted(component for _, component in volumes)
    told_apart = [part] * (len(parts) > 1) + told_apart
    names = {axis: " and ".join(each.name for each in told_apart if each.axis == axis) for axis in "tc"}
    by_axis = {axis: name for axis, name in names.items() if name}
    sorted_volumes = [[volumes[time, component] for component in components] for time in times]
    return Sorted(sorted_volumes, by_axis, "; ".join(dict.fromkeys(notes)) or None)


def times_of(volumes: Sequence[Sequence[Sequence[Frame]]]) -> TimeSteps:
    """Return the steps in time of `volumes[time][component]`, by the first field that gives the time of every step."""
    count = len(volumes)
    for keyword, (unit, is_clock) in CLOCKS.items():
        own = ([frame.times[keyword] for frame in volume[0] if keyword in frame.times] for volume in volumes)
        times = [min(found) for found in own if found]
        steps = steps_at(count, [time - times[0] * is_clock for time in times], unit)
        if steps.times:
            return steps
    return TimeSteps(count)


def _sort_part(frames: Sequence[Frame]) -> tuple[_Volumes, list[Dimension], str | None]:
    """Sort the frames of one segment or stack into volumes.

    Returns the volumes, the dimensions of their indices, and a note on frames that are left out, or None.
    """
    groups = by_place(frames)
    found = _told_apart(groups)
    if found is not None:
        return *found, None
    for kept, note in _without_unfinished(groups):
        found = _told_apart(by_place(kept))
        if found is not None:
            return *found, note
    same = max(groups, key=len)
    fewest, most = min(map(len, groups)), max(map(len, groups))
    why = f"; there are {fewest} to {most} at a position" if fewest < most else ", which no field tells apart"
    raise InputError(
        "two slices of this series are at the same position",
        got=f"{same[0].label} and {same[1].label}{why}",
        expected="one slice at each position, or as many at each as there are times or components",
        hint="a time series or several echoes? put each volume into its own folder",
    )


def _told_apart(groups: list[list[Frame]]) -> tuple[_Volumes, list[Dimension]] | None:
    """Return volumes of one frame from each place, and the dimensions that distinguish frames at one place.

    groups: the frames at each place. Returns None if no dimensions distinguish all frames of a place.
    """
    cells = groups
    shape: list[int] = []
    found: list[Dimension] = []
    for dimension in _dimensions_of(groups):
        # Frames without positions share one place; their order does not make them times.
        if len(cells[0]) == 1 or (dimension.is_order and len(groups) == 1):
            continue
        parted = [_parted(cell, dimension) for cell in cells]
        if len(parted[0]) > 1 and len({(len(cell), len(item)) for cell in parted for item in cell}) == 1:
            cells = [item for cell in parted for item in cell]
            shape.append(len(parted[0]))
            found.append(dimension)
    if max(map(len, cells)) > 1:
        return None
    volumes: _Volumes = defaultdict(list)
    for (_, *index), (frame,) in zip(np.ndindex(len(groups), *shape), cells, strict=True):
        time, component = (tuple(k for k, each in zip(index, found, strict=True) if each.axis == axis) for axis in "tc")
        volumes[time, component].append(frame)
    return volumes, found


def _dimensions_of(groups: Sequence[Sequence[Frame]]) -> list[Dimension]:
    """Return the dimensions (such as time or echo) in which frames of one place may differ, in the order of trial."""
    return list(dict.fromkeys(each for group in groups for frame in group for each in frame.marks))


def _without_unfinished(groups: list[list[Frame]]) -> Iterator[tuple[list[Frame], str]]:
    """Yield the frames that are kept if an unfinished part is left out, and a note on that part.

    The unfinished part is an incomplete volume, or an incomplete place at an end of the stack.
    """
    if len(groups) < 2 or len({len(group) for group in groups}) == 1:
        return
    place_of = {id(frame): place for place, group in enumerate(groups) for frame in group}
    everything = [frame for group in groups for frame in group]
    for dimension in _dimensions_of(groups):
        parts = _parted(everything, dimension)
        is_counted = dimension.is_order and len(parts) == len(everything)
        kept = (_whole_beginning if is_counted else _whole_parts)(parts, place_of, len(groups))
        if kept:
            num_left = len(everything) - len(kept)
            yield kept, f"an incomplete volume is left out: {counted(num_left, 'slice')}, by {dimension.name}"
    sizes = [len(group) for group in groups]
    for end, others in ((0, slice(1, None)), (-1, slice(None, -1))):
        kept = [frame for group in groups[others] for frame in group]
        is_short = len({*sizes[others]}) == 1 and sizes[end] < sizes[others][0]
        if is_short and any(_come_last(groups[end], kept, dimension) for dimension in _dimensions_of(groups)):
            yield kept, f"an incomplete place is left out: {sizes[end]} of {sizes[others][0]} slices there"


def _come_last(frames: Sequence[Frame], others: Sequence[Frame], dimension: Dimension) -> bool:
    """Return whether `dimension` is an order in which all of `frames` come after all of `others`."""
    if not dimension.is_order:
        return False
    marks, before = ([each.marks.get(dimension, ([], "")) for each in own] for own in (frames, others))
    return min(marks) > max(before)


def _whole_parts(parts: Sequence[list[Frame]], place_of: dict[int, int], num_places: int) -> list[Frame]:
    """Return the frames of the largest parts of a stack; an empty list if places have different numbers of frames.

    parts: the frames with each value of a dimension, such as each time. place_of: the number of the place of a
    frame, by the frame's id. num_places: the number of all places.
    """
    most = max(map(len, parts))
    nums = [Counter(place_of[id(frame)] for frame in part) for part in parts]
    largest = [(part, num) for part, num in zip(parts, nums, strict=True) if len(part) == most]
    if any(len(num) < num_places or len({*num.values()}) > 1 for _, num in largest):
        return []
    return [frame for part, _ in largest for frame in part]


def _whole_beginning(parts: Sequence[list[Frame]], place_of: dict[int, int], num_places: int) -> list[Frame]:
    """Return the longest beginning of a sequence of frames in which every place has equally many frames.

    parts: the sequence, as lists of one frame each. place_of: the number of the place of a frame, by the frame's id.
    """
    nums, num_whole = [0] * num_places, 0
    for k, (frame,) in enumerate(parts):
        nums[place_of[id(frame)]] += 1
        if (k + 1) % num_places == 0 and min(nums) == max(nums):
            num_whole = k + 1
    return [frame for (frame,) in parts[:num_whole]]


def _parted(frames: Sequence[Frame], dimension: Dimension) -> list[list[Frame]]:
    """Return frames in groups of the same mark (value) in a dimension; the groups are sorted by the mark."""
    parts: dict[str, list[Frame]] = defaultdict(list)
    for frame in frames:
        parts[str(frame.marks.get(dimension))].append(frame)
    return sorted(parts.values(), key=lambda own: own[0].marks.get(dimension, ([], "")))


def _with_empty(frames: list[Frame], everything: Sequence[Frame]) -> list[Frame]:
    """Return the frames of a segment, with an empty frame at each evenly spaced place where the segment has none.

    everything: the frames of all segments. Frames whose places are not evenly spaced are returned as they are.
    """
    places = [group[0] for group in by_place(everything)]
    along = distances(places, places[0])
    step = float(np.diff(along).min(initial=np.inf))
    count = round(along[-1] / step) + 1
    own = {round(place / step): frame for place, frame in zip(distances(frames, places[0]), frames, strict=True)}
    if count > _MAX_EMPTY * len(places) or len(own) < len(frames):
        return frames
    first, last = places[0].position, places[-1].position
    return [
        own.get(k) or replace(frames[0], number=None, position=first + (last - first) * (k / max(count - 1, 1)))
        for k in range(count)
    ]
