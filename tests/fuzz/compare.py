"""A frame against the oracle: its cut, its order, its radiance and its 8 bits."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from oracle import FLOAT32, Leaf, classify, drawn, require_cut
from oracle_splats import Order, Picture, centers, make_picture

from renderer.draw import GLRasterizer, make_edges
from renderer.frame import Frame, Stage, finest_level_at, render_frames
from renderer.pyramid import Cut, cut_pyramid
from renderer.scene import Color
from renderer.splats import make_splats
from renderer.view import View, visible_orders
from renderer.view.order_blending import FADE_ANGLE, MIN_SLOPE, sort_directions

Array = npt.NDArray[Any]
Float64 = npt.NDArray[np.float64]


class WrongError(AssertionError):
    """The picture or the message is not right."""


def reference(stage: Stage, frame: Frame, view: View) -> Picture:
    """What the frame must look like; takes the renderer's cut and orders, and verifies them."""
    scene, volume = stage.scene, stage.volume
    finest_level = finest_level_at(stage, frame.tolerance)
    cut = cut_pyramid(stage.pyramid, frame.tolerance, finest_level=finest_level)
    if len(cut) != frame.num_cells:
        raise WrongError(f"{frame.num_cells} cells in the frame, {len(cut)} in its cut")
    field = classify(volume, scene.transfer_function, scene.shading)
    leaves: list[Leaf] = [
        (int(level), int(x), int(y), int(z)) for level, (x, y, z) in zip(cut.levels, cut.cells, strict=True)
    ]
    require_cut(field, scene, frame.tolerance, finest_level, leaves)
    cells = drawn(field, scene, leaves)
    splats = make_splats(cut, scene.splat)
    orders = [
        (share, order.astype(np.int64))
        for share, order in visible_orders(splats, cut, view, scene.splat.order, stage.order_blending)
    ]
    _require_shares(orders)
    if scene.splat.order == "boxes":
        for _, order in orders:
            _require_box_order(cut, order, view)
    else:
        turned = sort_directions(stage.order_blending, view.forward)
        if scene.splat.order == "unmixed":
            turned = [(1.0, view.forward)]
        _require_depth_orders(cut, orders, centers(field, cells), view, turned)
    return make_picture(field, cells, scene, view, orders)


def _require_shares(orders: list[Order]) -> None:
    """Of one and the same set of splats."""
    shares = [share for share, _ in orders]
    if min(shares) < 0 or abs(sum(shares) - 1) > 1e-12:
        raise WrongError(f"shares {shares}")
    first, *more = (np.sort(order) for _, order in orders)
    if (np.diff(first) == 0).any() or any(not np.array_equal(first, other) for other in more):
        raise WrongError(f"orders of other splats: {[len(order) for _, order in orders]}")


def _require_depth_orders(
    cut: Cut, orders: list[Order], at: Float64, view: View, turned: list[tuple[float, Float64]]
) -> None:
    """Back to front by the centres `at` [n, 3] along the view, or along directions next to it, where neighbours on the
    lattice are at almost the same depth."""
    edges = cut.volume.world_from_index[:3, :3]
    if [weight for weight, _ in turned] != [share for share, _ in orders]:
        raise WrongError(f"{len(orders)} orders, {len(turned)} directions")
    # As far as the views around this one; and by what keeps the order of level steps, and makes them level.
    most = math.sin(FADE_ANGLE) + 2 * MIN_SLOPE if len(turned) > 1 else 0.0
    most += 12 * MIN_SLOPE
    diagonal = float(np.linalg.norm(edges * np.array(cut.volume.shape_xyz)))
    for (_, direction), (_, order) in zip(turned, orders, strict=True):
        turn = float(np.linalg.norm(direction - view.forward))
        if turn > most:
            raise WrongError(f"sorted along a direction {turn:.3g} off the view's")
        depths = (at[order] - cut.volume.centre) @ direction
        rise = float((depths - np.minimum.accumulate(depths)).max(initial=0.0))
        # Depths are those of float32 centres within half the diagonal.
        if rise > 4 * FLOAT32 * diagonal:
            raise WrongError(f"not back to front: {rise / diagonal:.3g} diagonals")


