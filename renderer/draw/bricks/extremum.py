"""Describe a search for the most extreme scalar along rays, for `extremum.cpp`."""

from __future__ import annotations

import numpy as np

from renderer.bricks import BrickBatch
from renderer.kernels import SearchRules
from renderer.view import View

# If the extremum is coloured by its depth, a later value along a ray replaces the largest one only if it exceeds it by
# more than this share of the colour range, so that rounding does not choose between equal values.
_MIN_RISE = 2.0**-18


def search_of(batch: BrickBatch, view: View) -> SearchRules:
    """Return the rules by which kernels search rays of a view for the most extreme scalar."""
    extremes, volume = batch.extremes, batch.cut.volume
    assert extremes is not None
    nearer = -0.5 / batch.model_unit * (view.forward @ volume.world_from_index[:3, :3])
    return SearchRules(
        offset=extremes.offset,
        slope=extremes.slope,
        slack=extremes.slack,
        min_rise=_MIN_RISE if extremes.by_depth else 0.0,
        ceiling=np.inf if extremes.by_depth else 1.0,
        is_sorted=not (extremes.by_depth or view.clip or batch.bricks.clip),
        has_absent=volume.num_absent > 0,
        forward=nearer if extremes.by_depth else np.zeros(3),
    )
