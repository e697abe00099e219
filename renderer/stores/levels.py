"""Define an image in levels of resolution: the records that describe it, and the interface of an open one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from renderer.volume import Array, Channel, Float64, Label

# The index of an item along each axis of an array, or the range of items as a slice with both ends.
Box = Sequence[int | slice]

# The number of decoded bytes that are read at a time, if a row of chunks is not larger.
_SLAB_BYTES = 64 << 20

# The kind of an axis; an empty text stands for an unknown kind.
AxisKind = Literal["space", "time", "channel", ""]
# The kinds of axes by their names in small letters.
_KINDS: dict[str, AxisKind] = {
    **dict.fromkeys(("x", "y", "z"), "space"),
    **dict.fromkeys(("t", "time", "times", "step"), "time"),
    **dict.fromkeys(("c", "ch", "channel", "channels", "component", "components"), "channel"),
    **dict.fromkeys(("band", "bands", "member", "rgb"), "channel"),
}


class Axis(NamedTuple):
    """An axis of an image in a store.

    kind: whether it is an axis of space, of times or of channels, as far as that is known. unit: the unit of
    coordinates. orientation: its direction in a body, such as `left-to-right`. Texts are empty where unknown.
    """

    name: str
    kind: AxisKind = ""
    unit: str = ""
    orientation: str = ""


def axis_named(name: str, unit: str = "") -> Axis:
    """Return an axis whose kind follows from its name, or from a unit of time such as `days since 2000`."""
    return Axis(name, "time" if " since " in unit else _KINDS.get(name.lower(), ""), unit)


class LevelPlan(NamedTuple):
    """A level as metadata describe it, before its array is opened.

    path: the path of the array in the store. world_from_index: float64 [n, n + 1], from the indices along the n axes of
    the array to coordinates along the axes of the image; None if the metadata do not state it. options: further members
    of tensorstore's specification of the array.
    """

    path: str
    world_from_index: Float64 | None = None
    options: tuple[tuple[str, Any], ...] = ()


@dataclass(frozen=True)
class ImagePlan:
    """An image as metadata describe it, before its arrays are opened.

    driver: the name of the format in tensorstore, or `hdf5`. axes: the axes in the order of the array; empty if the
    metadata do not state them. levels: from the finest to the coarsest. times: the time of each step in seconds; empty
    if they follow from the place of a level. nodata: stored numbers that mark absent voxels. scaling: the slope and the
    intercept that turn stored numbers into values. unapplied: the fields of the
    metadata that change how voxels are understood and that are not applied. is_reversed: whether the first axis of the
    arrays varies fastest.
    """

    driver: str
    axes: tuple[Axis, ...]
    levels: tuple[LevelPlan, ...]
    channels: tuple[Channel, ...] = ()
    labels: tuple[Label, ...] = ()
    times: tuple[float, ...] = ()
    nodata: tuple[float, ...] = ()
    scaling: tuple[float, float] = (1.0, 0.0)
    notes: tuple[str, ...] = ()
    unapplied: tuple[str, ...] = ()
    is_reversed: bool = False


@dataclass(frozen=True)
class Level:
    """A level of an image whose array is open.

    path: the path of the array in the store. shape, chunks: the lengths of the array and of a chunk, which is decoded
    as a whole. world_from_index: as in LevelPlan.
    """

    path: str
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    dtype: np.dtype[Any]
    world_from_index: Float64 | None


@dataclass(frozen=True)
class StoredImage:
    """An image in a store: an ImagePlan whose levels are open arrays.

    name: the path of the image in the store, empty for the store itself.
    """

    plan: ImagePlan
    levels: tuple[Level, ...]
    name: str = ""


class OpenImage(ABC):
    """An open image, whose voxels can be read. levels: the levels of the image, from the finest to the coarsest.

    marks: a text that changes when the metadata do; empty if it is not known.
    """

    image: StoredImage
    marks = ""

    @property
    def levels(self) -> tuple[Level, ...]:
        """Return the levels of the image, from the finest to the coarsest."""
        return self.image.levels

    @abstractmethod
    def read_box(self, level: int, box: Box, out: Array) -> None:
        """Read the voxels of a box of a level into an array, whose axes are those of the array with a range in the box.

        out: any strides. Missing chunks have the fill value. Raises InputError for chunks that are damaged or cannot be
            read.
        """


def slabs_of(box: Box, out: Array, chunks: Sequence[int]) -> Iterator[tuple[tuple[int | slice, ...], Array]]:
    """Yield parts of a box along its first axis that has several chunks, with their parts of the output array.

    A part ends at the border of a chunk, so that no chunk is decoded for two parts.
    """
    ranges = [(axis, item.start, item.stop) for axis, item in enumerate(box) if isinstance(item, slice)]
    spans = [place for place, (axis, begin, end) in enumerate(ranges) if end - begin > chunks[axis]]
    if not spans:
        yield tuple(box), out
        return
    place = spans[0]
    axis, begin, end = ranges[place]
    row = max(1, out.nbytes // (end - begin)) * chunks[axis]
    depth = chunks[axis] * max(1, _SLAB_BYTES // row)
    first = begin
    while first < end:
        last = min(end, (first // chunks[axis]) * chunks[axis] + depth)
        part = (*box[:axis], slice(first, last), *box[axis + 1 :])
        target = (*((slice(None),) * place), slice(first - begin, last - begin))
        yield part, out[target]
        first = last
