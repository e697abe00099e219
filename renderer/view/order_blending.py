"""Along which directions splats are sorted by depth, so that a picture that turns does not jump.

Neighbours on a lattice have the same depth where the step from one to the other is level, seen edge-on. When a camera
turns past such a view all of these pairs change their order at once, and what overlaps with another colour would pop.
Therefore the order is not that of the view alone but a mixture: each order that is met within a small turn has a share
of the picture, which grows and falls evenly while the view passes. The views around are the points of a sphere about
the viewing direction; seen along any step they are spread evenly (Archimedes), so that shares are linear in the turn.

Only the steps count that do become level on the way of a film. Others that are nearly level, such as the axis of a
turntable at elevation 0, keep one order by a slope too small to see.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]

# Half of the turn in which one order gives way to another. A pop of opaque noise is 0.4: over 2.2 degrees it makes
# 0.002 for 0.01 degrees, about as much as such a picture changes anyhow.
FADE_ANGLE = math.radians(1.1)

# What a depth must differ by, of a step's length, to be told apart in float32 between voxels of a volume of 2048^3.
# Steps that are never steeper are level.
MIN_SLOPE = 2e-4

# Slopes that are 0 but for rounding.
ROUNDING = 1e-9

# Smaller shares of a picture are left out: a jump of this share of a pop is not seen.
MIN_WEIGHT = 2.0**-9

# Steps to the next cell and to the next but diagonally in a plane: what is farther hardly overlaps. x, y, z.
NEIGHBOURS = np.array(
    [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1)]
)

# Points in an octant of the sphere.
_POINTS_PER_OCTANT = 2048


@dataclass(frozen=True)
class OrderBlending:
    """How the camera of a film turns against the lattice of its volume.

    crossing: float64 [k, 3], unit vectors in the world: steps of which neighbours change their order on the way.
    around: float64 [3, 3], takes the points of the unit sphere to the views around one: as far as FADE_ANGLE in the
        directions in which the film moves, less in those in which it moves less.
    flat: float64 [3, 3], takes from a direction its parts along steps that are level all the way.
    tie_breaker: float64 [3], is added: gives steps that are nearly level, and keep their order, a slope.
    """

    crossing: Float64
    around: Float64
    flat: Float64
    tie_breaker: Float64


@dataclass(frozen=True)
class SortDirection:
    """A direction, float64 [3] in the world, along which to sort; `share` of the picture that has this order."""

    share: float
    direction: Float64


def make_order_blending(world_from_index: Float64, runs: Iterable[Float64]) -> OrderBlending:
    """How a camera turns whose frames have these axes.

    runs: [n, 3, 3] (rows: right, up, back), each beginning with the frame at which the one before ended.
    """
    steps = NEIGHBOURS @ world_from_index[:3, :3].T
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    low, high = np.full(len(steps), np.inf), np.full(len(steps), -np.inf)
    moved, turned = np.zeros((3, 3)), 0.0  # squares of the ways of the viewing direction, and of all axes
    for axes in runs:
        slopes = -axes[:, 2] @ steps.T
        low, high = np.minimum(low, slopes.min(axis=0)), np.maximum(high, slopes.max(axis=0))
        ways = np.diff(axes, axis=0)
        moved += ways[:, 2].T @ ways[:, 2]
        turned += float(np.sum(ways * ways)) / 2
    is_level = np.maximum(np.abs(low), np.abs(high)) < MIN_SLOPE
    crosses = ~is_level & (low < -ROUNDING) & (high > ROUNDING)
    keeps_order = ~crosses & (np.minimum(np.abs(low), np.abs(high)) < MIN_SLOPE)
    flat = np.eye(3) - _projection_onto(steps[is_level])
    # Twice the mean square of a way on a circle is its largest square.
    around = math.sin(FADE_ANGLE) * _matrix_sqrt(2 * moved / turned if turned > 0 else moved) + 2 * MIN_SLOPE * np.eye(
        3
    )
    upward = -1.0 * (NEIGHBOURS >= 0).all(axis=1)  # as cells of equal depth are drawn, in the order of their numbers
    sides = np.where(is_level, upward, low + high)[keeps_order]
    return OrderBlending(steps[crosses], around @ flat, flat, _tie_breaker(steps[keeps_order], sides))


def _projection_onto(vectors: Float64) -> Float64:
    """float64 [3, 3]: onto the span of [n, 3] vectors."""
    return np.asarray(np.linalg.pinv(vectors) @ vectors if len(vectors) else np.zeros((3, 3)))


def _matrix_sqrt(squares: Float64) -> Float64:
    """The symmetric root of a symmetric matrix [3, 3], its values held to [0, 1]."""
    values, vectors = np.linalg.eigh(squares)
    return np.asarray(vectors * np.sqrt(np.clip(values, 0.0, 1.0)) @ vectors.T)


def _tie_breaker(steps: Float64, sides: Float64) -> Float64:
    """A vector along which these steps [n, 3] are at least as steep as MIN_SLOPE, if that can be.

    sides: a number for each, whose sign theirs must have; 0 for either.
    """
    if not len(steps):
        return np.zeros(3)
    along = _sphere_points() @ steps.T
    along = np.where(sides != 0, along * np.sign(sides), np.abs(along))
    best = int(np.argmax(along.min(axis=1)))
    return np.asarray(MIN_SLOPE / max(float(along[best].min()), 0.1) * _sphere_points()[best])


def sort_directions(turning: OrderBlending, forward: Float64) -> list[SortDirection]:
    """The directions to sort along for a view: nearly always one.

    Their shares add up to 1, and are continuous in the view.
    """
    direction = turning.flat @ forward
    slopes = turning.crossing @ direction
    is_open = np.abs(slopes) < np.linalg.norm(turning.crossing @ turning.around.T, axis=1)
    if not is_open.any():
        return [SortDirection(1.0, direction + turning.tie_breaker)]
    views = _sphere_points() @ turning.around
    ascends = slopes[is_open] + views @ turning.crossing[is_open].T > 0
    order = ascends @ (1 << np.arange(ascends.shape[1]))
    counts = np.bincount(order)
    kept = np.flatnonzero(counts >= MIN_WEIGHT * len(views))
    total = counts[kept].sum()
    directions = [direction + views[order == k].mean(axis=0) + turning.tie_breaker for k in kept]
    return [SortDirection(float(counts[k] / total), each) for k, each in zip(kept, directions, strict=True)]


@cache
def _sphere_points() -> Float64:
    """float64 [n, 3]: points spread evenly over the unit sphere, the same in each of its octants."""
    z = (np.arange(_POINTS_PER_OCTANT) + 0.5) / _POINTS_PER_OCTANT
    turns = np.arange(_POINTS_PER_OCTANT) * (math.sqrt(5) - 1) / 2 % 1  # the golden section: evenly in every part of z
    angle, radius = math.pi / 2 * turns, np.sqrt(1 - z * z)
    octant = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    signs = 1 - 2 * (np.arange(8)[:, None] >> np.arange(3) & 1)
    points = np.asarray((octant * signs[:, None]).reshape(-1, 3))
    points.flags.writeable = False
    return points
