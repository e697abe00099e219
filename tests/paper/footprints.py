"""Figure 1: draw one splat as fans of Gouraud-shaded triangles, coarse to fine, and as a Gaussian."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from figure import Claim, FigureRenderer, FigureStage, PaperFigure

from hsplat_cli.reports import SERIES, Chart, Curve, linear_axis
from renderer.film import Pixels
from renderer.frame import view_of
from renderer.scene import Scene
from renderer.splats import GouraudFootprint
from renderer.volume import Float64

# Angular and radial subdivisions.
SUBDIVISIONS = ((4, 1), (6, 2), (8, 3), (12, 5), (16, 8), (32, 16))
# Indices of those in the plot.
SHOWN_FANS = (0, 2, 5)
# The integral of fans with at least this many triangles must be exact to this share.
MIN_TRIANGLES, MAX_INTEGRAL_ERROR = 40, 0.05
# Share of the peak by which the finest fan may deviate from the smooth profile.
MAX_DEVIATION = 0.02


@dataclass(frozen=True)
class FootprintError:
    """A footprint that draws the splat, and its error against the smooth profile.

    deviation: largest difference of a pixel's alpha, as a share of the profile's peak.
    integral_error: relative error of the sum of all alphas.
    radii, alphas: float64 [n], of the pixels to the right of the centre; radii in standard deviations.
    """

    name: str
    num_triangles: int
    deviation: float
    integral_error: float
    radii: Float64
    alphas: Float64
    picture: Pixels

    @property
    def caption(self) -> str:
        """Return the name, with the number of triangles of a fan."""
        return f"{self.name}, {self.num_triangles} triangles" if self.num_triangles else self.name


def make_figure(scene: Scene, figure_renderer: FigureRenderer) -> PaperFigure:
    """Return figure 1 for a scene of one splat."""
    drawn, smooth = measure(scene, figure_renderer)
    return PaperFigure(
        "Splat shapes and footprints",
        "One splat, drawn as a fan of Gouraud-shaded triangles around its centre, at several angular and radial "
        "subdivisions. The vertices have the opacities of a smooth profile; the hardware interpolates between them.",
        check_claims(drawn[:-1]),
        {"The same splat": [(item.picture, item.caption) for item in drawn]},
        charts=(_profiles(drawn, smooth),),
        drawings=_meshes(scene),
        tables={
            "Error against the smooth profile, over all pixels": [
                {
                    "footprint": item.name,
                    "triangles": f"{item.num_triangles or '-'}",
                    "largest deviation, of the peak": f"{item.deviation:.2%}",
                    "error of the integral": f"{item.integral_error:+.2%}",
                }
                for item in drawn
            ]
        },
        notes=(
            "The Gaussian of hsplat is slightly broader in the middle than a plain one: two zeros in its spectrum keep "
            "grids of splats from rippling. Its optical depth is the same; its deviation is that difference.",
        ),
    )


def measure(scene: Scene, figure_renderer: FigureRenderer) -> tuple[list[FootprintError], Float64]:
    """Draw the splat with each footprint.

    Return the fans by number of triangles, and the Gaussian last; and the smooth profile, float64 [n, 2]: radius in
    standard deviations, alpha.
    """
    with figure_renderer.open_stage(scene) as stage:
        drawn = []
        for angular, radial in SUBDIVISIONS:
            keys = {"footprint": "gouraud", "angular": angular, "radial": radial}
            drawn.append(_measure_footprint(stage, f"fan {angular} x {radial}", angular * (2 * radial - 1), keys))
        drawn.append(_measure_footprint(stage, "Gaussian", 0, {"footprint": "gaussian"}))
        return drawn, np.column_stack(_smooth_profile(stage))


def check_claims(fans: Sequence[FootprintError]) -> tuple[Claim, ...]:
    """Compare the fans with the paper's claims."""
    deviations = [fan.deviation for fan in fans]
    fine = [abs(fan.integral_error) for fan in fans if fan.num_triangles >= MIN_TRIANGLES]
    return (
        Claim(
            "A splat can be drawn as a collection of Gouraud-shaded polygons; with more polygons it approaches a "
            "smooth Gaussian footprint.",
            f"the largest deviation falls with every subdivision, and ends below {MAX_DEVIATION:.0%} of the peak",
            " > ".join(f"{deviation:.1%}" for deviation in deviations),
            all(after < before for before, after in pairwise(deviations)) and deviations[-1] < MAX_DEVIATION,
        ),
        Claim(
            "A few dozen triangles are enough for a splat to contribute the right amount to the picture.",
            f"with {MIN_TRIANGLES} triangles or more the integral is right within {MAX_INTEGRAL_ERROR:.0%}",
            f"at most {max(fine):.2%} off",
            max(fine) < MAX_INTEGRAL_ERROR,
        ),
    )


