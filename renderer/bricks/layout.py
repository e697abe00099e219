"""Where the cells of a brick and its halo lie, and the voxels that kernels read into bricks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.transfer import Classifier, RawVoxels, raw_voxels
from renderer.volume import Float64, Int32, Volume

BRICK_LEVELS = 4
BRICK_SIZE = 1 << BRICK_LEVELS
HALO = 1
PADDED_BRICK_SIZE = BRICK_SIZE + 2 * HALO


def brick_grid_shape(volume: Volume, level: int) -> tuple[int, int, int]:
    """Return the number of bricks of a level along z, y, x."""
    z, y, x = (((num - 1) >> (level + BRICK_LEVELS)) + 1 for num in volume.values.shape)
    return z, y, x


def grid_cells(shape: tuple[int, ...]) -> Int32:
    """Return all cells (x, y, z) of a grid [z, y, x], x fastest, int32 [n, 3]."""
    return np.ascontiguousarray(np.indices(shape, np.int32).reshape(3, -1)[::-1].T)


class Voxels(NamedTuple):
    """A volume's voxels, as kernels read them into bricks.

    raw: as `raw_voxels` returns them. scalars: the scalar of each bit pattern; None where voxels are scalars
        themselves. has_absent: whether any voxel has no data. is_labels: whether scalars are numbers of labels.
    """

    raw: RawVoxels
    scalars: Float64 | None
    has_absent: bool
    is_labels: bool


def voxels_of(volume: Volume, classifier: Classifier) -> Voxels:
    """Return the voxels of a volume, whose classifier this is."""
    return Voxels(raw_voxels(volume), classifier.scalars, volume.num_absent > 0, volume.is_labels)
