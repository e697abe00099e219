"""Sort frames by their place, and those at one place by what tells them apart: times, echoes, stacks, segments.

What tells them apart is the first field of a table (`dicom_fields.py`) that parts the frames of every place alike. More
fields may part them further; all of times count as one axis, and all others as another.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from renderer.errors import InputError
from renderer.readers.dicom_fields import CLOCKS, SEGMENT, STACK, Dimension
from renderer.readers.dicom_frames import Frame
from renderer.readers.steps_in_time import TimeSteps, steps_at
from renderer.volume import Float64

# Of a time or a component: one for each dimension that tells them apart.
Index = tuple[int, ...]

# Frames may be off by this part of the spacing: positions have few digits, and gantries are not perfect. A missing
# one is off by a whole step.
UNEVEN = 0.05

# A segmentation may leave out this many empty slices for each one that it has.
_MAX_EMPTY = 64


def sort_frames(frames: Sequence[Frame]) -> tuple[list[list[list[Frame]]], dict[str, str]]:
    """Return frames as `volumes[time][component]`, each in ascending order along its normal, and the names of what
    tells times apart, under `t`, and components, under `c`.

    Raises InputError if nothing tells frames at one place apart.
    """
    part = SEGMENT if any(SEGMENT in frame.marks for frame in frames) else STACK
    parts = _parted(frames, part)
    volumes: dict[tuple[Index, Index], list[Frame]] = {}
    for k, own in enumerate(parts):
        found, told_apart = _sort_part(_with_empty(own, frames) if part is SEGMENT else own)
        volumes |= {(time, (k, *component)): volume for (time, component), volume in found.items()}
    times, components = (sorted(set(indices)) for indices in zip(*volumes, strict=True))
    if len(volumes) < len(times) * len(components):  # then times of each part are components, too
        volumes = {((), (*component, *time)): volume for (time, component), volume in volumes.items()}
        times, components = [()], sorted(component for _, component in volumes)
    told_apart = [part] * (len(parts) > 1) + told_apart
    names = {axis: " and ".join(each.name for each in told_apart if each.axis == axis) for axis in "tc"}
    by_axis = {axis: name for axis, name in names.items() if name}
    return [[volumes[time, component] for component in components] for time in times], by_axis


def times_of(volumes: Sequence[Sequence[Sequence[Frame]]]) -> TimeSteps:
    """Return the steps in time of `volumes[time][component]`, by the first field that tells the time of each."""
    count = len(volumes)
    for keyword, (unit, is_clock) in CLOCKS.items():
        own = ([frame.times[keyword] for frame in volume[0] if keyword in frame.times] for volume in volumes)
        times = [min(found) for found in own if found]
        steps = steps_at(count, [time - times[0] * is_clock for time in times], unit)
        if steps.times:
            return steps
    return TimeSteps(count)


def _sort_part(frames: Sequence[Frame]) -> tuple[dict[tuple[Index, Index], list[Frame]], list[Dimension]]:
    """Return volumes by the indices of their time and component, and the dimensions that these count."""
    cells = groups = _by_place(frames)
    shape: list[int] = []
    found: list[Dimension] = []
    for dimension in dict.fromkeys(each for frame in frames for each in frame.marks):
        if len(cells[0]) == 1 or (dimension.is_order and len(groups) == 1):  # without positions slices are no times
            continue
        parted = [_parted(cell, dimension) for cell in cells]
        if len(parted[0]) > 1 and len({(len(cell), len(item)) for cell in parted for item in cell}) == 1:
            cells = [item for cell in parted for item in cell]
            shape.append(len(parted[0]))
            found.append(dimension)
    same = max(cells, key=len)
    if len(same) > 1:
        fewest, most = min(map(len, groups)), max(map(len, groups))
        why = f"; there are {fewest} to {most} at a position" if fewest < most else ", which no field tells apart"
        raise InputError(
            "two slices of this series are at the same position",
            got=f"{same[0].label} and {same[1].label}{why}",
            expected="one slice at each position, or as many at each as there are times or components",
            hint="a time series or several echoes? put each volume into its own folder",
        )
    volumes: dict[tuple[Index, Index], list[Frame]] = defaultdict(list)
    for (_, *index), (frame,) in zip(np.ndindex(len(groups), *shape), cells, strict=True):
        time, component = (tuple(k for k, each in zip(index, found, strict=True) if each.axis == axis) for axis in "tc")
        volumes[time, component].append(frame)
    return volumes, found


def _parted(frames: Sequence[Frame], dimension: Dimension) -> list[list[Frame]]:
    """Return frames by what each has of a dimension, in its order."""
    parts: dict[str, list[Frame]] = defaultdict(list)
    for frame in frames:
        parts[str(frame.marks.get(dimension))].append(frame)
    return sorted(parts.values(), key=lambda own: own[0].marks.get(dimension, ([], "")))


def _distances(frames: Sequence[Frame], first: Frame) -> Float64:
    """Return how far frames lie from the first along its normal, float64 [n]."""
    return np.asarray([(frame.position - first.position) @ first.normal for frame in frames], np.float64)


def _by_place(frames: Sequence[Frame]) -> list[list[Frame]]:
    """Return frames by their place along their normal, in ascending order."""
    order = np.argsort(places := _distances(frames, frames[0]), kind="stable")
    gaps = np.diff(places[order])
    # Gaps far smaller than pixels and the largest gap, which may be between two blocks, are rounded positions.
    steps = gaps[gaps > min(0.01 * gaps.max(initial=0.0), 0.1 * min(frames[0].spacing))]
    begins = np.flatnonzero(gaps > UNEVEN * np.median(steps)) + 1 if steps.size else np.array([], np.intp)
    return [[frames[k] for k in part.tolist()] for part in np.split(order, begins)]


def _with_empty(frames: list[Frame], everything: Sequence[Frame]) -> list[Frame]:
    """Return the frames of a segment, and an empty one where only others have one, or none has.

    Frames that do not fit even places stay as they are.
    """
    places = [group[0] for group in _by_place(everything)]
    along = _distances(places, places[0])
    step = float(np.diff(along).min(initial=np.inf))
    count = round(along[-1] / step) + 1
    own = {round(place / step): frame for place, frame in zip(_distances(frames, places[0]), frames, strict=True)}
    if count > _MAX_EMPTY * len(places) or len(own) < len(frames):
        return frames
    first, last = places[0].position, places[-1].position
    return [
        own.get(k) or replace(frames[0], number=None, position=first + (last - first) * (k / max(count - 1, 1)))
        for k in range(count)
    ]
