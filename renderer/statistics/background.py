"""Find the background of a volume, with its noise, by the voxels at the border."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.statistics.smoothness import is_smooth
from renderer.statistics.voxel_sample import VoxelSample
from renderer.volume import Bools, Float64

# In a normal distribution the half of the values that is nearest to the mean lies within 0.674 standard deviations, and
# the nearest quarter within 0.319.
_SIGMAS_OF_HALF = 2 * 0.6745
_SIGMAS_OF_QUARTER = 2 * 0.3186
# Where the object fills much of the border, half of its values are a mixture, and a quarter tells the background. A
# mixture shows by the width of the quarter: it is at most this part of the width of the half, as standard deviations,
_MAX_QUARTER_RATIO = 0.4
# and at most this part of the range.
_MAX_QUARTER = 0.02
# The largest number of different values in the half for which widths tell nothing.
_MAX_GREY_STEPS = 8
# The background ends this many standard deviations from its middle: of ten million voxels of noise six are outside.
_NOISE_SIGMAS = 5.0
# The least standard deviation of a background, as a part of the range: for one without noise.
_MIN_SIGMA = 1 / 500
# The smallest range of the values, in standard deviations of the background. With less the border is like the rest of
# the volume: the range is 10 for a normal distribution, 15 for a skewed one.
_MIN_CONTRAST = 15.0
# In a smooth field, values beyond the background have at least this share of the border, compared with their share of
# the volume, where the border is like the rest and no background. Backgrounds of scans are noise, with second
# differences of at least 0.85 times the first.
_MIN_LIKENESS = 0.5
# The smallest share of voxels on one side of the background, compared with the other side, that counts.
_ONE_SIDED_RATIO = 0.15
# Percentiles outside which values are ignored when contrast is measured.
_CONTRAST_PERCENTILES = (0.01, 99.99)


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


def fill_with_background(sample: VoxelSample, are_away: Bools) -> VoxelSample:
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
