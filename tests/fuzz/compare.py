"""A frame of splats against the reference rasteriser, which draws the same splats in float64."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from splat_reference import rasterize_reference

from renderer.draw import Rasterizer, draw_lines, make_edges
from renderer.film import quantize
from renderer.frame import Frame, Stage, finest_level_at, make_primitive
from renderer.pyramid import cut_pyramid
from renderer.splats import GouraudFootprint, SplatBatch
from renderer.view import View
from renderer.volume import Array, Float64, UInt32

Order = tuple[float, UInt32]  # a share of the picture, and the splats back to front

# The device's exponential and a few operations; and what may be left of splats that are not drawn, where the near
# plane clips them: their moments are differences of larger numbers (tests/parity/test_raster_parity.py).
PRECISION, LEFT_OUT = 2e-5, 3e-4
# By how much sizes and places are off: a part, and units of the last place of the largest part of a coordinate, to some
# sides. SPREADS times the spread of such pictures may be off.
NUDGES = ((-1e-5, (1, 1, 1)), (1e-5, (-1, -1, 1)), (-1e-5, (1, -1, -1)), (1e-5, (-1, 1, -1)))
ULPS = 6 * 2.0**-24
SPREADS = 4.0
SUBPIXEL = 1 / 256  # the device places the vertices of triangles on a grid: llvmpipe's; GL guarantees 1/16
# Rounding decides on which side of a rim or a step a pixel lies. The larger of this number and this share may differ.
FEWEST_STRAYS, MOST_STRAYS = 2, 0.02


class WrongError(AssertionError):
    """The picture or the message is not right."""


def compare_splats(stage: Stage, frame: Frame, view: View, rasterizer: Rasterizer) -> None:
    """Raise WrongError where too many pixels differ from the reference by more than rounding explains."""
    lod = make_primitive(stage).make_lod(frame.tolerance, lambda _: None)
    if frame.num_cells != lod.num_cells:
        raise WrongError(f"{frame.num_cells} cells in the frame, {lod.num_cells} in its cut")
    (splats,), orders = lod.batches, [(share, order) for share, (order,) in lod.orders(view)]
    _require_shares(orders)
    samples = view.magnified(splats.samples_across)
    hidden = rasterize_reference(splats, np.setdiff1d(np.arange(len(splats)), orders[0][1]), samples)
    if hidden.max() > LEFT_OUT:
        raise WrongError(f"splats with an alpha of {hidden[..., 3].max():.3g} are left out")
    expected = _blended(splats, orders, samples)
    nudged = (_nudged(splats, samples, *nudge) for nudge in NUDGES)
    others = [_blended(moved_splats, orders, moved) for moved_splats, moved in nudged]
    if not np.array_equal(frame.image, quantize(frame.radiance, stage.scene.output.background)):
        raise WrongError("the 8 bits are not those of the radiance")
    if stage.scene.annotation.octree:
        _require_lines(stage, frame, view)
    require_close(frame.radiance, expected, PRECISION + SPREADS * np.ptp([expected, *others], axis=0))


def _blended(splats: SplatBatch, orders: Sequence[Order], samples: View) -> Float64:
    """Return the picture of the splats in all orders. samples: the view, with a pixel for each sample."""
    across = splats.samples_across
    width, height = samples.size

    def pixels(order: UInt32) -> Float64:
        drawn = rasterize_reference(splats, order, samples)
        if across == 1:
            return drawn
        return np.minimum(drawn, 1.0).reshape(height // across, across, width // across, across, 4).mean(axis=(1, 3))

    return np.asarray(sum(share * pixels(order) for share, order in orders))


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


def _require_lines(stage: Stage, frame: Frame, view: View) -> None:
    """Raise WrongError unless the lines of the octree lie over the picture."""
    cut = cut_pyramid(stage.layers[0].pyramid, frame.tolerance, finest_level=finest_level_at(stage, frame.tolerance))
    lines = np.zeros_like(frame.radiance)
    draw_lines(make_edges(cut, 0), view, lines)
    if not (lines.min() >= 0 and lines.max() <= 1 and (lines[..., :3] <= lines[..., 3:] + 1e-6).all()):
        raise WrongError(f"lines from {lines.min()} to {lines.max()}")
    expected = lines + (1 - lines[..., 3:]) * frame.radiance
    if np.abs(frame.radiance_with_lines() - expected).max() > 1e-6 * max(1.0, float(frame.radiance.max())):
        raise WrongError("the lines are not over the picture")


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
