"""Take a sample of the voxels of a volume, normalised to its range, so that units and types do not matter."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from renderer.statistics.histogram import Statistics, safe_scale
from renderer.volume import Array, Bools, Float64, Volume

# The largest number of samples along each axis of a volume. Two million voxels are enough for a transfer function.
_MAX_SAMPLES_PER_AXIS = 128
# The background is found at the border only if at least this share of the border's voxels have data.
_MIN_VALID_FRACTION = 0.1
# Normalised values that differ by no more than this count as equal.
SAME = 1e-9


@dataclass(frozen=True)
class VoxelSample:
    """A sample of the voxels of a volume, on a coarser grid, with values normalised to the volume's range.

    normalized: float64 [z, y, x] in [0, 1].
    is_valid: bool [z, y, x]; False for voxels without data, and for values outside of the range.
    strides: the numbers of voxels from one sample to the next along z, y, x.
    neighbours: float64 [4, z, y, x], the values of the voxels at -x, +x, -y, +y; beyond the border, the value of the
        voxel itself.
    minimum, maximum: the range of the volume, in data units.
    spacing: world distance between samples along z, y, x.
    diagonal: the diagonal of the whole volume, in world units.
    directions: float64 [3, 3], whose columns are the directions of the axes x, y, z in the world.
    centre: the centre of the volume, in the world.
    is_interpolated: whether values are interpolated between two samples; labels are not.
    """

    normalized: Float64
    is_valid: Bools
    strides: tuple[int, int, int]
    neighbours: Float64
    minimum: float
    maximum: float
    spacing: tuple[float, float, float]
    diagonal: float
    directions: Float64
    centre: Float64
    is_interpolated: bool = True

    def denormalize(self, share: float) -> float:
        """Return the data value of a normalised value, which may be below 0 or above 1."""
        low, extent, scale = self._scaled_range()
        largest = sys.float_info.max * scale
        return float(min(max(low + extent * share, -largest), largest)) / scale

    def normalize(self, value: float) -> float:
        """Return the normalised value of a data value."""
        low, extent, scale = self._scaled_range()
        return (value * scale - low) / extent

    def _scaled_range(self) -> tuple[float, float, float]:
        """Return the lowest value and the width of the range, both scaled, and the scale, a power of two."""
        scale = safe_scale(self.minimum, self.maximum)
        return self.minimum * scale, self.maximum * scale - self.minimum * scale, scale

    def round_value(self, value: float, gap: float = 1.0) -> float:
        """Round a data value to about a thousandth of the range, or to a twentieth of `gap` if that is finer.

        gap: the normalised distance to the next control point, so that points stay apart. If the range is too large or
            too small for this, the value is returned unchanged.
        """
        extent = abs(self.maximum - self.minimum) * min(1.0, 50 * gap)
        if not 1e-290 < extent < 1e290:
            return value
        decimals = 3 - math.floor(math.log10(extent))
        if decimals > -12 and abs(value) < 1e15:
            return float(round(value, max(decimals, 0))) + 0.0
        # Values far from 0, compared with their range, keep as many digits as tell them apart.
        digits = 1 + decimals + math.floor(math.log10(abs(value))) if value else 1
        return float(f"{value:.{min(max(digits, 5), 17)}g}")

    def valid_values(self) -> tuple[Float64, Float64]:
        """Return the valid normalised values on the six faces of the volume, [m], and all valid values, [n].

        If hardly any voxel on the faces is valid, the value that voxels without data are filled with is the background,
        and values without data are returned, too.
        """
        border, are_valid = faces(self.normalized), faces(self.is_valid)
        if np.mean(are_valid) < _MIN_VALID_FRACTION:
            return border, self.normalized.ravel()
        return border[are_valid], self.normalized[self.is_valid]

    def mapped(self, function: Callable[[Float64], Float64]) -> VoxelSample:
        """Return the sample with a function applied to its normalised values."""
        return replace(self, normalized=function(self.normalized), neighbours=function(self.neighbours))

    def with_inverted_range(self) -> VoxelSample:
        """Return the sample with its values mirrored in their range: 0 becomes 1."""
        return replace(self.mapped(lambda values: 1 - values), minimum=self.maximum, maximum=self.minimum)

    def with_logarithms(self, smallest: float) -> VoxelSample:
        """Return the sample with its values, of which none is negative, replaced by their logarithms to base 10.

        smallest: a share of the volume's maximum; smaller values count as this share.
        """
        first, high = math.log10(smallest), math.log10(self.maximum)

        def logarithms(values: Float64) -> Float64:
            return 1 - np.log10(np.maximum(self.shares(values), smallest)) / first

        return replace(self.mapped(logarithms), minimum=high + first, maximum=high)

    def shares(self, normalized: Float64) -> Float64:
        """Return normalised values as shares of the volume's maximum. No value of the volume may be negative."""
        low, extent, _ = self._scaled_range()
        return np.asarray((low + extent * normalized) / (low + extent))


