"""Integrate one ray at a time through the cells of the continuous field, at several steps at once, in compiled loops.

A *cell* is the box between eight voxel centres, or its outward extension over the outer half voxel, where the field
takes the nearest value. Along a ray inside one cell, the trilinear field is a cubic polynomial in the fraction t in
[0, 1] of the segment. The cubic is split where it crosses a control value of the transfer function (and where the light
grazes the surface), which leaves *pieces* on which colour and extinction are polynomials. The optical depth of a piece
is then exact, and its radiance is a Gauss-Legendre quadrature of a smooth function. No thin shell can be missed,
because crossings are computed and not sampled. Nearly all of the time is spent on cells and crossings, which do not
depend on the step: another step costs little.

Factors on extinction by the gradient are no polynomials. Depths are then the integrals of cubics through the nodes of
the quadrature, and exact where all factors are 1.

Most cells show nothing, which is found out once for each macrocell, when the first ray meets it. All functions are
inlined, because references to each array passed to a function are counted atomically in shared memory: with a dozen
arrays for each cell, two threads took twice as long.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from renderer.compiled import inline, jit
from renderer.truth.cells import (
    ALL_ABSENT,
    MACROCELL_SIZE,
    Cell,
    absent_corners,
    add_middles,
    clip_to_volume,
    distance_to_plane,
    first_cell,
    is_octant_absent,
    load_corners,
    load_values,
    macrocell_range,
)
from renderer.truth.cubic import Cubic, Vector, add_crossings, cubic_in_cell, restrict_cubic, value_at
from renderer.truth.light import Gloss, Gradient, LambertShading, aim, illuminate, lit_color, locate
from renderer.volume import Float64, UInt8

# A ray ends where its transmittance falls below 1e-12.
_MAX_OPTICAL_DEPTH = -math.log(1e-12)
# With four nodes, steps of a voxel and of an optical depth of 1 left errors of 6e-8 and less on two CT scans.
_MAX_DEPTH_OF_STEP = 1.0
_NODES = np.array([0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263])
_WEIGHTS = np.array([0.17392742256872692, 0.32607257743127307, 0.32607257743127307, 0.17392742256872692])
# From values at the nodes to the integrals from 0 to each node of the cubic through them.
_INTEGRALS = np.array([
    [0.08696371128436346, -0.026604180084998794, 0.012627462689404725, -0.0035551496857956833],
    [0.18811811749986806, 0.16303628871563652, -0.027880428602470895, 0.006735500594538156],
    [0.16719192197418878, 0.35395300603374397, 0.16303628871563652, -0.014190694931141144],
    [0.1774825722545226, 0.31344511474186837, 0.35267675751627187, 0.08696371128436346],
])  # fmt: skip

# The optical depth of a piece leads to at most this many steps, which keeps their number an integer.
_MAX_STEPS_BY_DEPTH = 2.0**30
# The states of a macrocell.
_UNKNOWN, _EMPTY, _VISIBLE, _PARTLY_ABSENT = 0, 1, 2, 3

_ZERO = np.zeros(1)


class Intervals(NamedTuple):
    """A transfer function of n control values as n + 1 intervals, the first and last of them unbounded.

    knots: float64 [n], times `scale`, not descending. Interval k has knots[k - 1] <= value < knots[k]: the value of a
        step belongs to its upper side.
    rows: float64 [n + 1, 10], base [4], slope [4], origin and the number of the first k control points that have
        extinction: (r, g, b, extinction) of a value is base + slope * (value - origin).
    scale: of scalars and knots, a power of two with which sums and differences neither overflow nor vanish.
    """

    knots: Float64
    rows: Float64
    scale: float


@inline
def _clamp_cubic(value: Cubic, low: float, high: float) -> Cubic:
    """Return a cubic on x in [0, 1] that should lie in [low, high], or a constant if it strays too far.

    It strays if the interval, and so the piece, is narrower than the rounding of the cubic: between such knots,
    extinction would be extrapolated without bounds.
    """
    v0, v1, v2, v3 = value
    one, two, three = v0 + v1 / 3.0, v0 + (2.0 * v1 + v2) / 3.0, v0 + v1 + v2 + v3  # the other Bernstein coefficients
    room = high - low
    if min(v0, one, two, three) >= low - room and max(v0, one, two, three) <= high + room:
        return value
    return min(max(0.5 * (v0 + three), low), high), 0.0, 0.0, 0.0


@inline
def _pass_step(
    row: Float64,
    value: Cubic,
    tau: Cubic,
    gradient: Gradient,
    place: tuple[float, float, int, float],
    shading: LambertShading,
    gloss: Gloss | None,
) -> tuple[float, float, float, float, float]:
    """Return the radiance (r, g, b), the optical depth and the opacity of one of the equal steps through a piece.

    row, value: of the piece, as in `_integrate_piece`. tau: optical depth per unit of the piece's x, over the step.
    place: the piece's start and extent in t, the number of the step, and its width in x.
    """
    if gloss is not None:
        return _pass_glossy_step(row, value, tau, gradient, place, shading, gloss)
    (d0, d1, d2, d3), (start, extent, step, width) = tau, place
    # From the integrand in powers of x to its integral from 0 to x, divided by x.
    d0, d1, d2, d3 = d0 * width, d1 * width / 2.0, d2 * width / 3.0, d3 * width / 4.0
    depth = max(0.0, d0 + d1 + d2 + d3)
    # The colour at the middle times the exact opacity, plus the quadrature of the difference from that colour: a
    # constant colour is exact at every opacity.
    x = (step + 0.5) * width
    c0, c1, c2 = lit_color(row, value_at(value, x), gradient, start + x * extent, shading)
    opacity = -math.expm1(-depth)
    s0, s1, s2 = c0 * opacity, c1 * opacity, c2 * opacity
    for node in range(_NODES.size):
        at = _NODES[node]
        density = d0 + at * (2.0 * d1 + at * (3.0 * d2 + at * 4.0 * d3))
        weight = _WEIGHTS[node] * density * math.exp(-at * (d0 + at * (d1 + at * (d2 + at * d3))))
        x = (step + at) * width
        r, g, b = lit_color(row, value_at(value, x), gradient, start + x * extent, shading)
        s0 += weight * (r - c0)
        s1 += weight * (g - c1)
        s2 += weight * (b - c2)
    return s0, s1, s2, depth, opacity


@inline
def _pass_glossy_step(
    row: Float64,
    value: Cubic,
    tau: Cubic,
    gradient: Gradient,
    place: tuple[float, float, int, float],
    shading: LambertShading,
    gloss: Gloss,
) -> tuple[float, float, float, float, float]:
    """Return what `_pass_step` does, with factors on extinction: depths come from their values at the nodes."""
    samples = (
        _glossy_sample(row, value, tau, gradient, place, _NODES[0], shading, gloss),
        _glossy_sample(row, value, tau, gradient, place, _NODES[1], shading, gloss),
        _glossy_sample(row, value, tau, gradient, place, _NODES[2], shading, gloss),
        _glossy_sample(row, value, tau, gradient, place, _NODES[3], shading, gloss),
    )
    t0, t1, t2, t3 = samples[0][3], samples[1][3], samples[2][3], samples[3][3]
    depth = _WEIGHTS[0] * t0 + _WEIGHTS[1] * t1 + _WEIGHTS[2] * t2 + _WEIGHTS[3] * t3
    c0, c1, c2, _ = _glossy_sample(row, value, tau, gradient, place, 0.5, shading, gloss)
    opacity = -math.expm1(-depth)
    s0, s1, s2 = c0 * opacity, c1 * opacity, c2 * opacity
    for node in range(_NODES.size):
        r, g, b, density = samples[node]
        of = _INTEGRALS[node]
        weight = _WEIGHTS[node] * density * math.exp(-(of[0] * t0 + of[1] * t1 + of[2] * t2 + of[3] * t3))
        s0 += weight * (r - c0)
        s1 += weight * (g - c1)
        s2 += weight * (b - c2)
    return s0, s1, s2, depth, opacity


@inline
def _glossy_sample(
    row: Float64,
    value: Cubic,
    tau: Cubic,
    gradient: Gradient,
    place: tuple[float, float, int, float],
    at: float,
    shading: LambertShading,
    gloss: Gloss,
) -> tuple[float, float, float, float]:
    """Return colour (r, g, b) and optical depth per step, at the fraction `at` of a step."""
    start, extent, step, width = place
    x = (step + at) * width
    lit, highlight, factor = illuminate(gradient, start + x * extent, shading, gloss)
    offset = value_at(value, x) - row[8]
    return (
        (row[0] + row[4] * offset) * lit + highlight,
        (row[1] + row[5] * offset) * lit + highlight,
        (row[2] + row[6] * offset) * lit + highlight,
        max(0.0, value_at(tau, at)) * width * factor,
    )


@inline
def _integrate_piece(
    cubic: Cubic,
    gradient: Gradient,
    start: float,
    end: float,
    length: float,
    length_voxels: float,
    intervals: Intervals,
    shading: LambertShading,
    max_steps: Float64,
    gathered: Float64,
) -> None:
    """Add the piece [start, end] of a cell, which lies in one interval, to what has been gathered.

    length, length_voxels: of the segment in the whole cell.
    """
    k = np.searchsorted(intervals.knots, value_at(cubic, 0.5 * (start + end)), side="right")
    row = intervals.rows[k]
    base, slope, origin = row[3], row[7], row[8]
    if base == 0.0 and slope == 0.0:
        return
    value = restrict_cubic(cubic, start, end - start)
    if 0 < k < intervals.knots.size:
        value = _clamp_cubic(value, intervals.knots[k - 1], intervals.knots[k])
    scale = (end - start) * length
    # Optical depth per unit of x in [0, 1], a cubic; its largest Bernstein coefficient bounds it from above.
    t0 = (base + slope * (value[0] - origin)) * scale
    t1, t2, t3 = slope * value[1] * scale, slope * value[2] * scale, slope * value[3] * scale
    bound = max(t0, t0 + t1 / 3.0, t0 + (2.0 * t1 + t2) / 3.0, t0 + t1 + t2 + t3)
    voxels = (end - start) * length_voxels
    num_parts = max(1.0, voxels, min(bound / _MAX_DEPTH_OF_STEP, _MAX_STEPS_BY_DEPTH))
    for number in range(max_steps.size):
        num_steps = math.ceil(num_parts / max_steps[number])
        width = 1.0 / num_steps
        for step in range(num_steps):
            if gathered[number, 3] > _MAX_OPTICAL_DEPTH:
                break
            tau = restrict_cubic((t0, t1, t2, t3), step * width, width)
            place = start, end - start, step, width
            s0, s1, s2, depth, opacity = _pass_step(row, value, tau, gradient, place, shading, shading.gloss)
            transmittance = math.exp(-gathered[number, 3])
            gathered[number, 0] += transmittance * s0
            gathered[number, 1] += transmittance * s1
            gathered[number, 2] += transmittance * s2
            gathered[number, 3] += depth
            gathered[number, 4 + k] += transmittance * opacity


@inline
def _linear_combination(weights: Vector, gradient: Gradient) -> Cubic:
    first, second, third = gradient
    a, b, c = weights
    return (
        a * first[0] + b * second[0] + c * third[0],
        a * first[1] + b * second[1] + c * third[1],
        a * first[2] + b * second[2] + c * third[2],
        a * first[3] + b * second[3] + c * third[3],
    )


@inline
def _world_gradient(
    values: Any, cell: Cell, entry: Vector, extent: Vector, shading: LambertShading, scale: float
) -> Gradient:
    """Return the gradient per world unit along the ray inside a cell."""
    in_index = (
        cubic_in_cell(load_corners(values, cell, 0, scale), entry, extent),
        cubic_in_cell(load_corners(values, cell, 1, scale), entry, extent),
        cubic_in_cell(load_corners(values, cell, 2, scale), entry, extent),
    )
    to_world = shading.world_from_index_gradient
    return (
        _linear_combination(to_world[0], in_index),
        _linear_combination(to_world[1], in_index),
        _linear_combination(to_world[2], in_index),
    )


@inline
def _is_visible(low: float, high: float, intervals: Intervals) -> bool:
    """Return whether any value in [low, high] has extinction."""
    first = np.searchsorted(intervals.knots, low, side="right")
    last = np.searchsorted(intervals.knots, high, side="right")
    if intervals.rows[last, 9] > intervals.rows[first, 9]:
        return True
    one, two = intervals.rows[first], intervals.rows[last]
    return bool(one[3] + one[7] * (low - one[8]) > 0.0 or two[3] + two[7] * (high - two[8]) > 0.0)


@inline
def _classify_macrocell(values: Any, i: int, j: int, k: int, intervals: Intervals) -> int:
    """Return whether anything may be visible in a macrocell."""
    low, high, has_absent = macrocell_range(values, i, j, k)
    if not low <= high or not _is_visible(low * intervals.scale, high * intervals.scale, intervals):
        return _EMPTY
    return _PARTLY_ABSENT if has_absent else _VISIBLE


@inline
def _integrate_cell(
    values: Any,
    cell: Cell,
    entry: Vector,
    extent: Vector,
    length: float,
    intervals: Intervals,
    shading: LambertShading,
    splits: Float64,
    max_steps: Float64,
    gathered: Float64,
    absent: int,
) -> None:
    """Add one cell, through which a ray goes along entry + extent * t, of world length `length`.

    splits: scratch space for 3 crossings of each knot and 6 more. absent: as `absent_corners` returns it.
    """
    if absent == ALL_ABSENT:
        return
    corners = load_values(values, cell, intervals.scale)
    if not _is_visible(min(corners), max(corners), intervals):
        return
    cubic = cubic_in_cell(corners, entry, extent)
    count = add_crossings(cubic, intervals.knots, splits, 0)
    if absent != 0:
        count = add_middles(entry, extent, splits, count)
    begin = cell[0] + entry[0], cell[1] + entry[1], cell[2] + entry[2]
    shading = locate(shading, shading.gloss, begin, extent)
    gradient = (cubic, cubic, cubic)  # unused without shading
    if shading.enabled:
        gradient = _world_gradient(values, cell, entry, extent, shading, intervals.scale)
        count = add_crossings(_linear_combination(shading.light, gradient), _ZERO, splits, count)
    voxels = math.sqrt(extent[0] ** 2 + extent[1] ** 2 + extent[2] ** 2)
    start = 0.0
    for piece in range(count + 1):
        end = splits[piece] if piece < count else 1.0
        if end > start and not is_octant_absent(absent, entry, extent, 0.5 * (start + end)):
            _integrate_piece(cubic, gradient, start, end, length, voxels, intervals, shading, max_steps, gathered)
        start = end


@inline
def _is_opaque(gathered: Float64) -> bool:
    """Return whether a ray may end, at all steps."""
    depth = gathered[0, 3]
    for k in range(1, len(gathered)):
        depth = min(depth, gathered[k, 3])
    return bool(depth > _MAX_OPTICAL_DEPTH)


@inline
def _integrate_ray(
    values: Any,
    macrocells: UInt8,
    origin: Vector,
    direction: Vector,
    part: tuple[float, float],
    intervals: Intervals,
    shading: LambertShading,
    splits: Float64,
    max_steps: Float64,
    gathered: Float64,
) -> None:
    """Add a part of one ray from cell to cell, for each of the steps, to what has been gathered."""
    s, end = clip_to_volume(values.shape, origin, direction, part[0], part[1])
    if not s < end:
        return
    aimed = aim(shading, shading.gloss, direction)
    (ox, oy, oz), (dx, dy, dz) = origin, direction
    num_z, num_y, num_x = values.shape
    x, y, z = first_cell(ox + s * dx, num_x), first_cell(oy + s * dy, num_y), first_cell(oz + s * dz, num_z)
    to_x, to_y, to_z = distance_to_plane(x, ox, dx), distance_to_plane(y, oy, dy), distance_to_plane(z, oz, dz)
    is_opaque = False
    while s < end and not is_opaque:
        s_exit = min(max(min(to_x, to_y, to_z), s), end)
        if s_exit > s:
            i, j, k = (x + 1) // MACROCELL_SIZE, (y + 1) // MACROCELL_SIZE, (z + 1) // MACROCELL_SIZE
            if macrocells[k, j, i] == _UNKNOWN:  # several threads may write here, but the same value
                macrocells[k, j, i] = _classify_macrocell(values, i, j, k, intervals)
            if macrocells[k, j, i] >= _VISIBLE:
                absent = absent_corners(values, (x, y, z)) if macrocells[k, j, i] == _PARTLY_ABSENT else 0
                length = s_exit - s
                entry = (ox + s * dx - x, oy + s * dy - y, oz + s * dz - z)
                extent = (length * dx, length * dy, length * dz)
                cell = (x, y, z)
                _integrate_cell(
                    values, cell, entry, extent, length, intervals, aimed, splits, max_steps, gathered, absent
                )
                is_opaque = _is_opaque(gathered)
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


@jit
def integrate_rays(
    values: Any,
    macrocells: UInt8,
    origins: Float64,
    directions: Float64,
    parts: Float64,
    max_steps: Float64,
    intervals: Intervals,
    shading: LambertShading,
    radiance: Float64,
) -> None:
    """Write premultiplied RGBA of n rays to `radiance` float64 [n, steps, 4], or more.

    With 4 + intervals channels, the others are what each interval of the transfer function adds to the opacity.
    values: [z, y, x]. macrocells: uint8, n // MACROCELL_SIZE + 1 along each axis, 0 at first; updated, for calls with
        the same values and intervals.
    origins, directions: float64 [n, 3] in index space, directions per world unit of length.
    parts: float64 [n, k, 2], world lengths along the ray at which its parts, one behind the other, start and end.
    max_steps: float64 [steps], the longest steps in voxels, in optical depth and in pieces.
    """
    # A cubic passes a knot at most three times, and so does the cosine of the light. Another voxel becomes the nearest
    # at most three times.
    splits = np.empty(3 * intervals.knots.size + 6)
    # Red, green, blue, optical depth, and what each interval shows.
    gathered = np.empty((max_steps.size, 4 + len(intervals.rows)))
    num_parts = parts.shape[1]
    for number in range(len(parts) * num_parts):  # one loop inside another would take 5 % longer
        i, k = number // num_parts, number % num_parts
        origin = (origins[i, 0], origins[i, 1], origins[i, 2])
        direction = (directions[i, 0], directions[i, 1], directions[i, 2])
        if k == 0:
            gathered[:] = 0.0
        if not _is_opaque(gathered):
            part = parts[i, k, 0], parts[i, k, 1]
            _integrate_ray(values, macrocells, origin, direction, part, intervals, shading, splits, max_steps, gathered)
        for step in range(max_steps.size):
            for channel in range(radiance.shape[2]):
                radiance[i, step, channel] = gathered[step, channel]
            radiance[i, step, 3] = -math.expm1(-gathered[step, 3])
