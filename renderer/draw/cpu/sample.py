"""Sample the field of a brick and classify the samples, compiled: in each lane a sample of its own.

The functions are short, and the compiler inlines them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from renderer.bricks import PADDED_BRICK_SIZE
from renderer.compiled import (
    any_of,
    bits_to_float32,
    broadcast,
    float32_to_bits,
    fma,
    gather,
    inline,
    load,
    load_corners,
    load_rows,
    num_lanes,
    permute,
    to_float32,
    to_int32,
    where,
)
from renderer.draw.constants import OPACITY_SERIES
from renderer.transfer import GUIDE_SIZE, PIECE_FLOATS, PiecewiseTransfer, lambert_factor
from renderer.volume import Float32, Int32

TEXELS_PER_BRICK = PADDED_BRICK_SIZE**3

_GUIDE_SIZE, _LAST_BUCKET = np.float32(GUIDE_SIZE), np.float32(GUIDE_SIZE - 1)
# From one texel of a brick to the next along y and along z.
_ROW_STRIDE, _PLANE_STRIDE = PADDED_BRICK_SIZE, PADDED_BRICK_SIZE**2

# Of a segment where some voxels have no data. With one, grazing rays have means that are off by 40 dB at tolerance 0.
_NUM_PARTS = 4

# The last texel that is the lowest of eight.
_LAST_CELL = np.int32(TEXELS_PER_BRICK - 1 - _PLANE_STRIDE - _ROW_STRIDE - 1)

_0: np.float32 = np.float32(0.0)
_1: np.float32 = np.float32(1.0)
_HALF: np.float32 = np.float32(0.5)
_LOG2_E, _LN_2, _MAX_DEPTH = np.float32(1 / math.log(2)), np.float32(math.log(2)), np.float32(40.0)
_EXPONENT_BIAS, _EXPONENT_SHIFT = np.int32(127), np.int32(23)  # of float32
_A, _B, _C, _D = (np.float32(coefficient) for coefficient in OPACITY_SERIES)


class Optics(NamedTuple):
    """A set of parameters that all samples of a picture share.

    termination_alpha, spacings_per_model_unit: as in ScreenSampling and BrickBatch.
    light: unit vector to the light (x, y, z), ambient and diffuse; used if `is_lit`.
    has_absent: whether any voxel has no data.
    """

    termination_alpha: np.float32
    spacings_per_model_unit: np.float32
    is_lit: bool
    has_absent: bool
    light: tuple[np.float32, np.float32, np.float32, np.float32, np.float32]


class Table(NamedTuple):
    """A transfer function as lanes read it.

    rows: float32 [pieces * PIECE_FLOATS], and guide: as in PiecewiseTransfer.
    columns: float32 [PIECE_FLOATS, num_lanes()], the same pieces, if they are so few that a vector holds a column;
        else [PIECE_FLOATS, 0].
    num_pieces: their number. lowest_visible: below this scalar nothing is visible.
    """

    columns: Float32
    rows: Float32
    guide: Int32
    num_pieces: int
    lowest_visible: np.float32


class Field(NamedTuple):
    """A field to sample: the texels of all bricks, and the table that classifies them.

    scalars: float32, of each brick [PADDED_BRICK_SIZE^3]; with shading, the gradients [PADDED_BRICK_SIZE^3, 3] follow.
    means: float32, of each brick [PADDED_BRICK_SIZE^3, 4].
    """

    scalars: Float32
    means: Float32
    table: Table
    optics: Optics


def make_table(transfer: PiecewiseTransfer) -> Table:
    """Return the table of a transfer function."""
    num = len(transfer.rows)
    columns = np.zeros((PIECE_FLOATS, num_lanes() if num <= num_lanes() else 0), np.float32)
    if num <= num_lanes():
        columns[:, :num] = transfer.rows.T
    return Table(columns, transfer.rows.reshape(-1), transfer.guide, num, _lowest_visible(transfer))


def _lowest_visible(transfer: PiecewiseTransfer) -> np.float32:
    """Return a scalar below which no extinction is positive.

    That is the start of the first piece with a positive extinction. Where extinction is 0 at the origin of a piece, and
    its slope is not positive, no scalar above the origin has a positive one; rounding keeps this. Only the piece in
    which the search starts has scalars below its origin.
    """
    first = transfer.guide[0]
    tau, slope = transfer.rows[first:, 2], transfer.rows[first:, 3]
    is_visible = (tau > 0) | (slope > 0)
    is_visible[0] |= slope[0] < 0
    starts = np.append(np.float32(-np.inf), transfer.rows[first:-1, 0])
    lowest: np.float32 = starts[is_visible].min(initial=np.float32(np.inf))
    return lowest


@inline
def classify(table: Table, scalar: Any) -> Any:
    """Return (tau, r, g, b) of scalars; NaN falls into the first piece."""
    return _classify_by_columns(table, scalar) if table.columns.size > 0 else _classify_by_rows(table, scalar)


@inline
def _classify_by_columns(table: Table, scalar: Any) -> Any:
    """Look pieces up in registers: a frame takes 0.8 of its time with `_classify_by_rows`."""
    piece = broadcast(table.guide[0], num_lanes())
    for k in range(table.guide[0], table.num_pieces - 1):
        piece = where(scalar >= table.columns[0, k], piece + np.int32(1), piece)
    offset = scalar - _column(table, 1, piece)
    return (
        fma(offset, _column(table, 3, piece), _column(table, 2, piece)),
        fma(offset, _column(table, 8, piece), _column(table, 4, piece)),
        fma(offset, _column(table, 9, piece), _column(table, 5, piece)),
        fma(offset, _column(table, 10, piece), _column(table, 6, piece)),
    )


@inline
def _column(table: Table, number: int, piece: Any) -> Any:
    return permute(load(table.columns, number * num_lanes(), num_lanes()), piece)


@inline
def _classify_by_rows(table: Table, scalar: Any) -> Any:
    """Look pieces up in memory."""
    bucket = to_int32(min(max(_0, scalar * _GUIDE_SIZE), _LAST_BUCKET))
    row = gather(table.guide, bucket) * np.int32(PIECE_FLOATS)
    end, origin, tau, tau_slope = load_rows(table.rows, row, 4)
    is_further = scalar >= end
    while any_of(is_further):
        row = where(is_further, row + np.int32(PIECE_FLOATS), row)
        end, origin, tau, tau_slope = load_rows(table.rows, row, 4)
        is_further = scalar >= end
    r, g, b, _, r_slope, g_slope, b_slope, _ = load_rows(table.rows, row + np.int32(4), 8)
    offset = scalar - origin
    return fma(offset, tau_slope, tau), fma(offset, r_slope, r), fma(offset, g_slope, g), fma(offset, b_slope, b)


@inline
def cell_at(number: Any, first: Any, step: Any) -> Any:
    """Return the texel of the brick at or below samples, by their numbers, and how far the samples are from it."""
    x, y, z = fma(number, step[0], first[0]), fma(number, step[1], first[1]), fma(number, step[2], first[2])
    i, j, k = to_int32(x), to_int32(y), to_int32(z)
    size = np.int32(PADDED_BRICK_SIZE)
    return (k * size + j) * size + i, (x - to_float32(i), y - to_float32(j), z - to_float32(k))


@inline
def lerp(share: Any, one: Any, other: Any) -> Any:
    """Interpolate between two numbers."""
    return fma(share, other - one, one)


@inline
def sample_scalar(texels: Float32, at: Any, shares: Any) -> Any:
    """Interpolate between eight texels, the lowest of which is at `at`."""
    return interpolate(texels, at, shares, (_ROW_STRIDE, _PLANE_STRIDE))


@inline
def interpolate(numbers: Float32, at: Any, shares: Any, strides: tuple[int, int]) -> Any:
    """Interpolate between eight numbers, the lowest of which is at `at`. strides: to the next along y and along z."""
    u, v, w = shares
    a, b, c, d, e, f, g, h = load_corners(numbers, at, strides[0], strides[1])
    below = lerp(v, lerp(u, a, b), lerp(u, c, d))
    above = lerp(v, lerp(u, e, f), lerp(u, g, h))
    return lerp(w, below, above)


@inline
def extinction_of_data(tau: Any, texels: Float32, optics: Optics, here: Any, first: Any, step: Any) -> Any:
    """Return the extinctions of samples times the shares of the segments around them that have data, by _NUM_PARTS
    points. here, first, step: as `cell_at` takes them."""
    if not optics.has_absent:
        return tau
    at, _ = cell_at(here, first, step)
    are_whole = are_all_present(texels, at)
    share = where(are_whole, _1, _0)
    if any_of(~are_whole):
        for k in range(_NUM_PARTS):
            at, shares = cell_at(here + np.float32((k + 0.5) / _NUM_PARTS - 0.5), first, step)
            at = min(max(at, np.int32(0)), _LAST_CELL)  # of lanes without a ray
            share += where(~are_whole & are_present(texels, at, shares), np.float32(1 / _NUM_PARTS), _0)
    return tau * share


@inline
def are_present(texels: Float32, at: Any, shares: Any) -> Any:
    """Return whether the texels that are nearest to samples have data; `at` is the lowest of the eight around each."""
    u, v, w = shares
    u, v, w = to_int32(u + _HALF), to_int32(v + _HALF), to_int32(w + _HALF)
    nearest = at + u + v * np.int32(_ROW_STRIDE) + w * np.int32(_PLANE_STRIDE)
    return _has_data(gather(texels, nearest))


@inline
def are_all_present(texels: Float32, at: Any) -> Any:
    """Return whether all eight texels, the lowest of which is at `at`, have data."""
    a, b, c, d, e, f, g, h = load_corners(texels, at, _ROW_STRIDE, _PLANE_STRIDE)
    below = _has_data(a) & _has_data(b) & _has_data(c) & _has_data(d)
    return below & _has_data(e) & _has_data(f) & _has_data(g) & _has_data(h)


@inline
def _has_data(texel: Any) -> Any:
    return (float32_to_bits(texel) & np.int32(1)) == np.int32(0)


@inline
def sample_gradient(texels: Float32, at: Any, shares: Any) -> Any:
    """Interpolate the gradient (x, y, z), which is behind the scalars of a brick, in one texel after the other."""
    x, y, z, _ = _mix_corners(texels, at * np.int32(3) + np.int32(TEXELS_PER_BRICK), shares, 3)
    return x, y, z


@inline
def sample_rgba(texels: Float32, at: Any, shares: Any) -> Any:
    """Interpolate four channels between eight texels, of which the lowest is at `at`."""
    return _mix_corners(texels, at * np.int32(4), shares, 4)


@inline
def _mix_corners(texels: Float32, place: Any, shares: Any, num: int) -> Any:
    """Interpolate `num` channels, 3 or 4, between eight texels, of which the lowest begins at `place`.

    Returns four numbers; the last of three channels is arbitrary. Two floats behind the last texel may be read.
    """
    u, v, w = shares
    row, plane = np.int32(num * _ROW_STRIDE), np.int32(num * _PLANE_STRIDE)
    below = _mix(v, _mix_pair(u, texels, place, num), _mix_pair(u, texels, place + row, num))
    place += plane
    above = _mix(v, _mix_pair(u, texels, place, num), _mix_pair(u, texels, place + row, num))
    return _mix(w, below, above)


@inline
def _mix_pair(share: Any, texels: Float32, place: Any, num: int) -> Any:
    """Interpolate between a texel of `num` channels and the next one."""
    pair = load_rows(texels, place, 8)
    return _mix(share, pair[:4], pair[3:7] if num == 3 else pair[4:])


@inline
def _mix(share: Any, one: Any, other: Any) -> Any:
    return (
        lerp(share, one[0], other[0]),
        lerp(share, one[1], other[1]),
        lerp(share, one[2], other[2]),
        lerp(share, one[3], other[3]),
    )


@inline
def light_factor(gradient: Any, light: tuple[np.float32, ...]) -> Any:
    """Return the factor on the colour for gradients (x, y, z) of any length: Lambert's law. light: as in Optics."""
    x, y, z = gradient
    largest = max(abs(x), abs(y))
    largest = max(largest, abs(z))
    return where(largest > _0, lambert_factor(x / largest, y / largest, z / largest, light), light[3])


@inline
def opacity_of_depth(x: Any) -> Any:
    """Return 1 - exp(-x) of x >= 0, relative error below 3e-7."""
    is_small = x < _HALF
    opacity = x * fma(-x, fma(-x, fma(-x, fma(x, -_D, _C), _B), _A), _1)
    if any_of(~is_small):
        power, power_of_half = exp_factors(x)
        large = where(x < _MAX_DEPTH, fma(-power, power_of_half, _1), _1)
        opacity = where(is_small, opacity, large)
    return opacity


@inline
def exp_factors(x: Any) -> Any:
    """Return two factors of exp(-x) of x >= 0, the second a power of two; x counts as 40 at most."""
    held = min(x, _MAX_DEPTH)
    n = to_int32(fma(held, _LOG2_E, _HALF))
    r = fma(to_float32(n), _LN_2, -held)
    power = fma(r, np.float32(1 / 720), np.float32(1 / 120))
    power = fma(r, power, np.float32(1 / 24))
    power = fma(r, power, np.float32(1 / 6))
    power = fma(r, power, _HALF)
    power = fma(r, fma(r, power, _1), _1)
    return power, bits_to_float32((_EXPONENT_BIAS - n) << _EXPONENT_SHIFT)
