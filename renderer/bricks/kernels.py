"""Compiled loops over bricks: fill their halo, find what is visible in them, add up the errors of their nodes.

The min-max test of `renderer.transfer` is applied to dual cells, whose corners are eight voxels: nothing in a dual cell
is visible if, and only if, an equal and even number of visibility breakpoints is at or below each corner's scalar.
Where that number is the same in a whole brick, no dual cell has to be looked at.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.jit import jit
from renderer.transfer import RawVoxels, count_breakpoints, scalar_at

Array = npt.NDArray[Any]
Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]
UInt8 = npt.NDArray[np.uint8]
UInt32 = npt.NDArray[np.uint32]

BRICK_LEVELS = 4
BRICK_SIZE = 1 << BRICK_LEVELS
HALO = 1
PADDED_BRICK_SIZE = BRICK_SIZE + 2 * HALO

# The bit of odd numbers, and the number of a dual cell whose corners differ.
_VISIBLE_BIT = np.uint32(1)


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


@jit
def find_voxel_bounds(
    raw: RawVoxels, counts_by_pattern: UInt32 | None, breakpoints: Float64, bricks: Int32, bounds: Float32
) -> None:
    """Write the visible bounds of bricks of voxels, at `bricks` [n, 3] (x, y, z), to `bounds` [z, y, x, 2, 3].

    bounds: as in BrickLevel, 0 before. counts_by_pattern: breakpoints at or below the scalar of a bit pattern; None
    where voxels are scalars themselves.
    """
    shape = (PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE)
    counts, scalars = np.empty(shape, np.uint32), np.empty(shape)
    low, high, end = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3)
    for i in range(len(bricks)):
        x, y, z = bricks[i, 0], bricks[i, 1], bricks[i, 2]
        if counts_by_pattern is not None:
            fill_padded(raw, counts_by_pattern, bricks[i], counts)
        else:
            fill_padded(raw, None, bricks[i], scalars)
            _count_in_field(breakpoints, scalars, counts)
        is_uniform = _is_uniform(counts)
        if is_uniform and counts[0, 0, 0] & _VISIBLE_BIT == 0:
            continue
        for axis in range(3):
            end[axis] = min(raw.shape[2 - axis] - BRICK_SIZE * bricks[i, axis], BRICK_SIZE)
            low[axis], high[axis] = 0, int(end[axis])  # dual cell t lies between the centres of texels t and t + 1
        if not is_uniform:
            _to_dual_cells(counts)
            _shrink_to_visible(counts, low, high)
        for axis in range(3):
            bounds[z, y, x, 0, axis] = max(low[axis] - 0.5, 0.0)
            bounds[z, y, x, 1, axis] = min(high[axis] + 0.5, end[axis])


@jit
def _count_in_field(breakpoints: Float64, scalars: Float64, counts: UInt32) -> None:
    for t in range(PADDED_BRICK_SIZE):
        for u in range(PADDED_BRICK_SIZE):
            for v in range(PADDED_BRICK_SIZE):
                counts[t, u, v] = count_breakpoints(breakpoints, scalars[t, u, v])


@jit
def _is_uniform(counts: UInt32) -> bool:
    differ = np.uint32(0)
    for t in range(PADDED_BRICK_SIZE):
        for u in range(PADDED_BRICK_SIZE):
            for v in range(PADDED_BRICK_SIZE):
                differ |= counts[t, u, v] ^ counts[0, 0, 0]
    return bool(differ == 0)


@jit
def _to_dual_cells(field: UInt32) -> None:
    """Turn numbers at voxel centres into numbers of dual cells, in place: odd where anything is visible."""
    for z in range(PADDED_BRICK_SIZE):
        for y in range(PADDED_BRICK_SIZE):
            for x in range(PADDED_BRICK_SIZE - 1):
                field[z, y, x] = field[z, y, x] if field[z, y, x] == field[z, y, x + 1] else _VISIBLE_BIT
    for z in range(PADDED_BRICK_SIZE):
        for y in range(PADDED_BRICK_SIZE - 1):
            for x in range(PADDED_BRICK_SIZE - 1):
                field[z, y, x] = field[z, y, x] if field[z, y, x] == field[z, y + 1, x] else _VISIBLE_BIT
    for z in range(PADDED_BRICK_SIZE - 1):
        for y in range(PADDED_BRICK_SIZE - 1):
            for x in range(PADDED_BRICK_SIZE - 1):
                field[z, y, x] = field[z, y, x] if field[z, y, x] == field[z + 1, y, x] else _VISIBLE_BIT


@jit
def _shrink_to_visible(field: UInt32, low: Array, high: Array) -> None:
    """Shrink low..high (x, y, z, both included) to the visible dual cells; at least one is visible."""
    x0 = y0 = z0 = PADDED_BRICK_SIZE
    x1 = y1 = z1 = -1
    for z in range(high[2] + 1):
        for y in range(high[1] + 1):
            for x in range(high[0] + 1):
                if field[z, y, x] & _VISIBLE_BIT:
                    x0, y0, z0 = min(x0, x), min(y0, y), min(z0, z)
                    x1, y1, z1 = max(x1, x), max(y1, y), max(z1, z)
    low[0], low[1], low[2] = x0, y0, z0
    high[0], high[1], high[2] = x1, y1, z1


@jit
def find_node_bounds(bounds_by_neighbour: UInt8, extents: Float64, bounds: Float32) -> None:
    """Write the visible bounds of all bricks of a level to `bounds` [z, y, x, 2, 3], 0 before.

    bounds_by_neighbour: [z, y, x, 3, 3, 3, 2, 3], as in NodeStatistics. extents: float64 [3], the volume's x, y, z in
    cells.
    """
    num_z, num_y, num_x = bounds.shape[:3]
    low, high, brick = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3, np.int64)
    for z in range(num_z):
        for y in range(num_y):
            for x in range(num_x):
                low[:], high[:] = BRICK_SIZE + 1, -BRICK_SIZE
                brick[0], brick[1], brick[2] = x, y, z
                for k in range(max(z - 1, 0), min(z + 2, num_z)):
                    for j in range(max(y - 1, 0), min(y + 2, num_y)):
                        for i in range(max(x - 1, 0), min(x + 2, num_x)):
                            of_neighbour = bounds_by_neighbour[k, j, i, z - k + 1, y - j + 1, x - i + 1]
                            _extend_bounds(of_neighbour, i - x, j - y, k - z, low, high)
                if low[0] <= high[0]:
                    for axis in range(3):  # cell k is visible from the centre of k - 1 to that of k + 1
                        bounds[z, y, x, 0, axis] = max(low[axis] - 0.5, 0.0)
                        bounds[z, y, x, 1, axis] = min(
                            high[axis] + 1.5, BRICK_SIZE, extents[axis] - BRICK_SIZE * brick[axis]
                        )


@jit
def _extend_bounds(bounds: UInt8, dx: int, dy: int, dz: int, low: Array, high: Array) -> None:
    """Grow low..high (x, y, z, both included) by the bounds [2, 3] of cells in a neighbour at dx, dy, dz."""
    if bounds[0, 0] <= bounds[1, 0]:
        for axis in range(3):
            shift = BRICK_SIZE * (dx, dy, dz)[axis]
            low[axis] = min(low[axis], bounds[0, axis] + shift)
            high[axis] = max(high[axis], bounds[1, axis] + shift)


@jit
def slot_at(slots: Int32, x: int, y: int, z: int) -> int:
    """Return the slot of a brick in `slots` [z, y, x], -1 if it has none or is outside the volume."""
    if x < 0 or y < 0 or z < 0 or z >= slots.shape[0] or y >= slots.shape[1] or x >= slots.shape[2]:
        return -1
    return int(slots[z, y, x])


@jit
def halo_span(step: int) -> tuple[int, int]:
    """Return the first and last cell, from -1 to BRICK_SIZE, that the neighbour at -1, 0 or 1 fills."""
    if step < 0:
        return -HALO, -1
    return (0, BRICK_SIZE - 1) if step == 0 else (BRICK_SIZE, BRICK_SIZE + HALO - 1)


@jit
def scatter(items: Array, cells: Int32, slots: Int32, out: Array) -> None:
    """Copy packed nodes [n] at `cells` [n, 3] (x, y, z) into bricks [., BRICK_SIZE, BRICK_SIZE, BRICK_SIZE]."""
    inside = BRICK_SIZE - 1
    for i in range(len(items)):
        x, y, z = cells[i, 0], cells[i, 1], cells[i, 2]
        slot = slots[z >> BRICK_LEVELS, y >> BRICK_LEVELS, x >> BRICK_LEVELS]
        out[slot, z & inside, y & inside, x & inside] = items[i]


@jit
def accumulate_max(errors: Float64, cells: Int32, shift: int, largest: Float64) -> None:
    """Raise `largest` [z, y, x], of bricks of 2^shift nodes a side, to the errors [n] of nodes at `cells` [n, 3]."""
    for i in range(len(errors)):
        x, y, z = cells[i, 0] >> shift, cells[i, 1] >> shift, cells[i, 2] >> shift
        largest[z, y, x] = max(largest[z, y, x], errors[i])


@jit
def accumulate_by_neighbour(errors: Float64, depths: Array, cells: Int32, largest: Float64, bounds: UInt8) -> None:
    """Add nodes at `cells` [n, 3] (x, y, z) to the largest errors and to the bounds of visible nodes, by the neighbours
    in whose halo they are: [z, y, x, 3, 3, 3] and [z, y, x, 3, 3, 3, 2, 3], as in NodeStatistics.

    errors: [n]. depths: [n], above 0 where a node is visible.
    """
    inside = BRICK_SIZE - 1
    for i in range(len(errors)):
        x, y, z = cells[i, 0], cells[i, 1], cells[i, 2]
        largest_of_brick = largest[z >> BRICK_LEVELS, y >> BRICK_LEVELS, x >> BRICK_LEVELS]
        bounds_of_brick = bounds[z >> BRICK_LEVELS, y >> BRICK_LEVELS, x >> BRICK_LEVELS]
        x, y, z = x & inside, y & inside, z & inside
        for k in range(1 - (z < HALO), 2 + (z > inside - HALO)):
            for j in range(1 - (y < HALO), 2 + (y > inside - HALO)):
                for h in range(1 - (x < HALO), 2 + (x > inside - HALO)):
                    largest_of_brick[k, j, h] = max(largest_of_brick[k, j, h], errors[i])
                    if depths[i] > 0:
                        low, high = bounds_of_brick[k, j, h, 0], bounds_of_brick[k, j, h, 1]
                        low[0], low[1], low[2] = min(low[0], x), min(low[1], y), min(low[2], z)
                        high[0], high[1], high[2] = max(high[0], x), max(high[1], y), max(high[2], z)


@jit
def accumulate_squares(
    errors: Float64, sizes: npt.NDArray[np.int64], cells: Int32, shift: int, largest: Float64, sums: Float64
) -> None:
    """Add the squares of errors [n], times sizes [n], to the bricks' sums [z, y, x].

    Errors are divided by the brick's largest, so that squares neither overflow nor vanish.
    """
    for i in range(len(errors)):
        x, y, z = cells[i, 0] >> shift, cells[i, 1] >> shift, cells[i, 2] >> shift
        if errors[i] > 0:
            ratio = errors[i] / largest[z, y, x]
            sums[z, y, x] += sizes[i] * (ratio * ratio)


@jit
def split_bricks(
    cells: Int32,
    errors: Float64,
    bounds: Float32,
    tolerance: float,
    shape_below: tuple[int, int, int],
    drawn: Int32,
    children: Int32,
) -> tuple[int, int]:
    """Split the bricks of a level at `cells` [n, 3] (x, y, z) whose error is not below the tolerance.

    Append their children to `children` [8 n, 3], in Morton order, and the others, where visible, to `drawn` [n, 3];
    return how many of either there are. shape_below: bricks along z, y, x on the level below.
    """
    num_drawn = num_children = 0
    for i in range(len(cells)):
        x, y, z = cells[i, 0], cells[i, 1], cells[i, 2]
        if errors[z, y, x] < tolerance:
            if bounds[z, y, x, 1, 0] > bounds[z, y, x, 0, 0]:
                drawn[num_drawn, 0], drawn[num_drawn, 1], drawn[num_drawn, 2] = x, y, z
                num_drawn += 1
            continue
        for k in range(8):
            x1, y1, z1 = 2 * x + (k & 1), 2 * y + (k >> 1 & 1), 2 * z + (k >> 2)
            if x1 < shape_below[2] and y1 < shape_below[1] and z1 < shape_below[0]:
                children[num_children, 0], children[num_children, 1], children[num_children, 2] = x1, y1, z1
                num_children += 1
    return num_drawn, num_children
