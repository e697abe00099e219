"""What nodes do not tell: how far the field is, where it is interpolated, from what its voxels show, and differences
of voxels that belong to two nodes.

On level 0 the scalar is interpolated and then classified. Between two voxels it passes through all that lies between
them, and the transfer function there may be far from both: an opaque peak between 0 and 1 of a mask, of which no voxel
has any. Means of classified voxels, and their errors, know nothing of it. What they can know is the straight line
between the values at the ends. Over a dual cell, whose corners are eight voxels with scalars from a to b,

    D^2 = mean over s from a to b of |w(s) - line(s)|^2,    line(a) = w(a), line(b) = w(b)

with w the channels that errors are of (`renderer.pyramid.pyramid`): what a way through the cell has in it that voxels
do not show is at most D times its length, if scalars are spread evenly on it. Of a step w has the upper side at the
step itself.

w is taken as linear between control values, so that D is exactly 0 where none lies between a and b. That (tau c, tau)
is not, where both change, makes at most a quarter of the difference that its ends show anyway; opacities, too, lie
between their ends. Then the distance is linear in every piece between control values, with ends d and e, and its square
has the mean (d^2 + d e + e^2) / 3 there: nothing is subtracted that is much larger than the result.

Of two peaks with the same D the thinner one takes the shorter steps. With E^2 the mean square of the distance's slope,
the way through the cell being 1,

    width^2 = 12 D^2 / E^2,    between MIN_PEAK_WIDTH^2 and 1

is that of a triangle on the line. Steps h that are longer meet it by chance, and are wrong by D h^0.5; shorter ones by
D h^2 / width^1.5. Steps are chosen as if errors were roughness * h^2.5 (`renderer.bricks.sampling`), which has both
where

    roughness = D / width^2

Nor do nodes tell of a difference between two of them each of which is constant, as boxes on even voxels have it, blocks
of a phantom, or a mask that was made larger. Coarser cells blur it over their width all the same, and steps must be as
short as for one in the middle of a node. There it has half of the difference for its error; here, for every dual cell,

    J = DIFFERENCE_ERROR_SHARE |w(b) - w(a)|

stands for it, whatever the nodes are. DIFFERENCE_ERROR_SHARE is less than a half: of noise the eight voxels of a dual
cell have a range of 2.85 standard deviations in the mean, and are taken for no more than nodes take them for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.bricks.kernels import BRICK_SIZE, HALO, PADDED_BRICK_SIZE
from renderer.jit import jit
from renderer.transfer import LARGEST_EXPONENT, Channels, RawVoxels, TransferFunction, scalar_at

Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]

# Colormaps have hundreds of control values, nearly on a line: those that are within this share of the largest channel
# of it are left out. D changes by four times as much at most, twice in each of four channels.
SIMPLIFICATION_TOLERANCE = 2.0**-12

# Peaks and steps count as this wide, at least, in the way through a cell: the longest step at a tolerance of 0.
MIN_PEAK_WIDTH = 1 / 16

# Of the difference of a dual cell's ends, what counts for its error.
DIFFERENCE_ERROR_SHARE = 0.35


class Polyline(NamedTuple):
    """The channels as a function of the scalar: linear between values, constant outside, the upper side of a step.

    values: float64 [n], ascending, scalars times `scale`, a power of two that makes differences finite, those of the
        volume's scalars, too. points: float64 [n, 4].
    """

    values: Float64
    points: Float64
    scale: float


def make_polyline(
    transfer: TransferFunction,
    finest_spacing: float,
    *,
    opacity: bool,
    brightest: float,
    volume_range: tuple[float, float],
) -> Polyline:
    """Of (tau c, tau) times the finest spacing, or of the (a c, a) of such a depth, colours times `brightest`."""
    weights = transfer.extinctions * finest_spacing
    if opacity:
        weights = -np.expm1(-weights)
    points = np.column_stack([brightest * transfer.colors * weights[:, None], weights])
    exponent = math.frexp(max(float(np.abs(transfer.values).max()), *map(abs, volume_range)))[1]
    scale = math.ldexp(1.0, min(0, LARGEST_EXPONENT - exponent))
    is_hidden = np.zeros(len(points), np.bool_)  # between two others at one value
    is_hidden[1:-1] = transfer.values[2:] == transfer.values[:-2]
    values, points = transfer.values[~is_hidden] * scale, points[~is_hidden]
    kept = _simplify_polyline(values, points, SIMPLIFICATION_TOLERANCE * float(points.max()))
    return Polyline(values[kept], points[kept], scale)


def make_scalar_polyline(volume_range: tuple[float, float]) -> Polyline:
    """Of scalars themselves, in shares of the volume's range, as the only channel; no scalar is an end of it."""
    low, high = volume_range
    scale = math.ldexp(1.0, min(0, LARGEST_EXPONENT - 1 - math.frexp(max(abs(low), abs(high)))[1]))
    width = (high * scale - low * scale) or 1.0
    points = np.zeros((2, 4))
    points[:, 3] = -1.0, 2.0
    return Polyline(np.array([low * scale - width, high * scale + width]), points, scale)


