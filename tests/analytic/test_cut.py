"""The cut covers every visible voxel exactly once, with cells that meet the tolerance."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from renderer.pyramid import Cut, Pyramid, build_pyramid, cut_pyramid
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import TransferFunction
from renderer.volume import Volume, make_volume

Array = npt.NDArray[Any]
Float64 = npt.NDArray[np.float64]

OPTICAL = ErrorSpec()
RMS = ErrorSpec(measure="rms")
SCALAR = ErrorSpec(measure="rms", of="scalar")
MEASURES = pytest.mark.parametrize("error", [OPTICAL, RMS, SCALAR], ids=["optical", "rms", "scalar"])
# A mean in float16 is off by 2^-11 at most, and by a few roundings of float32.
HALF_RTOL = 2.0**-11 + 2e-6


def oblique() -> Float64:
    """Anisotropic, sheared and left-handed."""
    affine = np.eye(4)
    affine[:3, :3] = [[0.5, 0.2, -0.1], [0.1, -0.9, 0.3], [0.0, 0.4, 2.0]]
    return affine


def blobs(shape: tuple[int, int, int], dtype: Any = np.uint8, seed: int = 0) -> Volume:
    """Smooth blobs with noise on a transparent background."""
    rng = np.random.default_rng(seed)
    z, y, x = np.indices(shape)
    field = np.zeros(shape)
    for centre in rng.uniform(0, shape, (3, 3)):
        radius = rng.uniform(3, 20)
        squares = (z - centre[0]) ** 2 + (y - centre[1]) ** 2 + (x - centre[2]) ** 2
        field += np.exp(-squares / radius**2)
    field = np.clip(field + rng.normal(0, 0.02, shape), 0, 1)
    return make_volume((field * 250).astype(dtype), oblique(), "blobs")


def transfer(deepest: float = 3.0) -> TransferFunction:
    colors = np.array([[0, 0, 0], [0, 0.5, 1], [1, 0.5, 0.1], [0.2, 1, 0.4]])
    return TransferFunction(np.array([0.0, 60, 120, 250]), colors, np.array([0, 0, 0.3, deepest]), 1.0)


def voxel_depths(of: Volume, tf: TransferFunction) -> Float64:
    """[z, y, x, 4]: (tau c, tau) h0."""
    colors, extinctions = tf.classify(of.values)
    extinctions = extinctions * of.spacing.min()
    return np.concatenate([colors * extinctions[..., None], extinctions[..., None]], axis=-1)


def build(of: Volume, tf: TransferFunction, error: ErrorSpec = OPTICAL, spec: PyramidSpec | None = None) -> Pyramid:
    return build_pyramid(of, tf, spec=spec or PyramidSpec(), error=error)


def voxels_of(cut: Cut) -> tuple[npt.NDArray[np.int64], tuple[Array, Array, Array]]:
    """Each voxel of each cell: which cell [m], and its index (z, y, x), each [m]."""
    owners, voxels = [np.zeros(0, np.int64)], [np.zeros((0, 3), np.int64)]
    for level in np.unique(cut.levels):
        cells = np.flatnonzero(cut.levels == level)
        offsets = np.indices((1 << level,) * 3).reshape(3, -1).T
        inside = cut.cells[cells][:, None].astype(np.int64) * (1 << level) + offsets
        real = np.all(inside < cut.volume.shape_xyz, axis=-1)
        owners.append(np.repeat(cells, real.sum(axis=1)))
        voxels.append(inside[real])
    x, y, z = np.concatenate(voxels).T
    return np.concatenate(owners), (z, y, x)


def coverage(cut: Cut) -> npt.NDArray[np.int64]:
    """[z, y, x]: how many cells each voxel lies in."""
    count = np.zeros(cut.volume.values.shape, np.int64)
    np.add.at(count, voxels_of(cut)[1], 1)
    return count


def cell_means(cut: Cut, values: Float64) -> Float64:
    """[n, c]: mean of values [z, y, x, c] over each cell's voxels."""
    owner, voxel = voxels_of(cut)
    count = np.bincount(owner, minlength=len(cut))
    sums = [np.bincount(owner, values[..., channel][voxel], len(cut)) for channel in range(values.shape[-1])]
    return np.asarray(np.stack(sums, axis=-1) / count[:, None])


def cell_errors(cut: Cut, values: Float64) -> Float64:
    """[n]: root mean squared distance of values [z, y, x, c] from each cell's mean; two passes, no cancellation."""
    owner, voxel = voxels_of(cut)
    squares = np.sum((values[voxel] - cell_means(cut, values)[owner]) ** 2, axis=-1)
    return np.asarray(np.sqrt(np.bincount(owner, squares, len(cut)) / np.bincount(owner, minlength=len(cut))))


