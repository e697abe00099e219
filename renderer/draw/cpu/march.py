"""March rays through bricks, compiled: a pixel grid, tile by tile, brick by brick, pixel by pixel.

The pixels of a tile stay in the processor's cache while all bricks over it are drawn, front to back. No two threads
write to one pixel, so that images do not depend on the number of threads. Rays, and where they meet bricks, are
float64; samples are float32. The loops use only sums, products, quotients and roots of IEEE 754, and `fma`, which
rounds once: the result is the same bytes on every machine.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.bricks import DITHER, HALO, JITTER_PER_PX, PADDED_BRICK_SIZE
from renderer.draw.constants import MAX_SAMPLE_CELL, MAX_SAMPLES, MIN_SAMPLE_CELL
from renderer.draw.cpu.sample import (
    PIECE_FLOATS,
    TEXELS_PER_BRICK,
    Field,
    Float3,
    Float32,
    Int32,
    Optics,
    bucket,
    cell_at,
    evaluate_piece,
    light_factor,
    opacity_of_depth,
    sample_rgba,
    sample_scalar,
)
from renderer.jit import fma, jit, prefetch
from renderer.view import RaySetup

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Vector = tuple[float, float, float]
Ray = tuple[float, ...]
Window = tuple[int, int, int, int]  # left, top, right and bottom, half-open

# `1 / n` is read from a table.
_RECIPROCALS = np.concatenate([[1.0], 1 / np.arange(1, MAX_SAMPLES + 1)])
# From cells of a brick to the index of the texel at or below.
_TEXEL_OFFSET = HALO - 0.5
_MIN_TEXEL, _MAX_TEXEL = MIN_SAMPLE_CELL + _TEXEL_OFFSET, MAX_SAMPLE_CELL + _TEXEL_OFFSET
_CACHE_LINE_BYTES = 64
# A ray as `_set_up_rays` writes it: origin [3]; direction [3]; its inverse [3], 0 where the direction is 0; the length
# of the direction, dithered; 1/2 plus the jitter; length per depth, in model units.
_ORIGIN, _DIRECTION, _INVERSE, _LENGTH, _ROUNDING_OFFSET, _LENGTH_PER_DEPTH, _RAY_FLOATS = 0, 3, 6, 9, 10, 11, 12

_0: np.float32 = np.float32(0.0)
_1: np.float32 = np.float32(1.0)


class TileBins(NamedTuple):
    """The bricks over each tile: those of tile k are `numbers[starts[k] : starts[k + 1]]`, front to back.

    side: of a tile, in pixels of the grid. rectangles: int64 [n, 4], left, top, right and bottom of each brick,
    half-open, in pixels of the grid and inside it. starts: int64 [tiles + 1]. numbers: int64.
    """

    side: int
    rectangles: Int64
    starts: Int64
    numbers: Int64


class _Brick(NamedTuple):
    """A brick: lowest and highest corner of its visible bounds; lowest corner of its first cell; cells per voxel;
    samples per length; where rays start; where its texels begin."""

    low: Vector
    high: Vector
    corner: Vector
    scale: float
    samples_per_length: float
    start: float
    texel_offset: int


@jit
def bin_bricks(tile_windows: Int64, num_columns: int, num_rows: int) -> tuple[Int64, Int64]:
    """Return `starts` and `numbers` as in TileBins.

    tile_windows: int64 [n, 4], the tiles under each brick, half-open. num_columns, num_rows: of tiles.
    """
    starts = np.zeros(num_columns * num_rows + 2, np.int64)
    for i in range(len(tile_windows)):
        left, top, right, bottom = tile_windows[i]
        for row in range(top, bottom):
            for column in range(left, right):
                starts[row * num_columns + column + 2] += 1
    starts = np.cumsum(starts)  # of tile k at k + 1
    numbers = np.empty(starts[-1], np.int64)
    for i in range(len(tile_windows)):
        left, top, right, bottom = tile_windows[i]
        for row in range(top, bottom):
            for column in range(left, right):
                tile = row * num_columns + column
                numbers[starts[tile + 1]] = i
                starts[tile + 1] += 1  # in the end, where the next tile's begin
    return starts[:-1], numbers


@jit
def draw_tiles(
    bins: TileBins,
    stride: int,
    rays: RaySetup,
    boxes: Float64,
    texel_offsets: Int64,
    is_mean: Bools,
    field: Field,
    is_drawn: Bools,
    image: Float32,
    tiles: Int64,
) -> None:
    """Composite bricks under some tiles of `image`, float32 [rows, columns, 4], premultiplied RGBA.

    stride: the pixels of the grid are every `stride`-th pixel along both axes. boxes, is_mean: as in BrickView.
    texel_offsets: int64 [n], where the texels of each brick begin in its atlas.
    is_drawn: [rows, columns], the pixels of the grid that are drawn. tiles: int64 [k], their numbers, row by row.

    Numba checks no array index. These keep them valid: rectangles are clipped to the grid, and windows to the tile;
    samples are clamped to the brick (`_clamp_to_brick`), and float32 rounds the last one by less than a quarter of a
    texel; scalars are finite, so that the search ends at the last piece.
    """
    num_rows, num_columns = is_drawn.shape
    side, rectangles, starts, numbers = bins.side, bins.rectangles, bins.starts, bins.numbers
    optics, scalars, means, pieces, guide = field.optics, field.scalars, field.means, field.pieces, field.guide
    tiles_in_row = -(-num_columns // side)
    pixel_rays = np.empty((side * side, _RAY_FLOATS))
    scalar_address, mean_address = scalars.ctypes.data, means.ctypes.data
    for tile in tiles:
        top, left = tile // tiles_in_row * side, tile % tiles_in_row * side
        bottom, right = min(top + side, num_rows), min(left + side, num_columns)
        frame = left, top, right, bottom
        _set_up_rays(rays, stride, frame, is_drawn, pixel_rays)
        for k in range(starts[tile], starts[tile + 1]):
            if stride > 1 and k + 1 < starts[tile + 1]:
                following = numbers[k + 1]
                brick = _brick_at(boxes, texel_offsets, following, rays.start)
                if is_mean[following]:
                    _prefetch_brick(brick, mean_address, 4 * 4)
                else:
                    _prefetch_brick(brick, scalar_address, 4)
            number = numbers[k]
            window = (
                max(left, rectangles[number, 0]), max(top, rectangles[number, 1]),
                min(right, rectangles[number, 2]), min(bottom, rectangles[number, 3]),
            )  # fmt: skip
            brick = _brick_at(boxes, texel_offsets, number, rays.start)
            if is_mean[number]:
                _draw_brick(brick, window, frame, optics, means, None, guide, pixel_rays, is_drawn, image)
            else:
                _draw_brick(brick, window, frame, optics, scalars, pieces, guide, pixel_rays, is_drawn, image)


@jit
def _prefetch_brick(brick: _Brick, texels_address: int, texel_bytes: int) -> None:
    """Load the visible texels of a brick into the cache while another brick is drawn.

    Where few pixels are drawn, each texel is read a few times only, and half of the time would be waiting.
    """
    low, high, corner, scale = brick.low, brick.high, brick.corner, brick.scale
    first_row, last_row = _texel_range(low[1], high[1], corner[1], scale)
    first_plane, last_plane = _texel_range(low[2], high[2], corner[2], scale)
    row_bytes = PADDED_BRICK_SIZE * texel_bytes
    for plane in range(first_plane, last_plane + 1):
        begin = texels_address + 4 * brick.texel_offset + plane * PADDED_BRICK_SIZE * row_bytes
        for line in range(begin + first_row * row_bytes, begin + (last_row + 1) * row_bytes, _CACHE_LINE_BYTES):
            prefetch(line)


@jit
def _texel_range(low: float, high: float, corner: float, scale: float) -> tuple[int, int]:
    """Return the first and last texel along an axis between two positions."""
    return (
        int((low - corner) * scale + _TEXEL_OFFSET),
        min(int((high - corner) * scale + _TEXEL_OFFSET + 1), PADDED_BRICK_SIZE - 1),
    )


@jit
def _set_up_rays(rays: RaySetup, stride: int, tile: Window, is_drawn: Bools, pixel_rays: Float64) -> None:
    """Write the rays of a tile, row by row: float64 [pixels, _RAY_FLOATS]."""
    left, top, right, bottom = tile
    origins, directions, slope_per_px, center_px = rays.origins, rays.directions, rays.slope_per_px, rays.center_px
    number = 0
    for row in range(top, bottom):
        for column in range(left, right):
            if is_drawn[row, column]:
                x = column * stride + 0.5 - center_px[0]
                y = row * stride + 0.5 - center_px[1]
                square = 0.0
                for axis in range(3):
                    speed = directions[axis, 0] + directions[axis, 1] * x + directions[axis, 2] * y
                    pixel_rays[number, _ORIGIN + axis] = origins[axis, 0] + origins[axis, 1] * x + origins[axis, 2] * y
                    pixel_rays[number, _DIRECTION + axis] = speed
                    pixel_rays[number, _INVERSE + axis] = 1 / speed if speed != 0.0 else 0.0
                    square += speed * speed
                jitter = _jitter(column * stride, row * stride)
                pixel_rays[number, _LENGTH] = math.sqrt(square) * (1 + DITHER * (jitter - 0.5))
                pixel_rays[number, _ROUNDING_OFFSET] = 0.5 + jitter
                pixel_rays[number, _LENGTH_PER_DEPTH] = math.sqrt(1 + slope_per_px**2 * (x * x + y * y))
            number += 1


@jit
def _jitter(column: int, row: int) -> float:
    """Return the jitter of a pixel, from 0 to 1, as in `renderer.bricks.sampling`."""
    whole = (column * JITTER_PER_PX[0] + row * JITTER_PER_PX[1]) & 0xFFFFFFFF
    return (whole >> 8) / 16777216.0


@jit
def _brick_at(boxes: Float64, texel_offsets: Int64, number: int, start: float) -> _Brick:
    return _Brick(
        (boxes[number, 0], boxes[number, 1], boxes[number, 2]),
        (boxes[number, 3], boxes[number, 4], boxes[number, 5]),
        (boxes[number, 6], boxes[number, 7], boxes[number, 8]),
        boxes[number, 9],
        boxes[number, 9] / boxes[number, 10],
        start,
        texel_offsets[number],
    )


@jit
def _ray_at(rays: Float64, k: int) -> Ray:
    """Return ray k as a tuple: loads that do not wait for the branches on it save 4 % of a frame."""
    return (
        rays[k, 0], rays[k, 1], rays[k, 2], rays[k, 3], rays[k, 4], rays[k, 5],
        rays[k, 6], rays[k, 7], rays[k, 8], rays[k, 9], rays[k, 10], rays[k, 11],
    )  # fmt: skip


@jit
def _clip_ray(brick: _Brick, ray: Ray) -> tuple[int, np.float32, Float3, Float3]:
    """Return the samples of a ray in a brick: their number, 0 where the ray misses it; the length of a segment, in
    model units; the first sample, in texels, and the step to the next one."""
    low, high, corner, scale = brick.low, brick.high, brick.corner, brick.scale
    enter, leave = brick.start, math.inf
    enter, leave = _clip_slab(enter, leave, ray[_ORIGIN], ray[_INVERSE], low[0], high[0])
    enter, leave = _clip_slab(enter, leave, ray[_ORIGIN + 1], ray[_INVERSE + 1], low[1], high[1])
    enter, leave = _clip_slab(enter, leave, ray[_ORIGIN + 2], ray[_INVERSE + 2], low[2], high[2])
    if not leave > enter:
        return 0, _0, (_0, _0, _0), (_0, _0, _0)
    num = int((leave - enter) * brick.samples_per_length * ray[_LENGTH] + ray[_ROUNDING_OFFSET])
    num = max(1, min(num, MAX_SAMPLES))
    num += num & 3 == 0
    segment = (leave - enter) * _RECIPROCALS[num]
    way = enter + 0.5 * segment, leave - 0.5 * segment, _RECIPROCALS[num - 1]
    x, step_x = _first_and_step(ray[_ORIGIN], ray[_DIRECTION], way, corner[0], scale)
    y, step_y = _first_and_step(ray[_ORIGIN + 1], ray[_DIRECTION + 1], way, corner[1], scale)
    z, step_z = _first_and_step(ray[_ORIGIN + 2], ray[_DIRECTION + 2], way, corner[2], scale)
    return num, np.float32(segment * ray[_LENGTH_PER_DEPTH]), (x, y, z), (step_x, step_y, step_z)


@jit
def _clip_slab(
    enter: float, leave: float, origin: float, inverse: float, low: float, high: float
) -> tuple[float, float]:
    """Clip a ray to what lies between two planes across an axis; a ray in a plane belongs to what is above it."""
    if inverse == 0.0:
        return (enter, leave) if low <= origin < high else (enter, -math.inf)
    one, other = (low - origin) * inverse, (high - origin) * inverse
    near = one if one < other else other
    far = other if one < other else one
    return near if near > enter else enter, far if far < leave else leave


@jit
def _first_and_step(
    origin: float, direction: float, way: Vector, corner: float, scale: float
) -> tuple[np.float32, np.float32]:
    """Return the first sample along an axis, in texels of the brick, and the step to the next one.

    way: where the first and the last sample are along the ray, and 1 / the number of intervals between samples.
    """
    begin, end, per_interval = way
    first = _clamp_to_brick((origin + begin * direction - corner) * scale + _TEXEL_OFFSET)
    last = _clamp_to_brick((origin + end * direction - corner) * scale + _TEXEL_OFFSET)
    return np.float32(first), np.float32((last - first) * per_interval)


@jit
def _clamp_to_brick(position: float) -> float:
    """Clamp a position to where a brick has texels; NaN becomes the lowest one."""
    position = position if position > _MIN_TEXEL else _MIN_TEXEL
    return position if position < _MAX_TEXEL else _MAX_TEXEL


@jit
def _draw_brick(
    brick: _Brick,
    window: Window,
    frame: Window,
    optics: Optics,
    texels: Float32,
    pieces: Float32 | None,
    guide: Int32,
    pixel_rays: Float64,
    is_drawn: Bools,
    image: Float32,
) -> None:
    """Composite a brick under the pixels of a window; rays end behind `termination_alpha`.

    frame: the tile whose rays are in `pixel_rays`. pieces: None if the texels are means, which need no classification;
    numba compiles the two cases separately. Arrays are arguments, and only single elements of them go on from here:
    numba counts references to arrays in tuples, which takes up to 15 % of the time.
    """
    left, top, right, bottom = window
    for row in range(top, bottom):
        for column in range(left, right):
            before = image[row, column, 3]
            if not is_drawn[row, column] or before > optics.termination_alpha:
                continue
            ray = _ray_at(pixel_rays, (row - frame[1]) * (frame[2] - frame[0]) + column - frame[0])
            num, segment_length, first, step = _clip_ray(brick, ray)
            red = green = blue = alpha = _0
            for number in range(num):
                at, shares = cell_at(np.float32(number), first, step)
                if pieces is None:
                    r, g, b, tau = sample_rgba(texels, brick.texel_offset + 4 * at, shares)
                else:
                    scalar = sample_scalar(texels, brick.texel_offset + at, shares)
                    piece = np.uint64(guide[bucket(scalar)] * PIECE_FLOATS)
                    while scalar >= pieces[piece]:
                        piece += np.uint64(PIECE_FLOATS)
                    tau, r, g, b = evaluate_piece(pieces, piece, scalar)
                if tau > _0:
                    weight = (_1 - alpha) * opacity_of_depth(tau * optics.spacings_per_model_unit * segment_length)
                    alpha += weight
                    if pieces is None:
                        weight /= tau
                    elif optics.is_lit:
                        gradient = brick.texel_offset + at + TEXELS_PER_BRICK
                        weight *= light_factor(
                            sample_scalar(texels, gradient, shares),
                            sample_scalar(texels, gradient + TEXELS_PER_BRICK, shares),
                            sample_scalar(texels, gradient + 2 * TEXELS_PER_BRICK, shares),
                            optics.light,
                        )
                    red, green, blue = fma(weight, r, red), fma(weight, g, green), fma(weight, b, blue)
                    if alpha > optics.termination_alpha:
                        break
            if alpha > _0:
                transmittance = _1 - before
                image[row, column, 0] = fma(transmittance, red, image[row, column, 0])
                image[row, column, 1] = fma(transmittance, green, image[row, column, 1])
                image[row, column, 2] = fma(transmittance, blue, image[row, column, 2])
                image[row, column, 3] = fma(transmittance, alpha, before)
