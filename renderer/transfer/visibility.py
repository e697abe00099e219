"""The min-max test: whether the transfer function shows anything between two scalars.

*Visibility breakpoints* are the ascending scalars at which visibility changes: a scalar is visible where an odd number
of breakpoints is at or below it. Nothing between two scalars is visible if, and only if, both have the same even
number, however thin a peak of the transfer function is.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from renderer.jit import jit
from renderer.transfer.transfer_function import TransferFunction

Float64 = npt.NDArray[np.float64]

# Smaller optical depths and opacities count as 0: a row of 10^10 such voxels would still be invisible, and the mean of
# 2^36 of them with nothing else is still a normal number of float32.
VISIBILITY_THRESHOLD = 2.0**-80


def visibility_breakpoints(transfer: TransferFunction, finest_spacing: float) -> Float64:
    """Return the scalars at which a voxel becomes visible or invisible, ascending, float64 [m].

    A slope that rises from 0 becomes visible at the next number, so that its foot is not seen. A step belongs to its
    upper side. Two changes at one scalar cancel.
    """
    values, is_visible = transfer.values, transfer.extinctions * finest_spacing >= VISIBILITY_THRESHOLD
    found = [-math.inf] if is_visible[0] else []
    for k in np.flatnonzero(is_visible[1:] != is_visible[:-1]):
        start, end = float(values[k]), float(values[k + 1])
        low, high = transfer.extinctions[k : k + 2] * finest_spacing
        share = float((VISIBILITY_THRESHOLD - low) / (high - low))
        crossing = start * (1 - share) + end * share
        found.append(min(max(crossing, math.nextafter(start, math.inf)), end))
    different, counts = np.unique(np.array(found, np.float64), return_counts=True)
    return np.asarray(different[counts % 2 == 1])


@jit
def is_range_visible(breakpoints: Float64, low: float, high: float) -> bool:
    """Return whether any scalar from `low` to `high` is visible."""
    num_low = np.searchsorted(breakpoints, low, side="right")
    return bool(num_low & 1) or np.searchsorted(breakpoints, high, side="right") != num_low
