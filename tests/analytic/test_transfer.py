"""The transfer function against exact rational arithmetic and numpy.interp."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import numpy.typing as npt
import pytest

from renderer.scene import ColormapSpec, ControlPoint, TransferSpec, colormap_points
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.transfer.transfer_function import MAX_VOXEL_DEPTH, NUM_COLORMAP_SAMPLES

Float64 = npt.NDArray[np.float64]
Point = tuple[float, tuple[float, float, float], float]


def transfer(*points: Point) -> TransferFunction:
    """Return the function through points of a value, a colour and an extinction."""
    values, colors, extinctions = zip(*points, strict=True)
    return TransferFunction(np.array(values, float), np.array(colors, float), np.array(extinctions, float), 1.0)


def random_transfer(rng: np.random.Generator, num: int) -> TransferFunction:
    values = np.sort(rng.normal(0, 100, num))
    return TransferFunction(values, rng.random((num, 3)), rng.random(num) * 5, 1.0)


def exact(tf: TransferFunction, scalar: float) -> list[Fraction]:
    """Return (r, g, b, extinction): linear between two points, the last of equal points, constant outside."""
    points = np.column_stack([tf.colors, tf.extinctions])
    after = [k for k, value in enumerate(tf.values) if value > scalar]
    if not after:
        return [Fraction(v) for v in points[-1]]
    if after[0] == 0:
        return [Fraction(v) for v in points[0]]
    low, high = after[0] - 1, after[0]
    start, end = Fraction(tf.values[low]), Fraction(tf.values[high])
    t = (Fraction(scalar) - start) / (end - start)
    return [(1 - t) * Fraction(a) + t * Fraction(b) for a, b in zip(points[low], points[high], strict=True)]


@pytest.mark.parametrize("num", [1, 2, 3, 17, 256])
def test_values_between_control_points_are_linear(num: int) -> None:
    rng = np.random.default_rng(num)
    tf = random_transfer(rng, num)
    span = tf.values[-1] - tf.values[0] + 1
    scalars = np.concatenate([rng.uniform(tf.values[0] - span / 5, tf.values[-1] + span / 5, 200), tf.values])
    colors, extinctions = tf.classify(scalars)
    for got, scalar in zip(np.column_stack([colors, extinctions]), scalars, strict=True):
        for channel, want in zip(got, exact(tf, float(scalar)), strict=True):
            # Three roundings, of numbers up to 5: the difference and the quotient, the product, the sum.
            assert abs(Fraction(channel) - want) <= Fraction(5 * 4, 2**53)


def test_control_points_are_hit_exactly() -> None:
    tf = random_transfer(np.random.default_rng(5), 50)
    colors, extinctions = tf.classify(tf.values)
    np.testing.assert_array_equal(colors, tf.colors)
    np.testing.assert_array_equal(extinctions, tf.extinctions)


def test_the_value_of_a_step_belongs_to_its_upper_side() -> None:
    tf = transfer((0, (0, 0, 0), 0), (5, (0, 0, 0), 1), (5, (1, 1, 1), 3), (9, (1, 1, 1), 3))
    below, at = np.nextafter(5.0, 0.0), 5.0
    np.testing.assert_allclose(tf.classify(np.array([below, at]))[1], [1, 3], rtol=1e-15)
    np.testing.assert_array_equal(tf.classify(np.array([below, at]))[0], [[0, 0, 0], [1, 1, 1]])


def test_steps_at_the_ends() -> None:
    tf = transfer((2, (0, 0, 0), 7), (2, (0, 0, 0), 1), (4, (0, 0, 0), 1), (4, (0, 0, 0), 9))
    scalars = np.array([-1e300, np.nextafter(2.0, 0.0), 2, 3, np.nextafter(4.0, 0.0), 4, 1e300])
    # Below a step at the first value there is only its lower side.
    np.testing.assert_array_equal(tf.classify(scalars)[1], [7, 7, 1, 1, 1, 9, 9])


@pytest.mark.parametrize("dtype", [np.int8, np.uint64, np.float16, np.float32])
def test_scalars_of_any_dtype(dtype: type) -> None:
    tf = transfer((0, (0, 0, 0), 0), (100, (1, 1, 1), 10))
    np.testing.assert_allclose(tf.classify(np.array([0, 25, 100], dtype))[1], [0, 2.5, 10], rtol=1e-15)


def points(*opacities: tuple[float, float]) -> tuple[ControlPoint, ...]:
    return tuple(ControlPoint(value, (1, 1, 1), opacity) for value, opacity in opacities)


@pytest.mark.parametrize("unit", [1e-6, 0.5, 1.0, 3.0, 1e6])
def test_opacity_per_unit_is_extinction(unit: float) -> None:
    opacities = [1e-300, 1e-17, 0.25, 0.999]
    tf = make_transfer_function(TransferSpec(points(*enumerate(opacities)), unit), finest_spacing=1e-9)
    np.testing.assert_allclose(tf.extinctions, [-math.log1p(-a) / unit for a in opacities], rtol=1e-15)
    assert tf.unit == unit


def test_the_default_unit_is_the_finest_spacing() -> None:
    tf = make_transfer_function(TransferSpec(points((0, 0.5))), finest_spacing=0.25)
    assert tf.unit == 0.25
    assert tf.max_extinction == math.log(2) / 0.25


@pytest.mark.parametrize("spacing", [0.001, 1.0, 40.0])
def test_opacity_1_is_the_cap(spacing: float) -> None:
    tf = make_transfer_function(TransferSpec(points((0, 0.0), (1, 1.0)), 1.0), spacing)
    np.testing.assert_array_equal(tf.extinctions, [0, MAX_VOXEL_DEPTH / spacing])
    assert math.exp(-MAX_VOXEL_DEPTH / 2) < 1e-6  # opaque in any picture, also half way to opacity 0
    assert math.copysign(1, tf.extinctions[0]) == 1


def test_an_opacity_just_below_1_per_short_unit_meets_the_cap() -> None:
    tf = make_transfer_function(TransferSpec(points((0, 0.9)), 0.001), finest_spacing=1.0)
    assert tf.max_extinction == MAX_VOXEL_DEPTH


def test_control_values_as_large_as_float64_holds() -> None:
    tf = make_transfer_function(TransferSpec(points((-1.7e308, 0.0), (1.7e308, 0.5)), 1.0), 1.0)
    np.testing.assert_allclose(tf.classify(np.array([-1.7e308, 0, 1.7e308]))[1], [0, math.log(2) / 2, math.log(2)])


def colormap(*opacities: tuple[float, float], name: str = "viridis") -> TransferFunction:
    return make_transfer_function(TransferSpec(ColormapSpec(name, (10.0, 90.0), opacities), 1.0), 1.0)


@pytest.mark.parametrize("name", ["viridis", "viridis_r", "crameri:batlow"])
def test_colormap_and_opacity_are_interpolated_apart(name: str) -> None:
    opacities = ((0.0, 0.0), (20.0, 0.0), (33.3, 0.7), (50.0, 0.1), (120.0, 0.4))
    tf = colormap(*opacities, name=name)
    scalars = np.linspace(-10, 130, 5001)
    colors, extinctions = tf.classify(scalars)
    at, opacity = np.array(opacities).T
    np.testing.assert_allclose(extinctions, np.interp(scalars, at, -np.log1p(-opacity)), rtol=1e-12, atol=1e-15)
    samples, table = np.linspace(10, 90, NUM_COLORMAP_SAMPLES), np.array(colormap_points(name, NUM_COLORMAP_SAMPLES))
    for channel in range(3):
        want = np.interp(scalars, samples, table[:, channel])
        np.testing.assert_allclose(colors[:, channel], want, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("at", [40.0, 10.0 + 80.0 * 51 / 255])
def test_a_step_in_a_colormaps_opacity(at: float) -> None:
    """A step may lie between the colormap's samples, or at one of them."""
    tf = colormap((0.0, 0.0), (at, 0.0), (at, 0.5), (100.0, 0.5))
    below = np.nextafter(at, 0.0)
    colors, extinctions = tf.classify(np.array([below, at, 99.0]))
    np.testing.assert_allclose(extinctions, [0, math.log(2), math.log(2)], rtol=1e-15)
    np.testing.assert_allclose(colors[0], colors[1], atol=1e-12)  # the colour does not step
    assert np.all(np.diff(tf.values) >= 0)


def test_a_colormap_with_one_opacity_point_is_equally_opaque_everywhere() -> None:
    tf = colormap((1000.0, 0.5))
    np.testing.assert_array_equal(tf.extinctions, np.full(len(tf.values), math.log(2)))


def test_a_colormap_over_fewer_numbers_than_it_has_samples() -> None:
    """Every number has the colour of its own place in the range; those outside have the colours of its ends."""
    first = 1e6
    numbers = first + np.spacing(first) * np.arange(-1, 7)
    spec = ColormapSpec("viridis", (float(numbers[1]), float(numbers[6])), ((first, 0.5),))
    colors, _ = make_transfer_function(TransferSpec(spec, 1.0), 1.0).classify(numbers)
    table = np.array(colormap_points("viridis", NUM_COLORMAP_SAMPLES))
    at = np.array([0, 0, 51, 102, 153, 204, 255, 255])  # 255 / 5 samples from number to number
    np.testing.assert_allclose(colors, table[at], rtol=1e-12)
