"""Find the values at given ranks among all values of a volume: exact, in a few passes and in bounded memory.

Integers and IEEE floats, with their signs turned, are unsigned integers in the same order. The first pass counts the 16
upper bits that differ. Each further pass counts the next 16 bits of the values that may have a wanted rank.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.volume import Array

Chunks = Callable[[], Iterator[Array]]
Counts = npt.NDArray[np.int64]

_BITS = 16


@dataclass(frozen=True)
class OrderedKeys:
    """Unsigned keys in the order of the values.

    dtype: of the values. low: the key of the smallest value, subtracted from all. shift: lower bits left out in
        `count`. num: counted numbers, at most 2**16.
    """

    dtype: np.dtype[np.generic]
    low: int
    shift: int
    num: int

    def keys(self, chunk: Array) -> Array:
        """Return the keys of values of any shape: unsigned, from 0, in the order of the values."""
        keys = _sortable_bits(chunk)
        return np.asarray(keys - keys.dtype.type(self.low))

    def count(self, chunk: Array) -> Counts:
        """Return how many values have each number; int64 [num]."""
        keys = self.keys(chunk)
        return np.bincount((keys >> keys.dtype.type(self.shift)).astype(np.int64), minlength=self.num)

    def value(self, key: int) -> int | float:
        """Return the value of a key."""
        ordered, sign = key + self.low, 1 << (8 * self.dtype.itemsize - 1)
        if self.dtype.kind == "i":
            ordered ^= sign
        elif self.dtype.kind == "f":
            ordered = ordered ^ sign if ordered & sign else ordered ^ (2 * sign - 1)
        number: int | float = np.array([ordered], f"u{self.dtype.itemsize}").view(self.dtype)[0].item()
        return number


def make_ordered_keys(dtype: np.dtype[np.generic], minimum: float, maximum: float) -> OrderedKeys:
    """Make the keys for values of a native integer or float type with this range."""
    low, high = (int(_sortable_bits(np.array([end], dtype))[0]) for end in (minimum, maximum))
    shift = max(0, (high - low).bit_length() - _BITS)
    return OrderedKeys(dtype, low, shift, (high - low >> shift) + 1)


def values_at_ranks(
    ranks: Iterable[int], counts: Counts, ordered_keys: OrderedKeys, chunks: Chunks
) -> dict[int, int | float]:
    """Return the value of each rank, from 0 for the smallest.

    counts: of all values, from `OrderedKeys.count`. chunks: begins a pass over all values; called at most three times,
        and not at all if the counted numbers are the values.
    """
    wanted = sorted(set(ranks))
    before = np.concatenate([[0], np.cumsum(counts)])
    prefixes = (np.searchsorted(before, wanted, side="right") - 1).tolist()
    within = [rank - int(before[prefix]) for rank, prefix in zip(wanted, prefixes, strict=True)]
    first, shift = np.isin(np.arange(ordered_keys.num), prefixes), ordered_keys.shift
    while shift:
        step = min(shift, _BITS)
        tables = _count_next(sorted(set(prefixes)), step, shift, first, ordered_keys, chunks)
        shift -= step
        for k, prefix in enumerate(prefixes):
            before = np.concatenate([[0], np.cumsum(tables[prefix])])
            bits = int(np.searchsorted(before, within[k], side="right")) - 1
            prefixes[k], within[k] = (prefix << step) + bits, within[k] - int(before[bits])
    return {rank: ordered_keys.value(key) for rank, key in zip(wanted, prefixes, strict=True)}


def _count_next(
    prefixes: Sequence[int], step: int, shift: int, first: Array, ordered_keys: OrderedKeys, chunks: Chunks
) -> dict[int, Counts]:
    """Count the next 2**step numbers in keys that begin with a prefix, before their `shift` lower bits.

    first: which of the first pass's numbers are of interest.
    """
    counts = np.zeros((len(prefixes), 1 << step), np.int64)
    for chunk in chunks():
        keys = ordered_keys.keys(chunk)
        kind = keys.dtype.type
        keys = keys[first[keys >> kind(ordered_keys.shift)]]
        sought = np.array(prefixes, keys.dtype)
        upper = keys >> kind(shift)
        at = np.searchsorted(sought, upper, side="right") - 1
        is_sought = (at >= 0) & (sought[at] == upper)
        bits = (keys[is_sought] >> kind(shift - step)) & kind((1 << step) - 1)
        place = (at[is_sought] << step) + bits.astype(np.int64)
        counts += np.bincount(place, minlength=counts.size).reshape(counts.shape)
    return dict(zip(prefixes, counts, strict=True))


def _sortable_bits(chunk: Array) -> Array:
    """Return unsigned integers of the same size in the order of the values; -0 is 0."""
    size, kind = chunk.dtype.itemsize, chunk.dtype.kind
    unsigned = np.dtype(f"u{size}")
    sign = unsigned.type(1 << (8 * size - 1))
    if kind == "u":
        return chunk
    if kind == "i":
        return np.asarray(chunk.view(unsigned) ^ sign)
    bits = (chunk + chunk.dtype.type(0)).view(unsigned)
    negative = (bits.view(f"i{size}") >> (8 * size - 1)).view(unsigned)  # all ones, or 0
    return np.asarray(bits ^ (negative | sign))