def parents_of(cut: Cut) -> Cut:
    """The parents of all cells, each once, as a cut (whose cells overlap)."""
    table = np.unique(np.column_stack([cut.levels + 1, cut.cells >> 1]), axis=0)
    return replace(cut, levels=table[:, 0].astype(np.uint8), cells=table[:, 1:].astype(np.int32))


@MEASURES
@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 5, 2), (33, 20, 65), (40, 47, 23)])
@pytest.mark.parametrize("tolerance", [0.0, 1e-3, 0.05, 0.4, 1e9])
def test_every_visible_voxel_lies_in_one_cell(shape: tuple[int, int, int], tolerance: float, error: ErrorSpec) -> None:
    of = blobs(shape)
    cut = cut_pyramid(build(of, transfer(), error), tolerance)
    count = coverage(cut)
    visible = voxel_depths(of, transfer())[..., 3] > 0
    assert count.max(initial=0) <= 1
    assert np.all(count[visible] == 1)
    assert np.all(cut.depths[:, 3] > 0)
    assert np.all(np.diff(cut.levels.astype(int)) <= 0)


@MEASURES
def test_tolerance_0_is_every_visible_voxel(error: ErrorSpec) -> None:
    """Even where all voxels are equal: the error must be *below* the tolerance."""
    for of in (blobs((20, 33, 37)), make_volume(np.full((9, 8, 17), 200, np.uint8), np.eye(4), "equal")):
        cut = cut_pyramid(build(of, transfer(), error), 0.0)
        want = voxel_depths(of, transfer())
        assert np.all(cut.levels == 0)
        assert len(cut) == np.count_nonzero(want[..., 3])
        x, y, z = cut.cells.T
        np.testing.assert_allclose(cut.depths, want[z, y, x], rtol=2e-7)


@MEASURES
def test_a_finer_tolerance_never_gives_fewer_cells(error: ErrorSpec) -> None:
    pyramid = build(blobs((33, 47, 65)), transfer(), error)
    numbers = [len(cut_pyramid(pyramid, tolerance)) for tolerance in (*np.geomspace(100, 1e-6, 30), 0.0)]
    assert np.all(np.diff(numbers) >= 0)
    assert numbers[0] < numbers[-1]


@pytest.mark.parametrize("tolerance", [0.01, 0.1, 0.5])
def test_leaves_meet_the_tolerance_and_their_parents_do_not(tolerance: float) -> None:
    of = blobs((33, 47, 65))
    depths = voxel_depths(of, transfer())
    volume_of_voxel = of.voxel_volume

    def optical(cut: Cut) -> Float64:
        sides = np.cbrt(np.bincount(voxels_of(cut)[0]) * volume_of_voxel)
        return np.asarray(cell_errors(cut, depths) * sides / of.spacing.min())

    cut = cut_pyramid(build(of, transfer()), tolerance)
    leaves = cut.levels > 0
    assert 0 < np.count_nonzero(leaves) < len(cut)
    assert np.all(optical(cut)[leaves] < tolerance * (1 + HALF_RTOL))
    assert np.all(optical(parents_of(cut)) >= tolerance * (1 - HALF_RTOL))


@pytest.mark.parametrize(("error", "tolerance"), [(RMS, 0.05), (SCALAR, 8.0)], ids=["rms", "scalar"])
def test_rms_of_leaves_and_of_their_parents(error: ErrorSpec, tolerance: float) -> None:
    of = blobs((33, 47, 65))
    depths = voxel_depths(of, transfer())
    opacity = -np.expm1(-depths[..., 3:])
    colors = transfer().classify(of.values)[0]
    measured = np.concatenate([colors * opacity, opacity], axis=-1)
    if error.of == "scalar":
        measured = of.values[..., None].astype(float)
    cut = cut_pyramid(build(of, transfer(), error), tolerance)
    assert np.all(cell_errors(cut, measured)[cut.levels > 0] < tolerance * (1 + HALF_RTOL))
    assert np.all(cell_errors(parents_of(cut), measured) >= tolerance * (1 - HALF_RTOL))


def test_the_error_of_the_scalar_is_in_data_units() -> None:
    """Two values 10 apart, half and half: 5 in root mean square."""
    values = np.zeros((8, 8, 8), np.int16)
    values[::2] = 10
    pyramid = build(make_volume(values - 3000, np.eye(4), ""), TransferFunction(*opaque()), SCALAR)
    assert len(cut_pyramid(pyramid, 5.01)) == 1
    assert len(cut_pyramid(pyramid, 4.99)) == 512


def opaque() -> tuple[Float64, Float64, Float64, float]:
    return np.zeros(1), np.ones((1, 3)), np.ones(1), 1.0


