"""Measure bricks of voxels: their visible bounds, and the sub-voxel variation.

A dual cell has eight voxels as its corners. By the min-max test of `renderer.transfer`, it may be visible if anything
between the smallest and the largest of their scalars is.

The sub-voxel variation is what the transfer function shows between two voxels but at neither, and differences between
voxels that belong to two nodes. Nodes do not tell either.

On level 0 the scalar is interpolated and then classified. Between two voxels it passes through all values between
theirs, and the transfer function may be far from both there: an opaque peak between 0 and 1 of a mask, for example,
which no voxel has. Means of classified voxels, and their errors, miss it. They are right about the straight line
between the values at the ends. Over a dual cell, whose corners are eight voxels with scalars from a to b,

    D^2 = mean over s from a to b of |w(s) - line(s)|^2,    line(a) = w(a), line(b) = w(b)

with w the channels that errors are of (`renderer.pyramid.pyramid`). A ray through the cell meets at most D times its
length that voxels do not show, if scalars are spread evenly along it. At a step, w has the value of the upper side.

w is taken as linear between control values, so that D is exactly 0 where none lies between a and b. (tau c, tau) is not
linear where both change, but the difference is at most a quarter of that between the ends. Opacities also lie between
their ends. The distance is then linear in every segment between control values, with ends d and e, and its square has
the mean (d^2 + d e + e^2) / 3: no large numbers are subtracted.

Of two peaks with the same D, the thinner one needs shorter steps. With E^2 the mean square of the distance's slope, for
a ray through the cell of length 1,

    width^2 = 12 D^2 / E^2,    between MIN_PEAK_WIDTH^2 and 1

is that of a triangle on the line. Longer steps h meet it by chance, and err by D h^0.5; shorter ones err by
D h^2 / width^1.5. Steps are chosen as if errors were step_error * h^2.5 (`renderer.bricks.sampling`), which covers both
with

    step_error = D / width^2

Nodes do not show a difference between two nodes that are each constant either, such as boxes on even voxels, blocks of
a phantom, or an enlarged mask. Coarser cells blur it over their width all the same, and steps must be as short as for a
difference inside a node. There half of the difference is the error; here, for every dual cell,

    J = DIFFERENCE_ERROR_SHARE |w(b) - w(a)|

stands for it, whatever the nodes are. DIFFERENCE_ERROR_SHARE is less than a half: the eight voxels of a dual cell of
noise have a range of 2.85 standard deviations in the mean, and count for no more than they do in nodes.

Where some voxels of a dual cell have no data, rays meet a step from w to nothing, at a place that no scalar tells. D is
that of the step of a transfer function in the middle of a ray, D^2 = w^2 / 12. Segments are divided there
(`renderer/kernels/sources/sample.h`), so that longer ones do: width^2 = 1 / 4 in place of 1 / 17.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.bricks.absent import fill_absent
from renderer.bricks.layout import BRICK_SIZE, PADDED_BRICK_SIZE, fill_padded
from renderer.compiled import jit
from renderer.transfer import (
    LARGEST_EXPONENT,
    RawVoxels,
    TransferFunction,
    TransferTable,
    evaluate_segment,
    is_range_visible,
    make_transfer_table,
)
from renderer.volume import Float32, Float64, Int32, Int64

# Colormaps have hundreds of control values, nearly on a line. Those within this share of the largest channel of it are
# left out. D changes by four times as much at most, twice in each of four channels.
SIMPLIFICATION_TOLERANCE = 2.0**-12

# Peaks and steps count as at least this wide, as a share of a ray through the cell: the longest step at tolerance 0.
MIN_PEAK_WIDTH = 1 / 16

# The share of the difference between a dual cell's ends that counts as its error.
DIFFERENCE_ERROR_SHARE = 0.35


# 1 / width^2 of the step between data and nothing. With it, a ball of 120^3 in NaN has 61 dB at tolerance 0.05, and the
# whole cube 59 dB.
EDGE_INVERSE_WIDTH = 4.0


def make_channel_curve(
    transfer: TransferFunction,
    finest_spacing: float,
    opacity: bool,
    brightest: float,
    volume_range: tuple[float, float],
) -> TransferTable:
    """Return the table of (tau c, tau) times the finest spacing, or of the (a c, a) of such a depth, simplified.

    brightest: a factor on colours. The table's scale makes differences finite, also those of the volume's scalars.
    """
    weights = transfer.extinctions * finest_spacing
    if opacity:
        weights = -np.expm1(-weights)
    points = np.column_stack([brightest * transfer.colors * weights[:, None], weights])
    exponent = math.frexp(max(float(np.abs(transfer.values).max()), *map(abs, volume_range)))[1]
    scale = math.ldexp(1.0, min(0, LARGEST_EXPONENT - exponent))
    is_hidden = np.zeros(len(points), np.bool_)  # between two others at one value
    is_hidden[1:-1] = transfer.values[2:] == transfer.values[:-2]
    values, points = transfer.values[~is_hidden], points[~is_hidden]
    chosen = _simplify(values * scale, points, SIMPLIFICATION_TOLERANCE * float(points.max()))
    return make_transfer_table(values[chosen], points[chosen], scale)


def make_scalar_curve(volume_range: tuple[float, float]) -> TransferTable:
    """Return the table of scalars as the only channel, in shares of the volume's range; none is an end of the table."""
    low, high = volume_range
    scale = math.ldexp(1.0, min(0, LARGEST_EXPONENT - 1 - math.frexp(max(abs(low), abs(high)))[1]))
    width = (high * scale - low * scale) or 1.0
    points = np.zeros((2, 4))
    points[:, 3] = -1.0, 2.0
    # Unscaled control values might overflow.
    scaled = np.array([low * scale - width, high * scale + width])
    return make_transfer_table(scaled, points)._replace(scale=scale)


