"""The transfer function against exact rational arithmetic and numpy.interp."""

from __future__ import annotations

import math

import numpy as np
import pytest

from renderer.scene import ColormapSpec, ControlPoint, TransferSpec, colormap_points
from renderer.transfer import MAX_VOXEL_DEPTH, TransferFunction, make_transfer_function

# A colormap has so many control points.
NUM_COLORMAP_SAMPLES = 256


def points(*opacities: tuple[float, float]) -> tuple[ControlPoint, ...]:
    return tuple(ControlPoint(value, (1, 1, 1), opacity) for value, opacity in opacities)


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


def colormap(*opacities: tuple[float, float], name: str = "viridis") -> TransferFunction:
    return make_transfer_function(TransferSpec(ColormapSpec(name, (10.0, 90.0), opacities), 1.0), 1.0)


@pytest.mark.parametrize(("low", "high"), [(1e-26, 1e-20), (1e-3, 2e-3), (1.0, 1e9), (1e-300, 1e300)])
def test_a_logarithmic_scale_is_linear_in_logarithms(low: float, high: float) -> None:
    middle = math.sqrt(low) * math.sqrt(high)
    opacities = ((low, 0.0), (middle, 0.2), (middle, 0.7), (2 * high, 0.4))
    spec = ColormapSpec("viridis", (low, high), opacities, "log")
    tf = make_transfer_function(TransferSpec(spec, 1.0), 1.0)
    logs = np.linspace(math.log(low) - 3, math.log(high) + 3, 20000)  # none at the step
    colors, extinctions = tf.classify(np.exp(logs))
    at, opacity = np.log([value for value, _ in opacities]), np.array([each for _, each in opacities])
    depths = -np.log1p(-opacity)
    side = np.where(logs < at[1], np.interp(logs, at[:2], depths[:2]), np.interp(logs, at[2:], depths[2:]))
    np.testing.assert_allclose(extinctions, side, atol=0.005 * depths.max())
    table = np.array(colormap_points("viridis", NUM_COLORMAP_SAMPLES))
    shares, samples = (logs - math.log(low)) / (math.log(high) - math.log(low)), np.linspace(0, 1, len(table))
    for channel in range(3):
        np.testing.assert_allclose(colors[:, channel], np.interp(shares, samples, table[:, channel]), atol=0.005)
    # A step is at its own value, and what has no logarithm is below all.
    np.testing.assert_allclose(tf.classify(np.array([middle]))[1], depths[2], rtol=1e-12)
    lowest = tf.classify(np.array([-1.0, 0.0, low]))
    np.testing.assert_allclose(lowest[0], np.tile(table[0], (3, 1)), atol=1e-12)
    np.testing.assert_array_equal(lowest[1], 0)


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
