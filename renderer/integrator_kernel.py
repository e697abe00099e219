"""The compiled half of `renderer.integrator`: one ray at a time through the cells of the continuous field.

A *cell* is the box between eight voxel centres, or its outward extension over the outer half voxel, where the field
takes the nearest value. Along a ray inside one cell the trilinear field is a cubic polynomial in the fraction t in
[0, 1] of the ray's way through it. The cubic is split where it crosses a control value of the transfer function (and
where the light grazes the surface), which leaves *pieces* on which colour and extinction are polynomials. The optical
depth of a piece is then exact, and its radiance is a Gauss-Legendre quadrature of a smooth function. No thin shell can
be missed, because no crossing is looked for by sampling.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.jit import jit

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Cubic = tuple[float, float, float, float]

# A ray ends where less than 1e-12 of what lies behind it could still be seen.
_LAST_DEPTH = -math.log(1e-12)
# With four nodes, steps of a voxel and of an optical depth of 1 left errors of 6e-8 and less on two CT scans.
_MAX_DEPTH_OF_STEP = 1.0
_NODES = np.array([0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263])
_WEIGHTS = np.array([0.17392742256872692, 0.32607257743127307, 0.32607257743127307, 0.17392742256872692])


class Intervals(NamedTuple):
    """A transfer function of n control values as n + 1 intervals, the first and last of them unbounded.

    knots: float64 [n], not descending. Interval k holds knots[k - 1] <= value < knots[k]: the search is for the right
        side, so that the value of a step belongs to its upper side.
    origin: float64 [n + 1]; base, slope: float64 [n + 1, 4]: (r, g, b, extinction) is base + slope * (value - origin).
    num_opaque_below: int64 [n + 1]: how many of the first k control points have extinction.
    """

    knots: Float64
    origin: Float64
    base: Float64
    slope: Float64
    num_opaque_below: Int64


class Lighting(NamedTuple):
    """Lambert's law on the world gradient.

    enabled: without it every factor is 1 and the rest is not looked at.
    light: float64 [3], unit vector to the light. world_from_index_gradient: float64 [3, 3].
    """

    enabled: bool
    ambient: float
    diffuse: float
    light: Float64
    world_from_index_gradient: Float64


class Work(NamedTuple):
    """Arrays to work in, allocated once for many rays.

    cell: int64 [3], the lower corner's index, -1 to n - 1 per axis (x, y, z). entry, extent: float64 [3], the ray's
    way through the cell is entry + extent * t. crossing: float64 [3], where the ray meets the cell's next planes.
    corners: float64 [8], the field, x fastest; slopes: [3, 8], its index-space gradient. splits: ascending t in (0, 1).
    ray: float64 [4], the red, green, blue and optical depth gathered so far.
    """

    cell: Int64
    entry: Float64
    extent: Float64
    crossing: Float64
    corners: Float64
    slopes: Float64
    splits: Float64
    ray: Float64


Gradient = tuple[Cubic, Cubic, Cubic]


@jit
def _lerp(start: float, end: float, fraction: float) -> float:
    return start + (end - start) * fraction


@jit
def _cubic_in_cell(corners: Float64, entry: Float64, extent: Float64) -> Cubic:
    """The trilinear field of 8 corners (x fastest) along `entry + extent * t`, in cell coordinates, in powers of t."""
    # Edges along x are linear in t, faces quadratic, the cell cubic. Only differences of corners are formed, so that a
    # constant cell gives its value exactly, which decides on which side of a step it lies.
    u, v, w = entry[0], entry[1], entry[2]
    du, dv, dw = extent[0], extent[1], extent[2]
    edge_0, edge_1 = _lerp(corners[0], corners[1], u), _lerp(corners[2], corners[3], u)
    edge_2, edge_3 = _lerp(corners[4], corners[5], u), _lerp(corners[6], corners[7], u)
    rise_0, rise_1 = (corners[1] - corners[0]) * du, (corners[3] - corners[2]) * du
    rise_2, rise_3 = (corners[5] - corners[4]) * du, (corners[7] - corners[6]) * du
    face_0, face_1 = _lerp(edge_0, edge_1, v), _lerp(edge_2, edge_3, v)
    line_0 = _lerp(rise_0, rise_1, v) + (edge_1 - edge_0) * dv
    line_1 = _lerp(rise_2, rise_3, v) + (edge_3 - edge_2) * dv
    square_0, square_1 = (rise_1 - rise_0) * dv, (rise_3 - rise_2) * dv
    return (
        _lerp(face_0, face_1, w),
        _lerp(line_0, line_1, w) + (face_1 - face_0) * dw,
        _lerp(square_0, square_1, w) + (line_1 - line_0) * dw,
        (square_1 - square_0) * dw,
    )


@jit
def _at(cubic: Cubic, t: float) -> float:
    return cubic[0] + t * (cubic[1] + t * (cubic[2] + t * cubic[3]))


@jit
def _part_of(cubic: Cubic, start: float, width: float) -> Cubic:
    """The same cubic in x, with t = start + width * x."""
    first = cubic[1] + start * (2.0 * cubic[2] + start * 3.0 * cubic[3])
    second = cubic[2] + start * 3.0 * cubic[3]
    return _at(cubic, start), first * width, second * width * width, cubic[3] * width * width * width


@jit
def _insert(splits: Float64, count: int, t: float) -> int:
    """Insert t into the ascending splits[:count] when it lies inside the cell; return the new count."""
    if not 0.0 < t < 1.0:
        return count
    slot = count
    while slot > 0 and splits[slot - 1] > t:
        splits[slot] = splits[slot - 1]
        slot -= 1
    splits[slot] = t
    return count + 1


@jit
def _stationary(cubic: Cubic) -> tuple[float, float]:
    """Where the cubic stops rising or falling, ascending; -1 where there is no such place."""
    a, b, c = 3.0 * cubic[3], 2.0 * cubic[2], cubic[1]
    square = b * b - 4.0 * a * c
    if square <= 0.0:
        return -1.0, -1.0
    q = -0.5 * (b + math.copysign(math.sqrt(square), b))  # the root without cancellation
    one = q / a if abs(q) < abs(a) else -1.0  # compared first: only quotients inside (0, 1) matter, none overflows
    two = c / q if abs(c) < abs(q) else -1.0
    return min(one, two), max(one, two)


@jit
def _crossing(cubic: Cubic, level: float, start: float, end: float) -> float:
    """The t in [start, end], where the cubic is monotone, at which it equals `level`, which it does."""
    rising = _at(cubic, end) > level
    t = 0.5 * (start + end)
    for _ in range(80):
        excess = _at(cubic, t) - level
        if (excess > 0.0) == rising:
            end = t
        else:
            start = t
        slope = cubic[1] + t * (2.0 * cubic[2] + t * 3.0 * cubic[3])
        new = t - excess / slope if slope != 0.0 else -1.0
        if not start < new < end:  # Newton left the bracket: bisect
            new = 0.5 * (start + end)
        if abs(new - t) <= 1e-15:
            return new
        t = new
    return t


@jit
def _add_crossings(cubic: Cubic, levels: Float64, splits: Float64, count: int) -> int:
    """Add to splits[:count] every t in (0, 1) at which the cubic passes through one of the ascending levels."""
    turn_0, turn_1 = _stationary(cubic)
    start = 0.0
    for candidate in (turn_0, turn_1, 1.0):
        if not start < candidate <= 1.0:
            continue
        at_start, at_end = _at(cubic, start), _at(cubic, candidate)
        low, high = min(at_start, at_end), max(at_start, at_end)
        k = np.searchsorted(levels, low, side="right")
        while k < levels.size and levels[k] < high:
            if k == 0 or levels[k] != levels[k - 1]:
                count = _insert(splits, count, _crossing(cubic, levels[k], start, candidate))
            k += 1
        start = candidate
    return count


@jit
def _light_factor(gradient: Gradient, t: float, lighting: Lighting) -> float:
    x, y, z = _at(gradient[0], t), _at(gradient[1], t), _at(gradient[2], t)
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return lighting.ambient
    light = lighting.light
    cosine = -float(x * light[0] + y * light[1] + z * light[2]) / length
    return lighting.ambient + lighting.diffuse * max(0.0, cosine)


@jit
def _lit_color(
    intervals: Intervals, k: int, value: float, gradient: Gradient, t: float, lighting: Lighting
) -> tuple[float, float, float]:
    """The colour of a value in interval k, at t along the ray's way through the cell."""
    lit = _light_factor(gradient, t, lighting) if lighting.enabled else 1.0
    base, slope, offset = intervals.base, intervals.slope, value - intervals.origin[k]
    return (
        (base[k, 0] + slope[k, 0] * offset) * lit,
        (base[k, 1] + slope[k, 1] * offset) * lit,
        (base[k, 2] + slope[k, 2] * offset) * lit,
    )


