"""The pyramid against a dense one in plain float64 numpy, which shares no code with it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from renderer.pyramid import Level, Pyramid, build_pyramid
from renderer.pyramid.kernels import store_float16
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import TransferFunction
from renderer.volume import Volume, make_volume

Array = npt.NDArray[Any]
Float64 = npt.NDArray[np.float64]

# float16 rounds to 11 bits; means below 2^-14 of their scale of 2^15 are counted in units of 2^-24 of it.
HALF_RTOL, HALF_TINY = 2.0**-11, 2.0**-25 / 2.0**15
# Voxels are float32, merged in 5 levels of 3 roundings each.
SINGLE_RTOL = 1e-6

OPTICAL = ErrorSpec()
RMS = ErrorSpec(measure="rms")
SCALAR = ErrorSpec(measure="rms", of="scalar")
SINGLE = PyramidSpec(precision="single")
SHAPES = [
    (1, 1, 1),
    (1, 1, 70),
    (1, 2, 1),
    (3, 1, 129),
    (9, 17, 33),
    (7, 13, 31),
    (33, 65, 31),
    (40, 24, 72),
    (64, 64, 64),
    (90, 100, 110),
]


def volume(values: Array, world_from_index: Float64 | None = None) -> Volume:
    return make_volume(values, np.eye(4) if world_from_index is None else world_from_index, "test")


def oblique() -> Float64:
    """Anisotropic, sheared and left-handed."""
    affine = np.eye(4)
    affine[:3, :3] = [[0.5, 0.2, -0.1], [0.1, -0.9, 0.3], [0.0, 0.4, 2.0]]
    affine[:3, 3] = [10, -20, 30]
    return affine


def half_visible(low: float, high: float) -> TransferFunction:
    """Nothing below the middle of the range; a step, slopes and changing colours above."""
    at = low + (high - low) * np.array([0, 0.5, 0.5, 0.75, 1.0])
    colors = np.array([[0, 0, 0], [0, 0, 0], [1, 0.5, 0], [0.2, 1, 0.4], [0.9, 0.3, 1]])
    return TransferFunction(at, colors, np.array([0, 0, 0.02, 0.5, 3.0]), 1.0)


def noise(shape: tuple[int, int, int], dtype: Any, low: float, high: float, seed: int = 0) -> Volume:
    """Noise around a smooth field, with a transparent slab."""
    rng = np.random.default_rng(seed)
    z, y, x = np.indices(shape) / 20
    field = 0.5 + 0.3 * np.sin(x + 2 * y) * np.cos(z) + rng.normal(0, 0.1, shape)
    field[:, : shape[1] // 3] *= 0.1
    return volume((low + np.clip(field, 0, 1) * (high - low)).astype(dtype))


def gradient(values: Float64, axis: int) -> Float64:
    return np.asarray(np.gradient(values, axis=axis)) if values.shape[axis] > 1 else np.zeros_like(values)


def lighting(of: Volume, shading: ShadingSpec) -> Float64:
    """Lambert's law on the normal -g / |g|, g the gradient in the world."""
    values = of.values.astype(np.float64)
    index_gradient = np.stack([gradient(values, 2), gradient(values, 1), gradient(values, 0)], axis=-1)
    g = index_gradient @ np.linalg.inv(of.world_from_index[:3, :3])
    length = np.linalg.norm(g, axis=-1)
    light = np.array(shading.light) / np.linalg.norm(shading.light)
    toward = np.divide(-g @ light, length, out=np.zeros_like(length), where=length > 0)
    return np.asarray(shading.ambient + shading.diffuse * np.maximum(toward, 0))


def channels(of: Volume, tf: TransferFunction, *, opacity: bool, shading: ShadingSpec | None = None) -> Float64:
    """[z, y, x, 4]: (tau c, tau) h0, or (a c, a)."""
    colors, extinctions = tf.classify(of.values)
    depths = extinctions * of.spacing.min()
    weights = -np.expm1(-depths) if opacity else depths
    if shading:
        colors = colors * lighting(of, shading)[..., None]
    return np.concatenate([colors * weights[..., None], weights[..., None]], axis=-1)


