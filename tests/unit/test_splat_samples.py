"""Pixels of splats are means of samples where footprints are narrow: edges, wires, tiles, and the rule."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from film_stages import SPLATS, stage_of
from splatting import in_order, look, place_splats, point_at

from renderer.draw import SplatRasterizer
from renderer.frame import make_primitive, view_of
from renderer.scene import OutputSpec, SplatSpec
from renderer.splats import SplatBatch, samples_across_at
from renderer.view import View
from renderer.volume import Float32, Float64

FOOTPRINTS = ("gaussian", "gouraud")
SIZE = (48, 40)


def drawn(gl: SplatRasterizer, batch: SplatBatch, view: View, across: int) -> Float32:
    batch = replace(batch, samples_across=across)
    return gl.rasterize([batch], [in_order(batch)], view)


def error_db(image: Float32, expected: Float32) -> float:
    return -10 * math.log10(float(np.mean((image.astype(np.float64) - expected) ** 2)))


def front(size: tuple[int, int] = SIZE) -> View:
    return look("orthographic", size=size, azimuth=0.0, elevation=0.0)


def lattice(view: View, columns: Float64, rows: Float64, sigma_px: float, depth: float, footprint: str) -> SplatBatch:
    """Equal splats of one depth, at these places in pixels."""
    places = [point_at(view, column, row, 4.0) for column, row in zip(columns.flat, rows.flat, strict=True)]
    return place_splats(places, sigma_px / view.scale_px, depth, (1.0, 1.0, 1.0), SplatSpec(footprint))  # type: ignore[arg-type]


def wire(view: View, footprint: str) -> SplatBatch:
    """A row of splats 0.3 pixels wide, every tenth of a pixel, nearly along the rows of pixels."""
    columns = np.arange(60, 420) / 10.0
    return lattice(view, columns, 20 + 0.1 * columns, 0.15, 1.0, footprint)


def plate(view: View, footprint: str) -> SplatBatch:
    """An opaque half of the picture whose edge is oblique, of splats half a pixel apart."""
    columns, rows = np.meshgrid(np.arange(12, 84) / 2, np.arange(12, 70) / 2)
    is_inside = columns + 0.4 * rows < 30
    return lattice(view, columns[is_inside], rows[is_inside], 0.21, 3.0, footprint)


@pytest.mark.parametrize(
    ("make", "footprint", "least_db"),
    [(wire, "gaussian", 33.0), (wire, "gouraud", 28.0), (plate, "gaussian", 38.0), (plate, "gouraud", 26.0)],
)
def test_narrow_splats_are_near_their_means_over_pixels(rasterizer, make, footprint: str, least_db: float) -> None:
    """Against the same splats with 64 samples a pixel; one sample is 3 to 13 dB worse."""
    view = front()
    batch = make(view, footprint)
    expected = drawn(rasterizer, batch, view, 8)
    one, several = (error_db(drawn(rasterizer, batch, view, across), expected) for across in (1, 2))
    assert several > least_db
    assert several > one + 3


def test_a_pixel_is_the_mean_of_what_is_displayed(rasterizer: SplatRasterizer) -> None:
    """Samples are those of a picture of twice the size, and light beyond white is cut off before it is averaged."""
    view = front((8, 8))
    bright = lattice(view, np.array([4.0]), np.array([4.0]), 0.4, 1.0, "gaussian")
    vertices = bright.vertices.copy()
    vertices[:, 3:6] *= 5
    bright = replace(bright, vertices=vertices)
    large = np.minimum(drawn(rasterizer, bright, view.magnified(2), 1), 1)
    assert (large[..., 0] == 1).any() and (large[..., 0] < 1).any()
    expected = large.reshape(8, 2, 8, 2, 4).mean(axis=(1, 3))
    np.testing.assert_allclose(drawn(rasterizer, bright, view, 2), expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("footprint", FOOTPRINTS)
@pytest.mark.parametrize("side", [6, 16, 34])
def test_pictures_do_not_depend_on_tiles(rasterizer, monkeypatch, footprint: str, side: int) -> None:
    """Gaussians have the same bytes; triangles are interpolated from where a tile begins."""
    rng = np.random.default_rng(5)
    view = front()
    axes = rng.uniform(0.02, 0.6, (40, 1, 1)) * np.eye(3)
    batch = place_splats(rng.uniform(-1, 1, (40, 3)), axes, 0.4, rng.uniform(0, 1, (40, 3)), SplatSpec(footprint))  # type: ignore[arg-type]
    for across in (1, 2):
        whole = drawn(rasterizer, batch, view, across)
        with monkeypatch.context() as patch:
            patch.setattr(rasterizer, "_tile_side", side)
            tiled = drawn(rasterizer, batch, view, across)
            patch.setattr("renderer.draw.splats.splat_rasterizer.MIN_CHUNK_SPLATS", 8)
            patch.setattr("renderer.draw.splats.splat_rasterizer.splats_per_chunk", lambda *_: 8)
            chunked = drawn(rasterizer, batch, view, across)
        if footprint == "gaussian":
            assert tiled.tobytes() == whole.tobytes()
        np.testing.assert_allclose(tiled, whole, rtol=0, atol=2e-5)
        np.testing.assert_allclose(chunked, whole, rtol=0, atol=2e-5)


@pytest.mark.parametrize("size", [(16384, 1), (1, 16384), (1, 1)])
def test_a_lattice_beyond_a_device_is_drawn_in_tiles(rasterizer: SplatRasterizer, size: tuple[int, int]) -> None:
    """A picture of 16,384 pixels is as one of 64 around the same splat."""
    middle = min(size[0], 64), min(size[1], 64)
    pictures = []
    for view in (replace(front(each), scale_px=100.0) for each in (size, middle)):
        batch = lattice(
            view, np.array([view.size[0] / 2 + 0.3]), np.array([view.size[1] / 2 + 0.3]), 4.0, 1.0, "gaussian"
        )
        pictures.append(drawn(rasterizer, batch, view, 2))
    large, small = pictures
    assert large.shape == (size[1], size[0], 4)
    top, left = (size[1] - middle[1]) // 2, (size[0] - middle[0]) // 2
    part = large[top : top + middle[1], left : left + middle[0]]
    np.testing.assert_allclose(part, small, rtol=0, atol=1e-3)
    assert part.max() > 0.4 and large.sum() == pytest.approx(part.sum())


@pytest.mark.parametrize(
    ("footprint", "tolerance", "cell_px", "across"),
    [
        ("gaussian", 0.1, 1.1, 1),
        ("gaussian", 0.1, 1.0, 2),
        ("gaussian", 0.1, 0.5, 3),
        ("gaussian", 0.3, 0.5, 1),
        ("gaussian", 0.0, 0.0, 4),
        ("gouraud", 0.1, 1.9, 1),
        ("gouraud", 0.1, 1.0, 2),
    ],
)
def test_footprints_that_would_be_widened_get_samples(
    footprint: str, tolerance: float, cell_px: float, across: int
) -> None:
    assert samples_across_at(tolerance, cell_px, SplatSpec(footprint)) == across  # type: ignore[arg-type]


def test_a_scene_of_small_cells_has_samples_and_states_their_work() -> None:
    """Large pictures of the same cells have one sample a pixel."""
    for size, across in (((24, 24), 2), ((400, 400), 1)):
        stage = stage_of(replace(SPLATS, output=OutputSpec(Path("film.mp4"), size)))
        lod = make_primitive(stage).make_lod(0.1, lambda _: None)
        (batch,), view = lod.batches, view_of(stage, 0)
        assert batch.samples_across == across
        alone = replace(lod, batches=[replace(batch, samples_across=1)])
        orders = lod.orders(view)
        assert (lod.num_pixels(orders, view) > 1.2 * alone.num_pixels(orders, view)) == (across > 1)
