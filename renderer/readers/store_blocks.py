"""Define the blocks of chunks in which a part of a level of a store is read."""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from renderer.volume import Bools, Int64, VolumeLevel

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

    def shape_in(self, within: Ranges) -> tuple[int, ...]:
        """Return the shape of an array of the blocks that meet a box: their numbers and their voxels, along z, y, x."""
        counts = [len(each) for each in self._near(within)]
        return (*counts[::-1], *self.size[::-1])

    def tiles(self, within: Ranges) -> Iterator[tuple[tuple[int, ...], Ranges]]:
        """Yield the place of each chosen block in an array of the blocks that meet a box, and its ranges of voxels.

        The place is along z, y, x; the ranges are along x, y, z, and none leaves the box.
        """
        xs, ys, zs = self._near(within)
        chosen = self.wanted[zs.start : zs.stop, ys.start : ys.stop, xs.start : xs.stop]
        for place in np.argwhere(chosen).tolist():
            numbers = [near[at] for near, at in zip((xs, ys, zs), place[::-1], strict=True)]
            ranges = tuple(
                (max(number * side, low), min((number + 1) * side, high))
                for number, side, (low, high) in zip(numbers, self.size, within, strict=True)
            )
            yield tuple(place), ranges

    def part_of_tile(self, ranges: Ranges) -> tuple[slice, ...]:
        """Return the part of a block, along z, y, x, that has these voxels, given by ranges along x, y, z."""
        pairs = zip(ranges, self.size, strict=True)
        return tuple(slice(low % side, low % side + high - low) for (low, high), side in pairs)[::-1]

    def places(self, within: Ranges) -> tuple[Int64, ...]:
        """Return the numbers, for z, y and x, whose sums are the places of a box's voxels in the array of blocks."""
        found, in_block, of_block = list[Int64](), 1, math.prod(self.size)
        for side, (low, high), near in zip(self.size, within, self._near(within), strict=True):
            block, inside = np.divmod(np.arange(low, high), side)
            found.append((block - near.start) * of_block + inside * in_block)
            in_block, of_block = in_block * side, of_block * len(near)
        return tuple(found[::-1])

    def _near(self, within: Ranges) -> list[range]:
        """Return the numbers, along x, y, z, of the blocks that meet a box."""
        return [range(low // side, -(-high // side)) for side, (low, high) in zip(self.size, within, strict=True)]

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
