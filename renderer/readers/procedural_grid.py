"""Give volumes from formulas their coordinates, blocks, random numbers, waves and noise, the same on every machine.

Sums, products, quotients and square roots are correctly rounded everywhere. Sines and cube roots of numpy are not, and
sums over an axis have no order that all processors keep, so that no formula here uses them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from renderer.scene import ProceduralSource
from renderer.volume import Array

# The largest number of voxels in the arrays that are worked on at once: slabs of whole planes, or blocks of rows of
# larger planes.
SLAB_VOXELS = 2**20
# The largest number of voxels of a block, of which a formula may hold a dozen arrays: they stay in a core's cache.
BLOCK_VOXELS = 2**17

# The number of random values along an axis after which smooth noise repeats; a power of 2.
_NOISE_PERIOD = 16


@dataclass(frozen=True)
class Block:
    """A part of a volume.

    out: its voxels, uint8 [z, y, x], to be written. x, y, z: the places of voxels in the model, each along its own axis
    of three. step: the finest spacing, in lengths of the model.
    """

    out: Array
    x: Array
    y: Array
    z: Array
    step: float

    def near(self, low: Array, high: Array) -> Array:
        """Return which of many boxes overlap the block; low, high: their corners (x, y, z), [box, 3]."""
        first = [axis.flat[0] for axis in (self.x, self.y, self.z)]
        last = [axis.flat[-1] for axis in (self.x, self.y, self.z)]
        return np.asarray(np.flatnonzero(((low <= last) & (high >= first)).all(axis=1)))

    def part(self, low: Array, high: Array) -> tuple[Block, tuple[slice, slice, slice]]:
        """Return the part of the block in a box, and where it lies in the block."""
        axes = (self.x, self.y, self.z)
        x, y, z = (slice(*np.searchsorted(axis.ravel(), ends)) for axis, *ends in zip(axes, low, high, strict=True))
        at = (z, y, x)
        return Block(self.out[at], self.x[..., x], self.y[:, y], self.z[z], self.step), at


def blocks(source: ProceduralSource, values: Array, size: tuple[float, float, float]) -> Iterator[Block]:
    """Yield the blocks of a volume whose middle is the model's origin, in which a box of this size just fits.

    values: the voxels of the volume, uint8 [z, y, x].
    """
    num, spacing = np.array(source.shape), np.array(source.spacing)
    unit = float(np.min(num * spacing / np.array(size)))  # the world length of a length 1 of the model
    x, y, z = ((np.arange(n) - (n - 1) / 2) * step / unit for n, step in zip(num, spacing, strict=True))
    rows = min(len(y), max(1, BLOCK_VOXELS // len(x)))
    planes = max(1, BLOCK_VOXELS // (len(x) * rows))
    step = float(spacing.min()) / unit
    for k in range(0, len(z), planes):
        for j in range(0, len(y), rows):
            at_z, at_y = slice(k, k + planes), slice(j, j + rows)
            yield Block(values[at_z, at_y], x[None, None], y[at_y][None, :, None], z[at_z][:, None, None], step)


def row_blocks(source: ProceduralSource) -> list[slice]:
    """Return the rows of a plane as blocks of at most SLAB_VOXELS voxels, at least a row each."""
    num_x, num_y, _ = source.shape
    num_rows = max(1, SLAB_VOXELS // num_x)
    return [slice(begin, begin + num_rows) for begin in range(0, num_y, num_rows)]


def random_bytes(seed: int, first: int, num: int) -> Array:
    """Return raw random bits, uint8 [num]; unlike numpy's distributions, they are the same in all versions of numpy."""
    word, skipped = divmod(first, 8)
    random = np.random.PCG64(seed)
    random.advance(word)
    words = random.random_raw(-(-(skipped + num) // 8))
    return words.astype("<u8").view(np.uint8)[skipped : skipped + num]


def random_places(seed: int, num: int, num_columns: int = 3) -> Array:
    """Return random numbers from -1 to 1, float64 [num, num_columns]."""
    words = np.random.PCG64(seed).random_raw(num * num_columns) >> np.uint64(11)
    return np.asarray(words.astype(np.float64) * 2.0**-52 - 1).reshape(num, num_columns)


def sine(turns: Array | float) -> Array:
    """Return nearly the sine of an angle in turns, by parabolas: off by 0.001, and correctly rounded everywhere."""
    turn = turns - np.floor(np.asarray(turns) + 0.5)
    wave = 8 * turn * (1 - 2 * np.abs(turn))
    return np.asarray(wave * (0.775 + 0.225 * np.abs(wave)))


def coverage(distance: Array, blur: float) -> Array:
    """Return 1 inside of a surface and 0 outside, with a ramp as wide as `blur`; distance: signed, negative inside."""
    return np.clip(0.5 - distance / blur, 0, 1)


def smooth_noise(seed: int, x: Array, y: Array, z: Array) -> Array:
    """Return noise from 0 to 1: random at whole coordinates, and smooth between them; it repeats after 16."""
    lattice = random_bytes(seed, 0, _NOISE_PERIOD**3)
    below, shares = [], []
    for axis in (x, y, z):
        floor = np.floor(axis)
        share = axis - floor
        below.append(floor.astype(np.int16) & (_NOISE_PERIOD - 1))
        shares.append(share * share * (3 - 2 * share))
    above = [(index + 1) & (_NOISE_PERIOD - 1) for index in below]
    along_z = []
    for k in (below[2], above[2]):
        along_y = []
        for j in (below[1], above[1]):
            row = (k * _NOISE_PERIOD + j) * _NOISE_PERIOD
            first, second = (lattice[row + i].astype(np.float64) for i in (below[0], above[0]))
            along_y.append(first + (second - first) * shares[0])
        along_z.append(along_y[0] + (along_y[1] - along_y[0]) * shares[1])
    return np.asarray((along_z[0] + (along_z[1] - along_z[0]) * shares[2]) / 255)