@jit
def _integrate_piece(
    cubic: Cubic,
    gradient: Gradient,
    start: float,
    end: float,
    length: float,
    min_steps: int,
    intervals: Intervals,
    lighting: Lighting,
    ray: Float64,
) -> None:
    """Add the piece [start, end] of a cell, which lies in one interval, to `ray` = (r, g, b, optical depth) so far.

    length: world length of the ray's way through the whole cell. min_steps: quadrature steps at least.
    """
    k = int(np.searchsorted(intervals.knots, _at(cubic, 0.5 * (start + end)), side="right"))
    base, slope, origin = intervals.base[k, 3], intervals.slope[k, 3], intervals.origin[k]
    if base == 0.0 and slope == 0.0:
        return
    value = _part_of(cubic, start, end - start)
    scale = (end - start) * length
    # Optical depth per unit of x in [0, 1], a cubic; its largest Bernstein coefficient bounds it from above.
    t0 = (base + slope * (value[0] - origin)) * scale
    t1, t2, t3 = slope * value[1] * scale, slope * value[2] * scale, slope * value[3] * scale
    bound = max(t0, t0 + t1 / 3.0, t0 + (2.0 * t1 + t2) / 3.0, t0 + t1 + t2 + t3)
    num_steps = max(min_steps, math.ceil(bound / _MAX_DEPTH_OF_STEP))
    width = 1.0 / num_steps
    for step in range(num_steps):
        if ray[3] > _LAST_DEPTH:
            return
        d0, d1, d2, d3 = _part_of((t0, t1, t2, t3), step * width, width)
        # From the integrand in powers of x to its integral from 0 to x, divided by x.
        d0, d1, d2, d3 = d0 * width, d1 * width / 2.0, d2 * width / 3.0, d3 * width / 4.0
        depth = max(0.0, d0 + d1 + d2 + d3)
        # The colour of the middle times the exact opacity, plus the quadrature of what differs from that colour: a
        # constant colour is exact at every opacity.
        x = (step + 0.5) * width
        c0, c1, c2 = _lit_color(intervals, k, _at(value, x), gradient, start + x * (end - start), lighting)
        opacity = -math.expm1(-depth)
        s0, s1, s2 = c0 * opacity, c1 * opacity, c2 * opacity
        for node in range(_NODES.size):
            at = _NODES[node]
            tau = d0 + at * (2.0 * d1 + at * (3.0 * d2 + at * 4.0 * d3))
            weight = _WEIGHTS[node] * tau * math.exp(-at * (d0 + at * (d1 + at * (d2 + at * d3))))
            x = (step + at) * width
            r, g, b = _lit_color(intervals, k, _at(value, x), gradient, start + x * (end - start), lighting)
            s0 += weight * (r - c0)
            s1 += weight * (g - c1)
            s2 += weight * (b - c2)
        seen = math.exp(-ray[3])
        ray[0] += seen * s0
        ray[1] += seen * s1
        ray[2] += seen * s2
        ray[3] += depth


