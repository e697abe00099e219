"""Find the values at given ranks among all values of a volume: exact, in a few passes and in bounded memory.

Values become unsigned integers, their keys, in the same order: for IEEE floats, the lower bits of negative numbers are
inverted. The first pass counts how often each pattern of the upper 16 of the bits in which keys differ occurs. Each
further pass counts the next 16 bits, of the keys that may have a wanted rank.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.volume import Array

# A function that begins a pass over all values of a volume, in chunks.
Chunks = Callable[[], Iterator[Array]]
Counts = npt.NDArray[np.int64]

# The number of bits of the keys that one pass over all values counts.
_BITS = 16


@dataclass(frozen=True)
class OrderedKeys:
    """A mapping of values to unsigned integer keys that ascend as the values do.

    dtype: the dtype of the values.
    low: the integer in whose place the smallest value stands; it is subtracted, so that keys begin at 0.
    shift: the number of lower bits of keys that `count` leaves out.
    num: the number of counters that `count` returns, at most 2**16.
    """

    dtype: np.dtype[np.generic]
    low: int
    shift: int
    num: int

    def keys(self, chunk: Array) -> Array:
        """Return the keys of values: unsigned integers from 0 on, in the order of the values. chunk: any shape."""
        ordered = _ordered_integers(chunk).view(f"u{chunk.itemsize}")
        return np.asarray(ordered - ordered.dtype.type(self.low % (1 << 8 * chunk.itemsize)))

    def count(self, chunk: Array) -> Counts:
        """Return how many values have each pattern of the upper bits of keys, int64 [num]."""
        return np.bincount((self.keys(chunk) >> self.shift).astype(np.int64), minlength=self.num)

    def value(self, key: int) -> int | float:
        """Return the value that has a key."""
        is_float = self.dtype.kind == "f"
        integer = np.array([key + self.low], f"i{self.dtype.itemsize}" if is_float else self.dtype)
        number: int | float = (_turned(integer).view(self.dtype) if is_float else integer)[0].item()
        return number


def make_ordered_keys(dtype: np.dtype[np.generic], minimum: float, maximum: float) -> OrderedKeys:
    """Make the keys for values from `minimum` to `maximum` of a native integer or float type."""
    low, high = (int(_ordered_integers(np.array([end], dtype))[0]) for end in (minimum, maximum))
    shift = max(0, (high - low).bit_length() - _BITS)
    return OrderedKeys(dtype, low, shift, (high - low >> shift) + 1)


def values_at_ranks(
    ranks: Sequence[int], counts: Counts, ordered_keys: OrderedKeys, chunks: Chunks
) -> dict[int, int | float]:
    """Return the value of each rank; the smallest value has the rank 0.

    counts: the counts of all values, from `OrderedKeys.count`. chunks: a function that begins a pass over all values;
        called at most three times, and not at all if each value has a counter of its own.
    """
    keys, within = dict.fromkeys(ranks, 0), {rank: rank for rank in ranks}
    tables, shift, step = {0: counts}, ordered_keys.shift, _BITS
    is_near = np.zeros(ordered_keys.num, bool)  # whether a counter's values may have a wanted rank
    while True:
        for rank, key in keys.items():
            before = np.concatenate([[0], np.cumsum(tables[key])])
            bits = int(np.searchsorted(before, within[rank], side="right")) - 1
            keys[rank], within[rank] = (key << step) + bits, within[rank] - int(before[bits])
        if shift == 0:
            return {rank: ordered_keys.value(key) for rank, key in keys.items()}
        step = min(shift, _BITS)
        is_near[[key >> (ordered_keys.shift - shift) for key in keys.values()]] = True
        tables = {key: np.zeros(1 << step, np.int64) for key in keys.values()}
        for chunk in chunks():
            chunk_keys = ordered_keys.keys(chunk)
            chunk_keys = chunk_keys[is_near[chunk_keys >> ordered_keys.shift]]
            upper = chunk_keys >> shift
            for key in tables:
                following = chunk_keys[upper == key] >> (shift - step) & ((1 << step) - 1)
                tables[key] += np.bincount(following.astype(np.int64), minlength=1 << step)
        shift -= step


def _ordered_integers(chunk: Array) -> Array:
    """Return integers in the order of the values, with as many bytes as the values; -0.0 counts as 0.0."""
    if chunk.dtype.kind != "f":
        return chunk
    return _turned((chunk + chunk.dtype.type(0)).view(f"i{chunk.itemsize}"))


def _turned(bits: Array) -> Array:
    """Invert the lower bits of negative floats, so that bits read as signed integers ascend as the floats do.

    bits: the bits of floats as signed integers. A second call restores them.
    """
    return np.asarray(bits ^ (bits >> (8 * bits.itemsize - 1) & np.iinfo(bits.dtype).max))
