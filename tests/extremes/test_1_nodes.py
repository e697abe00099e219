"""The error of a node against the exact root of the variance of its voxels, in integers of any length."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import pytest
from extremes import Extreme, Measure, Random, Section, worst_of

from renderer.pyramid import Pyramid, build_pyramid
from renderer.scene import ErrorSpec, PyramidSpec
from renderer.transfer import TransferFunction
from renderer.volume import Array, Volume, make_volume

SINGLE, HALF = PyramidSpec(precision="single"), PyramidSpec(precision="half")
SCALAR, OPTICAL = ErrorSpec(measure="rms", of="scalar"), ErrorSpec()

# The smallest number of float64; every number of float64 is a multiple of it.
LAST_PLACE = 2**1074

# One voxel, two, three; 2^k, 2^k + 1 and primes, alone and together.
SHAPES = [
    (1, 1, 2), (2, 1, 1), (1, 3, 1), (3, 5, 9), (2, 2, 2), (7, 11, 5), (1, 1, 33), (17, 1, 2), (9, 9, 9), (8, 8, 8),
]  # fmt: skip


def volume(values: Array) -> Volume:
    return make_volume(np.ascontiguousarray(values), np.eye(4), "extreme")


def constant_opacity() -> TransferFunction:
    """Return a function that shows every voxel, whatever its value."""
    return TransferFunction(np.zeros(1), np.array([[0.2, 0.5, 1.0]]), np.array([0.3]), 1.0)


def integers(values: Array) -> Array:
    """Return float64 numbers as Python's integers, in units of 1 / LAST_PLACE."""
    exact = np.empty(values.shape, object)
    for place, value in np.ndenumerate(values.astype(np.float64)):
        numerator, denominator = float(value).as_integer_ratio()
        exact[place] = numerator * (LAST_PLACE // denominator)
    return exact


def sums(values: Array, side: int) -> Array:
    """Return the sums over the cells of a level; the first three axes are z, y, x."""
    for axis in range(3):
        values = np.add.reduceat(values, np.arange(0, values.shape[axis], side), axis=axis)
    return values


def relative_error(error: float, numerator: int, denominator: int) -> float:
    """Return the relative error of a root whose exact square is numerator / denominator / LAST_PLACE^2."""
    assert error >= 0.0, error
    if numerator == 0:
        return 0.0 if error == 0.0 else math.inf
    up, down = error.as_integer_ratio()
    ratio = (up * LAST_PLACE) ** 2 * denominator / (down**2 * numerator)  # rounded once, however long the integers
    return abs(ratio - 1.0) / (math.sqrt(ratio) + 1.0)


def cells(pyramid: Pyramid, level: int) -> list[tuple[int, int, int]]:
    """Return all cells (x, y, z) of a level in the order of the pyramid's nodes, all of them visible."""
    sides = [-(-num >> level) for num in pyramid.volume.shape_xyz]
    return sorted(
        itertools.product(*map(range, sides)),
        key=lambda at: sum((at[axis] >> bit & 1) << 3 * bit + axis for bit in range(17) for axis in range(3)),
    )


def worst_of_nodes(pyramid: Pyramid) -> float:
    """Return the largest relative error of any node; all voxels are visible."""
    exact, worst = integers(pyramid.volume.values), 0.0
    for number, level in enumerate(pyramid.levels, start=1):
        count, first, second = (sums(of, 1 << number) for of in (np.ones(exact.shape, object), exact, exact * exact))
        numerators = count * second - first * first  # of n^2 times the variance
        for (x, y, z), error in zip(cells(pyramid, number), level.errors, strict=True):
            stored = float(error) * pyramid.error_unit
            worst = max(worst, relative_error(stored, int(numerators[z, y, x]), int(count[z, y, x]) ** 2))
    return worst


def of_scalars(make: Callable[[Random, tuple[int, ...]], Array], spec: PyramidSpec = SINGLE) -> Measure:
    """Return the measure of volumes of random values in all shapes."""

    def error(rng: Random, case: int) -> float:
        of = volume(make(rng, SHAPES[case % len(SHAPES)]))
        return worst_of_nodes(build_pyramid(of, constant_opacity(), spec=spec, error=SCALAR, num_threads=1))

    return worst_of(error)


def uniform(dtype: Any, low: float, high: float) -> Callable[[Random, tuple[int, ...]], Array]:
    """Return a maker of random values; it uses halves, because the range may exceed the largest number."""
    return lambda rng, shape: (2 * (low / 2 + (high / 2 - low / 2) * rng.random(shape))).astype(dtype)


def whole(dtype: Any, low: int, high: int) -> Callable[[Random, tuple[int, ...]], Array]:
    return lambda rng, shape: rng.integers(low, high, shape, dtype, endpoint=True)


def with_outlier(dtype: Any, outlier: float) -> Callable[[Random, tuple[int, ...]], Array]:
    """Return a maker of values from 0 to 1, and one voxel far away from them."""

    def make(rng: Random, shape: tuple[int, ...]) -> Array:
        values = rng.random(shape).astype(dtype)
        values[(0, 0, 0)] = outlier
        return values

    return make


def ramp(low: float, high: float, extinctions: Sequence[float]) -> TransferFunction:
    """Return a linear function over [low, high], with changing colours."""
    num = len(extinctions)
    colors = np.random.default_rng(num).random((num, 3))
    return TransferFunction(np.linspace(low, high, num), colors, np.array(extinctions, float), 1.0)


def equal_voxels(num_cases: int) -> float:
    """Return the largest error of any node of 100^3 equal voxels, of random values and types."""
    worst = 0.0
    for case in range(max(1, num_cases // 20)):
        rng = np.random.default_rng(case)
        for dtype, (spec, error) in itertools.product((np.uint8, np.float64), ((SINGLE, SCALAR), (HALF, OPTICAL))):
            of = volume(np.full((100, 100, 100), rng.uniform(1, 199), dtype))
            pyramid = build_pyramid(of, ramp(0.0, 200.0, [0.3, 1e-3, 5.0]), spec=spec, error=error, num_threads=1)
            assert len(pyramid.levels[0].errors) == 50**3
            worst = max(worst, *(float(level.errors.max()) for level in pyramid.levels))
    return worst


RELATIVE = "relative error of the estimate"
LARGEST_32, LARGEST_64 = float(np.finfo(np.float32).max), float(np.finfo(np.float64).max)

FROM_DIFFERENCES = "differences of neighbours are squared, never values; in float64"
SHIFTED = FROM_DIFFERENCES + ", after a shift that rounds nothing"
SCALED = FROM_DIFFERENCES + ", after a power of two that brings the range to 1"

node = partial(Extreme, quantity=RELATIVE, bound=1e-6)

# Volumes of scalars by name, with what makes their errors exact.
SCALARS = {
    "float64, 1e6 - 0.01 to 1e6 + 0.01": (SHIFTED, uniform(np.float64, 1e6 - 1e-2, 1e6 + 1e-2)),
    "float64, 1e15 to 1e15 + 8": (SHIFTED, uniform(np.float64, 1e15, 1e15 + 8)),
    "uint16, 65000 to 65003": (SHIFTED, whole(np.uint16, 65000, 65003)),
    "int64, up to both ends of its range": (SCALED, whole(np.int64, -(2**63), 2**63 - 1)),
    "float32, up to both ends of its range": (SCALED, uniform(np.float32, -LARGEST_32, LARGEST_32)),
    "float64, up to both ends of its range": (SCALED, uniform(np.float64, -LARGEST_64, LARGEST_64)),
    "float64, denormal, up to 1e-310": (SCALED, uniform(np.float64, 0.0, 1e-310)),
    "0 to 1, but for one voxel of 1e30 (float64)": (
        "the shift rounds nothing, however different the values", with_outlier(np.float64, 1e30)
    ),
    "0 to 1, but for one voxel of -3.4e38 (float32)": ("the same", with_outlier(np.float32, -LARGEST_32)),
}  # fmt: skip

SECTION = Section(
    "Error of a node",
    (
        *(node(name, method, measure=of_scalars(make)) for name, (method, make) in SCALARS.items()),
        Extreme("0 to 255 in half precision", "stored in float16, which rounds to 5e-4", RELATIVE, 2.0**-11 + 1e-6,
            of_scalars(uniform(np.float32, 0, 255), HALF)),
        Extreme("a million equal voxels", "no difference, no error", "largest error of a node", 0.0, equal_voxels),
    ),
)  # fmt: skip


@pytest.mark.parametrize("extreme", SECTION.extremes, ids=str)
def test_error_of_a_node(extreme: Extreme) -> None:
    extreme.check()