def _require_box_order(cut: Cut, order: Array, view: View) -> None:
    """No box is drawn over one that may hide it: some plane along their faces parts any two boxes, and the later one
    lies on the eye's side of it."""
    index_from_world = np.linalg.inv(cut.volume.world_from_index)
    sides = np.int64(1) << cut.levels[order, None].astype(np.int64)
    low = cut.cells[order] * sides - 0.5
    high = np.minimum(low + sides, np.array(cut.volume.shape_xyz) - 0.5)
    slack = 1e-9
    if view.projection == "perspective":
        eye = index_from_world[:3, :3] @ view.eye + index_from_world[:3, 3]
        slack *= 1 + float(np.abs(eye).max()) + float(np.abs(index_from_world[:3, 3]).max())
    else:  # at infinity; planes that are seen edge-on hide nothing, on either side
        toward = -index_from_world[:3, :3] @ view.forward
        eye = np.where(np.abs(toward) < slack * np.abs(toward).max(), np.nan, np.copysign(np.inf, toward))
    may_follow = np.zeros((len(order), len(order)), bool)
    for k in range(3):
        above = low[None, :, k] >= high[:, None, k]  # the later one lies beyond the earlier one along this axis
        below = high[None, :, k] <= low[:, None, k]
        is_edge_on = bool(np.isnan(eye[k]))
        may_follow |= above & (is_edge_on | (eye[k] >= high[:, None, k] - slack))
        may_follow |= below & (is_edge_on | (eye[k] <= low[:, None, k] + slack))
    wrong = np.argwhere(np.triu(~may_follow, 1))
    if len(wrong):
        raise WrongError(f"box {wrong[0, 1]} of {len(order)} is drawn over box {wrong[0, 0]}, which may hide it")


def without_overlay(stage: Stage, frame: Frame, view: View, rasterizer: GLRasterizer) -> Array:
    """The same frame without its lines; raises WrongError unless they lie over it."""
    bare = replace(stage, scene=replace(stage.scene, overlay="none"))
    (below,) = render_frames(bare, [frame.number], rasterizer, clock=lambda: 0.0)
    cut = cut_pyramid(stage.pyramid, frame.tolerance, finest_level=finest_level_at(stage, frame.tolerance))
    lines = rasterizer.rasterize_edges(make_edges(cut), view).astype(np.float64)
    if not (lines.min() >= 0 and lines.max() <= 1 and (lines[..., :3] <= lines[..., 3:] + 1e-6).all()):
        raise WrongError(f"lines from {lines.min()} to {lines.max()}")
    expected = lines + (1 - lines[..., 3:]) * below.radiance
    if np.abs(frame.radiance - expected).max() > 1e-6 * max(1.0, float(below.radiance.max())):
        raise WrongError("the overlay is not over the picture")
    return below.radiance


def compare_radiance(radiance: Array, picture: Picture) -> None:
    """Require a radiance within the bound of the reference."""
    off = np.abs(radiance - picture.radiance)
    excess = off - picture.bound - 1e-30
    if excess.max() > 0:
        row, column, channel = np.unravel_index(excess.argmax(), excess.shape)
        raise WrongError(
            f"row {row}, column {column}, channel {channel}: {radiance[row, column].tolist()} instead of "
            f"{picture.radiance[row, column].tolist()}, bound {picture.bound[row, column].tolist()}; "
            f"{np.count_nonzero(excess.max(axis=2) > 0)} of {off.shape[0] * off.shape[1]} pixels"
        )


def compare_8_bit(image: Array, picture: Picture, background: Color | None) -> None:
    """Each level must be one that a radiance within the bound can be rounded to."""
    slack = picture.bound + 4 * FLOAT32
    color, alpha = picture.radiance[..., :3], picture.radiance[..., 3:]
    if background is not None:
        value = color + (1 - alpha) * np.array(background)
        more = slack[..., :3] + slack[..., 3:] * np.array(background)
        low, high, exact = value - more, value + more, value
        got = image
    else:
        low = np.maximum(color - slack[..., :3], 0) / np.maximum(alpha + slack[..., 3:], 1e-12)
        high = (color + slack[..., :3]) / np.maximum(alpha - slack[..., 3:], 0.5 / 255)
        exact = color / np.maximum(alpha, 0.5 / 255)
        ends = np.concatenate([low, alpha - slack[..., 3:]], -1), np.concatenate([high, alpha + slack[..., 3:]], -1)
        (low, high), exact = ends, np.concatenate([exact, alpha], -1)
        got = image
        # Where the alpha written is 0 there is no colour.
        is_clear = got[..., 3] == 0
        if got[is_clear].any():
            raise WrongError("a colour where the alpha is 0")
        low[is_clear, :3] = 0
    wrong = (got < _level(low)) | (got > _level(high))
    if wrong.any():
        row, column, _ = np.argwhere(wrong)[0]
        raise WrongError(
            f"8 bits: row {row}, column {column}: {got[row, column].tolist()} instead of "
            f"{_level(exact)[row, column].tolist()}"
        )


def _level(values: Float64) -> npt.NDArray[np.int64]:
    return np.clip(np.floor(values * 255 + 0.5), 0, 255).astype(np.int64)
