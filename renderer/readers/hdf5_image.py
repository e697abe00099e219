"""Describe an image in an HDF5 file: its axes, its datasets, and its place in the world.

Each convention is a module `hdf5_*.py` with a function that finds the images of a file; `hdf5.py` has their table.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import NO_SPACING, affine, even_steps
from renderer.readers.hdf5_levels import Pyramid
from renderer.readers.hdf5_objects import Dataset
from renderer.readers.hdf5_values import Values, unpacked_line
from renderer.readers.steps_in_time import TimeSteps, steps_at
from renderer.readers.units import one_spelling
from renderer.scene import short_text
from renderer.stores import AxisKind, axis_named
from renderer.volume import Float64

# The lengths of units in metres, by the spelling of the unit that is shown.
_METRES = {"nm": 1e-9, "µm": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "km": 1e3, "Å": 1e-10}


class Axis(NamedTuple):
    """An axis of an image in an HDF5 file.

    length: the number of items along the axis. name, unit: its name, and the unit of its coordinates; each may be
    empty. way: the axis of the world along which it lies, x, y or z; any other text if that is unknown. points_down:
    whether its coordinates grow downwards. steps: the first coordinate and the step, where the file stores these two.
    coordinates: the dataset of its coordinates, where the file stores all of them.
    """

    length: int
    name: str = ""
    unit: str = ""
    way: str = ""
    points_down: bool = False
    steps: tuple[float, float] | None = None
    coordinates: Dataset | None = None

    @property
    def kind(self) -> AxisKind:
        """Return whether it is an axis of times or of components, as far as its name and its unit tell."""
        return axis_named(self.name, self.unit).kind

    @property
    def has_lengths(self) -> bool:
        """Return whether the file has coordinates along the axis."""
        return self.steps is not None or self.coordinates is not None

    def even(self) -> tuple[float, float] | None:
        """Return the first coordinate and the step; None if the steps are not even."""
        return self.steps or even_steps(unpacked_line(self.coordinates))

    def times(self) -> TimeSteps:
        """Return the steps in time of an axis of time."""
        if self.steps is not None:
            first, step = self.steps
            return steps_at(self.length, [first + k * step for k in range(self.length)], self.unit)
        if self.coordinates is None:
            return TimeSteps(self.length)
        return steps_at(self.length, unpacked_line(self.coordinates).tolist(), self.unit.partition(" since ")[0])


@dataclass(frozen=True)
class PlainImage:
    """An image in one dataset of an HDF5 file, as a convention describes it.

    axes: the axes from the slowest to the fastest.
    values: a function that returns the meaning of the numbers of a dataset.
    sizes: the sizes of a voxel in µm, from the slowest axis of space, for axes without coordinates.
    notes: remarks; None stands for no remark.
    lengths_note: the note for an image without sizes whose axes have no coordinates.
    """

    axes: tuple[Axis, ...]
    dataset: Dataset
    values: Callable[[Dataset], Values]
    sizes: tuple[float, ...] = ()
    notes: tuple[str | None, ...] = ()
    lengths_note: str = NO_SPACING

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the lengths of the axes."""
        return tuple(axis.length for axis in self.axes)


class Candidate(NamedTuple):
    """An image that may be read: its name, its shape, and a function that returns its description.

    is_part: whether it is read only if the scene names it.
    """

    name: str
    shape: tuple[int, ...]
    describe: Callable[[], PlainImage | Pyramid]
    is_part: bool = False


def place_of(image: PlainImage, letters: str, has_spacing_override: bool) -> tuple[Float64, str, list[str]]:
    """Return the affine of an image, float64 [4, 4], the unit that all lengths share, and notes, as `place_of_axes`."""
    space = [axis for axis, letter in zip(image.axes, letters, strict=True) if letter == "s"][::-1]
    if not any(axis.has_lengths for axis in space):
        direction = _direction(_ways(space))
        if len(image.sizes) == len(space) == 3:
            return affine(image.sizes[::-1], np.zeros(3), direction), "µm", []
        return affine(np.ones(3), np.zeros(3), direction), "", [image.lengths_note]
    return place_of_axes(space, has_spacing_override)


def _direction(ways: str) -> Float64:
    return np.asarray(np.eye(3)[:, ["xyz".index(way) for way in ways]])


def place_of_axes(space: Sequence[Axis], has_spacing_override: bool) -> tuple[Float64, str, list[str]]:
    """Return the affine of axes of space, the fastest first, float64 [4, 4], the unit of all lengths, and notes.

    The affine follows from coordinates; the step of an axis without any is 1. The unit is empty if units differ.

    has_spacing_override: whether uneven coordinates are allowed; otherwise they raise InputError.
    """
    ways = _ways(space)
    direction = _direction(ways)
    origin, spacing, units, notes = np.zeros(3), np.ones(3), dict[str, str](), list[str]()
    for column, axis in enumerate(space):
        if not axis.has_lengths:
            continue
        even = axis.even()
        if even is None and not has_spacing_override and axis.kind != "time":
            raise _uneven(axis, ways[column])
        unit = one_spelling(axis.unit.split("_")[0])  # the first word of a unit such as degrees_north
        first = next(iter(units.values()), unit)
        is_length = {unit, first} <= _METRES.keys()
        units[ways[column]] = first if is_length else unit
        factor = _METRES[unit] / _METRES[first] if is_length else 1.0
        origin[column], spacing[column] = np.array(even or (0.0, 1.0)) * factor
        if axis.points_down:
            direction[:, column] *= -1
            notes.append(f"{short_text(axis.name)} counts downwards: {ways[column]} of the world is its negative")
    notes += _unit_notes(units, ways[: len(space)])
    is_one = len(units) == len(space) and len({*units.values()}) == 1
    place = np.asarray(direction @ origin + 0.0, np.float64)
    return affine(spacing, place, direction) + 0.0, {*units.values()}.pop() if is_one else "", notes


def _ways(space: Sequence[Axis]) -> str:
    """Return the axis of the world along which each axis lies, the fastest axis first.

    Axes without a stated direction lie along the remaining axes of the world, in their order.
    """
    said = [axis.way if axis.way in ("x", "y", "z") else "" for axis in space]
    if any(said.count(way) > 1 for way in "xyz"):
        said = [""] * len(space)
    left = iter([way for way in "xyz" if way not in said])
    return "".join(way or next(left) for way in [*said, *[""] * (3 - len(said))])


def _uneven(axis: Axis, way: str) -> InputError:
    name = axis.name if axis.coordinates is None else axis.coordinates.name
    return InputError(
        "the coordinates of this dataset are not even",
        got=f"{short_text(name)} along {way}",
        expected="equal steps, as voxels have",
        hint=f"resample it by xarray: `data.interp({short_text(axis.name)}=numpy.linspace(FIRST, LAST, "
        f"{axis.length})).to_netcdf('even.nc')`; or give `spacing: [x, y, z]` to draw equal steps",
    )


def _unit_notes(units: dict[str, str], ways: str) -> list[str]:
    """Return notes on axes without coordinates, and on coordinates in different units."""
    notes = []
    if len(units) < len(ways):
        missing = ", ".join(axis for axis in sorted(ways) if axis not in units)
        notes.append(f"the file has no coordinates along {missing}; steps of 1 are assumed")
    if len({*units.values()}) > 1:
        each = ", ".join(f"{axis} in {unit or 'no unit'}" for axis, unit in units.items())
        notes.append(f"coordinates differ in their units, and are drawn as numbers ({short_text(each)}); "
                     "`spacing: [x, y, z]` gives other lengths")  # fmt: skip
    return notes
