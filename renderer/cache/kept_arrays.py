"""Keep arrays with a digest, by which an entry with damaged or missing files is found, and made again.

Arrays are read into memory, and compared with their digest, before anything uses them: 1 GB takes about a second.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from renderer.cache.cache_folder import Array, CacheFolder, cache_folder

# The number of bytes of voxels from which on it is worth while to keep what is made of them: to make it takes a quarter
# of a second or more.
LEAST_BYTES = 64 << 20
# The name of the array that holds the digest of all others.
_DIGEST = "digest"


@dataclass(frozen=True)
class KeptArrays:
    """The arrays of an entry in the folder of this process, which may be missing.

    folder: the folder; None if nothing is kept, and nothing found. kind, facts: as in `CacheFolder.find`.
    """

    folder: CacheFolder | None
    kind: str
    facts: object

    @classmethod
    def of(cls, kind: str, facts: object, num_bytes: int) -> KeptArrays:
        """Return an entry of the folder of this process. num_bytes: the voxels that it is made from."""
        return cls(cache_folder() if num_bytes >= LEAST_BYTES else None, kind, facts)

    def find(self) -> Mapping[str, Array] | None:
        """Return the arrays, in memory and read-only; None if they were not kept. A damaged entry is removed."""
        if self.folder is None:
            return None
        try:
            mapped = self.folder.find(self.kind, self.facts)
            if mapped is None:
                return None
            found = {name: np.array(array) for name, array in mapped.items()}
        except OSError:
            return None
        digest = found.pop(_DIGEST, None)
        if digest is None or not np.array_equal(digest, _digest_of(found)):
            self.folder.remove(self.kind, self.facts)
            return None
        for array in found.values():
            array.flags.writeable = False
        return found

    @contextmanager
    def making(self) -> Iterator[Mapping[str, Array] | None]:
        """Yield the arrays, as `find` returns them; or None, for a block that makes and keeps them.

        While another process or thread is in such a block, this one waits, and finds its arrays.
        """
        found = self.find()
        if found is not None or self.folder is None:
            yield found
            return
        with self.folder.alone(self.kind, self.facts):
            yield self.find()

    def keep(self, arrays: Mapping[str, Array]) -> None:
        """Keep arrays under their names, which are names of files."""
        if self.folder is None:
            return
        with suppress(OSError):
            self.folder.add(self.kind, self.facts, {**arrays, _DIGEST: _digest_of(arrays)})


# The entry that is never there.
NOT_KEPT = KeptArrays(None, "", None)


def numbers_to_array(numbers: Any) -> Array:
    """Return an array that holds plain data: lists, whole numbers and floats, which stay apart. uint8 [n], JSON."""
    return np.frombuffer(json.dumps(numbers).encode(), np.uint8)


def numbers_from_array(array: Array) -> Any:
    """Return the plain data that `numbers_to_array` turned into an array; tuples have become lists."""
    return json.loads(array.tobytes())


def _digest_of(arrays: Mapping[str, Array]) -> Array:
    """Return the digest of arrays with their names, types and shapes: uint8 [16]."""
    found = hashlib.blake2b(digest_size=16)
    for name, array in sorted(arrays.items()):
        found.update(repr((name, array.dtype.str, array.shape)).encode())
        found.update(np.ascontiguousarray(array).reshape(-1).view(np.uint8).data)
    return np.frombuffer(found.digest(), np.uint8)
