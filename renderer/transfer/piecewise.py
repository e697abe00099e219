"""Make tables of a transfer function: four channels, linear in the scalar between control points.

`TransferTable` is exact, in float64. By it, voxels are classified, and nodes and sub-voxel variation are computed.
`PiecewiseTransfer` is the same table in float32, over the normalized scalars of texels. By it, bricks are drawn.
Neither is sampled evenly: 16384 even parts of a range of a million would miss a shell that is 20 wide.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels import PiecewiseTransfer, TransferTable
from renderer.volume import Float32, Float64, Int32

# The number of buckets that a table divides the range of scalars into. A list of buckets, the guide, says where the
# search for the segment of a scalar starts. Most buckets hold no control point, and the guide's 8 KiB stay in cache.
GUIDE_SIZE = 1024

# The length, in finest spacings, whose opacity tells surfaces. Matter that is opaque over a few voxels looks like a
# surface.
OPACITY_SPACINGS = 4.0

# The largest magnitude of a normalized scalar. Larger scalars are clamped, so that no interpolation towards a visible
# scalar overflows.
MAX_NORMALIZED_SCALAR = 2.0**20
# Ranges of scalars that are at least as wide as this are halved, because MAX_NORMALIZED_SCALAR times the width would
# overflow.
_MAX_UNSCALED_WIDTH = 2.0**1000

# The number of floats in a row of PiecewiseTransfer.rows, which describes a segment between two control points.
PIECE_FLOATS = 12
# A segment that is at most as wide as this gets the slope 0, because its slope may not be finite in float32. No scalar
# falls into such a segment.
_MIN_SEGMENT_WIDTH = 2.0**-80


def make_transfer_table(values: Float64, channels: Float64, scale: float = 1.0) -> TransferTable:
    """Return the table that interpolates channels between control values.

    values: the control values, ascending, [n]. channels: the channels at these values, [n, 4]. scale: a power of two by
    which scalars are multiplied, so that their differences are finite.
    """
    scaled = values * scale
    starts, lows = np.concatenate([scaled[:1], scaled]), np.concatenate([channels[:1], channels])
    widths, rises = np.ones_like(starts), np.zeros_like(lows)
    widths[1:-1], rises[1:-1] = np.diff(scaled), np.diff(channels, axis=0)
    widths[widths == 0] = 1.0  # no scalar falls into the segment of a step; the division stays defined
    origin, extent = float(scaled[0]), float(scaled[-1] - scaled[0])
    bounds, buckets_per_unit = np.full(GUIDE_SIZE + 3, np.inf), 0.0
    if extent > GUIDE_SIZE * np.finfo(np.float64).tiny:
        # There is one bucket more on both sides, because `transfer.h` rounds the number of a scalar's bucket.
        bounds = origin + extent * ((np.arange(GUIDE_SIZE + 3) - 1) / GUIDE_SIZE)
        buckets_per_unit = GUIDE_SIZE / extent
    bounds[0] = -np.inf  # scalars below the first control value fall into the first bucket
    guide = np.searchsorted(scaled, bounds, side="right").astype(np.uint64)
    rows = np.column_stack([starts, widths, lows, rises])
    return TransferTable(np.ascontiguousarray(values), rows, scale, guide, buckets_per_unit)


def make_piecewise_transfer(curve: TransferTable, first: float, last: float) -> PiecewiseTransfer:
    """Return the table `curve` in float32, for scalars that are normalized to the range from `first` to `last`."""
    width, factor = range_width(first, last)
    with np.errstate(over="ignore"):  # infinite knots are clamped
        knots = (curve.values * factor - first * factor) / width
    knots = np.clip(knots, -MAX_NORMALIZED_SCALAR, MAX_NORMALIZED_SCALAR).astype(np.float32)
    origins, rises = np.concatenate([knots[:1], knots]), curve.rows[:, 6:]
    widths = np.diff(np.append(origins, knots[-1]).astype(np.float64))[:, None]
    slopes = np.divide(rises, widths, out=np.zeros_like(rises), where=widths > _MIN_SEGMENT_WIDTH)
    lows, ends = curve.rows[:, 2:6], np.append(knots, np.inf)
    rows = np.column_stack([ends, origins, lows[:, 3], slopes[:, 3], lows, slopes]).astype(np.float32)
    guide = np.searchsorted(knots, np.arange(GUIDE_SIZE) / GUIDE_SIZE, side="right").astype(np.int32)
    guide[0] = np.searchsorted(knots, 0.0, side="left")
    rows.flags.writeable = guide.flags.writeable = False
    depths = OPACITY_SPACINGS * _extinctions_at(rows, np.arange(GUIDE_SIZE + 1) / GUIDE_SIZE)
    opacities = (-np.expm1(-depths)).astype(np.float32)
    return PiecewiseTransfer(rows, guide, float(_lowest_visible(rows, guide)), opacities)


def _extinctions_at(rows: Float32, scalars: Float64) -> Float64:
    """Return the extinctions of normalized scalars, none below 0. rows: a member of PiecewiseTransfer."""
    origins, lows, slopes = rows[np.searchsorted(rows[:, 0], scalars, side="right"), 1:4].astype(np.float64).T
    return np.asarray(np.maximum(0.0, lows + (scalars - origins) * slopes))


def _lowest_visible(rows: Float32, guide: Int32) -> np.float32:
    """Return the normalized scalar below which no extinction is positive.

    It is the start of the first segment with a positive extinction. If the extinction is 0 at the origin of a segment,
    and its slope is not positive, no scalar above the origin has a positive extinction, also after rounding. Only the
    segment in which the search starts has scalars below its origin. rows, guide: members of PiecewiseTransfer.
    """
    first = guide[0]
    tau, slope = rows[first:, 2], rows[first:, 3]
    is_visible = (tau > 0) | (slope > 0)
    is_visible[0] |= slope[0] < 0
    starts = np.append(np.float32(-np.inf), rows[first:-1, 0])
    lowest: np.float32 = starts[is_visible].min(initial=np.float32(np.inf))
    return lowest


def range_width(first: float, last: float) -> tuple[float, float]:
    """Return the width of a range of scalars times a factor, and the factor: 1, or 1/2 if the width may overflow.

    If scalars are multiplied by the factor, their differences overflow only if they exceed MAX_NORMALIZED_SCALAR times
    the width.
    """
    factor = 1.0 if last - first < _MAX_UNSCALED_WIDTH else 0.5
    return last * factor - first * factor, factor
