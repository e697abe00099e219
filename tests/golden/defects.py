"""Faults that a comparison of frames has to find.

Each is injected where it would arise: in the scene, the cut, the splats or bricks, their order or the view; and into
the picture where only the picture is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from subjects import Change, Pixels, Shot, shifted

from hsplat_cli.compare import measure_difference
from renderer.bricks import PADDED_BRICK_SIZE, BrickBatch
from renderer.draw import BrickRasterizer
from renderer.scene import ControlPoint
from renderer.splats import GaussianFootprint, SplatBatch
from renderer.view import screen_rectangles
from renderer.volume import Bools, Float32, Float64, Int64, UInt32

Order = UInt32

# A pixel that is off by one step may have been rounded; what is off by more is a fault that can be seen.
SEEN_LEVELS = 2.0

# Cells, or pairs of them, that are tried until one is seen.
TRIES = 40


def _first_seen(shot: Shot, pictures: Iterable[Pixels]) -> Pixels | None:
    """Return the first picture in which the defect can be seen, or the worst one."""
    worst, most = None, -1.0
    for picture in pictures:
        steps = measure_difference(shot.golden, picture).largest
        if steps > most:
            worst, most = picture, steps
        if most >= SEEN_LEVELS:
            break
    return worst


# Order


def _one_missing(shot: Shot) -> Pixels | None:
    return _first_seen(shot, (_without(shot, np.arange(len(shot.batch)) == cell) for cell in _some_cells(shot)))


def _level_missing(shot: Shot) -> Pixels | None:
    return _first_seen(shot, (_without(shot, shot.cut.levels == level) for level in _levels_by_number(shot)))


def _block_missing(shot: Shot) -> Pixels | None:
    """Lose all splats in 8 x 8 x 8 voxels."""
    blocks = (shot.cut.cells << shot.cut.levels[:, None].astype(np.int32)) >> 3
    inside = ((blocks == blocks[splat]).all(axis=1) for splat in _some_cells(shot))
    return _first_seen(shot, (_without(shot, lost) for lost in inside))


def _two_swapped(shot: Shot) -> Pixels | None:
    return _first_seen(shot, (_swapped(shot, *pair) for pair in _overlapping_pairs(shot)))


def _reversed(shot: Shot) -> Pixels:
    return _in_order(shot, lambda order: np.ascontiguousarray(order[::-1]))


def _without(shot: Shot, lost: Bools) -> Pixels:
    return _in_order(shot, lambda order: order[~lost[order]])


def _swapped(shot: Shot, first: int, second: int) -> Pixels:
    def swapped(order: Order) -> Order:
        result = order.copy()
        result[order == first], result[order == second] = second, first
        return result

    return _in_order(shot, swapped)


def _in_order(shot: Shot, change: Callable[[Order], Order]) -> Pixels:
    orders = [(share, [change(order)]) for share, (order,) in shot.draw_list.orders]
    return shot.drawn(replace(shot.draw_list, orders=orders)).image


def _overlapping_pairs(shot: Shot) -> Iterator[tuple[int, int]]:
    """Yield cells and the next one in the order that covers about the same pixels."""
    order = shot.order
    if isinstance(shot.batch, BrickBatch):
        rectangles = screen_rectangles(shot.batch, order, shot.view)
        centers, reach = (rectangles[:, :2] + rectangles[:, 2:]) / 2, np.ptp(rectangles.reshape(-1, 2, 2), axis=1) / 2
    else:
        centers = (shot.batch.centers.astype(np.float64) @ shot.view.axes[:2].T)[order]
        sigma = np.linalg.norm(shot.batch.axes, axis=(1, 2))[shot.batch.vertices[:, 7].astype(np.int64)] / math.sqrt(3)
        reach = np.repeat(sigma[order, None], 2, axis=1)
    for place in _random(shot).permutation(len(order))[:TRIES]:
        later = slice(place + 1, None)
        near = (np.abs(centers[later] - centers[place]) < np.minimum(reach[later], reach[place])).all(axis=1)
        if near.any():
            yield int(order[place]), int(order[later][near.argmax()])


def _some_cells(shot: Shot) -> list[int]:
    """Return random splats or bricks that are drawn."""
    return _random(shot).permutation(shot.order)[:TRIES].tolist()


def _levels_by_number(shot: Shot) -> list[int]:
    """Return the levels in the picture, the one with the fewest cells first; none if there is only one."""
    levels, counts = np.unique(shot.cut.levels[shot.order], return_counts=True)
    return levels[counts.argsort(kind="stable")].tolist() if len(levels) > 1 else []


# Splats and bricks


def _uncorrected_level(shot: Shot) -> Pixels | None:
    """Make the splats of one level as opaque as those of voxels."""

    def uncorrected(level: int) -> Pixels:
        factors = np.where(shot.cut.levels == level, np.float32(0.5**level), np.float32(1))
        return shot.drawn_of(_scaled(shot.batch, slice(3, 7), factors[:, None]))

    return _first_seen(shot, (uncorrected(level) for level in _levels_by_number(shot) if level > 0))


def _red_too_strong(shot: Shot) -> Pixels:
    """Emit 1 % more red: the picture over nothing is linear in it."""
    return shot.finished(shot.frame.radiance * np.float32([1.01, 1, 1, 1]))


def _too_dense(shot: Shot) -> Pixels:
    """Make optical depths 1 % too large."""
    if isinstance(shot.batch, BrickBatch):
        (layer,) = shot.batch.bricks.layers
        denser = replace(shot.batch.bricks, layers=(replace(layer, weight=1.01),))
        return shot.drawn_of(replace(shot.batch, bricks=denser))
    return shot.drawn_of(_scaled(shot.batch, slice(3, 7), 1.01))


def _wider(shot: Shot) -> Pixels:
    return shot.drawn_of(replace(shot.batch, axes=shot.batch.axes * 1.01))


def _ending_in_a_step(shot: Shot) -> Pixels | None:
    """End footprints in a step of 0.2 % of their middle, with the same integral."""
    footprint = shot.batch.footprint
    if not isinstance(footprint, GaussianFootprint):
        return None
    c0, c1, c2 = np.divide(footprint.coefficients, 1 + footprint.rim * math.pi * footprint.cutoff**2).tolist()
    return shot.drawn_of(replace(shot.batch, footprint=replace(footprint, coefficients=(c0, c1, c2), rim=0.0)))


def _scaled(splats: SplatBatch, columns: slice, factor: Any) -> SplatBatch:
    vertices = splats.vertices.copy()
    vertices[:, columns] *= np.asarray(factor, np.float32)
    return replace(splats, vertices=vertices)


def _gaps(shot: Shot) -> Pixels:
    """Leave a tenth of a voxel free between bricks."""
    low, high = shot.batch.cut.visible_bounds.transpose(1, 0, 2)
    bounds = np.stack([np.minimum(low + 0.05, (low + high) / 2), np.maximum(high - 0.05, (low + high) / 2)], axis=1)
    return shot.drawn_of(replace(shot.batch, cut=replace(shot.batch.cut, visible_bounds=bounds)))


def _long_steps(shot: Shot) -> Pixels:
    """Take half as many samples along rays."""
    return shot.drawn_of(replace(shot.batch, steps=2 * shot.batch.steps))


def _sampled(shot: Shot, **changes: Any) -> Pixels:
    return shot.drawn_of(replace(shot.batch, screen_sampling=replace(shot.batch.screen_sampling, **changes)))


def _halo_off(shot: Shot) -> Pixels:
    """Fill the far layers of each brick's halo with the last cells of the brick, in place of the neighbour's first."""

    def spoilt(texels: Float32) -> None:
        for axis in (1, 2, 3):
            along = np.moveaxis(texels, axis, 0)
            along[-1] = along[-2]

    return _with_texels(shot, spoilt)


def _stale_brick(shot: Shot) -> Pixels | None:
    """Draw a brick with the texels of another one, whose slot it has taken."""
    pairs = _random(shot).integers(0, max(1, len(shot.order)), (TRIES, 2)).tolist()

    def spoil(into: int, source: int, texels: Float32) -> None:
        if max(into, source) < len(texels):
            texels[into] = texels[source]

    return _first_seen(shot, (_with_texels(shot, partial(spoil, *pair)) for pair in pairs if pair[0] != pair[1]))


def _coarse_brick(shot: Shot) -> Pixels | None:
    """Draw a brick of level 0 with the means of 2 x 2 x 2 cells."""

    def spoil(slot: int, texels: Float32) -> None:
        if slot < len(texels):
            inside = texels[slot, 1:-1, 1:-1, 1:-1]
            means = inside.reshape(8, 2, 8, 2, 8, 2, -1).mean(axis=(1, 3, 5), keepdims=True)
            inside[:] = np.broadcast_to(means, (8, 2, 8, 2, 8, 2, means.shape[-1])).reshape(inside.shape)

    slots = _random(shot).permutation(len(shot.order))[:TRIES].tolist()
    return _first_seen(shot, (_with_texels(shot, partial(spoil, slot)) for slot in slots))


def _with_texels(shot: Shot, spoil: Callable[[Float32], None]) -> Pixels:
    """Draw with texels that are changed in place, by a function of the texels of an atlas, [bricks, z, y, x, ...]."""
    with BrickRasterizer() as rasterizer:
        shot.draw_list.upload(rasterizer)
        for cache in rasterizer.caches.values():
            assert not cache.keeps_voxels, "texels are no float32 numbers"
            for atlas in (*cache.scalars, cache.means):
                length = atlas.brick_floats
                bricks = atlas.texels[: len(atlas.texels) // length * length].reshape(-1, length)
                # Lit texels of level 0 have all scalars first, and then all gradients.
                depth = 4 if atlas is cache.means else 1
                scalars = bricks[:, : depth * PADDED_BRICK_SIZE**3]
                spoil(scalars.reshape(len(bricks), *3 * [PADDED_BRICK_SIZE], depth))
        return shot.drawn(shot.draw_list, rasterizer).image


def _other_jitter(shot: Shot) -> Pixels:
    """Draw with the jitter of pixels that are 5 columns and 3 rows away."""
    right, down = 5, 3
    (width, height), view = shot.view.size, shot.view
    lod = shot.draw_list.lod
    wider = replace(view, size=(width + 2 * right, height + 2 * down))
    drawn = shot.drawn(replace(shot.draw_list, view=wider, orders=lod.orders(wider)))
    return shot.finished(np.ascontiguousarray(drawn.radiance[down : down + height, right : right + width]))


# Volume and view


def _mirrored(shot: Shot) -> Pixels:
    volume = shot.stage.layers[0].volume
    values = np.ascontiguousarray(volume.values[:, :, ::-1])
    return shot.drawn(shot.make_draw_list(shot.staged(shot.stage.scene, replace(volume, values=values)))).image


def _half_a_voxel_off(shot: Shot) -> Pixels:
    """Move the camera by half a voxel the other way."""
    step = shot.stage.layers[0].volume.world_from_index[:3, 0]
    return shot.seen_from(replace(shot.view, target=shot.view.target - step / 2))


def _camera_off(shot: Shot) -> Pixels:
    """Turn the camera about the target by 0.1 degree."""
    angle = math.radians(0.1)
    turn = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    return shot.seen_from(replace(shot.view, axes=turn @ shot.view.axes))


def _frame_repeated(shot: Shot) -> Pixels:
    frames = shot.stage.scene.camera.path.frames
    return shot.drawn(shot.make_draw_list(shot.stage, frame=(shot.subject.frame - 1) % frames)).image


# Scene


def _coarser(shot: Shot) -> Pixels | None:
    return shot.drawn(shot.make_draw_list(shot.stage, tolerance=shot.tolerance * 1.1)).image if shot.tolerance else None


def _grey_point(shot: Shot) -> Pixels | None:
    """Take the colour from the most colourful point of the transfer function that shows anything."""
    scene = shot.stage.scene
    points = scene.layers[0].transfer_function.mapping
    if not isinstance(points, tuple):
        return None
    spoilt = max(
        (point for point in points if point.opacity > 0), key=lambda point: max(point.color) - min(point.color)
    )
    grey = sum(spoilt.color) / 3
    others = tuple(
        ControlPoint(point.value, (grey, grey, grey), point.opacity) if point is spoilt else point for point in points
    )
    changed = scene.with_layers(transfer_function=replace(scene.layers[0].transfer_function, mapping=others))
    return shot.drawn(shot.make_draw_list(shot.staged(changed))).image


def _label_off(shot: Shot) -> Pixels | None:
    """Exchange the numbers of a label and the next one."""
    volume = shot.stage.layers[0].volume
    if not volume.is_labels:
        return None

    def renamed(label: int) -> Pixels:
        values = volume.values.copy()
        values[volume.values == label], values[volume.values == label + 1] = label + 1, label
        return shot.drawn(shot.make_draw_list(shot.staged(shot.stage.scene, replace(volume, values=values)))).image

    labels = _random(shot).permutation(np.arange(1, int(volume.values.max())))[:TRIES].tolist()
    return _first_seen(shot, map(renamed, labels))


# Picture


def _annotation_shifted(shot: Shot) -> Pixels | None:
    if not shot.stage.scene.annotation.entries:
        return None
    return shot.finished(shot.frame.radiance, shift=1)


def _grey_picture(shot: Shot) -> Pixels:
    return _colors(shot, lambda color: color.mean(axis=2, keepdims=True))


def _alpha_lost(shot: Shot) -> Pixels | None:
    return _colors(shot, lambda color: color, alpha=255) if _is_transparent(shot) else None


def _premultiplied(shot: Shot) -> Pixels | None:
    return _colors(shot, lambda color: color * (shot.golden[..., 3:] / 255)) if _is_transparent(shot) else None


def _wrong_gamma(shot: Shot) -> Pixels:
    """Undo sRGB's curve, and apply a power of 2.2."""

    def through(color: Float64) -> Float64:
        value = color / 255
        linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
        return 255 * linear ** (1 / 2.2)

    return _colors(shot, through)


