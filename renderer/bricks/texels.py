"""What a rasteriser interpolates in a brick: a texel for each of its cells and for the apron, the cells around them.

Texel (t, u, v) of a brick is the cell `BRICK_SIZE * brick - HALO + (t, u, v)` of its level. Beyond the volume's border
there are no cells, and the two kinds of field are continued in two ways.

Scalars take the nearest voxel, as the truth does. Means of a level above are not values at a point; that of the last
cell, which the border may cut to the share w of its width, belongs to the middle of what is left of it. The field is
the line through that point and the centre of the cell before,

    slope = (last - before) 2 / (1 + w)        at the last centre: last + slope (1 - w) / 2        beyond: + slope

along each axis in turn, which reproduces what is linear and, exactly, what is constant. It is never followed further
than from the middle of the last cell to the volume's face, half of its width, so that no error of a mean is seen more
than (1 + 2 w) / (1 + w) + w / (1 + w) <= 2 times as large per axis; with the nearest cell instead, the mean of a ramp
would be off by half a cell's rise. Where the line falls below 0 there is nothing, and it is never brighter than the
brightest colour of the transfer function.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.bricks.bricks import BRICK_SIZE, HALO, Bricks
from renderer.bricks.kernels import PADDED_BRICK_SIZE, halo_span, slot_at
from renderer.bricks.means import MeanCache
from renderer.jit import jit
from renderer.pyramid import STREAMED_LEVELS
from renderer.transfer import Float64, RawVoxels, range_width, raw_voxels, relative, scalar_at

Array = npt.NDArray[Any]
Float32 = npt.NDArray[np.float32]
Int32 = npt.NDArray[np.int32]


# Of a power of two by which small scalars are multiplied.
_LARGEST_EXPONENT = 1000

# By how much more a mean of tau c may exceed a mean of tau: each is rounded, to 11 bits at least.
_ROUNDING = 1 + 2.0**-9

# Texels from one to the next along x, y, z.
_STRIDES = (1, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE * PADDED_BRICK_SIZE)


def scalar_texels(bricks: Bricks, cells: Int32, *, lit: bool) -> Float32:
    """float32 [n, 18, 18, 18]: the scalars of bricks of level 0 at `cells` [n, 3] (x, y, z), 0 at the start of
    `bricks.scalar_range` and 1 at its end, held to +-MAX_NORMALIZED_SCALAR.

    lit: [n, 18, 18, 18, 4], (u, gx, gy, gz), with the gradient in world axes: central differences at voxel centres,
    one-sided at the border and 0 along an axis of one voxel; over a number that is the same in the whole volume, and
    such that differences of scalars are at most 1 and the largest factor of the transform to the world is 1.

    Raises InputError where the volume's file was changed.
    """
    volume, scalars = bricks.volume, bricks.pyramid.classifier.scalars
    first, last = bricks.scalar_range
    raw = raw_voxels(volume)
    volume.require_unchanged()
    if not lit:
        texels = np.empty((len(cells), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE), np.float32)
        _fill_scalars(raw, scalars, cells, first, last, texels)
        volume.require_unchanged()
        return texels
    lit_texels = np.empty((len(cells), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, 4), np.float32)
    world_from_gradient = np.linalg.inv(volume.world_from_index[:3, :3]).T
    world_from_gradient = np.ascontiguousarray(world_from_gradient / np.abs(world_from_gradient).max())
    scale = _unit_scale(*bricks.volume_range)
    _fill_lit_scalars(raw, scalars, cells, first, last, scale, world_from_gradient, lit_texels)
    volume.require_unchanged()
    return lit_texels


def mean_texels(bricks: Bricks, level: int, cells: Int32, made: MeanCache | None = None) -> Float32:
    """float32 [n, 18, 18, 18, 4]: (tau c, tau) times the finest spacing, of bricks of a level above 0 at `cells` [n, 3]
    (x, y, z); 0 where nothing is visible. made: where bricks that are made of voxels may be kept.

    Raises InputError where voxels are needed and the volume's file was changed.
    """
    if level <= STREAMED_LEVELS:
        means = (made or MeanCache()).get(bricks.pyramid, level, cells)
        texels = means.astype(np.float32)
        texels *= np.float32(bricks.pyramid.mean_unit)
    else:
        texels = _stored_means(bricks, level, cells)
    extents = np.array(bricks.volume.shape_xyz) / 2.0**level
    lighting = bricks.pyramid.classifier.lighting
    brightest = max(1.0, float(bricks.transfer.colors.max()) * (lighting.ambient + lighting.diffuse if lighting else 1))
    _extrapolate_border(texels.reshape(len(cells), PADDED_BRICK_SIZE**3, 4), extents, brightest * _ROUNDING, cells)
    return texels


def _stored_means(bricks: Bricks, level: int, cells: Int32) -> Float32:
    """float32 [n, 18, 18, 18, 4]: those of the cells in the volume, 0 beyond."""
    pyramid, bricks_of_level = bricks.pyramid, bricks.levels[level]
    half = bricks_of_level.means.dtype == np.float16
    bits, shift = bricks_of_level.means.view(np.uint16 if half else np.uint32), np.uint32(13 if half else 0)
    # Shifted to where float32 has its bits, float16 has another bias of the exponent.
    units = (2.0**112 if half else 1.0, pyramid.mean_unit)
    bits = bits.reshape(-1, BRICK_SIZE, BRICK_SIZE, 4 * BRICK_SIZE)
    texels = np.zeros((len(cells), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, 4 * PADDED_BRICK_SIZE), np.float32)
    _fill_means(bits, shift, units, bricks_of_level.slots, cells, texels)
    return texels.reshape(len(cells), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, 4)


def _unit_scale(low: float, high: float) -> float:
    """A power of two that brings the width of a range, however large, to at most 1; about 1, but for the smallest."""
    return math.ldexp(1.0, min(-1 - math.frexp(high / 2 - low / 2)[1], _LARGEST_EXPONENT))


@jit
def _set_nearest(cell: int, num: int, nearest: Array) -> None:
    """Which voxel each texel along an axis takes."""
    for t in range(PADDED_BRICK_SIZE):
        nearest[t] = min(max(BRICK_SIZE * cell - HALO + t, 0), num - 1)


@jit
def _fill_scalars(
    raw: RawVoxels, scalars: Float64 | None, cells: Int32, first: float, last: float, texels: Float32
) -> None:
    width, halves = range_width(first, last)
    x, y, z = (
        np.empty(PADDED_BRICK_SIZE, np.int64),
        np.empty(PADDED_BRICK_SIZE, np.int64),
        np.empty(PADDED_BRICK_SIZE, np.int64),
    )
    for i in range(len(cells)):
        _set_nearest(cells[i, 0], raw.shape[2], x)
        _set_nearest(cells[i, 1], raw.shape[1], y)
        _set_nearest(cells[i, 2], raw.shape[0], z)
        for t in range(PADDED_BRICK_SIZE):
            for u in range(PADDED_BRICK_SIZE):
                for v in range(PADDED_BRICK_SIZE):
                    scalar = scalar_at(raw, scalars, z[t], y[u], x[v])
                    texels[i, t, u, v] = relative(scalar, first, width, halves)


@jit
def _fill_lit_scalars(
    raw: RawVoxels,
    scalars: Float64 | None,
    cells: Int32,
    first: float,
    last: float,
    scale: float,
    world_from_gradient: Float64,
    texels: Float32,
) -> None:
    """Texels [n, 18, 18, 18, 4]. scale: of gradients; times it, no difference of two scalars overflows."""
    width, halves = range_width(first, last)
    around = np.empty(
        (PADDED_BRICK_SIZE + 2, PADDED_BRICK_SIZE + 2, PADDED_BRICK_SIZE + 2)
    )  # the voxels of texels and those next to them
    nearest, weights = np.empty((3, PADDED_BRICK_SIZE), np.int64), np.empty((3, PADDED_BRICK_SIZE))
    m = world_from_gradient
    for i in range(len(cells)):
        _fill_padded_scalars(raw, scalars, cells[i], around)
        for axis in range(3):
            num = raw.shape[2 - axis]
            _set_nearest(cells[i, axis], num, nearest[axis])
            for t in range(PADDED_BRICK_SIZE):
                voxel = nearest[axis, t]
                weights[axis, t] = 1.0 / max(min(voxel + 1, num - 1) - max(voxel - 1, 0), 1)
            nearest[axis] -= BRICK_SIZE * cells[i, axis] - HALO  # as texels
        for t in range(PADDED_BRICK_SIZE):
            for u in range(PADDED_BRICK_SIZE):
                z, y = nearest[2, t], nearest[1, u]
                row = texels[i, t, u]
                for x in range(PADDED_BRICK_SIZE):
                    row[x, 0] = relative(around[z + 1, y + 1, x + 1], first, width, halves)
                    gx = (around[z + 1, y + 1, x + 2] * scale - around[z + 1, y + 1, x] * scale) * weights[0, x]
                    gy = (around[z + 1, y + 2, x + 1] * scale - around[z + 1, y, x + 1] * scale) * weights[1, u]
                    gz = (around[z + 2, y + 1, x + 1] * scale - around[z, y + 1, x + 1] * scale) * weights[2, t]
                    row[x, 1] = m[0, 0] * gx + m[0, 1] * gy + m[0, 2] * gz
                    row[x, 2] = m[1, 0] * gx + m[1, 1] * gy + m[1, 2] * gz
                    row[x, 3] = m[2, 0] * gx + m[2, 1] * gy + m[2, 2] * gz
                for x in range(PADDED_BRICK_SIZE):
                    if nearest[0, x] != x:
                        row[x] = row[nearest[0, x]]


@jit
def _fill_padded_scalars(raw: RawVoxels, scalars: Float64 | None, cell: Int32, around: Float64) -> None:
    """The scalars [20, 20, 20] of a brick at `cell` (x, y, z) and of two voxels around it, the nearest ones beyond the
    border."""
    num_z, num_y, num_x = raw.shape
    x0, y0, z0 = BRICK_SIZE * cell[0] - HALO - 1, BRICK_SIZE * cell[1] - HALO - 1, BRICK_SIZE * cell[2] - HALO - 1
    for t in range(PADDED_BRICK_SIZE + 2):
        z = min(max(z0 + t, 0), num_z - 1)
        for u in range(PADDED_BRICK_SIZE + 2):
            y = min(max(y0 + u, 0), num_y - 1)
            for v in range(PADDED_BRICK_SIZE + 2):
                around[t, u, v] = scalar_at(raw, scalars, z, y, min(max(x0 + v, 0), num_x - 1))


@jit
def _fill_means(
    bits: Array,
    shift: Any,
    units: tuple[float, float],
    slots: Int32,
    cells: Int32,
    texels: Float32,
) -> None:
    """Texels [n, 18, 18, 4 * 18], which are 0.

    bits: of the means [., BRICK_SIZE, BRICK_SIZE, 4 * BRICK_SIZE]; shifted and times the units, one after the other,
    they are float32.
    """
    for i in range(len(cells)):
        for dz in range(-1, 2):
            for dy in range(-1, 2):
                for dx in range(-1, 2):
                    slot = slot_at(slots, cells[i, 0] + dx, cells[i, 1] + dy, cells[i, 2] + dz)
                    if slot >= 0:
                        _copy_means(bits[slot], shift, units, dx, dy, dz, texels[i])


@jit
def _copy_means(
    bits: Array, shift: Any, units: tuple[float, float], dx: int, dy: int, dz: int, texels: Float32
) -> None:
    """The apron's part of a neighbour [z, y, 4 x] to texels [z, y, 4 x]."""
    x0, x1 = halo_span(dx)
    y0, y1 = halo_span(dy)
    z0, z1 = halo_span(dz)
    to_normal, unit = np.float32(units[0]), np.float32(units[1])
    for z in range(z0, z1 + 1):
        for y in range(y0, y1 + 1):
            row = bits[
                z - BRICK_SIZE * dz, y - BRICK_SIZE * dy, 4 * (x0 - BRICK_SIZE * dx) : 4 * (x1 + 1 - BRICK_SIZE * dx)
            ]
            texel_row = texels[z + HALO, y + HALO, 4 * (x0 + HALO) : 4 * (x1 + 1 + HALO)]
            for k in range(len(row)):
                value = np.uint32(np.uint32(row[k]) << shift)
                texel_row[k] = value.view(np.float32) * to_normal * unit


