"""What the values of a volume look like: the background, what stands out from it, and how smooth that is.

All of it is found in a sample of the voxels, in units of the volume's range (`Sample.shares`), so that it is the same
for data in any unit and any type.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from renderer.suggest.histogram import HALF_OF_LARGEST, Statistics
from renderer.volume import Array, Float64, Volume

Mask = npt.NDArray[np.bool_]

# Along each axis; two million voxels tell all that a transfer function needs.
_MOST_SAMPLES = 128

# Of a normal distribution half the values lie within 0.674 standard deviations of the mean.
_SIGMAS_OF_HALF = 2 * 0.6745

# The background ends this many standard deviations from its middle: of ten million voxels of noise six are outside.
_NOISE_SIGMAS = 5.0
# A background without noise is still as wide as this part of the range.
_MIN_SIGMA = 1 / 500
# Where the values reach less than this many standard deviations, those at the border are no background but like the
# rest: 10 for a normal distribution, 15 for one of some skewness.
_MIN_CONTRAST = 15.0
# What a background takes at least of the border.
_MIN_BORDER_FRACTION = 0.5
# Of the border that part must be known.
_MIN_VALID_FRACTION = 0.1
# More than so many times the voxels that were NaN, and it is others that have their value.
_MAX_NONFINITE_RATIO = 1.5
# Sides of a background: one that has less than this part of the other one's voxels does not count.
ONE_SIDED_RATIO = 0.15
# The values outside of these percentiles are outliers when contrast is judged.
_OUTLIERS = (0.01, 99.99)


@dataclass(frozen=True)
class VoxelSample:
    """Voxels on a coarser grid, as shares of the volume's range.

    shares: float64 [z, y, x] in [0, 1].
    known: bool [z, y, x], where they are of the data: not where NaN were, as far as these can be told from others, nor
        where a value was filled in.
    steps: voxels from one to the next along z, y, x.
    neighbours_x, neighbours_y: float64, the two direct neighbours of each along x and y, [2, z, y, x]; the voxel itself
    at a
        border.
    minimum, maximum: the range, data units.
    lengths: world distance between samples along z, y, x.
    diagonal: of the whole volume, world units.
    """

    normalized: Float64
    is_valid: Mask
    strides: tuple[int, int, int]
    neighbours_x: Float64
    neighbours_y: Float64
    minimum: float
    maximum: float
    spacing: tuple[float, float, float]
    diagonal: float

    def denormalize(self, share: float) -> float:
        """The data value at a share of the range, which may be below 0 or above 1."""
        half = (self.maximum / 2 - self.minimum / 2) * share
        return float(np.clip(self.minimum / 2 + half, -HALF_OF_LARGEST, HALF_OF_LARGEST)) * 2

    def normalize(self, value: float) -> float:
        """The share of the range at a data value."""
        return (value / 2 - self.minimum / 2) / (self.maximum / 2 - self.minimum / 2)

    def round_value(self, value: float, gap: float = 1.0) -> float:
        """To about a thousandth of the range, so that it can be read, or a twentieth of the `gap` to the next share, so
        that points stay apart; where there are no such decimals, as it is."""
        extent = abs(self.maximum / 2 - self.minimum / 2) * 2 * min(1.0, 50 * gap)
        if not 1e-290 < extent < 1e290:
            return value
        decimals = 3 - math.floor(math.log10(extent))
        if decimals > -12 and abs(value) < 1e15:
            return float(round(value, max(decimals, 0))) + 0.0
        # With zeros before the point, and as many digits before them as tell values apart on a large offset.
        digits = 1 + decimals + math.floor(math.log10(abs(value))) if value else 1
        return float(f"{value:.{min(max(digits, 5), 17)}g}")

    def border_values(self) -> Float64:
        """The shares on the six faces; [n]. Those that are known, but where hardly any is: then the others are around
        the object, and what they have been given is its background."""
        on_faces = faces(self.normalized)
        is_known = faces(self.is_valid)
        return on_faces[is_known] if np.mean(is_known) >= _MIN_VALID_FRACTION else on_faces

    def valid_values(self) -> Float64:
        """The shares that belong with those of the border; [n]."""
        return (
            self.normalized[self.is_valid]
            if np.mean(faces(self.is_valid)) >= _MIN_VALID_FRACTION
            else self.normalized.ravel()
        )

    def with_inverted_range(self) -> VoxelSample:
        """The same with high for low."""
        return replace(
            self,
            normalized=1 - self.normalized,
            neighbours_x=1 - self.neighbours_x,
            neighbours_y=1 - self.neighbours_y,
            minimum=self.maximum,
            maximum=self.minimum,
        )


def sample_volume(volume: Volume, statistics: Statistics, outlier_fill: float = 0.0) -> VoxelSample:
    """The sample of a volume that is not constant. Raises InputError where its file was changed.

    outlier_fill: the share of those that are not in the range of the statistics, which are of the others.
    """
    volume.require_unchanged()
    values = volume.values
    low, high = float(statistics.minimum), float(statistics.maximum)
    scale = math.ldexp(1.0, min(-1 - math.frexp(max(abs(low), abs(high)))[1], 1000))
    extent = high * scale - low * scale

    def shares(part: Array) -> Float64:
        shown = np.clip((part.astype(np.float64) * scale - low * scale) / extent, 0.0, 1.0)
        return np.where(are_within(part), shown, outlier_fill)

    def are_within(part: Array) -> Mask:
        return np.asarray((part >= statistics.minimum) & (part <= statistics.maximum))

    nz, ny, nx = values.shape
    sz, sy, sx = (-(-n // _MOST_SAMPLES) for n in values.shape)
    z, y, x = np.arange(0, nz, sz), np.arange(0, ny, sy), np.arange(0, nx, sx)

    def neighbours(axis: int) -> Float64:
        both = []
        for shift in (-1, 1):
            at_y = np.clip(y + (shift if axis == 1 else 0), 0, ny - 1)
            at_x = np.clip(x + (shift if axis == 2 else 0), 0, nx - 1)
            both.append(shares(values[np.ix_(z, at_y, at_x)]))
        return np.stack(both)

    dx, dy, dz = volume.spacing.tolist()
    sampled = values[np.ix_(z, y, x)]
    own = shares(sampled)
    sample = VoxelSample(
        normalized=own,
        is_valid=_valid_mask(volume, own, own != shares(np.array(volume.nonfinite_fill_value, values.dtype)))
        & are_within(sampled),
        strides=(sz, sy, sx),
        neighbours_x=neighbours(2),
        neighbours_y=neighbours(1),
        minimum=low,
        maximum=high,
        spacing=(dz * sz, dy * sy, dx * sx),
        diagonal=float(np.linalg.norm(volume.spacing * volume.shape_xyz)),
    )
    volume.require_unchanged()
    return sample


def _valid_mask(volume: Volume, shares: Float64, differ: Mask) -> Mask:
    """Those that `differ` from what NaN have become, unless many others are like that, too."""
    like_them = float(np.mean(~differ))
    if like_them == 1 or like_them > _MAX_NONFINITE_RATIO * volume.num_nonfinite / volume.values.size:
        return np.ones(shares.shape, bool)
    return differ


def faces(cube: Array) -> Array:
    """What is on the six faces of [z, y, x]; [n]."""
    sides = (cube[0], cube[-1], cube[:, 0], cube[:, -1], cube[:, :, 0], cube[:, :, -1])
    return np.concatenate([side.ravel() for side in sides])


@dataclass(frozen=True)
class Background:
    """The range of values that surrounds the object, noise included: shares of the volume's range.

    middle: of it. low, high: where it ends; what is beyond is the object.
    is_there: whether the values at the border stand apart from the others at all.
    below, above: the part of all voxels on either side.
    """

    middle: float
    low: float
    high: float
    is_there: bool
    below: float
    above: float


def find_background(sample: VoxelSample) -> Background:
    """The shortest interval with half of the values on the volume's six faces, widened to what its noise may reach.

    The interval, the "shorth", is a robust estimate of the mode: objects may reach through a third of the border
    (P. J. Rousseeuw, A. M. Leroy, "Robust Regression and Outlier Detection", Wiley 1987).
    """
    shares = sample.valid_values()
    border = np.sort(sample.border_values())
    half = len(border) // 2
    widths = border[half:] - border[: len(border) - half]
    first = int(widths.argmin())
    begin, end = float(border[first]), float(border[first + half])
    low, high = np.percentile(shares, _OUTLIERS).tolist()
    extent = max(high - low, 1e-9)
    sigma = max((end - begin) / _SIGMAS_OF_HALF, _MIN_SIGMA * extent)
    middle = (begin + end) / 2
    bottom, top = middle - _NOISE_SIGMAS * sigma, middle + _NOISE_SIGMAS * sigma
    inside = np.count_nonzero((border >= bottom) & (border <= top)) / len(border)
    contrast = extent / sigma  # the range without outliers, in standard deviations
    return Background(
        middle,
        bottom,
        top,
        is_there=bool(contrast >= _MIN_CONTRAST and inside >= _MIN_BORDER_FRACTION),
        below=float(np.mean(shares < bottom)),
        above=float(np.mean(shares > top)),
    )


def has_much_below(background: Background) -> bool:
    """Whether what is below a background counts beside what is above it."""
    return background.below > ONE_SIDED_RATIO * background.above


def is_about_zero(sample: VoxelSample) -> bool:
    """Whether the middle of what is known is near the data value 0, by how far it spreads."""
    shares = sample.normalized[sample.is_valid]
    return abs(float(np.median(shares)) - sample.normalize(0.0)) < float(np.std(shares)) / 2


def second_difference_ratio(sample: VoxelSample, above: float) -> float:
    """How rough the values above a share are: mean second difference by mean first difference along x.

    0.2 for a smooth field, 0.5 to 0.8 for the edges of a scan, 1.7 for noise.
    """
    chosen = sample.normalized > above
    before, after = sample.neighbours_x[0][chosen], sample.neighbours_x[1][chosen]
    first = float(np.abs(after - before).sum())
    second = float(np.abs(before + after - 2 * sample.normalized[chosen]).sum())
    return second / first if first > 0 else math.inf


def coherence(sample: VoxelSample, above: float) -> float:
    """The probability that the neighbour of a voxel above a share is above it, too: low for noise, high for objects."""
    here = sample.normalized > above
    both = sum(int(np.count_nonzero(here & (other > above))) for side in _sides(sample) for other in side)
    num = int(np.count_nonzero(here))
    return both / (4 * num) if num else 0.0


def equal_neighbour_fraction(sample: VoxelSample, background: float) -> float:
    """The part of the neighbours of the voxels of other values than the background's that have just the same value."""
    here = np.abs(sample.normalized - background) > 1e-9
    same = sum(
        int(np.count_nonzero(here & (np.abs(other - sample.normalized) <= 1e-9)))
        for side in _sides(sample)
        for other in side
    )
    num = int(np.count_nonzero(here))
    return same / (4 * num) if num else 1.0


