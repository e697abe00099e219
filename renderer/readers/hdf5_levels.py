"""Open an image of HDF5 that has a dataset for each level, time and channel, as an image in levels (`stores`).

Datasets have the axes z, y, x, and may be padded to whole chunks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.readers.hdf5_objects import Dataset, Group, check_dataset, dataset_at, decoded
from renderer.readers.hdf5_values import plain_values
from renderer.scene import short_text
from renderer.stores import Axis, Box, ImagePlan, Level, OpenImage, StoredImage
from renderer.volume import Array, Float64


class Pyramid(NamedTuple):
    """An image with levels, as a convention describes it.

    plan: its description; the path of a level is a text for messages. sizes: for each level, the number of voxels along
    z, y and x without padding; a number that no dataset can have stands for an unknown one. path: a function that
    returns the path of the dataset of a level, a time and a channel. is_unsigned: whether the bits of signed numbers
    are those of unsigned ones.
    """

    plan: ImagePlan
    sizes: Sequence[Sequence[int]]
    num_times: int
    num_channels: int
    path: Callable[[int, int, int], str]
    is_unsigned: bool = False


def axes_in_space(unit: str) -> tuple[Axis, ...]:
    """Return the axes t, c, z, y and x of all levels. unit: the unit of lengths."""
    space = (Axis(name, "space", unit) for name in "zyx")
    return Axis("t", "time"), Axis("c", "channel"), *space


def place_by(steps: Sequence[tuple[float, float] | None]) -> Float64 | None:
    """Return the place of a level, from the coordinate of the first voxel and the step along z, y and x.

    Returns None if one of them is None, which stands for an unknown step.
    """
    matrix = np.hstack([np.eye(5), np.zeros((5, 1))])
    for axis, along in enumerate(steps, 2):
        if along is None:
            return None
        matrix[axis, 5], matrix[axis, axis] = along
    return matrix


class LevelsOfFile(OpenImage):
    """An open image of HDF5 with levels. Raises InputError for a level without voxels of its first time and channel."""

    def __init__(self, found: Pyramid, file: Group, path: Path, name: str) -> None:
        self._found, self._file, self._path = found, file, path
        levels = tuple(map(self._level, range(len(found.sizes))))
        self.image = StoredImage(found.plan, levels, name)

    def read_box(self, level: int, box: Box, out: Array) -> None:
        """Read the voxels of a box of a level into an array (see OpenImage)."""
        time, channel = box[:2]
        assert isinstance(time, int) and isinstance(channel, int)
        own = self.levels[level]
        source = self._dataset(level, time, channel)
        if source.dtype != self._dataset(level, 0, 0).dtype or any(np.less(source.shape, own.shape[2:])):
            raise self._lacks(level, time, channel)
        check_dataset(source, self._path)
        out[...] = decoded(source, box[2:]).view(own.dtype)

    def _level(self, number: int) -> Level:
        plan, first = self._found.plan.levels[number], self._dataset(number, 0, 0)
        said = self._found.sizes[number]
        sizes = tuple(n if 1 <= n <= own else own for n, own in zip(said, first.shape, strict=True))
        shape = (self._found.num_times, self._found.num_channels, *sizes)
        dtype = plain_values(first, is_unsigned=self._found.is_unsigned).dtype
        return Level(plan.path, shape, (1, 1, *(first.chunks or sizes)), dtype, plan.world_from_index)

    def _dataset(self, level: int, time: int, channel: int) -> Dataset:
        found = dataset_at(self._file, self._found.path(level, time, channel))
        if found is None or found.ndim != 3:
            raise self._lacks(level, time, channel)
        return found

    def _lacks(self, level: int, time: int, channel: int) -> InputError:
        return InputError(
            "this file lacks the voxels of a channel",
            got=short_text(self._found.path(level, time, channel)),
            hint="they are in other files, which are not opened: export it again as one file; or the file is damaged",
        )
