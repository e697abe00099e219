"""Figure 1: one splat as fans of few and of many Gouraud-shaded triangles, and as a Gaussian."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from hsplat_cli.studies.paper.figure_renderer import Studio, transfer_of, with_splat
from hsplat_cli.studies.paper.paper_figure import Chart, Claim, Figure, Picture, Pixels, Row, Table
from hsplat_cli.terminal import counted
from renderer.errors import InputError
from renderer.frame import Stage, view_of
from renderer.scene import Scene
from renderer.splats import GouraudFootprint, make_footprint

Float64 = npt.NDArray[np.float64]

# Angular and radial subdivisions of the fans.
SUBDIVISIONS = ((4, 1), (6, 2), (8, 3), (12, 5), (16, 8), (32, 16))
# Fans of at least so many triangles are expected to keep a splat's integral to this share.
MIN_TRIANGLES, MAX_INTEGRAL_ERROR = 40, 0.05
# Of the peak; the finest fan is expected to be this near to the smooth profile.
MAX_DEVIATION = 0.02
# Rings of pixels, by their distance from the centre, in which the plot shows mean, least and largest.
NUM_RINGS = 48


@dataclass(frozen=True)
class Footprint:
    """One way to draw the splat.

    deviation: largest difference of a pixel's alpha from the smooth profile's, as a share of the peak of that.
    integral_error: of the sum of all alphas, relative to that of the smooth profile.
    radii: float64 [n], of rings of pixels, in standard deviations. alphas: float64 [n, 3], mean, least, largest there.
    """

    name: str
    num_triangles: int
    deviation: float
    integral_error: float
    radii: Float64
    alphas: Float64
    picture: Pixels


@dataclass(frozen=True)
class Footprints:
    """fans: by rising number of triangles. smooth: radius in standard deviations and alpha of the profile itself."""

    fans: tuple[Footprint, ...]
    gaussian: Footprint
    smooth: Float64


def make(scene: Scene, studio: Studio) -> Figure:
    """The figure for a scene of one splat."""
    numbers = measure(scene, studio)
    drawn = (*numbers.fans, numbers.gaussian)
    return Figure(
        1,
        "Splat shapes and footprints",
        "One splat, drawn as a fan of Gouraud-shaded triangles around its centre, at several subdivisions by angle and "
        "by radius. The opacities of the vertices are those of a smooth profile; the hardware interpolates between.",
        judge(numbers),
        rows=(Row("The same splat", tuple(Picture(item.picture, _caption(item)) for item in drawn)),),
        charts=(_profiles(numbers), _meshes(scene)),
        tables=(
            Table(
                "Against the smooth profile, at every pixel",
                ("footprint", "triangles", "largest deviation, of the peak", "error of the integral"),
                tuple(
                    (item.name, f"{item.num_triangles or '-'}", f"{item.deviation:.2%}", f"{item.integral_error:+.2%}")
                    for item in drawn
                ),
            ),
        ),
        notes=(
            "The Gaussian of hsplat is a little broader in the middle than a plain one: two zeros in its spectrum keep "
            "lattices of splats from rippling. It adds up to the same optical depth; its deviation is that difference.",
        ),
    )


def measure(scene: Scene, studio: Studio) -> Footprints:
    """Draw the splat in all ways."""
    stage = studio.stage(scene)
    offset, smooth = _smooth_profile(stage)
    fans = []
    for angular, radial in SUBDIVISIONS:
        fan = with_splat(stage, footprint="gouraud", angular=angular, radial=radial)
        fans.append(_drawn(fan, f"fan {angular} x {radial}", angular * (2 * radial - 1), studio))
    gaussian = _drawn(with_splat(stage, footprint="gaussian"), "Gaussian", 0, studio)
    return Footprints(tuple(fans), gaussian, np.column_stack([offset, smooth]))


def judge(numbers: Footprints) -> tuple[Claim, ...]:
    """What the numbers say of the paper's claims."""
    deviations = [fan.deviation for fan in numbers.fans]
    fine = [abs(fan.integral_error) for fan in numbers.fans if fan.num_triangles >= MIN_TRIANGLES]
    return (
        Claim(
            "A splat can be drawn as a collection of Gouraud-shaded polygons, and the more of them the nearer it comes "
            "to a smooth Gaussian footprint.",
            f"the largest deviation falls with every subdivision, and is under {MAX_DEVIATION:.0%} of the peak at last",
            " > ".join(f"{deviation:.1%}" for deviation in deviations),
            all(after < before for before, after in pairwise(deviations)) and deviations[-1] < MAX_DEVIATION,
        ),
        Claim(
            "A few dozen triangles are enough for a splat to add what it should to the picture.",
            f"with {MIN_TRIANGLES} triangles or more the integral is right within {MAX_INTEGRAL_ERROR:.0%}",
            f"at most {max(fine):.2%} off",
            max(fine) < MAX_INTEGRAL_ERROR,
        ),
    )


