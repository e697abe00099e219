"""Make the curve by which sub-voxel variation is measured: colour and extinction over the scalar.

Sub-voxel variation, the distance of this curve from straight lines between neighbouring voxels, is defined and computed
by `renderer/kernels/sources/bricks/subvoxel.cpp`.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.kernels import TransferTable
from renderer.transfer import LARGEST_EXPONENT, TransferFunction, make_transfer_table
from renderer.volume import Float64, Int64

# A control value is left out if its channels are at most this far from the line through its neighbours, as a share of
# the largest channel: colormaps have hundreds of control values, nearly on a line. The kernel's sub-voxel variation D
# changes by at most four times this share.
SIMPLIFICATION_TOLERANCE = 2.0**-12
# Transfer functions with more control values than this are not simplified. Only labels have so many: their steps are
# not on a line, and the search would take a minute.
_MAX_SIMPLIFIED = 2**13


def make_channel_curve(
    transfer: TransferFunction,
    finest_spacing: float,
    opacity: bool,
    brightest: float,
    volume_range: tuple[float, float],
) -> TransferTable:
    """Return the simplified table of (tau c, tau) times the finest spacing, as a function of the scalar.

    opacity: whether the table is of (a c, a) instead, with the opacity a. brightest: a factor on colours.
    volume_range: the range of the volume's scalars. The table's scale makes all differences of scalars finite.
    """
    weights = transfer.extinctions * finest_spacing
    if opacity:
        weights = -np.expm1(-weights)
    points = np.column_stack([brightest * transfer.colors * weights[:, None], weights])
    exponent = math.frexp(max(float(np.abs(transfer.values).max()), *map(abs, volume_range)))[1]
    scale = math.ldexp(1.0, min(0, LARGEST_EXPONENT - exponent))
    is_hidden = np.zeros(len(points), np.bool_)  # whether a point lies between two other points at the same value
    is_hidden[1:-1] = transfer.values[2:] == transfer.values[:-2]
    values, points = transfer.values[~is_hidden], points[~is_hidden]
    chosen = np.arange(len(values))
    if len(values) <= _MAX_SIMPLIFIED:
        chosen = _simplify(values * scale, points, SIMPLIFICATION_TOLERANCE * float(points.max()))
    return make_transfer_table(values[chosen], points[chosen], scale)


def make_scalar_curve(volume_range: tuple[float, float]) -> TransferTable:
    """Return a table with the scalar as its only channel, as a share of the volume's range.

    The table is wider than the volume's range, so that no scalar is at its end.
    """
    low, high = volume_range
    scale = math.ldexp(1.0, min(0, LARGEST_EXPONENT - 1 - math.frexp(max(abs(low), abs(high)))[1]))
    width = (high * scale - low * scale) or 1.0
    points = np.zeros((2, 4))
    points[:, 3] = -1.0, 2.0
    # Unscaled control values might overflow.
    scaled = np.array([low * scale - width, high * scale + width])
    return make_transfer_table(scaled, points)._replace(scale=scale)


def _simplify(values: Float64, points: Float64, tolerance: float) -> Int64:
    """Return the indices of points whose connecting lines pass all other points within a tolerance: int64 [m].

    The algorithm of Douglas and Peucker 1973, along the axis of values, takes the farthest point first.
    """
    chosen, parts = {0, len(values) - 1}, [(0, len(values) - 1)]
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
            chosen.add(middle)
            parts += [(first, middle), (middle, last)]
    return np.array(sorted(chosen))
