"""Faults that a comparison of frames has to find, each injected where it would arise: in the scene, the cut, the
splats, their order or the view, and into the picture only where the picture is what is wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from subjects import Pixels, Shot

from renderer.film import quantize
from renderer.scene import ControlPoint
from renderer.splats import GaussianFootprint, SplatBatch
from renderer.study import FrameDifference

Order = npt.NDArray[np.uint32]

# A pixel that is off by one level may have been rounded; what is off by more is a fault that can be seen.
SEEN_LEVELS = 2.0

# Of splats, or pairs of them, one after the other until one is seen.
TRIES = 40


@dataclass(frozen=True)
class Defect:
    """name: what is wrong. inject: the picture of a shot with it; None where there is nothing to spoil."""

    name: str
    inject: Callable[[Shot], Pixels | None]

    def __str__(self) -> str:
        return self.name


def _first_seen(shot: Shot, pictures: Iterable[Pixels]) -> Pixels | None:
    """The first picture in which the defect can be seen, which so is no more of one than need be; or the worst."""
    worst, most = None, -1.0
    for picture in pictures:
        levels = FrameDifference(shot.golden, picture).largest()
        if levels > most:
            worst, most = picture, levels
        if most >= SEEN_LEVELS:
            break
    return worst


# Order


def _one_splat_missing(shot: Shot) -> Pixels | None:
    numbers = np.arange(len(shot.splats))
    return _first_seen(shot, (_without(shot, numbers == splat) for splat in _some_splats(shot)))


def _level_missing(shot: Shot) -> Pixels | None:
    return _first_seen(shot, (_without(shot, shot.cut.levels == level) for level in _levels_by_number(shot)))


def _brick_missing(shot: Shot) -> Pixels | None:
    """Of 8 x 8 x 8 voxels."""
    bricks = (shot.cut.cells << shot.cut.levels[:, None].astype(np.int32)) >> 3
    inside = ((bricks == bricks[splat]).all(axis=1) for splat in _some_splats(shot))
    return _first_seen(shot, (_without(shot, lost) for lost in inside))


def _two_swapped(shot: Shot) -> Pixels | None:
    return _first_seen(shot, (_swapped(shot, *pair) for pair in _overlapping_pairs(shot)))


def _front_to_back(shot: Shot) -> Pixels:
    return _in_order(shot, lambda order: np.ascontiguousarray(order[::-1]))


def _without(shot: Shot, lost: npt.NDArray[np.bool_]) -> Pixels:
    return _in_order(shot, lambda order: order[~lost[order]])


def _swapped(shot: Shot, first: int, second: int) -> Pixels:
    def swapped(order: Order) -> Order:
        result = order.copy()
        result[order == first], result[order == second] = second, first
        return result

    return _in_order(shot, swapped)


def _in_order(shot: Shot, change: Callable[[Order], Order]) -> Pixels:
    return shot.drawn(
        replace(shot.draw_list, orders=[(share, change(order)) for share, order in shot.draw_list.orders])
    ).image


def _overlapping_pairs(shot: Shot) -> Iterator[tuple[int, int]]:
    """Splats whose centres are seen within a standard deviation of each other, the next ones in the order."""
    order = shot.draw_list.orders[0][1]
    across = shot.splats.centers.astype(np.float64) @ shot.view.axes[:2].T
    sigma = np.linalg.norm(shot.splats.axes, axis=(1, 2))[shot.splats.shapes] / math.sqrt(3)
    for place in _random(shot).permutation(len(order))[:TRIES]:
        first, later = order[place], order[place + 1 :]
        near = np.linalg.norm(across[later] - across[first], axis=1) < np.minimum(sigma[later], sigma[first])
        if near.any():
            yield int(first), int(later[near.argmax()])


def _some_splats(shot: Shot) -> list[int]:
    """Random ones that are drawn."""
    return _random(shot).permutation(shot.draw_list.orders[0][1])[:TRIES].tolist()


def _levels_by_number(shot: Shot) -> list[int]:
    """Those in the picture, but not if it is the only one: the one with the fewest splats first."""
    levels, counts = np.unique(shot.cut.levels[shot.draw_list.orders[0][1]], return_counts=True)
    return levels[counts.argsort(kind="stable")].tolist() if len(levels) > 1 else []


# Splats


def _uncorrected_level(shot: Shot) -> Pixels | None:
    """Cells of one level are as opaque as a voxel."""

    def uncorrected(level: int) -> Pixels:
        factors = np.where(shot.cut.levels == level, np.float32(0.5**level), np.float32(1))
        return _drawn_of(shot, _scaled(shot.splats, slice(3, 7), factors[:, None]))

    return _first_seen(shot, (uncorrected(level) for level in _levels_by_number(shot) if level > 0))


def _red_too_strong(shot: Shot) -> Pixels:
    return _drawn_of(shot, _scaled(shot.splats, slice(3, 4), 1.01))


def _too_dense(shot: Shot) -> Pixels:
    return _drawn_of(shot, _scaled(shot.splats, slice(3, 7), 1.01))


def _wider(shot: Shot) -> Pixels:
    return _drawn_of(shot, replace(shot.splats, axes=shot.splats.axes * 1.01))


def _ending_in_a_step(shot: Shot) -> Pixels | None:
    """Of 0.2 % of their middle, with the integral that they should have."""
    footprint = shot.splats.footprint
    if not isinstance(footprint, GaussianFootprint):
        return None
    c0, c1, c2 = np.divide(footprint.coefficients, 1 + footprint.rim * math.pi * footprint.cutoff**2).tolist()
    return _drawn_of(shot, replace(shot.splats, footprint=replace(footprint, coefficients=(c0, c1, c2), rim=0.0)))


def _mirrored(shot: Shot) -> Pixels:
    return _drawn_of(shot, _scaled(shot.splats, slice(0, 1), -1))


def _half_a_voxel_off(shot: Shot) -> Pixels:
    step = shot.stage.volume.world_from_index[:3, 0]
    return _drawn_of(shot, replace(shot.splats, origin=shot.splats.origin + step / 2))


def _scaled(splats: SplatBatch, columns: slice, factor: Any) -> SplatBatch:
    vertices = splats.vertices.copy()
    vertices[:, columns] *= np.asarray(factor, np.float32)
    return replace(splats, vertices=vertices)


def _drawn_of(shot: Shot, splats: SplatBatch) -> Pixels:
    return shot.drawn(shot.with_splats(splats)).image


# View


def _camera_off(shot: Shot) -> Pixels:
    """Turned about the target by 0.1 degree."""
    angle = math.radians(0.1)
    turn = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    return shot.drawn(shot.seen_from(replace(shot.view, axes=turn @ shot.view.axes))).image


def _shifted_by(pixels: float) -> Callable[[Shot], Pixels]:
    """To the left, as far as what lies at the target's distance is concerned."""

    def shifted(shot: Shot) -> Pixels:
        view = shot.view
        step = pixels / view.scale_px * (view.distance if view.projection == "perspective" else 1.0)
        return shot.drawn(shot.seen_from(replace(view, target=view.target + step * view.axes[0]))).image

    return shifted


