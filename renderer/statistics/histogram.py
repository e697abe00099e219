"""Compute the statistics of a volume: range, percentiles, histogram and outliers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter

import numpy as np

from renderer.cache import numbers_from_array, numbers_to_array
from renderer.statistics.isolated import MAX_FRACTION, OutlierValue, find_isolated
from renderer.statistics.percentiles import Chunks, make_ordered_keys, values_at_ranks
from renderer.statistics.value_counts import ValueCounts, count_values, has_narrow_integers
from renderer.volume import Array, Float64, Int64, MappedFile, iter_slabs, kept_numbers, kept_pass

# The largest number of bins of a histogram. If at most this many integers are in the range of the values, each of them
# has its own bin; other values are divided into this many bins.
MAX_BINS = 2**16

# The percentages for which `Statistics` has percentiles of the values.
PERCENTILES = (1.0, 5.0, 25.0, 50.0, 75.0, 95.0, 99.0)

# A volume has outliers only if its other voxels have at least this many different values. A volume with fewer values
# has steps or labels.
_MIN_OTHER_VALUES = 16
# The largest number of rounds of the search for outliers. Far outliers hide nearer ones, which a later round finds.
_MAX_ROUNDS = 3

# Of more values than this, of types wider than 16 bits, suggestions count the values of some chunks. Counting 2^27
# float32 numbers takes 1.1 s.
MOST_COUNTED = 2**27

# The beginning of the names of arrays of statistics without outliers, among the arrays of all values.
_PREFIX_OF_OTHERS = "without_outliers_"

# The number of values in a chunk of a volume. Chunks are read one by one, so that no float64 copy of the volume is
# made.
_CHUNK = 2**20

# Half of the largest float64.
_HALF_OF_LARGEST = float(np.finfo(np.float64).max) / 2


@dataclass(frozen=True)
class Statistics:
    """The statistics of a volume: a summary of the values of all voxels that have data.

    minimum, maximum: the exact range; int for integer volumes and float otherwise.
    mean: the mean of all values, computed in float64.
    num_voxels: the number of voxels that have data.
    counts: int64 [n], the number of voxels in each bin. They may be of a sample, of fewer voxels than `num_voxels`; the
        mean and percentiles are then of the same sample.
    bins: float64 [n], the middle of each bin; integers whose range fits 16 bits have a bin for every value.
    bin_width: the width of a bin, in data units.
    percentiles: for each percentage of PERCENTILES, the smallest value that at least this share of the voxels does not
        exceed; exact.
    inner: the lowest and the highest value that are not among the voxels at each end of the range that may be outliers,
        by their number; exact.
    outliers: values that are far from all other values.
    without_outliers: the statistics of the values that are no outliers; None if no value is an outlier.
    """

    minimum: int | float
    maximum: int | float
    mean: float
    num_voxels: int
    counts: Int64
    bins: Float64
    bin_width: float
    percentiles: Mapping[float, int | float]
    inner: tuple[int | float, int | float]
    outliers: tuple[OutlierValue, ...] = ()
    without_outliers: Statistics | None = None

    def to_arrays(self) -> dict[str, Array]:
        """Return the statistics as named arrays, from which `from_arrays` makes the same statistics."""
        numbers = (
            self.minimum, self.maximum, self.mean, self.num_voxels, self.bin_width, [*self.percentiles.items()],
            self.inner, [(each.value, each.num, each.last) for each in self.outliers],
        )  # fmt: skip
        arrays = {"counts": self.counts, "bins": self.bins, "numbers": numbers_to_array(numbers)}
        others = {} if self.without_outliers is None else self.without_outliers.to_arrays()
        return arrays | {_PREFIX_OF_OTHERS + name: array for name, array in others.items()}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Array]) -> Statistics:
        """Return the statistics that `to_arrays` turned into arrays."""
        low, high, mean, num, bin_width, percentiles, inner, outliers = numbers_from_array(arrays["numbers"])
        length = len(_PREFIX_OF_OTHERS)
        others = {name[length:]: array for name, array in arrays.items() if name.startswith(_PREFIX_OF_OTHERS)}
        return cls(
            low, high, mean, num, arrays["counts"], arrays["bins"], bin_width, dict(percentiles), tuple(inner),
            tuple(OutlierValue(*each) for each in outliers), cls.from_arrays(others) if others else None,
        )  # fmt: skip

    @property
    def num_counted(self) -> int:
        """Return the number of voxels that were counted: all voxels that have data, or those of a sample."""
        return int(self.counts.sum())

    @property
    def is_of_sample(self) -> bool:
        """Return whether only some of the voxels were counted."""
        return self.num_counted < self.num_voxels


def safe_scale(minimum: float, maximum: float) -> float:
    """Return a power of two that scales values from `minimum` to `maximum` into [-1/2, 1/2].

    Neither sums of two scaled values nor their range overflow.
    """
    return math.ldexp(1.0, min(-1 - math.frexp(max(abs(minimum), abs(maximum)))[1], 1000))


def compute_statistics(values: Array, source: MappedFile | None = None, *, may_sample: bool = False) -> Statistics:
    """Compute the statistics of integer or float values in bounded memory.

    values: any shape, C-contiguous, finite except NaN where there are no data; at least one is finite. source: the file
    that the values are mapped from, if any. may_sample: whether a sample is enough if there are more than MOST_COUNTED
    values; the same sample is taken each time. Raises InputError if that file has changed.
    """
    compute = partial(_compute, values, source, may_sample=may_sample)
    return Statistics.from_arrays(
        kept_pass("statistics", values, source, lambda: compute().to_arrays(), facts=may_sample)
    )


def _compute(values: Array, source: MappedFile | None, *, may_sample: bool) -> Statistics:
    """Return the statistics of values, as `compute_statistics` does, in passes over the values."""
    measure = _measuring(values, source, may_sample=may_sample)
    whole = others = measure(-math.inf, math.inf)
    outliers: list[OutlierValue] = []
    for _ in range(_MAX_ROUNDS):
        ends = others.minimum, *others.inner, others.maximum
        found = find_isolated(values, source, ends, safe_scale(others.minimum, others.maximum))
        if found is None:
            break
        outliers += found[0]
        others = measure(*found[1:])
    if not outliers or np.count_nonzero(others.counts) < _MIN_OTHER_VALUES:
        return whole
    return replace(whole, outliers=tuple(sorted(outliers, key=attrgetter("value"))), without_outliers=others)


def _measuring(values: Array, source: MappedFile | None, *, may_sample: bool) -> Callable[[float, float], Statistics]:
    """Return a function of a range that returns the statistics of all values in the range, both ends included."""
    max_outliers = max(1, int(MAX_FRACTION * values.size))
    if has_narrow_integers(values.dtype):
        counted = count_values(values, source)
        return lambda low, high: _statistics_of_counts(counted.between(low, high), max_outliers)
    chunks = counted_chunks = partial(_chunks_of_data, values, source)
    if may_sample and values.size > MOST_COUNTED:
        some = partial(_chunks_of_data, values, source, -(-values.size // MOST_COUNTED))
        if next(some(), None) is not None:
            counted_chunks, max_outliers = some, max(1, int(MAX_FRACTION * MOST_COUNTED))

    def measure(low: float, high: float) -> Statistics:
        is_whole = low == -math.inf and high == math.inf
        whole, counted = (
            each if is_whole else partial(_values_between, each, low, high) for each in (chunks, counted_chunks)
        )
        return _statistics(values.dtype, whole, counted, max_outliers)

    return measure


def _statistics_of_counts(counted: ValueCounts, max_outliers: int) -> Statistics:
    """Return the statistics of values that are counted, as `_statistics` does."""
    bins = np.arange(counted.low, counted.high + 1, dtype=np.float64)
    ranked = _at_percents(PERCENTILES, counted.num_voxels, counted.at_ranks, max_outliers)
    return Statistics(counted.low, counted.high, counted.mean(), counted.num_voxels, counted.counts, bins, 1.0, *ranked)


def _chunks_of_data(values: Array, source: MappedFile | None, every: int = 1) -> Iterator[Array]:
    """Yield the values of a volume in chunks, without the values that are NaN.

    every: of so many chunks in a row, one is yielded, at a random place that is always the same: at regular places, all
        chunks might be of the same part of a plane.
    """
    places = np.random.default_rng(0)
    for number, chunk in enumerate(iter_slabs(values.reshape(-1), source, values.itemsize * _CHUNK)):
        if number % every == 0:
            chosen = number + int(places.integers(every))
        if number != chosen:
            continue
        least = chunk.min()
        data = chunk if not math.isnan(least) else chunk[~np.isnan(chunk)]
        if data.size:
            yield data


def _statistics(dtype: np.dtype[np.generic], whole: Chunks, chunks: Chunks, max_outliers: int) -> Statistics:
    """Return the statistics of all values, without a search for outliers.

    whole: a function that begins a pass over all values, in chunks. chunks: the same for the values that are counted.
    max_outliers: the largest number of outliers at each end of the range, among the values that are counted.
    """
    minimum, maximum, num_voxels = _extent(whole)
    scale = np.float64(safe_scale(minimum, maximum))
    low, extent = minimum * scale, maximum * scale - minimum * scale
    is_counted = dtype.kind in "iu" and maximum - minimum < MAX_BINS
    if is_counted:
        width, bins = 1.0, np.arange(maximum - minimum + 1) + float(minimum)
    elif extent == 0.0:
        width, bins = 0.0, np.array([minimum], np.float64)
    else:
        width, bins = extent / MAX_BINS / scale, (low + extent * ((np.arange(MAX_BINS) + 0.5) / MAX_BINS)) / scale
    ordered_keys = make_ordered_keys(dtype, minimum, maximum)
    key_counts, total = np.zeros(ordered_keys.num, np.int64), 0.0
    counts = key_counts if is_counted else np.zeros(len(bins), np.int64)
    for chunk in chunks():
        key_counts += ordered_keys.count(chunk)
        total += float(np.sum(chunk * scale))
        if not is_counted:  # the single bin of a constant volume has the index 0
            index = ((chunk * scale - low) / (extent / MAX_BINS or 1.0)).astype(np.int64)
            counts += np.bincount(np.minimum(index, len(bins) - 1), minlength=len(bins))
    size = int(key_counts.sum())
    at_ranks = partial(values_at_ranks, counts=key_counts, ordered_keys=ordered_keys, chunks=chunks)
    ranked = _at_percents(PERCENTILES, size, at_ranks, max_outliers)
    return Statistics(minimum, maximum, total / size / scale, num_voxels, counts, bins, width, *ranked)


def exact_percentiles(
    values: Array, source: MappedFile | None, percents: Sequence[float]
) -> Mapping[float, int | float]:
    """Return for each percentage the smallest value that at least this share of the voxels does not exceed; exact.

    values: any shape, C-contiguous, finite except NaN where there are no data. source: the file that the values are
    mapped from, if any. Raises InputError if that file has changed.
    """
    compute = partial(_exact_percentiles, values, source, percents)
    return dict(kept_numbers("percentiles", values, source, lambda: [*compute().items()], facts=percents))


def _exact_percentiles(
    values: Array, source: MappedFile | None, percents: Sequence[float]
) -> Mapping[float, int | float]:
    if has_narrow_integers(values.dtype):
        counted = count_values(values, source)
        return _at_percents(percents, counted.num_voxels, counted.at_ranks)[0]
    chunks = partial(_chunks_of_data, values, source)
    minimum, maximum, size = _extent(chunks)
    ordered_keys = make_ordered_keys(values.dtype, minimum, maximum)
    counts = np.zeros(ordered_keys.num, np.int64)
    for chunk in chunks():
        counts += ordered_keys.count(chunk)
    at_ranks = partial(values_at_ranks, counts=counts, ordered_keys=ordered_keys, chunks=chunks)
    return _at_percents(percents, size, at_ranks)[0]


def _extent(chunks: Chunks) -> tuple[int | float, int | float, int]:
    """Return the smallest and the largest value, and the number of values."""
    ends = [(chunk.min().item(), chunk.max().item(), chunk.size) for chunk in chunks()]
    return min(low for low, _, _ in ends), max(high for _, high, _ in ends), sum(num for _, _, num in ends)


def _at_percents(
    percents: Sequence[float],
    size: int,
    at_ranks: Callable[[Sequence[int]], Mapping[int, int | float]],
    max_outliers: int = 0,
) -> tuple[dict[float, int | float], tuple[int | float, int | float]]:
    """Return the values at some percentages, and `Statistics.inner`.

    size: the number of voxels. at_ranks: returns the value of each rank; the smallest value has the rank 0.
    """
    ranks = {percent: max(math.ceil(percent * size / 100), 1) - 1 for percent in percents}
    first = min(max_outliers, size - 1, *ranks.values())
    last = max(size - 1 - max_outliers, *ranks.values())
    found = at_ranks([*ranks.values(), first, last])
    return {percent: found[rank] for percent, rank in ranks.items()}, (found[first], found[last])


def _values_between(chunks: Chunks, low: float, high: float) -> Iterator[Array]:
    """Yield the values from `low` to `high`, both included."""
    for chunk in chunks():
        inside = chunk[(chunk >= low) & (chunk <= high)]
        if inside.size:
            yield inside


def rebin(statistics: Statistics, num_bins: int) -> tuple[Int64, Float64]:
    """Return a histogram with fewer bins: (counts, edges), int64 [m] and float64 [m + 1], with m <= num_bins.

    Each new bin joins the same number of the original bins, except the last, which may join fewer.
    """
    per_part = -(-len(statistics.counts) // num_bins)
    counts = np.add.reduceat(statistics.counts, np.arange(0, len(statistics.counts), per_part))
    # Edges are halved while they are computed, because the range of float64 values may exceed the largest float64.
    half_first, half_width = statistics.bins[0] / 2 - statistics.bin_width / 4, statistics.bin_width / 2
    half_edges = half_first + np.arange(len(counts) + 1) * per_part * half_width
    return counts, 2 * np.clip(half_edges, -_HALF_OF_LARGEST, _HALF_OF_LARGEST)
