"""Define the blocks of chunks in which a part of a level of a store is read."""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from renderer.volume import Bools, VolumeLevel

# The largest number of blocks of a level. A block then has several chunks along each axis. The choice of blocks is an
# argument of a process, which Linux limits to 128 KiB: this many bits take 43 KiB.
_MOST_BLOCKS = 2**18

Ranges = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Blocks:
    """A division of a level into equal blocks of whole chunks, and a choice of them.

    size: the number of voxels of a block along x, y, z. wanted: bool [z, y, x], the blocks that are chosen.
    """

    size: tuple[int, int, int]
    wanted: Bools

    @classmethod
    def of_level(cls, level: VolumeLevel) -> Blocks:
        """Return the blocks of a level, of which none is chosen."""
        factor = 1
        while math.prod(_counts(level, factor)) > _MOST_BLOCKS:
            factor += 1
        x, y, z = (factor * chunk for chunk in level.chunks)
        return cls((x, y, z), np.zeros(_counts(level, factor)[::-1], np.bool_))

    @classmethod
    def from_plain(cls, size: Sequence[int], shape: Sequence[int], bits: str) -> Blocks:
        """Return the blocks that `to_plain` describes."""
        x, y, z = size
        packed = np.frombuffer(zlib.decompress(base64.b85decode(bits)), np.uint8)
        return cls((x, y, z), np.unpackbits(packed, count=math.prod(shape)).astype(np.bool_).reshape(shape))

    def to_plain(self) -> tuple[Sequence[int], Sequence[int], str]:
        """Return the blocks as values that JSON can express."""
        bits = base64.b85encode(zlib.compress(np.packbits(self.wanted).tobytes())).decode("ascii")
        return self.size, self.wanted.shape, bits

    def boxes(self, within: Ranges) -> Iterator[Ranges]:
        """Yield the boxes of chosen blocks, those beside each other along x as one: ranges of voxels along x, y, z.

        within: ranges along x, y, z, which no box leaves. Boxes without voxels are left out.
        """
        padded = np.pad(self.wanted.astype(np.int8), ((0, 0), (0, 0), (1, 1)))
        changes = np.diff(padded, axis=2)
        begins, ends = np.argwhere(changes == 1), np.argwhere(changes == -1)
        for (z, y, x), (_, _, end) in zip(begins.tolist(), ends.tolist(), strict=True):
            blocks = ((x, end), (y, y + 1), (z, z + 1))
            found = tuple(
                (max(first * side, low), min(last * side, high))
                for (first, last), side, (low, high) in zip(blocks, self.size, within, strict=True)
            )
            if all(low < high for low, high in found):
                yield found


def _counts(level: VolumeLevel, factor: int) -> tuple[int, ...]:
    """Return the numbers of blocks of a level along x, y, z. factor: the number of chunks along a side of a block."""
    return tuple(-(-length // (factor * chunk)) for length, chunk in zip(level.shape, level.chunks, strict=True))
