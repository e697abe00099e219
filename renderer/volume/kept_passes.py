"""Keep what a pass over voxels in a file found, so that a later process need not read the voxels.

The voxels are known by the place, the size and both times of the last change of their file. Programs can set the time
of the last change of the content, and not that of the state. A file that was changed a moment ago is not trusted: a
second change may leave it the same times.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from renderer.cache import CacheFolder, KeptArrays, cache_folder, numbers_from_array, numbers_to_array
from renderer.volume.arrays import Array
from renderer.volume.mapped_file import MappedFile, place_in_file, time_of_change

# The seconds after its last change from which on a file is trusted. FAT has the coarsest times, of 2 s.
_SETTLED = 2.0


def kept_pass(
    kind: str, values: Array, source: MappedFile | None, make: Callable[[], Mapping[str, Array]], facts: object = ()
) -> Mapping[str, Array]:
    """Return arrays that `make` makes in a pass over voxels, or those that an earlier pass left in the cache.

    kind: a word for the pass. values: the voxels, C-contiguous. source: the file that they are mapped from; without
    one, nothing is kept. facts: all that the arrays depend on besides the voxels. Raises InputError if the file has
    changed.
    """
    folder = cache_folder()
    if source is None or folder is None:
        return make()
    place = str(source.path), source.state, time_of_change(source), place_in_file(values)
    entry = KeptArrays(folder, kind, (place, values.dtype.str, values.shape, facts))
    found = entry.find()
    if found is None and _is_settled(source, folder):
        with entry.making() as found:
            if found is None:
                made = make()
                entry.keep(made)
                return made
    if found is None:
        return make()
    source.require_unchanged()
    return found


def _is_settled(source: MappedFile, folder: CacheFolder) -> bool:
    """Return whether a file is trusted to have other times once it is changed again. Entries of the cache stay."""
    if source.may_go:
        return True
    try:
        return folder.now() - source.state[3] * 1e-9 > _SETTLED
    except OSError:
        return False


def kept_numbers(
    kind: str, values: Array, source: MappedFile | None, make: Callable[[], object], facts: object = ()
) -> Any:
    """Return plain data that `make` makes in a pass over voxels, or those that an earlier pass left, as `kept_pass`.

    The data are lists, whole numbers and floats; tuples become lists.
    """
    found = kept_pass(kind, values, source, lambda: {"numbers": numbers_to_array(make())}, facts)
    return numbers_from_array(found["numbers"])
