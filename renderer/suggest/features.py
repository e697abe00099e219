"""Measure features of a volume: its background, noise, edges and smoothness.

All features come from a sample of the voxels, normalised to the volume's range, so that units and types do not matter.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from renderer.suggest.histogram import Statistics, safe_scale
from renderer.volume import Array, Bools, Float64, Volume

# Samples along each axis; two million voxels are enough for a transfer function.
_MAX_SAMPLES_PER_AXIS = 128

# In a normal distribution half of the values lie within 0.674 standard deviations of the mean, a quarter within 0.319.
_SIGMAS_OF_HALF, _SIGMAS_OF_QUARTER = 2 * 0.6745, 2 * 0.3186
# If a quarter is so much narrower than expected, and than the range, other values are mixed with the background's. With
# so few grey steps widths tell nothing.
_MAX_QUARTER_RATIO, _MAX_QUARTER, _MAX_GREY_STEPS = 0.4, 0.02, 8

# The background ends this many standard deviations from its middle: of ten million voxels of noise six are outside.
_NOISE_SIGMAS = 5.0
# A background without noise is as wide as this part of the range.
_MIN_SIGMA = 1 / 500
# If the values reach fewer standard deviations than this, the border is like the rest and no background: 10 for a
# normal distribution, 15 for a skewed one.
_MIN_CONTRAST = 15.0
# A smooth field has no background if other values are nearly as frequent at the border as elsewhere. Backgrounds of
# scans are noise, with second differences of at least 0.85 times the first.
_MIN_LIKENESS = 0.5
# At least this part of the border must be valid.
_MIN_VALID_FRACTION = 0.1
# A side of a background with less than this part of the other side's voxels does not count.
_ONE_SIDED_RATIO = 0.15
# Fields have a smaller ratio of second to first differences.
_SMOOTH = 0.58
# Neighbours in noise have a smaller correlation; in the noisiest of 20 scans they have 0.7.
_MIN_CORRELATION = 0.3
# The values of a map of statistics, such as t or z, are noise around a middle, with a normal distribution: the 30 %
# that are nearest reach 0.385 standard deviations, 70 % reach 1.036.
_SIGMAS_OF_70_PERCENT = 1.036
# The ratio of both is 2.69. It is 2.7 of a map with a few active places, 115 of an orbital, 3.4 of seismic waves, 1.9
# of a distance, 2.3 of uniform values.
_NORMAL_RATIOS = (2.45, 3.2)
# Noise ends this many standard deviations from the middle: 6 of 100,000 voxels are outside.
_MAP_NOISE_SIGMAS = 4.0
# Something stands out if several sampled voxels are further away than this many standard deviations: of noise alone one
# of two millions is.
_OUTSTANDING_SIGMAS = 5.0
# The least number of such voxels.
_MIN_OUTSTANDING = 8
# Values outside these percentiles are ignored when contrast is measured.
_CONTRAST_PERCENTILES = (0.01, 99.99)
# Normalised values that differ by no more than this are the same.
SAME = 1e-9


@dataclass(frozen=True)
class VoxelSample:
    """A sample of the voxels, on a coarser grid, normalised to the volume's range.

    normalized: float64 [z, y, x] in [0, 1].
    is_valid: bool [z, y, x]; False for voxels without data, and for values outside of the range.
    strides: voxels from one sample to the next along z, y, x.
    neighbours: float64 [4, z, y, x], the neighbouring voxels at -x, +x, -y, +y; at the border the voxel itself.
    minimum, maximum: the range, data units.
    spacing: world distance between samples along z, y, x.
    diagonal: of the whole volume, world units.
    directions: float64 [3, 3], whose columns are the directions of the axes x, y, z in the world.
    centre: of the volume, in the world.
    is_interpolated: whether values lie between those of two samples; not of labels, between which they mean nothing.
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
        """Return the lowest value and the extent of the range, and the power of two that they are multiplied by."""
        scale = safe_scale(self.minimum, self.maximum)
        return self.minimum * scale, self.maximum * scale - self.minimum * scale, scale

    def round_value(self, value: float, gap: float = 1.0) -> float:
        """Round a data value to about a thousandth of the range, or to a twentieth of `gap`.

        gap: the normalised distance to the next point; points stay apart. Values without such decimals are returned
            unchanged.
        """
        extent = abs(self.maximum - self.minimum) * min(1.0, 50 * gap)
        if not 1e-290 < extent < 1e290:
            return value
        decimals = 3 - math.floor(math.log10(extent))
        if decimals > -12 and abs(value) < 1e15:
            return float(round(value, max(decimals, 0))) + 0.0
        # On a large offset keep as many digits as tell values apart, and zeros before the point.
        digits = 1 + decimals + math.floor(math.log10(abs(value))) if value else 1
        return float(f"{value:.{min(max(digits, 5), 17)}g}")

    def valid_values(self) -> tuple[Float64, Float64]:
        """Return the valid values on the six faces, [m], and all valid values, [n].

        Where hardly any is valid on the faces, the fill value is the background, and all values count.
        """
        border, are_valid = faces(self.normalized), faces(self.is_valid)
        if np.mean(are_valid) < _MIN_VALID_FRACTION:
            return border, self.normalized.ravel()
        return border[are_valid], self.normalized[self.is_valid]

    def mapped(self, function: Callable[[Float64], Float64], **changes: Any) -> VoxelSample:
        """Return the sample with a function of its normalised values, and other changes."""
        return replace(self, normalized=function(self.normalized), neighbours=function(self.neighbours), **changes)

    def with_inverted_range(self) -> VoxelSample:
        """Return the sample with the range inverted."""
        return self.mapped(lambda values: 1 - values, minimum=self.maximum, maximum=self.minimum)

    def with_logarithms(self, smallest: float) -> VoxelSample:
        """Return the sample with logarithms to base 10 in place of its values, none of which is negative.

        smallest: the share of the maximum that stands for all that is less.
        """
        first, high = math.log10(smallest), math.log10(self.maximum)

        def logarithms(values: Float64) -> Float64:
            return 1 - np.log10(np.maximum(self.shares(values), smallest)) / first

        return self.mapped(logarithms, minimum=high + first, maximum=high)

    def shares(self, normalized: Float64) -> Float64:
        """Return normalised values as shares of the maximum, where no value is negative."""
        low, extent, _ = self._scaled_range()
        return np.asarray((low + extent * normalized) / (low + extent))