def _simplify(values: Float64, points: Float64, tolerance: float) -> Int64:
    """Return the points, ascending, between which all others are within the tolerance of the line, int64 [m].

    Douglas and Peucker 1973, along the axis of values: the farthest point is taken first.
    """
    chosen, parts = {0, len(values) - 1}, [(0, len(values) - 1)]
    while parts:
        first, last = parts.pop()
        width = values[last] - values[first]
        if last - first < 2:
            continue
        share = ((values[first + 1 : last] - values[first]) / width)[:, None]
        line = points[first] * (1 - share) + points[last] * share
        off = np.abs(points[first + 1 : last] - line).max(axis=1)
        if off.max() > tolerance:
            middle = first + 1 + int(off.argmax())
            chosen.add(middle)
            parts += [(first, middle), (middle, last)]
    return np.array(sorted(chosen))


@jit
def measure_voxel_bricks(
    voxels: tuple[RawVoxels, Float64 | None, bool], breakpoints: Float64, curve: TransferTable, bricks: Int32,
    bounds: Float32, measures: Float64,
) -> None:  # fmt: skip
    """Measure the dual cells in bricks of voxels at `bricks` [n, 3] (x, y, z); all results are 0 before.

    Write the visible bounds, as in BrickLevel, to `bounds` [z, y, x, 2, 3]; and to `measures` [3, z, y, x] the largest
    D or J, and the root mean squares over the brick's volume of D / width^2 and of J. A brick has half of the dual
    cells between it and its neighbours; beyond the border the nearest voxels are repeated.

    voxels: raw ones; scalars by bit pattern, None where voxels are scalars themselves; and whether any has no data.
    breakpoints: of visibility.
    """
    raw, scalars, has_absent = voxels
    values, rows, scale = curve.rows[1:, 0].copy(), curve.rows, curve.scale
    shape = (PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE)
    low, high = np.empty(shape), np.empty(shape)
    if has_absent:
        side = PADDED_BRICK_SIZE + 2
        around = np.empty((side, side, side))
    for i in range(len(bricks)):
        x, y, z = bricks[i, 0], bricks[i, 1], bricks[i, 2]
        nums = (
            min(raw.shape[0] - BRICK_SIZE * z, BRICK_SIZE),
            min(raw.shape[1] - BRICK_SIZE * y, BRICK_SIZE),
            min(raw.shape[2] - BRICK_SIZE * x, BRICK_SIZE),
        )
        is_whole = True
        if has_absent:
            fill_padded(raw, scalars, bricks[i], around)
            is_whole = fill_absent(around, low)
        else:
            fill_padded(raw, scalars, bricks[i], low)
        least, most = range_of(low)
        if not least <= most:
            continue
        first = _num_at_or_below(values, scale * least, 0)
        is_varying = not is_whole or _num_at_or_below(values, scale * most, first) > first or rows[first, 6:].any()
        is_visible = is_range_visible(breakpoints, least, most)
        if is_varying or is_visible:
            _to_dual_cell_ranges(low, high, nums)
        if is_visible:
            _find_visible_bounds(low, high, nums, breakpoints, bounds[z, y, x])
        if is_varying:
            found = _variation_of_ranges(low, high, nums, values, rows, scale)
            if not is_whole:
                found = _with_edges_of_data(found, around, low, high, nums, values, rows, scale)
            measures[0, z, y, x], measures[1, z, y, x], measures[2, z, y, x] = found


