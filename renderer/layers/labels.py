"""Number the labels that a layer shows, and mark where a mask shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from renderer.volume import Array, Volume, iter_slabs


def number_labels(volume: Volume, shown: Sequence[int], *, as_one: bool = False) -> Volume:
    """Return a volume with a number in place of each label: 1, 2, ... of those that are shown, 0 of all others.

    shown: labels, ascending. as_one: all that are shown have the number 1. It keeps the fingerprint.
    Raises InputError where the volume's file was changed.
    """
    numbers = np.ones(len(shown), np.int64) if as_one else np.arange(1, len(shown) + 1)
    dtype = np.min_scalar_type(int(numbers.max(initial=0)))
    found = np.empty(volume.values.shape, dtype)
    start = 0
    for slab in iter_slabs(volume.values, volume.source):
        found[start : start + len(slab)] = _numbers_of(slab, np.array(shown), numbers.astype(dtype))
        start += len(slab)
    found.flags.writeable = False
    return replace(volume, values=found, source=None, num_absent=0, is_labels=True)


def _numbers_of(values: Array, shown: Array, numbers: Array) -> Array:
    """Return the numbers of labels; of those that are not shown, and of NaN, it is 0."""
    if not len(shown):
        return np.zeros(values.shape, numbers.dtype)
    if values.dtype.kind in "iu" and values.dtype.itemsize <= 2:
        lowest = np.iinfo(values.dtype).min
        table = np.zeros(1 << 8 * values.dtype.itemsize, numbers.dtype)
        is_possible = (shown >= lowest) & (shown <= np.iinfo(values.dtype).max)
        table[shown[is_possible] - lowest] = numbers[is_possible]
        return table[values.astype(np.int64) - lowest]
    at = np.minimum(np.searchsorted(shown, values), len(shown) - 1)
    return np.where(shown[at] == values, numbers[at], numbers.dtype.type(0))
