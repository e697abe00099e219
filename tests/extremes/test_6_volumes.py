"""Volumes of any shape, place, type and range of values, and transfer functions with any points."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from brickwork import transfer_of as transfer
from exact_classification import classified, placed
from extremes import Extreme, Section
from lattices import MATRICES, SHAPES
from number_types import LARGEST
from ray_integrals import along_z, integrate
from splat_reference import rasterize_reference
from splatting import look

from renderer.pyramid import Pyramid, build_pyramid, cut_pyramid
from renderer.scene import ColormapSpec, ErrorSpec, PyramidSpec, ShadingSpec, SplatSpec, TransferSpec
from renderer.splats import make_splats
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.view import View, visible_order
from renderer.volume import Array, Volume

Random = np.random.Generator


def build(of: Volume, by: TransferFunction, shading: ShadingSpec | None = None, **kind: Any) -> Pyramid:
    return build_pyramid(of, by, spec=PyramidSpec(**kind), error=ErrorSpec(), shading=shading, num_threads=1)


def colormap_range(num_cases: int) -> float:
    """Compare a colormap over nearly all float64, or over 1e-300 of it, with the same over [-1, 1]."""
    worst = 0.0
    at = np.random.default_rng(0).uniform(-1.2, 1.2, num_cases)
    for largest in (LARGEST / 1.5, 1e-300):
        specs = [
            TransferSpec(ColormapSpec("viridis", (-end, end), ((-end, 0.1), (0.25 * end, 0.9)))) for end in (1, largest)
        ]
        unit, wide = (make_transfer_function(spec, 1.0) for spec in specs)
        for one, other in zip(unit.classify(at), wide.classify(at * largest), strict=True):
            worst = max(worst, float(np.abs(one - other).max()))
    return worst


# Types


def scaled_by_powers(picture: Callable[[Volume, TransferFunction, View], Array]) -> Callable[[int], float]:
    """Measure the change of a pixel where values and control values are all times a power of two."""

    def measure(num_cases: int) -> float:
        worst = 0.0
        for case in range(max(1, num_cases // 10)):
            rng = np.random.default_rng(case)
            values = rng.integers(-1024, 1025, (3, 4, 5)) / 1024
            values[0, 0, :2] = -1.0, 1.0
            at = np.sort(rng.integers(-1024, 1025, 5)) / 1024
            colors, extinctions = rng.random((5, 3)), rng.random(5) * 3 * (rng.random(5) < 0.7)
            view = look("perspective", size=(24, 16), distance=14.0, azimuth=float(rng.uniform(0, 360)))
            pictures = [
                picture(
                    placed(np.ldexp(values, exponent), np.eye(3)),
                    TransferFunction(np.ldexp(at, exponent), colors, extinctions + 1e-9, 1.0),
                    view,
                )
                for exponent in (0, 1023, -1000, -1060)
            ]
            worst = max(worst, *(float(np.abs(other - pictures[0]).max()) for other in pictures[1:]))
        return worst

    return measure


def of_splats(of: Volume, by: TransferFunction, view: View) -> Array:
    cut = cut_pyramid(build(of, by, ShadingSpec()), 0.2)
    splats = make_splats(cut, SplatSpec())
    return rasterize_reference(splats, visible_order(splats, view), view)


def of_rays(of: Volume, by: TransferFunction, view: View) -> Array:
    return integrate(of, by, view, step_voxels=1.0, shading=ShadingSpec(), num_threads=1)


def narrow_spikes(num_cases: int) -> float:
    """Return the worst integral over a ramp that meets a triangle of extinction: its area over the slope."""
    worst = 0.0
    for case in range(10 * num_cases):
        rng = np.random.default_rng(case)
        width, tau = 10.0 ** rng.uniform(-320, -1), float(10.0 ** rng.uniform(-2, 2))
        centre = float(rng.choice([0.0, 1e-300, 0.25, 1 / 3, rng.random()]))
        low, high = float(rng.choice([-1e300, -1.0, -0.5])), float(rng.choice([1.5, 2.0, 1e300]))
        white = (1.0, 1.0, 1.0)
        by = transfer((centre - width, white, 0.0), (centre, white, tau), (centre + width, white, 0.0))
        area = tau * float((Fraction(by.values[2]) - Fraction(by.values[0])) / 2 / (Fraction(high) - Fraction(low)))
        worst = max(worst, abs(along_z([low, high], by)[3] - -math.expm1(-area)))
    return worst


# Shapes and places


def energies(tolerance: float, precision: str) -> Callable[[int], float]:
    """Compare the sum of the optical areas of splats with that of tau V, over all shapes and places."""

    def measure(num_cases: int) -> float:
        worst = 0.0
        by = TransferFunction(np.array([0.0, 255.0]), np.ones((2, 3)), np.array([0.0, 2.0]), 1.0)
        for case, (shape, axes) in enumerate(itertools.product(SHAPES, MATRICES)):
            values = np.random.default_rng((num_cases, case)).integers(1, 256, shape[::-1], np.uint8)
            of = placed(values, axes)
            splats = make_splats(cut_pyramid(build(of, by, precision=precision), tolerance), SplatSpec())
            exact = values.sum(dtype=np.float64) / 255 * 2.0 * abs(np.linalg.det(axes))
            got = splats.vertices[:, 6].sum(dtype=np.float64) * splats.model_unit**2
            worst = max(worst, abs(float(got / exact) - 1))
        return worst

    return measure


# Statistics


SHARE = "error, share of the largest extinction"
FLOATS, TABLES = ("float64", "float32", "int64"), ("int8", "uint16", "float16")
ALL_TYPES = (*FLOATS, *TABLES)
EXACT = "classified by the segment it falls into, or by a table of all values of the type; nothing is resampled"
SAME = "the same"
POWER = "values are brought to 1 by a power of two, which rounds nothing"
PIXEL = "largest difference of a channel of a pixel"

# Control values by name, with what makes them safe and the types of voxels.
POINTS: dict[str, tuple[str, tuple[str, ...], Callable[[Random], Any]]] = {
    "points 1e-300 apart": (EXACT, ("float64",), lambda rng: np.arange(4) * 1e-300),
    "points 1e-310 apart, and one at 1": (SAME, ("float64",), lambda rng: [0, 1e-310, 2e-310, 1.0]),
    "points 1e300 apart, and at the ends of float64": (
        SAME, ("float64",), lambda rng: [-LARGEST, -1e300, 0, 1e300, LARGEST]
    ),
    "a spike of 1e-9 (float), between 8-bit values": (
        SAME, ALL_TYPES, lambda rng: [0, 100, 100 + 1e-9, 100 + 2e-9, 120]
    ),
    "a spike at one value of 16 bits": (SAME, ("uint16", "float32"), lambda rng: [0, 12344, 12345, 12346, 65535]),
    "steps: repeated points, at the ends, too": (
        "a scalar at a step belongs to the upper side", ALL_TYPES, lambda rng: [5, 5, 50, 50, 77, 100, 100]
    ),
    "points far outside of the values of the type": (EXACT, ALL_TYPES, lambda rng: [-1e9, -1e5, 0.5, 1e5, 1e9]),
    "all values below, or above, all points": (
        "constant outside of the points", ALL_TYPES, lambda rng: np.sort(rng.choice([-1.0, 1.0]) * np.array([1e9, 2e9]))
    ),
    "30 random points": (EXACT, ALL_TYPES, lambda rng: np.sort(rng.normal(0, 60, 30))),
}  # fmt: skip

SECTION = Section(
    "Volumes",
    (
        *(Extreme(name, method, SHARE, 1e-6, classified(*how)) for name, (method, *how) in POINTS.items()),
        Extreme("a colormap over nearly all of float64, or over 1e-300 of it", POWER,
            "difference from the same over [-1, 1]", 1e-12, colormap_range),
        Extreme("values and points times 2^-1060, 2^-1000 or 2^1023, lit; splats", POWER, PIXEL, 1e-6,
            scaled_by_powers(of_splats)),
        Extreme("the same, ray integral", POWER, PIXEL, 1e-6, scaled_by_powers(of_rays)),
        Extreme("a spike 1e-320 to 0.1 wide on a ramp of 1 to 1e300, ray integral",
            "held to its interval where that is narrower than rounding", "error of the opacity", 1e-9, narrow_spikes),
        Extreme("1 x 1 x 1 to 16^3 voxels, 1000 : 1, sheared, left-handed; voxel by voxel",
            "optical areas from the determinant, in float64", "relative error of the sum of tau V", 1e-6,
            energies(0.0, "single")),
        Extreme("the same in half precision", "means stored in float16", "relative error of the sum of tau V",
            2.0**-11 + 1e-6, energies(math.inf, "half")),
    ),
)  # fmt: skip


@pytest.mark.parametrize("extreme", SECTION.extremes, ids=str)
def test_volumes(extreme: Extreme) -> None:
    extreme.check()
