"""The cut covers every visible voxel exactly once, with cells that meet the tolerance."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from brickwork import hills
from dense_bricks import OBLIQUE, depths_of, errors_of_cells, spread_of_cells

from renderer.pyramid import Cut, Pyramid, build_pyramid, cut_pyramid
from renderer.scene import ErrorSpec, PyramidSpec
from renderer.transfer import TransferFunction
from renderer.volume import Volume, make_volume

Array = npt.NDArray[Any]

OPTICAL = ErrorSpec()
RMS = ErrorSpec(measure="rms")
SCALAR = ErrorSpec(measure="rms", of="scalar")
MEASURES = pytest.mark.parametrize("error", [OPTICAL, RMS, SCALAR], ids=["optical", "rms", "scalar"])
# A mean in float16 is off by 2^-11 at most, and by a few roundings of float32.
HALF_RTOL = 2.0**-11 + 2e-6


def blobs(shape: tuple[int, int, int]) -> Volume:
    """Return smooth blobs with noise on a transparent background."""
    field = 1.5 * hills(shape, 40.0) - 0.5 + np.random.default_rng(0).normal(0, 0.02, shape)
    return make_volume((np.clip(field, 0, 1) * 250).astype(np.uint8), OBLIQUE, "blobs")


def plain(values: Array) -> Volume:
    return make_volume(values, np.eye(4), "plain")


def transfer(deepest: float = 3.0) -> TransferFunction:
    colors = np.array([[0, 0, 0], [0, 0.5, 1], [1, 0.5, 0.1], [0.2, 1, 0.4]])
    return TransferFunction(np.array([0.0, 60, 120, 250]), colors, np.array([0, 0, 0.3, deepest]), 1.0)


def build(of: Volume, tf: TransferFunction, error: ErrorSpec = OPTICAL, spec: PyramidSpec | None = None) -> Pyramid:
    return build_pyramid(of, tf, spec=spec or PyramidSpec(), error=error)


def coverage(cut: Cut) -> npt.NDArray[np.int64]:
    """Return the number of cells that each voxel lies in, [z, y, x]."""
    count = np.zeros(cut.volume.values.shape, np.int64)
    for level, cell in zip(cut.levels.tolist(), cut.cells.tolist(), strict=True):
        x, y, z = (slice(k << level, (k + 1) << level) for k in cell)
        count[z, y, x] += 1
    return count


@MEASURES
@pytest.mark.parametrize("shape", [(1, 5, 2), (33, 20, 65), (40, 47, 23)])
@pytest.mark.parametrize("tolerance", [1e-3, 0.05, 1e9])
def test_every_visible_voxel_lies_in_one_cell(shape: tuple[int, int, int], tolerance: float, error: ErrorSpec) -> None:
    of = blobs(shape)
    cut = cut_pyramid(build(of, transfer(), error), tolerance)
    count = coverage(cut)
    assert count.max(initial=0) <= 1
    assert np.all(count[depths_of(of, transfer())[..., 3] > 0] == 1)
    assert np.all(cut.depths[:, 3] > 0)
    assert np.all(np.diff(cut.levels.astype(int)) <= 0)


@MEASURES
def test_tolerance_0_is_every_visible_voxel(error: ErrorSpec) -> None:
    """The error must be *below* the tolerance, also where all voxels are equal."""
    for of in (blobs((20, 33, 37)), plain(np.full((9, 8, 17), 200, np.uint8))):
        cut = cut_pyramid(build(of, transfer(), error), 0.0)
        want = depths_of(of, transfer())
        assert np.all(cut.levels == 0)
        assert len(cut) == np.count_nonzero(want[..., 3])
        x, y, z = cut.cells.T
        np.testing.assert_allclose(cut.depths, want[z, y, x], rtol=2e-7)


@pytest.mark.parametrize(
    ("error", "tolerance"),
    [(OPTICAL, 0.01), (OPTICAL, 0.5), (RMS, 0.05), (SCALAR, 8.0)],
    ids=["optical, fine", "optical, coarse", "rms", "scalar"],
)
def test_leaves_meet_the_tolerance_and_their_parents_do_not(error: ErrorSpec, tolerance: float) -> None:
    of = blobs((33, 47, 65))
    measured = depths_of(of, transfer())
    if error.measure == "rms":
        opacity = -np.expm1(-measured[..., 3:])
        measured = np.concatenate([transfer().classify(of.values)[0] * opacity, opacity], axis=-1)
    if error.of == "scalar":
        measured = of.values[..., None].astype(float)
    pyramid = build(of, transfer(), error)
    errors = [np.zeros(of.values.shape)]
    for level in range(1, pyramid.num_levels + 1):
        is_optical = error.measure == "optical"
        errors.append(errors_of_cells(of, measured, level) if is_optical else spread_of_cells(measured, level))
    cut = cut_pyramid(pyramid, tolerance)
    assert 0 < np.count_nonzero(cut.levels) < len(cut)
    for level, (x, y, z) in zip(cut.levels.tolist(), cut.cells.tolist(), strict=True):
        if level > 0:
            assert errors[level][z, y, x] < tolerance * (1 + HALF_RTOL)
        assert errors[level + 1][z // 2, y // 2, x // 2] >= tolerance * (1 - HALF_RTOL)


@pytest.mark.parametrize("precision", ["half", "single"])
@pytest.mark.parametrize("deepest", [9.0, 40.0])
def test_averages_of_opacities_near_1_are_no_deeper_than_the_deepest_voxel(precision: Any, deepest: float) -> None:
    of = plain(np.full((16, 16, 16), 250, np.uint8))
    pyramid = build(of, transfer(deepest), spec=PyramidSpec("opacity", precision))
    for tolerance in (0.0, 1.0):
        depths = cut_pyramid(pyramid, tolerance).depths
        assert np.all(depths[:, 3] <= np.float32(deepest))
        assert np.all(depths[:, 3] > min(0.99 * deepest, 16))  # float32 resolves opacities to 2^-24, a depth of 16.6
        np.testing.assert_allclose(depths[:, :3], depths[:, 3:] * [0.2, 1, 0.4], rtol=HALF_RTOL)


@pytest.mark.parametrize("finest", [0, 1, 3, 6, 20])
def test_no_cell_is_finer_than_the_finest_level(finest: int) -> None:
    of = blobs((33, 20, 65))
    pyramid = build(of, transfer())
    cut = cut_pyramid(pyramid, 1e-3, finest_level=finest)
    assert cut.levels.min() == min(finest, pyramid.num_levels)
    assert np.all(coverage(cut)[depths_of(of, transfer())[..., 3] > 0] == 1)


def test_a_volume_of_one_voxel() -> None:
    pyramid = build(plain(np.full((1, 1, 1), 250, np.uint8)), transfer())
    voxel, whole = cut_pyramid(pyramid, 0.0), cut_pyramid(pyramid, 1e-9)
    assert (voxel.levels.tolist(), whole.levels.tolist()) == ([0], [1])
    np.testing.assert_allclose(voxel.depths, [[0.6, 3, 1.2, 3]], rtol=2e-7)
    np.testing.assert_allclose(whole.depths, [[0.6, 3, 1.2, 3]], rtol=HALF_RTOL)