def _simplify_polyline(values: Float64, points: Float64, tolerance: float) -> npt.NDArray[np.int64]:
    """int64 [m], ascending: the points that it takes to have all others within the tolerance of the line between them.

    Douglas and Peucker 1973, along the axis of values: the farthest one is taken first.
    """
    kept, parts = {0, len(values) - 1}, [(0, len(values) - 1)]
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
            kept.add(middle)
            parts += [(first, middle), (middle, last)]
    return np.array(sorted(kept))


@jit
def measure_subvoxel_variation(
    raw: RawVoxels,
    scalars: Float64 | None,
    values: Float64,
    points: Float64,
    scale: float,
    bricks: Int32,
    largest: Float64,
    roughness: Float64,
    steepness: Float64,
) -> None:
    """Write the largest D or J of the dual cells in bricks of voxels, at `bricks` [n, 3] (x, y, z), to `largest`
    [z, y, x], and root mean squares over the brick's volume of D / width^2 to `roughness` and of J to `steepness`; all
    are 0.

    A brick has half of the dual cells between it and its neighbours; beyond the border the nearest voxels are repeated.
    scalars: by bit pattern; None where voxels are scalars themselves. Others as in Polyline.
    """
    low, high = (
        np.empty((PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE)),
        np.empty((PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE)),
    )
    for i in range(len(bricks)):
        x, y, z = bricks[i, 0], bricks[i, 1], bricks[i, 2]
        nums = (
            min(raw.shape[0] - BRICK_SIZE * z, BRICK_SIZE),
            min(raw.shape[1] - BRICK_SIZE * y, BRICK_SIZE),
            min(raw.shape[2] - BRICK_SIZE * x, BRICK_SIZE),
        )
        least, most = _fill_scalars(raw, scalars, scale, x, y, z, nums, low)
        first = _num_at_or_below(values, least, 0)
        if _num_at_or_below(values, most, first) > first or not _is_constant(first, points):
            _to_dual_cell_ranges(low, high, nums)
            largest[z, y, x], roughness[z, y, x], steepness[z, y, x] = _variation_of_ranges(
                low, high, nums, values, points
            )


@jit
def _fill_scalars(
    raw: RawVoxels,
    scalars: Float64 | None,
    scale: float,
    i: int,
    j: int,
    k: int,
    nums: tuple[int, int, int],
    field: Float64,
) -> tuple[float, float]:
    """Scaled scalars of a brick's voxels [nums], with an apron of one, the nearest voxels beyond the border; the
    smallest and the largest."""
    num_z, num_y, num_x = raw.shape
    least, most = np.inf, -np.inf
    for t in range(nums[0] + 2 * HALO):
        z = min(max(BRICK_SIZE * k - HALO + t, 0), num_z - 1)
        for u in range(nums[1] + 2 * HALO):
            y = min(max(BRICK_SIZE * j - HALO + u, 0), num_y - 1)
            for v in range(nums[2] + 2 * HALO):
                x = min(max(BRICK_SIZE * i - HALO + v, 0), num_x - 1)
                scalar = scale * scalar_at(raw, scalars, z, y, x)
                field[t, u, v] = scalar
                least, most = min(least, scalar), max(most, scalar)
    return least, most