@jit
def _corner_index(values: Any, cell: Int64, corner: int) -> tuple[int, int, int]:
    """The voxel (x, y, z) at corner 0 to 7 (x fastest) of a cell, or the nearest one beyond the outermost centres."""
    num_z, num_y, num_x = values.shape
    return (
        min(max(cell[0] + (corner & 1), 0), num_x - 1),
        min(max(cell[1] + (corner >> 1 & 1), 0), num_y - 1),
        min(max(cell[2] + (corner >> 2), 0), num_z - 1),
    )


@jit
def _index_gradient(values: Any, x: int, y: int, z: int, axis: int) -> float:
    """Central difference at a voxel centre, one-sided at the border; 0 along an axis of one voxel."""
    dx, dy, dz = int(axis == 0), int(axis == 1), int(axis == 2)
    num_z, num_y, num_x = values.shape
    x0, y0, z0 = max(x - dx, 0), max(y - dy, 0), max(z - dz, 0)
    x1, y1, z1 = min(x + dx, num_x - 1), min(y + dy, num_y - 1), min(z + dz, num_z - 1)
    steps = (x1 - x0) + (y1 - y0) + (z1 - z0)
    if steps == 0:
        return 0.0
    return (float(values[z1, y1, x1]) - float(values[z0, y0, x0])) / float(steps)