def cell_sums(values: Array, side: int) -> Array:
    for axis in range(3):
        values = np.add.reduceat(values, np.arange(0, values.shape[axis], side), axis=axis)
    return values


def cell_means(values: Float64, side: int) -> Float64:
    count = cell_sums(np.ones(values.shape[:3]), side)
    return np.asarray(cell_sums(values, side) / count[..., None])


def cell_errors(values: Float64, side: int) -> Float64:
    """Root of the mean squared distance of the voxels from the mean of their cell; two passes, no cancellation."""
    spread = cell_means(values, side)
    for axis in range(3):
        spread = np.repeat(spread, side, axis=axis)
    size_z, size_y, size_x = values.shape[:3]
    squares = np.sum((values - spread[:size_z, :size_y, :size_x]) ** 2, axis=-1, keepdims=True)
    return np.asarray(np.sqrt(cell_means(squares, side)[..., 0]))


@dataclass(frozen=True)
class DenseLevel:
    """One level of a pyramid spread out to [z, y, x]; where no node is stored everything is 0."""

    stored: npt.NDArray[np.bool_]
    means: Float64
    errors: Float64


def morton(cells: Array) -> Array:
    """One integer for (x, y, z), x in the lowest bit."""
    code = np.zeros(len(cells), np.int64)
    for bit in range(20):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return code


def child_cells(level: Level, cells: Array) -> Array:
    """Walk down the masks; `first_children` must number the children in order and without a gap."""
    bits = level.masks[:, None] >> np.arange(8) & 1 == 1
    assert bits.any(axis=1).all()
    np.testing.assert_array_equal(level.first_children, np.cumsum(bits.sum(axis=1)) - bits.sum(axis=1))
    parent, k = np.nonzero(bits)
    return 2 * cells[parent] + np.stack([k & 1, k >> 1 & 1, k >> 2], axis=1)


def dense_levels(pyramid: Pyramid) -> list[DenseLevel]:
    """Level 1 first; checks the links between the levels on the way down."""
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
    """Every node of every level against the dense reference."""
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
    for number, level in enumerate(levels, start=1):
        means, errors = cell_means(averaged, 2**number), cell_errors(measured, 2**number)
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
def test_every_node_of_any_shape(shape: tuple[int, int, int]) -> None:
    check(noise(shape, np.uint8, 0, 255), half_visible(0, 255), PyramidSpec(), OPTICAL)


@pytest.mark.parametrize("average", ["extinction", "opacity"])
@pytest.mark.parametrize("precision", ["half", "single"])
@pytest.mark.parametrize("error", [OPTICAL, RMS, SCALAR], ids=["optical", "rms", "scalar"])
def test_every_quantity(average: Any, precision: Any, error: ErrorSpec) -> None:
    of = replace(noise((33, 37, 41), np.uint8, 0, 255), world_from_index=oblique())
    check(of, half_visible(0, 255), PyramidSpec(average, precision), error)


@pytest.mark.parametrize(("dtype", "low", "high"), [(np.uint16, 100, 60000), (np.float32, -0.7, 1.9)])
@pytest.mark.parametrize("error", [OPTICAL, RMS, SCALAR], ids=["optical", "rms", "scalar"])
def test_wider_voxels(dtype: Any, low: float, high: float, error: ErrorSpec) -> None:
    check(noise((35, 17, 66), dtype, low, high), half_visible(low, high), SINGLE, error)


@pytest.mark.parametrize("dtype", [np.int16, np.float32])
@pytest.mark.parametrize("error", [OPTICAL, RMS, SCALAR], ids=["optical", "rms", "scalar"])
def test_shading(dtype: Any, error: ErrorSpec) -> None:
    of = replace(noise((34, 1, 45), dtype, -3000, 3000), world_from_index=oblique())
    check(of, half_visible(-3000, 3000), SINGLE, error, ShadingSpec(0.25, 0.7, (1.0, -2.0, 0.5)))


def test_shading_brighter_than_white_and_flat_regions() -> None:
    values = np.full((20, 20, 20), 200, np.uint8)
    values[5:9] = 255
    check(volume(values), half_visible(0, 255), PyramidSpec(), OPTICAL, ShadingSpec(1.0, 1.0, (0.0, 0.0, -1.0)))


