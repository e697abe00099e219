"""Make the texels of bricks: what is interpolated in a brick, for each of its cells and for the halo around them.

Texel (t, u, v) of a brick is the cell `BRICK_SIZE * brick - HALO + (t, u, v)` of its level. Beyond the volume's border
there are no cells, and the field is continued in one of two ways.

Scalars take the nearest voxel, as the truth does, also beside voxels without data (`absent.py`). Means of a level above
are not values at a point. That of the last cell, which the border may cut to the share w of its width, belongs to the
middle of what is left of it. The field is the line through that point and the centre of the cell before,

    slope = (last - before) 2 / (1 + w)        at the last centre: last + slope (1 - w) / 2        beyond: + slope

along each axis in turn, which reproduces linear fields and, exactly, constant ones. It is only followed from the middle
of the last cell to the volume's face, half of its width, so an error of a mean appears at most
(1 + 2 w) / (1 + w) + w / (1 + w) <= 2 times as large per axis. With the nearest cell instead, the mean of a ramp would
be off by half a cell's rise. Where the line falls below 0 the field is 0, and it is never brighter than the brightest
colour of the transfer function.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.bricks.absent import continue_gradients, fill_absent, mark_absent_texels
from renderer.bricks.bricks import Bricks
from renderer.bricks.layout import BRICK_SIZE, PADDED_BRICK_SIZE, fill_padded
from renderer.bricks.means import MeanCache
from renderer.compiled import inline, jit
from renderer.transfer import RawVoxels, normalize_scalar, range_width, raw_voxels
from renderer.volume import Array, Float32, Float64, Int32, Volume

# The largest power of two, as its exponent, that small scalars are multiplied by.
_LARGEST_EXPONENT = 1000

# How much a mean of tau c may exceed a mean of tau: each is rounded, to 11 bits at least.
_ROUNDING = 1 + 2.0**-9

# Texels from one to the next along x, y, z.
_STRIDES = (1, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE * PADDED_BRICK_SIZE)


def scalar_texels(bricks: Bricks, cells: Int32, *, lit: bool) -> Float32:
    """Return the scalars of bricks of level 0 at `cells` [n, 3] (x, y, z), normalized to `bricks.scalar_range` and
    clamped to +-MAX_NORMALIZED_SCALAR, float32 [n, 18, 18, 18]. Of a volume with voxels without data, the lowest bit
    is set in theirs.

    lit: [n, 18, 18, 18, 4], (u, gx, gy, gz), with the gradient in world axes: central differences at voxel centres,
    one-sided at the border and 0 along an axis of one voxel. It is divided by a number that is the same in the whole
    volume, such that differences of scalars are at most 1, and so is the largest entry of the transform to the world.

    Raises InputError where the volume's file was changed.
    """
    volume, scalars = bricks.volume, bricks.pyramid.classifier.scalars
    texels = np.empty((len(cells), *(PADDED_BRICK_SIZE,) * 3, 4 if lit else 1), np.float32)
    world_from_gradient = None
    if lit:
        world_from_gradient = _world_from_gradient(volume)
        world_from_gradient = np.ascontiguousarray(world_from_gradient / np.abs(world_from_gradient).max())
    scale = _unit_scale(*bricks.volume_range)
    volume.require_unchanged()
    raw, has_absent = raw_voxels(volume), volume.num_absent > 0
    _fill_scalars(raw, scalars, cells, bricks.scalar_range, world_from_gradient, scale, has_absent, texels)
    volume.require_unchanged()
    return texels if lit else texels[..., 0]


def texel_gradients(bricks: Bricks, magnitudes: Float64) -> Float64:
    """Return the lengths in texels of gradients of these magnitudes, in scalar units per world unit, float64 [n].

    What is far longer than any gradient in the volume may be the largest float32.
    """
    with np.errstate(over="ignore"):
        scaled = magnitudes * _unit_scale(*bricks.volume_range) / np.abs(_world_from_gradient(bricks.volume)).max()
    return np.asarray(np.minimum(scaled, np.finfo(np.float32).max))


def _world_from_gradient(volume: Volume) -> Float64:
    """Return the matrix that takes gradients per voxel to gradients per world unit, float64 [3, 3]."""
    return np.asarray(np.linalg.inv(volume.world_from_index[:3, :3]).T)


def mean_texels(bricks: Bricks, level: int, cells: Int32, cache: MeanCache | None = None) -> Float32:
    """Return (tau c, tau) times the finest spacing, of bricks of a level above 0 at `cells` [n, 3] (x, y, z), float32
    [n, 18, 18, 18, 4]; 0 where nothing is visible. cache: of means.

    Raises InputError where voxels are needed and the volume's file was changed.
    """
    texels: Float32 = (cache or MeanCache()).get(bricks.pyramid, level, cells).astype(np.float32)
    texels *= np.float32(bricks.pyramid.mean_unit)
    extents = np.array(bricks.volume.shape_xyz) / 2.0**level
    lighting = bricks.pyramid.classifier.lighting
    lit = lighting.light[3] + lighting.light[4] if lighting else 1
    brightest = max(1.0, float(bricks.transfer.colors.max()) * lit)
    _extrapolate_border(texels.reshape(len(cells), PADDED_BRICK_SIZE**3, 4), extents, brightest * _ROUNDING, cells)
    return texels


def _unit_scale(low: float, high: float) -> float:
    """Return a power of two that scales the width of a range to at most 1; to about 1, unless it is tiny."""
    return math.ldexp(1.0, min(-1 - math.frexp(high / 2 - low / 2)[1], _LARGEST_EXPONENT))


@jit
def _fill_scalars(
    raw: RawVoxels,
    scalars: Float64 | None,
    cells: Int32,
    scalar_range: tuple[float, float],
    world_from_gradient: Float64 | None,
    scale: float,
    has_absent: bool,
    texels: Float32,
) -> None:
    """Write texels [n, 18, 18, 18, c]. With the factor `scale`, no difference of two scalars overflows.

    world_from_gradient: [3, 3]; None where texels have no gradient. has_absent: whether any voxel has no data.
    """
    first = scalar_range[0]
    width, factor = range_width(first, scalar_range[1])
    margin = 0 if world_from_gradient is None else 1  # gradients need the voxels next to those of texels
    side = PADDED_BRICK_SIZE + 2 * margin
    field, bits = np.empty((side, side, side)), texels.view(np.uint32)
    if has_absent:  # and so does what takes the place of voxels without data
        around, gradients = np.empty((side + 2, side + 2, side + 2)), np.empty((side, side, side, 3))
    for i in range(len(cells)):
        if has_absent:
            fill_padded(raw, scalars, cells[i], around)
            fill_absent(around, field)
        else:
            fill_padded(raw, scalars, cells[i], field)
        for z in range(PADDED_BRICK_SIZE):
            for y in range(PADDED_BRICK_SIZE):
                for x in range(PADDED_BRICK_SIZE):
                    scalar = field[z + margin, y + margin, x + margin]
                    if math.isnan(scalar):  # far from data
                        scalar = first
                    texels[i, z, y, x, 0] = normalize_scalar(scalar, first, width, factor)
        if has_absent:
            mark_absent_texels(around, margin + 1, bits[i, :, :, :, 0])
        if world_from_gradient is not None and has_absent:
            _fill_gradients(around, raw.shape, cells[i], world_from_gradient, scale, gradients, True)
            continue_gradients(gradients, texels[i, :, :, :, 1:])
        elif world_from_gradient is not None:
            _fill_gradients(field, raw.shape, cells[i], world_from_gradient, scale, texels[i, :, :, :, 1:], None)


@jit
def _fill_gradients(
    field: Float64, shape: tuple[int, int, int], cell: Int32, m: Float64, scale: float, gradients: Array,
    gaps: bool | None,
) -> None:  # fmt: skip
    """Write the gradients of a brick, which `m` takes to the world, to [n, n, n, 3]; NaN without data.

    field: the scalars, [n + 2, n + 2, n + 2]. gaps: None where all voxels have data; the loop compiled for that takes
    half of the time.
    """
    side = gradients.shape[0]
    nearest, weights = np.empty((3, side), np.int64), np.empty((3, side))
    for axis in range(3):
        num, start = shape[2 - axis], BRICK_SIZE * cell[axis] - (side - BRICK_SIZE) // 2
        for t in range(side):
            voxel = min(max(start + t, 0), num - 1)
            weights[axis, t] = 1.0 / max(min(voxel + 1, num - 1) - max(voxel - 1, 0), 1)
            nearest[axis, t] = voxel - start  # the place of the voxel that is taken
    for t in range(side):
        for u in range(side):
            z, y = nearest[2, t], nearest[1, u]
            row = gradients[t, u]
            for x in range(side):
                here = field[z + 1, y + 1, x + 1]
                gx = _difference(field[z + 1, y + 1, x], here, field[z + 1, y + 1, x + 2], scale, weights[0, x], gaps)
                gy = _difference(field[z + 1, y, x + 1], here, field[z + 1, y + 2, x + 1], scale, weights[1, u], gaps)
                gz = _difference(field[z, y + 1, x + 1], here, field[z + 2, y + 1, x + 1], scale, weights[2, t], gaps)
                row[x, 0] = m[0, 0] * gx + m[0, 1] * gy + m[0, 2] * gz
                row[x, 1] = m[1, 0] * gx + m[1, 1] * gy + m[1, 2] * gz
                row[x, 2] = m[2, 0] * gx + m[2, 1] * gy + m[2, 2] * gz
            for x in range(side):
                if nearest[0, x] != x:
                    row[x] = row[nearest[0, x]]


@inline
def _difference(before: float, here: float, after: float, scale: float, weight: float, gaps: bool | None) -> float:
    """Return a difference times its weight, one-sided beside a voxel without data; NaN in one."""
    if gaps is not None:
        if math.isnan(here):
            return here
        if math.isnan(before):
            before, weight = here, 1.0
        if math.isnan(after):
            after, weight = here, 1.0
    return (after * scale - before * scale) * weight


@jit
def _extrapolate_border(texels: Float32, extents: Float64, brightest: float, cells: Int32) -> None:
    """Turn texels [n, 18^3, 4] of cells into texels of the field. extents: float64 [3], the volume's in cells."""
    for i in range(len(cells)):
        for axis in range(3):
            _extrapolate_axis(texels[i], axis, cells[i, axis], extents[axis], brightest)


@jit
def _extrapolate_axis(texels: Float32, axis: int, cell: int, extent: float, brightest: float) -> None:
    """Move the last cells along an axis to their centres, and continue the field beyond the volume's border.

    texels: [18^3, 4]. cell: the brick's, along the axis. extent: the volume's, in cells.
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
    """Write to the texel `at` the line through `before` and `last`, a mean over `share` of a cell, `distance` cells
    beyond the middle of the latter."""
    slope = 2.0 * (float(texels[last, 3]) - float(texels[before, 3])) / (1.0 + share)
    depth = max(float(texels[last, 3]) + distance * slope, 0.0)
    texels[at, 3] = depth
    for channel in range(3):
        slope = 2.0 * (float(texels[last, channel]) - float(texels[before, channel])) / (1.0 + share)
        value = float(texels[last, channel]) + distance * slope
        texels[at, channel] = min(max(value, 0.0), brightest * depth)