def _smooth_profile(stage: Stage) -> tuple[Float64, Float64]:
    """Radius in standard deviations and alpha of the splat whose profile has no triangles, float64 [n] each.

    Mass and second moment of the profile over the disc are those of the splat, as in `renderer.splats.splats`.
    """
    spec, volume = stage.scene.splat, stage.volume
    u = np.linspace(0, 1, 4001)
    weight = np.interp(u, *np.array(spec.profile, np.float64).T)
    mass = 2 * math.pi * np.trapezoid(weight * u, u)
    radius = math.sqrt(mass / (math.pi * np.trapezoid(weight * u**3, u)))  # in standard deviations
    extinction = float(transfer_of(stage).classify(volume.values.reshape(-1)[:1])[1][0])
    sigma = spec.sigma * np.cbrt(volume.voxel_volume)
    depth = extinction * volume.voxel_volume / sigma**2 * weight / (mass * radius**2)
    return np.append(u * radius, math.inf), np.append(-np.expm1(-depth), 0.0)


def _drawn(stage: Stage, name: str, num_triangles: int, studio: Studio) -> Footprint:
    frame, view = studio.draw(stage), view_of(stage, 0)
    if frame.num_splats != 1 or view.projection != "orthographic":
        raise InputError(
            "figure 1 is of one splat in parallel projection",
            got=f"{counted(frame.num_splats, 'splat')}, {view.projection}",
            hint="give it a volume of 1 x 1 x 1 voxels",
        )
    width, height = view.size
    sigma_px = stage.scene.splat.sigma * np.cbrt(stage.volume.voxel_volume) * view.scale_px
    distance = (
        np.hypot(*np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)) / sigma_px
    )
    radii, profile = _smooth_profile(stage)
    smooth, alpha = np.interp(distance, radii, profile), frame.radiance[..., 3].astype(np.float64)
    end = radii[-2]
    ring = np.minimum((distance / end * NUM_RINGS).astype(int), NUM_RINGS)
    rings = [alpha[ring == k] for k in range(NUM_RINGS)]
    return Footprint(
        name,
        num_triangles,
        float(np.abs(alpha - smooth).max() / profile[0]),
        float(alpha.sum() / smooth.sum() - 1),
        (np.arange(NUM_RINGS) + 0.5) * end / NUM_RINGS,
        np.array([[values.mean(), values.min(), values.max()] if values.size else [np.nan] * 3 for values in rings]),
        frame.image,
    )


def _caption(item: Footprint) -> str:
    return f"{item.name}, {item.num_triangles} triangles" if item.num_triangles else item.name


def _profiles(numbers: Footprints) -> Chart:
    from hsplat_cli.studies.paper.empty_plots import SERIES, new_plot

    plot, axes = new_plot("distance from the centre, standard deviations", "alpha")
    shown: Sequence[Footprint] = [fan for fan in numbers.fans if fan.name in ("fan 4 x 1", "fan 8 x 3", "fan 32 x 16")]
    for color, fan in zip(SERIES, shown, strict=False):
        axes.fill_between(fan.radii, fan.alphas[:, 1], fan.alphas[:, 2], color=color, alpha=0.2, linewidth=0)
        axes.plot(fan.radii, fan.alphas[:, 0], color=color, label=_caption(fan))
    axes.plot(numbers.gaussian.radii, numbers.gaussian.alphas[:, 0], color=SERIES[3], linestyle=":", label="Gaussian")
    axes.plot(*numbers.smooth[:-1].T, color=SERIES[7], linestyle="--", label="smooth profile")
    axes.legend()
    return Chart(
        plot,
        "Alpha over the distance from the centre, for three fans, the Gaussian and the smooth profile",
        "Alpha by the distance from the centre: the mean over all directions, and from the least to the largest",
    )


def _meshes(scene: Scene) -> Chart:
    from hsplat_cli.studies.paper.empty_plots import SERIES, new_plots

    plot, all_axes = new_plots(len(SUBDIVISIONS), side=1.6)
    for axes, (angular, radial) in zip(all_axes, SUBDIVISIONS, strict=True):
        footprint = make_footprint(replace(scene.splat, footprint="gouraud", angular=angular, radial=radial))
        assert isinstance(footprint, GouraudFootprint)
        axes.triplot(*footprint.vertices.T, footprint.triangles, color=SERIES[0], linewidth=0.5)
        axes.set_title(f"{angular} x {radial}")
        axes.set_aspect("equal")
        axes.set_axis_off()
    return Chart(plot, "The triangles of the fans", "The triangles, angular x radial subdivisions, all at one scale")
