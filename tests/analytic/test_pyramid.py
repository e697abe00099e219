"""The pyramid against a dense one in plain float64 numpy, which shares no code with it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from brick_reference import index_gradients, light_factor
from dense_bricks import OBLIQUE, means_over_cells, spread_of_cells, sums_over_cells

from renderer.pyramid import Level, Pyramid, build_pyramid, store_scaled
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import TransferFunction
from renderer.volume import Array, Bools, Float64, Volume, make_volume

# float16 rounds to 11 bits; means below 2^-14 of their scale of 2^15 are counted in units of 2^-24 of it.
HALF_RTOL, HALF_TINY = 2.0**-11, 2.0**-25 / 2.0**15
# Voxels are float32, merged in 5 levels of 3 roundings each.
SINGLE_RTOL = 1e-6

OPTICAL = ErrorSpec()
RMS = ErrorSpec(measure="rms")
SCALAR = ErrorSpec(measure="rms", of="scalar")
SINGLE = PyramidSpec(precision="single")
SHAPES = [(1, 1, 1), (3, 1, 129), (9, 17, 33), (64, 64, 64), (33, 90, 70)]


def volume(values: Array, world_from_index: Float64 | None = None) -> Volume:
    return make_volume(values, np.eye(4) if world_from_index is None else world_from_index, "test")


def half_visible(low: float, high: float) -> TransferFunction:
    """Return a function that shows nothing in the lower half of the range; steps, slopes and colours above."""
    at = low + (high - low) * np.array([0, 0.5, 0.5, 0.75, 1.0])
    colors = np.array([[0, 0, 0], [0, 0, 0], [1, 0.5, 0], [0.2, 1, 0.4], [0.9, 0.3, 1]])
    return TransferFunction(at, colors, np.array([0, 0, 0.02, 0.5, 3.0]), 1.0)


def noise(shape: tuple[int, int, int], dtype: Any, low: float, high: float, seed: int = 0) -> Volume:
    """Return noise around a smooth field, with a transparent slab."""
    rng = np.random.default_rng(seed)
    z, y, x = np.indices(shape) / 20
    field = 0.5 + 0.3 * np.sin(x + 2 * y) * np.cos(z) + rng.normal(0, 0.1, shape)
    field[:, : shape[1] // 3] *= 0.1
    return volume((low + np.clip(field, 0, 1) * (high - low)).astype(dtype))


def lighting(of: Volume, shading: ShadingSpec) -> Float64:
    """Return Lambert's factor on the normal -g / |g|, with g the gradient in the world."""
    g = index_gradients(of.values.astype(np.float64)) @ np.linalg.inv(of.world_from_index[:3, :3])
    return light_factor(shading, g.reshape(-1, 3)).reshape(of.values.shape)


def channels(of: Volume, tf: TransferFunction, *, opacity: bool, shading: ShadingSpec | None = None) -> Float64:
    """Return (tau c, tau) h0, or (a c, a), [z, y, x, 4]."""
    colors, extinctions = tf.classify(of.values)
    depths = extinctions * of.spacing.min()
    weights = -np.expm1(-depths) if opacity else depths
    if shading:
        colors = colors * lighting(of, shading)[..., None]
    return np.concatenate([colors * weights[..., None], weights[..., None]], axis=-1)


@dataclass(frozen=True)
class DenseLevel:
    """One level of a pyramid spread out to [z, y, x]; where no node is stored everything is 0."""

    stored: Bools
    means: Float64
    errors: Float64


def morton(cells: Array) -> Array:
    """Return one integer for each (x, y, z), x in the lowest bit."""
    code = np.zeros(len(cells), np.int64)
    for bit in range(20):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return code


def child_cells(level: Level, cells: Array) -> Array:
    """Return the children of cells by their masks; `first_children` must number them in order and without a gap."""
    bits = level.masks[:, None] >> np.arange(8) & 1 == 1
    assert bits.any(axis=1).all()
    np.testing.assert_array_equal(level.first_children, np.cumsum(bits.sum(axis=1)) - bits.sum(axis=1))
    parent, k = np.nonzero(bits)
    return 2 * cells[parent] + np.stack([k & 1, k >> 1 & 1, k >> 2], axis=1)


