"""Volumes of any shape, place, type and range of values, and transfer functions with any points."""

from __future__ import annotations

import itertools
import json
import math
import tempfile
from bisect import bisect_right
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from extremes import Extreme, Section
from ray_integrals import along_z, transfer
from splatting import in_order, look, optical_depth
from volume_files import write_volume

from hsplat_cli import main
from hsplat_cli.info import info
from renderer.camera import View
from renderer.classify import classify_voxel, make_classifier, voxel_codes
from renderer.errors import InputError, SceneError
from renderer.integrator import integrate
from renderer.octree import cut_pyramid
from renderer.projection import visible_order
from renderer.pyramid import Pyramid, build_pyramid
from renderer.raster_gl import GLRasterizer
from renderer.raster_reference import rasterize_reference
from renderer.readers import read_volume
from renderer.scene import (
    ColormapSpec,
    ControlPoint,
    ErrorSpec,
    FileSource,
    PyramidSpec,
    RawSource,
    SplatSpec,
    TransferSpec,
    VolumeSpec,
)
from renderer.scene_schema import parse_scene
from renderer.splats import SplatBatch, make_splats
from renderer.statistics import measure as measure_statistics
from renderer.transfer import TransferFunction, make_transfer
from renderer.volume import Volume, make_volume

Array = npt.NDArray[Any]
Float64 = npt.NDArray[np.float64]
Random = np.random.Generator

INTEGERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
TYPES = (*INTEGERS, "float16", "float32", "float64")
LARGEST = float(np.finfo(np.float64).max)

# One voxel, a row along each axis, 2^k + 1, primes. x, y, z.
SHAPES = [(1, 1, 1), (1, 1, 40), (40, 1, 1), (1, 23, 1), (2, 1, 3), (9, 17, 5), (7, 13, 11), (16, 16, 16), (33, 3, 2)]

ROTATION = np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]) / 3
# Index axes in the world, columns: straight, 1000 : 1, oblique, sheared, left-handed, all of it.
MATRICES = [
    np.eye(3),
    np.diag([1.0, 1.0, 1000.0]),
    np.diag([1e-3, 1.0, 1.0]),
    ROTATION,
    np.array([[1.0, 0.5, 0.2], [0.0, 1.0, 0.4], [0.0, 0.0, 1.0]]),
    np.diag([-1.0, 1.0, 1.0]),
    ROTATION @ np.array([[1.0, 0.3, 0.0], [0.0, -2.0, 0.1], [0.2, 0.0, 50.0]]),
]


def placed(values: Array, axes: Float64) -> Volume:
    """Around the world's origin."""
    world_from_index = np.eye(4)
    world_from_index[:3, :3] = axes
    world_from_index[:3, 3] = -axes @ ((np.array(values.shape[::-1]) - 1) / 2)
    return make_volume(np.ascontiguousarray(values), world_from_index, "extreme")


def build(of: Volume, by: TransferFunction, **kind: Any) -> Pyramid:
    return build_pyramid(of, by, spec=PyramidSpec(**kind), error=ErrorSpec(), num_threads=1)


def limits(dtype: str) -> tuple[float, float]:
    kind = np.iinfo(dtype) if dtype in INTEGERS else np.finfo(dtype)
    return kind.min, kind.max


# Classification


def exactly(by: TransferFunction) -> Callable[[Any], list[Fraction]]:
    """(tau c, tau) of a scalar: linear between the points about it, of equal ones the last, constant outside."""
    rows = [[Fraction(float(v)) for v in (*color, tau)] for color, tau in zip(by.colors, by.extinctions, strict=True)]
    at = [Fraction(float(value)) for value in by.values]

    def channels(scalar: Any) -> list[Fraction]:
        s = Fraction(int(scalar)) if isinstance(scalar, np.integer) else Fraction(float(scalar))
        above = bisect_right(at, s)
        row = rows[min(above, len(at) - 1)]
        if 0 < above < len(at):
            t = (s - at[above - 1]) / (at[above] - at[above - 1])
            row = [low + t * (high - low) for low, high in zip(rows[above - 1], rows[above], strict=True)]
        return [*(channel * row[3] for channel in row[:3]), row[3]]

    return channels


