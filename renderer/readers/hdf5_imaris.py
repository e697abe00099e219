"""Find the image of an Imaris file (.ims, 5.5), with a dataset for each level of resolution, time and channel.

Datasets are padded to whole chunks. Attributes are arrays of single characters.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from renderer.errors import InputError
from renderer.readers.hdf5_image import Candidate
from renderer.readers.hdf5_levels import Pyramid, axes_in_space, place_by
from renderer.readers.hdf5_objects import Group, dataset_at, open_inside
from renderer.readers.statements import FormatTable, Statement
from renderer.scene import short_text
from renderer.stores import ImagePlan, LevelPlan
from renderer.system import number_in
from renderer.volume import Channel

STATEMENTS = FormatTable(
    "Imaris",
    (
        Statement("ImageSizeX", "values", "the size without padding; also ImageSizeY and ImageSizeZ"),
        Statement("ExtMax0", "place", "the end of the image along an axis; also ExtMin0, ExtMax1 and so on"),
        Statement("Unit", "meaning", "the unit of lengths"),
        Statement("Name", "meaning", "the name of a channel"),
        Statement("Color", "meaning", "the colour of a channel"),
        Statement("ColorRange", "meaning", "the display range"),
        Statement("TimePoint1", "meaning", "the time of each step"),
    ),
)

# The largest number of times and of channels. Further ones are not found.
_MAX_ITEMS = 10_000
# The largest number of levels. Coarser ones are not found.
_MAX_LEVELS = 32

# The beginning of the name of a level's group; a number follows.
_LEVEL = "ResolutionLevel"
# The beginning of the name of a time's group in a level; a number follows.
_TIME = "TimePoint"
# The beginning of the name of a channel's group in a time; a number follows.
_CHANNEL = "Channel"


def find_images(file: Group) -> list[Candidate]:
    """Return the image of the file, with its levels."""
    images = open_inside(file, "DataSet")
    if text_of(file, "ImarisDataSet") == "" or images is None:
        return []
    num_levels = min(_count(images, _LEVEL), _MAX_LEVELS)
    first = open_inside(images, f"{_LEVEL} 0")
    num_times = 0 if first is None else _count(first, _TIME)
    num_channels = 0 if num_times == 0 else _count(open_inside(first, f"{_TIME} 0"), _CHANNEL)
    if num_channels == 0:
        raise InputError("this Imaris file has no voxels", got=f"{num_levels} levels, {num_times} times")
    sizes = [_sizes(file, number) for number in range(num_levels)]
    shape = (num_times, num_channels, *sizes[0])
    return [Candidate("DataSet", shape, partial(_describe, file, sizes, num_times, num_channels))]


def text_of(owner: Group | None, name: str) -> str:
    """Return an attribute of single characters as text; an empty text for any other attribute, and without an owner."""
    found = np.ravel(() if owner is None else owner.attrs.get(name, ()))
    if found.dtype.kind != "S":
        return "".join(each for each in found.tolist() if isinstance(each, str))
    return found.tobytes().decode("utf-8", "replace").strip("\0 ")


def _path(level: int, time: int, channel: int) -> str:
    return f"DataSet/{_LEVEL} {level}/{_TIME} {time}/{_CHANNEL} {channel}/Data"


def _sizes(file: Group, level: int) -> list[int]:
    """Return the numbers of voxels of a level along z, y and x without padding, or with padding if none are stated."""
    path = _path(level, 0, 0)
    owner, data = open_inside(file, path.rpartition("/")[0]), dataset_at(file, path)
    said = [number_in(text_of(owner, f"ImageSize{axis}")) for axis in "ZYX"]
    stored = data.shape if data is not None and data.ndim == 3 else (0, 0, 0)
    return [int(n) if 1 <= n <= own else own for n, own in zip(said, stored, strict=True)]


def _count(group: Group, name: str) -> int:
    """Return the number of items of a group that are called by a name and consecutive numbers from 0."""
    return next((k for k in range(_MAX_ITEMS) if open_inside(group, f"{name} {k}") is None), _MAX_ITEMS)


def _describe(file: Group, sizes: Sequence[Sequence[int]], num_times: int, num_channels: int) -> Pyramid:
    info = open_inside(file, "DataSetInfo/Image")
    places = (place_by([_steps(info, axis, n) for axis, n in zip((2, 1, 0), own, strict=True)]) for own in sizes)
    plan = ImagePlan(
        "hdf5",
        axes_in_space(text_of(info, "Unit")),
        tuple(LevelPlan(f"{_LEVEL} {number}", place) for number, place in enumerate(places)),
        tuple(_channel(file, k) for k in range(num_channels)),
        times=_times(file, num_times),
    )
    return Pyramid(plan, sizes, num_times, num_channels, _path)


def _steps(info: Group | None, axis: int, length: int) -> tuple[float, float] | None:
    """Return the centre of the first voxel along an axis, and the size of a voxel, from the ends of the image.

    Returns None if the file does not give the ends.
    """
    first, last = (number_in(text_of(info, f"Ext{end}{axis}")) for end in ("Min", "Max"))
    size = (last - first) / max(length, 1)
    return (first + size / 2, size) if np.isfinite(size) and size else None


def _channel(file: Group, number: int) -> Channel:
    info = open_inside(file, f"DataSetInfo/{_CHANNEL} {number}")
    color, ends = (_numbers(text_of(info, name)) for name in ("Color", "ColorRange"))
    is_color = len(color) == 3 and all(0 <= part <= 1 for part in color)
    return Channel(
        short_text(text_of(info, "Name")),
        (color[0], color[1], color[2]) if is_color else None,
        (ends[0], ends[1]) if len(ends) == 2 and ends[0] < ends[1] else None,
        is_light=True,
    )


def _numbers(text: str) -> list[float]:
    return [number_in(word) for word in text.split()[:4]]


def _times(file: Group, count: int) -> tuple[float, ...]:
    """Return the times of the steps in seconds, counted from the first one; an empty tuple if one is missing."""
    info = open_inside(file, "DataSetInfo/TimeInfo")
    try:
        taken = np.array([np.datetime64(text_of(info, f"TimePoint{k + 1}") or "none", "us") for k in range(count)])
    except (ValueError, OverflowError):
        return ()
    return tuple(((taken - taken[0]) / np.timedelta64(1, "s")).tolist())
