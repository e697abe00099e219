"""Hold an image as a reader returns it: voxels, their place in the world, and what its file says of them."""

from __future__ import annotations

from dataclasses import dataclass, field

from renderer.readers.steps_in_time import TimeSteps
from renderer.readers.units import Units
from renderer.volume import Array, Channel, Float64, Label


@dataclass(frozen=True)
class Image:
    """An image as a reader returns it: voxels as stored, and their place in the world.

    values: [z, y, x] of one time step and one component, an integer or float dtype in any byte order and memory layout,
        possibly mapped from a file.
    world_from_index: float64 [4, 4], (x, y, z) voxel index to world.
    notes: remarks on how they were read; None stands for none.
    nodata: ranges of values, both ends included, that stand for no data by what the file says.
    channels: of each component, where there are several.
    labels: those that the file describes, by value.
    steps: all that it has in time.
    units: of its lengths and values, and its axes.
    has_lengths: whether the format can say how long a voxel is.
    """

    values: Array
    world_from_index: Float64
    notes: tuple[str | None, ...] = ()
    nodata: tuple[tuple[float, float], ...] = ()
    channels: tuple[Channel, ...] = ()
    labels: tuple[Label, ...] = ()
    steps: TimeSteps = field(default=TimeSteps())
    units: Units = field(default=Units())
    has_lengths: bool = True
