"""What a rasteriser interpolates in a brick: a texel for each of its cells and for the apron, the cells around them.

Texel (t, u, v) of a brick is the cell `BRICK * brick - APRON + (t, u, v)` of its level. Beyond the volume's border
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

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.brick_kernels import SIDE, apron_part, slot_at
from renderer.bricks import APRON, BRICK, Bricks
from renderer.classify import Codes, Float64, scalar_at, voxel_codes
from renderer.jit import jit

Array = npt.NDArray[Any]
Float32 = npt.NDArray[np.float32]
Int32 = npt.NDArray[np.int32]

# Scalars are held to this many ranges from the range's start: no interpolation towards a visible one overflows.
FARTHEST = 2.0**20

# Texels from one to the next along x, y, z.
_STRIDES = (1, SIDE, SIDE * SIDE)


def scalar_texels(bricks: Bricks, cells: Int32, *, lit: bool) -> Float32:
    """float32 [n, 18, 18, 18]: the scalars of bricks of level 0 at `cells` [n, 3] (x, y, z), 0 at the start of
    `bricks.scalar_range` and 1 at its end, held to +-FARTHEST.

    lit: [n, 18, 18, 18, 4], (u, gx, gy, gz), with the gradient in world axes: central differences at voxel centres,
    one-sided at the border and 0 along an axis of one voxel, over a number that is one for the whole volume and makes
    the largest possible derivative along an index axis, and the largest factor of the transform to the world, 1.
    """
    volume, scalars = bricks.volume, bricks.pyramid.classifier.scalars
    first, last = bricks.scalar_range
    codes = voxel_codes(volume)
    if not lit:
        texels = np.empty((len(cells), SIDE, SIDE, SIDE), np.float32)
        _fill_scalars(codes, scalars, cells, first, last, texels)
        return texels
    lit_texels = np.empty((len(cells), SIDE, SIDE, SIDE, 4), np.float32)
    world_from_gradient = np.linalg.inv(volume.world_from_index[:3, :3]).T
    world_from_gradient = np.ascontiguousarray(world_from_gradient / np.abs(world_from_gradient).max())
    _fill_lit_scalars(codes, scalars, cells, first, last, *bricks.volume_range, world_from_gradient, lit_texels)
    return lit_texels


def mean_texels(bricks: Bricks, level: int, cells: Int32) -> Float32:
    """float32 [n, 18, 18, 18, 4]: (tau c, tau) times the finest spacing, of bricks of a level above 0 at `cells` [n, 3]
    (x, y, z); 0 where nothing is visible."""
    pyramid, bricks_of_level = bricks.pyramid, bricks.levels[level]
    half = bricks_of_level.means.dtype == np.float16
    bits, shift = bricks_of_level.means.view(np.uint16 if half else np.uint32), np.uint32(13 if half else 0)
    # Shifted to where float32 has its bits, float16 has another bias of the exponent.
    units = (2.0**112 if half else 1.0, pyramid.mean_unit)
    texels = np.zeros((len(cells), SIDE, SIDE, SIDE, 4), np.float32)
    extents = np.array(bricks.volume.shape_xyz) / 2.0**level
    lighting = pyramid.classifier.lighting
    brightest = float(bricks.transfer.colors.max()) * (lighting.ambient + lighting.diffuse if lighting else 1.0)
    _fill_means(bits, shift, units, bricks_of_level.slots, extents, max(brightest, 1.0), cells, texels)
    return texels


@jit
def _set_nearest(cell: int, num: int, nearest: Array) -> None:
    """Which voxel each texel along an axis takes."""
    for t in range(SIDE):
        nearest[t] = min(max(BRICK * cell - APRON + t, 0), num - 1)


@jit
def _relative(scalar: float, first: float, width: float, halves: float) -> float:
    """The scalar's place in a range, held; its difference may overflow."""
    return min(max((scalar * halves - first * halves) / width, -FARTHEST), FARTHEST)


@jit
def _width(first: float, last: float) -> tuple[float, float]:
    """The width of a range times 1, or times 1/2 where it would overflow; and that factor."""
    halves = 1.0 if last - first < np.inf else 0.5
    return last * halves - first * halves, halves


@jit
def _fill_scalars(
    codes: Codes, scalars: Float64 | None, cells: Int32, first: float, last: float, texels: Float32
) -> None:
    width, halves = _width(first, last)
    x, y, z = np.empty(SIDE, np.int64), np.empty(SIDE, np.int64), np.empty(SIDE, np.int64)
    for i in range(len(cells)):
        _set_nearest(cells[i, 0], codes.shape[2], x)
        _set_nearest(cells[i, 1], codes.shape[1], y)
        _set_nearest(cells[i, 2], codes.shape[0], z)
        for t in range(SIDE):
            for u in range(SIDE):
                for v in range(SIDE):
                    scalar = scalar_at(codes, scalars, z[t], y[u], x[v])
                    texels[i, t, u, v] = _relative(scalar, first, width, halves)


