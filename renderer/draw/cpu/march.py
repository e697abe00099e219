"""March rays through bricks, compiled: a pixel grid, tile by tile, brick by brick, `num_lanes()` pixels in step.

    rays of a tile -> their spans inside a brick, sorted by numbers of samples -> marched in step
    -> composited under the pixels of the tile

The pixels of a tile stay in the processor's cache while all bricks over it are drawn, front to back. No two threads
write to one pixel, so that images do not depend on the number of threads. Rays, and where they meet bricks, are
float64; samples are float32. The loops use only sums, products, quotients and roots of IEEE 754, and `fma`, which
rounds once: the result is the same bytes on every machine.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from renderer.bricks import HALO, PADDED_BRICK_SIZE
from renderer.compiled import (
    any_of,
    append,
    fma,
    gather,
    inline,
    jit,
    lane_numbers,
    load,
    load_rows,
    num_lanes,
    prefetch,
    store,
    store_rows,
    to_float32,
    to_float64,
    to_int32,
    where,
)
from renderer.draw.constants import MAX_SAMPLE_CELL, MAX_SAMPLES, MIN_SAMPLE_CELL
from renderer.draw.cpu.light import Light, aim, arriving_shares, illuminate, place_brick
from renderer.draw.cpu.rays import (
    CLIPPED,
    DIRECTION,
    LENGTH,
    LENGTH_PER_DEPTH,
    RAY_FLOATS,
    ROUNDING_OFFSET,
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
from renderer.draw.cpu.sample import (
    Field,
    Optics,
    Table,
    cell_at,
    classify,
    extinction_of_data,
    light_factor,
    opacity_of_depth,
    sample_gradient,
    sample_rgba,
    sample_scalar,
)
from renderer.view import RaySetup
from renderer.volume import Bools, Float32, Float64, Int32, Int64

# From cells of a brick to the index of the texel at or below.
TEXEL_OFFSET = HALO - 0.5
_MIN_TEXEL, _MAX_TEXEL = MIN_SAMPLE_CELL + TEXEL_OFFSET, MAX_SAMPLE_CELL + TEXEL_OFFSET
_CACHE_LINE_BYTES = 64
# A span, the part of a ray inside a brick, as `_clip_rays` writes it: the first sample [3], in texels of the brick; the
# step to the next one [3]; the length of a segment, in model units; the number of the last sample.
SPAN_FLOATS = 8
_LAST = 7

_0: np.float32 = np.float32(0.0)
_1: np.float32 = np.float32(1.0)


class TileBins(NamedTuple):
    """A list of the bricks over each tile: those of tile k are `numbers[starts[k] : starts[k + 1]]`, front to back.

    side: of a tile, in pixels of the grid. rectangles: int64 [n, 4], left, top, right and bottom of each brick,
    half-open, in pixels of the grid and inside it. starts: int64 [tiles + 1]. numbers: int64.
    """

    side: int
    rectangles: Int64
    starts: Int64
    numbers: Int64


class Spans(NamedTuple):
    """A list of the parts of rays inside a brick. rows: float32 [room * SPAN_FLOATS]. pixels: int32 [room].

    order: int32 [room], the numbers of spans, those with few samples first. starts: int64, for sorting.
    """

    rows: Float32
    pixels: Int32
    order: Int32
    starts: Int64


@jit
def draw_tiles(
    bins: TileBins,
    stride: int,
    rays: RaySetup,
    boxes: Float64,
    texel_offsets: Int64,
    is_mean: Bools,
    field: Field,
    light: Light | None,
    is_drawn: Bools,
    image: Float32,
    tiles: Int64,
) -> None:
    """Composite bricks under some tiles of `image`, float32 [rows, columns, 4], premultiplied RGBA.

    stride: the pixels of the grid are every `stride`-th pixel along both axes. boxes, is_mean: as in BrickView.
    texel_offsets: int64 [n], where the texels of each brick begin in its atlas.
    light: None for none, or for what Optics has; numba compiles the two cases separately.
    is_drawn: [rows, columns], the pixels of the grid that are drawn. tiles: int64 [k], their numbers, row by row.

    Numba checks no array index. These keep them valid: rectangles are clipped to the grid, and windows to the tile;
    samples are clamped to the brick (`_clamp_to_brick`), and float32 rounds the last one by less than a quarter of a
    texel; scalars are finite, so that the search ends at the last piece; lanes without a ray have a span of zeros or of
    another brick, whose texels are at the same places.
    """
    num_rows, num_columns = is_drawn.shape
    side, rectangles, starts, numbers = bins.side, bins.rectangles, bins.starts, bins.numbers
    tiles_in_row = -(-num_columns // side)
    room = side * side + max(num_lanes(), CLIPPED)
    tile = Tile(side, room, np.zeros(RAY_FLOATS * room), np.empty(room, np.float32), np.empty(room, np.int64))
    spans = Spans(
        np.zeros(SPAN_FLOATS * room, np.float32), np.empty(room, np.int32), np.zeros(room, np.int32),
        np.empty(MAX_SAMPLES + 1, np.int64),
    )  # fmt: skip
    kept = make_kept(rays.cuts, room)
    colors, pixels = np.empty(4 * num_lanes(), np.float32), image.reshape(-1)
    scalar_address, mean_address = field.scalars.ctypes.data, field.means.ctypes.data
    for tile_number in tiles:
        top, left = tile_number // tiles_in_row * side, tile_number % tiles_in_row * side
        bottom, right = min(top + side, num_rows), min(left + side, num_columns)
        set_up_rays(rays, stride, (left, top, right, bottom), is_drawn, image, tile)
        cut_rays(rays.cuts, rays.start, (right - left, bottom - top), tile, kept)
        for k in range(starts[tile_number], starts[tile_number + 1]):
            if stride > 1 and k + 1 < starts[tile_number + 1]:
                following = numbers[k + 1]
                if is_mean[following]:
                    _prefetch_brick(boxes[following], mean_address + 4 * texel_offsets[following], 4 * 4)
                else:
                    _prefetch_brick(boxes[following], scalar_address + 4 * texel_offsets[following], 4)
            number = numbers[k]
            window = (
                max(left, rectangles[number, 0]) - left, max(top, rectangles[number, 1]) - top,
                min(right, rectangles[number, 2]) - left, min(bottom, rectangles[number, 3]) - top,
            )  # fmt: skip
            corner = _texel_0(boxes[number])
            is_whole = False
            while not is_whole:  # one part of every ray after the other, where a removed box divides rays
                num, is_whole = _clip_rays(
                    boxes[number], rays.start, kept, window, field.optics.termination_alpha, tile, spans
                )
                if num > 0:
                    sort_spans(spans, num)
                    if is_mean[number]:
                        texels = field.means[texel_offsets[number] :]
                        _march(texels, None, None, corner, field.optics, spans, num, tile, colors, pixels)
                    else:
                        texels = field.scalars[texel_offsets[number] :]
                        _march(texels, field.table, light, corner, field.optics, spans, num, tile, colors, pixels)


@jit
def _prefetch_brick(box: Float64, address: int, texel_bytes: int) -> None:
    """Load the visible texels of a brick, which begin at an address, into the cache while another brick is drawn.

    Where few pixels are drawn, each texel is read a few times only, and half of the time would be waiting. box: [11],
    as in BrickView.
    """
    _, low_y, low_z, _, high_y, high_z, _, corner_y, corner_z, scale, _ = box
    first_row, last_row = _texel_range(low_y, high_y, corner_y, scale)
    first_plane, last_plane = _texel_range(low_z, high_z, corner_z, scale)
    row_bytes = PADDED_BRICK_SIZE * texel_bytes
    for plane in range(first_plane, last_plane + 1):
        begin = address + plane * PADDED_BRICK_SIZE * row_bytes
        for line in range(begin + first_row * row_bytes, begin + (last_row + 1) * row_bytes, _CACHE_LINE_BYTES):
            prefetch(line)


@jit
def _texel_range(low: float, high: float, corner: float, scale: float) -> tuple[int, int]:
    """Return the first and last texel along an axis between two positions."""
    return (
        int((low - corner) * scale + TEXEL_OFFSET),
        min(int((high - corner) * scale + TEXEL_OFFSET + 1), PADDED_BRICK_SIZE - 1),
    )


@jit
def _clip_rays(
    box: Float64,
    start: float,
    kept: Kept | None,
    window: Window,
    termination_alpha: np.float32,
    tile: Tile,
    spans: Spans,
) -> tuple[int, bool]:
    """Write the spans of rays inside a brick. Return their number, and whether they are all that there is to draw.

    box: [11], as in BrickView. start: where rays start. window: in pixels of the tile. kept: None without cuts; a span
    ends where a removed box begins, and the next call finds what is behind that box.
    """
    left, top, right, bottom = window
    low_x, low_y, low_z, high_x, high_y, high_z, corner_x, corner_y, corner_z, scale, step = box
    samples_per_length, room = scale / step, tile.room
    num, is_whole = 0, True
    for row in range(top, bottom):
        for column in range(left, right, CLIPPED):
            pixel = row * tile.side + column
            hit = lane_numbers(CLIPPED) < np.int32(right - column)
            hit &= load(tile.alphas, pixel, CLIPPED) <= termination_alpha
            if not any_of(hit):
                continue
            ox, dx, ix = ray_along(tile, pixel, 0)
            oy, dy, iy = ray_along(tile, pixel, 1)
            oz, dz, iz = ray_along(tile, pixel, 2)
            enter, leave = clip_slab(start, math.inf, ox, ix, low_x, high_x)
            enter, leave = clip_slab(enter, leave, oy, iy, low_y, high_y)
            enter, leave = clip_slab(enter, leave, oz, iz, low_z, high_z)
            if kept is not None:
                enter, leave, has_more = take_part(kept, enter, leave, hit, room, pixel)
                is_whole &= not any_of(has_more)
            hit &= leave > enter
            if not any_of(hit):
                continue
            length = where(hit, leave - enter, 0.0)
            ray_length = load(tile.rays, pixel + LENGTH * room, CLIPPED)
            fractional = length * samples_per_length * ray_length
            fractional += load(tile.rays, pixel + ROUNDING_OFFSET * room, CLIPPED)
            num_samples = to_int32(min(max(fractional, 1.0), float(MAX_SAMPLES)))
            num_samples = where((num_samples & np.int32(3)) == np.int32(0), num_samples + np.int32(1), num_samples)
            segment = length * (1.0 / to_float64(num_samples))
            way = enter + 0.5 * segment, leave - 0.5 * segment, 1.0 / max(to_float64(num_samples) - 1.0, 1.0)
            x, step_x = first_and_step(ox, dx, way, corner_x, scale)
            y, step_y = first_and_step(oy, dy, way, corner_y, scale)
            z, step_z = first_and_step(oz, dz, way, corner_z, scale)
            segment = to_float32(segment * load(tile.rays, pixel + LENGTH_PER_DEPTH * room, CLIPPED))
            last = to_float32(num_samples - np.int32(1))
            append(spans.pixels, num, hit, lane_numbers(CLIPPED) + np.int32(pixel))
            num = append(spans.rows, num, hit, (x, y, z, step_x, step_y, step_z, segment, last))
    return num, is_whole


@inline
def first_and_step(origin: Any, direction: Any, way: Any, corner: float, scale: float) -> Any:
    """Return the first sample along an axis, in texels of the brick, and the step to the next one.

    way: where the first and the last sample are along the ray, and 1 / the number of intervals between samples.
    """
    begin, end, per_interval = way
    first = _clamp_to_brick((origin + begin * direction - corner) * scale + TEXEL_OFFSET)
    last = _clamp_to_brick((origin + end * direction - corner) * scale + TEXEL_OFFSET)
    return to_float32(first), to_float32((last - first) * per_interval)


@inline
def _clamp_to_brick(position: Any) -> Any:
    """Clamp positions to where a brick has texels; NaN becomes the lowest one."""
    return min(max(_MIN_TEXEL, position), _MAX_TEXEL)


@jit
def sort_spans(spans: Spans, num: int) -> None:
    """Sort spans by their numbers of samples, so that those that are marched in step end together."""
    rows, order, starts = spans.rows, spans.order, spans.starts
    if num <= num_lanes():
        for k in range(num):
            order[k] = k
        return
    largest = 0
    for k in range(num):
        largest = max(largest, int(rows[SPAN_FLOATS * k + _LAST]))
    starts[: largest + 2] = 0
    for k in range(num):
        starts[int(rows[SPAN_FLOATS * k + _LAST]) + 1] += 1
    for count in range(1, largest + 1):
        starts[count] += starts[count - 1]
    for k in range(num):
        last = int(rows[SPAN_FLOATS * k + _LAST])
        order[starts[last]] = k
        starts[last] += 1


@inline
def _texel_0(box: Float64) -> tuple[float, float, float]:
    """Return where the texel 0 of a brick of voxels is, in voxels from the volume's centre."""
    return box[6] - TEXEL_OFFSET, box[7] - TEXEL_OFFSET, box[8] - TEXEL_OFFSET