def _smooth_profile(stage: FigureStage) -> tuple[Float64, Float64]:
    """Return radius in standard deviations and alpha, float64 [n] each, of the profile that the triangles approximate.

    The profile's mass and second moment over the disc are the splat's, as in `renderer.splats.splats`.
    """
    u = np.linspace(0, 1, 4001)
    weight = np.interp(u, *np.array(stage.base.scene.splat.profile, np.float64).T)
    mass = 2 * math.pi * np.trapezoid(weight * u, u)
    radius = math.sqrt(mass / (math.pi * np.trapezoid(weight * u**3, u)))  # in standard deviations
    total = stage.extinction * stage.base.layers[0].volume.voxel_volume
    depth = total / _sigma(stage) ** 2 * weight / (mass * radius**2)
    return np.append(u * radius, math.inf), np.append(-np.expm1(-depth), 0.0)


def _sigma(stage: FigureStage) -> float:
    """Return the standard deviation of the splat, in world units."""
    return float(stage.base.scene.splat.sigma * np.cbrt(stage.base.layers[0].volume.voxel_volume))


def _measure_footprint(stage: FigureStage, name: str, num_triangles: int, keys: dict[str, Any]) -> FootprintError:
    frame, view = stage.draw(**keys), view_of(stage.base, 0)
    assert frame.num_primitives == 1 and view.projection == "orthographic"
    width, height = view.size
    x, y = (np.arange(side) + 0.5 - side / 2 for side in view.size)
    distance = np.hypot(*np.meshgrid(x, y)) / (_sigma(stage) * view.scale_px)
    radii, profile = _smooth_profile(stage)
    smooth, alpha = np.interp(distance, radii, profile), frame.radiance[..., 3].astype(np.float64)
    deviation = float(np.abs(alpha - smooth).max() / profile[0])
    right = (height // 2, slice(width // 2, None))
    error = float(alpha.sum() / smooth.sum() - 1)
    return FootprintError(name, num_triangles, deviation, error, distance[right], alpha[right], frame.image)


def _profiles(drawn: Sequence[FootprintError], smooth: Float64) -> Chart:
    fans = [drawn[k] for k in SHOWN_FANS]
    gaussian = drawn[-1]
    curves = [Curve(fan.caption, _points(fan.radii, fan.alphas), SERIES[k]) for k, fan in enumerate(fans)]
    curves.append(Curve(gaussian.name, _points(gaussian.radii, gaussian.alphas), SERIES[3], dash="2 3"))
    curves.append(Curve("smooth profile", _points(*smooth[:-1].T), SERIES[7], dash="7 3"))
    return Chart(
        linear_axis("distance from the centre, standard deviations", drawn[0].radii.tolist()),
        linear_axis("alpha", [alpha for each in drawn for alpha in each.alphas.tolist()]),
        curves,
        "Alpha over the distance from the centre, to the right.",
        "Alpha over the distance from the centre, for three fans, the Gaussian and the smooth profile",
    )


def _points(across: Float64, up: Float64) -> list[tuple[float, float]]:
    return list(zip(across.tolist(), up.tolist(), strict=True))


def _meshes(scene: Scene) -> list[tuple[str, str]]:
    """Return the triangles of each fan as a path, all at one scale, and its subdivisions."""
    meshes = []
    for angular, radial in SUBDIVISIONS:
        footprint = GouraudFootprint.from_spec(replace(scene.splat, angular=angular, radial=radial))
        meshes.append((footprint.vertices[footprint.triangles], f"{angular} x {radial}"))
    reach = max(float(np.abs(corners).max()) for corners, _ in meshes)
    return [(_triangles(corners / reach), caption) for corners, caption in meshes]


def _triangles(corners: Float64) -> str:
    """Return a path of triangles, [n, 3, 2]."""
    return "".join(f"M{'L'.join(f'{x:.3f} {y:.3f}' for x, y in triangle)}Z" for triangle in corners.tolist())
