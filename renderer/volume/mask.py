"""Prepare a mask, a volume of the labels 0 and 1, for kernels: which points of another volume it shows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.kernels import kernels
from renderer.volume.arrays import Bools, Float64, UInt8

# What the eight voxels around a dual cell are: as in `mask.h` of the kernels.
_ALL_OUT, _ALL_IN, _MIXED = 0, 1, 2

# Voxels along each side of the blocks in which a mask is searched.
_BLOCK = 8


class MaskGrid(NamedTuple):
    """A mask on a grid of its own.

    voxels: uint8 [z, y, x], 1 in the mask. cells: uint8 [z + 1, y + 1, x + 1], what the voxels around each dual cell
        are, of which the first lies before the first voxel.
    from_index: float64 [3, 4], from places in the index space of another volume to those in the mask's.
    """

    voxels: UInt8
    cells: UInt8
    from_index: Float64


def make_mask_grid(voxels: UInt8, mask_from_world: Float64, world_from_index: Float64) -> MaskGrid:
    """Return the grid of a mask for a volume with this affine, float64 [4, 4]."""
    lowest = highest = np.pad(voxels, 1, mode="edge")
    for axis in range(3):
        before, behind = np.arange(lowest.shape[axis] - 1), np.arange(1, lowest.shape[axis])
        lowest = np.minimum(lowest.take(before, axis), lowest.take(behind, axis))
        highest = np.maximum(highest.take(before, axis), highest.take(behind, axis))
    cells = np.where(lowest == 1, _ALL_IN, np.where(highest == 0, _ALL_OUT, _MIXED)).astype(np.uint8)
    return MaskGrid(voxels, cells, np.ascontiguousarray((mask_from_world @ world_from_index)[:3]))


def shown_voxels(grid: MaskGrid, shape: tuple[int, ...]) -> UInt8:
    """Return which voxels of the other volume, [z, y, x], have their centres in a mask, uint8 of this shape."""
    out = np.empty(shape, np.uint8)
    kernels().mark_voxels(mask=grid, out=out)
    return out


def may_be_shown(grid: MaskGrid, lows: Float64, highs: Float64) -> Bools:
    """Return whether boxes may meet a mask, bool [n]. lows, highs: their corners in the other volume, [n, 3]."""
    middles, halves = (lows + highs) / 2, (highs - lows) / 2
    middles = middles @ grid.from_index[:, :3].T + grid.from_index[:, 3]
    halves = halves @ np.abs(grid.from_index[:, :3]).T + 1
    blocks, sizes = grid.voxels, np.array(grid.voxels.shape)
    for axis, size in enumerate(sizes.tolist()):
        blocks = np.maximum.reduceat(blocks, np.arange(0, size, _BLOCK), axis)
    counts = np.pad(blocks.cumsum(0, np.int64).cumsum(1).cumsum(2), (1, 0))
    low = np.clip(np.floor(middles - halves)[:, ::-1], 0, sizes).astype(np.int64) // _BLOCK
    high = -(-np.clip(np.ceil(middles + halves)[:, ::-1] + 1, 0, sizes).astype(np.int64) // _BLOCK)
    total = np.zeros(len(lows), np.int64)
    for corner in np.ndindex(2, 2, 2):
        z, y, x = (np.where(k, end, start) for k, start, end in zip(corner, low.T, high.T, strict=True))
        total += (-1) ** (3 - sum(corner)) * counts[z, y, x]
    return np.asarray(total > 0)
