"""The transfer function as a rasteriser of bricks has it: a table to be interpolated."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from renderer.transfer import TransferFunction

Float64 = npt.NDArray[np.float64]

# Between which numbers of a table's entries a good one is looked for: usually, and where a piece of the transfer
# function would have fewer than CELLS_OF_PIECE of them. Any device can hold the most in a row.
USUAL_ENTRIES, MOST_ENTRIES = (1 << 10, 1 << 12), (1 << 13, 1 << 14)
CELLS_OF_PIECE = 4

# Scalars are held to this many ranges from the range's start: no interpolation towards a visible one overflows.
FARTHEST = 2.0**20


def optical_table(transfer: TransferFunction, first: float, last: float) -> npt.NDArray[np.float32]:
    """float32 [k, 4]: (tau c, tau) at evenly spaced scalars from `first` to `last`.

    What lies between two entries is linear, as the transfer function is between two control values: it is exact where
    these fall on entries, and so the number of entries is the one, of the usual ones, with which they do so best.
    """
    share = np.linspace(0, 1, _num_entries(transfer.values, first, last))
    colors, extinctions = transfer.classify(first * (1 - share) + last * share)
    table = np.column_stack([colors * extinctions[:, None], extinctions]).astype(np.float32)
    table.flags.writeable = False
    return table


def _num_entries(values: Float64, first: float, last: float) -> int:
    """How many entries a table has: more where the transfer function has steps, which take one from one to the next."""
    exponent = max(math.frexp(first)[1], math.frexp(last)[1])
    scale = math.ldexp(1.0, min(-exponent, 1023))  # differences are finite then, and so is the scale of denormals
    inside = values[(values >= first) & (values <= last)]
    shares = (inside * scale - first * scale) / (last * scale - first * scale)
    fewest, most = USUAL_ENTRIES
    if float(np.diff(shares).min(initial=1.0)) * most < CELLS_OF_PIECE:
        fewest, most = MOST_ENTRIES
    nums = np.arange(fewest, most)
    farthest = np.zeros(len(nums))
    for share in shares:  # there may be many, all of which at a time take much memory
        at = nums * share
        np.maximum(farthest, np.abs(at - np.round(at)), out=farthest)
    return int(nums[farthest.argmin()]) + 1
