"""Measure flicker: how much the error of a pixel changes from one frame to the next, in levels of 8 bits, 0 to 255.

An error is a picture minus its truth, so that what moves in both does not count.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.accuracy.metrics import FloatImage
from renderer.volume import Array, Bools

# Levels of a colour of 1.
LEVELS = 255.0
# Rows and columns of a block of pixels, whose mean error is an error, too: what is seen of changes from some way off.
BLOCK_PX = 8


@dataclass(frozen=True)
class PictureErrors:
    """The errors of the picture of a frame. errors: with their signs, in [-1, 1], [h, w, 3].

    variances: of the errors, by the rays of the truth, [h, w, 3]. on_volume: where the truth shows the volume, [h, w].
    """

    frame: int
    errors: FloatImage
    variances: FloatImage
    on_volume: Bools


@dataclass(frozen=True)
class Flicker:
    """The change of errors from one frame to the next.

    rms: over all pixels and channels, free of the errors of the truths on average. Other changes are those of the
    channel that changes most, where either truth shows the volume, and have the errors of the truths. p99, largest: of
    pixels. block_p99, block_largest: of the mean errors of blocks of pixels that show any of the volume.
    """

    rms: float
    p99: float
    largest: float
    block_p99: float
    block_largest: float


def measure_flicker(before: PictureErrors, after: PictureErrors) -> Flicker | None:
    """Compare the errors of two frames; None unless the second comes next and one of them shows the volume."""
    seen = before.on_volume | after.on_volume
    if after.frame != before.frame + 1 or not seen.any():
        return None
    change = LEVELS * (after.errors - before.errors)
    squares = change**2 - LEVELS**2 * (before.variances + after.variances)
    pixels = np.abs(change).max(axis=2)[seen]
    blocks = np.abs(_block_sums(change) / _block_sums(np.ones_like(change))).max(axis=2)
    blocks = blocks[_block_sums(seen[..., None].astype(np.float64))[..., 0] > 0]
    of_pixels, of_blocks = ((float(np.percentile(each, 99)), float(each.max())) for each in (pixels, blocks))
    return Flicker(math.sqrt(max(float(squares.mean()), 0.0)), *of_pixels, *of_blocks)


def pool_flickers(flickers: Sequence[Flicker]) -> Flicker | None:
    """Return the flicker of several pairs of frames, each with equal weight; None without any.

    The root mean square is from the mean of the squares, and percentiles have their mean.
    """
    if not flickers:
        return None
    return Flicker(
        rms=math.sqrt(statistics.fmean(each.rms**2 for each in flickers)),
        p99=statistics.fmean(each.p99 for each in flickers),
        largest=max(each.largest for each in flickers),
        block_p99=statistics.fmean(each.block_p99 for each in flickers),
        block_largest=max(each.block_largest for each in flickers),
    )


def _block_sums(values: Array) -> Array:
    """Return the sums over blocks of pixels, [rows, columns, channels]; those at the border may be smaller."""
    height, width, _ = values.shape
    in_rows = np.add.reduceat(values, np.arange(0, height, BLOCK_PX), axis=0)
    return np.asarray(np.add.reduceat(in_rows, np.arange(0, width, BLOCK_PX), axis=1))