@jit
def _to_dual_cell_ranges(low: Float64, high: Float64, nums: tuple[int, int, int]) -> None:
    """From scalars at centres, in `low`, to the smallest and the largest of dual cells [nums + 1]."""
    for z in range(nums[0] + 2):
        for y in range(nums[1] + 2):
            for x in range(nums[2] + 1):
                here, there = low[z, y, x], low[z, y, x + 1]
                low[z, y, x], high[z, y, x] = min(here, there), max(here, there)
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
def _variation_of_ranges(
    low: Float64, high: Float64, nums: tuple[int, int, int], values: Float64, points: Float64
) -> tuple[float, float, float]:
    """The largest D or J, and the root mean squares of D / width^2 and of J."""
    largest, total, total_difference, first = 0.0, 0.0, 0.0, 0
    for z in range(nums[0] + 1):
        in_z = 0.5 if z == 0 or z == nums[0] else 1.0
        for y in range(nums[1] + 1):
            in_yz = in_z * (0.5 if y == 0 or y == nums[1] else 1.0)
            for x in range(nums[2] + 1):
                if low[z, y, x] == high[z, y, x]:
                    continue
                part = in_yz * (0.5 if x == 0 or x == nums[2] else 1.0)
                first = _num_at_or_below(values, low[z, y, x], first)
                last = _num_at_or_below(values, high[z, y, x], first)
                if last > first:
                    square, width = squared_distance(low[z, y, x], high[z, y, x], first, values, points)
                    largest = max(largest, square)
                    total += part * square / (width * width)
                square = squared_difference(low[z, y, x], high[z, y, x], first, last, values, points)
                square *= DIFFERENCE_ERROR_SHARE * DIFFERENCE_ERROR_SHARE
                largest = max(largest, square)
                total_difference += part * square
    num = nums[0] * nums[1] * nums[2]
    return math.sqrt(largest), math.sqrt(total / num), math.sqrt(total_difference / num)


@jit
def squared_difference(low: float, high: float, first: int, last: int, values: Float64, points: Float64) -> float:
    """|w(high) - w(low)|^2 of two scaled scalars, at or below which are `first` and `last` values."""
    r0, g0, b0, a0 = _channels_at(low, first, values, points)
    r1, g1, b1, a1 = _channels_at(high, last, values, points)
    return (r1 - r0) ** 2 + (g1 - g0) ** 2 + (b1 - b0) ** 2 + (a1 - a0) ** 2


@jit
def _num_at_or_below(values: Float64, scalar: float, near: int) -> int:
    """How many values are at or below a scalar; `near` is where to look first."""
    num = near
    while num > 0 and values[num - 1] > scalar:
        num -= 1
    while num < len(values) and values[num] <= scalar:
        num += 1
    return num


@jit
def _is_constant(first: int, points: Float64) -> bool:
    """Whether all scalars show the same, at or below which are the `first` values and no more."""
    below, above = max(first - 1, 0), min(first, len(points) - 1)
    return np.array_equal(points[below], points[above])


@jit
def squared_distance(low: float, high: float, first: int, values: Float64, points: Float64) -> tuple[float, float]:
    """D^2 and width^2 from one scalar to a higher one, both scaled; `first` values are at or below `low`."""
    last = _num_at_or_below(values, high, first)
    r0, g0, b0, a0 = _channels_at(low, first, values, points)
    r1, g1, b1, a1 = _channels_at(high, last, values, points)
    r = g = b = a = 0.0  # the distance at the value before
    before = total = slopes = 0.0
    for k in range(np.uint64(first), np.uint64(last)):
        t = (values[k] - low) / (high - low)
        u = 1.0 - t
        rk = u * (points[k, 0] - r0) + t * (points[k, 0] - r1)
        gk = u * (points[k, 1] - g0) + t * (points[k, 1] - g1)
        bk = u * (points[k, 2] - b0) + t * (points[k, 2] - b1)
        ak = u * (points[k, 3] - a0) + t * (points[k, 3] - a1)
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


@jit
def _channels_at(scalar: float, num: int, values: Float64, points: Float64) -> Channels:
    """The channels of a scaled scalar, at or below which are `num` values."""
    # Unsigned indices spare numba asking whether they count from the end.
    below, above = np.uint64(max(num - 1, 0)), np.uint64(min(num, len(values) - 1))
    width = values[above] - values[below]
    t = (scalar - values[below]) / width if num > 0 and width > 0 else 0.0
    u = 1.0 - t
    return (
        u * points[below, 0] + t * points[above, 0],
        u * points[below, 1] + t * points[above, 1],
        u * points[below, 2] + t * points[above, 2],
        u * points[below, 3] + t * points[above, 3],
    )