@jit
def _combined(weights: Float64, gradient: Gradient) -> Cubic:
    first, second, third = gradient
    a, b, c = weights[0], weights[1], weights[2]
    return (
        a * first[0] + b * second[0] + c * third[0],
        a * first[1] + b * second[1] + c * third[1],
        a * first[2] + b * second[2] + c * third[2],
        a * first[3] + b * second[3] + c * third[3],
    )


@jit
def _world_gradient(values: Any, lighting: Lighting, work: Work) -> Gradient:
    """The gradient per world unit along the ray inside a cell; fills work.slopes."""
    for corner in range(8):
        x, y, z = _corner_index(values, work.cell, corner)
        for axis in range(3):
            work.slopes[axis, corner] = _index_gradient(values, x, y, z, axis)
    in_index = (
        _cubic_in_cell(work.slopes[0], work.entry, work.extent),
        _cubic_in_cell(work.slopes[1], work.entry, work.extent),
        _cubic_in_cell(work.slopes[2], work.entry, work.extent),
    )
    matrix = lighting.world_from_index_gradient
    return _combined(matrix[0], in_index), _combined(matrix[1], in_index), _combined(matrix[2], in_index)


@jit
def _load_corners(values: Any, cell: Int64, corners: Float64) -> tuple[float, float]:
    """Fill in the field at a cell's corners; return the smallest and the largest value."""
    low, high = math.inf, -math.inf
    for corner in range(8):
        x, y, z = _corner_index(values, cell, corner)
        value = float(values[z, y, x])
        corners[corner] = value
        low, high = min(low, value), max(high, value)
    return low, high


@jit
def _is_visible(low: float, high: float, intervals: Intervals) -> bool:
    """Whether any value in [low, high] has extinction."""
    first = np.searchsorted(intervals.knots, low, side="right")
    last = np.searchsorted(intervals.knots, high, side="right")
    if intervals.num_opaque_below[last] > intervals.num_opaque_below[first]:
        return True
    at_low = intervals.base[first, 3] + intervals.slope[first, 3] * (low - intervals.origin[first])
    at_high = intervals.base[last, 3] + intervals.slope[last, 3] * (high - intervals.origin[last])
    return bool(at_low > 0.0 or at_high > 0.0)