def worst_classified(by: TransferFunction, values: Array) -> float:
    """The largest error of a channel of any voxel, as a share of the largest extinction; the spacing is 1."""
    of = placed(values.reshape(1, 1, -1), np.eye(3))
    rule, codes = make_classifier(of, by, None, opacity=False), voxel_codes(of)
    worst, exact = 0.0, exactly(by)
    for x, scalar in enumerate(of.values[0, 0]):
        got = classify_voxel(codes, *rule, 0, 0, x)
        worst = max(worst, *(abs(float(Fraction(float(a)) - b)) for a, b in zip(got, exact(scalar), strict=True)))
    return worst / by.max_extinction


def about(values: Float64, dtype: str, rng: Random) -> Array:
    """Scalars of a type at control values, next to them and between them, and its limits."""
    low, high = limits(dtype)
    ends = np.array([low, high], dtype)
    fine = np.sort(np.clip(values, float(low), float(high)))
    between = fine[:-1] + rng.random((4, len(fine) - 1)) * (fine[1:] / 2 - fine[:-1] / 2)
    near = np.concatenate([fine, between.ravel()])
    if dtype in INTEGERS:
        near = np.clip(np.concatenate([np.floor(near), np.ceil(near)]), low + 1, high / 2)
        return np.concatenate([ends, near.astype(dtype)])
    typed = near.astype(dtype)
    steps = np.concatenate([np.nextafter(typed, ends[0]), np.nextafter(typed, ends[1])])
    return np.concatenate([ends, typed, steps[np.isfinite(steps)]])


def classified(dtypes: tuple[str, ...], points: Callable[[Random], Any]) -> Callable[[int], float]:
    """Measures transfer functions of random colours and extinctions at the given control values."""

    def measure(num_cases: int) -> float:
        worst = 0.0
        for case in range(num_cases):
            rng = np.random.default_rng(case)
            values = np.array(points(rng), np.float64)
            by = TransferFunction(values, rng.random((len(values), 3)), rng.random(len(values)) * 5, 1.0)
            worst = max(worst, worst_classified(by, about(values, dtypes[case % len(dtypes)], rng)))
        return worst

    return measure


def colormap_range(num_cases: int) -> float:
    """A colormap over nearly all float64, or over 1e-300 of it, against the same over [-1, 1]."""
    worst = 0.0
    at = np.random.default_rng(0).uniform(-1.2, 1.2, num_cases)
    for largest in (LARGEST / 1.5, 1e-300):
        specs = [
            TransferSpec(ColormapSpec("viridis", (-end, end), ((-end, 0.1), (0.25 * end, 0.9)))) for end in (1, largest)
        ]
        unit, wide = (make_transfer(spec, 1.0) for spec in specs)
        for one, other in zip(unit.classify(at), wide.classify(at * largest), strict=True):
            worst = max(worst, float(np.abs(one - other).max()))
    return worst


# Types


def spread(dtype: str, rng: Random) -> Array:
    """Values over the whole range of a type, both limits among them: [3, 4, 5]."""
    low, high = limits(dtype)
    values = rng.integers(low, high, (3, 4, 5), dtype, endpoint=True) if dtype in INTEGERS else None
    if values is None:
        values = (rng.uniform(-1, 1, (3, 4, 5)) * float(high)).astype(dtype)
    values[0, 0, :2] = low, high
    return values


