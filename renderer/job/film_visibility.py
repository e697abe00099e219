"""Say which scalars the pictures of a film show: from the records of frames to that of the film, and to words."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from math import isfinite

import numpy as np

from renderer.job.record import FilmVisibility, FrameRecord, VisibleRange

_DIGITS = 6
# A range with a smaller share is named.
_LEAST_SHARE = 0.01


def film_visibility(
    frames: Sequence[FrameRecord], bounds: Sequence[tuple[float | None, float | None]]
) -> FilmVisibility | None:
    """Return what ranges of scalars between these bounds show in a film; None unless each frame has told.

    A bound that is None or infinite is none.
    """
    if not bounds or any(len(frame.visible) != len(bounds) for frame in frames):
        return None
    visible = np.mean([frame.visible for frame in frames], axis=0)
    coverage = float(visible.sum())
    if coverage == 0.0:
        return None
    ranges = [
        VisibleRange(round(float(each) / coverage, _DIGITS), _finite(low), _finite(high))
        for each, (low, high) in zip(visible, bounds, strict=True)
    ]
    return FilmVisibility(round(min(coverage, 1.0), _DIGITS), tuple(ranges))


def _finite(bound: float | None) -> float | None:
    return bound if bound is not None and isfinite(bound) else None


def visibility_text(visibility: FilmVisibility) -> str:
    """Return `values 180 to 255 are 0.1 % of what is seen`, of all ranges that are hardly seen; empty without any.

    Neighbours are one range.
    """
    ranges, parts = visibility.ranges, []
    for is_hidden, group in groupby(ranges, lambda each: each.share < _LEAST_SHARE):
        found = list(group)
        if is_hidden:
            parts.append(f"{_range_text(found[0].low, found[-1].high)} {100 * sum(each.share for each in found):.1f} %")
    return f"hardly seen: {', '.join(parts)} of what is visible" if parts else ""


def _range_text(low: float | None, high: float | None) -> str:
    if low is None:
        return "all values" if high is None else f"values below {high:g}"
    return f"values from {low:g}" if high is None else f"values {low:g} to {high:g}"
