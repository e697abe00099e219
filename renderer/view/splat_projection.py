"""Transform a view to the coordinates of a batch of splats, and find the splats that it sees, in their order."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np

from renderer.kernels import ModelView, kernels
from renderer.pyramid import Cut
from renderer.splats import SplatBatch
from renderer.view.camera import View
from renderer.view.depth_order import box_order, order_by_depth
from renderer.view.order_blending import OrderBlending, sort_directions
from renderer.volume import Float64, UInt32

# The footprint of a splat with a larger slope x / depth is projected as at this slope, a multiple of the slope at the
# image's edge: the affine approximation of perspective (Zwicker et al. 2001, "EWA Splatting") diverges for splats
# beside the eye.
SLOPE_LIMIT = 1.3

# The near plane clips a splat whose centre is less than this beyond the plane, in standard deviations of the splat.
CLIPPED_SIGMAS = 5.0
# The near plane removes the whole of a splat whose centre is at least this far on the eye's side of the plane, in
# standard deviations of the splat.
CULLED_SIGMAS = 4.0

# Means over the footprints of all splats are estimated, within a few per cent, from a sample of about this many splats.
FOOTPRINT_SAMPLE = 4096


class Model(Protocol):
    """A coordinate system of splats or bricks: its origin in the world, float64 [3], and its unit in world units."""

    @property
    def origin(self) -> Float64: ...
    @property
    def model_unit(self) -> float: ...


def model_view(model: Model, view: View) -> ModelView:
    """Return the view in the coordinate system `model` of splats or bricks. The translation is computed in float64."""
    translation = view.view_from_world(model.origin) / model.model_unit
    perspective = view.projection == "perspective"
    scale_px = view.scale_px if perspective else view.scale_px * model.model_unit
    return ModelView(
        np.column_stack([view.axes, translation]),
        perspective,
        float(scale_px),
        view.size,
        view.center_px,
        float(view.near / model.model_unit),
        SLOPE_LIMIT * np.maximum(view.center_px, np.array(view.size) - view.center_px) / view.scale_px,
    )


class Region(NamedTuple):
    """A rectangle of pixels, which may be empty: its first column and row, and the numbers of columns and rows."""

    left: int
    top: int
    width: int
    height: int

    @property
    def num_pixels(self) -> int:
        """Return the number of pixels in the rectangle."""
        return self.width * self.height


def covered_region(batch: SplatBatch, camera: ModelView) -> Region:
    """Return a rectangle of the image that holds all footprints of a batch of splats.

    All splats have their centres in a ball with the radius `radius` about the model's origin, which is at (x0, z0) in
    view space, and at depths of `nearest` or more. `scale` is the focal length in pixels. On the image, a centre at (x,
    z) is at most `scale |x / z - x0 / z0| <= scale radius sqrt(1 + (x0 / z0)^2) / nearest` away from the model's
    origin. A footprint reaches further by its cutoff radius, as projected at the largest angle to the view that
    SLOPE_LIMIT allows.
    """
    size = np.array(camera.size)
    centers = batch.centers
    radius = math.sqrt(float(np.max(np.einsum("ij,ij->i", centers, centers), initial=0.0))) * (1 + 1e-6)
    sigma = float(np.max(longest_sigma(batch), initial=0.0))
    origin = camera.view_from_model[:, 3] * (1.0, -1.0, -1.0)
    nearest, slopes, limit = 1.0, np.zeros(2), np.zeros(2)
    if camera.perspective:
        nearest = origin[2] - radius
        if nearest - camera.near <= CLIPPED_SIGMAS * sigma:  # a splat that the near plane clips may be anywhere
            return Region(0, 0, *camera.size)
        slopes, limit = origin[:2] / origin[2], camera.slope_limit
    magnification = camera.scale_px / nearest
    center_px = camera.center_px + camera.scale_px * (slopes if camera.perspective else origin[:2])
    model_px = magnification * (radius * np.hypot(1, slopes) + batch.footprint.cutoff * sigma * np.hypot(1, limit))
    # Two pixels allow for rounding to whole pixels.
    reach_px = model_px + batch.footprint.cutoff * batch.footprint.min_sigma_px + 2
    low = np.clip(np.floor(center_px - reach_px), 0, size).astype(int)
    high = np.clip(np.ceil(center_px + reach_px), 0, size).astype(int)
    return Region(int(low[0]), int(low[1]), *(int(n) for n in high - low))


def mean_footprint_area_px(batch: SplatBatch, order: UInt32, camera: ModelView, region: Region) -> float:
    """Estimate how many pixels of a region a footprint covers, on average.

    order: the indices of the splats in the batch; at least one. region: a rectangle that is not empty. The estimate is
    made from a sample of the splats. Each splat counts as an ellipse with the two longest of its axes, as it would
    appear at the image's centre, at its own depth or at the near plane if that is farther.
    """
    vertices = batch.vertices[order[:: max(1, len(order) // FOOTPRINT_SAMPLE)]]
    axes = np.linalg.svd(batch.axes, compute_uv=False)[vertices[:, 7].astype(np.int64), :2]
    depths = -(vertices[:, :3] @ camera.view_from_model[2, :3] + camera.view_from_model[2, 3])
    radii_px = batch.footprint.cutoff * np.maximum(axes * _scale_px(camera, depths), batch.footprint.min_sigma_px)
    areas_px = math.pi * np.minimum(radii_px, region.num_pixels).prod(axis=1)
    return float(np.minimum(areas_px, region.num_pixels).mean())


def total_square_area_px(batch: SplatBatch, order: UInt32, camera: ModelView) -> float:
    """Estimate how many pixels of the image lie in the squares around footprints, in the sum over all splats.

    A rasteriser has to test these pixels. order: the indices of the splats in the batch. The estimate is made from all
    splats of the coarsest cells, which are the first of a batch, and from a sample of the splats of finer cells. A
    splat counts as a ball with its longest axis as radius.
    """
    is_coarse = order < FOOTPRINT_SAMPLE
    others = order[~is_coarse]
    stride = max(1, len(others) // FOOTPRINT_SAMPLE)
    sample = others[::stride]
    pixels = _square_areas_px(batch, np.concatenate([order[is_coarse], sample]), camera)
    num_coarse = len(order) - len(others)
    mean = float(pixels[num_coarse:].mean()) if len(sample) else 0.0
    return float(pixels[:num_coarse].sum()) + mean * len(others)


def _square_areas_px(batch: SplatBatch, splats: UInt32, camera: ModelView) -> Float64:
    """Return the number of the image's pixels in the square around each footprint, float64 [n].

    splats: the indices of the splats in the batch, [n].
    """
    vertices = batch.vertices[splats]
    in_view = vertices[:, :3] @ camera.view_from_model[:, :3].T + camera.view_from_model[:, 3]
    scale_px = _scale_px(camera, -in_view[:, 2])
    sigmas = longest_sigma(batch)[vertices[:, 7].astype(np.int64), None]
    reach_px = batch.footprint.cutoff * np.maximum(sigmas * scale_px, batch.footprint.min_sigma_px)
    center_px = camera.center_px + in_view[:, :2] * (1.0, -1.0) * scale_px
    low, high = (np.clip(center_px + sign * reach_px, 0, camera.size) for sign in (-1, 1))
    return np.asarray((high - low).prod(axis=1))


def _scale_px(camera: ModelView, depths: Float64) -> Float64 | float:
    """Return how many pixels a model unit has at each depth, or at the near plane if that is farther, float64 [n, 1].

    In orthographic projection, one number holds for all depths.
    """
    if not camera.perspective:
        return camera.scale_px
    return np.asarray(camera.scale_px / np.maximum(depths, max(camera.near, 1e-6)))[:, None]


def longest_sigma(batch: SplatBatch) -> Float64:
    """Return the largest standard deviation of each shape of a batch's splats, in model units, float64 [num_shapes]."""
    return np.asarray(np.linalg.norm(batch.axes, ord=2, axis=(1, 2)), np.float64)


