"""Divide values into classes that stand apart in the histogram: two classes of all values, or an object's materials."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from renderer.statistics.background import Background
from renderer.statistics.voxel_sample import VoxelSample
from renderer.volume import Float64

# The number of bins of the histograms in which thresholds are looked for.
_NUM_BINS = 256
# Values above this percentile are outliers.
_TOP_PERCENTILE = 99.99
# A bin of the histogram is the bottom of a valley only if none of this many bins above it is clearly lower.
_LOOK_AHEAD = 8
# In the search for a valley, a bin of the histogram is clearly lower than another bin if its count is less than this
# part of the other bin's count.
_DESCENT = 0.97
# The background ends at most this part of the way from its middle to the largest value.
_MAX_VALLEY = 0.5
# The largest number of materials that the values of a scan are divided into.
_MAX_CLASSES = 3
# A class of values is a material only if at least this share of its voxels differ little from all of their neighbours.
# Materials of scans have 0.5 to 0.95. A class with a smaller share, 0.01 to 0.45, consists of edges: its values lie
# between a material and its surroundings.
_MIN_FLAT = 0.5
# A voxel differs little from its neighbours if the differences are less than this part of its class's range of values.
_MAX_STEP = 0.5


def top_value(sample: VoxelSample) -> float:
    """Return the largest normalised value that is no outlier."""
    return float(np.percentile(sample.normalized, _TOP_PERCENTILE))


def foreground_threshold(sample: VoxelSample, background: Background) -> float:
    """Return the normalised value at which the object begins: the histogram's first valley above the background."""
    first, top = background.middle, top_value(sample)
    if not first < background.high < top:
        return background.high
    counts, edges = np.histogram(sample.normalized, _NUM_BINS, (first, top))
    smooth = np.convolve(counts, np.full(5, 0.2), mode="same")
    at = max(1, int(np.searchsorted(edges, background.high)))
    while at < _MAX_VALLEY * _NUM_BINS and smooth[at + 1 : at + 1 + _LOOK_AHEAD].min() < _DESCENT * smooth[at]:
        at += 1
    return float(edges[at])


def material_edges(sample: VoxelSample, first: float) -> tuple[float, ...]:
    """Return the ends of the ranges of one to three materials, ascending: normalised values from `first` on.

    A class of values that consists of edges between materials is joined to the class above it.
    """
    top = max(top_value(sample), first + 1e-6)
    counts, edges = np.histogram(sample.normalized, _NUM_BINS, (first, top))
    # Thresholds are found by the square roots of the counts, so that small materials have an influence.
    ends = [first, *(float(edges[cut]) for cut in otsu_thresholds(np.sqrt(counts), _MAX_CLASSES)), top]
    kept = [high for low, high in pairwise(ends[:-1]) if low < high and not _is_made_of_edges(sample, low, high)]
    return (first, *kept, top)


def _is_made_of_edges(sample: VoxelSample, low: float, high: float) -> bool:
    chosen = (sample.normalized >= low) & (sample.normalized < high)
    steps = np.abs(sample.neighbours[:, chosen] - sample.normalized[chosen])
    return bool(np.mean(steps.max(axis=0) < _MAX_STEP * (high - low)) < _MIN_FLAT) if steps.size else True


def otsu_threshold(values: Float64, low: float, high: float, min_separation: float = 0.0) -> float | None:
    """Return the threshold between two classes of the values from `low` to `high`.

    The classes are divided where the variance between them is largest. The threshold is then moved to the bin with the
    fewest voxels between the medians of the two classes. Returns None if there are no two classes, or if the variance
    between the classes is less than the share `min_separation` of the total variance.
    """
    if high <= low:
        return None
    counts, edges = np.histogram(values, _NUM_BINS, (low, high))
    if np.count_nonzero(counts) < 2:
        return None
    (cut,) = otsu_thresholds(counts, 2)
    # total, below, above: the sums of the values' squared distances from their mean, in bins: for all values, for the
    # values below the threshold, and for the values above it.
    total, below, above = (
        float(np.cov(np.arange(_NUM_BINS)[part], fweights=counts[part], ddof=0)) * counts[part].sum()
        for part in (slice(None), slice(cut), slice(cut, None))
    )
    if 1 - (below + above) / total < min_separation:
        return None
    cumulative = np.cumsum(counts)
    first, last = np.searchsorted(cumulative, (cumulative[cut - 1] / 2, (cumulative[cut - 1] + cumulative[-1]) / 2))
    # Counts are averaged over five bins, so that single empty bins, as stretched data have, are not taken for a valley.
    smooth = np.convolve(np.pad(counts, 2, mode="edge"), np.full(5, 0.2), mode="valid")[first + 1 : last + 1]
    lowest = np.flatnonzero(smooth <= smooth.min() * (1 + 1e-9))
    return float(edges[first + 1 + lowest[len(lowest) // 2]])


def otsu_thresholds(counts: Float64, num_classes: int) -> tuple[int, ...]:
    """Return the first bin of each class except the lowest, so that the variance between the classes is largest.

    N. Otsu, "A Threshold Selection Method from Gray-Level Histograms", IEEE Trans. SMC 9(1), 1979; P.-S. Liao et al.,
    "A Fast Algorithm for Multilevel Thresholding", J. Inf. Sci. Eng. 17, 2001. counts: the count of each bin of the
    histogram, [n].
    """
    weights = np.append(0.0, np.cumsum(counts))
    moments = np.append(0.0, np.cumsum(counts * np.arange(len(counts))))
    weight, moment = (sums[None, :] - sums[:, None] for sums in (weights, moments))
    # part[i, j]: the contribution of a class to the variance between the classes, if it begins with bin i and ends
    # before bin j.
    part = np.divide(moment**2, weight, out=np.zeros_like(weight), where=weight > 0)
    part[np.tril_indices(len(part))] = -np.inf
    best, origins = part[0], []
    for _ in range(num_classes - 1):
        joined = best[:, None] + part
        origins.append(joined.argmax(axis=0))
        best = joined.max(axis=0)
    starts = [len(counts)]
    for origin in reversed(origins):
        starts.append(int(origin[starts[-1]]))
    return tuple(reversed(starts[1:]))
