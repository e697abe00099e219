"""Views, splats that are placed by hand, and splats of small volumes, for tests of splats."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.pyramid import Cut, build_pyramid, cut_pyramid
from renderer.scene import (
    CameraPath,
    CameraSpec,
    ControlPoint,
    ErrorSpec,
    PyramidSpec,
    SplatSpec,
    TransferSpec,
    TurntablePath,
)
from renderer.splats import SplatBatch, make_footprint, make_splats
from renderer.transfer import make_transfer_function
from renderer.view import View, camera_poses, make_view
from renderer.volume import Float32, Float64, UInt8, UInt32, Volume, make_volume


def look(
    projection: str = "perspective",
    *,
    size: tuple[int, int] = (64, 48),
    target: Sequence[float] = (0.0, 0.0, 0.0),
    distance: float = 4.0,
    azimuth: float = 25.0,
    elevation: float = 15.0,
    field_of_view: float = 30.0,
    near: float = 0.0,
) -> View:
    """Return the view of a camera at a distance from its target."""
    camera = CameraSpec(TurntablePath(1, azimuth, elevation), projection, field_of_view, near=near)  # type: ignore[arg-type]
    return make_view(camera, 0, tuple(target), distance, size)  # type: ignore[arg-type]


def camera_pose(path: CameraPath, frame: int) -> Any:
    """Return the pose of a camera at one frame: direction, right and up, [3] each, and zoom."""
    poses = camera_poses(path, [frame])
    return poses.rows(0)


def point_at(view: View, column: float, row: float, depth: float) -> Float64:
    """Return the point in the world, float64 [3], at a depth, that a view shows at (column, row) in pixels."""
    per_px = (depth if view.projection == "perspective" else 1.0) / view.scale_px
    in_view = [(column - view.size[0] / 2) * per_px, (view.size[1] / 2 - row) * per_px, -depth]
    return view.target + (in_view + np.array([0.0, 0.0, view.distance])) @ view.axes


def place_splats(
    centers: npt.ArrayLike,
    axes: npt.ArrayLike,
    depths: npt.ArrayLike = 1.0,
    colors: npt.ArrayLike = (0.9, 0.5, 0.2),
    spec: SplatSpec | None = None,
) -> SplatBatch:
    """Return splats that are placed by hand.

    centers: points in the world, [n, 3]. axes: their axes as columns, in standard deviations, [n, 3, 3] or [3, 3]; a
    number for spheres. depths: the optical depths [n] along their central rays, of spheres of the same volume.
    """
    points = np.atleast_2d(np.asarray(centers, np.float64))
    axes = np.asarray(axes, np.float64)
    axes = axes * np.eye(3) if axes.ndim == 0 else axes
    each = np.broadcast_to(axes, (len(points), 3, 3))
    origin = points.mean(axis=0) if len(points) else np.zeros(3)
    vertices = np.empty((len(points), 8), np.float32)
    vertices[:, :3] = points - origin
    vertices[:, 6] = np.asarray(depths) * 2 * math.pi * np.cbrt(np.abs(np.linalg.det(each))) ** 2
    vertices[:, 3:6] = np.asarray(colors) * vertices[:, 6:7]
    vertices[:, 7] = np.arange(len(points)) if axes.ndim == 3 else 0
    return SplatBatch(
        vertices, each if axes.ndim == 3 else axes[None], origin, 1.0, make_footprint(spec or SplatSpec())
    )


def in_order(batch: SplatBatch) -> UInt32:
    """Return the numbers of all splats of a batch, in its own order."""
    return np.arange(len(batch), dtype=np.uint32)


def volume_of(values: UInt8, world_from_index: Float64 | None = None) -> Volume:
    """Return a volume of voxels [z, y, x]. Without an affine, it has spacing 1 and its centre is the world's origin."""
    if world_from_index is None:
        world_from_index = np.eye(4)
        world_from_index[:3, 3] = -(np.array(values.shape[::-1]) - 1) / 2
    return make_volume(np.ascontiguousarray(values), world_from_index, "test")


def cut_of(volume: Volume, opacity: float, *, level: int = 0, tolerance: float = 0.0, unit: float | None = None) -> Cut:
    """Return the cut of a volume in cells no finer than `level`.

    Colours go from blue at 0 to red at 255, and opacities from 0 to `opacity`. unit: the length of these opacities.
    """
    points = (
        ControlPoint(0.0, (0.1, 0.2, 0.9), 0.0),
        ControlPoint(128.0, (0.4, 0.9, 0.3), opacity / 3),
        ControlPoint(255.0, (1.0, 0.3, 0.1), opacity),
    )
    transfer = make_transfer_function(TransferSpec(points, unit), volume.finest_spacing)
    pyramid = build_pyramid(volume, transfer, spec=PyramidSpec(precision="single"), error=ErrorSpec(), num_threads=1)
    return cut_pyramid(pyramid, tolerance, finest_level=level)


def splats_of(volume: Volume, opacity: float, spec: SplatSpec | None = None, **cut: float) -> SplatBatch:
    """Return the splats of all cells of `cut_of`. cut: options of `cut_of`."""
    return make_splats(cut_of(volume, opacity, **cut), spec or SplatSpec())  # type: ignore[arg-type]


def optical_depth(image: Float32) -> Float64:
    """Return the optical depth of each pixel, `-log(1 - alpha)`, float64 [h, w]."""
    return -np.log1p(-image[..., 3].astype(np.float64))
