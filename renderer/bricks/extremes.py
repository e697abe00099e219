"""Bound the scalars in each brick of level 0, for rays that look for the most extreme one.

Such rays need the field itself: cells of coarser levels have means, which lose every peak. Bricks that cannot change a
pixel are passed over instead. At a tolerance, a share of the colour range, they also are where they could change it by
a part of it, SLACK_SHARE.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from renderer.bricks.brick_cut import BrickCut, cut_bricks
from renderer.bricks.bricks import Bricks
from renderer.bricks.layout import PADDED_BRICK_SIZE, fill_padded
from renderer.bricks.pixel_grid import screen_sampling_at
from renderer.bricks.sampling import BrickBatch, Extremes
from renderer.bricks.subvoxel import range_of
from renderer.compiled import jit
from renderer.kernels import ThreadPool
from renderer.scene import ModeSpec
from renderer.transfer import RawVoxels, raw_voxels
from renderer.volume import Float64, Int32

SLACK_SHARE = 1 / 16

# Bricks of one task.
_BRICKS_PER_TASK = 256


def extreme_bricks(bricks: Bricks, mode: ModeSpec, *, num_threads: int) -> BrickBatch:
    """Return the bricks of level 0 in which a scalar may count, for tolerance 0.

    What is more extreme than one end of the colour range is what `bricks.transfer` shows, a ramp from 0 over that
    range.
    """
    cut, volume = cut_bricks(bricks, 0.0), bricks.volume
    first, last = bricks.transfer.values
    low, high = bricks.scalar_range
    # Halves of large ranges do not overflow.
    width = last / 2 - first / 2
    slope, offset = (high / 2 - low / 2) / width, (low / 2 - first / 2) / width
    if mode.type == "minimum":
        slope, offset = -slope, 1.0 - offset
    ranges = _scalar_ranges(bricks, cut, num_threads)
    ends = (ranges / 2 - low / 2) / (high / 2 - low / 2)
    extremes = Extremes(offset, slope, (offset + slope * ends).max(axis=1), 0.0, mode.color_by == "depth")
    sampling = screen_sampling_at(0.0, 1.0)
    steps = np.ones(len(cut))
    return BrickBatch(cut, bricks, steps, None, sampling, volume.centre, volume.half_diagonal, extremes)


def extremes_at(batch: BrickBatch, tolerance: float, voxel_px: float) -> BrickBatch:
    """Return the same bricks for a tolerance, a share of the colour range; voxels are about `voxel_px` pixels wide."""
    assert batch.extremes is not None
    volume = batch.cut.volume
    thinnest = float((volume.spacing / volume.finest_spacing * volume.shape_xyz).min())
    return replace(
        batch,
        screen_sampling=screen_sampling_at(tolerance, voxel_px, voxel_px * thinnest),
        extremes=replace(batch.extremes, slack=0.0 if batch.extremes.by_depth else SLACK_SHARE * tolerance),
    )


def _scalar_ranges(bricks: Bricks, cut: BrickCut, num_threads: int) -> Float64:
    """Return the smallest and the largest scalar of bricks of level 0 and their halo, float64 [n, 2]."""
    ranges, raw = np.empty((len(cut), 2)), raw_voxels(bricks.volume)
    scalars, has_absent = bricks.pyramid.classifier.scalars, bricks.volume.num_absent > 0

    def work(first: int) -> None:
        bricks.volume.require_unchanged()
        part = slice(first, first + _BRICKS_PER_TASK)
        _measure_ranges(raw, scalars, cut.cells[part], has_absent, ranges[part])

    with ThreadPool(num_threads) as pool:
        pool.map(work, range(0, len(cut), _BRICKS_PER_TASK))
    bricks.volume.require_unchanged()
    return ranges


@jit
def _measure_ranges(raw: RawVoxels, scalars: Float64 | None, cells: Int32, has_absent: bool, ranges: Float64) -> None:
    """Write the ranges [n, 2] of bricks at `cells` [n, 3] (x, y, z). has_absent: whether any voxel has no data."""
    margin = 1 if has_absent else 0  # what takes the place of voxels without data may lie outside of their brick
    side = PADDED_BRICK_SIZE + 2 * margin
    field = np.empty((side, side, side))
    for i in range(len(cells)):
        fill_padded(raw, scalars, cells[i], field)
        ranges[i, 0], ranges[i, 1] = range_of(field)