@jit
def _integrate_cell(
    values: Any, length: float, step_voxels: float, intervals: Intervals, lighting: Lighting, work: Work
) -> None:
    """Add one cell to work.ray; `length` is the world length of the ray's way through it."""
    corners, extent, splits = work.corners, work.extent, work.splits
    low, high = _load_corners(values, work.cell, corners)
    if not _is_visible(low, high, intervals):
        return
    cubic = _cubic_in_cell(corners, work.entry, extent)
    count = _add_crossings(cubic, intervals.knots, splits, 0)
    gradient = (cubic, cubic, cubic)  # not looked at without light
    if lighting.enabled:
        gradient = _world_gradient(values, lighting, work)
        count = _add_crossings(_combined(lighting.light, gradient), np.zeros(1), splits, count)
    length_voxels = math.sqrt(extent[0] ** 2 + extent[1] ** 2 + extent[2] ** 2)
    start = 0.0
    for piece in range(count + 1):
        end = splits[piece] if piece < count else 1.0
        if end > start:
            min_steps = max(1, math.ceil((end - start) * length_voxels / step_voxels))
            _integrate_piece(cubic, gradient, start, end, length, min_steps, intervals, lighting, work.ray)
        start = end


@jit
def _inside_volume(values: Any, origin: Float64, direction: Float64, start: float) -> tuple[float, float]:
    """The part of the ray from `start` on in [-1/2, n - 1/2] per axis; empty when the first is not the smaller one."""
    end = math.inf
    for axis in range(3):
        low, high = -0.5 - origin[axis], values.shape[2 - axis] - 0.5 - origin[axis]
        if direction[axis] == 0.0:
            if not low <= 0.0 < high:
                return 0.0, 0.0
            continue
        one, two = low / direction[axis], high / direction[axis]
        start, end = max(start, min(one, two)), min(end, max(one, two))
    return start, end


@jit
def _integrate_ray(
    values: Any,
    origin: Float64,
    direction: Float64,
    start: float,
    step_voxels: float,
    intervals: Intervals,
    lighting: Lighting,
    work: Work,
) -> None:
    """Gather the colour and the optical depth of one ray in work.ray, from cell to cell."""
    cell, crossing = work.cell, work.crossing
    work.ray[:] = 0.0
    s, end = _inside_volume(values, origin, direction, start)
    if not s < end:
        return
    for axis in range(3):
        last = values.shape[2 - axis] - 1
        cell[axis] = min(max(math.floor(origin[axis] + s * direction[axis]), -1), last)
    while s < end and work.ray[3] <= _LAST_DEPTH:
        # Planes are found from the cell's number each time, so that no rounding accumulates along the ray.
        for axis in range(3):
            plane = cell[axis] + (1 if direction[axis] > 0.0 else 0)
            crossing[axis] = (plane - origin[axis]) / direction[axis] if direction[axis] != 0.0 else math.inf
        through = int(np.argmin(crossing))
        leave = min(max(crossing[through], s), end)
        if leave > s:
            for axis in range(3):
                work.entry[axis] = origin[axis] + s * direction[axis] - cell[axis]
                work.extent[axis] = (leave - s) * direction[axis]
            _integrate_cell(values, leave - s, step_voxels, intervals, lighting, work)
        s = leave
        cell[through] += 1 if direction[through] > 0.0 else -1


@jit
def integrate_rays(
    values: Any,
    origins: Float64,
    directions: Float64,
    starts: Float64,
    step_voxels: float,
    intervals: Intervals,
    lighting: Lighting,
    radiance: Float64,
) -> None:
    """Write premultiplied RGBA of n rays to `radiance` float64 [n, 4].

    values: [z, y, x]. origins, directions: float64 [n, 3] in index space, directions per world unit of length.
    starts: float64 [n], world length along the ray before which nothing counts.
    """
    # A cubic passes a level at most three times, and so it is with grazing light.
    splits = np.empty(3 * intervals.knots.size + 3)
    work = Work(
        np.empty(3, np.int64), np.empty(3), np.empty(3), np.empty(3), np.empty(8), np.empty((3, 8)), splits, np.empty(4)
    )
    for i in range(starts.size):
        _integrate_ray(values, origins[i], directions[i], starts[i], step_voxels, intervals, lighting, work)
        for channel in range(3):
            radiance[i, channel] = work.ray[channel]
        radiance[i, 3] = -math.expm1(-work.ray[3])