def reread(num_cases: int) -> float:
    """The number of voxels that are not what was written, over all formats, types and byte orders."""
    num_wrong = 0
    # SimpleITK and NIfTI have no float16.
    no_half = tuple(dtype for dtype in TYPES if dtype != "float16")
    types = {"npy": TYPES, "tif": TYPES, "nrrd": no_half, "mha": no_half, "nii": no_half}
    with tempfile.TemporaryDirectory() as folder:
        for case, (suffix, order) in enumerate(itertools.product(types, "<>")):
            for dtype in types[suffix][:: 1 if num_cases > 20 else 2]:
                values = spread(dtype, np.random.default_rng(case))
                path = Path(folder) / f"{case}.{suffix}"
                write_volume(path, values, order)
                read = read_volume(VolumeSpec(FileSource(path)))
                assert read.values.dtype == values.dtype
                num_wrong += int(np.count_nonzero(read.values != values))
    return num_wrong


def drawn_types(num_cases: int) -> float:
    """Depths of the voxels of headerless files of each type and byte order, each classified over its whole range."""
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.raw"
        for case, (dtype, order) in enumerate(itertools.product(TYPES, ("little", "big"))):
            rng = np.random.default_rng((num_cases, case))
            values = spread(dtype, rng)
            path.write_bytes(values.astype(values.dtype.newbyteorder("<" if order == "little" else ">")).tobytes())
            of = read_volume(VolumeSpec(RawSource(path, (5, 4, 3), dtype, order)))  # type: ignore[arg-type]
            low, high = (float(limit) for limit in limits(dtype))
            at = np.array([low, low / 2 + high / 2 + 0.0, high / 2, high])
            by = TransferFunction(at, rng.random((4, 3)), 0.1 + rng.random(4), 1.0)
            cut, exact = cut_pyramid(build(of, by), 0.0), exactly(by)
            for (x, y, z), depths in zip(cut.cells, cut.depths, strict=True):
                pairs = zip(depths, exact(values[z, y, x]), strict=True)
                worst = max(worst, *(abs(float(Fraction(float(got)) - channel)) for got, channel in pairs))
    return worst


def constant_cells(num_cases: int) -> float:
    """More cells than one in the cut of a constant volume, whatever its value, at any tolerance above 0."""
    more = 0
    by = make_transfer(TransferSpec((ControlPoint(0.0, (1.0, 0.5, 0.2), 0.3),)), 1.0)
    for dtype in TYPES[:: 1 if num_cases > 20 else 3]:
        for value in limits(dtype):
            of = placed(np.full((5, 8, 7), value, dtype), np.eye(3))
            for error in (ErrorSpec(), ErrorSpec(measure="rms"), ErrorSpec(measure="rms", of="scalar")):
                pyramid = build_pyramid(of, by, spec=PyramidSpec(), error=error, num_threads=1)
                more = max(more, len(cut_pyramid(pyramid, 1e-300)) - 1)
    return more


