"""Find the most extreme scalar along rays through bricks, compiled: `num_lanes()` rays in step, from cell to cell.

Between eight voxels the field along a ray is a cubic, whose extremes are known: nothing falls between samples. The
scalar is turned so that its maximum is sought (`renderer.bricks.Extremes`). A pixel keeps the largest number that was
found; what lies below it is passed over, brick by brick and cell by cell. Bricks come with the largest bound first, and
a tile ends when no brick that is left can change it. By depth they come front to back, and the first maximum counts.

Where some of the eight voxels have no data, the way through a cell is divided where another voxel becomes the nearest.

The image has in its first channel the number, in its second how near it is, from 0 at the farthest point of the ball
around the volume to 1, and 0 in the others.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from renderer.bricks import PADDED_BRICK_SIZE
from renderer.compiled import (
    any_of,
    append,
    broadcast,
    fma,
    gather,
    inline,
    jit,
    lane_numbers,
    load,
    load_corners,
    load_rows,
    num_lanes,
    store,
    to_float32,
    to_int32,
    where,
)
from renderer.draw.cpu.grid import TileBins
from renderer.draw.cpu.march import SPAN_FLOATS, TEXEL_OFFSET, Spans, first_and_step, sort_spans
from renderer.draw.cpu.rays import (
    CLIPPED,
    RAY_FLOATS,
    Kept,
    Tile,
    Window,
    clip_slab,
    cut_rays,
    make_kept,
    ray_along,
    set_up_rays,
    take_part,
)
from renderer.draw.cpu.sample import are_all_present, are_present
from renderer.view import RaySetup
from renderer.volume import Bools, Float32, Float64, Int64

# A ray through a brick and half of its halo crosses at most 17 faces along each axis.
_MAX_CELLS = 3 * (PADDED_BRICK_SIZE - 1) + 1
_LAST_CELL = np.int32(PADDED_BRICK_SIZE - 2)
# Rays that move less along an axis, in texels of a brick, do not cross it.
_MIN_EXTENT = np.float32(1e-12)
# Bricks of a tile between two looks at what its pixels have found.
_BRICKS_BETWEEN_LOOKS = 4
_NOT_DRAWN = np.float32(np.inf)

_0, _1, _TWO, _THREE = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(3.0)


class Search(NamedTuple):
    """A search, the same in all bricks.

    offset, slope: as in Extremes. slack: by how much a number must exceed the largest one to count, and min_rise to
        take its place. ceiling: a ray ends at this number.
    is_sorted: whether the bounds of bricks fall. Else they come front to back. has_absent: whether any voxel has no
        data.
    forward: float64 [3], how much nearer a step along each index axis is; 0 where depth does not count.
    """

    offset: np.float32
    slope: np.float32
    slack: np.float32
    min_rise: np.float32
    ceiling: np.float32
    is_sorted: bool
    has_absent: bool
    forward: Float64


@jit
def draw_extremes(
    bins: TileBins,
    stride: int,
    rays: RaySetup,
    boxes: Float64,
    texel_offsets: Int64,
    tops: Float64,
    scalars: Float32,
    search: Search,
    is_drawn: Bools,
    image: Float32,
    tiles: Int64,
) -> None:
    """Draw bricks into some tiles of `image`, float32 [rows, columns, 4].

    tops: float64 [n], upper bounds of what is in each brick. Other parameters as in Grid.
    """
    num_rows, num_columns = is_drawn.shape
    side, rectangles, starts, numbers = bins.side, bins.rectangles, bins.starts, bins.numbers
    tiles_in_row, by_depth = -(-num_columns // side), np.any(search.forward != 0.0)
    room = side * side + max(num_lanes(), CLIPPED)
    tile = Tile(side, room, np.zeros(RAY_FLOATS * room), np.empty(room, np.float32), np.empty(room, np.int64))
    spans = Spans(
        np.zeros(SPAN_FLOATS * room, np.float32), np.zeros(room, np.int32), np.zeros(room, np.int32),
        np.empty(_MAX_CELLS + 2, np.int64),
    )  # fmt: skip
    kept = make_kept(rays.cuts, room)
    found, pixels = np.empty(2 * num_lanes(), np.float32), image.reshape(-1)
    for tile_number in tiles:
        top, left = tile_number // tiles_in_row * side, tile_number % tiles_in_row * side
        bottom, right = min(top + side, num_rows), min(left + side, num_columns)
        window = (left, top, right, bottom)
        set_up_rays(rays, stride, window, is_drawn, image, tile)
        cut_rays(rays.cuts, rays.start, (right - left, bottom - top), tile, kept)
        _load_found(window, is_drawn, image, tile)
        for k in range(starts[tile_number], starts[tile_number + 1]):
            number = numbers[k]
            limit = min(np.float32(tops[number]) - search.slack, search.ceiling)
            is_look = search.is_sorted and (k - starts[tile_number]) % _BRICKS_BETWEEN_LOOKS == 0
            if is_look and _least_found(window, tile) >= limit:
                break
            inside = (
                max(left, rectangles[number, 0]) - left, max(top, rectangles[number, 1]) - top,
                min(right, rectangles[number, 2]) - left, min(bottom, rectangles[number, 3]) - top,
            )  # fmt: skip
            corner = boxes[number, 6:9] - TEXEL_OFFSET
            nearness = 0.5 + np.sum(search.forward * corner) if by_depth else 0.0
            is_whole = False
            while not is_whole:  # one part of every ray after the other, where a removed box divides rays
                num, is_whole = _clip_rays(boxes[number], rays.start, kept, inside, limit, tile, spans)
                if num > 0:
                    sort_spans(spans, num)
                    _search(scalars[texel_offsets[number] :], search, nearness, spans, num, tile, found, pixels)


@jit
def _load_found(window: Window, is_drawn: Bools, image: Float32, tile: Tile) -> None:
    """Load the numbers that the pixels in a window have found."""
    left, top, right, bottom = window
    for row in range(top, bottom):
        for column in range(left, right):
            pixel = (row - top) * tile.side + column - left
            tile.alphas[pixel] = image[row, column, 0] if is_drawn[row, column] else _NOT_DRAWN


@jit
def _least_found(window: Window, tile: Tile) -> Any:
    """Return the least number that the pixels in a window have found."""
    left, top, right, bottom = window
    least = _NOT_DRAWN
    for row in range(bottom - top):
        for pixel in range(row * tile.side, row * tile.side + right - left):
            least = min(least, tile.alphas[pixel])
    return least


@jit
def _clip_rays(
    box: Float64, start: float, kept: Kept | None, window: Window, limit: np.float32, tile: Tile, spans: Spans
) -> tuple[int, bool]:
    """Write the spans of rays inside a brick that have found less than `limit`; return as `march` does.

    A span has where it begins [3] and its extents [3], in texels of the brick, 0, and about how many cells it crosses.
    """
    left, top, right, bottom = window
    low_x, low_y, low_z, high_x, high_y, high_z, corner_x, corner_y, corner_z, scale, _ = box
    num, is_whole = 0, True
    for row in range(top, bottom):
        for column in range(left, right, CLIPPED):
            pixel = row * tile.side + column
            hit = lane_numbers(CLIPPED) < np.int32(right - column)
            hit &= load(tile.alphas, pixel, CLIPPED) < limit
            if not any_of(hit):
                continue
            ox, dx, ix = ray_along(tile, pixel, 0)
            oy, dy, iy = ray_along(tile, pixel, 1)
            oz, dz, iz = ray_along(tile, pixel, 2)
            enter, leave = clip_slab(start, math.inf, ox, ix, low_x, high_x)
            enter, leave = clip_slab(enter, leave, oy, iy, low_y, high_y)
            enter, leave = clip_slab(enter, leave, oz, iz, low_z, high_z)
            if kept is not None:
                enter, leave, has_more = take_part(kept, enter, leave, hit, tile.room, pixel)
                is_whole &= not any_of(has_more)
            hit &= leave > enter
            if not any_of(hit):
                continue
            way = enter, leave, 1.0
            x, extent_x = first_and_step(ox, dx, way, corner_x, scale)
            y, extent_y = first_and_step(oy, dy, way, corner_y, scale)
            z, extent_z = first_and_step(oz, dz, way, corner_z, scale)
            num_cells = to_float32(to_int32(abs(extent_x) + abs(extent_y) + abs(extent_z)))
            num_cells = where(hit, num_cells, _0)
            append(spans.pixels, num, hit, lane_numbers(CLIPPED) + np.int32(pixel))
            zero = num_cells - num_cells
            num = append(spans.rows, num, hit, (x, y, z, extent_x, extent_y, extent_z, zero, num_cells))
    return num, is_whole


@jit
def _search(
    texels: Float32, search: Search, nearness: float, spans: Spans, num: int, tile: Tile,
    found: Float32, pixels: Float32,
) -> None:  # fmt: skip
    """Search the cells of spans for larger numbers than those of their pixels.

    nearness: at the texel 0 of the brick. found: float32 [2 * num_lanes()], overwritten. pixels: of the image.
    """
    forward = np.float32(search.forward[0]), np.float32(search.forward[1]), np.float32(search.forward[2])
    for first in range(0, num, num_lanes()):
        order = load(spans.order, first, num_lanes())
        x, y, z, dx, dy, dz, _, _ = load_rows(spans.rows, order * np.int32(SPAN_FLOATS), SPAN_FLOATS)
        best = gather(tile.alphas, gather(spans.pixels, order))
        near = broadcast(_0, num_lanes())
        i, j, k = to_int32(x), to_int32(y), to_int32(z)
        active = lane_numbers(num_lanes()) < np.int32(num - first)
        t, cells = broadcast(_0, num_lanes()), 0
        while cells < _MAX_CELLS:
            cells += 1
            i, j, k = _inside(i), _inside(j), _inside(k)
            tx, ty, tz = _leave_at(i, x, dx), _leave_at(j, y, dy), _leave_at(k, z, dz)
            to_xy, to_end = min(tx, ty), min(tz, _1)
            out = min(to_xy, to_end)
            at = (k * np.int32(PADDED_BRICK_SIZE) + j) * np.int32(PADDED_BRICK_SIZE) + i
            corners = _turned_corners(texels, at, search)
            may_rise = active & (_largest_corner(corners) > best + search.slack)
            if any_of(may_rise):
                entry = fma(t, dx, x) - to_float32(i), fma(t, dy, y) - to_float32(j), fma(t, dz, z) - to_float32(k)
                length = max(out - t, _0)
                extent = length * dx, length * dy, length * dz
                largest, share = _largest_in_cell(corners, entry, extent)
                if search.has_absent:
                    largest, share = _largest_of_data(texels, at, corners, entry, extent, (largest, share))
                is_larger = may_rise & (largest > best + search.min_rise)
                best = where(is_larger, largest, best)
                place = fma(share, length, t)
                here = fma(fma(place, dz, z), forward[2], np.float32(nearness))
                here = fma(fma(place, dx, x), forward[0], fma(fma(place, dy, y), forward[1], here))
                near = where(is_larger, here, near)
                active &= best < search.ceiling
            active &= out < _1
            if not any_of(active):
                break
            i = where(tx <= out, i + _step(dx), i)
            j = where(ty <= out, j + _step(dy), j)
            k = where(tz <= out, k + _step(dz), k)
            t = out
        store(found, 0, best)
        store(found, num_lanes(), near)
        for lane in range(min(num_lanes(), num - first)):
            pixel = spans.pixels[spans.order[first + lane]]
            if found[lane] > tile.alphas[pixel]:
                number = min(found[lane], search.ceiling)
                tile.alphas[pixel] = number
                pixels[tile.places[pixel]], pixels[tile.places[pixel] + 1] = number, found[num_lanes() + lane]


@inline
def _inside(cell: Any) -> Any:
    """Clamp cells to those of a brick."""
    return min(max(cell, np.int32(0)), _LAST_CELL)


@inline
def _step(extent: Any) -> Any:
    return to_int32(where(extent > _0, _1, -_1))


@inline
def _leave_at(cell: Any, first: Any, extent: Any) -> Any:
    """Return where along spans their rays leave cells along an axis, as a share of the span; 2 where never."""
    face = to_float32(cell) + where(extent > _0, _1, _0)
    return where(abs(extent) < _MIN_EXTENT, _TWO, (face - first) / where(abs(extent) < _MIN_EXTENT, _1, extent))


@inline
def _turned_corners(texels: Float32, at: Any, search: Search) -> Any:
    """Load the numbers at the eight corners of cells."""
    a, b, c, d, e, f, g, h = load_corners(texels, at, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE**2)
    offset, slope = search.offset, search.slope
    return (
        fma(a, slope, offset), fma(b, slope, offset), fma(c, slope, offset), fma(d, slope, offset),
        fma(e, slope, offset), fma(f, slope, offset), fma(g, slope, offset), fma(h, slope, offset),
    )  # fmt: skip


@inline
def _largest_corner(corners: Any) -> Any:
    a, b, c, d, e, f, g, h = corners
    ab, cd, ef, gh = max(a, b), max(c, d), max(e, f), max(g, h)
    abcd, efgh = max(ab, cd), max(ef, gh)
    return max(abcd, efgh)


@inline
def _largest_in_cell(corners: Any, entry: Any, extent: Any) -> Any:
    """Return the largest number along `entry + extent q`, q in [0, 1], inside cells, and its q.

    The trilinear field is a + q (b + q (c + q d)) there. Its extremes are at the ends or where its slope is 0.
    """
    c000, c100, c010, c110, c001, c101, c011, c111 = corners
    u, v, w = entry
    du, dv, dw = extent
    x00, x10, x01, x11 = c100 - c000, c110 - c010, c101 - c001, c111 - c011
    y00, y10, y01, y11 = fma(u, x00, c000), fma(u, x10, c010), fma(u, x01, c001), fma(u, x11, c011)
    rise0, rise1 = y10 - y00, y11 - y01
    twist0, twist1 = x10 - x00, x11 - x01
    z0, z1 = fma(v, rise0, y00), fma(v, rise1, y01)
    slope0 = fma(dv, rise0, du * fma(v, twist0, x00))
    slope1 = fma(dv, rise1, du * fma(v, twist1, x01))
    bend0, bend1 = du * dv * twist0, du * dv * twist1
    a = fma(w, z1 - z0, z0)
    b = fma(dw, z1 - z0, fma(w, slope1 - slope0, slope0))
    c = fma(dw, slope1 - slope0, fma(w, bend1 - bend0, bend0))
    d = dw * (bend1 - bend0)
    best, place = a, a - a
    end = a + (b + (c + d))
    place, best = where(end > best, _1, place), max(end, best)
    # b + 2 c q + 3 d q^2 = 0, without cancellation; any q in [0, 1] gives a number of the field.
    triple = _THREE * d
    root = np.sqrt(max(fma(c, c, -(triple * b)), _0))
    sum_ = -(c + where(c < _0, -root, root))
    for q in (_quotient(sum_, triple), _quotient(b, sum_)):
        number = fma(q, fma(q, fma(q, d, c), b), a)
        place, best = where(number > best, q, place), max(number, best)
    return best, place


@inline
def _largest_of_data(texels: Float32, at: Any, corners: Any, entry: Any, extent: Any, found: Any) -> Any:
    """Return what `_largest_in_cell` does, of the places whose nearest voxel has data; minus infinity if there is none.

    found: what that returns, which stays where all eight have data.
    """
    is_whole = are_all_present(texels, at)
    if not any_of(~is_whole):
        return found
    u, v, w = entry
    du, dv, dw = extent
    one, two, three = _middle(u, du), _middle(v, dv), _middle(w, dw)
    low, high = min(one, two), max(one, two)
    first, last = min(low, three), max(high, three)
    between = max(low, min(high, three))
    best, place = where(is_whole, found[0], -np.float32(np.inf)), where(is_whole, found[1], _0)
    zero = first - first
    for begin, end in ((zero, first), (first, between), (between, last), (last, zero + _1)):
        width, half = end - begin, (begin + end) * np.float32(0.5)
        start = fma(begin, du, u), fma(begin, dv, v), fma(begin, dw, w)
        number, share = _largest_in_cell(corners, start, (width * du, width * dv, width * dw))
        nearest = fma(half, du, u), fma(half, dv, v), fma(half, dw, w)
        counts = (width > _0) & are_present(texels, at, nearest) & ~is_whole & (number > best)
        best, place = where(counts, number, best), where(counts, fma(share, width, begin), place)
    return best, place


@inline
def _middle(entry: Any, extent: Any) -> Any:
    """Return where a ray passes the plane in the middle of a cell, as a share of its way through; 0 or 1 beyond."""
    flat = abs(extent) < _MIN_EXTENT
    return min(max(where(flat, _0, (np.float32(0.5) - entry) / where(flat, _1, extent)), _0), _1)


@inline
def _quotient(a: Any, b: Any) -> Any:
    """Return a / b clamped to [0, 1], and 0 where b is 0."""
    return min(max(a / where(b == _0, _1, b), _0), _1)
