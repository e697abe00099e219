"""Find the image of an Imaris file (.ims, 5.5), with a dataset for each level of resolution, time and channel.

Datasets are padded to whole chunks. Attributes are arrays of single characters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from renderer.errors import InputError
from renderer.readers.hdf5_image import Axis, Candidate, StoredImage
from renderer.readers.hdf5_objects import Dataset, Group, dataset_at, open_inside
from renderer.readers.hdf5_values import plain_values
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.steps_in_time import TimeSteps, steps_at
from renderer.scene import short_text
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

# The largest number of levels of a file, of times of a level, and of channels of a time. Further ones are not found.
_MAX_ITEMS = 10_000

# The beginning of the name of a level's group; a number follows.
_LEVEL = "ResolutionLevel"
# The beginning of the name of a time's group in a level; a number follows.
_TIME = "TimePoint"
# The beginning of the name of a channel's group in a time; a number follows.
_CHANNEL = "Channel"


@dataclass(frozen=True)
class _Level:
    """A level of resolution: its group, and its numbers of times, of channels, and of voxels along z, y and x."""

    group: Group
    num_times: int
    num_channels: int
    sizes: tuple[int, ...]

    def data(self, time: int, channel: int) -> Dataset:
        """Return the dataset of a time and a channel; raises InputError if it is missing or too small."""
        path = f"{_TIME} {time}/{_CHANNEL} {channel}/Data"
        found = dataset_at(self.group, path)
        if found is None or found.ndim != 3 or any(n < own for n, own in zip(found.shape, self.sizes, strict=True)):
            raise InputError(
                "this Imaris file lacks the voxels of a channel",
                got=short_text(f"{self.group.name}/{path}"),
                hint="the file is damaged, or its voxels are in other files, which are not opened",
            )
        return found


def find_images(file: Group) -> list[Candidate]:
    """Return the image at its finest level.

    All levels and all single datasets are returned, too, but are read only if the scene names them.
    """
    if text_of(file, "ImarisDataSet") == "" or open_inside(file, "DataSet") is None:
        return []
    found: list[Candidate] = []
    for number in range(_count(file["DataSet"], _LEVEL)):
        level = _level(file["DataSet"], number)
        name = f"DataSet/{_LEVEL} {number}"
        shape = (level.num_times, level.num_channels, *level.sizes)
        found.append(Candidate(name if number else "DataSet", shape, partial(_describe, file, level), number > 0))
        found += [found[-1]._replace(name=name, is_part=True)] * (number == 0)
        for time, channel in np.ndindex(level.num_times, level.num_channels):
            one = partial(_describe, file, level, time, channel)
            path = f"{name}/{_TIME} {time}/{_CHANNEL} {channel}/Data"
            found.append(Candidate(path, level.sizes, one, is_part=True))
    return found


def text_of(owner: Group | None, name: str) -> str:
    """Return an attribute of single characters as text; an empty text for any other attribute, and without an owner."""
    found = np.ravel(() if owner is None else owner.attrs.get(name, ()))
    if found.dtype.kind != "S":
        return "".join(each for each in found.tolist() if isinstance(each, str))
    return found.tobytes().decode("utf-8", "replace").strip("\0 ")


def _level(images: Group, number: int) -> _Level:
    group = images[f"{_LEVEL} {number}"]
    first = open_inside(group, f"{_TIME} 0")
    num_channels = 0 if first is None else _count(first, _CHANNEL)
    channel = open_inside(group, f"{_TIME} 0/{_CHANNEL} 0")
    data = dataset_at(group, f"{_TIME} 0/{_CHANNEL} 0/Data")
    if channel is None or data is None or data.ndim != 3:
        raise InputError("this Imaris file has no voxels at a level of resolution", got=short_text(group.name))
    said = [number_in(text_of(channel, f"ImageSize{axis}")) for axis in "ZYX"]
    sizes = tuple(int(n) if 1 <= n <= own else own for n, own in zip(said, data.shape, strict=True))
    return _Level(group, _count(group, _TIME), num_channels, sizes)


def _count(group: Group, name: str) -> int:
    """Return the number of items of a group that are called by a name and consecutive numbers from 0."""
    return next((k for k in range(_MAX_ITEMS) if open_inside(group, f"{name} {k}") is None), _MAX_ITEMS)


def _describe(file: Group, level: _Level, time: int | None = None, channel: int | None = None) -> StoredImage:
    """Return the description of a level, or of one of its datasets."""
    info = open_inside(file, "DataSetInfo/Image")
    unit = text_of(info, "Unit")
    space = tuple(
        Axis(n, name, unit, name, steps=_steps(info, "xyz".index(name), n))
        for n, name in zip(level.sizes, "zyx", strict=True)
    )
    if time is not None and channel is not None:
        return StoredImage(space, partial(level.data, time, channel), plain_values)
    return StoredImage(
        (Axis(level.num_times, "time"), Axis(level.num_channels, "channel"), *space),
        level.data,
        plain_values,
        num_outer=2,
        channels=tuple(_channel(file, k) for k in range(level.num_channels)),
        steps=_times(file, level.num_times),
    )


def _steps(info: Group | None, axis: int, length: int) -> tuple[float, float] | None:
    """Return the centre of the first voxel along an axis, and the size of a voxel, from the ends of the image.

    Returns None if the file does not give the ends.
    """
    first, last = (number_in(text_of(info, f"Ext{end}{axis}")) for end in ("Min", "Max"))
    size = (last - first) / length
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


def _times(file: Group, count: int) -> TimeSteps:
    """Return the times of the steps, counted from the first one."""
    info = open_inside(file, "DataSetInfo/TimeInfo")
    try:
        taken = np.array([np.datetime64(text_of(info, f"TimePoint{k + 1}") or "none", "us") for k in range(count)])
    except (ValueError, OverflowError):
        return TimeSteps(count)
    return steps_at(count, ((taken - taken[0]) / np.timedelta64(1, "s")).tolist(), "s")