def _frame_repeated(shot: Shot) -> Pixels:
    frames = shot.stage.scene.camera.path.frames
    return shot.drawn(shot.make_draw_list(shot.stage, frame=(shot.subject.frame - 1) % frames)).image


# Scene


def _coarser(shot: Shot) -> Pixels | None:
    """Every tenth part of the tolerance is a step."""
    return shot.drawn(shot.make_draw_list(shot.stage, tolerance=shot.tolerance * 1.1)).image if shot.tolerance else None


def _grey_point(shot: Shot) -> Pixels | None:
    """The most colourful of the transfer function's points that shows anything."""
    scene = shot.stage.scene
    points = scene.transfer_function.mapping
    if not isinstance(points, tuple):
        return None
    spoilt = max(
        (point for point in points if point.opacity > 0), key=lambda point: max(point.color) - min(point.color)
    )
    grey = sum(spoilt.color) / 3
    others = tuple(
        ControlPoint(point.value, (grey, grey, grey), point.opacity) if point is spoilt else point for point in points
    )
    changed = replace(scene, transfer_function=replace(scene.transfer_function, mapping=others))
    return shot.drawn(shot.make_draw_list(shot.staged(changed))).image


# Picture


def _grey_picture(shot: Shot) -> Pixels:
    return _colors(shot, lambda color: color.mean(axis=2, keepdims=True))


def _alpha_lost(shot: Shot) -> Pixels | None:
    return _colors(shot, lambda color: color, alpha=255) if _is_transparent(shot) else None


def _premultiplied(shot: Shot) -> Pixels | None:
    """What should be straight alpha."""
    return _colors(shot, lambda color: color * (shot.golden[..., 3:] / 255)) if _is_transparent(shot) else None