def small_step_fraction(sample: VoxelSample, step: float) -> float:
    """The part of all unequal neighbours that differ by no more than `step`, a share of the range."""
    differences = np.concatenate(
        [np.abs(other - sample.normalized).ravel() for side in _sides(sample) for other in side]
    )
    unequal = differences[differences > 1e-9]
    return float(np.mean(unequal <= step)) if unequal.size else 0.0


def transition_value_fraction(sample: VoxelSample) -> float:
    """The part of all values, each of them counted once, most of whose voxels lie strictly between their neighbours
    along x or y: what the edges of an image go through has its voxels there, and a label has them side by side."""
    values, number = np.unique(sample.normalized, return_inverse=True)
    here, passed = sample.normalized, np.zeros(sample.normalized.shape, bool)
    for before, after in _sides(sample):
        passed |= ((before < here) & (here < after)) | ((before > here) & (here > after))
    counts = np.bincount(number.ravel(), minlength=len(values))
    return float(np.mean(np.bincount(number.ravel(), passed.ravel()) > counts / 2))


def _sides(sample: VoxelSample) -> tuple[Float64, Float64]:
    return sample.neighbours_x, sample.neighbours_y


@dataclass(frozen=True)
class OtsuThreshold:
    """Two classes of values: the first share of the upper one, and how much of the variance is between the two."""

    threshold: float
    separation: float


