"""Compute the fingerprint of a volume when it is first asked for, in a pass that also finds the range of its values."""

from __future__ import annotations

import hashlib
import math
import threading
from collections.abc import Callable

import numpy as np

from renderer.kernels import ThreadPool
from renderer.volume.arrays import Array, Float64, UInt8
from renderer.volume.kept_passes import kept_pass
from renderer.volume.mapped_file import MappedFile
from renderer.volume.slabs import iter_slabs

# The least number of bytes of voxels for which a second thread is started: the digest of fewer takes 0.2 ms.
_LEAST_BYTES = 1 << 18


class Fingerprint:
    """The fingerprint of a volume: a digest of its voxels, which are read once it is asked for, and never twice.

    Threads may ask at the same time.

    values, source, colors: as in Volume. world_from_index: float64 [4, 4], in which no number is -0.0. text: the digest
    if it is known; the voxels are then not read.
    """

    def __init__(
        self,
        values: Array,
        world_from_index: Float64,
        source: MappedFile | None = None,
        colors: UInt8 | None = None,
        text: str = "",
    ) -> None:
        self.values = values
        self._place, self._source, self._colors = world_from_index, source, colors
        self._text = text
        self._range: tuple[float, float] | None = None
        self._lock = threading.Lock()

    def text(self) -> str:
        """Return the digest as hexadecimal digits. Raises InputError if the file of the voxels has changed."""
        with self._lock:
            if not self._text:
                self._read()
            return self._text

    def __eq__(self, other: object) -> bool:
        """Return whether both are fingerprints of equal volumes."""
        return isinstance(other, Fingerprint) and self.text() == other.text()

    def __hash__(self) -> int:
        """Return the same number for equal fingerprints."""
        return hash(self.text())

    def __reduce__(self) -> tuple[type[Fingerprint], tuple[object, ...]]:
        """Return the arguments by which another process makes the same fingerprint, with its text."""
        text = self.text()
        return Fingerprint, (self.values, self._place, self._source, self._colors, text)

    def range_of(self, values: Array) -> tuple[float, float] | None:
        """Return the range of values if they are the voxels of this fingerprint, and were read for it; else None."""
        return self._range if values is self.values else None

    def _read(self) -> None:
        """Find the digest and the range in the cache, or read them from the voxels."""
        source = self._source if self._colors is None else None  # the file of the values alone does not tell colours
        found = kept_pass("fingerprint", self.values, source, self._pass_over, self._place.tolist())
        low, high = found["range"].tolist()
        self._range = low, high
        self._text = found["digest_of_voxels"].tobytes().hex()

    def _pass_over(self) -> dict[str, Array]:
        """Pass over the voxels: one thread adds a slab to the digest, another finds the slab's range."""
        digest = hashlib.blake2b(f"{self.values.dtype.name} {self.values.shape}".encode(), digest_size=16)
        digest.update(self._place.data.cast("B"))
        ends = list[tuple[float, float]]()

        def add(slab: Array) -> None:
            digest.update(slab.data.cast("B"))

        def measure(slab: Array) -> None:
            ends.append(slab_range(slab))

        def apply(each: tuple[Callable[[Array], None], Array]) -> None:
            each[0](each[1])

        with ThreadPool(2 if self.values.nbytes > _LEAST_BYTES else 1) as pool:
            for slab in iter_slabs(self.values, self._source):
                pool.map(apply, ((add, slab), (measure, slab)))
        if self._colors is not None:
            digest.update(self._colors.data.cast("B"))
        return {"range": np.array(joined_range(ends)), "digest_of_voxels": np.frombuffer(digest.digest(), np.uint8)}


def slab_range(values: Array) -> tuple[float, float]:
    """Return the smallest and the largest value without NaN; infinite ends in the wrong order if there is no value."""
    low, high = values.min(), values.max()
    if np.isnan(low):
        data = values[~np.isnan(values)]
        if not data.size:
            return math.inf, -math.inf
        low, high = data.min(), data.max()
    return float(low), float(high)


def joined_range(ends: list[tuple[float, float]]) -> tuple[float, float]:
    """Return the range of the values of several slabs."""
    return min(low for low, _ in ends), max(high for _, high in ends)
