"""Continue the field of a brick into voxels without data, which are NaN, as it is continued beyond the volume's border.

A voxel covers the points that are nearest to it: what a voxel without data covers is not drawn. Between a voxel and one
without data, the field is interpolated to the mean of the nearest of the latter's 26 neighbours that have data. Beside
a plane of voxels that is the voxel itself, so that data surrounded by NaN look as they do alone.

A texel tells by its lowest bit whether its voxel has no data.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.bricks.layout import PADDED_BRICK_SIZE
from renderer.compiled import jit
from renderer.volume import Array, Float32, Float64

# Means of up to twelve numbers do not overflow.
_SCALE = 16.0


@jit
def fill_absent(field: Float64, filled: Float64) -> bool:
    """Write the inside of a field [n + 2, n + 2, n + 2] to `filled` [n, n, n], continued into voxels without data.

    What has no neighbour with data stays NaN. Return whether all voxels inside have data.
    """
    is_whole = True
    for z in range(filled.shape[0]):
        for y in range(filled.shape[1]):
            for x in range(filled.shape[2]):
                value = field[z + 1, y + 1, x + 1]
                if math.isnan(value):
                    is_whole, value = False, _mean_of_nearest(field, z, y, x)
                filled[z, y, x] = value
    return is_whole


@jit
def _mean_of_nearest(field: Float64, z: int, y: int, x: int) -> float:
    """Return the mean of the nearest data among the 26 neighbours of [z + 1, y + 1, x + 1]; NaN without any."""
    for distance in range(1, 4):  # squared
        total, num = 0.0, 0
        for k in range(3):
            for j in range(3):
                for i in range(3):
                    value = field[z + k, y + j, x + i]
                    if (k - 1) ** 2 + (j - 1) ** 2 + (i - 1) ** 2 == distance and not math.isnan(value):
                        total, num = total + value / _SCALE, num + 1
        if num > 0:
            return total / num * _SCALE
    return np.nan


@jit
def mark_absent_texels(field: Float64, margin: int, bits: Array) -> None:
    """Set the lowest bits of texels, uint32 [18, 18, 18], where a field with a margin around them has no data."""
    for z in range(PADDED_BRICK_SIZE):
        for y in range(PADDED_BRICK_SIZE):
            for x in range(PADDED_BRICK_SIZE):
                value = field[z + margin, y + margin, x + margin]
                bits[z, y, x] = bits[z, y, x] & np.uint32(0xFFFFFFFE) | np.uint32(math.isnan(value))


@jit
def continue_gradients(gradients: Float64, texels: Float32) -> None:
    """Write gradients [20, 20, 20, 3] to texels [18, 18, 18, 3], continued into voxels without data; else 0."""
    filled = np.empty(texels.shape[:3])
    for axis in range(3):
        fill_absent(gradients[..., axis], filled)
        for z, y, x in np.ndindex(filled.shape):
            texels[z, y, x, axis] = filled[z, y, x] if not math.isnan(filled[z, y, x]) else 0.0
