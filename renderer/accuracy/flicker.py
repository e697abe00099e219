"""Measure flicker: how much the error of a pixel changes from one frame to the next, in levels of 8 bits, 0 to 255.

An error is a picture minus its truth, so that motion of the object, which is in both, does not count.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.accuracy.metrics import FloatImage
from renderer.volume import Array, Bools

# The factor from colours in [0, 1] to levels of 8 bits.
LEVELS = 255.0
# The number of rows and columns of a block of pixels. The mean error of a block changes, too: it stands for the flicker
# that is seen from some way off.
BLOCK_PX = 8


@dataclass(frozen=True)
class PictureErrors:
    """The errors of the picture of a frame.

    errors: [h, w, 3], picture minus truth, in [-1, 1].
    variances: [h, w, 3], the variance that each error has because the truth is a mean of a few rays.
    on_volume: bool [h, w], whether the truth shows the volume.
    """

    frame: int
    errors: FloatImage
    variances: FloatImage
    on_volume: Bools


@dataclass(frozen=True)
class Flicker:
    """The change of errors from one frame to the next, in levels of 8 bits.

    rms: the root mean square change over all pixels and channels, less the part that the truths' own errors cause.
    p99, largest: the 99th percentile and the maximum over the pixels in which either truth shows the volume, of the
        change of the channel that changes most. They include the truths' own errors.
    block_p99, block_largest: the same for the mean errors of blocks of pixels that show any of the volume.
    """

    rms: float
    p99: float
    largest: float
    block_p99: float
    block_largest: float


def measure_flicker(before: PictureErrors, after: PictureErrors) -> Flicker | None:
    """Return the flicker between two frames; None unless they are neighbours and one of them shows the volume."""
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
    """Return the flicker of several pairs of frames, each with equal weight; None without any pair.

    `rms` is the root of the mean of its squares, percentiles are averaged, and of maxima the largest is taken.
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
    """Return the sums over blocks of pixels, [rows, columns, channels]; blocks at the border may have fewer pixels."""
    height, width, _ = values.shape
    in_rows = np.add.reduceat(values, np.arange(0, height, BLOCK_PX), axis=0)
    return np.asarray(np.add.reduceat(in_rows, np.arange(0, width, BLOCK_PX), axis=1))
