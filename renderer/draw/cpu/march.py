"""The compiled half of `renderer.draw.cpu.bricks`: a grid of pixels, tile by tile, box by box, pixel by pixel.

A tile's pixels stay in the processor's cache while all boxes over it are drawn, front to back, and no two threads write
to one pixel, so that pictures do not depend on their number. Rays, and where they meet boxes, are float64; what lies
between is float32. Nothing is computed but by IEEE's sums, products, quotients and roots, and by `fma`, which rounds
once: what rays take up is the same bytes on every machine.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.bricks import DITHER, JITTER_PER_PX, PADDED_BRICK_SIZE
from renderer.draw.cpu.sample import (
    PIECE_FLOATS,
    TEXELS_PER_BRICK,
    Field,
    Float32,
    Int32,
    Shares,
    bucket,
    cell_at,
    evaluate_piece,
    light_factor,
    opacity,
    sample_rgba,
    scalar_at,
)
from renderer.jit import fma, jit, prefetch

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Vector = tuple[float, float, float]
Window = tuple[int, int, int, int]  # left, top, right and bottom, half-open
BrickGeometry = tuple[Vector, Vector, Vector, float, float, float]
Ray = tuple[Vector, Vector, Vector, float, float, float]
RaySamples = tuple[int, np.float32, Shares, Shares]

# Parts of a way through a brick, at most; `1 / n` is looked up.
_MAX_SAMPLES = 4095
_RECIPROCALS = np.concatenate([[1.0], 1 / np.arange(1, _MAX_SAMPLES + 1)])
# Where samples are, in texels of a brick: between the centres of the first and the last, whatever is rounded.
_MIN_TEXEL, _MAX_TEXEL = 0.25, PADDED_BRICK_SIZE - 1.25
# Bytes that come to a cache together.
_LINE = 64
# Numbers of a ray, as `_ray_at` has them.
_RAY_FLOATS = 12

_0: np.float32 = np.float32(0.0)
_1: np.float32 = np.float32(1.0)


class Rays(NamedTuple):
    """Origins, directions, slope_per_px and start as in RaySetup; center_px: (x, y) of the image's centre."""

    origins: Float64
    directions: Float64
    slope_per_px: float
    start: float
    center_px: tuple[float, float]


class Boxes(NamedTuple):
    """Bricks of a picture, front to back; index space relative to the volume's centre.

    bounds, corners, cells_per_voxel, steps, is_mean: as in BrickView.
    firsts: int64 [n], where the brick begins in the texels of its kind.
    """

    bounds: Float64
    corners: Float64
    cells_per_voxel: Float64
    steps: Float64
    is_mean: Bools
    texel_offsets: Int64


@jit
def bin_bricks(rectangles: Int64, side: int, num_columns: int, starts: Int64, numbers: Int64) -> int:
    """Which boxes lie over which tiles: those of tile k are `numbers[starts[k] : starts[k + 1]]`, in their order.

    rectangles: int64 [n, 4], left, top, right and bottom, half-open, in nodes of the lattice, inside of it. side: of a
    tile, in nodes. num_columns: of tiles. starts: int64 [tiles + 1] and numbers: int64, both written. How many numbers
    there are is returned; where there is no room for them, they are not written.
    """
    starts[:] = 0
    for i in range(len(rectangles)):
        left, top, right, bottom = _tile_window(rectangles[i], side)
        for row in range(top, bottom):
            for column in range(left, right):
                starts[row * num_columns + column + 1] += 1
    for tile in range(len(starts) - 1):
        starts[tile + 1] += starts[tile]
    num = int(starts[-1])
    if num > len(numbers):
        return num
    for i in range(len(rectangles)):
        left, top, right, bottom = _tile_window(rectangles[i], side)
        for row in range(top, bottom):
            for column in range(left, right):
                tile = row * num_columns + column
                numbers[starts[tile]] = i
                starts[tile] += 1  # in the end where the next tile's begin
    starts[1:] = starts[:-1].copy()
    starts[0] = 0
    return num


@jit
def _tile_window(rectangle: Int64, side: int) -> Window:
    """Of tiles, which a rectangle of nodes lies over."""
    left, top, right, bottom = rectangle
    if left >= right or top >= bottom:
        return 0, 0, 0, 0
    return left // side, top // side, (right - 1) // side + 1, (bottom - 1) // side + 1