class ValueRange(NamedTuple):
    """The range of values."""

    minimum: float
    maximum: float


def sample_volume(volume: Volume, statistics: Statistics | ValueRange, fill: float = 0.0) -> VoxelSample:
    """Return a sample of a volume that is not constant.

    statistics: give the range. fill: the normalised value of voxels outside it, and of those without data.
    Raises InputError if the volume's file has changed.
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
    # Isolated voxels leave no hole.
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
    """Return values on the six faces of [z, y, x], as many of each face; [n].

    Small ones are repeated: an object that reaches through two faces of a slab does not fill most of its border.
    """
    sides = [side.ravel() for axis in range(3) for side in (cube.take(0, axis), cube.take(-1, axis))]
    num = max(side.size for side in sides)
    return np.concatenate([side[np.arange(num) * side.size // num] for side in sides])


@dataclass(frozen=True)
class Background:
    """A range of values that surrounds the object, noise included, normalised.

    middle: its middle. low, high: its ends; the object is beyond them.
    is_there: whether the values at the border stand apart from the others.
    below, above: the part of all voxels on either side.
    """

    middle: float
    low: float
    high: float
    is_there: bool
    below: float
    above: float

    @property
    def has_much_below(self) -> bool:
        """Return whether the part below it counts beside the part above it."""
        return self.below > _ONE_SIDED_RATIO * self.above

    @property
    def has_much_above(self) -> bool:
        """Return whether the part above it counts beside the part below it."""
        return self.above > _ONE_SIDED_RATIO * self.below


def find_background(sample: VoxelSample) -> Background:
    """Find the shortest interval with half of the values on the volume's six faces, and widen it by its noise.

    The interval, the "shorth", is a robust estimate of the mode: objects may reach through a third of the border (P. J.
    Rousseeuw, A. M. Leroy, "Robust Regression and Outlier Detection", Wiley 1987). Where the object fills more of it,
    a quarter of the values tells the background better than half of them.
    """
    return background_at(sample, *sample.valid_values())


def background_at(sample: VoxelSample, border: Float64, shares: Float64) -> Background:
    """Find the background by the values at a border, [m], as `find_background`. shares: all values, [n]."""
    border = np.sort(border)
    half, quarter = shortest_interval(border, 0.5), shortest_interval(border, 0.25)
    wide, narrow = np.ptp(half) / _SIGMAS_OF_HALF, np.ptp(quarter) / _SIGMAS_OF_QUARTER
    num_within = np.unique(border[(border >= half[0]) & (border <= half[1])]).size
    low, high = np.percentile(shares, _CONTRAST_PERCENTILES).tolist()
    extent = max(high - low, 1e-9)
    is_mixed = narrow < min(_MAX_QUARTER_RATIO * wide, _MAX_QUARTER * extent) and num_within > _MAX_GREY_STEPS
    part, (begin, end), noise = (0.25, quarter, narrow) if is_mixed else (0.5, half, wide)
    sigma = max(float(noise), _MIN_SIGMA * extent)
    middle = (begin + end) / 2
    bottom, top = middle - _NOISE_SIGMAS * sigma, middle + _NOISE_SIGMAS * sigma
    inside = np.count_nonzero((border >= bottom) & (border <= top)) / len(border)
    below, above = float(np.mean(shares < bottom)), float(np.mean(shares > top))
    is_like_the_rest = 1 - inside > _MIN_LIKENESS * (below + above) and is_smooth(sample, bottom, top)
    is_there = bool(extent / sigma >= _MIN_CONTRAST and inside >= part and not is_like_the_rest)
    return Background(middle, bottom, top, is_there, below, above)


def without(sample: VoxelSample, are_away: Bools) -> VoxelSample:
    """Return a sample with background, noise included, in place of some of its voxels, bool [z, y, x]."""
    background, (border, _) = find_background(sample), sample.valid_values()
    noise = border[(border >= background.low) & (border <= background.high)]

    return sample.mapped(lambda values: fill_with_noise(values, np.broadcast_to(are_away, values.shape), noise))


def fill_with_noise(values: Float64, are_filled: Bools, noise: Float64) -> Float64:
    """Return values, some of which are replaced by values of noise, [n]."""
    values, filled = values.copy(), np.flatnonzero(are_filled)
    values.flat[filled] = noise[filled % len(noise)]
    return values


def shortest_interval(ascending: Float64, part: float) -> tuple[float, float]:
    """Return the ends of the shortest interval with a part of the values."""
    num = int(len(ascending) * part)
    first = int((ascending[num:] - ascending[: len(ascending) - num]).argmin())
    return float(ascending[first]), float(ascending[first + num])


def is_about_zero(sample: VoxelSample) -> bool:
    """Return whether the median of the valid values is near the data value 0, compared with their spread."""
    shares = sample.normalized[sample.is_valid]
    return abs(float(np.median(shares)) - sample.normalize(0.0)) < float(np.std(shares)) / 2


def is_smooth(sample: VoxelSample, low: float, high: float = math.inf) -> bool:
    """Return whether the values from `low` to `high` are those of a field.

    The mean second difference along x, divided by the mean first difference, is about 0.2 in a smooth field, 0.5 to 0.8
    at the edges of a scan, and 1.7 in noise.
    """
    chosen = (sample.normalized > low) & (sample.normalized < high)
    before, after = sample.neighbours[0][chosen], sample.neighbours[1][chosen]
    first = float(np.abs(after - before).sum())
    second = float(np.abs(before + after - 2 * sample.normalized[chosen]).sum())
    return second < _SMOOTH * first


def noise_reach(sample: VoxelSample, middle: float) -> float:
    """Return how far noise reaches from the middle of a map of statistics, normalised; 0 where there is no such map.

    Voxels of exactly the middle lie outside of what the map is of, and do not count. Something must stand out.
    """
    distances = np.abs(sample.normalized[sample.is_valid] - middle)
    distances = distances[distances > SAME]
    if not distances.size:
        return 0.0
    near, far = np.percentile(distances, (30, 70)).tolist()
    sigma = far / _SIGMAS_OF_70_PERCENT
    is_normal = _NORMAL_RATIOS[0] * near < far < _NORMAL_RATIOS[1] * near
    stands_out = np.count_nonzero(distances > _OUTSTANDING_SIGMAS * sigma) >= _MIN_OUTSTANDING
    return _MAP_NOISE_SIGMAS * sigma if is_normal and stands_out else 0.0


def is_noise(sample: VoxelSample) -> bool:
    """Return whether the values are nothing but noise: neighbours along x are not alike."""
    here, beside = (values - sample.normalized.mean() for values in (sample.normalized, sample.neighbours[1]))
    return float((here * beside).mean()) < _MIN_CORRELATION * float(here.var())