@jit
def range_of(field: Float64) -> tuple[float, float]:
    """Return the smallest and the largest number of a field [z, y, x]; infinity and minus infinity if all are NaN."""
    least, most = np.inf, -np.inf
    for z in range(field.shape[0]):
        for y in range(field.shape[1]):
            for x in range(field.shape[2]):
                # NaN, being neither smaller nor larger, does not count as the second of two.
                least, most = min(least, field[z, y, x]), max(most, field[z, y, x])
    return least, most


@jit
def _find_visible_bounds(
    low: Float64, high: Float64, nums: tuple[int, int, int], breakpoints: Float64, bounds: Float32
) -> None:
    """Write the lowest and highest corner (x, y, z) of the visible dual cells [nums + 1] to `bounds` [2, 3].

    At least one is visible. Dual cell k lies between the centres of the cells k - 1 and k.
    """
    x0, y0, z0 = BRICK_SIZE, BRICK_SIZE, BRICK_SIZE
    x1, y1, z1 = 0, 0, 0
    for z in range(nums[0] + 1):
        for y in range(nums[1] + 1):
            for x in range(nums[2] + 1):
                if low[z, y, x] <= high[z, y, x] and is_range_visible(breakpoints, low[z, y, x], high[z, y, x]):
                    x0, y0, z0 = min(x0, x), min(y0, y), min(z0, z)
                    x1, y1, z1 = max(x1, x), max(y1, y), max(z1, z)
    bounds[0, 0], bounds[0, 1], bounds[0, 2] = max(x0 - 0.5, 0.0), max(y0 - 0.5, 0.0), max(z0 - 0.5, 0.0)
    bounds[1, 0], bounds[1, 1], bounds[1, 2] = min(x1 + 0.5, nums[2]), min(y1 + 0.5, nums[1]), min(z1 + 0.5, nums[0])


@jit
def _to_dual_cell_ranges(low: Float64, high: Float64, nums: tuple[int, int, int]) -> None:
    """Turn scalars at voxel centres, in `low`, into the smallest and the largest of dual cells [nums + 1].

    NaN do not count, as in `range_of`.
    """
    for z in range(nums[0] + 2):
        for y in range(nums[1] + 2):
            for x in range(nums[2] + 1):
                here, there = low[z, y, x], low[z, y, x + 1]
                low[z, y, x], high[z, y, x] = min(np.inf, here, there), max(-np.inf, here, there)
    for z in range(nums[0] + 2):
        for y in range(nums[1] + 1):
            for x in range(nums[2] + 1):
                low[z, y, x] = min(low[z, y, x], low[z, y + 1, x])
                high[z, y, x] = max(high[z, y, x], high[z, y + 1, x])
    for z in range(nums[0] + 1):
        for y in range(nums[1] + 1):
            for x in range(nums[2] + 1):
                low[z, y, x] = min(low[z, y, x], low[z + 1, y, x])
                high[z, y, x] = max(high[z, y, x], high[z + 1, y, x])