def visible_order(batch: SplatBatch, view: View, *, cells: Cut | None = None, along: Float64 | None = None) -> UInt32:
    """Return the indices of the splats that can touch the image, back to front, uint32 [k].

    cells: the cells of the splats, which are then sorted as boxes; None to sort splats by depth. along: the world
        direction along which depths are measured, float64 [3]; None for the view's direction.
    """
    depths, is_visible = np.empty(len(batch), np.float32), np.empty(len(batch), np.bool_)
    kernels().cull_splats(
        vertices=batch.vertices, sigmas=longest_sigma(batch), cutoff=batch.footprint.cutoff,
        min_sigma_px=batch.footprint.min_sigma_px, clipped_sigmas=CLIPPED_SIGMAS, culled_sigmas=CULLED_SIGMAS,
        camera=model_view(batch, view), along=view.forward if along is None else along, depths=depths,
        is_visible=is_visible,
    )  # fmt: skip
    if cells is not None:
        back_to_front = box_order(cells.levels, cells.cells, cells.volume, view)
        return back_to_front[is_visible[back_to_front]]
    indices = np.flatnonzero(is_visible).astype(np.uint32)
    return indices[order_by_depth(depths[indices])]


def blended_orders(batch: SplatBatch, view: View, blending: OrderBlending) -> list[tuple[float, UInt32]]:
    """Return the draw orders that are blended for a view: the weight of each, and the indices of splats, uint32 [k]."""
    return [
        (weight, visible_order(batch, view, along=direction))
        for weight, direction in sort_directions(blending, view.forward)
    ]
