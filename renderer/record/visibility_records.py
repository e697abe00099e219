"""Say which scalars the pictures of a film show: from records of frames to the record of the film, and to words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from math import isfinite

import numpy as np

from renderer.accuracy import ScalarRange
from renderer.record.film_record import FilmVisibility, FrameRecord, VisibleRange
from renderer.record.rounding import round_share
from renderer.scene import join_some
from renderer.system import printable

# A range of scalars counts as hidden if its share of the visibility of all ranges is below this.
_HIDDEN_SHARE = 0.01
# A range counts as hidden only if its opacity is at least this part of the largest opacity in its volume: the foot of a
# ramp of opacity is meant to be faint.
_LEAST_OPACITY = 0.25
# A label counts as hidden if its share of the visibility is below this part of the mean share of a label: labels are
# many and small.
_HIDDEN_PART = 0.1


def range_record(found: ScalarRange) -> VisibleRange:
    """Return the record of a range of scalars whose share of the visibility is not known yet.

    An end of the range that is infinite is None in the record.
    """
    low, high = (end if isfinite(end) else None for end in (found.low, found.high))
    return VisibleRange(0.0, round_share(found.opacity), low, high, found.name, found.layer)


def film_visibility(frames: Sequence[FrameRecord], ranges: Sequence[VisibleRange]) -> FilmVisibility | None:
    """Return the share of each range in the visibility over a film.

    Return None if the visibility of a frame was not measured, or if nothing is visible."""
    if not ranges or any(len(frame.visible) != len(ranges) for frame in frames):
        return None
    visible = np.mean([frame.visible for frame in frames], axis=0)
    coverage = float(visible.sum())
    if coverage == 0.0:
        return None
    shares = [round_share(each / coverage) for each in visible]
    found = tuple(replace(each, share=share) for each, share in zip(ranges, shares, strict=True))
    return FilmVisibility(round_share(min(coverage, 1.0)), found)


def visibility_text(visibility: FilmVisibility) -> str:
    """Return `hardly seen: values from 180 to 255, 0.1 % of what is visible`; empty if no range is hidden.

    Hidden ranges that are neighbours are named as one range, and all hidden labels of a volume together.
    """

    def is_hidden(each: VisibleRange) -> bool:
        opacities = [other.opacity for other in visibility.ranges if other.layer == each.layer]
        least = _HIDDEN_SHARE if each.name is None else _HIDDEN_PART / len(opacities)
        return each.share < least and each.opacity >= _LEAST_OPACITY * max(opacities)

    ranges = [each for each in visibility.ranges if each.name is None or is_hidden(each)]
    runs = groupby(ranges, lambda each: (is_hidden(each), each.layer))
    groups = [list(group) for (hidden, _), group in runs if hidden]
    parts = [f"{_group_text(group)}, {_percent(group)}" for group in groups]
    return f"hardly seen: {'; '.join(parts)} of what is visible" if parts else ""


def _percent(ranges: Sequence[VisibleRange]) -> str:
    return f"{100 * sum(each.share for each in ranges):.2g} %"


def _group_text(group: Sequence[VisibleRange]) -> str:
    """Return the name of neighbouring ranges: the values from the first to the last range, or the names of labels."""
    first, last = group[0], group[-1]
    volume = "" if first.layer is None else f" of volume {first.layer + 1}"
    if first.name is not None:
        return join_some([printable(each.name or "") for each in group]) + volume
    ends = [f"{word} {end:g}" for word, end in (("from", first.low), ("to", last.high)) if end is not None]
    return " ".join(["values", *ends]) + volume