def _wrong_gamma(shot: Shot) -> Pixels:
    """sRGB's curve is undone, and a power of 2.2 applied."""

    def through(color: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        value = color / 255
        linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
        return 255 * linear ** (1 / 2.2)

    return _colors(shot, through)


def _blue_for_red(shot: Shot) -> Pixels:
    return _colors(shot, lambda color: color[..., ::-1])


def _rounded_down(shot: Shot) -> Pixels | None:
    """In place of rounding to the nearest level."""
    if _is_transparent(shot):
        return None
    radiance = shot.frame.radiance.copy()
    radiance[..., :3] -= np.float32(0.5 / 255)
    return quantize(radiance, shot.stage.scene.output.background)


def _other_background(shot: Shot) -> Pixels | None:
    """By a level."""
    background = shot.stage.scene.output.background
    if background is None:
        return None
    red, green, blue = (value + 1 / 255 for value in background)
    return quantize(shot.frame.radiance, (red, green, blue))


def _row_doubled(shot: Shot) -> Pixels:
    rows = np.flatnonzero(_shows(shot).any(axis=1))
    picture = shot.golden.copy()
    picture[rows[len(rows) // 2] + 1] = picture[rows[len(rows) // 2]]
    return picture


def _black_tile(shot: Shot) -> Pixels:
    return _in_a_square(shot, 16, np.zeros_like)


def _noise_cluster(levels: int) -> Callable[[Shot], Pixels]:
    """Within 8 x 8 pixels, of up to so many levels."""

    def noisy(square: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        rng = np.random.default_rng(levels)
        return square + rng.integers(1, levels + 1, square.shape) * rng.choice([-1, 1], square.shape)

    return lambda shot: _in_a_square(shot, 8, noisy)


def _one_pixel_off(levels: int) -> Callable[[Shot], Pixels]:
    return lambda shot: _in_a_square(shot, 1, lambda square: np.where(square > 127, square - levels, square + levels))


def _in_a_square(shot: Shot, side: int, change: Callable[[npt.NDArray[np.int64]], npt.NDArray[np.int64]]) -> Pixels:
    """Somewhere in what is seen of the volume, colours only."""
    picture = shot.golden.copy()
    height, width = picture.shape[:2]
    row, column = _random(shot).choice(np.argwhere(_shows(shot)))
    top, left = np.clip([row - side // 2, column - side // 2], 0, [height - side, width - side])
    place = slice(top, top + side), slice(left, left + side), slice(0, 3)
    picture[place] = np.clip(change(picture[place].astype(np.int64)), 0, 255)
    return picture


def _colors(
    shot: Shot, change: Callable[[npt.NDArray[np.float64]], npt.NDArray[np.float64]], alpha: int | None = None
) -> Pixels:
    picture = shot.golden.copy()
    picture[..., :3] = np.clip(np.rint(change(picture[..., :3].astype(np.float64))), 0, 255)
    if alpha is not None:
        picture[..., 3] = alpha
    return picture


def _is_transparent(shot: Shot) -> bool:
    return shot.golden.shape[2] == 4


def _shows(shot: Shot) -> npt.NDArray[np.bool_]:
    """bool [h, w]: where a good deal of the volume is."""
    alpha = shot.frame.radiance[..., 3]
    return alpha >= 0.5 * alpha.max()


def _random(shot: Shot) -> np.random.Generator:
    return np.random.default_rng([shot.subject.frame, *shot.stage.scene.output.size])


DEFECTS = (
    Defect("one splat missing", _one_splat_missing),
    Defect("two overlapping splats swapped", _two_swapped),
    Defect("all splats front to back", _front_to_back),
    Defect("one level of cells missing", _level_missing),
    Defect("one brick of 8 x 8 x 8 voxels missing", _brick_missing),
    Defect("no opacity correction in one level", _uncorrected_level),
    Defect("red 1 % too strong", _red_too_strong),
    Defect("optical depths 1 % too large", _too_dense),
    Defect("footprints 1 % wider", _wider),
    Defect("footprints that end in a step", _ending_in_a_step),
    Defect("volume mirrored", _mirrored),
    Defect("volume half a voxel off", _half_a_voxel_off),
    Defect("camera off by 0.1 degree", _camera_off),
    Defect("shifted by 0.1 px", _shifted_by(0.1)),
    Defect("shifted by 0.25 px", _shifted_by(0.25)),
    Defect("one frame repeated", _frame_repeated),
    Defect("tolerance 10 % coarser", _coarser),
    Defect("a grey for a colour of the transfer function", _grey_point),
    Defect("all colours grey", _grey_picture),
    Defect("alpha lost", _alpha_lost),
    Defect("premultiplied for straight alpha", _premultiplied),
    Defect("wrong gamma: a power of 2.2 for sRGB's curve", _wrong_gamma),
    Defect("blue for red", _blue_for_red),
    Defect("rounded down", _rounded_down),
    Defect("background one level brighter", _other_background),
    Defect("one row doubled", _row_doubled),
    Defect("a black tile of 16 x 16 px", _black_tile),
    Defect("noise cluster: 3 levels in 8 x 8 px", _noise_cluster(3)),
    Defect("noise cluster: 1 level in 8 x 8 px", _noise_cluster(1)),
    Defect("one pixel off by 3 levels", _one_pixel_off(3)),
    Defect("one pixel off by 8 levels", _one_pixel_off(8)),
)
