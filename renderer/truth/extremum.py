"""Find the most extreme scalar of a ray exactly, from cell to cell: the cubic of each has known extremes.

Cells are those of `renderer.truth.cells`. A macrocell whose bound does not exceed what was found is passed over; the
first ray that meets it finds its bound.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from renderer.compiled import inline, jit
from renderer.truth.cells import (
    MACROCELL_SIZE,
    absent_corners,
    add_middles,
    clip_to_volume,
    distance_to_plane,
    first_cell,
    is_octant_absent,
    load_values,
    macrocell_range,
)
from renderer.truth.cubic import Cubic, Vector, cubic_in_cell, restrict_cubic, stationary_points, value_at
from renderer.volume import Float64


@jit
def search_rays(
    values: Any,
    tops: Float64,
    origins: Float64,
    directions: Float64,
    parts: Float64,
    sign: float,
    least_rise: float,
    found: Float64,
) -> None:
    """Write the largest `sign` times scalar of n rays, and the length along the ray at which it is, to `found` [n, 2].

    It is minus infinity for a ray that misses the volume. Of numbers that differ by no more than `least_rise` the first
    counts.
    tops: float64, NaN at first, the largest number of each macrocell; updated, for calls with the same values and sign.
    Other parameters as in `renderer.truth.kernel.integrate_rays`.
    """
    splits = np.empty(3)
    for i in range(len(parts)):
        origin = origins[i, 0], origins[i, 1], origins[i, 2]
        direction = directions[i, 0], directions[i, 1], directions[i, 2]
        found[i, 0], found[i, 1] = -math.inf, 0.0
        for k in range(parts.shape[1]):
            s, end = clip_to_volume(values.shape, origin, direction, parts[i, k, 0], parts[i, k, 1])
            if s < end:
                _search_ray(values, tops, (origin, direction), (s, end), sign, least_rise, splits, found[i])


@inline
def _search_ray(
    values: Any, tops: Float64, ray: Any, reach: tuple[float, float], sign: float, least_rise: float, splits: Float64,
    found: Float64,
) -> None:  # fmt: skip
    """Search one ray, its origin and direction, between two lengths for more than was found. splits: scratch [3]."""
    ((ox, oy, oz), (dx, dy, dz)), (s, end) = ray, reach
    num_z, num_y, num_x = values.shape
    x, y, z = first_cell(ox + s * dx, num_x), first_cell(oy + s * dy, num_y), first_cell(oz + s * dz, num_z)
    to_x, to_y, to_z = distance_to_plane(x, ox, dx), distance_to_plane(y, oy, dy), distance_to_plane(z, oz, dz)
    best, place = found[0], found[1]
    while s < end:
        s_exit = min(max(min(to_x, to_y, to_z), s), end)
        i, j, k = (x + 1) // MACROCELL_SIZE, (y + 1) // MACROCELL_SIZE, (z + 1) // MACROCELL_SIZE
        if math.isnan(tops[k, j, i]):  # several threads may write here, but the same value
            low, high, _ = macrocell_range(values, i, j, k)
            tops[k, j, i] = max(sign * low, sign * high) if low <= high else -math.inf
        if tops[k, j, i] > best + least_rise:
            length = s_exit - s
            entry = (ox + s * dx - x, oy + s * dy - y, oz + s * dz - z)
            extent = (length * dx, length * dy, length * dz)
            cubic = cubic_in_cell(load_values(values, (x, y, z), sign), entry, extent)
            absent = absent_corners(values, (x, y, z))
            number, t = _largest(cubic) if absent == 0 else _largest_of_data(cubic, absent, entry, extent, splits)
            if number > best + least_rise:
                best, place = number, s + t * length
        s = s_exit
        if to_x <= to_y and to_x <= to_z:
            x += 1 if dx > 0.0 else -1
            to_x = distance_to_plane(x, ox, dx)
        elif to_y <= to_z:
            y += 1 if dy > 0.0 else -1
            to_y = distance_to_plane(y, oy, dy)
        else:
            z += 1 if dz > 0.0 else -1
            to_z = distance_to_plane(z, oz, dz)
    found[0], found[1] = best, place


@inline
def _largest(cubic: Cubic) -> tuple[float, float]:
    """Return the largest value of a cubic in [0, 1], and where it is first."""
    best, place = value_at(cubic, 0.0), 0.0
    turn_0, turn_1 = stationary_points(cubic)
    for t in (turn_0, turn_1, 1.0):
        if 0.0 < t <= 1.0 and value_at(cubic, t) > best:
            best, place = value_at(cubic, t), t
    return best, place


@inline
def _largest_of_data(cubic: Cubic, absent: int, entry: Vector, extent: Vector, splits: Float64) -> tuple[float, float]:
    """Return the largest value of a cubic in [0, 1] where the nearest voxel has data, and where it is first.

    It is minus infinity where no voxel on the way has data. Other parameters as in `renderer.truth.cells`.
    """
    best, place, start = -math.inf, 0.0, 0.0
    count = add_middles(entry, extent, splits, 0)
    for part in range(count + 1):
        end = splits[part] if part < count else 1.0
        if not is_octant_absent(absent, entry, extent, 0.5 * (start + end)):
            number, t = _largest(restrict_cubic(cubic, start, end - start))
            if number > best:
                best, place = number, start + t * (end - start)
        start = end
    return best, place


def empty_tops(shape: tuple[int, ...]) -> Float64:
    """Return `tops` for a volume of this shape, in which nothing is known yet."""
    return np.full([n // MACROCELL_SIZE + 1 for n in shape], np.nan)
