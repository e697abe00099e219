"""Join voxels into a coarse grid of cells, and find the voxels deep inside the visible part."""

from __future__ import annotations

import numpy as np

from renderer.statistics.voxel_sample import VoxelSample
from renderer.volume import Bools, Float64, grow, reduce_blocks

# The largest number of cells of the coarse grid along each axis.
_MAX_CELLS = 64
# A voxel lies deep inside the visible part if its cell is more than this many cells away from every empty cell.
_DEPTH = 3


def are_deep(sample: VoxelSample, is_visible: Bools) -> Bools:
    """Return which voxels of a sample lie deep inside its visible part, bool [z, y, x].

    is_visible: which voxels of the sample are visible, bool [z, y, x].
    """
    cells, _ = pool_voxels(is_visible, sample.spacing)
    for _ in range(_DEPTH):
        cells = ~grow(~cells, 1)
    z, y, x = (np.arange(num) // factor for num, factor in zip(is_visible.shape, _factors(is_visible), strict=True))
    return np.asarray(cells[np.ix_(z, y, x)])


def pool_voxels(is_visible: Bools, spacing: tuple[float, float, float]) -> tuple[Bools, Float64]:
    """Join voxels into the cells of a coarse grid.

    spacing: the lengths of a voxel along z, y, x. Returns which cells have a visible voxel, and the lengths of a cell.
    """
    factors = _factors(is_visible)
    return reduce_blocks(np.logical_or, is_visible, factors), np.array(spacing) * factors


def _factors(voxels: Bools) -> list[int]:
    return [-(-n // _MAX_CELLS) for n in voxels.shape]