@jit
def _march(
    texels: Float32, table: Table | None, light: Light | None, corner: tuple[float, float, float], optics: Optics,
    spans: Spans, num: int, tile: Tile, colors: Float32, pixels: Float32,
) -> None:  # fmt: skip
    """Composite the samples of spans under the pixels of a tile; rays end behind `termination_alpha`.

    texels: of the brick, and what follows. table: None if the texels are means, which need no classification; numba
    compiles the two cases separately. light: as in `draw_tiles`. corner: as `_texel_0` returns it.
    colors: float32 [4 * num_lanes()], overwritten. pixels: of the image.
    """
    if light is not None:
        origin = place_brick(light, corner)
    for first in range(0, num, num_lanes()):
        order = load(spans.order, first, num_lanes())
        x, y, z, step_x, step_y, step_z, length, last = load_rows(
            spans.rows, order * np.int32(SPAN_FLOATS), SPAN_FLOATS
        )
        if light is not None:
            ways = aim(light, _directions(tile, gather(spans.pixels, order)))
        red = green = blue = alpha = _0
        alive = lane_numbers(num_lanes()) < np.int32(num - first)
        number = _0
        while True:
            active = alive & (last >= number)
            if not any_of(active):
                break
            here = min(last, number)
            at, shares = cell_at(here, (x, y, z), (step_x, step_y, step_z))
            number += _1
            if table is None:
                r, g, b, tau = sample_rgba(texels, at, shares)
            else:
                scalar = sample_scalar(texels, at, shares)
                if not any_of(active & (scalar >= table.lowest_visible)):
                    continue
                tau, r, g, b = classify(table, scalar)
                tau = extinction_of_data(tau, texels, optics, here, (x, y, z), (step_x, step_y, step_z))
            visible = active & (tau > _0)
            if not any_of(visible):
                continue
            if light is not None:
                texel = fma(here, step_x, x), fma(here, step_y, y), fma(here, step_z, z)
                arriving = arriving_shares(light, texel, origin)
                tau, r, g, b = illuminate((tau, r, g, b), sample_gradient(texels, at, shares), ways, arriving, light)
            depth = where(visible, tau, _0) * optics.spacings_per_model_unit * length
            weight = (_1 - alpha) * opacity_of_depth(depth)
            alpha += weight
            if table is None:
                weight = where(visible, weight / tau, _0)
            elif optics.is_lit:
                weight *= light_factor(sample_gradient(texels, at, shares), optics.light)
            red, green, blue = fma(weight, r, red), fma(weight, g, green), fma(weight, b, blue)
            alive &= alpha <= optics.termination_alpha
        store_rows(colors, (red, green, blue, alpha))
        _composite_under(colors, spans, first, min(num_lanes(), num - first), tile, pixels)


@inline
def _directions(tile: Tile, pixels: Any) -> Any:
    """Return the directions (x, y, z) of the rays of pixels of a tile, in index space."""
    at = pixels + np.int32(DIRECTION * tile.room)
    x, y = gather(tile.rays, at), gather(tile.rays, at + np.int32(tile.room))
    return to_float32(x), to_float32(y), to_float32(gather(tile.rays, at + np.int32(2 * tile.room)))


@inline
def _composite_under(colors: Float32, spans: Spans, first: int, num: int, tile: Tile, pixels: Float32) -> None:
    """Composite colours, premultiplied RGBA, under the pixels of the spans from `first` on."""
    for k in range(num):
        if colors[4 * k + 3] > _0:
            pixel = spans.pixels[spans.order[first + k]]
            place = tile.places[pixel]
            transmittance = _1 - tile.alphas[pixel]
            store(pixels, place, fma(transmittance, load(colors, 4 * k, 4), load(pixels, place, 4)))
            tile.alphas[pixel] = pixels[place + 3]
