"""Bricks in a view: which are seen in which order, where on the image, and the rays that meet them.

Rays are told in index space, relative to the volume's centre, as they are in `renderer.truth.integrator`: each begins
on the plane through that centre that faces the camera, which keeps its digits in float32 however far the eye is; in
perspective at the eye itself where that is near, for rays of wide views meet the plane far away. Origins and directions
are linear in the pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.bricks import BRICK_LEVELS, BrickBatch
from renderer.jit import jit
from renderer.view.camera import View
from renderer.view.visibility import box_order
from renderer.volume import Volume

Float64 = npt.NDArray[np.float64]

# What a corner must have of depth, in model units, to be divided by it; a box with one that has not is cut.
_MIN_DEPTH = 1e-6
# Of eyes at which rays begin, in model units from the volume's centre.
_NEAR_EYE_DISTANCE = 2.0


@dataclass(frozen=True)
class RaySetup:
    """Rays by pixel: with (x, y) the place of a pixel's centre relative to the image's centre, in pixels, y downwards,

        origin = origins @ (1, x, y)        direction = directions @ (1, x, y)

    origins: float64 [3, 3], index space relative to the volume's centre. directions: float64 [3, 3], index units per
        model unit of depth in perspective, of length otherwise.
    slope_per_px: a ray has `sqrt(1 + slope_per_px^2 (x^2 + y^2))` of length for each unit of depth.
    start: where the near plane is, in model units along the direction.
    """

    origins: Float64
    directions: Float64
    slope_per_px: float
    start: float


def ray_setup(volume: Volume, length: float, view: View) -> RaySetup:
    """The rays of a view; `length` is that of a model unit."""
    centre = view.in_view(volume.centre) / length
    index_from_view = np.linalg.inv(volume.world_from_index[:3, :3] / length) @ view.axes.T
    is_near = view.projection == "perspective" and np.linalg.norm(centre) < _NEAR_EYE_DISTANCE
    depth = 0.0 if is_near else max(0.0, -float(centre[2]))
    begin = -centre - (0.0, 0.0, depth)
    if view.projection == "perspective":
        slope = 1 / view.scale_px
        across = np.array([[depth * slope, 0.0], [0.0, -depth * slope], [0.0, 0.0]])
        turn = np.array([[slope, 0.0], [0.0, -slope], [0.0, 0.0]])
    else:
        slope = 0.0
        px = 1 / (view.scale_px * length)
        across, turn = np.array([[px, 0.0], [0.0, -px], [0.0, 0.0]]), np.zeros((3, 2))
    forward = np.array([[0.0], [0.0], [-1.0]])
    return RaySetup(
        index_from_view @ np.column_stack([begin, across]),
        index_from_view @ np.hstack([forward, turn]),
        slope,
        view.near / length - depth,
    )


def visible_bricks(batch: BrickBatch, view: View) -> npt.NDArray[np.uint32]:
    """uint32 [k]: the bricks that may touch the image, front to back, exactly."""
    cut = batch.cut
    rectangles = screen_rectangles(batch, np.arange(len(cut), dtype=np.uint32), view)
    order = box_order(cut.levels + np.uint8(BRICK_LEVELS), cut.cells, cut.volume, view)[::-1]
    seen = (rectangles[:, 0] < rectangles[:, 2]) & (rectangles[:, 1] < rectangles[:, 3])
    return order[seen[order]].astype(np.uint32)


def screen_rectangles(batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> Float64:
    """float64 [n, 4]: left, top, right and bottom of rectangles of the image, in pixels, around the boxes of bricks.

    To the image belongs what the last nodes of the coarsest lattice are beyond it. Empty, with right <= left or
    bottom <= top, where a box is not in it; the whole of it where the eye plane cuts a box.
    """
    boxes, volume, length = batch.cut.visible_bounds[order], batch.cut.volume, batch.model_unit
    view_from_index = view.axes @ volume.world_from_index[:3, :3] / length
    centre = view.in_view(volume.centre) / length
    rectangles = np.empty((len(boxes), 4))
    perspective = view.projection == "perspective"
    scale_px = view.scale_px if perspective else view.scale_px * length
    width, height = view.size
    beyond = batch.screen_sampling.strides[0] - 1
    _project_bounds(
        boxes, volume.centre_index, view_from_index, centre, perspective, scale_px, width / 2, height / 2,
        float(width + beyond), float(height + beyond), view.near / length, rectangles,
    )  # fmt: skip
    return rectangles


@jit
def _project_bounds(
    boxes: Float64,
    centre_index: Float64,
    view_from_index: Float64,
    centre: Float64,
    perspective: bool,
    scale_px: float,
    center_column: float,
    center_row: float,
    width: float,
    height: float,
    near: float,
    rectangles: Float64,
) -> None:
    for i in range(len(boxes)):
        left, top, right, bottom = np.inf, np.inf, -np.inf, -np.inf
        num_behind, is_cut = 0, False
        for corner in range(8):
            x = boxes[i, corner & 1, 0] - centre_index[0]
            y = boxes[i, corner >> 1 & 1, 1] - centre_index[1]
            z = boxes[i, corner >> 2, 2] - centre_index[2]
            view_x = centre[0] + view_from_index[0, 0] * x + view_from_index[0, 1] * y + view_from_index[0, 2] * z
            view_y = centre[1] + view_from_index[1, 0] * x + view_from_index[1, 1] * y + view_from_index[1, 2] * z
            depth = -(centre[2] + view_from_index[2, 0] * x + view_from_index[2, 1] * y + view_from_index[2, 2] * z)
            if depth <= near:
                num_behind += 1
            if perspective:
                if depth <= _MIN_DEPTH:
                    is_cut = True
                    continue
                view_x, view_y = view_x / depth, view_y / depth
            column, row = center_column + scale_px * view_x, center_row - scale_px * view_y
            left, right = min(left, column), max(right, column)
            top, bottom = min(top, row), max(bottom, row)
        if num_behind == 8:
            left = right = top = bottom = 0.0
        elif is_cut:
            left, top, right, bottom = 0.0, 0.0, width, height
        rectangles[i, 0], rectangles[i, 1] = max(left, 0.0), max(top, 0.0)
        rectangles[i, 2], rectangles[i, 3] = min(right, width), min(bottom, height)
