"""Find the background of a volume, with its noise, by the voxels at the border."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.statistics.smoothness import is_smooth
from renderer.statistics.voxel_sample import VoxelSample
from renderer.volume import Bools, Float64

# The width, in standard deviations, of the shortest interval that holds half of a normal distribution.
_SIGMAS_OF_HALF = 2 * 0.6745
# The width, in standard deviations, of the shortest interval that holds a quarter of a normal distribution.
_SIGMAS_OF_QUARTER = 2 * 0.3186
# Where the object fills much of the border, the shortest interval with half of the border's values holds values of the
# object, too, and the shortest interval with a quarter of the border's values is much narrower. The background is found
# by the quarter if the standard deviation that follows from the quarter's width is less than this part of the standard
# deviation that follows from the half's width.
_MAX_QUARTER_RATIO = 0.4
# The background is found by the shortest interval with a quarter of the border's values only if the standard deviation
# that follows from this interval's width is less than this part of the range of all values.
_MAX_QUARTER = 0.02
# If the shortest interval with half of the border's values holds at most this many different values, it gives the
# background: grey steps are too coarse for a comparison with the interval with a quarter of the values.
_MAX_GREY_STEPS = 8
# The background ends this many standard deviations from its middle: of ten million voxels of noise, six are outside.
_NOISE_SIGMAS = 5.0
# The least standard deviation of a background, as a part of the range of all values; backgrounds without noise have it.
_MIN_SIGMA = 1 / 500
# There is a background only if the range of all values is at least this many standard deviations of the background. A
# smaller range means that the border is like all of the volume: a normal distribution has a range of 10, a skewed one
# of 15.
_MIN_CONTRAST = 15.0
# A smooth field has no background if values beyond the supposed background are about as frequent on the border as in
# the volume: if their share of the border is more than this part of their share of the volume. A scan's background is
# not smooth but noise, whose second differences are at least 0.85 times as large as the first.
_MIN_LIKENESS = 0.5
# Voxels on one side of the background count if there are more than this many for each voxel on the other side.
_ONE_SIDED_RATIO = 0.15
# Whether the border stands apart is judged by the range of all values, between these percentiles; values outside are
# ignored.
_CONTRAST_PERCENTILES = (0.01, 99.99)


@dataclass(frozen=True)
class Background:
    """The range of the normalised values, noise included, of the background that surrounds the object.

    middle: the middle of the range.
    low, high: the ends of the range; the values of the object are beyond these ends.
    is_there: whether there is a background: whether the values at the border stand apart from all other values.
    below, above: the shares of all voxels whose values are below and above the range.
    """

    middle: float
    low: float
    high: float
    is_there: bool
    below: float
    above: float

    @property
    def has_much_below(self) -> bool:
        """Return whether enough voxels are below the background to count beside those above it."""
        return self.below > _ONE_SIDED_RATIO * self.above

    @property
    def has_much_above(self) -> bool:
        """Return whether enough voxels are above the background to count beside those below it."""
        return self.above > _ONE_SIDED_RATIO * self.below


def find_background(sample: VoxelSample) -> Background:
    """Return the background: the shortest interval with half of the values on the volume's six faces, and its noise.

    The interval, the "shorth", is a robust estimate of the mode: objects may reach through a third of the border (P. J.
    Rousseeuw, A. M. Leroy, "Robust Regression and Outlier Detection", Wiley 1987). Where the object fills more of the
    border, the shortest interval with a quarter of the values is the better estimate.
    """
    return background_at(sample, *sample.valid_values())


def background_at(sample: VoxelSample, border: Float64, shares: Float64) -> Background:
    """Find the background by the shortest interval with half of the values on the border, as `find_background` does.

    border: the normalised values on the border, float64 [m]. shares: all normalised values, float64 [n].
    """
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
    """Return a sample in which some voxels have the background's values, noise included.

    are_away: which voxels get values of the background, bool [z, y, x].
    """
    background, (border, _) = find_background(sample), sample.valid_values()
    noise = border[(border >= background.low) & (border <= background.high)]

    return sample.mapped(lambda values: fill_with_noise(values, np.broadcast_to(are_away, values.shape), noise))


def fill_with_noise(values: Float64, are_filled: Bools, noise: Float64) -> Float64:
    """Return the values, with the values at `are_filled` replaced by values taken from `noise`, [n]."""
    values, filled = values.copy(), np.flatnonzero(are_filled)
    values.flat[filled] = noise[filled % len(noise)]
    return values


def shortest_interval(ascending: Float64, part: float) -> tuple[float, float]:
    """Return the ends of the shortest interval that holds the share `part` of sorted values. ascending: the values."""
    num = int(len(ascending) * part)
    first = int((ascending[num:] - ascending[: len(ascending) - num]).argmin())
    return float(ascending[first]), float(ascending[first + num])
