"""Choose the ranges of scalars whose share of the picture is told: a visibility histogram.

A range shows, of each ray, the sum of transmittance times opacity over the pieces whose scalars lie in it (C. D. Correa
and K.-L. Ma, "Visibility Histograms and Visibility-Driven Transfer Functions", IEEE TVCG 2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.frame import Stage
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.volume import Float64

# Colormaps have 256 control points.
_MOST_RANGES = 12
# A millionth of a picture is less than a pixel of most, and keeps records short.
_DIGITS = 6


class ScalarRange(NamedTuple):
    """A range of scalars: low <= scalar < high, which may be infinite, and intervals first to end of the transfer
    function, `end` not among them."""

    low: float
    high: float
    first: int
    end: int


def scalar_ranges(stage: Stage) -> list[ScalarRange]:
    """Return the ranges of a stage's scene, ascending; none where its mode has no opacities."""
    if stage.projection is not None:
        return []
    return visible_ranges(make_transfer_function(stage.scene.transfer_function, stage.volume.finest_spacing))


def visible_ranges(transfer: TransferFunction) -> list[ScalarRange]:
    """Return the ranges between control points in which something is visible, ascending.

    Where there are many, those are joined whose middles lie in the same of equal parts of the visible values.
    """
    ends = np.concatenate([[-np.inf], transfer.values, [np.inf]])
    is_opaque = np.pad(transfer.extinctions > 0, 1, mode="edge")
    visible = np.flatnonzero((is_opaque[:-1] | is_opaque[1:]) & (ends[:-1] < ends[1:]))
    parts = np.arange(visible.size)
    if visible.size > _MOST_RANGES:
        finite = np.clip(ends, transfer.values[0], transfer.values[-1]) / 4  # sums and differences do not overflow
        low, high = finite[visible[0]], finite[visible[-1] + 1]
        middles = (finite[visible] + finite[visible + 1]) / 2
        parts = np.minimum((middles - low) / (high - low) * _MOST_RANGES, _MOST_RANGES - 1).astype(np.int64)
    # What lies beyond the first or last control point belongs to the range beside it: often there are no such values.
    is_inner = (visible[:-1] > 0) & (visible[1:] < transfer.values.size)
    is_new = (np.diff(parts) > 0) & (is_inner | (np.diff(visible) > 1))
    groups = np.split(visible, np.flatnonzero(is_new) + 1) if visible.size else []
    return [ScalarRange(float(ends[at[0]]), float(ends[at[-1] + 1]), int(at[0]), int(at[-1]) + 1) for at in groups]


def sum_ranges(by_interval: Float64, ranges: Sequence[ScalarRange]) -> tuple[float, ...]:
    """Return the sums over ranges of what intervals show, float64 [intervals]."""
    return tuple(round(float(by_interval[each.first : each.end].sum()), _DIGITS) for each in ranges)