def test_root_is_the_mean_of_the_volume() -> None:
    of = noise((50, 70, 90), np.uint8, 0, 255)
    root = build_pyramid(of, half_visible(0, 255), spec=SINGLE, error=OPTICAL)
    want = channels(of, half_visible(0, 255), opacity=False).reshape(-1, 4)
    np.testing.assert_allclose(root.levels[-1].means[0] * root.mean_unit, want.mean(axis=0), rtol=SINGLE_RTOL)
    rms = np.sqrt(want.var(axis=0).sum())
    np.testing.assert_allclose(root.levels[-1].errors[0] * root.error_unit, rms, rtol=SINGLE_RTOL)


def test_a_transparent_volume_has_no_nodes() -> None:
    pyramid = build_pyramid(
        volume(np.zeros((40, 3, 70), np.uint8)), half_visible(0, 255), spec=PyramidSpec(), error=OPTICAL
    )
    assert pyramid.num_levels == 7
    assert [len(level.means) for level in pyramid.levels] == [0] * 7


def test_one_visible_voxel_is_one_path() -> None:
    values = np.zeros((70, 70, 70), np.uint8)
    values[69, 0, 37] = 255
    pyramid = check(volume(values), half_visible(0, 255), PyramidSpec(), OPTICAL)
    assert [len(level.means) for level in pyramid.levels] == [1] * 7


@pytest.mark.parametrize("error", [OPTICAL, RMS, SCALAR], ids=["optical", "rms", "scalar"])
@pytest.mark.parametrize("average", ["extinction", "opacity"])
def test_a_million_equal_voxels_have_no_error(error: ErrorSpec, average: Any) -> None:
    """Exactly none, whatever the shape and the value: 0.1 and 1 / 3 are no binary numbers."""
    tf = TransferFunction(np.array([0.0, 1.0]), np.array([[0.1, 0.3, 0.7]] * 2), np.array([0.0, 1 / 3]), 1.0)
    for shape in ((101, 99, 103), (1, 1, 1000000)):
        of = volume(np.full(shape, 0.1, np.float32))
        pyramid = build_pyramid(of, tf, spec=PyramidSpec(average), error=error)
        assert all(np.all(level.errors == 0) for level in pyramid.levels)
        assert all(np.all(level.means == level.means[0]) for level in pyramid.levels)


def test_scalars_far_from_zero_and_close_together() -> None:
    rng = np.random.default_rng(0)
    values = 1e6 + rng.uniform(-0.01, 0.01, (40, 33, 35))
    check(volume(values), half_visible(1e6 - 0.01, 1e6 + 0.01), SINGLE, SCALAR)


def test_scalars_close_together_in_a_volume_of_wide_range() -> None:
    """The spread of most nodes is 1e-9 of the range: means of scalars need float64."""
    rng = np.random.default_rng(0)
    values = 1e6 + rng.uniform(-0.001, 0.001, (32, 32, 64))
    values[0, 0, 0] = -1e6
    pyramid = build_pyramid(
        volume(values), TransferFunction(np.zeros(1), np.ones((1, 3)), np.ones(1), 1.0), spec=SINGLE, error=SCALAR
    )
    got = dense_levels(pyramid)[3].errors * 1.0
    want = cell_errors(values[..., None], 16)
    np.testing.assert_allclose(got.ravel()[1:], want.ravel()[1:], rtol=1e-5)


def test_scalars_on_a_pedestal() -> None:
    rng = np.random.default_rng(0)
    values = (60000 + rng.integers(0, 3, (40, 33, 35))).astype(np.uint16)
    check(volume(values), half_visible(0, 65535), SINGLE, SCALAR)


@pytest.mark.parametrize("scale", [1e30, 1e-41, 3e38])
@pytest.mark.parametrize("error", [OPTICAL, SCALAR], ids=["optical", "scalar"])
def test_scalars_at_the_ends_of_float32(scale: float, error: ErrorSpec) -> None:
    of = noise((17, 18, 35), np.float32, 0, scale)
    assert np.isfinite(of.values).all()
    check(of, half_visible(0, scale), SINGLE, error)


