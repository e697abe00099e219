"""Describe a search for the most extreme scalar along rays, for `extremum.cpp`."""

from __future__ import annotations

import numpy as np

from renderer.bricks import BrickBatch
from renderer.kernels import SearchRules
from renderer.view import View

# In searches by depth, a later number must exceed the largest one by this share of the colour range, so that rounding
# does not choose between equal numbers.
_MIN_RISE = 2.0**-18


def search_of(batch: BrickBatch, view: View) -> SearchRules:
    """Return the rules of the search for the extremum in a view."""
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
