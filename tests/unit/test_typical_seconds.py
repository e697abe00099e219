"""The typical seconds of a frame: what it draws is counted, wherever it is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from splatting import look, place_splats

from renderer.frame.frame import DrawList
from renderer.frame.primitives import LOD
from renderer.splats import SplatBatch
from renderer.view.splat_projection import visible_order


def draw_list_of(batch: SplatBatch, *shares: float, size: tuple[int, int] = (64, 48)) -> DrawList:
    view = look("orthographic", size=size, azimuth=0.0, elevation=0.0)
    order = visible_order(batch, None, view, "unmixed")  # type: ignore[arg-type]
    return DrawList(0, LOD(0.1, batch, None, pytest.fail), view, [(share, order) for share in shares], 0.0)


def num_pixels_of(draw_list: DrawList) -> float:
    return draw_list.lod.num_pixels(draw_list.orders, draw_list.view)


def covered_pixels(batch: SplatBatch, radius_px: float, size: tuple[int, int]) -> int:
    """Pixels whose centres lie in the squares around the footprints, each footprint by itself."""
    view = look("orthographic", size=size, azimuth=0.0, elevation=0.0)
    columns, rows = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    total = 0
    for center in batch.vertices[:, :3] * batch.model_unit + batch.origin:
        x, y, _ = view.view_from_world(center) * view.scale_px
        reach_px = np.maximum(abs(columns - size[0] / 2 - x), abs(rows - size[1] / 2 + y))
        total += int((reach_px < radius_px).sum())
    return total


def test_what_a_frame_draws_against_a_count() -> None:
    size, scale_px = (64, 48), look("orthographic", size=(64, 48)).scale_px
    rng = np.random.default_rng(4)
    centers = rng.uniform(-0.35, 0.35, (50, 3))
    sigma = 1.6 / scale_px
    batch = place_splats(centers, sigma)
    num_pixels = num_pixels_of(draw_list_of(batch, 1.0))
    count = covered_pixels(batch, batch.footprint.cutoff * 1.6, size)
    # A square of 10 x 10 pixels has as many centres in it, give or take half a row and half a column.
    assert num_pixels == pytest.approx(count, rel=0.1 / math.sqrt(50) * 3)


def test_a_few_large_cells_among_many_small_ones_are_all_counted() -> None:
    """They are the first of a batch; a sample would hit or miss them, and they cover most of what is covered."""
    rng = np.random.default_rng(6)
    centers = rng.uniform(-0.35, 0.35, (60_000, 3))
    axes = np.where(np.arange(len(centers)) < 20, 0.08, 0.002)[:, None, None] * np.eye(3)
    batch = place_splats(centers, axes)
    large, small = place_splats(centers[:20], axes[:20]), place_splats(centers[20:], axes[20:])
    total, *parts = (num_pixels_of(draw_list_of(each, 1.0)) for each in (batch, large, small))
    assert total == pytest.approx(sum(parts), rel=0.01)


def test_every_order_is_drawn() -> None:
    batch = place_splats(np.random.default_rng(5).uniform(-0.3, 0.3, (20, 3)), 0.05)
    one, three = (draw_list_of(batch, *shares).typical_seconds for shares in ((1.0,), (0.5, 0.3, 0.2)))
    assert three - 5e-3 == pytest.approx(3 * (one - 5e-3))  # the rest is a frame's


def test_what_is_out_of_view_costs_nothing() -> None:
    batch = place_splats([[50.0, 0, 0]], 0.05)
    assert num_pixels_of(draw_list_of(batch, 1.0)) == 0
    assert draw_list_of(batch, 1.0).typical_seconds == 5e-3  # a frame's alone
