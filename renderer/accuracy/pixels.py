"""Choose the pixels of a frame that are worth an exact ray: more of them where the picture has edges.

A block of pixels is chosen by its largest difference between neighbours, and a pixel in it by its own: errors lie near
edges. A part of the rays is spread evenly, so that no error can hide. With all of them, four times as many are needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.volume import Float64, Int64, UInt8

_BLOCK = 8
# Blocks along y that are looked at together: their differences stay in the processor's cache.
_BLOCKS_AT_ONCE = 8
# A pixel's weight is its difference plus a share of the largest in its block and a constant for a block that is not
# flat, in levels of 8 bits. What they are hardly matters. Every pixel gets this part of the mean weight, too.
_SHARE_OF_LARGEST, _NOT_FLAT, _EVEN = 0.6, 2.0, 0.15
# The difference of a typical pixel, by the largest in its block.
_TYPICAL_DIFFERENCE = 0.25


class ChosenPixels(NamedTuple):
    """Pixels that were chosen, with repetitions.

    numbers: int64 [n], row by row from the top left corner.
    factors: float64 [n]. The mean of any quantity over the picture is expected to be that of quantity times factor.
    """

    numbers: Int64
    factors: Float64


def choose_pixels(image: UInt8, num: int, seed: tuple[int, ...]) -> ChosenPixels:
    """Choose pixels of a picture, uint8 [h, w, channels]: one for each of `num` equal parts of the blocks' weight."""
    height, width, _ = image.shape
    random, each = np.random.default_rng(seed), np.arange(num)
    largest = _largest_differences(image)
    num_columns = largest.shape[1]
    largest = largest.ravel()
    shared = _SHARE_OF_LARGEST * largest + _NOT_FLAT * (largest > 0)
    shared += _EVEN * (shared + _TYPICAL_DIFFERENCE * largest).mean() or 1.0
    ends = np.cumsum(shared + _TYPICAL_DIFFERENCE * largest)
    blocks = np.searchsorted(ends, (each + random.random(num)) * (ends[-1] / num), side="right")
    blocks = np.minimum(blocks, len(ends) - 1)
    chances = np.diff(ends, prepend=0.0)[blocks] / ends[-1]
    rows, columns = (_BLOCK * at[:, None] + np.arange(_BLOCK + 1) for at in np.divmod(blocks, num_columns))
    weights = _differences_in_blocks(image, rows, columns) + shared[blocks, None, None]
    weights *= (rows[:, :-1, None] < height) & (columns[:, None, :-1] < width)
    ends = np.cumsum(weights.reshape(num, -1), axis=1)
    pixels = np.argmax(ends > (random.random(num) * ends[:, -1])[:, None], axis=1)
    row, column = np.divmod(pixels, _BLOCK)
    chances *= weights[each, row, column] / ends[:, -1]
    return ChosenPixels(rows[each, row] * width + columns[each, column], 1 / (chances * (height * width)))


def _largest_differences(image: UInt8) -> UInt8:
    """Return for each block the largest difference of a channel from the next pixel to the right or below."""
    height, width, num_channels = image.shape
    num_rows, num_columns = -(-height // _BLOCK), -(-width // _BLOCK)
    found = np.empty((num_rows, num_columns), np.uint8)
    for first in range(0, num_rows, _BLOCKS_AT_ONCE):
        part = image[_BLOCK * first : _BLOCK * (first + _BLOCKS_AT_ONCE) + 1]
        blocks = found[first : first + _BLOCKS_AT_ONCE]
        differences = np.zeros((_BLOCK * len(blocks) + 1, num_columns * _BLOCK, num_channels), np.uint8)
        differences[: len(part) - 1, :width] = _difference(part[:-1], part[1:])
        across = differences[: len(part), : width - 1]
        np.maximum(across, _difference(part[:, :-1], part[:, 1:]), out=across)
        in_rows = differences[:-1].reshape(len(blocks), _BLOCK, -1).max(axis=1)
        blocks[:] = in_rows.reshape(*blocks.shape, -1).max(axis=2)
    return found


def _differences_in_blocks(image: UInt8, rows: Int64, columns: Int64) -> UInt8:
    """Return the differences of all pixels in some blocks, uint8 [n, _BLOCK, _BLOCK].

    rows, columns: int64 [n, _BLOCK + 1], those of the blocks and the next one.
    """
    height, width, _ = image.shape
    values = image[np.minimum(rows, height - 1)[:, :, None], np.minimum(columns, width - 1)[:, None, :]]
    down = _difference(values[:, :-1, :-1], values[:, 1:, :-1])
    across = _difference(values[:, :-1, :-1], values[:, :-1, 1:])
    larger: UInt8 = np.maximum(down, across).max(axis=3)
    return larger


def _difference(one: UInt8, two: UInt8) -> UInt8:
    larger: UInt8 = np.maximum(one, two)
    larger -= np.minimum(one, two)
    return larger
