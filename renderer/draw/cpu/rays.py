"""Set up the rays of a tile of pixels, compiled, and where they are not cut away."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from renderer.bricks import DITHER, JITTER_PER_PX
from renderer.compiled import inline, jit, lane_numbers, load, store, to_float64, where
from renderer.view import Cuts, RaySetup
from renderer.volume import Bools, Float32, Float64, Int64

Window = tuple[int, int, int, int]  # left, top, right and bottom, half-open

# The lanes of float64 in which rays are clipped.
CLIPPED = 8
# A ray as `set_up_rays` writes it: origin [3]; direction [3]; its inverse [3], 0 where the direction is 0; the length
# of the direction, dithered; 1/2 plus the jitter; length per depth, in model units.
ORIGIN, DIRECTION, INVERSE, LENGTH, ROUNDING_OFFSET, LENGTH_PER_DEPTH, RAY_FLOATS = 0, 3, 6, 9, 10, 11, 12
_NOT_DRAWN = np.float32(2.0)  # an alpha at which every ray has ended


class Tile(NamedTuple):
    """A tile: the rays of its pixels, row by row; rows are `side` pixels apart.

    room: pixels of a tile, and those that are loaded behind the last one.
    rays: float64 [RAY_FLOATS * room], one number of all rays after the other. alphas: float32 [room], what is before
    the next brick; _NOT_DRAWN where no ray is. places: int64 [room], of pixels in the image.
    """

    side: int
    room: int
    rays: Float64
    alphas: Float32
    places: Int64


class Kept(NamedTuple):
    """A list of what cuts leave of the rays of a tile: from a start to an end, less a range for each removed box.

    bounds: float64 [2 * room], all starts, then all ends; a start moves on as what is behind it is drawn.
    removed: float64 [2 * boxes * room], for each box where all rays enter and leave it; infinity and -infinity where
    they do not.
    """

    num_boxes: int
    bounds: Float64
    removed: Float64


@jit
def set_up_rays(rays: RaySetup, stride: int, window: Window, is_drawn: Bools, image: Float32, tile: Tile) -> None:
    """Set up the rays of the pixels in a window, and what is in the image there."""
    left, top, right, bottom = window
    origins, directions = rays.origins, rays.directions
    for row in range(top, bottom):
        y = row * stride + 0.5 - rays.center_px[1]
        for first in range(left, right, CLIPPED):
            begin = (row - top) * tile.side + first - left
            column = lane_numbers(CLIPPED) + np.int32(first)
            x = to_float64(column * np.int32(stride)) + 0.5 - rays.center_px[0]
            square = 0.0
            for axis in range(3):
                speed = directions[axis, 0] + directions[axis, 1] * x + directions[axis, 2] * y
                store(
                    tile.rays,
                    begin + (ORIGIN + axis) * tile.room,
                    origins[axis, 0] + origins[axis, 1] * x + origins[axis, 2] * y,
                )
                store(tile.rays, begin + (DIRECTION + axis) * tile.room, speed)
                store(tile.rays, begin + (INVERSE + axis) * tile.room, where(speed == 0.0, 0.0, 1.0 / speed))
                square += speed * speed
            jitter = _jitter(column * np.int32(stride), np.int32(row * stride))
            store(tile.rays, begin + LENGTH * tile.room, np.sqrt(square) * (1.0 + DITHER * (jitter - 0.5)))
            store(tile.rays, begin + ROUNDING_OFFSET * tile.room, 0.5 + jitter)
            square = rays.slope_per_px**2 * (x * x + y * y)
            store(tile.rays, begin + LENGTH_PER_DEPTH * tile.room, np.sqrt(1.0 + square))
            for place in range(first, min(first + CLIPPED, right)):
                pixel = begin + place - first
                tile.places[pixel] = 4 * (row * image.shape[1] + place)
                tile.alphas[pixel] = image[row, place, 3] if is_drawn[row, place] else _NOT_DRAWN


@inline
def _jitter(column: Any, row: Any) -> Any:
    """Return the jitter of pixels, from 0 to 1, as in `renderer.bricks.sampling`."""
    whole = column * np.int32(JITTER_PER_PX[0]) + row * np.int32(JITTER_PER_PX[1])
    return to_float64(whole >> np.int32(8) & np.int32(0xFFFFFF)) / 16777216.0


@jit
def make_kept(cuts: Cuts | None, room: int) -> Kept | None:
    """Return room for where the rays of a tile are not cut away; None without cuts."""
    if cuts is None:
        return None
    num_boxes = len(cuts.boxes)
    return Kept(num_boxes, np.zeros(2 * room), np.zeros(2 * num_boxes * room))


@jit
def cut_rays(cuts: Cuts | None, start: float, size: tuple[int, int], tile: Tile, kept: Kept | None) -> None:
    """Find where the rays of a tile are not cut away. size: columns and rows of its rays."""
    if cuts is None or kept is None:
        return
    for row in range(size[1]):
        for column in range(0, size[0], CLIPPED):
            pixel = row * tile.side + column
            enter, leave = _clip_slabs(cuts.slabs, start, tile, pixel)
            store(kept.bounds, pixel, enter)
            store(kept.bounds, pixel + tile.room, leave)
            for box in range(kept.num_boxes):
                enter, leave = _clip_slabs(cuts.boxes[box], -math.inf, tile, pixel)
                place = pixel + 2 * box * tile.room
                store(kept.removed, place, where(enter < leave, enter, math.inf))
                store(kept.removed, place + tile.room, where(enter < leave, leave, -math.inf))


@inline
def _clip_slabs(slabs: Float64, start: float, tile: Tile, pixel: int) -> Any:
    """Return where rays enter and leave what slabs, float64 [k, 5] as in Cuts, have in common, from a start on."""
    ox, dx, _ = ray_along(tile, pixel, 0)
    oy, dy, _ = ray_along(tile, pixel, 1)
    oz, dz, _ = ray_along(tile, pixel, 2)
    enter, leave = start, math.inf
    for k in range(len(slabs)):
        x, y, z = slabs[k, 0], slabs[k, 1], slabs[k, 2]
        speed = x * dx + y * dy + z * dz
        inverse = where(speed == 0.0, 0.0, 1.0 / speed)
        enter, leave = clip_slab(enter, leave, x * ox + y * oy + z * oz, inverse, slabs[k, 3], slabs[k, 4])
    return enter, leave


@inline
def take_part(kept: Kept, enter: Any, leave: Any, hit: Any, room: int, pixel: int) -> Any:
    """Take the next part of rays that is not cut away, between where they enter and leave a brick.

    Returns where it begins and ends, empty where nothing is left, and which of the rays that `hit` have more behind it.
    """
    start = load(kept.bounds, pixel, CLIPPED)
    enter, leave = max(enter, start), min(leave, load(kept.bounds, pixel + room, CLIPPED))
    for _ in range(kept.num_boxes):  # behind a box may be another one
        for box in range(kept.num_boxes):
            begin = load(kept.removed, pixel + 2 * box * room, CLIPPED)
            end = load(kept.removed, pixel + (2 * box + 1) * room, CLIPPED)
            enter = where((begin <= enter) & (enter < end), end, enter)
    part_end = leave
    for box in range(kept.num_boxes):
        begin = load(kept.removed, pixel + 2 * box * room, CLIPPED)
        part_end = where((begin > enter) & (begin < part_end), begin, part_end)
    hit &= part_end > enter
    store(kept.bounds, pixel, where(hit, part_end, start))
    return enter, part_end, hit & (part_end < leave)


@inline
def ray_along(tile: Tile, pixel: int, axis: int) -> Any:
    """Return origin, direction and inverse direction of rays along an axis."""
    return (
        load(tile.rays, pixel + (ORIGIN + axis) * tile.room, CLIPPED),
        load(tile.rays, pixel + (DIRECTION + axis) * tile.room, CLIPPED),
        load(tile.rays, pixel + (INVERSE + axis) * tile.room, CLIPPED),
    )


@inline
def clip_slab(enter: Any, leave: Any, origin: Any, inverse: Any, low: float, high: float) -> Any:
    """Clip rays to what lies between two planes across an axis; a ray in a plane belongs to what is above it."""
    one, other = (low - origin) * inverse, (high - origin) * inverse
    near, far = where(one < other, one, other), where(one < other, other, one)
    near, far = where(near > enter, near, enter), where(far < leave, far, leave)
    is_parallel = inverse == 0.0
    is_inside = (origin >= low) & (origin < high)
    return where(is_parallel, enter, near), where(is_parallel, where(is_inside, leave, -math.inf), far)
