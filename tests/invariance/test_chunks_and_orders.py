"""Neither drawing in chunks nor mixing two orders leaves anything out, and orders change without a jump."""

from __future__ import annotations

import numpy as np
import pytest
from splatting import cut_of, in_order, look, place_splats, volume_of

from renderer import raster_gl
from renderer.compositing import LEAST_CHUNK, MEAN_LAYERS, splats_at_once
from renderer.projection import Region, mean_footprint_px, model_view
from renderer.raster_gl import GLRasterizer
from renderer.scene import SplatSpec
from renderer.visibility import FADE_ANGLE, LEVEL, depth_directions


@pytest.mark.parametrize("footprint", ["gaussian", "gouraud"])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_chunks_draw_what_one_go_draws(
    rasterizer: GLRasterizer, monkeypatch: pytest.MonkeyPatch, footprint: str, projection: str
) -> None:
    """Wherever the splats are: in the middle, beside and partly beside the picture, around the eye.

    300 layers at most; they differ by the rounding of float32, 6 u each.
    """
    rng = np.random.default_rng(4)
    for spread in (0.01, 0.1, 1.0, 4.5):
        for target in ((0.0, 0.0, 0.0), (0.9, 0.3, -0.4), (-9.0, 0.0, 2.0)):
            centers = rng.uniform(-spread, spread, (300, 3))
            sigma = spread * rng.uniform(0.02, 0.3)
            batch = place_splats(centers, sigma, 0.1, rng.uniform(0, 1, (300, 3)), SplatSpec(footprint))  # type: ignore[arg-type]
            view = look(projection, target=target)
            whole = rasterizer.rasterize(batch, in_order(batch), view)
            with monkeypatch.context() as patch:
                patch.setattr(raster_gl, "LEAST_CHUNK", 16)
                patch.setattr(raster_gl, "splats_at_once", lambda *_: 16)
                chunked = rasterizer.rasterize(batch, in_order(batch), view)
            np.testing.assert_allclose(chunked, whole, atol=6 * 300 * 2.0**-24)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_the_mean_footprint(projection: str) -> None:
    """Round splats far from the eye, wide and narrow; around the eye none covers more than the region."""
    centers = np.random.default_rng(5).uniform(-1e-3, 1e-3, (9000, 3))
    region = Region(0, 0, 50, 40)
    view = look(projection, distance=4.0)
    for sigma in (0.03, 1e-6):
        batch = place_splats(centers, sigma, 0.1, np.ones((9000, 3)), SplatSpec())
        camera = model_view(batch, view)
        scale_px = camera.scale_px / (4.0 / batch.length if camera.perspective else 1.0)
        radius_px = batch.footprint.cutoff * max(sigma / batch.length * scale_px, batch.footprint.narrowest_px)
        # depths differ by 1e-3 / 4, areas by twice that
        assert mean_footprint_px(batch, in_order(batch), camera, region) == pytest.approx(
            np.pi * radius_px**2, rel=1e-3
        )
    batch = place_splats(100 * centers, 0.1, 0.1, np.ones((9000, 3)), SplatSpec())
    camera = model_view(batch, look(projection, distance=1e-3, size=(2000, 2000)))
    assert mean_footprint_px(batch, in_order(batch), camera, region) == region.num_pixels


@pytest.mark.parametrize(("num_pixels", "footprint_px"), [(1, 1.0), (2000, 8.0), (10**6, 40.0), (10**6, 1e6)])
def test_a_chunk_has_its_layers_or_the_least_number(num_pixels: int, footprint_px: float) -> None:
    num = splats_at_once(num_pixels, footprint_px)
    layers = num * footprint_px / num_pixels
    assert num == LEAST_CHUNK or MEAN_LAYERS * 0.999 < layers <= MEAN_LAYERS


def test_most_views_have_one_order_and_shares_add_up() -> None:
    cut = cut_of(volume_of(np.full((4, 4, 4), 200, np.uint8)), 0.5)
    for projection in ("perspective", "orthographic"):
        for elevation, most in ((0.0, 0.06), (20.0, 0.1)):
            views = [look(projection, azimuth=azimuth, elevation=elevation) for azimuth in np.arange(0, 360, 0.5)]
            mixtures = [depth_directions(cut, view) for view in views]
            for shares in ([each.share for each in mixture] for mixture in mixtures if mixture):
                assert sum(shares) == pytest.approx(1, abs=1e-15)
                assert min(shares) > 0
            assert np.mean([len(mixture) > 1 for mixture in mixtures]) <= most


def test_an_order_fades_in_over_the_fade_angle() -> None:
    """Turning past azimuth 90 at elevation 20, where steps along y are level."""
    cut = cut_of(volume_of(np.full((4, 4, 4), 200, np.uint8)), 0.5)
    degrees = np.degrees(FADE_ANGLE) * np.linspace(-1.5, 1.5, 301)
    shares = []
    for azimuth in 90 + degrees:
        view = look(azimuth=azimuth, elevation=20.0)
        directions = [(each.share, each.direction[1]) for each in depth_directions(cut, view)]
        shares.append(sum(share for share, slope in directions or [(1.0, view.forward[1])] if slope > LEVEL))
    assert {shares[0], shares[-1]} == {0.0, 1.0}
    assert np.abs(np.diff(shares)).max() < 0.011
