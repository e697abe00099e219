"""In which order splats are composited: back to front, ties by the cell's place in the cut.

Two orders. `depth` sorts the cells' centres by view depth, which is what splats that overlap need. `boxes` is the exact
visibility order of the octree's cells taken as boxes (the paper's traversal): right for footprints that stay inside
their cells, but overlapping ones show seams along the planes between large cells seen edge-on.

Where a view turns past a direction in which neighbours on the lattice have the same depth (0, 45, 90 degrees ...), all
such pairs change their order at once, and what overlaps with another colour would pop. Within FADE_ANGLE beyond such a
direction the picture is therefore a mixture of both orders, `depth_directions`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.camera import View
from renderer.jit import jit
from renderer.octree import Cut

Float64 = npt.NDArray[np.float64]

# Three passes over a 32-bit key, with counters that stay in the first-level cache.
RADIX_BITS = 11
NUM_PASSES = 3
NUM_DIGITS = 1 << RADIX_BITS

# Wide enough that a mixture changes no faster than a turning picture does anyhow: in opaque noise a pop is 0.4, of
# which it makes 0.003 for 0.01 degrees. Narrow enough that 4 to 9 % of a turntable's frames need two orders.
FADE_ANGLE = math.radians(1.5)

# The slope at which a lattice's planes are sorted while they are (almost) seen face-on: between voxels of a volume of
# 2048^3 it is still a difference in float32.
LEAST_SLOPE = 2e-4

# A slope that is 0 but for rounding.
LEVEL = 1e-12

# Steps to the next cell and to the next but diagonally in a plane: what is farther hardly overlaps. x, y, z.
NEIGHBOURS = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1))


@dataclass(frozen=True)
class DepthDirection:
    """A direction, float64 [3] in the world, along which to sort; `share` of the picture that has this order."""

    share: float
    direction: Float64


def depth_directions(cut: Cut, view: View) -> list[DepthDirection]:
    """The directions to sort along in place of the view's: none for nearly all views, else 1, 2 or, seldom, 4.

    Their shares add up to 1. Shares and orders are continuous in the view: past the direction in which a step on the
    lattice is level the old order fades out and the new one in. Up to there, and where a step stays level, as one along
    the axis of a turntable at elevation 0, there is one order, that of the cells' numbers.
    """
    steps = np.array(NEIGHBOURS) @ cut.volume.world_from_index[:3, :3].T
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    forward = view.forward
    slopes = steps @ forward
    level_axes = np.flatnonzero(np.abs(slopes[:3]) < LEVEL)
    uprightness = np.abs(steps @ view.view_from_world[1, :3])
    left_level = max(level_axes, key=lambda axis: float(uprightness[axis]), default=None)
    directions = [DepthDirection(1.0, forward)]
    crossed: set[int] = set()
    for number, (step, slope) in enumerate(zip(steps, slopes, strict=True)):
        axes = set(np.flatnonzero(NEIGHBOURS[number]).tolist())
        if not -LEAST_SLOPE < slope < math.sin(FADE_ANGLE) or (number >= 3 and axes & crossed):
            continue  # a diagonal goes with its axes
        crossed |= axes
        if number != left_level:
            directions = [turned for each in directions for turned in _turned(each, step, float(slope))]
    return directions if directions[0].direction is not forward else []


def _turned(old: DepthDirection, step: Float64, slope: float) -> list[DepthDirection]:
    """`old` with the step descending, with it ascending, or both, as its slope in the view wants."""
    ascending = min(max(slope / math.sin(FADE_ANGLE), 0.0), 1.0)
    made = []
    for share, wanted in ((1 - ascending, -LEAST_SLOPE), (ascending, max(slope, LEAST_SLOPE))):
        if share > 0:
            direction = old.direction + step * (wanted - old.direction @ step)
            made.append(DepthDirection(old.share * share, direction))
    return made


def depth_order(depths: npt.NDArray[np.float32]) -> npt.NDArray[np.uint32]:
    """uint32 [n]: indices by descending depth (float32 [n], any sign, no NaN), equal depths in ascending index."""
    order = np.empty(len(depths), np.uint32)
    _radix_sort(depths.view(np.uint32), order)
    return order


@jit
def _radix_sort(bits: npt.NDArray[np.uint32], order: npt.NDArray[np.uint32]) -> None:
    """Stable order of float32 given by their bits, descending; least significant digit first, keys with indices."""
    num = len(bits)
    pairs, other = np.empty(num, np.uint64), np.empty(num, np.uint64)
    starts = np.zeros((NUM_PASSES, NUM_DIGITS), np.uint32)
    sign, last = np.uint32(1 << 31), np.uint32(NUM_DIGITS - 1)
    for i in range(num):
        # Bits of positive numbers ascend with the number, of negative ones descend, and the two zeros are equal.
        key = bits[i] if bits[i] > sign else np.uint32(sign - np.uint32(1)) - (bits[i] & ~sign)
        pairs[i] = np.uint64(key) << np.uint64(32) | np.uint64(i)
        for k in range(NUM_PASSES):
            starts[k, key >> np.uint32(RADIX_BITS * k) & last] += np.uint32(1)
    for k in range(NUM_PASSES):
        before = np.uint32(0)
        for digit in range(NUM_DIGITS):
            here = starts[k, digit]
            starts[k, digit] = before
            before += here
    for k in range(NUM_PASSES):
        for i in range(num):
            digit = pairs[i] >> np.uint64(32 + RADIX_BITS * k) & np.uint64(last)
            other[starts[k, digit]] = pairs[i]
            starts[k, digit] += np.uint32(1)
        pairs, other = other, pairs
    for i in range(num):
        order[i] = np.uint32(pairs[i] & np.uint64(0xFFFFFFFF))


def box_order(cut: Cut, view: View) -> npt.NDArray[np.int64]:
    """int64 [n]: the cells back to front as boxes, exact for any eye in perspective, and in parallel projection.

    At a node of the octree, a child may hide another only if fewer of the node's three splitting planes lie between
    it and the eye. That number, 0 to 3, is one base-4 digit of the cell's key, the root's split first; it is a sum over
    the axes, so that three tables by coordinate give every key. Digits of splits inside the cell are cleared.
    """
    volume = cut.volume
    index_from_world = np.linalg.inv(volume.world_from_index[:3, :3])
    if view.projection == "perspective":
        from_centre = (view.target - volume.centre) + view.distance * view.axes[2]
        eye = volume.centre_index + index_from_world @ from_centre
    else:  # the eye at infinity; a splitting plane seen edge-on hides nothing
        direction = index_from_world @ view.forward
        eye = np.where(direction == 0, np.nan, np.copysign(np.inf, -direction))
    num_levels = max(1, (max(volume.shape_xyz) - 1).bit_length())
    keys = np.zeros(len(cut), np.uint64)
    first = cut.cells.astype(np.int64) << cut.levels[:, None].astype(np.int64)
    for axis in range(3):
        keys += _separation_digits(float(eye[axis]), volume.shape_xyz[axis], num_levels)[first[:, axis]]
    cleared = 2 * cut.levels.astype(np.uint64)
    keys = keys >> cleared << cleared
    return np.argsort(~keys, kind="stable")


def _separation_digits(eye: float, num: int, num_levels: int) -> npt.NDArray[np.uint64]:
    """uint64 [num]: by index along an axis, two bits a level, 1 where its split lies between it and the eye."""
    index = np.arange(num)
    digits = np.zeros(num, np.uint64)
    for level in range(num_levels):
        plane = (index >> (level + 1) << (level + 1)) + (1 << level) - 0.5
        upper = (index >> level & 1) == 1
        separated = np.where(upper, eye < plane, eye > plane)
        digits |= separated.astype(np.uint64) << np.uint64(2 * level)
    return digits