@jit
def draw_tiles(
    tiles: Int64,
    side: int,
    stride: int,
    opaque: np.float32,
    rays: Rays,
    boxes: Boxes,
    rectangles: Int64,
    starts: Int64,
    numbers: Int64,
    field: Field,
    is_drawn: Bools,
    image: Float32,
) -> None:
    """Draw boxes behind what is in some tiles of `image`, float32 [rows, columns, 4], premultiplied RGBA, whose nodes
    are every `stride`-th pixel along both axes.

    tiles: int64 [k], their numbers, row by row. side: of a tile, in nodes. opaque: the alpha behind which nothing is
    drawn. rectangles, starts, numbers: as in `bin_bricks`. is_drawn: [rows, columns], which nodes are.

    No place of an array is checked (numba does not). What keeps them inside: rectangles are clipped to the lattice, and
    windows to the tile; samples are held to the brick (`_inside`), from which the last one is off by float32's rounding
    at most, less than a quarter of a texel; u is finite, so that the search ends at the last piece.
    """
    num_rows, num_columns = is_drawn.shape
    tiles_in_row = -(-num_columns // side)
    pixel_rays = np.empty((side * side, _RAY_FLOATS))
    light = (field.light[0], field.light[1], field.light[2], field.ambient, field.diffuse)
    of_scalars, of_means = field.scalars.ctypes.data, field.means.ctypes.data
    for tile in tiles:
        top, left = tile // tiles_in_row * side, tile % tiles_in_row * side
        bottom, right = min(top + side, num_rows), min(left + side, num_columns)
        _aim(
            rays.origins, rays.directions, rays.center_px, rays.slope_per_px, stride, (left, top, right, bottom),
            is_drawn, pixel_rays,
        )  # fmt: skip
        for place in range(starts[tile], starts[tile + 1]):
            if stride > 1 and place + 1 < starts[tile + 1]:
                box = numbers[place + 1]
                size, texels = (4 * 4, of_means) if boxes.is_mean[box] else (4, of_scalars)
                geometry = _brick_geometry(
                    boxes.bounds, boxes.corners, boxes.cells_per_voxel, boxes.steps, box, rays.start
                )
                _prefetch_brick(geometry, texels + 4 * boxes.texel_offsets[box], size)
            box = numbers[place]
            window = (
                max(left, rectangles[box, 0]), max(top, rectangles[box, 1]),
                min(right, rectangles[box, 2]), min(bottom, rectangles[box, 3]),
            )  # fmt: skip
            frame = (left, top, right - left)
            geometry = _brick_geometry(boxes.bounds, boxes.corners, boxes.cells_per_voxel, boxes.steps, box, rays.start)
            if boxes.is_mean[box]:
                _draw_means(
                    window, frame, geometry, opaque, field.spacings_per_model_unit, boxes.texel_offsets[box],
                        field.means,
                    pixel_rays, is_drawn, image,
                )  # fmt: skip
            else:
                _draw_scalars(
                    window, frame, geometry, opaque, field.spacings_per_model_unit, boxes.texel_offsets[box],
                        field.scalars,
                    field.pieces, field.guide, field.is_lit, light, pixel_rays, is_drawn, image,
                )  # fmt: skip


@jit
def _prefetch_brick(geometry: BrickGeometry, texels: int, size: int) -> None:
    """Have what a box shows of its brick brought to the cache while another box is drawn: where few pixels are, each
    texel is looked up a few times only, and half of the time would be waiting. texels: where the brick begins, size:
    of a texel, bytes."""
    low, high, corner, scale, _, _ = geometry
    first_row, last_row = _texel_range(low[1], high[1], corner[1], scale)
    first_plane, last_plane = _texel_range(low[2], high[2], corner[2], scale)
    row = PADDED_BRICK_SIZE * size
    for plane in range(first_plane, last_plane + 1):
        begin = texels + plane * PADDED_BRICK_SIZE * row
        for address in range(begin + first_row * row, begin + (last_row + 1) * row, _LINE):
            prefetch(address)


@jit
def _texel_range(low: float, high: float, corner: float, scale: float) -> tuple[int, int]:
    """The first and the last texel along an axis of what lies between two places."""
    return int((low - corner) * scale + 0.5), min(int((high - corner) * scale + 1.5), PADDED_BRICK_SIZE - 1)


@jit
def _aim(
    origins: Float64,
    directions: Float64,
    center_px: tuple[float, float],
    slope_per_px: float,
    stride: int,
    tile: Window,
    is_drawn: Bools,
    pixel_rays: Float64,
) -> None:
    """The rays of a tile, row by row: float64 [pixels, _RAY_FLOATS], which has what `_line` takes."""
    left, top, right, bottom = tile
    number = 0
    for row in range(top, bottom):
        for column in range(left, right):
            if is_drawn[row, column]:
                x = column * stride + 0.5 - center_px[0]
                y = row * stride + 0.5 - center_px[1]
                square = 0.0
                for axis in range(3):
                    speed = directions[axis, 0] + directions[axis, 1] * x + directions[axis, 2] * y
                    pixel_rays[number, axis] = origins[axis, 0] + origins[axis, 1] * x + origins[axis, 2] * y
                    pixel_rays[number, 3 + axis] = speed
                    pixel_rays[number, 6 + axis] = 1 / speed if speed != 0.0 else 0.0
                    square += speed * speed
                phase = _phase(column * stride, row * stride)
                pixel_rays[number, 9] = math.sqrt(square) * (1 + DITHER * (phase - 0.5))
                pixel_rays[number, 10] = 0.5 + phase
                pixel_rays[number, 11] = math.sqrt(1 + slope_per_px**2 * (x * x + y * y))
            number += 1


@jit
def _phase(column: int, row: int) -> float:
    """Of a pixel, from 0 to 1: as in `brick_batch`."""
    whole = (column * JITTER_PER_PX[0] + row * JITTER_PER_PX[1]) & 0xFFFFFFFF
    return (whole >> 8) / 16777216.0


@jit
def _brick_geometry(
    bounds: Float64, corners: Float64, cells_per_voxel: Float64, steps: Float64, box: int, start: float
) -> BrickGeometry:
    """Of a box: lowest and highest corner, lowest corner of the brick, cells in a voxel, parts of a length, and where
    rays begin."""
    scale = cells_per_voxel[box]
    return (
        (bounds[box, 0, 0], bounds[box, 0, 1], bounds[box, 0, 2]),
        (bounds[box, 1, 0], bounds[box, 1, 1], bounds[box, 1, 2]),
        (corners[box, 0], corners[box, 1], corners[box, 2]),
        scale,
        scale / steps[box],
        start,
    )


@jit
def _ray_at(pixel_rays: Float64, number: int) -> Ray:
    """Origin and direction; the inverse of the direction, 0 where it is; its length and 1/2, both with the pixel's
    phase, for the number of parts; length for each unit of depth."""
    return (
        (pixel_rays[number, 0], pixel_rays[number, 1], pixel_rays[number, 2]),
        (pixel_rays[number, 3], pixel_rays[number, 4], pixel_rays[number, 5]),
        (pixel_rays[number, 6], pixel_rays[number, 7], pixel_rays[number, 8]),
        pixel_rays[number, 9],
        pixel_rays[number, 10],
        pixel_rays[number, 11],
    )


@jit
def _line(geometry: BrickGeometry, ray: Ray) -> RaySamples:
    """A ray's way through a box: the number of its parts, 0 where it passes by, and the length of each; where in the
    brick the first one's middle is, in texels, and how far from there the next one is."""
    low, high, corner, scale, samples_per_length, start = geometry
    origin, direction, inverse, length, rounding_offset, way = ray
    enter, leave = start, math.inf
    enter, leave = _between(enter, leave, origin[0], inverse[0], low[0], high[0])
    enter, leave = _between(enter, leave, origin[1], inverse[1], low[1], high[1])
    enter, leave = _between(enter, leave, origin[2], inverse[2], low[2], high[2])
    if not leave > enter:
        return 0, _0, (_0, _0, _0), (_0, _0, _0)
    num = max(1, min(int((leave - enter) * samples_per_length * length + rounding_offset), _MAX_SAMPLES))
    num += num & 3 == 0
    part = (leave - enter) * _RECIPROCALS[num]
    begin, end = enter + 0.5 * part, leave - 0.5 * part
    fewer = _RECIPROCALS[num - 1]
    x, step_x = _first_and_step(origin[0], direction[0], begin, end, corner[0], scale, fewer)
    y, step_y = _first_and_step(origin[1], direction[1], begin, end, corner[1], scale, fewer)
    z, step_z = _first_and_step(origin[2], direction[2], begin, end, corner[2], scale, fewer)
    return num, np.float32(part * way), (x, y, z), (step_x, step_y, step_z)


@jit
def _between(enter: float, leave: float, origin: float, inverse: float, low: float, high: float) -> tuple[float, float]:
    """The way from `enter` to `leave` as far as it is between two planes across an axis; a ray within a plane belongs
    to what is above it."""
    if inverse == 0.0:
        return (enter, leave) if low <= origin < high else (enter, -math.inf)
    one, other = (low - origin) * inverse, (high - origin) * inverse
    near = one if one < other else other
    far = other if one < other else one
    return near if near > enter else enter, far if far < leave else leave


@jit
def _first_and_step(
    origin: float, direction: float, begin: float, end: float, corner: float, scale: float, fewer: float
) -> tuple[np.float32, np.float32]:
    """Along an axis, in texels of the brick: where the first sample is, and how far the next one is from there."""
    first = (origin + begin * direction - corner) * scale + 0.5
    last = (origin + end * direction - corner) * scale + 0.5
    first, last = _inside(first), _inside(last)
    return np.float32(first), np.float32((last - first) * fewer)


@jit
def _inside(place: float) -> float:
    """A place where there are texels around; what is no number is brought there, too."""
    place = place if place > _MIN_TEXEL else _MIN_TEXEL
    return place if place < _MAX_TEXEL else _MAX_TEXEL


@jit
def _draw_scalars(
    window: Window,
    frame: tuple[int, int, int],
    geometry: BrickGeometry,
    opaque: np.float32,
    spacings_per_model_unit: np.float32,
    first: int,
    texels: Float32,
    pieces: Float32,
    guide: Int32,
    is_lit: bool,
    light: tuple[np.float32, ...],
    pixel_rays: Float64,
    is_drawn: Bools,
    image: Float32,
) -> None:
    """What rays take up in the brick of scalars that begins at `first`, behind the pixels of a window.

    frame: left and top of the tile whose rays `pixel_rays` has, and its width. Arrays are arguments, and everything but
    single places of them happens here: numba counts arrays that are handed on, up to 15 % of the time.
    """
    left, top, right, bottom = window
    for row in range(top, bottom):
        for column in range(left, right):
            before = image[row, column, 3]
            if not is_drawn[row, column] or before > opaque:
                continue
            ray = _ray_at(pixel_rays, (row - frame[1]) * frame[2] + column - frame[0])
            num, way, place, step = _line(geometry, ray)
            red = green = blue = alpha = _0
            for number in range(num):
                at, shares = cell_at(np.float32(number), place, step)
                scalar = scalar_at(texels, first + at, shares)
                piece_offset = np.uint64(guide[bucket(scalar)] * PIECE_FLOATS)
                while scalar >= pieces[piece_offset]:
                    piece_offset += np.uint64(PIECE_FLOATS)
                tau, r, g, b = evaluate_piece(pieces, piece_offset, scalar)
                if tau > _0:
                    weight = (_1 - alpha) * opacity(tau * spacings_per_model_unit * way)
                    alpha += weight
                    if is_lit:
                        weight *= light_factor(
                            scalar_at(texels, first + at + TEXELS_PER_BRICK, shares),
                            scalar_at(texels, first + at + 2 * TEXELS_PER_BRICK, shares),
                            scalar_at(texels, first + at + 3 * TEXELS_PER_BRICK, shares),
                            light,
                        )
                    red, green, blue = fma(weight, r, red), fma(weight, g, green), fma(weight, b, blue)
                    if alpha > opaque:
                        break
            if alpha > _0:
                _composite_under(image, row, column, before, red, green, blue, alpha)


@jit
def _draw_means(
    window: Window,
    frame: tuple[int, int, int],
    geometry: BrickGeometry,
    opaque: np.float32,
    spacings_per_model_unit: np.float32,
    first: int,
    texels: Float32,
    pixel_rays: Float64,
    is_drawn: Bools,
    image: Float32,
) -> None:
    """As `_draw_scalars`, of a brick of means."""
    left, top, right, bottom = window
    for row in range(top, bottom):
        for column in range(left, right):
            before = image[row, column, 3]
            if not is_drawn[row, column] or before > opaque:
                continue
            ray = _ray_at(pixel_rays, (row - frame[1]) * frame[2] + column - frame[0])
            num, way, place, step = _line(geometry, ray)
            red = green = blue = alpha = _0
            for number in range(num):
                at, shares = cell_at(np.float32(number), place, step)
                r, g, b, tau = sample_rgba(texels, first + 4 * at, shares)
                if tau > _0:
                    weight = (_1 - alpha) * opacity(tau * spacings_per_model_unit * way)
                    alpha += weight
                    weight /= tau
                    red, green, blue = fma(weight, r, red), fma(weight, g, green), fma(weight, b, blue)
                    if alpha > opaque:
                        break
            if alpha > _0:
                _composite_under(image, row, column, before, red, green, blue, alpha)


@jit
def _composite_under(
    image: Float32,
    row: int,
    column: int,
    before: np.float32,
    red: np.float32,
    green: np.float32,
    blue: np.float32,
    alpha: np.float32,
) -> None:
    left = _1 - before
    image[row, column, 0] = fma(left, red, image[row, column, 0])
    image[row, column, 1] = fma(left, green, image[row, column, 1])
    image[row, column, 2] = fma(left, blue, image[row, column, 2])
    image[row, column, 3] = fma(left, alpha, before)