@jit
def _fill_lit_scalars(
    codes: Codes,
    scalars: Float64 | None,
    cells: Int32,
    first: float,
    last: float,
    lowest: float,
    highest: float,
    world_from_gradient: Float64,
    texels: Float32,
) -> None:
    width, halves = _width(first, last)
    steepest, gradient_halves = _width(lowest, highest)
    per_unit = steepest if steepest > 0.0 else 1.0
    m = world_from_gradient
    near = np.empty((3, SIDE), np.int64)
    for i in range(len(cells)):
        for axis in range(3):
            _set_nearest(cells[i, axis], codes.shape[2 - axis], near[axis])
        for t in range(SIDE):
            for u in range(SIDE):
                for v in range(SIDE):
                    x, y, z = near[0, v], near[1, u], near[2, t]
                    scalar = scalar_at(codes, scalars, z, y, x)
                    gx = _derivative(codes, scalars, z, y, x, 2, gradient_halves) / per_unit
                    gy = _derivative(codes, scalars, z, y, x, 1, gradient_halves) / per_unit
                    gz = _derivative(codes, scalars, z, y, x, 0, gradient_halves) / per_unit
                    texels[i, t, u, v, 0] = _relative(scalar, first, width, halves)
                    texels[i, t, u, v, 1] = m[0, 0] * gx + m[0, 1] * gy + m[0, 2] * gz
                    texels[i, t, u, v, 2] = m[1, 0] * gx + m[1, 1] * gy + m[1, 2] * gz
                    texels[i, t, u, v, 3] = m[2, 0] * gx + m[2, 1] * gy + m[2, 2] * gz


@jit
def _derivative(codes: Codes, scalars: Float64 | None, z: int, y: int, x: int, axis: int, halves: float) -> float:
    """Along one axis of `codes`, per voxel and times `halves`."""
    dz, dy, dx = int(axis == 0), int(axis == 1), int(axis == 2)
    z0, y0, x0 = max(z - dz, 0), max(y - dy, 0), max(x - dx, 0)
    z1, y1, x1 = min(z + dz, codes.shape[0] - 1), min(y + dy, codes.shape[1] - 1), min(x + dx, codes.shape[2] - 1)
    low, high = scalar_at(codes, scalars, z0, y0, x0), scalar_at(codes, scalars, z1, y1, x1)
    return float((high * halves - low * halves) / max((z1 - z0) + (y1 - y0) + (x1 - x0), 1))


@jit
def _fill_means(
    bits: Array,
    shift: Any,
    units: tuple[float, float],
    slots: Int32,
    extents: Float64,
    brightest: float,
    cells: Int32,
    texels: Float32,
) -> None:
    """Texels [n, 18, 18, 18, 4], which are 0.

    bits: of the means; shifted and times the units, one after the other, they are float32. extents: float64 [3], the
    volume's along x, y, z in cells.
    """
    for i in range(len(cells)):
        for dz in range(-1, 2):
            for dy in range(-1, 2):
                for dx in range(-1, 2):
                    slot = slot_at(slots, cells[i, 0] + dx, cells[i, 1] + dy, cells[i, 2] + dz)
                    if slot >= 0:
                        _copy_means(bits[slot], shift, units, dx, dy, dz, texels[i])
        lines = texels[i].reshape(SIDE**3, 4)
        for axis in range(3):
            _continue(lines, axis, cells[i, axis], extents[axis], brightest)


@jit
def _copy_means(
    bits: Array, shift: Any, units: tuple[float, float], dx: int, dy: int, dz: int, texels: Float32
) -> None:
    """The apron's part of a neighbour [z, y, x, 4]."""
    x0, x1 = apron_part(dx)
    y0, y1 = apron_part(dy)
    z0, z1 = apron_part(dz)
    to_normal, unit = np.float32(units[0]), np.float32(units[1])
    for z in range(z0, z1 + 1):
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                for channel in range(4):
                    value = np.uint32(bits[z - BRICK * dz, y - BRICK * dy, x - BRICK * dx, channel])
                    value = np.uint32(value << shift)
                    texels[z + APRON, y + APRON, x + APRON, channel] = value.view(np.float32) * to_normal * unit


@jit
def _continue(texels: Float32, axis: int, cell: int, extent: float, brightest: float) -> None:
    """Move the last cells along an axis to their centres, and continue the field beyond the volume's border.

    texels: [18^3, 4]. cell: of the brick along the axis. extent: the volume's in cells.
    """
    num_cells = int(np.ceil(extent))
    last = num_cells - BRICK * cell  # its texel
    if cell > 0 and last > SIDE - 1:
        return
    step, other, another = _STRIDES[axis], _STRIDES[(axis + 1) % 3], _STRIDES[(axis + 2) % 3]
    share = extent - num_cells + 1.0
    to_centre = 0.5 - 0.5 * share
    for a in range(SIDE):
        for b in range(SIDE):
            line = a * other + b * another
            at = line + last * step
            if num_cells == 1:
                texels[at - step], texels[at + step] = texels[at], texels[at]
                continue
            if last < SIDE - 1:
                _set_on_line(texels, at - step, at, share, 1.0 + to_centre, at + step, brightest)
            if last <= SIDE - 1 and share < 1.0:
                _set_on_line(texels, at - step, at, share, to_centre, at, brightest)
            if cell == 0:
                _set_on_line(texels, line + 2 * step, line + step, 1.0, 1.0, line, brightest)


@jit
def _set_on_line(
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
