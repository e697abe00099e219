"""Opacity, from the scene's numbers to that of a column of voxels, against 50 digits of mpmath."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from typing import Any

import mpmath
import numpy as np
import pytest
from extremes import Extreme, Measure, Random, Section, worst_of

from renderer.pyramid import Cut, build_pyramid, cut_pyramid
from renderer.scene import ControlPoint, ErrorSpec, PyramidSpec, SplatSpec, TransferSpec
from renderer.splats import make_splats
from renderer.transfer import MAX_VOXEL_DEPTH, make_transfer_function
from renderer.volume import Fingerprint, Float32, Volume, make_volume

mpmath.mp.dps = 50

OPACITIES = [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 0.5, 0.9, 0.999, 1 - 1e-6, 1 - 1e-9, 1 - 1e-12, 1.0]
LENGTHS = [1e-9, 1e-6, 1e-3, 0.7, 1.0, 3.0, 1e3, 1e6, 1e9]
NUM_DOUBLINGS = 20


def random_cases(num: int) -> Iterator[tuple[float, float, float]]:
    """Yield opacities, units and finest spacings: the extremes, then random ones between them."""
    rng = np.random.default_rng(2)
    extremes = list(itertools.product(OPACITIES, LENGTHS, [1e-9, 1.0, 1e9]))
    yield from (extremes[k] for k in rng.permutation(len(extremes))[: 10 * num])
    for _ in range(num):
        faint = 10.0 ** rng.uniform(-12, 0)
        unit, spacing = 10.0 ** rng.uniform(-9, 9, 2)
        yield (faint if rng.random() < 0.5 else 1 - faint), float(unit), float(spacing)


def points(*opacities: float, unit: float | None = None) -> TransferSpec:
    """Return the transfer function of a scene with points at 0, 1, 2, ..."""
    return TransferSpec(tuple(ControlPoint(k, (1.0, 0.5, 0.25), a) for k, a in enumerate(opacities)), unit)


def exact_depth(opacity: float, length: float, unit: float, spacing: float) -> Any:
    """Return the optical depth of a length of homogeneous matter; that of a voxel is capped."""
    if opacity == 1.0:
        return mpmath.mpf(MAX_VOXEL_DEPTH) / mpmath.mpf(spacing) * length
    extinction = -mpmath.log1p(-mpmath.mpf(opacity)) / mpmath.mpf(unit)
    return min(extinction, mpmath.mpf(MAX_VOXEL_DEPTH) / mpmath.mpf(spacing)) * mpmath.mpf(length)


def relative(got: float, exact: Any) -> float:
    return float(abs(mpmath.mpf(got) / exact - 1)) if exact else abs(got)


def opacity_error(depth: float, exact: Any) -> float:
    return relative(-math.expm1(-depth), -mpmath.expm1(-exact))


def transmittance_error(depth: float, exact: Any) -> float:
    return float(abs(mpmath.mpf(math.exp(-depth)) - mpmath.exp(-exact)))


def column_depth(depth: Float32, level: int, spacing: float) -> float:
    """Return the optical depth of a cell along an axis, in a volume of 2^20 voxels a side, by the area of its splat.

    The volume has no voxels: nothing reads them.
    """
    side = 1 << NUM_DOUBLINGS
    empty = np.broadcast_to(np.uint8(0), (side, side, side))
    placed = np.diag([spacing, spacing, spacing, 1.0])
    of = Volume(empty, placed, "a cube", Fingerprint(empty, placed))
    cell = Cut(np.array([level], np.uint8), np.zeros((1, 3), np.int32), depth[None], of)
    splats = make_splats(cell, SplatSpec())
    return float(splats.vertices[0, 6]) * splats.model_unit**2 / (spacing * 2.0**level) ** 2


def voxel_depth(spec: TransferSpec, value: float, spacing: float) -> Float32:
    """Return the channels in the cut of a volume of one voxel, float32 [4]; zeros where it is invisible."""
    of = make_volume(np.full((1, 1, 1), value), np.diag([spacing, spacing, spacing, 1.0]), "a voxel")
    transfer = make_transfer_function(spec, of.finest_spacing)
    pyramid = build_pyramid(of, transfer, spec=PyramidSpec(), error=ErrorSpec(), num_threads=1)
    depths = cut_pyramid(pyramid, 0.0).depths
    return np.asarray(depths[0] if len(depths) else np.zeros(4, np.float32))


def chain(error: Callable[[float, Any], float]) -> Measure:
    """Measure all steps: opacity -> extinction -> depth of a voxel -> cut -> area of a splat -> depth of a cell."""

    def measure(num_cases: int) -> float:
        worst = 0.0
        for opacity, unit, spacing in itertools.islice(random_cases(num_cases), 0, None, 4):
            depth = voxel_depth(points(opacity, unit=unit), 0.0, spacing)
            if depth[3] == 0.0:  # nothing, or less than VISIBILITY_THRESHOLD
                assert exact_depth(opacity, spacing, unit, spacing) < 1e-24
                continue
            for level in range(0, NUM_DOUBLINGS + 1, 5):
                exact = exact_depth(opacity, spacing * 2.0**level, unit, spacing)
                worst = max(worst, error(column_depth(depth, level, spacing), exact))
        return worst

    return measure


def colors(num_cases: int) -> float:
    """Return the worst premultiplied colour over opacity, of the splats of single voxels."""
    worst = 0.0
    for opacity, unit, spacing in itertools.islice(random_cases(num_cases), 0, None, 4):
        depth = voxel_depth(points(opacity, unit=unit), 0.0, spacing).astype(np.float64)
        if depth[3] > 0.0:
            worst = max(worst, float(np.abs(depth[:3] / depth[3] / [1.0, 0.5, 0.25] - 1).max()))
    return worst


def averaged(precision: str) -> Measure:
    """Measure cells of 2^3 random voxels of opacities 0 to 1 that are averaged by `average: opacity`."""
    spec = PyramidSpec("opacity", precision)  # type: ignore[arg-type]
    transfer = make_transfer_function(points(0.0, 1e-12, 1e-3, 0.5, 0.999, 1 - 1e-12, 1.0), 1.0)

    def error(rng: Random, case: int) -> float:
        values = rng.integers(0, 7, (2, 2, 2), np.uint8)
        values[0, 0, 0] = case % 6 + 1  # something is visible
        of = make_volume(values, np.eye(4), "8 voxels")
        pyramid = build_pyramid(of, transfer, spec=spec, error=ErrorSpec(), num_threads=1)
        depth = float(cut_pyramid(pyramid, math.inf).depths[0, 3])
        exact = sum(-mpmath.expm1(-mpmath.mpf(float(transfer.extinctions[v]))) for v in values.flat) / 8
        return relative(-math.expm1(-depth), exact)

    return worst_of(error)


FLOATS = "`-log1p(-a) / unit`, and depths double where the paper squares `1 - a`; depths in float32"

SECTION = Section(
    "Opacity",
    (
        Extreme("corrected opacity of a cell of 1 to 2^20 voxels, by its splat", FLOATS, "relative error", 1e-6,
            chain(opacity_error)),
        Extreme("transmittance of a cell, by its splat", FLOATS, "error", 1e-6, chain(transmittance_error)),
        Extreme("colour of a voxel, by its splat", "`tau c` and `tau` are rounded alike", "relative error", 1e-6,
            colors),
        Extreme("cell of 2^3 voxels, `average: opacity`, single precision",
            "`-log1p` of the mean alpha; 1 means the deepest voxel", "relative error of the opacity", 1e-6,
            averaged("single")),
        Extreme("the same in half precision", "float16 rounds the mean to 5e-4", "relative error of the opacity",
            2.0**-11 + 1e-6, averaged("half")),
    ),
    "Opacities are 0, 1e-12 to 1 - 1e-12, and 1; units and spacings 1e-9 to 1e9, each with each; lengths 1 to 2^20"
    " voxels, so that depths are 0 to 4e7. A voxel deeper than 40 is held at 40: it lets 4e-18 through and not less."
    " With `average: opacity` a mean alpha that float32 rounds to 1, nearer than 3e-8, has the depth of the deepest"
    " voxel: at the rim of such a cell the picture may be too opaque.",
)  # fmt: skip


@pytest.mark.parametrize("extreme", SECTION.extremes, ids=str)
def test_opacity(extreme: Extreme) -> None:
    extreme.check()
