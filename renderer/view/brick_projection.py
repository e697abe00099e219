"""Project bricks into a view: their visibility order, their rectangles on the image, and the rays through them.

Rays are in index space, relative to the volume's centre. Each ray begins on the plane through the centre that faces the
camera, where its origin keeps its digits in float32, however far away the eye is. In perspective, rays begin at the eye
if that is near, because rays of wide views meet the plane far away. Origins and directions are linear in the pixel's
position.
"""

from __future__ import annotations

import numpy as np

from renderer.bricks import BRICK_LEVELS, BrickBatch
from renderer.kernels import RaySetup, kernels
from renderer.scene import ClipSpec
from renderer.view.camera import View
from renderer.view.clip_slabs import are_clipped_away, place_clips
from renderer.view.depth_order import box_order
from renderer.view.splat_projection import model_view
from renderer.volume import Float64, UInt32, Volume

# If the eye is nearer to the volume's centre (or to the point `middle` of `ray_setup`) than this, rays begin at the
# eye, and not on the plane through the centre. In model units, which are half the volume's diagonal.
_NEAR_EYE_DISTANCE = 2.0


def ray_setup(
    volume: Volume, length: float, view: View, clip: tuple[ClipSpec, ...] = (), middle: Float64 | None = None
) -> RaySetup:
    """Return the set-up of a view's rays in the index space of a volume: where they begin, and their directions.

    length: the world length of a model unit. clip: clip planes and boxes in addition to those of the view. middle: a
        world position on the plane on which rays begin and depths are 0; the same position for several volumes makes
        their depths agree. By default, it is the volume's centre.
    """
    centre = view.view_from_world(volume.centre) / length
    begins = centre if middle is None else view.view_from_world(middle) / length
    index_from_view = np.linalg.inv(volume.world_from_index[:3, :3] / length) @ view.axes.T
    is_perspective = view.projection == "perspective"
    is_near = is_perspective and np.linalg.norm(begins) < _NEAR_EYE_DISTANCE
    depth = 0.0 if is_near else max(0.0, -float(begins[2]))
    begin = -centre - (0.0, 0.0, depth)
    slope = 1 / view.scale_px if is_perspective else 0.0
    px = depth * slope if is_perspective else 1 / (view.scale_px * length)
    columns_and_rows, forward = np.array([[1.0, 0.0], [0.0, -1.0], [0.0, 0.0]]), np.array([[0.0], [0.0], [-1.0]])
    return RaySetup(
        index_from_view @ np.column_stack([begin, px * columns_and_rows]),
        index_from_view @ np.hstack([forward, slope * columns_and_rows]),
        float(slope),
        float(view.near / length - depth),
        view.center_px,
        place_clips(volume, view.clip + clip, view),
    )


def visible_bricks(batch: BrickBatch, view: View) -> UInt32:
    """Return the bricks that may touch the image, in their exact order front to back, uint32 [k].

    Returns indices into the batch. Bricks that are clipped away as a whole are left out.
    """
    cut = batch.cut
    rectangles = screen_rectangles(batch, np.arange(len(cut), dtype=np.uint32), view)
    order = box_order(cut.levels + np.uint8(BRICK_LEVELS), cut.cells, cut.volume, view)[::-1]
    is_visible = (rectangles[:, 0] < rectangles[:, 2]) & (rectangles[:, 1] < rectangles[:, 3])
    if (clip := place_clips(cut.volume, view.clip + batch.bricks.clip, view)) is not None:
        is_visible &= ~are_clipped_away(clip, cut.visible_bounds - cut.volume.centre_index)
    return order[is_visible[order]]


def screen_rectangles(batch: BrickBatch, order: UInt32, view: View) -> Float64:
    """Return the rectangles around the visible bounds of bricks on the image.

    order: the indices of the bricks, [n]. Returns float64 [n, 4]: left, top, right and bottom, in pixels. Rectangles
    are clipped to the image, enlarged by the pixels that the coarsest pixel grid has beyond the image's edges. A
    rectangle is empty (right <= left or bottom <= top) if the bounds are outside of the image, and it is the whole
    image if the eye plane cuts the bounds.
    """
    volume, camera = batch.cut.volume, model_view(batch, view)
    view_from_index = view.axes @ volume.world_from_index[:3, :3] / batch.model_unit
    camera = camera._replace(view_from_model=np.column_stack([view_from_index, camera.view_from_model[:, 3]]))
    beyond = batch.screen_sampling.strides[0] - 1
    rectangles = np.empty((len(order), 4))
    bounds = batch.cut.visible_bounds[order] - volume.centre_index
    kernels().project_bounds(bounds=bounds, camera=camera, beyond=beyond, rectangles=rectangles)
    return rectangles