def dense_levels(pyramid: Pyramid) -> list[DenseLevel]:
    """Return all levels, level 1 first; check the links between them on the way down."""
    shape_xyz = np.array(pyramid.volume.shape_xyz)
    cells = np.zeros((len(pyramid.levels[-1].means), 3), np.int64)
    dense: list[DenseLevel] = []
    for number in range(pyramid.num_levels, 0, -1):
        level = pyramid.levels[number - 1]
        assert len(cells) == len(level.means) == len(level.errors)
        assert np.all(np.diff(morton(cells)) > 0)
        size = -(-shape_xyz // 2**number)
        assert np.all(cells < size)
        at = tuple(cells.T[::-1])
        part = DenseLevel(np.zeros(size[::-1], bool), np.zeros((*size[::-1], 4)), np.zeros(size[::-1]))
        part.stored[at] = True
        part.means[at] = level.means.astype(np.float64) * pyramid.mean_unit
        part.errors[at] = level.errors.astype(np.float64) * pyramid.error_unit
        dense.insert(0, part)
        if number > 1:
            cells = child_cells(level, cells)
        else:
            assert len(level.masks) == len(level.first_children) == 0
    return dense


def check(
    of: Volume, tf: TransferFunction, spec: PyramidSpec, error: ErrorSpec, shading: ShadingSpec | None = None
) -> Pyramid:
    """Compare every node of every level with the dense reference."""
    pyramid = build_pyramid(of, tf, spec=spec, error=error, shading=shading)
    averaged = channels(of, tf, opacity=spec.average == "opacity", shading=shading)
    measured = channels(of, tf, opacity=error.measure == "rms", shading=shading)
    if error.of == "scalar":
        measured = of.values.astype(np.float64)[..., None]
    rtol = SINGLE_RTOL if spec.precision == "single" else HALF_RTOL + SINGLE_RTOL
    tiny = 0.0 if spec.precision == "single" else 2 * HALF_TINY
    levels = dense_levels(pyramid)
    assert max(of.shape_xyz) <= 2 ** len(levels)
    assert len(levels) == 1 or max(of.shape_xyz) > 2 ** (len(levels) - 1)
    occupied = sums_over_cells(averaged[..., 3] > 0, pyramid.occupied_level) > 0
    np.testing.assert_array_equal(pyramid.occupied, occupied)
    assert max(occupied.shape) <= 128 and (max(occupied.shape) > 64 or pyramid.occupied_level == 1)
    for number, level in enumerate(levels, start=1):
        assert not any(array.flags.writeable for array in pyramid.levels[number - 1])
        means, errors = means_over_cells(averaged, number), spread_of_cells(measured, number)
        np.testing.assert_array_equal(level.stored, means[..., 3] > 0)
        if spec.average == "opacity":  # stored as the depth that has it
            means *= np.divide(
                -np.log1p(-means[..., 3:]), means[..., 3:], out=means[..., 3:] * 0, where=means[..., 3:] > 0
            )
        largest = channels(of, tf, opacity=False, shading=shading).max()
        np.testing.assert_allclose(level.means, means, rtol=rtol, atol=tiny * largest)
        errors[~level.stored] = 0
        # The square root of what is left of float32 numbers that cancel: an error of 1e-6 of the largest of them.
        spread = np.ptp(measured) if error.of == "scalar" else measured.max()
        np.testing.assert_allclose(level.errors, errors, rtol=rtol, atol=(SINGLE_RTOL + tiny) * spread)
    return pyramid


@pytest.mark.parametrize("shape", SHAPES)
def test_every_node_equals_the_dense_reference(shape: tuple[int, int, int]) -> None:
    check(noise(shape, np.uint8, 0, 255), half_visible(0, 255), PyramidSpec(), OPTICAL)


LIGHT = ShadingSpec(0.25, 0.7, (1.0, -2.0, 0.5))
BYTES = ((33, 37, 41), np.uint8, 0.0, 255.0)


@pytest.mark.parametrize(
    ("values", "spec", "error", "shading"),
    [
        (BYTES, SINGLE, OPTICAL, None),
        (BYTES, PyramidSpec("opacity", "half"), OPTICAL, None),
        (BYTES, PyramidSpec("extinction", "half"), RMS, None),
        (BYTES, PyramidSpec("opacity", "single"), RMS, None),
        (BYTES, PyramidSpec("extinction", "half"), SCALAR, None),
        (BYTES, PyramidSpec("opacity", "single"), SCALAR, None),
        (((35, 17, 66), np.uint16, 100.0, 6e4), SINGLE, RMS, None),
        (((35, 17, 66), np.uint16, 100.0, 6e4), SINGLE, SCALAR, None),
        (((35, 17, 66), np.float32, -0.7, 1.9), SINGLE, OPTICAL, None),
        (((34, 1, 45), np.int16, -3e3, 3e3), SINGLE, OPTICAL, LIGHT),
        (((34, 1, 45), np.float32, -3e3, 3e3), SINGLE, RMS, LIGHT),
        (((34, 1, 45), np.int16, -3e3, 3e3), SINGLE, SCALAR, LIGHT),
    ],
)
def test_every_type_average_precision_measure_and_light(
    values: Any, spec: PyramidSpec, error: ErrorSpec, shading: ShadingSpec | None
) -> None:
    check(replace(noise(*values), world_from_index=OBLIQUE), half_visible(*values[2:]), spec, error, shading)


@pytest.mark.parametrize("faintest", [1e-44, 1e-30, 1e-12])
def test_faint_voxels_beside_opaque_voxels_stay_finite(faintest: float) -> None:
    values = np.zeros((40, 40, 40), np.uint8)
    values[::7, ::5, ::3] = 1
    values[20:, 20:, 20:] = 2
    tf = TransferFunction(np.arange(3.0), np.ones((3, 3)), np.array([0, faintest, 40.0]), 1.0)
    for average in ("extinction", "opacity"):
        pyramid = build_pyramid(volume(values), tf, spec=PyramidSpec(average), error=OPTICAL)
        for level in pyramid.levels:
            assert np.all(np.isfinite(level.means))
            assert np.all(level.means >= 0)
            assert np.all(np.isfinite(level.errors))
            assert np.all(level.errors >= 0)


@pytest.mark.parametrize("extinction", [1e-300, 1e-25, 1e-20])
@pytest.mark.parametrize("spec", [PyramidSpec(), SINGLE], ids=["half", "single"])
def test_depths_below_the_visibility_threshold_are_dropped(extinction: float, spec: PyramidSpec) -> None:
    """Voxels of a depth below 2^-80 are dropped; above, the mean keeps full precision."""
    tf = TransferFunction(np.zeros(1), np.ones((1, 3)), np.full(1, extinction), 1.0)
    pyramid = build_pyramid(volume(np.ones((9, 9, 40), np.uint8)), tf, spec=spec, error=OPTICAL)
    means = pyramid.levels[-1].means.astype(np.float64) * pyramid.mean_unit
    assert len(means) == (extinction > 2.0**-80)
    np.testing.assert_allclose(means, np.full(means.shape, extinction), rtol=HALF_RTOL)


def test_float16_is_rounded_to_nearest() -> None:
    halves = np.arange(0x7800, dtype=np.uint16).view(np.float16)  # from 0 to 2^15, denormal ones included
    between = (halves[:-1].astype(np.float64) + halves[1:]) / 2
    values = np.concatenate([halves.astype(np.float32), between.astype(np.float32)])
    values = np.concatenate([values, np.nextafter(values, np.float32(0)), np.nextafter(values, np.float32(1e9))])
    values = values[values <= 2.0**15]
    got = np.empty(len(values), np.float16)
    store_scaled(values / np.float32(4), 4.0, got)
    nearest = values.astype(np.float16).astype(np.float64)
    error = np.abs(got.astype(np.float64) - values)
    # Only where the two neighbours are equally near may it be another one than numpy's.
    np.testing.assert_array_equal(error, np.abs(nearest - values))
