"""Sample the field of a brick and classify the samples, compiled.

The functions are short, and the compiler inlines them. Arrays are their arguments: `renderer.draw.cpu.march` says why.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.bricks import PADDED_BRICK_SIZE
from renderer.draw.constants import OPACITY_SERIES
from renderer.jit import fma, jit
from renderer.transfer import GUIDE_SIZE, lambert_factor

Float32 = npt.NDArray[np.float32]
Int32 = npt.NDArray[np.int32]
Color = tuple[np.float32, np.float32, np.float32, np.float32]
Float3 = tuple[np.float32, np.float32, np.float32]

# The floats of a piece of the transfer function: end, origin, (r, g, b, tau) at the origin, and their slopes.
PIECE_FLOATS = 10
TEXELS_PER_BRICK = PADDED_BRICK_SIZE**3

_GUIDE_SIZE, _LAST_BUCKET = np.float32(GUIDE_SIZE), np.float32(GUIDE_SIZE - 1)
# From one texel of a brick to the next along y and along z.
_ROW_STRIDE, _PLANE_STRIDE = PADDED_BRICK_SIZE, PADDED_BRICK_SIZE**2

_0: np.float32 = np.float32(0.0)
_1: np.float32 = np.float32(1.0)
_HALF: np.float32 = np.float32(0.5)
_LOG2_E, _LN_2, _MAX_DEPTH = np.float32(1 / math.log(2)), np.float32(math.log(2)), np.float32(40.0)
_POWERS_OF_HALF = (2.0 ** -np.arange(64.0)).astype(np.float32)
_A, _B, _C, _D = (np.float32(coefficient) for coefficient in OPACITY_SERIES)


class Optics(NamedTuple):
    """Parameters that all samples of a picture share.

    termination_alpha, spacings_per_model_unit: as in ScreenSampling and BrickBatch.
    light: unit vector to the light (x, y, z), ambient and diffuse; used if `is_lit`.
    """

    termination_alpha: np.float32
    spacings_per_model_unit: np.float32
    is_lit: bool
    light: tuple[np.float32, np.float32, np.float32, np.float32, np.float32]


class Field(NamedTuple):
    """The texels of all bricks, with the tables that classify them.

    scalars: float32, of each brick [PADDED_BRICK_SIZE^3]; with shading [4, PADDED_BRICK_SIZE^3], with the gradient.
    means: float32, of each brick [PADDED_BRICK_SIZE^3, 4]. pieces: float32 [pieces * PIECE_FLOATS]. guide: int32
    [GUIDE_SIZE]. Both as in PiecewiseTransfer.
    """

    scalars: Float32
    means: Float32
    pieces: Float32
    guide: Int32
    optics: Optics


@jit
def bucket(scalar: np.float32) -> np.uint64:
    """Return the bucket of the guide that a scalar falls into; NaN falls into the first one."""
    position = scalar * _GUIDE_SIZE
    position = position if position > _0 else _0
    position = position if position < _LAST_BUCKET else _LAST_BUCKET
    number: np.uint64 = np.uint64(np.int32(position))
    return number


@jit
def evaluate_piece(pieces: Float32, row: np.uint64, scalar: np.float32) -> Color:
    """Return (tau, r, g, b) of a scalar in the piece that begins at `row`."""
    offset = scalar - pieces[row + np.uint64(1)]
    return (
        fma(offset, pieces[row + np.uint64(9)], pieces[row + np.uint64(5)]),
        fma(offset, pieces[row + np.uint64(6)], pieces[row + np.uint64(2)]),
        fma(offset, pieces[row + np.uint64(7)], pieces[row + np.uint64(3)]),
        fma(offset, pieces[row + np.uint64(8)], pieces[row + np.uint64(4)]),
    )


@jit
def cell_at(number: np.float32, first: Float3, step: Float3) -> tuple[int, Float3]:
    """Return the texel of the brick at or below a sample, by its number, and how far the sample is from it."""
    x, y, z = fma(number, step[0], first[0]), fma(number, step[1], first[1]), fma(number, step[2], first[2])
    i, j, k = np.int32(x), np.int32(y), np.int32(z)
    return np.int64((k * PADDED_BRICK_SIZE + j) * PADDED_BRICK_SIZE + i), (
        x - np.float32(i),
        y - np.float32(j),
        z - np.float32(k),
    )


@jit
def _lerp(share: np.float32, one: np.float32, other: np.float32) -> np.float32:
    return fma(share, other - one, one)


@jit
def sample_scalar(texels: Float32, at: int, shares: Float3, texel_floats: int = 1) -> np.float32:
    """Interpolate between eight texels of `texel_floats` channels, in the channel that the lowest has at `at`."""
    low, right, up = np.uint64(at), np.uint64(texel_floats), np.uint64(texel_floats * _ROW_STRIDE)
    high = low + np.uint64(texel_floats * _PLANE_STRIDE)
    u, v, w = shares
    below = _lerp(v, _lerp(u, texels[low], texels[low + right]), _lerp(u, texels[low + up], texels[low + up + right]))
    above = _lerp(
        v, _lerp(u, texels[high], texels[high + right]), _lerp(u, texels[high + up], texels[high + up + right])
    )
    return _lerp(w, below, above)


@jit
def light_factor(x: np.float32, y: np.float32, z: np.float32, light: tuple[np.float32, ...]) -> np.float32:
    """Return the factor on the colour where the gradient is (x, y, z), of any length: Lambert's law.

    light: as in Optics.
    """
    largest = max(abs(x), abs(y), abs(z))
    if not largest > _0:
        return light[3]
    factor: np.float32 = lambert_factor(x / largest, y / largest, z / largest, light)
    return factor


@jit
def opacity_of_depth(x: np.float32) -> np.float32:
    """Return 1 - exp(-x) of x >= 0, relative error below 3e-7; 2^-n is read from a table."""
    if x < _HALF:
        series = fma(x, -_D, _C)
        series = fma(-x, series, _B)
        series = fma(-x, series, _A)
        small: np.float32 = x * fma(-x, series, _1)
        return small
    if not x < _MAX_DEPTH:
        return _1
    n = np.int32(fma(x, _LOG2_E, _HALF))
    r = fma(np.float32(n), _LN_2, -x)
    power = fma(r, np.float32(1 / 720), np.float32(1 / 120))
    power = fma(r, power, np.float32(1 / 24))
    power = fma(r, power, np.float32(1 / 6))
    power = fma(r, power, _HALF)
    power = fma(r, fma(r, power, _1), _1)
    return fma(-power, _POWERS_OF_HALF[np.uint64(n)], _1)


@jit
def sample_rgba(texels: Float32, at: int, shares: Float3) -> Color:
    """Interpolate four channels between eight texels, the lowest of which begins at `at`."""
    return (
        sample_scalar(texels, at, shares, 4),
        sample_scalar(texels, at + 1, shares, 4),
        sample_scalar(texels, at + 2, shares, 4),
        sample_scalar(texels, at + 3, shares, 4),
    )
