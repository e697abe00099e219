"""Describe a search for the most extreme scalar along rays, for `extremum.cpp`."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.bricks import BrickBatch
from renderer.view import View

# By depth, a later number must exceed the largest one by this share of the colour range: rounding must not choose
# between equal ones.
_MIN_RISE = 2.0**-18


def search_of(batch: BrickBatch, view: View) -> dict[str, Any]:
    """Return what is sought in a view, the same in all bricks: members of DrawExtremes in kernels.h.

    offset, slope: as in Extremes. slack: by how much a number must exceed the largest one to count, and min_rise to
        take its place. ceiling: a ray ends at this number.
    is_sorted: whether the bounds of bricks fall. Else they come front to back. has_absent: whether any voxel has no
        data.
    forward: float64 [3], how much nearer a step along each index axis is; 0 where depth does not count. Nearness falls
        from 1 to 0 through the ball around the volume, its diameter.
    """
    extremes, volume = batch.extremes, batch.cut.volume
    assert extremes is not None
    nearer = -0.5 / batch.model_unit * (view.forward @ volume.world_from_index[:3, :3])
    return {
        "offset": np.float32(extremes.offset),
        "slope": np.float32(extremes.slope),
        "slack": np.float32(extremes.slack),
        "min_rise": _MIN_RISE if extremes.by_depth else 0.0,
        "ceiling": np.inf if extremes.by_depth else 1.0,
        "is_sorted": not (extremes.by_depth or view.clip or batch.bricks.clip),
        "has_absent": volume.num_absent > 0,
        "forward": nearer if extremes.by_depth else np.zeros(3),
    }
