"""Describe a search for the most extreme scalar along rays, for `extremum.cpp`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.bricks import BrickBatch
from renderer.view import View
from renderer.volume import Float64

# By depth, a later number must exceed the largest one by this share of the colour range: rounding must not choose
# between equal ones.
_MIN_RISE = 2.0**-18


class Search(NamedTuple):
    """A search, the same in all bricks.

    offset, slope: as in Extremes. slack: by how much a number must exceed the largest one to count, and min_rise to
        take its place. ceiling: a ray ends at this number.
    is_sorted: whether the bounds of bricks fall. Else they come front to back. has_absent: whether any voxel has no
        data.
    forward: float64 [3], how much nearer a step along each index axis is; 0 where depth does not count.
    """

    offset: np.float32
    slope: np.float32
    slack: np.float32
    min_rise: float
    ceiling: float
    is_sorted: bool
    has_absent: bool
    forward: Float64


def make_search(batch: BrickBatch, view: View) -> Search:
    """Return what is sought in a view. Nearness falls from 1 to 0 through the ball around the volume, its diameter."""
    extremes, volume = batch.extremes, batch.cut.volume
    assert extremes is not None
    nearer = -0.5 / batch.model_unit * (view.forward @ volume.world_from_index[:3, :3])
    return Search(
        np.float32(extremes.offset),
        np.float32(extremes.slope),
        np.float32(extremes.slack),
        _MIN_RISE if extremes.by_depth else 0.0,
        np.inf if extremes.by_depth else 1.0,
        not (extremes.by_depth or view.cuts),
        volume.num_absent > 0,
        nearer if extremes.by_depth else np.zeros(3),
    )
