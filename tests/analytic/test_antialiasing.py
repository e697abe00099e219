"""Pixels are means over their area: edges, wires and discs against their coverage."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from brickwork import alone, bricks_of, level_cut, ordered, placed, transfer_of
from pixel_areas import coverage, turned

from renderer.bricks import BrickBatch, ScreenSampling, screen_sampling_at
from renderer.draw import BrickRasterizer
from renderer.view import View
from renderer.volume import Array, Float64, Volume

WHITE = (1.0, 1.0, 1.0)
# Opaque from one half on: 40 in an optical depth of a voxel.
OPAQUE = transfer_of((0, WHITE, 0.0), (0.5, WHITE, 0.0), (0.5, WHITE, 40.0), (1, WHITE, 40.0))
LADDER = screen_sampling_at(0.1, 1.0)
ONE_RAY = ScreenSampling((1,), 0.0, 0.0)


def batch_of(volume: Volume, sampling: ScreenSampling = LADDER) -> BrickBatch:
    bricks = bricks_of(volume, OPAQUE)
    cut = level_cut(bricks, 0)
    return BrickBatch(cut, alone(bricks), np.full(len(cut), 0.25), sampling, volume.centre, volume.half_diagonal)


def alphas(rasterizer: BrickRasterizer, batch: BrickBatch, view: View) -> Float64:
    return rasterizer.rasterize([batch], [ordered(batch.cut, view)], view)[..., 3].astype(np.float64)


def plates(shown: Array) -> Volume:
    """Four equal planes along z of pixels [y, x]."""
    return placed(np.repeat(shown[None].astype(np.float32), 4, axis=0))


@pytest.mark.parametrize("degrees", [0.0, 3.0, 30.0, 45.0, 90.0])
def test_an_edge_has_the_coverage_of_its_pixels(brick_rasterizer: BrickRasterizer, degrees: float) -> None:
    """Half a plane that ends at x = 1/2, a surface of the field between two voxels: 16 rays tell it within 1/16."""
    x = np.arange(48)
    volume = plates(np.broadcast_to(x > 23.5, (48, 48)))
    view = turned(volume, degrees, voxels_per_px=1.7, size=(14, 14))
    expected = coverage(view, lambda x, y: (x > 0) & (abs(x) < 24) & (abs(y) < 24))
    error = np.abs(alphas(brick_rasterizer, batch_of(volume), view) - expected)
    assert error.max() < 1.5 / 16 and np.sqrt((error**2).mean()) < 0.02
    one = alphas(brick_rasterizer, batch_of(volume, ONE_RAY), view)
    assert degrees % 90 == 0 or np.abs(one - expected).max() > 0.3


@pytest.mark.parametrize("width", [1, 2, 3, 7])
@pytest.mark.parametrize("degrees", [0.5, 4.0, 27.0])
def test_no_wire_is_dashed(brick_rasterizer: BrickRasterizer, width: int, degrees: float) -> None:
    """Wires of an eighth of a pixel to 0.9 pixels: along each of them, no group of four pixels loses a part."""
    shown = np.zeros((17, 400))
    shown[8 - width // 2 : 8 - width // 2 + width] = 1
    volume = plates(shown)
    view = turned(volume, degrees, voxels_per_px=8.0, size=(44, 28))
    image = alphas(brick_rasterizer, batch_of(volume, screen_sampling_at(0.1, 1 / 8)), view)
    expected = coverage(view, lambda x, y: (np.abs(y + 0.5 * (width % 2 == 0)) < width / 2) & (np.abs(x) < 190), 32)
    along = image.sum(axis=0)[6:-6].reshape(-1, 4).mean(axis=1)
    wanted = expected.sum(axis=0)[6:-6].reshape(-1, 4).mean(axis=1)
    assert np.abs(along / wanted - 1).max() < 0.3
    assert -10 * math.log10(((image - expected)[:, 6:-6] ** 2).mean()) > 35


@pytest.mark.parametrize("degrees", [44.8, 45.0, 135.0])
def test_a_wire_between_the_four_rays_of_pixels_is_drawn(brick_rasterizer: BrickRasterizer, degrees: float) -> None:
    """A wire of 0.28 pixels through the centres of pixels on a diagonal: only the first ray of each meets it."""
    shown = np.zeros((51, 1250))
    shown[22:29] = 1
    volume = plates(shown)
    view = turned(volume, degrees, voxels_per_px=25.0, size=(28, 28))
    image = alphas(brick_rasterizer, batch_of(volume, screen_sampling_at(0.1, 1 / 25)), view)
    expected = coverage(view, lambda x, y: (np.abs(y) < 3.5) & (np.abs(x) < 600), 32)
    assert -10 * math.log10(((image - expected) ** 2).mean()) > 38


def test_a_disc_has_the_coverage_of_its_pixels(brick_rasterizer: BrickRasterizer) -> None:
    y, x = np.indices((64, 64)) - 31.5
    volume = plates(np.clip(20.5 - np.hypot(x, y), 0, 1))
    view = turned(volume, 10.0, voxels_per_px=1.3, size=(40, 40))
    error = alphas(brick_rasterizer, batch_of(volume), view) - coverage(view, lambda x, y: np.hypot(x, y) < 20)
    assert np.sqrt((error**2).mean()) < 0.015


def test_even_pixels_have_one_ray(brick_rasterizer: BrickRasterizer) -> None:
    """A slope below the threshold has the bytes of one ray a pixel."""
    volume = placed(np.tile(np.linspace(0, 1, 64, dtype=np.float32), (8, 64, 1)))
    fog = transfer_of((0, WHITE, 0.0), (1, WHITE, 0.2))
    bricks = bricks_of(volume, fog)
    cut = level_cut(bricks, 0)
    view = turned(volume, 0.0, voxels_per_px=1.5, size=(32, 32))
    pictures = []
    for sampling in (LADDER, ONE_RAY):
        batch = BrickBatch(cut, alone(bricks), np.ones(len(cut)), sampling, volume.centre, volume.half_diagonal)
        pictures.append(brick_rasterizer.rasterize([batch], [ordered(cut, view)], view))
    assert pictures[0][:, 2:-2].tobytes() == pictures[1][:, 2:-2].tobytes()


@pytest.mark.parametrize(
    ("sampling", "num_rays"),
    [
        (ONE_RAY, 32 * 32),
        (ScreenSampling((1,), 0.0, 0.0, -1.0, 2.0), (1 + 4) * 32 * 32),
        (ScreenSampling((1,), 0.0, 0.0, -1.0, -1.0), (1 + 4 + 16) * 32 * 32),
        (ScreenSampling((4,), 0.0, 0.0), 9 * 9),
        (ScreenSampling((4, 2), 2.0, 0.0), 9 * 9),
    ],
)
def test_rays_are_counted(brick_rasterizer: BrickRasterizer, sampling: ScreenSampling, num_rays: int) -> None:
    """Thresholds below 0 are exceeded by every pixel, those above 1 by none."""
    volume = placed(np.tile(np.linspace(0, 1, 64, dtype=np.float32), (8, 64, 1)))
    before = brick_rasterizer.num_rays
    alphas(brick_rasterizer, batch_of(volume, sampling), turned(volume, 0.0, voxels_per_px=1.5, size=(32, 32)))
    assert brick_rasterizer.num_rays - before == num_rays


@pytest.mark.parametrize("num_threads", [1, 3])
def test_pictures_do_not_depend_on_threads_and_memory(num_threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    y, x = np.indices((64, 64)) - 31.5
    volume = plates(np.clip(20.5 - np.hypot(x, y), 0, 1))
    batch, view = batch_of(volume), turned(volume, 10.0, voxels_per_px=0.5, size=(90, 90))
    with BrickRasterizer(num_threads=2) as rasterizer:
        expected = alphas(rasterizer, batch, view)
        num_rays = rasterizer.num_rays
    monkeypatch.setattr("renderer.draw.bricks.antialiasing._PIXELS_AT_ONCE", 17)
    with BrickRasterizer(num_threads=num_threads) as rasterizer:
        assert alphas(rasterizer, replace(batch), view).tobytes() == expected.tobytes()
        assert rasterizer.num_rays == num_rays > 90 * 90
