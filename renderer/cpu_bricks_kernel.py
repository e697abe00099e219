"""The compiled half of `renderer.cpu_bricks`: a lattice of pixels, tile by tile, in each box by box, pixel by pixel.

A tile's pixels stay in the processor's cache while all boxes over it are drawn, front to back, and no two threads write
to one pixel, so that pictures do not depend on their number. Rays, and where they meet boxes, are float64; what lies
between is float32. Nothing is computed but by IEEE's sums, products, quotients and roots, and by `fma`, which rounds
once: pictures are the same bytes on every machine.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.brick_batch import DITHER, PHASE_PER_PX
from renderer.brick_kernels import SIDE
from renderer.jit import fma, jit, jit_inline
from renderer.optical_pieces import GUIDE_SIZE

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Color = tuple[np.float32, np.float32, np.float32, np.float32]
Shares = tuple[np.float32, np.float32, np.float32]

# Floats of a piece of the transfer function: end, origin, (r, g, b, tau) there, and their slopes.
PIECE = 10
_GUIDE_SIZE, _LAST_OF_GUIDE = np.float32(GUIDE_SIZE), np.float32(GUIDE_SIZE - 1)
# Parts of a way through a brick, at most; `1 / n` is looked up.
_MOST_PARTS = 4095
_PARTS_OF_ONE = np.concatenate([[1.0], 1 / np.arange(1, _MOST_PARTS + 1)])
# Where samples are, in texels of a brick: between the centres of the first and the last, whatever is rounded.
_FIRST, _LAST = 0.25, SIDE - 1.25
# From one texel of a brick to the next along y and z; of all of it.
_ROW, _PLANE, _NUM_TEXELS = SIDE, SIDE**2, SIDE**3
# What a row of the rays of a tile has.
_ORIGIN, _DIRECTION, _INVERSE, _LENGTH, _HALF_MORE, _WAY, _RAY = 0, 3, 6, 9, 10, 11, 12

_0: np.float32 = np.float32(0.0)
_1: np.float32 = np.float32(1.0)
_HALF: np.float32 = np.float32(0.5)
_LOG2_E, _LN_2, _MOST_DEPTH = np.float32(1 / math.log(2)), np.float32(math.log(2)), np.float32(40.0)
_POWERS = (2.0 ** -np.arange(64.0)).astype(np.float32)


class Rays(NamedTuple):
    """As in RayFrame: matrices, of which each row is that of an axis; center_px: (x, y) of the image's centre."""

    origins: Float64
    directions: Float64
    slope_per_px: float
    start: float
    center_px: tuple[float, float]


class Boxes(NamedTuple):
    """Bricks of a picture, front to back; index space relative to the volume's centre.

    bounds: float64 [n, 2, 3]. corners: float64 [n, 3], of the first cell's centre and half a cell before it.
    cells_per_voxel, steps: float64 [n]. firsts: int64 [n], where the brick begins among those of its kind.
    """

    bounds: Float64
    corners: Float64
    cells_per_voxel: Float64
    steps: Float64
    is_mean: Bools
    firsts: Int64


class Field(NamedTuple):
    """What is looked up.

    scalars: float32, of each brick [SIDE^3], or with light [4, SIDE^3] with the gradient. means: of each [SIDE^3, 4].
    depth_of_spacing: 1 / model unit for 1 / finest spacing.
    pieces: float32 [pieces * PIECE]. guide: int32 [GUIDE_SIZE]. Both as in OpticalPieces.
    """

    scalars: Float32
    means: Float32
    depth_of_spacing: np.float32
    pieces: Float32
    guide: npt.NDArray[np.int32]
    is_lit: bool
    light: tuple[np.float32, np.float32, np.float32]
    ambient: np.float32
    diffuse: np.float32


