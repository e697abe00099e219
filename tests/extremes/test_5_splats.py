"""Splats of any size, shape and place."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from extremes import Extreme, Measure, Random, Section, worst_drawn
from splat_reference import rasterize_reference
from splatting import look, optical_depth, place_splats, point_at

from renderer.draw import SplatRasterizer
from renderer.scene import SplatSpec
from renderer.splats import SplatBatch
from renderer.view import View
from renderer.volume import Float64

FIRST = np.zeros(1, np.uint32)
DISTANCE = 4.0
# Sums of weights stay thin, so that a pixel's optical depth is known to float32 from its alpha.
THIN = 1e-3


def random_rotation(rng: Random) -> Float64:
    """float64 [3, 3]."""
    rotation, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return np.asarray(rotation)


def axes_px(view: View, rng: Random, sigma_px: float, ratio: float) -> Float64:
    """float64 [1, 3, 3]: the longest standard deviation is `sigma_px` at DISTANCE, others down to 1 / `ratio` of it."""
    per_px = (DISTANCE if view.projection == "perspective" else 1.0) / view.scale_px
    sides = sigma_px * per_px * np.array([1.0, ratio ** -rng.uniform(), 1 / ratio])
    return np.asarray(random_rotation(rng) @ np.diag(rng.permutation(sides)))[None]


def thin_splat(center: Float64, axes: Float64, spec: SplatSpec, view: View) -> SplatBatch:
    """A splat that is thin wherever it is drawn: its optical area is THIN of what it covers, at least of a pixel."""
    batch = place_splats(center, axes, 1.0, spec=spec)
    per_px = (DISTANCE if view.projection == "perspective" else 1.0) / view.scale_px
    sigmas = np.sort(np.linalg.svd(axes[0], compute_uv=False))
    vertices = batch.vertices.copy()
    vertices[:, 3:7] = THIN * max(sigmas[0], 0.5 * per_px) * max(sigmas[1], 0.5 * per_px)
    return replace(batch, vertices=vertices)


def energy_error(gl: SplatRasterizer, batch: SplatBatch, view: View) -> float:
    """Relative difference of the sum of a picture's optical depths from what the splat's optical area asks for."""
    in_view = view.view_from_world(batch.origin + batch.centers[0])
    per_px, slant = 1.0 / view.scale_px, 1.0
    if view.projection == "perspective":
        per_px *= -in_view[2]
        slant = float(np.linalg.norm(in_view) / -in_view[2])
    expected = float(batch.vertices[0, 6]) * slant / per_px**2
    return abs(float(optical_depth(gl.rasterize([batch], [FIRST], view)).sum()) / expected - 1)


def energy(spec: SplatSpec, ratio: float) -> Measure:
    """The relative error: 1/1000 to 12 pixels, anywhere within a pixel, turned in any way, both projections."""

    def error(gl: SplatRasterizer, rng: Random, case: int) -> float:
        view = look("perspective" if case % 2 else "orthographic", size=(96, 96))
        axes = axes_px(view, rng, 10 ** rng.uniform(-3, math.log10(12)), ratio)
        center = point_at(view, *(48 + rng.uniform(-1, 1, 2)), DISTANCE)
        return energy_error(gl, thin_splat(center, axes, spec, view), view)

    return lambda cases: worst_drawn(error)(5 * cases)


def large_energy(spec: SplatSpec) -> Measure:
    """The relative error of a picture's sum: standard deviations from 3 pixels to ten times the picture's side."""

    def error(gl: SplatRasterizer, rng: Random, case: int) -> float:
        view = look("perspective" if case % 2 else "orthographic", size=(48, 48), field_of_view=3.0)
        sigma_px = 10 ** rng.uniform(math.log10(3), math.log10(480))
        axes = axes_px(view, rng, sigma_px, 3.0)
        center = point_at(view, *(24 + sigma_px * rng.uniform(-1, 1, 2)), DISTANCE)
        batch = thin_splat(center, axes, spec, view)
        expected = optical_depth(rasterize_reference(batch, FIRST, view)).sum()
        missing = abs(optical_depth(gl.rasterize([batch], [FIRST], view)).sum() - expected)
        return float(missing / max(expected, THIN))

    return worst_drawn(error)


def behind_the_near_plane(gl: SplatRasterizer, rng: Random, _: int) -> float:
    """The relative error: the near plane 3 standard deviations before the centre to 3 behind it."""
    view = look("orthographic", size=(96, 96), near=DISTANCE)
    axes = axes_px(view, rng, 8.0, 3.0)
    sigma = float(np.linalg.norm(view.forward @ axes[0]))
    a = rng.uniform(-3, 3)
    batch = thin_splat(point_at(view, 48.2, 47.9, DISTANCE - a * sigma), axes, SplatSpec(), view)
    expected = float(batch.vertices[0, 6]) * view.scale_px**2 * 0.5 * math.erfc(a / math.sqrt(2))
    return abs(float(optical_depth(gl.rasterize([batch], [FIRST], view)).sum()) / expected - 1)


def ranges(spec: SplatSpec, most_px: float = math.inf) -> Measure:
    """The error of alpha: focal lengths, or pixels by model unit, from 1e-12 to 1e16, eyes as far as 1e12, where a
    model unit is at most `most_px` pixels long."""

    def error(gl: SplatRasterizer, rng: Random, case: int) -> float:
        distance, scale_px = 10 ** rng.uniform(-2, 12), 10 ** rng.uniform(-12, 16)
        scale_px = min(scale_px, most_px * distance if case % 2 else most_px)
        projection: Any = "perspective" if case % 2 else "orthographic"
        view = View(np.eye(3), np.zeros(3), distance, projection, scale_px, (16, 16))
        axes = random_rotation(rng) @ np.diag(10 ** rng.uniform(-9, 0, 3))
        direction = rng.standard_normal(3) * 10 ** rng.uniform(-12, 0)
        batch = place_splats(np.zeros(3), axes[None], 10 ** rng.uniform(-3, 3), spec=spec)
        vertices = batch.vertices.copy()
        vertices[:, :3] = direction
        batch = replace(batch, vertices=vertices, origin=np.zeros(3))
        image = gl.rasterize([batch], [FIRST], view)
        assert np.isfinite(image).all()
        return float(np.abs(image - rasterize_reference(batch, FIRST, view)).max())

    return lambda cases: worst_drawn(error)(5 * cases)


GOURAUD = SplatSpec("gouraud")

# Of larger triangles devices drop pixels when they clip them.
LARGEST_FAN_PX = 1e7

SECTION = Section(
    "Splats",
    (
        Extreme("1/1000 to 12 pixels, Gaussian, any place in a pixel",
            "widened to 0.5 pixels and scaled, in optical depth", "relative error of the energy", 0.045,
            energy(SplatSpec(), 1.0)),
        Extreme("1/1000 to 12 pixels, ellipsoids of 1000:1, Gaussian", "the shorter side from a Gram determinant",
            "relative error of the energy", 0.045, energy(SplatSpec(), 1000.0)),
        Extreme("1/1000 to 12 pixels, ellipsoids of 1000:1, Gouraud", "widened to 0.85 pixels",
            "relative error of the energy", 0.08, energy(GOURAUD, 1000.0)),
        Extreme("3 pixels to ten times the picture, Gaussian", "quads where points are too small",
            "relative error of the energy in the picture", 1e-5, large_energy(SplatSpec())),
        Extreme("3 pixels to ten times the picture, Gouraud", "triangles",
            "relative error of the energy in the picture", 1e-5, large_energy(GOURAUD)),
        Extreme("the near plane through a splat", "the moments of a truncated normal", "relative error of the energy",
            2e-4, worst_drawn(behind_the_near_plane)),
        Extreme("1e-12 to 1e16 pixels a unit, eyes up to 1e12 units away, Gaussian",
            "footprints in units of their longest side", "error of a channel", 2e-4, ranges(SplatSpec())),
        Extreme("1e-12 to 1e7 pixels a unit, eyes up to 1e12 units away, Gouraud", "as above", "error of a channel",
            2e-4, ranges(GOURAUD, LARGEST_FAN_PX)),
    ),
)  # fmt: skip


@pytest.mark.parametrize("extreme", SECTION.extremes, ids=str)
def test_splats(extreme: Extreme) -> None:
    extreme.check()