class ValueRange(NamedTuple):
    """A range of values, by which a sample can be normalised."""

    minimum: float
    maximum: float


def sample_volume(volume: Volume, statistics: Statistics | ValueRange, fill: float = 0.0) -> VoxelSample:
    """Return a sample of a volume that is not constant.

    statistics: the range to normalise by. fill: the normalised value for voxels outside of this range, and for voxels
    without data. Raises InputError if the volume's file has changed.
    """
    volume.require_unchanged()
    values = volume.values
    low, high = float(statistics.minimum), float(statistics.maximum)
    scale = safe_scale(low, high)
    extent = high * scale - low * scale

    def normalized(part: Array) -> Float64:
        shown = np.clip((part.astype(np.float64) * scale - low * scale) / extent, 0.0, 1.0)
        return np.where(are_within(part), shown, fill)

    def are_within(part: Array) -> Bools:
        return np.asarray((part >= statistics.minimum) & (part <= statistics.maximum))

    nz, ny, nx = values.shape
    sz, sy, sx = (-(-n // _MAX_SAMPLES_PER_AXIS) for n in values.shape)
    z, y, x = np.arange(0, nz, sz), np.arange(0, ny, sy), np.arange(0, nx, sx)

    def sampled(dy: int, dx: int) -> Array:
        return np.asarray(values[np.ix_(z, np.clip(y + dy, 0, ny - 1), np.clip(x + dx, 0, nx - 1))])

    here = sampled(0, 0)
    own, is_within = normalized(here), are_within(here)
    neighbours = np.stack([normalized(sampled(*step)) for step in ((0, -1), (0, 1), (-1, 0), (1, 0))])
    # Isolated voxels with values outside the range get the median of their neighbours, and leave no holes.
    is_isolated = ~is_within & ~np.isnan(here)
    own[is_isolated] = np.median(neighbours[:, is_isolated], axis=0)
    side_x, side_y, side_z = volume.spacing.tolist()
    sample = VoxelSample(
        normalized=own,
        is_valid=is_within,
        strides=(sz, sy, sx),
        neighbours=neighbours,
        minimum=low,
        maximum=high,
        spacing=(side_z * sz, side_y * sy, side_x * sx),
        diagonal=float(np.linalg.norm(volume.spacing * volume.shape_xyz)),
        directions=volume.world_from_index[:3, :3] / volume.spacing,
        centre=volume.centre,
    )
    volume.require_unchanged()
    return sample


def faces(cube: Array) -> Array:
    """Return the values on the six faces of an array, the same number from each face, [n]. cube: [z, y, x].

    Values of small faces are repeated, so that an object which fills the two large faces of a slab does not fill most
    of its border.
    """
    sides = [side.ravel() for axis in range(3) for side in (cube.take(0, axis), cube.take(-1, axis))]
    num = max(side.size for side in sides)
    return np.concatenate([side[np.arange(num) * side.size // num] for side in sides])