@jit
def bin_boxes(rectangles: Int64, side: int, num_columns: int, starts: Int64, numbers: Int64) -> int:
    """Which boxes lie over which tiles: those of tile k are `numbers[starts[k] : starts[k + 1]]`, in their order.

    rectangles: int64 [n, 4], half-open, of nodes. starts: [tiles + 1]. How many numbers there are is returned; where
    there is no room for them, they are not written.
    """
    starts[:] = 0
    for is_told in range(2):
        for i in range(len(rectangles)):
            left, top, right, bottom = rectangles[i, 0], rectangles[i, 1], rectangles[i, 2], rectangles[i, 3]
            if left >= right or top >= bottom:
                continue
            for row in range(top // side, (bottom - 1) // side + 1):
                for column in range(left // side, (right - 1) // side + 1):
                    tile = row * num_columns + column
                    if is_told:
                        numbers[starts[tile]] = i
                        starts[tile] += 1
                    else:
                        starts[tile + 1] += 1
        if is_told:
            starts[1:] = starts[:-1].copy()
            starts[0] = 0
            break
        for tile in range(len(starts) - 1):
            starts[tile + 1] += starts[tile]
        if starts[-1] > len(numbers):
            break
    return int(starts[-1])


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
    """Boxes behind what is in some tiles of `image` [rows, columns, 4], whose nodes are every `stride`-th pixel.

    opaque: the alpha behind which nothing is drawn. rectangles, starts, numbers: as in `bin_boxes`. is_drawn: [rows,
    columns], which nodes are.
    """
    num_rows, num_columns = is_drawn.shape
    tiles_in_row = -(-num_columns // side)
    of_pixels = np.empty((side * side, _RAY))
    for tile in tiles:
        top, left = tile // tiles_in_row * side, tile % tiles_in_row * side
        bottom, right = min(top + side, num_rows), min(left + side, num_columns)
        _aim(rays, stride, left, top, right, bottom, is_drawn, of_pixels)
        for place in range(starts[tile], starts[tile + 1]):
            box = numbers[place]
            first, last = max(left, rectangles[box, 0]), min(right, rectangles[box, 2])
            for row in range(max(top, rectangles[box, 1]), min(bottom, rectangles[box, 3])):
                number = (row - top) * (right - left) + first - left
                _draw_row(row, first, last, number, box, opaque, rays.start, boxes, field, of_pixels, is_drawn, image)


@jit_inline
def _aim(
    rays: Rays, stride: int, left: int, top: int, right: int, bottom: int, is_drawn: Bools, of_pixels: Float64
) -> None:
    """The rays of a tile, row by row: float64 [pixels, _RAY], which has what `_draw_row` says."""
    number = 0
    for row in range(top, bottom):
        for column in range(left, right):
            if is_drawn[row, column]:
                x = column * stride + 0.5 - rays.center_px[0]
                y = row * stride + 0.5 - rays.center_px[1]
                square = 0.0
                for axis in range(3):
                    origin = rays.origins[axis, 0] + rays.origins[axis, 1] * x + rays.origins[axis, 2] * y
                    speed = rays.directions[axis, 0] + rays.directions[axis, 1] * x + rays.directions[axis, 2] * y
                    of_pixels[number, _ORIGIN + axis] = origin
                    of_pixels[number, _DIRECTION + axis] = speed
                    of_pixels[number, _INVERSE + axis] = 1 / speed if speed != 0.0 else 0.0
                    square += speed * speed
                phase = _phase(column * stride, row * stride)
                of_pixels[number, _LENGTH] = math.sqrt(square) * (1 + DITHER * (phase - 0.5))
                of_pixels[number, _HALF_MORE] = 0.5 + phase
                of_pixels[number, _WAY] = math.sqrt(1 + rays.slope_per_px**2 * (x * x + y * y))
            number += 1


@jit
def _phase(column: int, row: int) -> float:
    """Of a pixel, from 0 to 1: as in `brick_batch`."""
    whole = (column * PHASE_PER_PX[0] + row * PHASE_PER_PX[1]) & 0xFFFFFFFF
    return (whole >> 8) / 16777216.0


@jit_inline
def _draw_row(
    row: int,
    first: int,
    last: int,
    number: int,
    box: int,
    opaque: np.float32,
    start: float,
    boxes: Boxes,
    field: Field,
    of_pixels: Float64,
    is_drawn: Bools,
    image: Float32,
) -> None:
    """The pixels `first` to `last` of a row behind which a box may lie; the first one's ray is `number`."""
    low_x, low_y, low_z = boxes.bounds[box, 0, 0], boxes.bounds[box, 0, 1], boxes.bounds[box, 0, 2]
    high_x, high_y, high_z = boxes.bounds[box, 1, 0], boxes.bounds[box, 1, 1], boxes.bounds[box, 1, 2]
    corner_x, corner_y, corner_z = boxes.corners[box, 0], boxes.corners[box, 1], boxes.corners[box, 2]
    scale = boxes.cells_per_voxel[box]
    parts_per_length = scale / boxes.steps[box]
    of_brick, is_mean = boxes.firsts[box], boxes.is_mean[box]
    for column in range(first, last):
        before = image[row, column, 3]
        if not is_drawn[row, column] or before > opaque:
            continue
        ray = number + column - first
        enter, leave = start, math.inf
        enter, leave = _between(enter, leave, of_pixels[ray, 0], of_pixels[ray, 6], low_x, high_x)
        enter, leave = _between(enter, leave, of_pixels[ray, 1], of_pixels[ray, 7], low_y, high_y)
        enter, leave = _between(enter, leave, of_pixels[ray, 2], of_pixels[ray, 8], low_z, high_z)
        if not leave > enter:
            continue
        num = int((leave - enter) * parts_per_length * of_pixels[ray, _LENGTH] + of_pixels[ray, _HALF_MORE])
        num = max(1, min(num, _MOST_PARTS))
        part = (leave - enter) * _PARTS_OF_ONE[num]
        begin, end = enter + 0.5 * part, leave - 0.5 * part
        fewer = _PARTS_OF_ONE[num - 1]
        x, step_x = _samples(of_pixels[ray, 0], of_pixels[ray, 3], begin, end, corner_x, scale, fewer)
        y, step_y = _samples(of_pixels[ray, 1], of_pixels[ray, 4], begin, end, corner_y, scale, fewer)
        z, step_z = _samples(of_pixels[ray, 2], of_pixels[ray, 5], begin, end, corner_z, scale, fewer)
        way = np.float32(part * of_pixels[ray, _WAY])
        line = (x, y, z, step_x, step_y, step_z)
        if is_mean:
            color = _through_means(line, num, way, opaque, of_brick, field)
        else:
            color = _through_scalars(line, num, way, opaque, of_brick, field)
        left = _1 - before
        image[row, column, 0] = fma(left, color[0], image[row, column, 0])
        image[row, column, 1] = fma(left, color[1], image[row, column, 1])
        image[row, column, 2] = fma(left, color[2], image[row, column, 2])
        image[row, column, 3] = fma(left, color[3], before)


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
def _samples(
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
    place = place if place > _FIRST else _FIRST
    return place if place < _LAST else _LAST


@jit
def _lerp(share: np.float32, one: np.float32, other: np.float32) -> np.float32:
    return fma(share, other - one, one)


@jit_inline
def _through_scalars(
    line: tuple[np.float32, ...], num: int, way: np.float32, opaque: np.float32, first: int, field: Field
) -> Color:
    """(r, g, b, alpha) of `num` parts of a way, each of the length `way`, in the brick of scalars that begins at
    `first`."""
    x, y, z, step_x, step_y, step_z = line
    depth, pieces = field.depth_of_spacing * way, field.pieces
    red = green = blue = alpha = _0
    for number in range(num):
        t = np.float32(number)
        at, shares = _cell_at(fma(t, step_x, x), fma(t, step_y, y), fma(t, step_z, z))
        at += first
        scalar = _scalar_at(field.scalars, at, shares)
        piece = _piece_at(field, scalar)
        offset = scalar - pieces[piece + np.uint64(1)]
        tau = fma(offset, pieces[piece + np.uint64(9)], pieces[piece + np.uint64(5)])
        if tau > _0:
            weight = (_1 - alpha) * _opacity(tau * depth)
            alpha += weight
            if field.is_lit:
                weight *= _light_factor(field, at, shares)
            red = fma(weight, fma(offset, pieces[piece + np.uint64(6)], pieces[piece + np.uint64(2)]), red)
            green = fma(weight, fma(offset, pieces[piece + np.uint64(7)], pieces[piece + np.uint64(3)]), green)
            blue = fma(weight, fma(offset, pieces[piece + np.uint64(8)], pieces[piece + np.uint64(4)]), blue)
            if alpha > opaque:
                break
    return red, green, blue, alpha


@jit_inline
def _piece_at(field: Field, scalar: np.float32) -> np.uint64:
    """Where in `pieces` that of a scalar is; the last one has no end."""
    place = scalar * _GUIDE_SIZE
    place = place if place > _0 else _0
    place = place if place < _LAST_OF_GUIDE else _LAST_OF_GUIDE
    piece: np.uint64 = np.uint64(field.guide[np.uint64(np.int32(place))] * PIECE)
    while scalar >= field.pieces[piece]:
        piece = piece + np.uint64(PIECE)
    return piece


@jit
def _cell_at(x: np.float32, y: np.float32, z: np.float32) -> tuple[int, Shares]:
    """Of a place in a brick, in texels: the number of the texel at or below it, and how far it is beyond that."""
    i, j, k = np.int32(x), np.int32(y), np.int32(z)
    return np.int64((k * SIDE + j) * SIDE + i), (x - np.float32(i), y - np.float32(j), z - np.float32(k))


@jit_inline
def _scalar_at(texels: Float32, at: int, shares: Shares) -> np.float32:
    """Between eight texels, the lowest of which is `at`."""
    low = np.uint64(at)
    high = low + np.uint64(_PLANE)
    u, v, w = shares
    below = _lerp(
        v,
        _lerp(u, texels[low], texels[low + np.uint64(1)]),
        _lerp(u, texels[low + np.uint64(_ROW)], texels[low + np.uint64(_ROW + 1)]),
    )
    above = _lerp(
        v,
        _lerp(u, texels[high], texels[high + np.uint64(1)]),
        _lerp(u, texels[high + np.uint64(_ROW)], texels[high + np.uint64(_ROW + 1)]),
    )
    return _lerp(w, below, above)


@jit_inline
def _light_factor(field: Field, at: int, shares: Shares) -> np.float32:
    """What a colour is multiplied by: Lambert's law on the gradient, of any length, between eight texels."""
    x = _scalar_at(field.scalars, at + _NUM_TEXELS, shares)
    y = _scalar_at(field.scalars, at + 2 * _NUM_TEXELS, shares)
    z = _scalar_at(field.scalars, at + 3 * _NUM_TEXELS, shares)
    largest = max(abs(x), abs(y), abs(z))
    if not largest > _0:
        return field.ambient
    x, y, z = x / largest, y / largest, z / largest  # their squares neither overflow nor vanish
    across = fma(x, field.light[0], fma(y, field.light[1], z * field.light[2]))
    length = np.float32(math.sqrt(fma(x, x, fma(y, y, z * z))))
    return fma(field.diffuse, max(_0, -across / length), field.ambient)


@jit
def _opacity(x: np.float32) -> np.float32:
    """1 - exp(-x) of x >= 0, relative error below 3e-7, as in shaders/opacity.glsl; 2^-n is looked up."""
    if x < _HALF:
        series = fma(x, np.float32(-0.00680757), np.float32(0.04104245))
        series = fma(-x, series, np.float32(0.16656359))
        series = fma(-x, series, np.float32(0.49999463))
        opacity: np.float32 = x * fma(-x, series, _1)
        return opacity
    if not x < _MOST_DEPTH:
        return _1
    n = np.int32(fma(x, _LOG2_E, _HALF))
    r = fma(np.float32(n), _LN_2, -x)
    power = fma(r, np.float32(1 / 720), np.float32(1 / 120))
    power = fma(r, power, np.float32(1 / 24))
    power = fma(r, power, np.float32(1 / 6))
    power = fma(r, power, _HALF)
    power = fma(r, fma(r, power, _1), _1)
    return fma(-power, _POWERS[np.uint64(n)], _1)


@jit_inline
def _through_means(
    line: tuple[np.float32, ...], num: int, way: np.float32, opaque: np.float32, first: int, field: Field
) -> Color:
    """As `_through_scalars`, in a brick of means."""
    x, y, z, step_x, step_y, step_z = line
    depth = field.depth_of_spacing * way
    red = green = blue = alpha = _0
    for number in range(num):
        t = np.float32(number)
        at, shares = _cell_at(fma(t, step_x, x), fma(t, step_y, y), fma(t, step_z, z))
        r, g, b, tau = _four_at(field.means, first + 4 * at, shares)
        if tau > _0:
            weight = (_1 - alpha) * _opacity(tau * depth)
            alpha += weight
            weight /= tau
            red, green, blue = fma(weight, r, red), fma(weight, g, green), fma(weight, b, blue)
            if alpha > opaque:
                break
    return red, green, blue, alpha


@jit_inline
def _four_at(texels: Float32, at: int, shares: Shares) -> Color:
    """Four channels between eight texels, the lowest of which begins at `at`."""
    low = np.uint64(at)
    high = low + np.uint64(4 * _PLANE)
    u, v, w = shares
    below = _mixed(v, _four_between(u, texels, low), _four_between(u, texels, low + np.uint64(4 * _ROW)))
    above = _mixed(v, _four_between(u, texels, high), _four_between(u, texels, high + np.uint64(4 * _ROW)))
    return _mixed(w, below, above)


@jit_inline
def _four_between(share: np.float32, texels: Float32, at: np.uint64) -> Color:
    """Between a texel and the next one along x."""
    return (
        _lerp(share, texels[at], texels[at + np.uint64(4)]),
        _lerp(share, texels[at + np.uint64(1)], texels[at + np.uint64(5)]),
        _lerp(share, texels[at + np.uint64(2)], texels[at + np.uint64(6)]),
        _lerp(share, texels[at + np.uint64(3)], texels[at + np.uint64(7)]),
    )


@jit
def _mixed(share: np.float32, one: Color, other: Color) -> Color:
    return (
        _lerp(share, one[0], other[0]),
        _lerp(share, one[1], other[1]),
        _lerp(share, one[2], other[2]),
        _lerp(share, one[3], other[3]),
    )
