"""Choose the directions along which splats are sorted by depth, so that a turning picture does not jump.

A step is the vector from a voxel to a neighbour. It is level in a view in which both have the same depth. When a camera
turns past such a view, all pairs of neighbours along this step change their order at once, and colours would pop.
Therefore the image blends several orders. Each order that occurs within a small turn has a weight, which rises and
falls evenly while the view passes. The nearby views are points of a sphere around the viewing direction. Along any step
these points are spread evenly (Archimedes), so that weights are linear in the turn.

Only steps that become level on the path of a film are blended. Other steps that are nearly level, such as the axis of a
turntable at elevation 0, keep one order: they get a slope too small to see.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from renderer.scene import CameraPath
from renderer.view.paths import ANYWHERE, About, iter_camera_poses
from renderer.volume import Float64

# Half of the turn over which one draw order fades into another, in radians. In opaque noise, a sudden change of the
# order changes colours, from 0 to 1, by 0.4. Spread over a turn of 2.2 degrees, the change is 0.002 for every 0.01
# degrees, about as much as such an image changes anyway.
FADE_ANGLE = math.radians(1.1)

# A step from a cell to a neighbour is level if its slope, the difference of depths divided by the step's length, is
# less than this: the smallest difference that float32 resolves in a volume of 2048^3 voxels.
MIN_SLOPE = 2e-4

# A step from a cell to a neighbour is exactly level if its slope is at most this, which is rounding error.
ZERO_SLOPE = 1e-9

# A draw order whose weight is less than this is left out: colours then jump by this share of the difference between two
# orders, which is invisible.
MIN_WEIGHT = 2.0**-9

# The steps (x, y, z) from a cell to its neighbours along the axes and the diagonals of the planes of two axes. Cells
# farther apart hardly overlap.
NEIGHBOURS = np.array(
    [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1)]
)

# The number of points in each octant of a sphere by which the views near a view are sampled.
_POINTS_PER_OCTANT = 2048


@dataclass(frozen=True)
class OrderBlending:
    """The data by which draw orders of splats are blended while the camera of a film turns around a volume.

    crossing_steps: float64 [k, 3], unit vectors in the world: steps along which neighbours change their order on the
        path.
    nearby_from_sphere: float64 [3, 3], a matrix that takes points of the unit sphere to nearby views: as far as
        FADE_ANGLE in the directions in which the view moves most, and less far in other directions.
    level_rejection: float64 [3, 3], a matrix that removes from a direction its parts along steps that stay level.
    tie_breaker: float64 [3], a vector that is added to a direction. It gives a slope to steps that are nearly level and
        keep their order.
    """

    crossing_steps: Float64
    nearby_from_sphere: Float64
    level_rejection: Float64
    tie_breaker: Float64


def make_order_blending(world_from_index: Float64, path: CameraPath, about: About = ANYWHERE) -> OrderBlending:
    """Return the order blending for a camera on a path and the grid of a volume.

    about: the target of the film, and the distance of the eye from it.
    """
    steps = NEIGHBOURS @ world_from_index[:3, :3].T
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    low, high = np.full(len(steps), np.inf), np.full(len(steps), -np.inf)
    moved, turned = np.zeros((3, 3)), 0.0  # sums of squared movements: of the viewing direction; of all axes
    for poses in iter_camera_poses(path, about):
        axes = poses.axes
        slopes = -axes[:, 2] @ steps.T
        low, high = np.minimum(low, slopes.min(axis=0)), np.maximum(high, slopes.max(axis=0))
        movements = np.diff(axes, axis=0)
        moved += movements[:, 2].T @ movements[:, 2]
        turned += float(np.sum(movements * movements)) / 2
    is_level = np.maximum(np.abs(low), np.abs(high)) < MIN_SLOPE
    crosses = ~is_level & (low < -ZERO_SLOPE) & (high > ZERO_SLOPE)
    keeps_order = ~crosses & (np.minimum(np.abs(low), np.abs(high)) < MIN_SLOPE)
    level_steps = steps[is_level]
    level_rejection = np.eye(3) - (np.linalg.pinv(level_steps) @ level_steps if len(level_steps) else 0.0)
    # While an axis moves along a circle, the largest square of its movement in one direction is twice the mean square.
    spread = _matrix_sqrt(2 * moved / turned if turned > 0 else moved)
    nearby_from_sphere = math.sin(FADE_ANGLE) * spread + 2 * MIN_SLOPE * np.eye(3)
    upward = -1.0 * (NEIGHBOURS >= 0).all(axis=1)  # cells of equal depth are drawn in the order of their numbers
    sides = np.where(is_level, upward, low + high)[keeps_order]
    tie_breaker = _tie_breaker(steps[keeps_order], sides)
    return OrderBlending(steps[crosses], nearby_from_sphere @ level_rejection, level_rejection, tie_breaker)


def _matrix_sqrt(squares: Float64) -> Float64:
    """Return the symmetric root of a symmetric matrix [3, 3], with its eigenvalues clamped to [0, 1]."""
    values, vectors = np.linalg.eigh(squares)
    return np.asarray(vectors * np.sqrt(np.clip(values, 0.0, 1.0)) @ vectors.T)


def _tie_breaker(steps: Float64, sides: Float64) -> Float64:
    """Return a vector along which the slopes of all steps are at least MIN_SLOPE, if there is such a vector.

    steps: unit vectors from a cell to its neighbours, [n, 3]. sides: for each step, a number with the sign that its
    slope must have, [n]; 0 for either sign.
    """
    if not len(steps):
        return np.zeros(3)
    along = _sphere_points() @ steps.T
    along = np.where(sides != 0, along * np.sign(sides), np.abs(along))
    best = int(np.argmax(along.min(axis=1)))
    return np.asarray(MIN_SLOPE / max(float(along[best].min()), 0.1) * _sphere_points()[best])


def sort_directions(blending: OrderBlending, forward: Float64) -> list[tuple[float, Float64]]:
    """Return the world directions along which splats are sorted for a view, each with the weight of its draw order.

    There is nearly always one direction. The weights add up to 1, and change without jumps as the view turns.
    """
    direction = blending.level_rejection @ forward
    steps = blending.crossing_steps
    slopes = steps @ direction
    is_open = np.abs(slopes) < np.linalg.norm(steps @ blending.nearby_from_sphere.T, axis=1)
    if not is_open.any():
        return [(1.0, direction + blending.tie_breaker)]
    views = _sphere_points() @ blending.nearby_from_sphere
    ascends = slopes[is_open] + views @ steps[is_open].T > 0
    order = ascends @ (1 << np.arange(ascends.shape[1]))
    counts = np.bincount(order)
    significant = np.flatnonzero(counts >= MIN_WEIGHT * len(views))
    total = counts[significant].sum()
    return [
        (float(counts[k] / total), direction + views[order == k].mean(axis=0) + blending.tie_breaker)
        for k in significant
    ]


@cache
def _sphere_points() -> Float64:
    """Return points that are spread evenly over the unit sphere, float64 [n, 3]. All octants have mirrored points."""
    z = (np.arange(_POINTS_PER_OCTANT) + 0.5) / _POINTS_PER_OCTANT
    # Turns by the golden section spread the angles of points evenly in every range of z.
    turns = np.arange(_POINTS_PER_OCTANT) * (math.sqrt(5) - 1) / 2 % 1
    angle, radius = math.pi / 2 * turns, np.sqrt(1 - z * z)
    octant = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    signs = 1 - 2 * (np.arange(8)[:, None] >> np.arange(3) & 1)
    points = np.asarray((octant * signs[:, None]).reshape(-1, 3))
    points.flags.writeable = False
    return points
