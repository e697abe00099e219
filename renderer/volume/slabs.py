"""Pass over the voxels of a volume slab by slab, by several threads."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from renderer.kernels import ThreadPool
from renderer.system import num_cores
from renderer.volume.arrays import Array
from renderer.volume.mapped_file import MappedFile, iter_slabs

# The number of bytes of a slab; whole planes are taken. It is small enough that a slab stays in the processor's cache.
_SLAB_BYTES = 1 << 20

Result = TypeVar("Result")


def map_slabs(work: Callable[[int, Array], Result], values: Array, source: MappedFile | None) -> list[Result]:
    """Return `work(first, slab)` for all slabs of an array, in their order. first: the index of the first plane.

    values: [n, ...], of which a plane is `values[k]`. source: the file that the values are mapped from, if any. Raises
    InputError if that file has changed.
    """
    num = max(1, _SLAB_BYTES // values[0].nbytes)
    with ThreadPool(min(num_cores(), -(-len(values) // num))) as pool:
        slabs = enumerate(iter_slabs(values, source, _SLAB_BYTES))
        found = pool.map(lambda each: work(each[0] * num, each[1]), slabs)
    if source is not None:
        source.require_unchanged()
    return found