@pytest.mark.parametrize("ends", [(-1.7e308, 1.7e308), (0.0, 5e-324), (0.0, 1e-310)])
def test_scalars_at_the_ends_of_float64_stay_finite(ends: tuple[float, float]) -> None:
    values = np.array(ends)[np.random.default_rng(0).integers(0, 2, (20, 20, 20))]
    tf = TransferFunction(np.array([0.0, 0.0]), np.ones((2, 3)), np.array([0.0, 1.0]), 1.0)
    for error in (OPTICAL, RMS, SCALAR):
        pyramid = build_pyramid(volume(values), tf, spec=PyramidSpec(), error=error)
        for level in pyramid.levels:
            assert np.all(np.isfinite(level.means))
            assert np.all(level.means >= 0)
            assert np.all(np.isfinite(level.errors))
            assert np.all(level.errors >= 0)


@pytest.mark.parametrize("faintest", [1e-44, 1e-30, 1e-12])
def test_faint_voxels_beside_opaque_ones_make_no_nan(faintest: float) -> None:
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


@pytest.mark.parametrize("error", [OPTICAL, SCALAR], ids=["optical", "scalar"])
def test_the_number_of_threads_changes_no_byte(error: ErrorSpec) -> None:
    of = noise((100, 130, 200), np.uint8, 0, 255)
    first, *others = (
        build_pyramid(of, half_visible(0, 255), spec=PyramidSpec(), error=error, num_threads=n) for n in (1, 2, 5, 2)
    )
    for other in others:
        for a, b in zip(first.levels, other.levels, strict=True):
            for name in ("means", "errors", "masks", "first_children"):
                assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name


def test_light_on_scalars_at_the_ends_of_float64_stays_finite() -> None:
    values = np.random.default_rng(0).choice([-1.7e308, 0.0, 1e-320, 1.7e308], (20, 20, 20))
    tf = TransferFunction(np.zeros(1), np.ones((1, 3)), np.ones(1), 1.0)
    pyramid = build_pyramid(
        volume(values), tf, spec=PyramidSpec(), error=OPTICAL, shading=ShadingSpec(0.3, 0.7, (1.0, -1.0, 1.0))
    )
    for level in pyramid.levels:
        assert np.all(np.isfinite(level.means))
        assert np.all(level.means[:, :3] <= level.means[:, 3:])


@pytest.mark.parametrize("exponent", [-1074, 1015])
def test_light_depends_on_the_direction_of_the_gradient_alone(exponent: int) -> None:
    """Scalars that are a few of the smallest numbers, or whose sums overflow, are lit as plain ones."""
    tf = TransferFunction(np.zeros(1), np.ones((1, 3)), np.ones(1), 1.0)
    plain = np.random.default_rng(0).integers(-200, 200, (9, 1, 20)).astype(np.float64)
    means = [
        build_pyramid(volume(values), tf, spec=SINGLE, error=OPTICAL, shading=ShadingSpec()).levels[0].means
        for values in (plain, np.ldexp(plain, exponent))
    ]
    np.testing.assert_array_equal(*means)


@pytest.mark.parametrize("extinction", [1e-300, 1e-25, 1e-20])
@pytest.mark.parametrize("spec", [PyramidSpec(), SINGLE], ids=["half", "single"])
def test_a_volume_that_is_all_but_transparent(extinction: float, spec: PyramidSpec) -> None:
    """A depth below 2^-80 a voxel is none; above, its mean is kept to full precision."""
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
    got = np.empty(len(values), np.uint16)
    store_float16(values / np.float32(4), 4.0, got)
    nearest = values.astype(np.float16).astype(np.float64)
    error = np.abs(got.view(np.float16).astype(np.float64) - values)
    # Only where the two neighbours are equally near may it be another one than numpy's.
    np.testing.assert_array_equal(error, np.abs(nearest - values))


def test_arrays_are_read_only() -> None:
    pyramid = build_pyramid(
        noise((9, 9, 40), np.uint8, 0, 255), half_visible(0, 255), spec=PyramidSpec(), error=OPTICAL
    )
    for level in pyramid.levels:
        for array in (level.means, level.errors, level.masks, level.first_children):
            assert not array.flags.writeable
