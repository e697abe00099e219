"""Splats of any size, shape and place, and orders that change while the camera turns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from extremes import Extreme, Measure, Random, Section, worst_drawn
from splat_reference import rasterize_reference
from splatting import look, optical_depth, place_splats, point_at, volume_of

from renderer.draw import SplatRasterizer
from renderer.pyramid import Cut, build_pyramid, cut_pyramid
from renderer.scene import (
    CameraSpec,
    ControlPoint,
    ErrorSpec,
    KeyframePath,
    PyramidSpec,
    SplatSpec,
    TransferSpec,
    TurntablePath,
    Vector,
)
from renderer.scene.camera_section import Keyframe
from renderer.splats import SplatBatch, make_splats
from renderer.transfer import make_transfer_function
from renderer.view import OrderBlending, View, blended_orders, make_order_blending, make_view
from renderer.volume import Float32, Float64

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


def opaque_noise(size: int, edges: Float64) -> Cut:
    """Voxels of three opaque colours, half of them empty; edges: float64 [3, 3], those of a voxel as columns."""
    colors = ((128, (1.0, 0.1, 0.1)), (192, (0.1, 1.0, 0.1)), (255, (0.1, 0.1, 1.0)))
    points = (ControlPoint(127, (0.0, 0.0, 0.0), 0.0), *(ControlPoint(v, color, 0.9) for v, color in colors))
    affine = np.eye(4)
    affine[:3, :3] = edges
    volume = volume_of(np.random.default_rng(1).integers(0, 256, (size,) * 3, np.uint8), affine)
    transfer = make_transfer_function(TransferSpec(points, 1.0), 1.0)
    return cut_pyramid(build_pyramid(volume, transfer, spec=PyramidSpec(), error=ErrorSpec(), num_threads=1), 0.0)


@dataclass(frozen=True)
class Turn:
    """A path of 0.01 degrees a frame around splats."""

    gl: SplatRasterizer
    cut: Cut
    camera: CameraSpec

    def changes(self, first: int, num: int = 1) -> float:
        """The largest change of any channel of any pixel from one frame to the next, of `num` from `first` on."""
        pictures = [self._picture(frame) for frame in range(first, first + num + 1)]
        return max(float(np.abs(after - before).max()) for before, after in pairwise(pictures))

    def _picture(self, frame: int) -> Float32:
        view = make_view(self.camera, frame % self.camera.path.frames, self.target, self.distance, (128, 128))
        orders = blended_orders(self.splats, view, self.turning)
        return np.sum([share * self.gl.rasterize([self.splats], [order], view) for share, order in orders], axis=0)

    @cached_property
    def splats(self) -> SplatBatch:
        return make_splats(self.cut, SplatSpec())

    @cached_property
    def turning(self) -> OrderBlending:
        return make_order_blending(self.cut.volume.world_from_index, self.camera.path)

    @property
    def target(self) -> Vector:
        x, y, z = self.cut.volume.centre.tolist()
        return x, y, z

    @property
    def distance(self) -> float:
        return 4.5 * self.splats.model_unit


def turntable(elevation: float) -> TurntablePath:
    return TurntablePath(36000, elevation=elevation)


def over_the_poles(azimuth: float) -> KeyframePath:
    """From one pole to the other."""
    keys = (Keyframe(0, azimuth, -90.0), Keyframe(18000, azimuth, 90.0))
    return KeyframePath(18001, keys, loop=False, easing="linear")


SHEARED = np.array([[1.0, math.sin(math.radians(20)), 0.0], [0.0, math.cos(math.radians(20)), 0.0], [0.0, 0.0, 1.0]])

# Paths, and frames next to which neighbours change their order: azimuths, or elevations from -90, times 100.
EIGHTHS = range(0, 36000, 4500)
TURNS: tuple[tuple[TurntablePath | KeyframePath, Float64, Sequence[int]], ...] = (
    (turntable(20.0), np.eye(3), EIGHTHS),
    (turntable(0.0), np.eye(3), EIGHTHS),
    (turntable(-0.7), np.eye(3), EIGHTHS),
    (turntable(45.0), np.eye(3), EIGHTHS),
    (turntable(88.0), np.eye(3), EIGHTHS),
    (turntable(90.0), np.eye(3), EIGHTHS),
    (turntable(20.0), SHEARED, (0, 9000, 18000, 20000, 29000)),
    (over_the_poles(0.0), np.eye(3), (4500, 9000, 13500)),
    (over_the_poles(45.0), np.eye(3), (9000, 9000 + 3526)),
)


def popping(cases: int) -> float:
    """Largest change where neighbours change their order over the largest elsewhere; the worst of all paths."""
    rng = np.random.default_rng(9)
    is_short = cases < 100
    ratios = []
    with SplatRasterizer() as gl:
        for number, (path, edges, crossings) in enumerate(TURNS[:2] if is_short else TURNS):
            cut = opaque_noise(12, edges)
            projection: Any = ("perspective", "orthographic")[number % 2]
            turn = Turn(gl, cut, CameraSpec(path, projection=projection))
            usual = max(turn.changes(int(frame)) for frame in rng.integers(0, path.frames - 1, cases // 2))
            worst = 0.0
            for crossing in crossings[1:3] if is_short else crossings:
                fading = np.arange(-120, 120, 80 if is_short else 15) + crossing
                worst = max(worst, turn.changes(crossing - 3, 5), *(turn.changes(int(frame)) for frame in fading))
            ratios.append(worst / usual)
    return max(ratios)


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
        Extreme("turning past 45 and 90 degrees by 0.01, and past other lattice planes: opaque noise, 128 pixels",
            "near such a view, a mixture of the orders before and after",
            "largest change of a pixel, over that elsewhere", 2.0, popping),
    ),
)  # fmt: skip


@pytest.mark.parametrize("extreme", SECTION.extremes, ids=str)
def test_splats(extreme: Extreme) -> None:
    extreme.check()
