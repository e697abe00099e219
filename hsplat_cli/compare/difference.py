"""Measure the difference of a picture of 8 bits from its golden: PSNR, the PSNR of the worst part, the largest, FLIP.

If the pictures have alpha, alpha is a channel beside the colours, and the error of a colour is weighted by the larger
of both opacities. Premultiplied colours would count a change of alpha twice: if a colour and its alpha each differ by
one step of rounding, they would differ by two steps.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from renderer.accuracy import MOST_DB, REACH_PX, metric_map, psnr
from renderer.film import Pixels
from renderer.volume import Array, Float32, Float64

# The side of a part, in pixels: a missing brick, or a wrong edge, fills at least a part of this size.
PART_PX = 8
# The side of the squares in which FLIP is computed, in pixels: a large picture would take gigabytes at once.
_BLOCK_PX = 256
# The largest value of a channel.
_WHITE = 255.0

_Block = tuple[slice, slice]


@dataclass(frozen=True)
class Figures:
    """The figures of a difference.

    psnr: the PSNR of the picture against its golden, in dB; MOST_DB for equal pictures.
    part_psnr: the PSNR of the worst part of PART_PX x PART_PX pixels.
    part: the column and the row of the top left pixel of that part.
    largest: the largest error of a channel, in grey steps of 1/255.
    is_same: whether all stored values are equal, colours at an alpha of 0 included.
    """

    psnr: float = MOST_DB
    part_psnr: float = MOST_DB
    part: tuple[int, int] = (0, 0)
    largest: float = 0.0
    is_same: bool = True


SAME = Figures()


def measure_difference(golden: Pixels, actual: Pixels) -> Figures:
    """Return the figures of a picture against its golden: uint8 [h, w, 3] or, with straight alpha, [h, w, 4]."""
    assert golden.shape == actual.shape and golden.dtype == actual.dtype == np.uint8, (golden.shape, actual.shape)
    if golden is actual or np.array_equal(golden, actual):
        return SAME
    errors = _signed_errors(golden, actual)
    squares = (errors.astype(np.float64) ** 2).mean(axis=2)
    height, width = (min(PART_PX, length) for length in squares.shape)
    sums = _sums_down(_sums_down(squares, height).T, width).T
    row, column = np.unravel_index(int(sums.argmax()), sums.shape)
    return Figures(
        _decibels(float(squares.mean())),
        _decibels(float(sums[row, column]) / (height * width)),
        (int(column), int(row)),
        float(np.abs(errors).max()) * _WHITE,
        is_same=False,
    )


def _decibels(mean_square: float) -> float:
    """Return a PSNR from 0 to MOST_DB; rounding may make the largest error a little larger than white."""
    return max(0.0, min(psnr(mean_square), MOST_DB))


def _signed_errors(golden: Pixels, actual: Pixels) -> Float32:
    """Return actual minus golden, float32 [h, w, 3 or 4] in [-1, 1]; colours weighted by the larger opacity."""
    errors: Float32 = (actual.astype(np.float32) - golden) / np.float32(_WHITE)
    if golden.shape[2] == 4:
        errors[..., :3] *= np.maximum(golden[..., 3:], actual[..., 3:]) / np.float32(_WHITE)
    return errors


def has_flip() -> bool:
    """Return whether the package for FLIP is installed."""
    return importlib.util.find_spec("flip_evaluator") is not None


def measure_flip(golden: Pixels, actual: Pixels) -> float:
    """Return the mean FLIP; for transparent pictures, the worse value over black and over white.

    It needs the package flip-evaluator (`has_flip`). Squares in which nothing differs are not computed.
    """
    height, width, channels = golden.shape
    errors = _signed_errors(golden, actual)
    sums = [0.0] if channels == 3 else [0.0, 0.0]
    for around, cut in _blocks(height, width):
        if errors[around].any():
            for ground in range(len(sums)):
                found = metric_map("flip", _over(actual[around], ground), _over(golden[around], ground))
                sums[ground] += float(np.sum(found[cut]))
    return float(max(sums) / (height * width))


def _sums_down(values: Float64, num: int) -> Float64:
    """Return the sums of each column over `num` consecutive rows."""
    sums: Float64 = np.lib.stride_tricks.sliding_window_view(values, num, axis=0).sum(axis=-1)
    return sums


def _blocks(height: int, width: int) -> Iterator[tuple[_Block, _Block]]:
    """Yield the squares of a picture, each with a margin of REACH_PX, and the place of the square within its margin."""
    for top in range(0, height, _BLOCK_PX):
        for left in range(0, width, _BLOCK_PX):
            y, x = max(top - REACH_PX, 0), max(left - REACH_PX, 0)
            around = slice(y, top + _BLOCK_PX + REACH_PX), slice(x, left + _BLOCK_PX + REACH_PX)
            yield around, (slice(top - y, top - y + _BLOCK_PX), slice(left - x, left - x + _BLOCK_PX))


def _over(image: Pixels, ground: float) -> Array:
    """Composite a picture over a grey, from 0 for black to 1 for white; return float64 [h, w, 3] in [0, 1]."""
    values = image / _WHITE
    if image.shape[2] == 3:
        return values
    alpha = values[..., 3:]
    return np.clip(values[..., :3] * alpha + (1 - alpha) * ground, 0, 1)