_NUM_BINS = 256


def otsu_threshold(shares: Float64, low: float, high: float) -> OtsuThreshold | None:
    """The threshold with the largest variance between the two sides, among the values from `low` to `high`, moved to
    the least populated value between the medians of the sides (N. Otsu, IEEE Trans. SMC 9(1), 1979); None where there
    is nothing to divide.
    """
    inside = shares[(shares >= low) & (shares <= high)]
    if inside.size == 0 or high <= low:
        return None
    counts, edges = np.histogram(inside, _NUM_BINS, (low, high))
    if np.count_nonzero(counts) < 2:
        return None
    weight, place = counts.astype(np.float64), np.arange(_NUM_BINS, dtype=np.float64)
    below, moment = np.cumsum(weight)[:-1], np.cumsum(weight * place)[:-1]
    total, mean = weight.sum(), float(weight @ place) / weight.sum()
    divides = (below > 0) & (below < total)
    between = np.zeros(len(below))
    between[divides] = (moment - mean * below)[divides] ** 2 / (below * (total - below))[divides]
    best = int(between.argmax()) + 1
    variance = float(weight @ (place - mean) ** 2) / total
    first = int(np.searchsorted(np.cumsum(weight[:best]), weight[:best].sum() / 2))
    last = best + int(np.searchsorted(np.cumsum(weight[best:]), weight[best:].sum() / 2))
    # A box of five bins keeps single empty bins of stretched data from passing for a valley.
    smooth = np.convolve(np.pad(weight, 2, mode="edge"), np.full(5, 0.2), mode="valid")[first + 1 : last + 1]
    lowest = np.flatnonzero(smooth <= smooth.min() * (1 + 1e-9))
    at = first + 1 + int(lowest[len(lowest) // 2])
    return OtsuThreshold(float(edges[at]), float(between.max()) / variance)