@pytest.mark.parametrize("average", ["extinction", "opacity"])
@pytest.mark.parametrize("tolerance", [0.0, 0.05, 0.5, 1e9])
def test_cells_hold_the_mean_of_their_voxels(average: Any, tolerance: float) -> None:
    of = blobs((33, 20, 65))
    depths = voxel_depths(of, transfer())
    cut = cut_pyramid(build(of, transfer(), spec=PyramidSpec(average)), tolerance)
    if average == "extinction":
        np.testing.assert_allclose(cut.depths, cell_means(cut, depths), rtol=HALF_RTOL, atol=1e-9)
        return
    opacity = -np.expm1(-depths)[..., 3:]
    colors = transfer().classify(of.values)[0]
    mean = cell_means(cut, np.concatenate([colors * opacity, opacity], axis=-1))
    want = mean * (-np.log1p(-mean[:, 3:]) / mean[:, 3:])
    np.testing.assert_allclose(cut.depths, want, rtol=HALF_RTOL, atol=1e-9)


@pytest.mark.parametrize("precision", ["half", "single"])
@pytest.mark.parametrize("deepest", [9.0, 40.0])
def test_averages_of_opacities_near_1_are_no_deeper_than_the_deepest_voxel(precision: Any, deepest: float) -> None:
    of = make_volume(np.full((16, 16, 16), 250, np.uint8), np.eye(4), "opaque")
    pyramid = build(of, transfer(deepest), spec=PyramidSpec("opacity", precision))
    for tolerance in (0.0, 1.0):
        depths = cut_pyramid(pyramid, tolerance).depths
        assert np.all(depths[:, 3] <= np.float32(deepest))
        assert np.all(depths[:, 3] > min(0.99 * deepest, 16))  # float32 tells opacities apart to 2^-24, a depth of 16.6
        np.testing.assert_allclose(depths[:, :3], depths[:, 3:] * [0.2, 1, 0.4], rtol=HALF_RTOL)


@pytest.mark.parametrize("precision", ["half", "single"])
def test_a_mean_of_almost_opaque_voxels_keeps_its_depth(precision: Any) -> None:
    """Half of the voxels at 0.9996 and half at 1 are as deep as 0.9998, which in float16 would be 1."""
    values = (np.indices((8, 8, 8)).sum(axis=0) % 2).astype(np.uint8)
    depths = np.array([-np.log1p(-0.9996), 40.0])
    tf = TransferFunction(np.array([0.0, 1.0]), np.ones((2, 3)), depths, 1.0)
    pyramid = build(make_volume(values, np.eye(4), "almost"), tf, spec=PyramidSpec("opacity", precision))
    (depth,) = cut_pyramid(pyramid, 1e9).depths[:, 3]
    assert depth == pytest.approx(-np.log1p(-0.9998), rel=6e-4)


@pytest.mark.parametrize("faintest", [1e-44, 1e-30, 1e-12])
@pytest.mark.parametrize("average", ["extinction", "opacity"])
def test_faint_voxels_beside_opaque_ones_make_no_nan(faintest: float, average: Any) -> None:
    values = np.zeros((40, 40, 40), np.uint8)
    values[::7, ::5, ::3] = 1
    values[20:, 20:, 20:] = 2
    tf = TransferFunction(np.arange(3.0), np.ones((3, 3)), np.array([0, faintest, 40.0]), 1.0)
    pyramid = build(make_volume(values, np.eye(4), "faint"), tf, spec=PyramidSpec(average))
    for tolerance in (0.0, 1e-20, 1e-3, 1e9):
        depths = cut_pyramid(pyramid, tolerance).depths
        assert np.all(np.isfinite(depths))
        assert np.all(depths >= 0)


@pytest.mark.parametrize("finest", [0, 1, 3, 6, 20])
def test_no_cell_is_finer_than_the_finest_level(finest: int) -> None:
    of = blobs((33, 20, 65))
    pyramid = build(of, transfer())
    cut = cut_pyramid(pyramid, 1e-3, finest_level=finest)
    assert cut.levels.min() == min(finest, pyramid.num_levels)
    assert np.all(coverage(cut)[voxel_depths(of, transfer())[..., 3] > 0] == 1)


@MEASURES
@pytest.mark.parametrize("tolerance", [0.0, 0.1])
def test_a_transparent_volume_has_an_empty_cut(tolerance: float, error: ErrorSpec) -> None:
    cut = cut_pyramid(build(make_volume(np.zeros((20, 40, 3), np.uint8), np.eye(4), ""), transfer(), error), tolerance)
    assert (len(cut), cut.cells.shape, cut.depths.shape) == (0, (0, 3), (0, 4))
    assert [array.dtype.name for array in (cut.levels, cut.cells, cut.depths)] == ["uint8", "int32", "float32"]


