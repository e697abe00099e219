"""Which value has a rank among all the values of a volume: exact, in a few passes and bounded memory.

Integers and IEEE floats are unsigned numbers in the same order, once their signs are turned. Their 16 upper bits that
differ at all are counted by one pass, and by each further pass the next 16 of those that may have a wanted rank.
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
    """How values are numbered: by their keys, less that of the smallest, without their `shift` lower bits.

    dtype: of the values. low: the key of the smallest one. num: of these numbers, at most 2**16.
    """

    dtype: np.dtype[np.generic]
    low: int
    shift: int
    num: int

    def keys(self, chunk: Array) -> Array:
        """Unsigned numbers in the order of the values, from 0; as many."""
        keys = _sortable_bits(chunk)
        return np.asarray(keys - keys.dtype.type(self.low))

    def count(self, chunk: Array) -> Counts:
        """How many values of a chunk have each number; [num]."""
        keys = self.keys(chunk)
        return np.bincount((keys >> keys.dtype.type(self.shift)).astype(np.int64), minlength=self.num)

    def value(self, key: int) -> int | float:
        """The value that has a key."""
        ordered, sign = key + self.low, 1 << (8 * self.dtype.itemsize - 1)
        if self.dtype.kind == "i":
            ordered ^= sign
        elif self.dtype.kind == "f":
            ordered = ordered ^ sign if ordered & sign else ordered ^ (2 * sign - 1)
        number: int | float = np.array([ordered], f"u{self.dtype.itemsize}").view(self.dtype)[0].item()
        return number


def make_ordered_keys(dtype: np.dtype[np.generic], minimum: float, maximum: float) -> OrderedKeys:
    """Of values of a native integer or float type that have this range."""
    low, high = (int(_sortable_bits(np.array([end], dtype))[0]) for end in (minimum, maximum))
    shift = max(0, (high - low).bit_length() - _BITS)
    return OrderedKeys(dtype, low, shift, (high - low >> shift) + 1)


def values_at_ranks(
    ranks: Iterable[int], counts: Counts, ordered_keys: OrderedKeys, chunks: Chunks
) -> dict[int, int | float]:
    """The value of each rank, from 0 for the smallest. counts: of all values, as `OrderedKeys.count` gives them.

    chunks: begins a pass over all values; there is none where these numbers are the values, and 3 at most.
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
    """How many keys that begin with a prefix, before their `shift` lower bits, go on with each of 2**step numbers.

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
    """Unsigned numbers of the same size and in the same order; -0 is 0."""
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
