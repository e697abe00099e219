"""Frame the visible cells: find the camera distance at which a cloud of points fills the image over a whole path.

With (x, y, z) the coordinates of a point about the target along (right, up, direction), a perspective camera at
distance d sees the point inside half-angles whose tangents are m_x, m_y when |x| <= m_x (d - z) and |y| <= m_y (d - z).
Each condition says that d is at least a *linear* function of the point: z + x / m_x, z - x / m_x, and so on. The
smallest distance is therefore the largest value of a few linear functions over the cloud: exact, without iteration. In
orthographic projection, where half the frame's height shows d tan(field of view / 2), the functions have no z.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.kernels import ClipRegion
from renderer.pyramid import Pyramid
from renderer.scene import CameraSpec, Vector
from renderer.view.clip_slabs import are_clipped_away
from renderer.view.paths import CameraPoses, camera_poses, focal_length_px, iter_camera_poses
from renderer.view.seen import seen_cells
from renderer.volume import Bools, Float64, Int64, Volume

# The margin that framing leaves free along every side of the image, as a share of half of the image's smaller side: a
# footprint reaches beyond the centre of its cell.
MARGIN = 0.03
# A cell is finer than the narrowest footprint if it is narrower than this on the image, in pixels.
SMALLEST_CELL_PX = 0.5
# The largest number of scalar products, of points with directions, that are in memory at a time: 16 MB of float64.
_MAX_PRODUCTS = 2_000_000
# The largest number of frames whose directions are taken together as similar: a third of a degree of a turntable of a
# million frames.
_MAX_RUN = 1024


class Room(NamedTuple):
    """A rectangle of a picture: its sides, as shares of the picture's width and height from the top left corner."""

    left: float = 0.0
    top: float = 0.0
    right: float = 1.0
    bottom: float = 1.0

    @property
    def shift(self) -> tuple[float, float]:
        """Return how far the rectangle's middle is to the right of the picture's middle, and above it, in shares."""
        return (self.left + self.right - 1.0) / 2, (1.0 - self.top - self.bottom) / 2

    @property
    def shares(self) -> tuple[float, float]:
        """Return the rectangle's width and height, as shares of the picture's."""
        return self.right - self.left, self.bottom - self.top


# The rectangle of the whole picture.
WHOLE_PICTURE = Room()


def fit_distance(
    camera: CameraSpec,
    points_world: Float64,
    target: Vector,
    size: tuple[int, int],
    margin: float = MARGIN,
    room: Room = WHOLE_PICTURE,
) -> float:
    """Return the smallest distance of the eye from the target at which all points are in the image, on the whole path.

    Points are inside the margin of the image. They are also at a depth of `camera.near` or more, which may keep
    orthographic cameras with wide fields of view farther away than the image needs. The zoom of keyframes is ignored,
    because it magnifies on purpose. Flights have eyes of their own; a path of flights alone fits at any distance.

    points_world: float64 [n, 3]. margin: the margin, as a share of half of the smaller side of the image, or of `room`.
    room: the part of the image in which all points must be, with the target in its middle. Raises InputError if there
    is nothing to frame.
    """
    if points_world.size == 0:
        raise InputError(
            "nothing is visible, so there is nothing to frame",
            where="camera.distance",
            expected="a volume and a transfer function that show something",
            hint="raise the opacities or set camera.distance",
        )
    distance = least_distance(camera, points_world, target, size, margin, room=room)
    if not distance > 0.0:
        what = "all visible voxels lie beyond the target, and are in frame from any distance"
        no_extent = "the visible voxels have no extent, so there is nothing to frame"
        raise InputError(
            what if (points_world != target).any() else no_extent,
            where="camera.distance",
            hint="set camera.distance",
        )
    return distance


def least_distance(
    camera: CameraSpec,
    points_world: Float64,
    target: Vector,
    size: tuple[int, int],
    margin: float = MARGIN,
    frames: Sequence[int] | None = None,
    room: Room = WHOLE_PICTURE,
) -> float:
    """Return the smallest distance at which all points are in the image, as `fit_distance` does; it may be 0 or less.

    frames: the frames of the path at which the points must be in the image, None for all frames.
    """
    offsets = points_world - np.asarray(target, np.float64)
    width, height = (share * side for share, side in zip(room.shares, size, strict=True))
    margin_px = margin * min(width, height) / 2
    tangent_per_px = math.tan(math.radians(camera.field_of_view) / 2) / (size[1] / 2)
    limit_x, limit_y = (width / 2 - margin_px) * tangent_per_px, (height / 2 - margin_px) * tangent_per_px
    distance = -math.inf
    all_poses = iter_camera_poses(camera.path) if frames is None else [camera_poses(camera.path, frames)]
    for poses in (each.rows(~each.is_free) for each in all_poses if not each.is_free.all()):
        right, up, direction = poses.right / limit_x, poses.up / limit_y, poses.direction
        depth = direction if camera.projection == "perspective" else np.zeros_like(direction)
        for normals in (depth + right, depth - right, depth + up, depth - up):
            distance = _largest_product(offsets, normals, distance)
        distance = camera.near + _largest_product(offsets, direction, distance - camera.near)
    return max(1.0, 2.0 * float(np.linalg.norm(offsets, axis=1).max())) if distance == -math.inf else distance