@jit
def _with_edges_of_data(
    found: tuple[float, float, float], around: Float64, low: Float64, high: Float64, nums: tuple[int, int, int],
    values: Float64, rows: Float64, scale: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Return what `_variation_of_ranges` found, with the steps between data and nothing.

    around: [20, 20, 20], the scalars, NaN without data.
    """
    largest, total, size = found[0] ** 2, 0.0, nums[0] * nums[1] * nums[2]
    for z, y, x in np.ndindex((nums[0] + 1, nums[1] + 1, nums[2] + 1)):
        least, most = scale * low[z, y, x], scale * high[z, y, x]
        num_absent = 0
        for k in range(8):
            corner = around[z + 1 + (k >> 2), y + 1 + (k >> 1 & 1), x + 1 + (k & 1)]
            num_absent += math.isnan(corner)
        if least <= most and 0 < num_absent < 8:
            part = 1.0
            for at, num in ((z, nums[0]), (y, nums[1]), (x, nums[2])):
                part *= 0.5 if at in (0, num) else 1.0
            square = 0.0
            for end in (least, most):
                r, g, b, a = evaluate_segment(rows, np.uint64(_num_at_or_below(values, end, 0)), end)
                square = max(square, r * r + g * g + b * b + a * a)
            largest = max(largest, square / 12)
            total += part * square / 12 * EDGE_INVERSE_WIDTH**2
    return math.sqrt(largest), math.sqrt(found[1] ** 2 + total / size), found[2]


@jit
def _variation_of_ranges(
    low: Float64, high: Float64, nums: tuple[int, int, int], values: Float64, rows: Float64, scale: float
) -> tuple[float, float, float]:
    """Return the largest D or J, and the root mean squares of D / width^2 and of J."""
    largest, total, total_difference, first = 0.0, 0.0, 0.0, 0
    for z in range(nums[0] + 1):
        in_z = 0.5 if z == 0 or z == nums[0] else 1.0
        for y in range(nums[1] + 1):
            in_yz = in_z * (0.5 if y == 0 or y == nums[1] else 1.0)
            for x in range(nums[2] + 1):
                least, most = scale * low[z, y, x], scale * high[z, y, x]
                if not least < most:
                    continue
                part = in_yz * (0.5 if x == 0 or x == nums[2] else 1.0)
                first = _num_at_or_below(values, least, first)
                last = _num_at_or_below(values, most, first)
                if last > first:
                    square, width = squared_distance(least, most, first, values, rows)
                    largest = max(largest, square)
                    total += part * square / (width * width)
                square = squared_difference(least, most, first, last, rows)
                square *= DIFFERENCE_ERROR_SHARE * DIFFERENCE_ERROR_SHARE
                largest = max(largest, square)
                total_difference += part * square
    num = nums[0] * nums[1] * nums[2]
    return math.sqrt(largest), math.sqrt(total / num), math.sqrt(total_difference / num)


@jit
def squared_difference(low: float, high: float, first: int, last: int, rows: Float64) -> float:
    """Return |w(high) - w(low)|^2 of two scaled scalars in segments `first` and `last`."""
    r0, g0, b0, a0 = evaluate_segment(rows, np.uint64(first), low)
    r1, g1, b1, a1 = evaluate_segment(rows, np.uint64(last), high)
    return (r1 - r0) ** 2 + (g1 - g0) ** 2 + (b1 - b0) ** 2 + (a1 - a0) ** 2


@jit
def _num_at_or_below(values: Float64, scalar: float, near: int) -> int:
    """Return how many values are at or below a scalar; the search starts from `near`."""
    num = near
    while num > 0 and values[num - 1] > scalar:
        num -= 1
    while num < len(values) and values[num] <= scalar:
        num += 1
    return num


@jit
def squared_distance(low: float, high: float, first: int, values: Float64, rows: Float64) -> tuple[float, float]:
    """Return D^2 and width^2 from one scalar to a higher one, both scaled; `low` is in segment `first`.

    values: [n], the scaled control values.
    """
    last = _num_at_or_below(values, high, first)
    r0, g0, b0, a0 = evaluate_segment(rows, np.uint64(first), low)
    r1, g1, b1, a1 = evaluate_segment(rows, np.uint64(last), high)
    r = g = b = a = 0.0  # the distance at the control value before
    before = total = slopes = 0.0
    for k in range(np.uint64(first), np.uint64(last)):
        point, t = k + np.uint64(1), (values[k] - low) / (high - low)  # a segment's row begins at its control point
        u = 1.0 - t
        rk = u * (rows[point, 2] - r0) + t * (rows[point, 2] - r1)
        gk = u * (rows[point, 3] - g0) + t * (rows[point, 3] - g1)
        bk = u * (rows[point, 4] - b0) + t * (rows[point, 4] - b1)
        ak = u * (rows[point, 5] - a0) + t * (rows[point, 5] - a1)
        squares = r * (r + rk) + rk * rk + g * (g + gk) + gk * gk + b * (b + bk) + bk * bk + a * (a + ak) + ak * ak
        total += (t - before) * squares
        rises = (rk - r) ** 2 + (gk - g) ** 2 + (bk - b) ** 2 + (ak - a) ** 2
        slopes += rises / max(t - before, MIN_PEAK_WIDTH)
        r, g, b, a, before = rk, gk, bk, ak, t
    squares = r * r + g * g + b * b + a * a
    total += (1.0 - before) * squares
    slopes += squares / max(1.0 - before, MIN_PEAK_WIDTH)
    width = 4.0 * total / slopes if slopes > 0 else 1.0
    return total / 3.0, min(max(width, MIN_PEAK_WIDTH * MIN_PEAK_WIDTH), 1.0)
