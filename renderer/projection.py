"""A view in model units, and which splats it sees in which order: what both rasterisers start from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from renderer.camera import View
from renderer.jit import jit
from renderer.octree import Cut
from renderer.splats import SplatBatch
from renderer.visibility import box_order, depth_order

Float64 = npt.NDArray[np.float64]

# Slopes x / depth are held to this multiple of those at the image's edges when a footprint is projected: the affine
# approximation of perspective (Zwicker et al. 2001, "EWA Splatting") diverges for splats beside the eye.
SLOPE_LIMIT = 1.3

# The near plane changes splats whose centre is less than so many standard deviations beyond it, and leaves nothing of
# those whose centre is so many before it; both as in shaders/project.glsl.
CUT_SIGMAS, GONE_SIGMAS = 5.0, 4.0


@dataclass(frozen=True)
class ModelView:
    """view_from_model: float64 [3, 4], rotation and translation, model units.
    scale_px: focal length in pixels (perspective), pixels per model unit (orthographic).
    near: model units.
    slope_limit: float64 [2], bound on |x| / depth and |y| / depth where footprints are linearised.
    """

    view_from_model: Float64
    perspective: bool
    scale_px: float
    size: tuple[int, int]
    near: float
    slope_limit: Float64


class Model(Protocol):
    """What has model units: its origin in the world, float64 [3], and the world length of a unit."""

    @property
    def origin(self) -> Float64: ...
    @property
    def length(self) -> float: ...


def model_view(model: Model, view: View) -> ModelView:
    """The view as model units see it; differences are taken in float64."""
    rotation = view.view_from_world[:3, :3]
    translation = rotation @ (model.origin - view.eye) / model.length
    perspective = view.projection == "perspective"
    scale_px = view.scale_px if perspective else view.scale_px * model.length
    return ModelView(
        np.column_stack([rotation, translation]),
        perspective,
        scale_px,
        view.size,
        view.near / model.length,
        SLOPE_LIMIT * np.array(view.size) / 2 / view.scale_px,
    )


def longest_sigma(batch: SplatBatch) -> Float64:
    """float64 [num_shapes]: the largest standard deviation of each shape in any direction, model units."""
    return np.asarray(np.linalg.norm(batch.axes, ord=2, axis=(1, 2)), np.float64)


def visible_order(batch: SplatBatch, cut: Cut, view: View, order: str) -> npt.NDArray[np.uint32]:
    """uint32 [k]: the splats that can touch the image, back to front."""
    camera = model_view(batch, view)
    sigmas = longest_sigma(batch)
    depths, seen = np.empty(len(batch), np.float32), np.empty(len(batch), np.bool_)
    half_width, half_height = (0.5 * n + batch.footprint.cutoff * batch.footprint.narrowest_px + 1 for n in camera.size)
    _depths_and_culling(
        batch.vertices, sigmas, batch.footprint.cutoff, camera.view_from_model, camera.perspective,
        camera.scale_px, half_width, half_height, camera.slope_limit, camera.near, depths, seen,
    )  # fmt: skip
    if order == "boxes":
        back_to_front = box_order(cut, view)
        return back_to_front[seen[back_to_front]].astype(np.uint32)
    indices = np.flatnonzero(seen).astype(np.uint32)
    return indices[depth_order(depths[indices])]


@jit
def _depths_and_culling(
    vertices: npt.NDArray[np.float32],
    sigmas: Float64,
    cutoff: float,
    view_from_model: Float64,
    perspective: bool,
    scale: float,
    half_width: float,
    half_height: float,
    slope_limit: Float64,
    near: float,
    depths: npt.NDArray[np.float32],
    seen: npt.NDArray[np.bool_],
) -> None:
    """Depth of every centre behind the model's origin, and whether its footprint can meet the image (conservative).

    A splat that the near plane cuts is drawn elsewhere than its centre would be: it counts as in the image. Depths from
    the eye would lose their order to float32 where the eye is far away.
    """
    r = view_from_model
    # Pixels times depth that a ball of radius 1 reaches, its image being linearised at no more than the slope limit.
    side, top = scale * np.sqrt(1 + slope_limit[0] ** 2), scale * np.sqrt(1 + slope_limit[1] ** 2)
    for i in range(len(vertices)):
        cx, cy, cz = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        x = abs(r[0, 0] * cx + r[0, 1] * cy + r[0, 2] * cz + r[0, 3])
        y = abs(r[1, 0] * cx + r[1, 1] * cy + r[1, 2] * cz + r[1, 3])
        behind_origin = -(r[2, 0] * cx + r[2, 1] * cy + r[2, 2] * cz)
        depth = behind_origin - r[2, 3]
        depths[i] = behind_origin
        sigma = sigmas[int(vertices[i, 7])]
        radius = cutoff * sigma
        if perspective:
            inside = (x * scale - depth * half_width <= radius * side) and (
                y * scale - depth * half_height <= radius * top
            )
        else:
            inside = (x - radius) * scale <= half_width and (y - radius) * scale <= half_height
        is_cut = depth - CUT_SIGMAS * sigma < near
        seen[i] = (inside or is_cut) and depth + GONE_SIGMAS * sigma > near
