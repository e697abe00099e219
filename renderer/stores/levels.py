"""Define the records that describe an image in a store: its axes, its levels of resolution, and the image itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from renderer.volume import Channel, Float64, Label

# The kind of an axis; an empty text stands for an unknown kind.
AxisKind = Literal["space", "time", "channel", ""]
# The kinds of axes by their names in small letters.
_KINDS: dict[str, AxisKind] = {
    **dict.fromkeys(("x", "y", "z"), "space"),
    **dict.fromkeys(("t", "time", "times", "step"), "time"),
    **dict.fromkeys(("c", "ch", "channel", "channels", "component", "components"), "channel"),
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
    """Return an axis whose kind follows from its name."""
    return Axis(name, _KINDS.get(name.lower(), ""), unit)


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

    driver: the name of the format in tensorstore. axes: the axes in the order of the array; empty if the metadata do
    not state them. levels: from the finest to the coarsest. nodata: values that mark absent voxels. unapplied: the
    fields of the metadata that change how voxels are understood and that are not applied. is_reversed: whether the
    first axis of the arrays varies fastest.
    """

    driver: str
    axes: tuple[Axis, ...]
    levels: tuple[LevelPlan, ...]
    channels: tuple[Channel, ...] = ()
    labels: tuple[Label, ...] = ()
    nodata: tuple[float, ...] = ()
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