def scaled_by_powers(picture: Callable[[Volume, TransferFunction, View], Array]) -> Callable[[int], float]:
    """The largest change of a pixel where values and control values are all times a power of two."""

    def measure(num_cases: int) -> float:
        worst = 0.0
        for case in range(max(1, num_cases // 5)):
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
    cut = cut_pyramid(build(of, by), 0.2)
    splats = make_splats(cut, SplatSpec())
    return rasterize_reference(splats, visible_order(splats, cut, view, "depth"), view)


def of_rays(of: Volume, by: TransferFunction, view: View) -> Array:
    return integrate(of, by, view, step_voxels=1.0, num_threads=1)


def ramp_between(num_cases: int) -> float:
    """The ray integral from one voxel to another, whose extinctions rise from 0 to tau: depth tau / 2 and a half."""
    worst = 0.0
    for low, high in (
        (-LARGEST, LARGEST),
        (0.0, LARGEST),
        (-1.5e308, 1.5e308),
        (0.0, 1e-310),
        (1e6 - 1e-2, 1e6 + 1e-2),
    ):
        for tau in 10.0 ** np.random.default_rng(num_cases).uniform(-3, 1, 4):
            by = transfer((low, (1.0, 1.0, 1.0), 0.0), (high, (1.0, 1.0, 1.0), float(tau)))
            alpha = along_z([low, high], by)[3]
            worst = max(worst, abs(alpha / -math.expm1(-tau) - 1))
    return worst


# Shapes and places


def energies(tolerance: float, precision: str) -> Callable[[int], float]:
    """Sum of the splats' optical areas against the sum of tau times the volume of a voxel, over all shapes and places."""

    def measure(num_cases: int) -> float:
        worst = 0.0
        by = TransferFunction(np.array([0.0, 255.0]), np.ones((2, 3)), np.array([0.0, 2.0]), 1.0)
        for case, (shape, axes) in enumerate(itertools.product(SHAPES, MATRICES)):
            values = np.random.default_rng((num_cases, case)).integers(1, 256, shape[::-1], np.uint8)
            of = placed(values, axes)
            splats = make_splats(cut_pyramid(build(of, by, precision=precision), tolerance), SplatSpec())
            exact = values.sum(dtype=np.float64) / 255 * 2.0 * abs(np.linalg.det(axes))
            got = splats.areas[:, 3].sum(dtype=np.float64) * splats.length**2
            worst = max(worst, abs(float(got / exact) - 1))
        return worst

    return measure


def pictures(cases: int) -> Iterator[tuple[SplatBatch, npt.NDArray[np.uint32], View, Volume, TransferFunction]]:
    """Small volumes of all shapes and places, seen from somewhere."""
    by = TransferFunction(np.array([0.0, 128.0, 255.0]), np.eye(3), np.array([0.0, 0.2, 1.0]), 1.0)
    everything = list(itertools.product(SHAPES, MATRICES))
    for case in range(cases):
        shape, axes = everything[5 * case % len(everything)]
        rng = np.random.default_rng(case)
        values = rng.integers(1, 256, shape[::-1], np.uint8)
        yield from _seen(placed(values, axes), by, rng)


def _seen(of: Volume, by: TransferFunction, rng: Random) -> Iterator[Any]:
    radius = 0.5 * float(np.linalg.norm(of.world_from_index[:3, :3] * of.shape_xyz))
    azimuth, elevation = rng.uniform(0, 360), rng.uniform(-80, 80)
    view = look("perspective", size=(40, 32), distance=4 * radius, azimuth=azimuth, elevation=elevation)
    scaled = TransferFunction(by.values, by.colors, by.extinctions / of.finest_spacing, 1.0)
    cut = cut_pyramid(build(of, scaled), 0.3)
    splats = make_splats(cut, SplatSpec())
    yield splats, visible_order(splats, cut, view, "depth"), view, of, scaled


def gl_against_reference(num_cases: int) -> float:
    worst = 0.0
    with GLRasterizer() as gl:
        for splats, order, view, _, _ in pictures(num_cases):
            drawn = gl.rasterize(splats, order, view)
            worst = max(worst, float(np.abs(drawn - rasterize_reference(splats, order, view)).max()))
    return worst


def turned(of: Volume, permutation: tuple[int, int, int], flips: tuple[int, ...]) -> Volume:
    """The same voxels at the same places, by another order of the index axes: some swapped, some backwards."""
    values = np.transpose(of.values, [2 - permutation[2 - k] for k in range(3)])
    axes = of.world_from_index[:3, :3][:, list(permutation)].copy()
    origin = of.world_from_index[:3, 3].copy()
    for axis in flips:
        values = np.flip(values, 2 - axis)
        origin += axes[:, axis] * (values.shape[2 - axis] - 1)
        axes[:, axis] *= -1
    world_from_index = np.eye(4)
    world_from_index[:3, :3], world_from_index[:3, 3] = axes, origin
    return make_volume(np.ascontiguousarray(values), world_from_index, "turned")


def index_axes(num_cases: int) -> float:
    """The largest change of a pixel where the same volume is stored along other axes; voxel by voxel."""
    worst = 0.0
    for case, (_, _, view, of, by) in enumerate(pictures(max(1, num_cases // 2))):
        rng = np.random.default_rng(case)
        permutation = tuple(int(k) for k in rng.permutation(3))
        other = turned(of, permutation, tuple(np.flatnonzero(rng.random(3) < 0.5)))  # type: ignore[arg-type]
        images = []
        for one in (of, other):
            cut = cut_pyramid(build(one, by), 0.0)
            splats = make_splats(cut, SplatSpec())
            images.append(rasterize_reference(splats, visible_order(splats, cut, view, "depth"), view))
        worst = max(worst, float(np.abs(images[0] - images[1]).max()))
    return worst


def one_voxel_energy(num_cases: int) -> float:
    """Optical depth summed over the picture of one voxel, times the area of a pixel, against tau V."""
    worst = 0.0
    with GLRasterizer() as gl:
        for case, axes in enumerate(itertools.islice(itertools.cycle(MATRICES), num_cases)):
            rng = np.random.default_rng(case)
            of = placed(np.ones((1, 1, 1), np.uint8), axes)
            tau = float(10.0 ** rng.uniform(-2, -1) / of.finest_spacing)
            by = TransferFunction(np.zeros(1), np.ones((1, 3)), np.array([tau]), 1.0)
            splats = make_splats(cut_pyramid(build(of, by), 0.0), SplatSpec())
            reach = float(np.linalg.norm(axes))
            turn = {"azimuth": float(rng.uniform(0, 360)), "elevation": float(rng.uniform(-70, 70))}
            view = look("orthographic", size=(64, 64), distance=3 * reach, field_of_view=60.0, **turn)  # type: ignore[arg-type]
            depths = optical_depth(gl.rasterize(splats, in_order(splats), view))
            worst = max(worst, abs(float(depths.sum()) / view.scale_px**2 / (tau * of.voxel_volume) - 1))
    return worst


def transparent(num_cases: int) -> float:
    """Bytes of the pyramid, cells of the cut and levels of colour of a volume that its transfer function hides."""
    worst = 0.0
    by = make_transfer(
        TransferSpec((ControlPoint(10.0, (1.0, 1.0, 1.0), 0.0), ControlPoint(20.0, (1.0, 1.0, 1.0), 1.0))), 1.0
    )
    view = look(distance=100.0)
    with GLRasterizer() as gl:
        for case, shape in enumerate(itertools.islice(itertools.cycle(SHAPES), num_cases)):
            dtype = (np.uint8, np.float32, np.int64)[case % 3]
            of = placed(np.random.default_rng(case).integers(0, 11, shape[::-1]).astype(dtype), MATRICES[case % 7])
            pyramid = build(of, by)
            cut = cut_pyramid(pyramid, 0.0)
            splats = make_splats(cut, SplatSpec())
            image = gl.rasterize(splats, visible_order(splats, cut, view, "depth"), view)
            worst = max(worst, pyramid.num_bytes + len(cut) + float(np.abs(image).max()))
    return worst


# Statistics

RANGES = [(-LARGEST, LARGEST), (-1.7e308, 1.7e308), (0.0, 1e-310), (1e6 - 1e-2, 1e6 + 1e-2), (1e15, 1e15 + 8), (0, 255)]


def random_ranges(num_cases: int) -> Iterator[Array]:
    for case in range(num_cases):
        low, high = RANGES[case % len(RANGES)]
        rng = np.random.default_rng(case)
        yield 2 * (low / 2 + (high / 2 - low / 2) * rng.random(1000))
        yield spread(TYPES[case % len(TYPES)], rng)


def means(num_cases: int) -> float:
    worst = 0.0
    for values in random_ranges(num_cases):
        exact = sum(Fraction(int(v)) if values.dtype.kind in "iu" else Fraction(float(v)) for v in values.flat)
        largest = max(abs(Fraction(float(values.min()))), abs(Fraction(float(values.max()))))
        got = Fraction(float(measure_statistics(values).mean))
        worst = max(worst, float(abs(got - exact / values.size) / largest))
    return worst


def medians(num_cases: int) -> float:
    worst = 0.0
    for values in random_ranges(num_cases):
        statistics = measure_statistics(values)
        assert statistics.counts.sum() == values.size
        exact = float(np.sort(values.ravel())[(values.size - 1) // 2])
        extent = float(statistics.maximum) / 2 - float(statistics.minimum) / 2
        worst = max(worst, abs(statistics.percentile(50.0) / 2 - exact / 2) / extent)
    return worst


SHARE = "error, share of the largest extinction"
FLOATS, TABLES = ("float64", "float32", "int32"), ("uint8", "int8", "uint16", "int16", "float16")
ALL_TYPES = (*FLOATS, *TABLES)
EXACT = "classified by the segment it falls into, or by a table of all values of the type; nothing is resampled"
SAME = "the same"
POWER = "values are brought to 1 by a power of two, which rounds nothing"
PIXEL = "largest difference of a channel of a pixel"

SECTION = Section(
    "Volumes",
    (
        Extreme("points 1e-300 apart", EXACT, SHARE, 1e-6, classified(("float64",), lambda rng: np.arange(4) * 1e-300)),
        Extreme("points 1e-310 apart, and one at 1", SAME, SHARE, 1e-6, classified(("float64",), lambda rng: [0, 1e-310, 2e-310, 1.0])),
        Extreme("points 1e300 apart, and at the ends of float64", SAME, SHARE, 1e-6, classified(("float64",), lambda rng: [-LARGEST, -1e300, 0, 1e300, LARGEST])),
        Extreme("a spike of 1e-9 (float), between 8-bit values", SAME, SHARE, 1e-6, classified(ALL_TYPES, lambda rng: [0, 100, 100 + 1e-9, 100 + 2e-9, 120])),
        Extreme("a spike at one value of 16 bits", SAME, SHARE, 1e-6, classified(("uint16", "float32"), lambda rng: [0, 12344, 12345, 12346, 65535])),
        Extreme("steps: repeated points, at the ends, too", "a scalar at a step belongs to the upper side", SHARE, 1e-6, classified(ALL_TYPES, lambda rng: [5, 5, 50, 50, 77, 100, 100])),
        Extreme("points far outside of the values of the type", EXACT, SHARE, 1e-6, classified(ALL_TYPES, lambda rng: [-1e9, -1e5, 0.5, 1e5, 1e9])),
        Extreme("all values below, or above, all points", "constant outside of the points", SHARE, 1e-6, classified(ALL_TYPES, lambda rng: np.sort(rng.choice([-1.0, 1.0]) * np.array([1e9, 2e9])))),
        Extreme("30 random points", EXACT, SHARE, 1e-6, classified(ALL_TYPES, lambda rng: np.sort(rng.normal(0, 60, 30)))),
        Extreme("a colormap over nearly all of float64, or over 1e-300 of it", POWER, "difference from the same over [-1, 1]", 1e-12, colormap_range),
        Extreme("every type at its limits, both byte orders, 5 formats", "tests write the bytes themselves", "voxels that are read wrongly", 0.0, reread),
        Extreme("every type at its limits, classified over its range", EXACT, "error of the depth of a voxel", 1e-6, drawn_types),
        Extreme("constant volumes of every type, at its limits", "no difference, no error", "cells in the cut, less one", 0.0, constant_cells),
        Extreme("values and points of 2^-1070 to 2^1023, splats", POWER, PIXEL, 1e-6, scaled_by_powers(of_splats)),
        Extreme("the same, ray integral", POWER, PIXEL, 1e-6, scaled_by_powers(of_rays)),
        Extreme("ramp between two voxels of +-1.8e308, 1e-310, 1e6 +- 0.01", "ray integral; " + POWER, "relative error of the opacity", 1e-6, ramp_between),
        Extreme("1 x 1 x 1 to 16^3 voxels, 1000 : 1, sheared, left-handed; voxel by voxel", "optical areas from the determinant, in float64", "relative error of the sum of tau V", 1e-6, energies(0.0, "single")),
        Extreme("the same, one splat for all", "means over the voxels that are there, not over cubes", "relative error of the sum of tau V", 1e-6, energies(math.inf, "single")),
        Extreme("the same in half precision", "means stored in float16", "relative error of the sum of tau V", 2.0**-11 + 1e-6, energies(math.inf, "half")),
        Extreme("the same volumes, drawn", "GL against float64", PIXEL, 2e-3, gl_against_reference),
        Extreme("the same, index axes swapped and run backwards", "only places in the world count", PIXEL, 2e-3, index_axes),
        Extreme("one voxel of any shape, drawn", "widened to half a pixel, the integral being kept", "relative error of tau V", 0.045, one_voxel_energy),
        Extreme("fully transparent volumes", "what is invisible is not stored", "bytes of the pyramid, cells, pixels", 0.0, transparent),
        Extreme("mean of the values, float64 up to its ends, every type", POWER, "error, share of the largest value", 1e-12, means),
        Extreme("median of the values, the same", "histogram of 65536 bins, between the ends", "error, share of the range", 1 / 65536, medians),
    ),
)  # fmt: skip


@pytest.mark.parametrize("extreme", SECTION.extremes, ids=str)
def test_volumes(extreme: Extreme) -> None:
    extreme.check()


SCENE = """\
volume: {file: hidden.npy}
transfer_function:
  points:
    - {value: 10, color: "#000000", opacity: 0.0}
    - {value: 20, color: "#ffffff", opacity: 1.0}
camera: {path: {type: turntable, frames: 2}}
output: {file: "frame{frame}.png", size: [32, 16], background: "#336699"}
"""


def test_a_hidden_volume_is_the_background_and_said_to_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    np.save("hidden.npy", np.random.default_rng(0).integers(0, 11, (9, 17, 5), np.uint8))
    Path("scene.yaml").write_text(SCENE, encoding="utf-8")
    assert main.run(["render", "scene.yaml"]) == 0
    assert "note: nothing is visible: the transfer function hides every voxel" in capsys.readouterr().out
    for frame in (0, 1):
        assert np.all(imageio.imread(f"frame{frame}.png") == [0x33, 0x66, 0x99])
    record = json.loads(next(Path().glob("*.json")).read_text(encoding="utf-8"))
    assert record["pyramid"]["bytes"] == 0
    assert [frame["splats"] for frame in record["frames"]] == [0, 0]


def of_info(path: Path, values: Array) -> dict[str, Any]:
    """What `hsplat info` says about a volume; JSON without NaN and infinities."""
    np.save(path, values)
    result = CliRunner().invoke(info, [str(path), "--json"], catch_exceptions=False)
    assert result.exit_code == 0
    assert CliRunner().invoke(info, [str(path)], catch_exceptions=False).exit_code == 0

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    facts: dict[str, Any] = json.loads(result.output, parse_constant=refuse)
    return facts


@pytest.mark.parametrize("case", range(len(RANGES) + len(TYPES)))
def test_info_of_values_at_the_ends(tmp_path: Path, case: int) -> None:
    """Its numbers are within the volume's, and what it suggests is a transfer function that shows something."""
    values = list(random_ranges(11))[2 * case if case < len(RANGES) else 2 * (case - len(RANGES)) + 1]
    facts = of_info(tmp_path / "a.npy", values.reshape(-1, 2, 2))
    low, high = values.min().item(), values.max().item()
    assert (facts["minimum"], facts["maximum"]) == (low, high)
    assert low <= facts["mean"] <= high
    assert all(low <= value <= high for value in facts["percentiles"].values())
    assert sum(facts["histogram"]["counts"]) == values.size
    scene = {
        "version": 1,
        "volume": {"file": "a.npy"},
        "transfer_function": facts["transfer_function"],
        "camera": {"path": {"type": "turntable", "frames": 1}},
        "output": {"file": "a.mp4"},
    }
    by = make_transfer(parse_scene(scene, base=tmp_path).transfer_function, 1.0)
    assert by.classify(values)[1].max() > 0


@pytest.mark.parametrize("dtype", TYPES)
def test_info_of_a_constant_at_the_ends(tmp_path: Path, dtype: str) -> None:
    for value in limits(dtype):
        facts = of_info(tmp_path / "a.npy", np.full((2, 2, 2), value, dtype))
        assert facts["minimum"] == facts["maximum"] == int(value) if dtype in INTEGERS else float(value)


def test_infinities_in_half_precision_become_the_lowest_number(tmp_path: Path) -> None:
    """Every bit pattern of float16 is in the file."""
    patterns = np.arange(2**16, dtype=np.uint16).view(np.float16).reshape(16, 64, 64)
    np.save(tmp_path / "a.npy", patterns)
    source = FileSource(tmp_path / "a.npy")
    with pytest.raises(InputError, match="2048 of 65536 voxels are NaN or infinite"):
        read_volume(VolumeSpec(source))
    finite = read_volume(VolumeSpec(source, nonfinite="lowest")).values
    assert np.isfinite(finite).all()
    assert np.all(finite[~np.isfinite(patterns)] == np.float16(-65504))


@pytest.mark.parametrize(("low", "high"), [(2**60, 2**60 + 255), (-(2**62), -(2**62) + 1), (2**53, 2**53 + 2**15)])
def test_integers_too_large_for_their_differences_are_refused(tmp_path: Path, low: int, high: int) -> None:
    np.save(tmp_path / "a.npy", np.array([low, high], np.int64).reshape(1, 1, 2))
    with pytest.raises(InputError, match="these integers are too large for their differences to be drawn"):
        read_volume(VolumeSpec(FileSource(tmp_path / "a.npy")))


@pytest.mark.parametrize(("low", "high"), [(2**62, 2**62), (2**53 - 255, 2**53), (0, 2**63 - 1), (-(2**63), 0)])
def test_integers_that_float64_tells_apart_are_read(tmp_path: Path, low: int, high: int) -> None:
    np.save(tmp_path / "a.npy", np.array([low, high], np.int64).reshape(1, 1, 2))
    assert read_volume(VolumeSpec(FileSource(tmp_path / "a.npy"))).values.tolist() == [[[low, high]]]


@pytest.mark.parametrize("scale", [1e-91, 1e91, 1e-200, 1e200])
def test_voxels_too_small_or_too_large_for_numbers_are_refused(tmp_path: Path, scale: float) -> None:
    (tmp_path / "a.raw").write_bytes(bytes(8))
    source = RawSource(tmp_path / "a.raw", (2, 2, 2), "uint8", spacing=(scale, scale, scale))
    with pytest.raises(InputError, match="the voxels are too small, too large or too far away"):
        read_volume(VolumeSpec(source))


@pytest.mark.parametrize("scale", [1e-90, 1e90])
def test_the_smallest_and_the_largest_voxels_are_drawn(tmp_path: Path, scale: float) -> None:
    (tmp_path / "a.raw").write_bytes(bytes(range(1, 9)))
    source = RawSource(tmp_path / "a.raw", (2, 2, 2), "uint8", spacing=(scale, scale, scale))
    of = read_volume(VolumeSpec(source))
    by = make_transfer(TransferSpec((ControlPoint(0.0, (1.0, 1.0, 1.0), 0.5),)), of.finest_spacing)
    for tolerance in (0.0, 1e-3):
        splats = make_splats(cut_pyramid(build(of, by), tolerance), SplatSpec())
        energy = splats.areas[:, 3].sum(dtype=np.float64) * splats.length**2 / of.finest_spacing**2
        assert energy == pytest.approx(8 * math.log(2), rel=1e-3)


def test_points_out_of_order_are_refused_with_their_place(tmp_path: Path) -> None:
    points = [{"value": value, "color": "white", "opacity": 0.5} for value in (1, 1, 3, 2)]
    with pytest.raises(SceneError) as caught:
        parse_scene({"transfer_function": {"points": points}}, base=tmp_path)
    problem = next(problem for problem in caught.value.problems if problem.what == "points out of order")
    assert problem.path == "transfer_function.points.3.value"
    assert not any(problem.path.startswith("transfer_function.points.1") for problem in caught.value.problems)
