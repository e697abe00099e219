"""Continue the field of a brick into voxels without data, which are NaN, as it is continued beyond the volume's border.

A voxel covers the points that are nearest to it: what a voxel without data covers is not drawn. Between a voxel and one
without data, the field is interpolated to the mean of the nearest of the latter's 26 neighbours that have data. Beside
a plane of voxels that is the voxel itself, so that data surrounded by NaN look as they do alone.

A texel tells by its lowest bit whether its voxel has no data.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.bricks.layout import HALO, PADDED_BRICK_SIZE
from renderer.compiled import jit
from renderer.transfer import one_sided
from renderer.volume import Array, Float32, Float64, Int32

# Means of up to twelve numbers do not overflow.
_SCALE = 16.0


@jit
def fill_absent(field: Float64, filled: Float64) -> bool:
    """Write the inside of a field [n + 2, n + 2, n + 2] to `filled` [n, n, n], continued into voxels without data.

    What has no neighbour with data stays NaN. Return whether all data.
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
def fill_gradients_beside_absent(
    field: Float64, shape: tuple[int, int, int], first: Int32, m: Float64, scale: float, texels: Float32
) -> None:
    """Write gradients, which `m` takes to the world, to texels [18, 18, 18, 1:], continued into voxels without data.

    field: [22, 22, 22], with two voxels around the texels. first: the voxel (x, y, z) of the first texel.
    """
    side = PADDED_BRICK_SIZE + 2 * HALO
    gradients, filled = np.empty((3, side, side, side)), np.empty((side - 2, side - 2, side - 2))
    at, step, difference = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3)
    for place in np.ndindex((side, side, side)):
        for axis in range(3):  # of the nearest voxel
            start = first[axis] - HALO
            at[axis] = min(max(start + place[2 - axis], 0), shape[2 - axis] - 1) - start + HALO
        here = field[at[2], at[1], at[0]]
        for axis in range(3):
            step[:] = 0
            step[axis] = 1
            voxel = at[axis] + first[axis] - 2 * HALO
            before, after, low, high = one_sided(
                field[at[2] - step[2], at[1] - step[1], at[0] - step[0]] if voxel > 0 else np.nan, here,
                field[at[2] + step[2], at[1] + step[1], at[0] + step[0]] if voxel < shape[2 - axis] - 1 else np.nan,
                -1, 0, 1,
            )  # fmt: skip
            difference[axis] = (after * scale - before * scale) / max(high - low, 1)
        for axis in range(3):
            row = m[axis]
            gradients[axis, place[0], place[1], place[2]] = (
                row[0] * difference[0] + row[1] * difference[1] + row[2] * difference[2]
            )
    for axis in range(3):
        fill_absent(gradients[axis], filled)
        for z, y, x in np.ndindex(filled.shape):
            texels[z, y, x, 1 + axis] = filled[z, y, x] if not math.isnan(filled[z, y, x]) else 0.0
