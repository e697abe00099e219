"""Count the voxels of each value, for integers of at most 16 bits: all statistics follow from the counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.kernels import kernels
from renderer.volume import Array, Int64, MappedFile, kept_pass, map_slabs


@dataclass(frozen=True)
class ValueCounts:
    """The number of voxels of each value from `low` on: counts is int64 [n], without zeros at its ends."""

    low: int
    counts: Int64

    @property
    def high(self) -> int:
        """Return the largest value of a voxel."""
        return self.low + len(self.counts) - 1

    @property
    def num_voxels(self) -> int:
        """Return the number of voxels."""
        return int(self.counts.sum())

    def between(self, low: float, high: float) -> ValueCounts:
        """Return the counts of the values from `low` to `high`, both included; at least one voxel has such a value."""
        values = np.arange(self.low, self.high + 1)
        return _without_ends(self.low, np.where((values >= low) & (values <= high), self.counts, 0))

    def mean(self) -> float:
        """Return the mean of all values."""
        total = int(self.counts @ np.arange(self.low, self.high + 1))
        return total / self.num_voxels

    def at_ranks(self, ranks: Sequence[int]) -> dict[int, int | float]:
        """Return the value of each rank; the smallest value has the rank 0."""
        found = self.low + np.searchsorted(self.counts.cumsum(), ranks, side="right")
        return dict(zip(ranks, found.tolist(), strict=True))


def has_narrow_integers(dtype: np.dtype[np.generic]) -> bool:
    """Return whether values of a type can be counted by `count_values`."""
    return dtype.kind in "iu" and dtype.itemsize <= 2


def count_values(values: Array, source: MappedFile | None) -> ValueCounts:
    """Count the values of an array of narrow integers, of any shape and C-contiguous, by several threads.

    source: the file that the values are mapped from, if any. Raises InputError if that file has changed.
    """
    dtype = values.dtype
    total = kept_pass("counts", values, source, lambda: {"counts": _pattern_counts(values, source)})["counts"]
    low = int(np.iinfo(dtype).min)
    return _without_ends(low, np.roll(total, -low))  # negative numbers have the highest patterns


def _pattern_counts(values: Array, source: MappedFile | None) -> Int64:
    """Return the number of voxels of each bit pattern: int64 [patterns]."""
    dtype = values.dtype
    patterns, num = values.reshape(-1).view(f"u{dtype.itemsize}"), 1 << 8 * dtype.itemsize

    def count(_: int, slab: Array) -> Int64:
        counts = np.zeros(num, np.int64)
        kernels().count_patterns(raw=slab.reshape(1, 1, -1), counts=counts)
        return counts

    return np.asarray(sum(map_slabs(count, patterns, source), np.zeros(num, np.int64)))


def _without_ends(low: int, counts: Int64) -> ValueCounts:
    first, last = np.flatnonzero(counts)[[0, -1]].tolist()
    return ValueCounts(low + first, counts[first : last + 1])