def corners_around(volume: Volume, points_world: Float64, reach: float) -> Float64:
    """Return the corners of boxes around points, [8 n, 3] in the world.

    points_world: the points, [n, 3]. reach: how far each box reaches from its point along each axis, in voxels.
    """
    signs = np.stack(np.meshgrid(*[(-reach, reach)] * 3), axis=-1).reshape(-1, 3)
    return np.asarray(points_world[:, None] + signs @ volume.world_from_index[:3, :3].T, np.float64).reshape(-1, 3)


def visible_centre(points_world: Float64) -> Vector:
    """Return the middle of the bounding box of points. points_world: float64 [n, 3], at least one point."""
    x, y, z = (points_world.min(axis=0) + points_world.max(axis=0)) / 2
    return float(x), float(y), float(z)


def _largest_product(points: Float64, normals: Float64, least: float) -> float:
    """Return the largest scalar product of points [n, 3] with normals [m, 3], or `least` if that is larger.

    Neighbouring normals of a path are similar, so that normals are taken in runs. With r the largest length of a point,
    and d the largest distance of a normal in a run from the run's middle normal, a point's product with any normal of
    the run differs from its product with the middle normal by at most `d r`. So only points whose product with the
    middle normal is within `2 d r` of the largest such product are multiplied with all normals of the run. Runs that
    cannot reach `least` are skipped.
    """
    radius = float(np.sqrt((points**2).sum(axis=1).max()))
    rows = min(_MAX_RUN, max(1, _MAX_PRODUCTS // len(points)))
    for first in range(0, len(normals), rows):
        run = normals[first : first + rows]
        middle = run[len(run) // 2]
        products = points @ middle
        # slack: the bound `d r`, and a little more for rounding.
        slack = 1.0001 * radius * float(np.sqrt(((run - middle) ** 2).sum(axis=1).max())) + 1e-12 * abs(least)
        best = float(products.max())
        if best + slack > least:
            candidates = points[products >= best - 2.0 * slack]
            least = max(least, float((candidates @ run.T).max()))
    return least


def visible_points(pyramid: Pyramid, clip: ClipRegion | None = None) -> Float64:
    """Return corners of visible cells that reach as far as all visible cells in every direction, float64 [n, 3].

    Corners are in the world. If nothing is visible, the corners of the whole volume are returned. The cells are 1/128
    of the volume or smaller, down to two voxels (`Pyramid.occupied`). clip: the region that clipping leaves; cells
    outside of it do not count.
    """
    return _extreme_corners(pyramid, pyramid.occupied if clip is None else _without_clipped_cells(pyramid, clip))


def framed_points(pyramid: Pyramid, clip: ClipRegion | None = None) -> tuple[Float64, float]:
    """Return corners as `visible_points` does, but without cells that add next to nothing to a picture.

    The second result is the share of a picture that the omitted cells would add; mostly 0, as no cells are omitted.
    """
    cells = pyramid.occupied if clip is None else _without_clipped_cells(pyramid, clip)
    seen = seen_cells(pyramid, cells)
    return _extreme_corners(pyramid, seen.cells), seen.left_out


def _extreme_corners(pyramid: Pyramid, occupied: Bools) -> Float64:
    """Return corners of cells, in the world, that reach as far as all of the cells in every direction, float64 [n, 3].

    occupied: which cells these are, bool [z, y, x]. Without any, the corners of the whole volume are returned.
    """
    volume, level = pyramid.volume, pyramid.occupied_level
    shape = np.array(volume.shape_xyz)
    rows = occupied.any(axis=2)
    if not rows.any():
        return volume_corners(volume)
    # On each line of corners along x, only the first and the last corner can be extreme. Up to four rows of cells share
    # such a line.
    num = occupied.shape[2]
    row_first = np.where(rows, occupied.argmax(axis=2), num)
    row_last = np.where(rows, num - occupied[..., ::-1].argmax(axis=2), 0)
    first, last = _extreme_around_corners(np.minimum, row_first, num), _extreme_around_corners(np.maximum, row_last, 0)
    z, y = np.nonzero(last)
    corners = np.concatenate([np.column_stack([x[z, y], y, z]) for x in (first, last)])
    return _to_world(volume, np.minimum(corners.astype(np.int64) << level, shape) - 0.5)


def _without_clipped_cells(pyramid: Pyramid, clip: ClipRegion) -> Bools:
    """Return which occupied cells of a pyramid clipping leaves, at least in part, bool [z, y, x]."""
    volume, left = pyramid.volume, np.zeros_like(pyramid.occupied)
    for z in range(len(left)):  # one plane of cells at a time, to bound memory
        y, x = np.nonzero(pyramid.occupied[z])
        first = np.column_stack([x, y, np.full_like(x, z)]) << pyramid.occupied_level
        last = np.minimum(first + (1 << pyramid.occupied_level), volume.shape_xyz)
        bounds = np.stack([first, last], axis=1) - 0.5 - volume.centre_index
        left[z, y, x] = ~are_clipped_away(clip, bounds)
    return left


def volume_corners(volume: Volume) -> Float64:
    """Return the world positions of the corners of the volume's box: float64 [8, 3]."""
    corners = np.stack(np.meshgrid(*([-0.5, n - 0.5] for n in volume.shape_xyz), indexing="ij"), axis=-1)
    return _to_world(volume, corners.reshape(-1, 3))


def _extreme_around_corners(extreme: np.ufunc, of_rows: Int64, outside: int) -> Int64:
    """Return the extreme value of the four rows of cells around each line of corners, [nz + 1, ny + 1].

    extreme: np.minimum or np.maximum. of_rows: a value for each row of cells along x, [nz, ny]. outside: the value of
    rows beyond the border.
    """
    padded = np.pad(of_rows, 1, constant_values=outside)
    in_y = extreme(padded[:, 1:], padded[:, :-1])
    return np.asarray(extreme(in_y[1:], in_y[:-1]), np.int64)


def finest_useful_level(
    volume: Volume, points_world: Float64, camera: CameraSpec, target: Vector, distance: float, size: tuple[int, int]
) -> int:
    """Return the coarsest pyramid level whose cells are at most SMALLEST_CELL_PX wide on all frames; 0 without one.

    Finer levels show nothing more, as no footprint is narrower. The width of a cell is bounded by the longest diagonal
    of a voxel, at the smallest depth and the steepest angle of the points' bounding box. If the eye may be inside this
    box, the level is 0.
    """
    low, high = points_world.min(axis=0), points_world.max(axis=0)
    box = np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), axis=-1).reshape(-1, 3)
    edges = volume.world_from_index[:3, :3]
    diagonal = max(float(np.linalg.norm(edges @ signs)) for signs in ([1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]))
    focal_px = focal_length_px(camera, size)
    widest_px = 0.0
    for poses in iter_camera_poses(camera.path, (target, distance)):
        if camera.projection == "orthographic":
            px_per_unit = poses.zoom * (focal_px / poses.distance)
        else:
            depth = poses.distance - _products(poses.direction, box, poses).max(axis=1)
            if depth.min() <= 0.0:
                return 0
            x, y = (np.abs(_products(side, box, poses)).max(axis=1) / depth for side in (poses.right, poses.up))
            px_per_unit = poses.zoom * focal_px / depth * np.sqrt(1.0 + x**2 + y**2)
        widest_px = max(widest_px, diagonal * float(px_per_unit.max()))
    return max(0, math.floor(math.log2(SMALLEST_CELL_PX / widest_px)))


def smallest_voxel_px(
    volume: Volume, camera: CameraSpec, target: Vector, distance: float, size: tuple[int, int]
) -> float:
    """Return the smallest width that a voxel at the volume's centre has on any frame, in pixels.

    A voxel's width is the finest spacing of the volume. An eye nearer to the centre than half of the volume's diagonal
    counts as half of the diagonal away, because most visible voxels are about as far away.
    """
    spacing, focal_px = volume.finest_spacing, focal_length_px(camera, size)
    narrowest_px = math.inf
    for poses in iter_camera_poses(camera.path, (target, distance)):
        depths = poses.distance
        if camera.projection == "perspective":
            along = _products(poses.direction, volume.centre, poses)
            depths = np.maximum(poses.distance - along, volume.half_diagonal)
        narrowest_px = min(narrowest_px, float((poses.zoom * (spacing / depths)).min()) * focal_px)
    return narrowest_px


def _products(directions: Float64, points: Float64, poses: CameraPoses) -> Float64:
    """Return the scalar products of directions with points, whose positions are relative to the camera's target.

    directions: a direction for each pose, [n, 3]. points: [m, 3] in the world, for products [n, m]; or one point [3],
    for products [n].
    """
    if not poses.is_free.any():
        return np.asarray(directions @ (points - poses.target[0]).T)
    targets = poses.target[:, None] if points.ndim == 2 else poses.target
    return np.asarray(np.einsum("ni,n...i->n...", directions, points - targets))


def _to_world(volume: Volume, index: Float64) -> Float64:
    return np.asarray(index @ volume.world_from_index[:3, :3].T + volume.world_from_index[:3, 3], np.float64)
