"""The GL rasteriser against the reference, pixel by pixel.

Errors are compared with the largest alpha of the picture. PRECISION is that of float32: a footprint's place is known to
a few ulps of a coordinate, 2^-24 * 100 px each, and its slope is at most 1.2 per pixel at the narrowest standard
deviation of 0.5 px. Worst seen on llvmpipe: 2.6e-5, where only the tail of a splat is in the picture.

Where a footprint ends abruptly (the rim of a profile that does not fall to 0), a pixel on that edge may fall to either
side; a Gaussian ends where its weight less that of its rim is 0, which float32 knows to some 1e-7 of the peak. What
that may change is the difference between two references whose edge lies EDGE further in and out.

Gouraud triangles are covered on the device's grid of subpixels (GL guarantees 1/16 px, llvmpipe has 1/256 px): a pixel
that close to an edge may be drawn by the triangle next to it, whose plane there is off by SUBPIXEL times the slope.
That concerns few pixels. Worst seen on llvmpipe: 1.2e-3 of the peak.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from splat_reference import rasterize_reference
from splatting import in_order, look, place_splats, point_at

from renderer.draw import SplatRasterizer
from renderer.scene import SplatSpec
from renderer.splats import GaussianFootprint, SplatBatch
from renderer.view import View
from renderer.volume import Float32, Float64

PRECISION = 4e-5
EDGE = 1e-4
SUBPIXEL = 1 / 256
LARGEST_SHARE_BESIDE_EDGES = 0.03

FOOTPRINTS = ("gaussian", "gouraud")
PROJECTIONS = ("perspective", "orthographic")
STEP = SplatSpec("gouraud", profile=((0.0, 1.0), (1.0, 1.0)))


def with_edge(batch: SplatBatch, factor: float) -> SplatBatch:
    """The same splats, ending a little further in or out; Gaussians at a weight of 0, which moves all others by 5e-7 of
    the largest: about as much as float32 leaves of their difference from the rim."""
    footprint = batch.footprint
    if isinstance(footprint, GaussianFootprint):
        cutoff = footprint.cutoff * factor
        at_cutoff = np.polynomial.polynomial.polyval(cutoff**2, footprint.coefficients)
        rim = math.exp(-footprint.decay * cutoff**2) * float(at_cutoff)
        return replace(batch, footprint=replace(footprint, cutoff=cutoff, rim=rim))
    return replace(batch, footprint=replace(footprint, vertices=footprint.vertices * factor))


def assert_parity(
    gl: SplatRasterizer,
    batch: SplatBatch,
    view: View,
    what: object = "",
    *,
    precision: float = PRECISION,
    edge: float = EDGE,
) -> Float32:
    """Both rasterisers draw the same picture, which is returned."""
    order = in_order(batch)
    image, expected = gl.rasterize([batch], [order], view), rasterize_reference(batch, order, view)
    assert image.dtype == np.float32
    assert np.isfinite(image).all(), what
    peak = expected[..., 3].max()
    excess = np.abs(image - expected) - precision * peak
    if isinstance(batch.footprint, GaussianFootprint) or batch.footprint.weights.min() > 0:
        band = [rasterize_reference(with_edge(batch, factor), order, view) for factor in (1 - edge, 1 + edge)]
        excess -= np.abs(band[1] - band[0])
    if not isinstance(batch.footprint, GaussianFootprint):
        beside_edges = np.any(excess > 0, axis=2)
        # 4 of a mesh of few pixels, all of which lie beside an edge.
        assert np.sum(beside_edges) <= 4 + LARGEST_SHARE_BESIDE_EDGES * np.sum(expected[..., 3] > 0), what
        # Slope of a fan: its peak over a third of its radius, which is 2.4 standard deviations or more.
        excess -= peak * SUBPIXEL / (2.4 * batch.footprint.min_sigma_px / 3)
    worst = np.unravel_index(excess.argmax(), excess.shape)
    assert excess[worst] <= 0, f"{what}: {image[worst]} instead of {expected[worst]} at {worst}, peak {peak}"
    return image


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_one_splat_of_any_size_at_any_place(rasterizer: SplatRasterizer, footprint: str, projection: str) -> None:
    view = look(projection, size=(64, 48))
    for sigma_px in (1e-3, 0.45, 0.55, 3.7, 20.0, 192.0):
        sigma = sigma_px * np.linalg.norm(point_at(view, 1, 0, 4.0) - point_at(view, 0, 0, 4.0))
        outside = 1.5 * max(sigma_px, 0.5)
        for column, row in (
            (32.0, 24.0), (31.5, 23.5), (30.27, 21.81), (0.0, 20.1), (64.0, 48.0),
            (-outside, 24.2), (64 + outside, 10.4), (20.3, -outside), (33.3, 48 + outside),
            (-outside, 48 + outside), (64 + 9 * outside, 24.0),
        ):  # fmt: skip
            batch = place_splats(point_at(view, column, row, 4.0), sigma, spec=SplatSpec(footprint))  # type: ignore[arg-type]
            assert_parity(rasterizer, batch, view, (sigma_px, column, row))


def random_axes(rng: np.random.Generator, num: int, sigma: float, stretch: float) -> Float64:
    """float64 [num, 3, 3]: oblique, sheared, of either hand, each direction up to `stretch` times longer or shorter."""
    skewed = np.eye(3) + 0.4 * rng.standard_normal((num, 3, 3))
    return sigma * skewed * stretch ** rng.uniform(-1, 1, (num, 1, 3)) * rng.choice([-1, 1], (num, 1, 3))


@pytest.mark.parametrize("footprint", FOOTPRINTS)
@pytest.mark.parametrize(
    ("sigma", "stretch", "projection"),
    [(0.002, 3.0, "perspective"), (0.03, 1.5, "orthographic"), (0.03, 30.0, "perspective"), (0.3, 3.0, "orthographic"),
        (1.0, 20.0, "perspective")],
)  # fmt: skip
def test_splats_of_any_shape_on_top_of_each_other(
    rasterizer: SplatRasterizer, footprint: str, projection: str, sigma: float, stretch: float
) -> None:
    rng = np.random.default_rng(7)
    num = 120
    spec = SplatSpec(footprint, angular=6, radial=2)  # type: ignore[arg-type]
    batch = place_splats(
        rng.uniform(-1.2, 1.2, (num, 3)),
        random_axes(rng, num, sigma, stretch),
        10 ** rng.uniform(-3, 1, num),
        rng.uniform(0, 1, (num, 3)),
        spec,
    )
    assert_parity(rasterizer, batch, look(projection, near=3.9))


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_the_near_plane_cuts_splats(rasterizer: SplatRasterizer, footprint: str, projection: str) -> None:
    """Centres from 6 standard deviations before the plane to 6 behind it, looked at along an oblique Gaussian's axes.

    Where nearly all is cut off, its moments are differences of larger numbers. Worst seen: 6.4e-5, at 3.9 deviations.
    """
    rng = np.random.default_rng(3)
    for near, sigma in ((0.0, 0.3), (0.5, 0.3), (0.5, 1e-3)):
        view = look(projection, near=near)
        for axes in random_axes(rng, 2, sigma, 2.0):
            sigma_depth = float(np.linalg.norm(view.forward @ axes))
            for a in (6.0, 3.9, 2.0, 0.5, 0.0, -0.5, -2.0, -4.9, -5.1, -6.0):
                center = point_at(view, 32.0, 24.0, near - a * sigma_depth)
                batch = place_splats(center, axes[None], spec=SplatSpec(footprint))  # type: ignore[arg-type]
                if a <= 4:
                    assert_parity(rasterizer, batch, view, (near, sigma, a), precision=2e-4 if a > 0 else PRECISION)
                else:
                    assert not rasterizer.rasterize([batch], [in_order(batch)], view).any()
                    missing = rasterize_reference(batch, in_order(batch), view)[..., 3].max()
                    assert missing < 0.5 * math.erfc(4 / math.sqrt(2))


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_splats_behind_the_eye_or_without_extinction_leave_nothing(rasterizer, projection: str) -> None:
    """The reference sees the tail of the normal distribution, where float64 can hold it."""
    view = look(projection)
    for depth in (-2.0, -300.0):
        batch = place_splats(point_at(view, 32.0, 24.0, depth), 0.2)
        assert not rasterizer.rasterize([batch], [in_order(batch)], view).any()
        assert rasterize_reference(batch, in_order(batch), view).max() < 1e-20
    for footprint in FOOTPRINTS:
        batch = place_splats(np.zeros((2, 3)), 0.2, 0.0, spec=SplatSpec(footprint))  # type: ignore[arg-type]
        assert not rasterizer.rasterize([batch], [in_order(batch)], view).any()


def test_a_profile_that_ends_in_a_step(rasterizer: SplatRasterizer) -> None:
    """A disc of constant opacity: its rim is as sharp as the mesh, its inside has no seam between triangles."""
    view = look(size=(128, 96))
    for sigma in (0.02, 0.1, 0.4):
        batch = place_splats(point_at(view, 61.27, 49.81, 4.0), sigma, spec=STEP)
        sigma_px = sigma / np.linalg.norm(point_at(view, 1, 0, 4.0) - point_at(view, 0, 0, 4.0))
        image = assert_parity(rasterizer, batch, view, sigma, edge=SUBPIXEL / (batch.footprint.cutoff * sigma_px))
        inside = image[..., 3][image[..., 3] > 0]
        np.testing.assert_allclose(inside, inside[0], rtol=1e-6)


@pytest.mark.parametrize("largest_point_px", [1.0, 6.5])
def test_quads_draw_what_points_draw(rasterizer, monkeypatch, largest_point_px: float) -> None:
    """To the byte, in the same place in the order, whatever the driver's largest point is."""
    rng = np.random.default_rng(11)
    axes = random_axes(rng, 150, 0.05, 3.0)
    batch = place_splats(rng.uniform(-1.5, 1.5, (150, 3)), axes, 1.0, rng.uniform(0, 1, (150, 3)))
    for view in (look(near=3.9), look("orthographic")):
        points = rasterizer.rasterize([batch], [in_order(batch)], view)
        with monkeypatch.context() as patch:
            patch.setattr(rasterizer, "_largest_point_px", largest_point_px)
            quads = rasterizer.rasterize([batch], [in_order(batch)], view)
        assert points[..., 3].max() > 0.5
        assert points.tobytes() == quads.tobytes()
