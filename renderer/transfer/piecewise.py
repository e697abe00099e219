"""The transfer function as a rasteriser of bricks has it: by the scalars of its texels, and exact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.jit import jit
from renderer.transfer.transfer_function import TransferFunction

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]

# Scalars are held to this many ranges from the range's start: no interpolation towards a visible one overflows.
MAX_NORMALIZED_SCALAR = 2.0**20
# What is so large that MAX_NORMALIZED_SCALAR times it is no number.
_MAX_UNSCALED_WIDTH = 2.0**1000

# Equal parts of the range, of each of which is known where to begin to look for a piece.
GUIDE_SIZE = 1024

# Pieces narrower than this are none: their slopes would not be numbers.
_MIN_PIECE_WIDTH = 2.0**-80


@dataclass(frozen=True)
class PiecewiseTransfer:
    """Colour and extinction by u, where 0 is the start of a range of scalars and 1 its end; linear in each piece.

    ends: float32 [n]. Piece k holds u from the end of the piece before on (that of a step belongs to its upper side)
        to below its own; the last one's end is infinite.
    origins: float32 [n]. lows, slopes: float32 [n, 4], of (r, g, b, extinction times the finest spacing), at the origin
        and for each unit of u.
    guide: int32 [GUIDE_SIZE]: for u from k / GUIDE_SIZE on the piece is no earlier. Below 0 it is the first one's.
    """

    ends: Float32
    origins: Float32
    lows: Float32
    slopes: Float32
    guide: npt.NDArray[np.int32]


def make_piecewise_transfer(
    transfer: TransferFunction, finest_spacing: float, first: float, last: float
) -> PiecewiseTransfer:
    """Of a transfer function whose control values are within some ranges of the range from `first` to `last`."""
    width, halves = range_width(first, last)
    knots = np.array([relative(float(value), first, width, halves) for value in transfer.values], np.float32)
    _, _, lows, rises = transfer.segments()
    lows, rises = (channels * [1.0, 1.0, 1.0, finest_spacing] for channels in (lows, rises))
    origins = np.concatenate([knots[:1], knots])
    widths = np.diff(np.append(origins, knots[-1]).astype(np.float64))
    slopes = np.divide(rises, widths[:, None], out=np.zeros_like(rises), where=widths[:, None] > _MIN_PIECE_WIDTH)
    buckets = np.searchsorted(knots, np.arange(GUIDE_SIZE) / GUIDE_SIZE, side="right")
    buckets[0] = np.searchsorted(knots, 0.0, side="left")
    pieces = PiecewiseTransfer(
        np.append(knots, np.float32(np.inf)),
        origins,
        lows.astype(np.float32),
        slopes.astype(np.float32),
        buckets.astype(np.int32),
    )
    for array in (pieces.ends, pieces.origins, pieces.lows, pieces.slopes, pieces.guide):
        array.flags.writeable = False
    return pieces


@jit
def relative(scalar: float, first: float, width: float, halves: float) -> float:
    """The scalar's place in a range, held."""
    return min(max((scalar * halves - first * halves) / width, -MAX_NORMALIZED_SCALAR), MAX_NORMALIZED_SCALAR)


@jit
def range_width(first: float, last: float) -> tuple[float, float]:
    """The width of a range times 1, or times 1/2 where it is large, and that factor. Times it, differences of scalars
    overflow, if at all, where they are more than MAX_NORMALIZED_SCALAR widths."""
    halves = 1.0 if last - first < _MAX_UNSCALED_WIDTH else 0.5
    return last * halves - first * halves, halves
