"""What a volume's values are: range, percentiles, histogram, and the ranges that look like materials."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.suggest.nodata import OutlierSplit, OutlierValue, ValueCluster, end_cluster_ranks, find_outliers
from renderer.suggest.percentiles import Chunks, Counts, OrderedKeys, make_ordered_keys, values_at_ranks
from renderer.volume import Array, Float64, MappedFile

# Every value of 16-bit data has a bin of its own, and wider types are resolved as finely.
MAX_BINS = 2**16

PERCENTILES = (1.0, 5.0, 25.0, 50.0, 75.0, 95.0, 99.0)

# Materials are looked for at the resolution of 8-bit data: finer bins hold too few voxels to show valleys.
_NUM_COARSE = 256

# Where the others are fewer values than that, no value is far from them: these are steps, or labels.
_MIN_OTHER_VALUES = 16

# Values are looked at in runs of this many, so that no float64 copy of the volume is ever made.
_CHUNK = 2**20

HALF_OF_LARGEST = float(np.finfo(np.float64).max) / 2

# A middle class this dominant is what the two outer ones stand out from: a signed field around zero.
_DOMINANT = 0.9


@dataclass(frozen=True)
class Statistics:
    """Of all voxels.

    minimum, maximum: exact, int for integer volumes and float otherwise.
    mean: in float64.
    counts: int64 [n], voxels by bin.
    bins: float64 [n], the middle of each bin; integers whose range fits 16 bits have a bin for every value.
    bin_width: in data units.
    percentiles: of PERCENTILES, exact: the least value that at least so many of the voxels do not exceed.
    far: values that are far from all others, of which alone `others` are the statistics; empty and None where there
        are none.
    """

    minimum: int | float
    maximum: int | float
    mean: float
    counts: npt.NDArray[np.int64]
    bins: Float64
    bin_width: float
    percentiles: Mapping[float, int | float]
    outliers: tuple[OutlierValue, ...] = ()
    without_outliers: Statistics | None = None


@dataclass(frozen=True)
class ValueRange:
    """Values from `low` to `high`, both included; `typical` is their median, `share` their part of all voxels."""

    name: str
    low: float
    high: float
    median: float
    fraction: float


def compute_statistics(values: Array, source: MappedFile | None = None) -> Statistics:
    """Statistics of finite integer or float values of any shape, C-contiguous, in memory bounded by a chunk.

    source: the file that they are mapped from, if any; raises InputError where it is not what it was.
    """
    chunks = partial(_chunks, values, source)
    whole, apart = _measure(values.dtype, chunks)
    if apart is None:
        return whole
    others, _ = _measure(values.dtype, partial(_within, chunks, apart.low, apart.high))
    if np.count_nonzero(others.counts) < _MIN_OTHER_VALUES:
        return whole
    return replace(whole, outliers=apart.outliers, without_outliers=others)


def _measure(dtype: np.dtype[Any], chunks: Chunks) -> tuple[Statistics, OutlierSplit | None]:
    """Statistics of all values, and which of them are far from the others, if any."""
    ends = [(chunk.min().item(), chunk.max().item(), chunk.size) for chunk in chunks()]
    minimum, maximum = min(low for low, _, _ in ends), max(high for _, high, _ in ends)
    size = sum(num for _, _, num in ends)
    # Times a power of two that brings the values into [-1/2, 1/2]: neither their sum nor their range overflows.
    scale = np.float64(math.ldexp(1.0, min(-1 - math.frexp(max(abs(minimum), abs(maximum)))[1], 1000)))
    mean = sum(float(np.sum(chunk * scale)) for chunk in chunks()) / size / scale
    low, extent = minimum * scale, maximum * scale - minimum * scale
    is_counted = dtype.kind in "iu" and maximum - minimum < MAX_BINS
    if is_counted:
        width, bins = 1.0, np.arange(maximum - minimum + 1) + float(minimum)
    elif extent == 0.0:
        width, bins = 0.0, np.array([minimum], np.float64)
    else:
        width, bins = extent / MAX_BINS / scale, (low + extent * ((np.arange(MAX_BINS) + 0.5) / MAX_BINS)) / scale
    counts = np.zeros(len(bins), np.int64)
    ordered_keys = make_ordered_keys(dtype, minimum, maximum)
    key_counts = np.zeros(ordered_keys.num, np.int64)
    for chunk in chunks():
        if is_counted:  # wraps around to the right unsigned number, whatever the type
            index = (chunk - dtype.type(minimum)).view(f"u{dtype.itemsize}").astype(np.int64)
        elif extent == 0.0:
            index = np.zeros(chunk.shape, np.int64)
        else:
            index = ((chunk * scale - low) / (extent / MAX_BINS)).astype(np.int64)
        counts += np.bincount(np.minimum(index, len(bins) - 1), minlength=len(bins))
        key_counts += ordered_keys.count(chunk)
    percentiles, apart = _by_rank(key_counts, ordered_keys, chunks)
    return Statistics(minimum, maximum, mean, counts, bins, width, percentiles), apart


def _by_rank(
    counts: Counts, ordered_keys: OrderedKeys, chunks: Chunks
) -> tuple[dict[float, int | float], OutlierSplit | None]:
    """The percentiles, and the values that are far from the others. counts: as `OrderedKeys.count` gives them."""
    size = int(counts.sum())
    ranks = {percent: max(math.ceil(percent * size / 100), 1) - 1 for percent in PERCENTILES}
    ends = end_cluster_ranks(counts)
    at_ends = [rank for end in ends for pair in end for rank in pair]
    found = values_at_ranks([*ranks.values(), *at_ends], counts, ordered_keys, chunks)
    lowest, highest = ([ValueCluster(found[a], found[b], b - a + 1) for a, b in end] for end in ends)
    apart = find_outliers(lowest, highest, int(np.count_nonzero(counts)), size)
    return {percent: found[rank] for percent, rank in ranks.items()}, apart


def _within(chunks: Chunks, low: float, high: float) -> Iterator[Array]:
    """The values from `low` to `high`, both included."""
    for chunk in chunks():
        inside = chunk[(chunk >= low) & (chunk <= high)]
        if inside.size:
            yield inside


def _chunks(values: Array, source: MappedFile | None) -> Iterator[Array]:
    flat = values.reshape(-1)
    for begin in range(0, flat.size, _CHUNK):
        if source is not None:
            source.require_unchanged()
        yield flat[begin : begin + _CHUNK]
    if source is not None:
        source.require_unchanged()


def _per_part(statistics: Statistics, num_bins: int) -> int:
    return -(-len(statistics.counts) // num_bins)


def rebin(statistics: Statistics, num_bins: int) -> tuple[npt.NDArray[np.int64], Float64]:
    """(counts, edges): int64 [m] and float64 [m + 1], m <= num_bins equal parts of the range.

    Every part holds the same number of the original bins, except the last, which may hold fewer.
    """
    num, per_part = len(statistics.counts), _per_part(statistics, num_bins)
    num_parts = -(-num // per_part)
    padded = np.zeros(num_parts * per_part, np.int64)
    padded[:num] = statistics.counts
    # Halves: the range of float64 may be more than the largest number.
    half_first, half_width = statistics.bins[0] / 2 - statistics.bin_width / 4, statistics.bin_width / 2
    half_edges = half_first + np.arange(num_parts + 1) * per_part * half_width
    edges = 2 * np.clip(half_edges, -HALF_OF_LARGEST, HALF_OF_LARGEST)
    return padded.reshape(num_parts, per_part).sum(axis=1), edges


def suggest_ranges(statistics: Statistics) -> tuple[ValueRange, ...]:
    """One to three ranges, ascending, no value between them: `background`, `material 1`, `material 2`.

    N. Otsu, "A Threshold Selection Method from Gray-Level Histograms", IEEE Trans. SMC 9(1), 1979: the threshold with
    the largest variance between the two sides. It is applied to all values, then to those above, because a small dense
    part hardly moves the thresholds of a joint optimum; each threshold is moved to the least populated value between
    the medians of its two sides.
    """
    counts, _ = rebin(statistics, _NUM_COARSE)
    cuts: list[int] = []
    begin = 0
    for _ in range(2):
        cut = _split(counts[begin:])
        if cut is None:
            break
        begin += cut
        cuts.append(begin)
    bounds = [0, *cuts, len(counts)]
    total = float(counts.sum())
    shares = [float(counts[a:b].sum()) / total for a, b in pairwise(bounds)]
    names = ["background", "material 1", "material 2"][: len(shares)]
    if len(shares) == 1:
        names = ["material 1"]
    elif len(shares) == 3 and shares[1] > _DOMINANT:
        names = ["material 1", "background", "material 2"]
    ranges, per_part = [], _per_part(statistics, _NUM_COARSE)
    for name, (a, b), share in zip(names, pairwise(bounds), shares, strict=True):
        inside = slice(a * per_part, b * per_part)
        occupied = statistics.bins[inside][statistics.counts[inside] > 0]
        low = float(statistics.minimum if a == 0 else occupied[0])
        high = float(statistics.maximum if b == len(counts) else occupied[-1])
        cumulative = np.cumsum(statistics.counts[inside])
        typical = float(statistics.bins[inside][np.searchsorted(cumulative, cumulative[-1] / 2)])
        ranges.append(ValueRange(name, low, high, min(max(typical, low), high), share))
    return tuple(ranges)


def _split(counts: npt.NDArray[np.int64]) -> int | None:
    """The first bin of the upper of two classes, or None where there are no two."""
    if np.count_nonzero(counts) < 2:
        return None
    weight = counts.astype(np.float64)
    place = np.arange(len(counts))
    below, above = np.cumsum(weight)[:-1], weight.sum() - np.cumsum(weight)[:-1]
    moment = np.cumsum(weight * place)[:-1]
    with np.errstate(invalid="ignore", divide="ignore"):
        between = (moment * above - (float(weight @ place) - moment) * below) ** 2 / (below * above)
    best = int(np.nanargmax(between)) + 1
    low = int(np.searchsorted(np.cumsum(weight[:best]), weight[:best].sum() / 2))
    high = best + int(np.searchsorted(np.cumsum(weight[best:]), weight[best:].sum() / 2))
    # A box of five bins keeps single empty bins of stretched data from passing for a valley.
    smooth = np.convolve(np.pad(weight, 2, mode="edge"), np.full(5, 0.2), mode="valid")
    valley = smooth[low + 1 : high + 1]
    lowest = np.flatnonzero(valley == valley.min())
    return low + 1 + int(lowest[len(lowest) // 2])