def _blue_for_red(shot: Shot) -> Pixels:
    return _colors(shot, lambda color: color[..., ::-1])


def _rounded_down(shot: Shot) -> Pixels | None:
    if _is_transparent(shot):
        return None
    radiance = shot.frame.radiance.copy()
    radiance[..., :3] -= np.float32(0.5 / 255)
    return shot.finished(radiance)


def _other_background(shot: Shot) -> Pixels | None:
    background = shot.stage.scene.output.background
    if background is None:
        return None
    red, green, blue = (value + 1 / 255 for value in background)
    return shot.finished(shot.frame.radiance, (red, green, blue))


def _row_doubled(shot: Shot) -> Pixels:
    rows = np.flatnonzero(_shows(shot).any(axis=1))
    picture = shot.golden.copy()
    picture[rows[len(rows) // 2] + 1] = picture[rows[len(rows) // 2]]
    return picture


def _black_tile(shot: Shot) -> Pixels:
    return _in_a_square(shot, 16, np.zeros_like)


def _noise_cluster(steps: int) -> Callable[[Shot], Pixels]:
    """Move values in 8 x 8 pixels by up to this many steps."""

    def noisy(square: Int64) -> Int64:
        rng = np.random.default_rng(steps)
        return square + rng.integers(1, steps + 1, square.shape) * rng.choice([-1, 1], square.shape)

    return lambda shot: _in_a_square(shot, 8, noisy)


def _one_pixel_off(steps: int) -> Callable[[Shot], Pixels]:
    return lambda shot: _in_a_square(shot, 1, lambda square: np.where(square > 127, square - steps, square + steps))


def _in_a_square(shot: Shot, side: int, change: Callable[[Int64], Int64]) -> Pixels:
    """Change the colours of a random square in which the volume shows."""
    picture = shot.golden.copy()
    height, width = picture.shape[:2]
    row, column = _random(shot).choice(np.argwhere(_shows(shot)))
    top, left = np.clip([row - side // 2, column - side // 2], 0, [height - side, width - side])
    place = slice(top, top + side), slice(left, left + side), slice(0, 3)
    picture[place] = np.clip(change(picture[place].astype(np.int64)), 0, 255)
    return picture


def _colors(shot: Shot, change: Callable[[Float64], Float64], alpha: int | None = None) -> Pixels:
    picture = shot.golden.copy()
    picture[..., :3] = np.clip(np.rint(change(picture[..., :3].astype(np.float64))), 0, 255)
    if alpha is not None:
        picture[..., 3] = alpha
    return picture


def _is_transparent(shot: Shot) -> bool:
    return shot.golden.shape[2] == 4


def _shows(shot: Shot) -> Bools:
    """Return bool [h, w]: where the picture is at least half as opaque as anywhere."""
    alpha = shot.frame.radiance[..., 3]
    return alpha >= 0.5 * alpha.max()


def _random(shot: Shot) -> np.random.Generator:
    return np.random.default_rng([shot.subject.frame, *shot.stage.scene.output.size])


DEFECTS = (
    Change("one splat or brick missing", _one_missing),
    Change("two overlapping ones swapped", _two_swapped),
    Change("all in reverse order", _reversed),
    Change("one level of cells missing", _level_missing),
    Change("8 x 8 x 8 voxels missing", _block_missing, of=SplatBatch),
    Change("no opacity correction in one level", _uncorrected_level, of=SplatBatch),
    Change("red 1 % too strong", _red_too_strong),
    Change("optical depths 1 % too large", _too_dense),
    Change("footprints 1 % wider", _wider, of=SplatBatch),
    Change("footprints that end in a step", _ending_in_a_step, of=SplatBatch),
    Change("gaps of 0.1 voxel between bricks", _gaps, of=BrickBatch),
    Change("steps twice as long", _long_steps, of=BrickBatch),
    Change(
        "pixels interpolated that differ", partial(_sampled, strides=(4, 1), difference_threshold=0.1), of=BrickBatch
    ),
    Change("rays that end at a transmittance of 10 %", partial(_sampled, termination_transmittance=0.1), of=BrickBatch),
    Change("antialiasing lost", partial(_sampled, contrast_threshold=math.inf), of=BrickBatch),
    Change("at most four rays in a pixel", partial(_sampled, spread_threshold=math.inf), of=BrickBatch),
    Change("halo off by one cell", _halo_off, of=BrickBatch),
    Change("a stale brick", _stale_brick, of=BrickBatch),
    Change("a brick at the wrong level", _coarse_brick, of=BrickBatch),
    Change("another seed of jitter", _other_jitter, of=BrickBatch),
    Change("volume mirrored", _mirrored, is_in_scene=True),
    Change("volume half a voxel off", _half_a_voxel_off),
    Change("camera off by 0.1 degree", _camera_off),
    Change("shifted by 0.1 px", partial(shifted, pixels=0.1)),
    Change("shifted by 0.25 px", partial(shifted, pixels=0.25)),
    Change("one frame repeated", _frame_repeated),
    Change("tolerance 10 % coarser", _coarser),
    Change("a grey for a colour of the transfer function", _grey_point, is_in_scene=True),
    Change("labels off by one", _label_off, is_in_scene=True),
    Change("annotation off by one pixel", _annotation_shifted),
    Change("all colours grey", _grey_picture),
    Change("alpha lost", _alpha_lost),
    Change("premultiplied for straight alpha", _premultiplied),
    Change("wrong gamma: a power of 2.2 for sRGB's curve", _wrong_gamma),
    Change("blue for red", _blue_for_red),
    Change("rounded down", _rounded_down),
    Change("background one step brighter", _other_background),
    Change("one row doubled", _row_doubled),
    Change("a black tile of 16 x 16 px", _black_tile),
    Change("noise cluster: 3 steps in 8 x 8 px", _noise_cluster(3)),
    Change("noise cluster: 1 step in 8 x 8 px", _noise_cluster(1)),
    Change("one pixel off by 3 steps", _one_pixel_off(3)),
    Change("one pixel off by 8 steps", _one_pixel_off(8)),
)
