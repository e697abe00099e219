"""Pass over the voxels of a volume slab by slab, by one thread or several, and tell a watcher how far a pass is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

from renderer.kernels import ThreadPool
from renderer.system import num_cores
from renderer.volume.arrays import Array
from renderer.volume.mapped_file import MappedFile

# The number of bytes of a slab of a pass by one thread; whole planes are taken.
_SLAB_BYTES = 16 << 20
# The number of bytes of a slab of a pass by several threads; whole planes are taken. It is small enough that a slab
# stays in the processor's cache.
_SLAB_BYTES_OF_THREAD = 1 << 20

# A function that is called at the beginning of each pass, and after each slab: with the number of bytes that were read,
# with the number of bytes of all voxels, and with a word for what is read, such as `voxels` or `level 1`.
PassWatcher = Callable[[int, int, str], None]
_watcher: ContextVar[PassWatcher | None] = ContextVar("_watcher", default=None)

Result = TypeVar("Result")


@contextmanager
def watched_passes(watcher: PassWatcher) -> Iterator[None]:
    """Tell a watcher of all passes over voxels that this thread makes in a `with` block."""
    before = _watcher.set(watcher)
    try:
        yield
    finally:
        _watcher.reset(before)


def tell_pass(num_read: int, num_bytes: int, what: str = "voxels") -> None:
    """Tell the watcher how many bytes of a pass were read; 0 begins a pass."""
    watcher = _watcher.get()
    if watcher is not None:
        watcher(num_read, num_bytes, what)


def iter_slabs(values: Array, source: MappedFile | None, num_bytes: int = _SLAB_BYTES) -> Iterator[Array]:
    """Yield the values [z, y, x] as slabs of a few planes.

    Raises InputError if the file of the values was changed, which is checked before each slab and at the end.
    """
    _tell(values, 0)
    read = 0
    for slab in _slabs(values, source, num_bytes):
        yield slab
        read += len(slab)
        _tell(values, read)


def map_slabs(work: Callable[[int, Array], Result], values: Array, source: MappedFile | None) -> list[Result]:
    """Return `work(first, slab)` for all slabs of an array, in their order. first: the index of the first plane.

    values: [n, ...], of which a plane is `values[k]`. source: the file that the values are mapped from, if any. Raises
    InputError if that file has changed.
    """
    num = max(1, _SLAB_BYTES_OF_THREAD // values[0].nbytes)
    found = list[Result]()
    _tell(values, 0)
    with ThreadPool(min(num_cores(), -(-len(values) // num))) as pool:
        slabs = enumerate(_slabs(values, source, _SLAB_BYTES_OF_THREAD))
        for each in pool.each(lambda each: work(each[0] * num, each[1]), slabs):
            found.append(each)
            _tell(values, min(len(found) * num, len(values)))
    if source is not None:
        source.require_unchanged()
    return found


def _slabs(values: Array, source: MappedFile | None, num_bytes: int) -> Iterator[Array]:
    num = max(1, num_bytes // values[0].nbytes)
    for first in range(0, len(values), num):
        if source is not None:
            source.require_unchanged()
        yield values[first : first + num]
    if source is not None:
        source.require_unchanged()


def _tell(values: Array, num_read: int) -> None:
    """Tell the watcher how many planes of a pass were read."""
    tell_pass(values.nbytes * num_read // len(values), values.nbytes)
