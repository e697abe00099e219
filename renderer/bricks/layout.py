"""Define the places of the cells of a brick and its halo, and the voxels that kernels read into bricks."""

from __future__ import annotations

import numpy as np

from renderer.kernels import Classifier, Voxels
from renderer.transfer import raw_voxels
from renderer.volume import Int32, Volume

# The number of octree levels between a brick and its cells.
BRICK_LEVELS = 4
# The number of cells along each side of a brick.
BRICK_SIZE = 1 << BRICK_LEVELS
# The width, in cells, of a brick's halo: the layer of neighbouring cells around the brick.
HALO = 1
# The number of cells along each side of a brick with its halo.
PADDED_BRICK_SIZE = BRICK_SIZE + 2 * HALO


def brick_grid_shape(volume: Volume, level: int) -> tuple[int, int, int]:
    """Return the number of bricks of a level along z, y, x."""
    z, y, x = (((num - 1) >> (level + BRICK_LEVELS)) + 1 for num in volume.values.shape)
    return z, y, x


def grid_cells(shape: tuple[int, ...]) -> Int32:
    """Return the places (x, y, z) of all cells of a grid, x fastest: int32 [n, 3].

    shape: the number of cells along z, y, x.
    """
    return np.ascontiguousarray(np.indices(shape, np.int32).reshape(3, -1)[::-1].T)


def voxels_of(volume: Volume, classifier: Classifier) -> Voxels:
    """Return a volume's voxels in the form that kernels read. classifier: the classifier of the volume."""
    return Voxels(raw_voxels(volume), classifier.scalars, volume.num_absent > 0, volume.is_labels)
