"""Express the trilinear field along a ray through a cell as a cubic polynomial, and find where it crosses knots."""

from __future__ import annotations

import math

import numpy as np

from renderer.compiled import inline
from renderer.volume import Float64

Vector = tuple[float, float, float]
# Coefficients of 1, t, t^2 and t^3.
Cubic = tuple[float, float, float, float]
# A field at a cell's corners, x fastest.
Corners = tuple[float, float, float, float, float, float, float, float]


@inline
def _lerp(start: float, end: float, fraction: float) -> float:
    return start + (end - start) * fraction


@inline
def cubic_in_cell(corners: Corners, entry: Vector, extent: Vector) -> Cubic:
    """Return the trilinear field of 8 corners along `entry + extent * t`, in cell coordinates, in powers of t."""
    # Edges along x are linear in t, faces quadratic, the cell cubic. Differences of corners keep the value of a
    # constant cell exact, which decides on which side of a step it lies.
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


@inline
def value_at(cubic: Cubic, t: float) -> float:
    """Return the cubic at t."""
    return cubic[0] + t * (cubic[1] + t * (cubic[2] + t * cubic[3]))


@inline
def restrict_cubic(cubic: Cubic, start: float, width: float) -> Cubic:
    """Return the same cubic in x, with t = start + width * x."""
    first = cubic[1] + start * (2.0 * cubic[2] + start * 3.0 * cubic[3])
    second = cubic[2] + start * 3.0 * cubic[3]
    return value_at(cubic, start), first * width, second * width * width, cubic[3] * width * width * width


@inline
def insert_split(splits: Float64, count: int, t: float) -> int:
    """Insert t into the ascending splits[:count] if it lies inside the cell; return the new count."""
    if not 0.0 < t < 1.0:
        return count
    slot = count
    while slot > 0 and splits[slot - 1] > t:
        splits[slot] = splits[slot - 1]
        slot -= 1
    splits[slot] = t
    return count + 1


@inline
def stationary_points(cubic: Cubic) -> tuple[float, float]:
    """Return where the slope of the cubic changes its sign, ascending; -1 for each missing place."""
    a, b, c = 3.0 * cubic[3], 2.0 * cubic[2], cubic[1]
    largest = max(abs(a), abs(b), abs(c))
    if largest == 0.0:
        return -1.0, -1.0
    a, b, c = a / largest, b / largest, c / largest  # so that squares neither overflow nor vanish
    square = b * b - 4.0 * a * c
    if square <= 0.0:
        return -1.0, -1.0
    q = -0.5 * (b + math.copysign(math.sqrt(square), b))  # avoids cancellation
    one = q / a if abs(q) < abs(a) else -1.0  # only quotients inside (-1, 1) matter: none overflows
    two = c / q if abs(c) < abs(q) else -1.0
    return min(one, two), max(one, two)


@inline
def _crossing(cubic: Cubic, knot: float, start: float, end: float) -> float:
    """Return the t in [start, end], where the cubic is monotone and passes through `knot`, at which it equals it."""
    rising = value_at(cubic, end) > knot
    rounding = 2.0**-52 * (abs(cubic[0]) + abs(cubic[1]) + abs(cubic[2]) + abs(cubic[3]))
    t = 0.5 * (start + end)
    for _ in range(80):
        excess = value_at(cubic, t) - knot
        if abs(excess) <= rounding:  # else Newton often leaves the bracket by a bit, and bisection follows
            return t
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


@inline
def add_crossings(cubic: Cubic, knots: Float64, splits: Float64, count: int) -> int:
    """Add to splits[:count] every t in (0, 1) at which the cubic passes through one of the ascending knots."""
    turn_0, turn_1 = stationary_points(cubic)
    start = 0.0
    for candidate in (turn_0, turn_1, 1.0):
        if not start < candidate <= 1.0:
            continue
        at_start, at_end = value_at(cubic, start), value_at(cubic, candidate)
        low, high = min(at_start, at_end), max(at_start, at_end)
        k = np.searchsorted(knots, low, side="right")
        while k < knots.size and knots[k] < high:
            if k == 0 or knots[k] != knots[k - 1]:
                count = insert_split(splits, count, _crossing(cubic, knots[k], start, candidate))
            k += 1
        start = candidate
    return count
