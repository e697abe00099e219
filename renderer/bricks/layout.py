"""Where the cells of a brick and its halo lie: constants, and the compiled loops that read them."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.compiled import jit
from renderer.transfer import RawVoxels, scalar_at
from renderer.volume import Array, Int32, Volume

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


@jit
def fill_padded(raw: RawVoxels, by_pattern: Any, brick: Int32, out: Array) -> None:
    """Write the scalars of a brick of voxels and its halo to `out` [n, n, n], n = BRICK_SIZE + 2 halo.

    Beyond the volume's border the nearest voxel is repeated. brick: [3] (x, y, z). by_pattern: the numbers to write, by
    bit pattern; None where voxels are scalars themselves.
    """
    num_z, num_y, num_x = raw.shape
    halo = (out.shape[0] - BRICK_SIZE) // 2
    x0, y0, z0 = BRICK_SIZE * brick[0] - halo, BRICK_SIZE * brick[1] - halo, BRICK_SIZE * brick[2] - halo
    for t in range(out.shape[0]):
        z = min(max(z0 + t, 0), num_z - 1)
        for u in range(out.shape[1]):
            y = min(max(y0 + u, 0), num_y - 1)
            for v in range(out.shape[2]):
                out[t, u, v] = scalar_at(raw, by_pattern, z, y, min(max(x0 + v, 0), num_x - 1))