@jit
def _extrapolate_border(texels: Float32, extents: Float64, brightest: float, cells: Int32) -> None:
    """Texels [n, 18^3, 4] of cells to texels of the field. extents: float64 [3], the volume's x, y, z in cells."""
    for i in range(len(cells)):
        for axis in range(3):
            _extrapolate_axis(texels[i], axis, cells[i, axis], extents[axis], brightest)


@jit
def _extrapolate_axis(texels: Float32, axis: int, cell: int, extent: float, brightest: float) -> None:
    """Move the last cells along an axis to their centres, and continue the field beyond the volume's border.

    texels: [18^3, 4]. cell: of the brick along the axis. extent: the volume's in cells.
    """
    num_cells = int(np.ceil(extent))
    last = num_cells - BRICK_SIZE * cell  # its texel
    if cell > 0 and last > PADDED_BRICK_SIZE - 1:
        return
    step, other, another = _STRIDES[axis], _STRIDES[(axis + 1) % 3], _STRIDES[(axis + 2) % 3]
    share = extent - num_cells + 1.0
    to_centre = 0.5 - 0.5 * share
    for a in range(PADDED_BRICK_SIZE):
        for b in range(PADDED_BRICK_SIZE):
            line = a * other + b * another
            at = line + last * step
            if num_cells == 1:
                texels[at - step], texels[at + step] = texels[at], texels[at]
                continue
            if last < PADDED_BRICK_SIZE - 1:
                _set_extrapolated(texels, at - step, at, share, 1.0 + to_centre, at + step, brightest)
            if last <= PADDED_BRICK_SIZE - 1 and share < 1.0:
                _set_extrapolated(texels, at - step, at, share, to_centre, at, brightest)
            if cell == 0:
                _set_extrapolated(texels, line + 2 * step, line + step, 1.0, 1.0, line, brightest)


@jit
def _set_extrapolated(
    texels: Float32, before: int, last: int, share: float, distance: float, at: int, brightest: float
) -> None:
    """Write, to the texel `at`, the line through `before` and `last`, a mean over `share` of a cell, so many cells
    beyond the latter's middle."""
    slope = 2.0 * (float(texels[last, 3]) - float(texels[before, 3])) / (1.0 + share)
    depth = max(float(texels[last, 3]) + distance * slope, 0.0)
    texels[at, 3] = depth
    for channel in range(3):
        slope = 2.0 * (float(texels[last, channel]) - float(texels[before, channel])) / (1.0 + share)
        value = float(texels[last, channel]) + distance * slope
        texels[at, channel] = min(max(value, 0.0), brightest * depth)
