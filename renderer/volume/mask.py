"""Prepare a mask, a volume of the labels 0 and 1, for kernels that ask which points of another volume it shows."""

from __future__ import annotations

import numpy as np

from renderer.kernels import MaskGrid, kernels
from renderer.volume.arrays import Bools, Float64, Int64, UInt8, reduce_blocks

# The number of voxels along each side of a block. Boxes are compared with whole blocks of a mask.
_BLOCK = 8


def make_mask_grid(voxels: UInt8, mask_from_world: Float64, world_from_index: Float64) -> MaskGrid:
    """Return the grid of a mask for another volume.

    voxels: the voxels of the mask, 0 and 1. mask_from_world: float64 [4, 4], the inverse of the mask's affine.
    world_from_index: float64 [4, 4], the affine of the other volume.
    """
    _, rows, columns = voxels.shape
    padded, planes = np.pad(voxels, ((0, 0), (1, 1), (1, 1)), mode="edge"), np.zeros(voxels.shape, np.uint16)
    for bit in range(9):
        y, x = divmod(bit, 3)
        planes |= padded[:, y : y + rows, x : x + columns].astype(np.uint16) << np.uint16(bit)
    return MaskGrid(planes, np.ascontiguousarray((mask_from_world @ world_from_index)[:3]))


def shown_voxels(grid: MaskGrid, shape: tuple[int, ...]) -> UInt8:
    """Return which voxels of another volume have their centres in a mask: uint8 [z, y, x].

    shape: the shape of that volume.
    """
    out = np.empty(shape, np.uint8)
    kernels().mark_voxels(mask=grid, out=out)
    return out


def meet_mask(voxels: UInt8, from_index: Float64, lows: Float64, highs: Float64) -> tuple[Bools, Bools]:
    """Return which boxes may meet a mask, and which are certainly inside of it: bool [n] each.

    voxels: the voxels of the mask. from_index: float64 [3, 4], the affine to voxel indices of the mask from those of
        the volume in which the boxes lie. lows, highs: float64 [n, 3], the lowest and highest corners (x, y, z) of the
        boxes.
    """
    middles, halves = (lows + highs) / 2, (highs - lows) / 2
    middles = middles @ from_index[:, :3].T + from_index[:, 3]
    halves = halves @ np.abs(from_index[:, :3]).T
    sizes = np.array(voxels.shape[::-1])
    is_within = ((middles - halves > -0.5 - 1e-6) & (middles + halves < sizes - 0.5 + 1e-6)).all(axis=1)
    low = np.clip(np.floor(middles - halves - 1), 0, sizes)[:, ::-1].astype(np.int64) // _BLOCK
    high = -(-np.clip(np.ceil(middles + halves + 1) + 1, 0, sizes)[:, ::-1].astype(np.int64) // _BLOCK)
    return _num_blocks(voxels == 1, low, high) > 0, is_within & (_num_blocks(voxels == 0, low, high) == 0)


def _num_blocks(are_marked: Bools, low: Int64, high: Int64) -> Int64:
    """Return the number of blocks with a marked voxel in half-open ranges of blocks (z, y, x): int64 [n].

    are_marked: which voxels are marked, [z, y, x]. low, high: the ends of the ranges, int64 [n, 3].
    """
    blocks = reduce_blocks(np.logical_or, are_marked, _BLOCK)
    counts = np.pad(blocks.cumsum(0, np.int64).cumsum(1).cumsum(2), ((1, 0),) * 3)
    total = np.zeros(len(low), np.int64)
    for corner in np.ndindex(2, 2, 2):
        z, y, x = (np.where(k, end, start) for k, start, end in zip(corner, low.T, high.T, strict=True))
        total += (-1) ** (3 - sum(corner)) * counts[z, y, x]
    return total
