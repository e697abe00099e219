"""Describe volumes that overlap, each on its own grid of voxels, for `mixture.cpp`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.draw.bricks.brick_cache import BrickView
from renderer.kernels import RaySetup
from renderer.view import ray_setup
from renderer.volume import Float64, Int64


class Mixture(NamedTuple):
    """The bricks of several volumes, seen by one camera and sorted by their nearest depth.

    rays: the rays of the picture in the index space of each volume.
    unit: the world length of a model unit.
    members: int64 [n, 2], the number of each brick's view, and the number of the brick in this view.
    depths: float64 [n, 3], the nearest and the farthest depth of each brick, and the depth of a step in it, in model
        units. Depths are measured from the plane where all rays begin.
    rectangles_px: float64 [n, 4], as in BrickView.
    """

    rays: Sequence[RaySetup]
    unit: float
    members: Int64
    depths: Float64
    rectangles_px: Float64


def make_mixture(brick_views: Sequence[BrickView]) -> Mixture:
    """Join the bricks of several volumes' views. The order of the views only decides the numbers in `members`."""
    volumes, view = [each.batch.cut.volume for each in brick_views], brick_views[0].view
    middle = np.mean(np.sort([volume.centre for volume in volumes], axis=0), axis=0)
    unit = max(volume.half_diagonal for volume in volumes)
    rays = [ray_setup(each.batch.cut.volume, unit, view, each.batch.bricks.clip, middle) for each in brick_views]
    depths = np.concatenate([_depths(*each, unit) for each in zip(brick_views, rays, strict=True)])
    members = [np.column_stack([np.full(len(each.order), k), np.arange(len(each.order))])
               for k, each in enumerate(brick_views)]  # fmt: skip
    rectangles = np.concatenate([each.rectangles_px for each in brick_views])
    order = np.lexsort([*rectangles.T, *depths.T[::-1]])
    return Mixture(rays, unit, np.concatenate(members)[order], depths[order], rectangles[order])


def _depths(brick_view: BrickView, rays: RaySetup, unit: float) -> Float64:
    """Return the depths of the bricks of a view, float64 [n, 3], as in `Mixture.depths`."""
    volume, view, boxes = brick_view.batch.cut.volume, brick_view.view, brick_view.boxes
    plane = view.near / unit - rays.start
    centre = -view.view_from_world(volume.centre)[2] / unit - plane
    gradient = view.forward @ volume.world_from_index[:3, :3] / unit
    low, high = boxes[:, :3], boxes[:, 3:6]
    middles, halves = centre + (low + high) / 2 @ gradient, (high - low) / 2 @ np.abs(gradient)
    cells_per_depth = np.linalg.norm(rays.directions[:, 0]) * boxes[:, 9]
    return np.column_stack([middles - halves, middles + halves, boxes[:, 10] / cells_per_depth])
