"""Bound the scalars in each brick of level 0, for rays that look for the most extreme scalar.

Such rays need the field itself: cells of coarser levels have means, which lose every peak. Instead, rays pass over
bricks that cannot change a pixel. At a tolerance, a share of the colour range, they also pass over bricks that could
change a pixel by no more than SLACK_SHARE of the tolerance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from renderer.bricks.brick_cut import cut_bricks
from renderer.bricks.brick_layers import BrickLayers
from renderer.bricks.pixel_grid import screen_sampling_at
from renderer.bricks.sampling import BrickBatch, Extremes
from renderer.scene import ModeSpec

# Rays pass over a brick that could change a pixel by no more than this share of the tolerance.
SLACK_SHARE = 1 / 16


def extreme_bricks(layers: BrickLayers, mode: ModeSpec) -> BrickBatch:
    """Return the bricks of level 0 in which the most extreme scalar may lie, for tolerance 0.

    layers: a single layer. Its transfer function is a ramp over the colour range, from 0 at the least extreme end, so
        that a brick is visible if it has more extreme scalars.
    """
    bricks = layers.layers[0].bricks
    cut, volume = cut_bricks(bricks, 0.0), bricks.volume
    first, last = bricks.transfer.values
    low, high = bricks.scalar_range
    # Halves of large ranges do not overflow.
    width = last / 2 - first / 2
    slope, offset = (high / 2 - low / 2) / width, (low / 2 - first / 2) / width
    if mode.type == "minimum":
        slope, offset = -slope, 1.0 - offset
    x, y, z = cut.cells.T
    ranges = bricks.ranges[z, y, x]
    ends = (ranges / 2 - low / 2) / (high / 2 - low / 2)
    extremes = Extremes(offset, slope, (offset + slope * ends).max(axis=1), 0.0, mode.color_by == "depth")
    sampling = screen_sampling_at(0.0, 1.0)
    steps = np.ones(len(cut))
    return BrickBatch(cut, layers, steps, sampling, volume.centre, volume.half_diagonal, extremes)


def extremes_at(batch: BrickBatch, tolerance: float, voxel_px: float) -> BrickBatch:
    """Return a batch from `extreme_bricks` with its pixels and its slack changed for a tolerance.

    tolerance: the largest error, as a share of the colour range. voxel_px: the width of voxels, in pixels.
    """
    assert batch.extremes is not None
    volume = batch.cut.volume
    thinnest = float((volume.spacing / volume.finest_spacing * volume.shape_xyz).min())
    return replace(
        batch,
        screen_sampling=screen_sampling_at(tolerance, voxel_px, voxel_px * thinnest),
        extremes=replace(batch.extremes, slack=0.0 if batch.extremes.by_depth else SLACK_SHARE * tolerance),
    )