def test_a_volume_of_one_voxel() -> None:
    pyramid = build(make_volume(np.full((1, 1, 1), 250, np.uint8), np.eye(4), ""), transfer())
    voxel, whole = cut_pyramid(pyramid, 0.0), cut_pyramid(pyramid, 1e-9)
    assert (voxel.levels.tolist(), whole.levels.tolist()) == ([0], [1])
    np.testing.assert_allclose(voxel.depths, [[0.6, 3, 1.2, 3]], rtol=2e-7)
    np.testing.assert_allclose(whole.depths, [[0.6, 3, 1.2, 3]], rtol=HALF_RTOL)


def test_lit_voxels_are_lit_in_the_cut() -> None:
    """Brightness follows the light on both sides of a slab whose normals are +z and -z."""
    values = np.zeros((12, 4, 4), np.uint8)
    values[4:8] = 250
    lit = build_pyramid(
        make_volume(values, np.eye(4), ""), transfer(), spec=PyramidSpec(), error=OPTICAL,
        shading=ShadingSpec(0.25, 0.5, (0.0, 0.0, 1.0)),
    )  # fmt: skip
    cut = cut_pyramid(lit, 0.0)
    factor = cut.depths[:, 1] / cut.depths[:, 3]  # green is 1
    want = {4: 0.25, 5: 0.25, 6: 0.25, 7: 0.75}
    np.testing.assert_allclose(factor, [want[z] for z in cut.cells[:, 2]], rtol=1e-6)


VOXEL_TYPES = ["u1", "i1", "u2", "i2", "f2", "u4", "i4", "u8", "i8", "f4", "f8"]


def around(values: Float64, dtype: Any) -> Array:
    """The values, and their neighbours in `dtype` below and above."""
    info = np.finfo(dtype) if dtype.kind == "f" else np.iinfo(dtype)
    # float(2^64 - 1) is 2^64: stay clear of the end where float64 cannot say it.
    kept = values[(values > float(info.min) * (1 - 1e-15)) & (values < float(info.max) * (1 - 1e-15))]
    middle = kept.astype(dtype)
    if dtype.kind == "f":
        return np.concatenate([np.nextafter(middle, info.min), middle, np.nextafter(middle, info.max)])
    inner = middle[(middle > info.min) & (middle < info.max)]
    return np.concatenate([middle, inner - dtype.type(1), inner + dtype.type(1)])


def some_transfers(low: float, high: float) -> dict[str, TransferFunction]:
    rng = np.random.default_rng(1)
    span = high - low

    def make(values: Float64, extinctions: Float64) -> TransferFunction:
        return TransferFunction(values, rng.random((len(values), 3)), extinctions, 1.0)

    spikes = np.repeat(low + span * rng.random(12), 3)
    spikes[1::3] += span * 1e-6  # far narrower than any bucket that a search could start from
    spikes[2::3] += span * 2e-6
    steps = np.sort(np.repeat(low + span * rng.random(6), 2))
    return {
        "one point": make(np.array([low + span / 3]), np.array([2.0])),
        "256 points": make(np.linspace(low, high, 256), rng.random(256) * (rng.random(256) > 0.5)),
        "spikes": make(np.sort(spikes), np.tile([0, 5.0, 0], 12)),
        "steps": make(steps, rng.random(12) * (rng.random(12) > 0.5)),
        "crowded": make(np.concatenate([np.linspace(low, low + span * 1e-4, 200), [high]]), rng.random(201)),
    }


@pytest.mark.parametrize("name", VOXEL_TYPES)
def test_voxels_of_every_type_are_classified_as_the_transfer_function_says(name: str) -> None:
    dtype = np.dtype(name)
    info = np.finfo(dtype) if dtype.kind == "f" else np.iinfo(dtype)
    low, high = max(float(info.min), -1e30), min(float(info.max), 1e30)
    rng = np.random.default_rng(2)
    for what, tf in some_transfers(low, high).items():
        near = around(tf.values, dtype)
        spread = (low + (high - low) * 0.999 * rng.random(300)).astype(dtype)
        small = np.arange(20).astype(dtype)
        values = np.concatenate([near, spread, small, np.array([info.min, info.max], dtype)])
        values = np.resize(values, (5, 7, -(-len(values) // 35)))
        of = make_volume(values, np.diag([1.0, 2.0, 0.7, 1.0]), what)
        want = voxel_depths(of, tf)
        cut = cut_pyramid(build(of, tf), 0.0)
        x, y, z = cut.cells.T
        found = np.zeros_like(want)
        found[z, y, x] = cut.depths
        # Channels are float32; slopes are evaluated with a reciprocal, an error of 1e-15 of the largest value.
        np.testing.assert_allclose(found, want, rtol=2e-7, atol=1e-14, err_msg=what)
