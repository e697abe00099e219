"""A frame of splats against the oracle (its cut, its splats, their order) and the reference rasteriser."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from oracle import FLOAT32, Cells, Field, Leaf, centers, classify, drawn, require_cut
from splat_reference import rasterize_reference

from renderer.draw import Rasterizer, draw_lines, make_edges
from renderer.film import quantize
from renderer.frame import Frame, Stage, finest_level_at, make_primitive, render_frames
from renderer.pyramid import Cut, cut_pyramid
from renderer.scene import SplatSpec
from renderer.splats import GouraudFootprint, SplatBatch, make_splats
from renderer.view import View
from renderer.view.order_blending import FADE_ANGLE, MIN_SLOPE, sort_directions
from renderer.volume import Array, Float64, Int64

Order = tuple[float, Int64]  # a share of the picture, and the splats back to front

# The device's exponential and a few operations; and what may be left of splats that are not drawn, where the near
# plane clips them: their moments are differences of larger numbers (tests/parity/test_raster_parity.py).
PRECISION, LEFT_OUT = 2e-5, 3e-4
# By how much sizes and places are off: a part, and units of the last place of the largest part of a coordinate, to some
# sides. SPREADS times the spread of such pictures may be off.
NUDGES = ((-1e-5, (1, 1, 1)), (1e-5, (-1, -1, 1)), (-1e-5, (1, -1, -1)), (1e-5, (-1, 1, -1)))
ULPS = 6 * FLOAT32
SPREADS = 4.0
SUBPIXEL = 1 / 256  # the device places the vertices of triangles on a grid: llvmpipe's; GL guarantees 1/16
# Rounding decides on which side of a rim or a step a pixel lies. The larger of this number and this share may differ.
FEWEST_STRAYS, MOST_STRAYS = 2, 0.02
TINY = 2.0**-126  # below it float32 has fewer digits


class WrongError(AssertionError):
    """The picture or the message is not right."""


def compare_splats(stage: Stage, frame: Frame, view: View, rasterizer: Rasterizer) -> None:
    """Raise WrongError where the frame is not as the definitions have it; its cut and its orders are verified."""
    scene, volume = stage.scene, stage.layers[0].volume
    finest_level = finest_level_at(stage, frame.tolerance)
    cut = cut_pyramid(stage.layers[0].pyramid, frame.tolerance, finest_level=finest_level)
    if len(cut) != frame.num_cells:
        raise WrongError(f"{frame.num_cells} cells in the frame, {len(cut)} in its cut")
    field = classify(volume, scene.transfer_function, scene.shading)
    leaves: list[Leaf] = [
        (int(level), int(x), int(y), int(z)) for level, (x, y, z) in zip(cut.levels, cut.cells, strict=True)
    ]
    require_cut(field, scene, frame.tolerance, finest_level, leaves)
    cells = drawn(field, scene, leaves)
    splats = make_splats(cut, scene.splat)
    _require_splats(splats, field, cells, scene.splat)
    orders = [
        (share, order.astype(np.int64))
        for share, (order,) in make_primitive(stage).make_lod(frame.tolerance, lambda _: None).orders(view)
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
    hidden = rasterize_reference(splats, np.setdiff1d(np.arange(len(splats)), orders[0][1]), view)
    if hidden.max() > LEFT_OUT:
        raise WrongError(f"splats with an alpha of {hidden[..., 3].max():.3g} are left out")
    expected = _blended(splats, orders, view)
    others = [_blended(nudged, orders, moved) for nudged, moved in (_nudged(splats, view, *nudge) for nudge in NUDGES)]
    if not np.array_equal(frame.image, quantize(frame.radiance, scene.output.background)):
        raise WrongError("the 8 bits are not those of the radiance")
    radiance = frame.radiance
    if scene.overlay == "octree":
        radiance = without_overlay(stage, frame, view, rasterizer)
    require_close(radiance, expected, PRECISION + SPREADS * np.ptp([expected, *others], axis=0))


def _require_splats(splats: SplatBatch, field: Field, cells: Cells, spec: SplatSpec) -> None:
    """Their centres, sizes, optical areas and colours are those of the cells, but for rounding."""
    edges = field.volume.world_from_index[:3, :3]
    spacing = float(np.linalg.norm(edges, axis=0).min())
    num_voxels = np.prod(cells.extent, axis=1, dtype=np.float64)
    thickness = num_voxels if spec.opacity_correction else num_voxels ** (2 / 3)
    area = spacing**2 * abs(np.linalg.det(edges / spacing)) * thickness / splats.model_unit**2
    axes = edges * (spec.sigma * cells.extent)[:, None, :] / splats.model_unit
    off = (centers(field, cells) - splats.origin) / splats.model_unit - splats.centers
    emitted, depth = splats.vertices[:, 3:6], splats.vertices[:, 6].astype(np.float64)
    slack = cells.color_slack[:, None] + 4 * FLOAT32
    is_right = {
        "centre": np.abs(off).max(axis=1) <= 4 * FLOAT32,
        "size": np.isclose(splats.axes[splats.vertices[:, 7].astype(int)], axes, rtol=1e-9, atol=1e-30).all((1, 2)),
        "optical area": (depth >= cells.low * area * (1 - 4 * FLOAT32) - TINY)
        & (depth <= cells.high * area * (1 + 4 * FLOAT32) + TINY),
        "colour": (np.abs(emitted - cells.colors * depth[:, None]) <= slack * depth[:, None] + TINY).all(axis=1),
    }
    for name, is_so in is_right.items():
        if not is_so.all():
            i = int(np.argmin(is_so))
            raise WrongError(f"{np.count_nonzero(~is_so)} splats of another {name}, the first is {splats.vertices[i]}")


def _blended(splats: SplatBatch, orders: Sequence[Order], view: View) -> Float64:
    """The picture of the splats in all orders."""
    return np.asarray(sum(share * rasterize_reference(splats, order, view) for share, order in orders))


def _nudged(splats: SplatBatch, view: View, factor: float, sides: tuple[int, int, int]) -> tuple[SplatBatch, View]:
    """Splats and a view that are off by what float32 rounds away."""
    origin = view.view_from_world(splats.origin)
    steps = ULPS * (splats.model_unit + np.abs(origin))
    if isinstance(splats.footprint, GouraudFootprint):
        steps[:2] += SUBPIXEL / view.scale_px * (abs(origin[2]) if view.projection == "perspective" else 1.0)
    vertices = splats.vertices * np.array([1, 1, 1, *[1 + factor] * 4, 1], np.float32)
    return (
        replace(splats, axes=splats.axes * (1 + factor), vertices=vertices),
        replace(view, target=view.target + (steps * np.array(sides)) @ view.axes),
    )


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


def without_overlay(stage: Stage, frame: Frame, view: View, rasterizer: Rasterizer) -> Array:
    """The same frame without its lines; raises WrongError unless they lie over it."""
    bare = replace(stage, scene=replace(stage.scene, overlay="none"))
    (below,) = render_frames(bare, [frame.number], rasterizer, clock=lambda: 0.0)
    cut = cut_pyramid(stage.layers[0].pyramid, frame.tolerance, finest_level=finest_level_at(stage, frame.tolerance))
    lines = np.zeros_like(below.radiance)
    draw_lines(make_edges(cut, 0), view, lines)
    if not (lines.min() >= 0 and lines.max() <= 1 and (lines[..., :3] <= lines[..., 3:] + 1e-6).all()):
        raise WrongError(f"lines from {lines.min()} to {lines.max()}")
    expected = lines + (1 - lines[..., 3:]) * below.radiance
    if np.abs(frame.radiance - expected).max() > 1e-6 * max(1.0, float(below.radiance.max())):
        raise WrongError("the overlay is not over the picture")
    return below.radiance


def require_close(radiance: Array, expected: Float64, bound: Float64 | float) -> None:
    """Raise WrongError where too many pixels are farther from the reference than the bound."""
    off = np.abs(radiance - expected)
    excess = off - bound
    num_strays, num_pixels = int(np.count_nonzero(excess.max(axis=2) > 0)), off.shape[0] * off.shape[1]
    if num_strays > max(FEWEST_STRAYS, MOST_STRAYS * num_pixels):
        row, column, channel = np.unravel_index(excess.argmax(), excess.shape)
        raise WrongError(
            f"{num_strays} of {num_pixels} pixels; row {row}, column {column}, channel {channel}: "
            f"{radiance[row, column].tolist()} instead of {expected[row, column].tolist()}"
        )
