"""Automatic framing: the camera distance at which a cloud of points fills the frame over a whole path.

With (x, y, z) the coordinates of a point about the target along (right, up, direction), a perspective camera at
distance d sees the point inside half-angles whose tangents are m_x, m_y when |x| <= m_x (d - z) and |y| <= m_y (d - z).
Each of these says that d is at least a *linear* function of the point: z + x / m_x, z - x / m_x, and so on. The
smallest distance is therefore the largest value of a few linear functions over the cloud: exact, without iteration.
Orthographic, where half the frame's height shows d tan(field of view / 2), the functions only lose their z.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from renderer.camera import Float64, View
from renderer.camera_paths import camera_pose
from renderer.errors import InputError
from renderer.pyramid import Pyramid
from renderer.scene import CameraSpec, Vector
from renderer.volume import Volume

# Left free along every side, as a share of half the frame's smaller side: a footprint reaches beyond its cell's centre.
MARGIN = 0.03
# A cell narrower than this on the image is finer than the narrowest footprint that is drawn.
SMALLEST_CELL_PX = 0.5
# Products formed at once: 16 MB of float64 whatever the number of points and frames.
_MAX_PRODUCTS = 2_000_000


def fit_distance(
    camera: CameraSpec, points_world: Float64, target: Vector, size: tuple[int, int], frames: Iterable[int]
) -> float:
    """The smallest distance at which all points lie inside the frame less its margin, at every one of the frames.

    points_world: float64 [n, 3]. All points are then also at a depth of `camera.near` or more; orthographic cameras
    with wide fields of view stand further off for that than the frame alone would ask. The zoom of keyframes is left
    out: it is a magnification that was asked for. Raises InputError when there is nothing to frame.
    """
    offsets = points_world - np.asarray(target, np.float64)
    if offsets.size == 0:
        raise InputError(
            "nothing is visible, so there is nothing to frame",
            where="camera.distance",
            expected="a volume and a transfer function that show something",
            hint="raise the opacities or set camera.distance",
        )
    width, height = size
    margin_px = MARGIN * min(width, height) / 2
    tangent_per_px = math.tan(math.radians(camera.field_of_view) / 2) / (height / 2)
    limit_x, limit_y = (width / 2 - margin_px) * tangent_per_px, (height / 2 - margin_px) * tangent_per_px
    poses = [camera_pose(camera.path, frame) for frame in frames]
    right = np.array([pose.right for pose in poses]) / limit_x
    up = np.array([pose.up for pose in poses]) / limit_y
    direction = np.array([pose.direction for pose in poses])
    depth = direction if camera.projection == "perspective" else np.zeros_like(direction)
    sides = np.concatenate([depth + right, depth - right, depth + up, depth - up])
    distance = max(_largest_product(offsets, sides), _largest_product(offsets, direction) + camera.near)
    if not distance > 0.0:
        raise InputError(
            "what is visible has no extent, so there is nothing to frame",
            where="camera.distance",
            hint="set camera.distance",
        )
    return distance


def visible_centre(points_world: Float64) -> Vector:
    """The middle of the bounding box of float64 [n, 3] points, n > 0."""
    x, y, z = (points_world.min(axis=0) + points_world.max(axis=0)) / 2
    return float(x), float(y), float(z)


def _largest_product(points: Float64, normals: Float64) -> float:
    """The largest scalar product of any of [n, 3] points with any of [m, 3] normals."""
    rows = max(1, _MAX_PRODUCTS // len(points))
    return max(float((points @ normals[i : i + rows].T).max()) for i in range(0, len(normals), rows))


def visible_points(pyramid: Pyramid) -> Float64:
    """float64 [n, 3]: world positions of corners of visible cells, with the same extremes in every direction as all of
    them; the corners of the whole volume where nothing is visible.

    The cells are 1/128 of the volume or smaller, down to two voxels (`Pyramid.occupied`).
    """
    volume, level = pyramid.volume, pyramid.occupied_level
    shape = np.array(volume.shape_xyz)
    rows = pyramid.occupied.any(axis=2)
    if not rows.any():
        corners = np.stack(np.meshgrid(*([-0.5, n - 0.5] for n in shape), indexing="ij"), axis=-1).reshape(-1, 3)
        return _to_world(volume, corners)
    # Of all corners on a line along x only the first and the last can be extreme.
    z, y = np.nonzero(rows)
    first = pyramid.occupied.argmax(axis=2)[z, y]
    last = pyramid.occupied.shape[2] - pyramid.occupied[..., ::-1].argmax(axis=2)[z, y]
    corners = np.concatenate(
        [np.column_stack([x, y + dy, z + dz]) for x in (first, last) for dy in (0, 1) for dz in (0, 1)]
    )
    return _to_world(volume, np.minimum(corners.astype(np.int64) << level, shape) - 0.5)


def finest_useful_level(volume: Volume, points_world: Float64, views: Sequence[View]) -> int:
    """The finest level of which some cell is wider than SMALLEST_CELL_PX on some view; 0 if an eye may be among them.

    A bound: the longest diagonal of a voxel, at the smallest depth and the steepest angle of the points' bounding box.
    """
    low, high = points_world.min(axis=0), points_world.max(axis=0)
    box = np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), axis=-1).reshape(-1, 3)
    edges = volume.world_from_index[:3, :3]
    diagonal = max(float(np.linalg.norm(edges @ signs)) for signs in ([1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]))
    widest_px = 0.0
    for view in views:
        position = box @ view.view_from_world[:3, :3].T + view.view_from_world[:3, 3]
        if view.projection == "orthographic":
            widest_px = max(widest_px, diagonal * view.scale_px)
            continue
        depth = float(-position[:, 2].max())
        if depth <= 0:
            return 0
        steepest = math.hypot(1.0, *(np.abs(position[:, :2]).max(axis=0) / depth))
        widest_px = max(widest_px, diagonal * view.scale_px / depth * steepest)
    return max(0, math.floor(math.log2(SMALLEST_CELL_PX / widest_px)))


def _to_world(volume: Volume, index: Float64) -> Float64:
    return np.asarray(index @ volume.world_from_index[:3, :3].T + volume.world_from_index[:3, 3], np.float64)
