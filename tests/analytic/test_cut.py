"""The cut covers every visible voxel exactly once, with cells that meet the tolerance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from brickwork import hills, transfer_of
from dense_bricks import OBLIQUE, depths_of, errors_of_cells, spread_of_cells

from renderer.pyramid import Cut, Pyramid, build_pyramid, cut_pyramid
from renderer.scene import ErrorSpec, PyramidSpec
from renderer.transfer import TransferFunction
from renderer.volume import Array, Int64, Volume, make_volume

OPTICAL = ErrorSpec()
RMS = ErrorSpec(measure="rms")
SCALAR = ErrorSpec(measure="rms", of="scalar")
# A mean in float16 is off by 2^-11 at most, and by a few roundings of float32.
HALF_RTOL = 2.0**-11 + 2e-6


def blobs(shape: tuple[int, int, int]) -> Volume:
    """Return smooth blobs with noise on a transparent background."""
    field = 1.5 * hills(shape, 40.0) - 0.5 + np.random.default_rng(0).normal(0, 0.02, shape)
    return make_volume((np.clip(field, 0, 1) * 250).astype(np.uint8), OBLIQUE, "blobs")


def plain(values: Array) -> Volume:
    return make_volume(values, np.eye(4), "plain")


def transfer(deepest: float = 3.0) -> TransferFunction:
    return transfer_of(
        (0, (0, 0, 0), 0), (60, (0, 0.5, 1), 0), (120, (1, 0.5, 0.1), 0.3), (250, (0.2, 1, 0.4), deepest)
    )


def build(of: Volume, tf: TransferFunction, error: ErrorSpec = OPTICAL, spec: PyramidSpec | None = None) -> Pyramid:
    return build_pyramid(of, tf, spec=spec or PyramidSpec(), error=error)


def coverage(cut: Cut) -> Int64:
    """Return the number of cells that each voxel lies in, [z, y, x]."""
    count = np.zeros(cut.volume.values.shape, np.int64)
    for level, cell in zip(cut.levels.tolist(), cut.cells.tolist(), strict=True):
        x, y, z = (slice(k << level, (k + 1) << level) for k in cell)
        count[z, y, x] += 1
    return count


def errors_of(of: Volume, error: ErrorSpec, num_levels: int) -> list[Array]:
    """Return the errors of all cells [z, y, x], level 1 first."""
    measured = depths_of(of, transfer())
    if error.measure == "rms":
        opacity = -np.expm1(-measured[..., 3:])
        measured = np.concatenate([transfer().classify(of.values)[0] * opacity, opacity], axis=-1)
    if error.of == "scalar":
        measured = of.values[..., None].astype(float)
    levels = range(1, num_levels + 1)
    if error.measure == "optical":
        return [errors_of_cells(of, measured, level) for level in levels]
    return [spread_of_cells(measured, level) for level in levels]


@pytest.mark.parametrize(
    ("error", "tolerance", "is_mixed"),
    [
        (OPTICAL, 0.0, False), (OPTICAL, 1e-3, False), (OPTICAL, 0.01, True), (OPTICAL, 0.5, True),
        (OPTICAL, 1e9, False), (RMS, 0.0, False), (RMS, 0.05, True), (SCALAR, 0.0, False), (SCALAR, 8.0, True),
    ],
)  # fmt: skip
@pytest.mark.parametrize("finest", [0, 2, 20])
def test_each_visible_voxel_lies_in_one_cell_that_meets_the_tolerance(
    error: ErrorSpec, tolerance: float, is_mixed: bool, finest: int
) -> None:
    """And the parent of the cell does not. The error must be *below* the tolerance, also where all voxels are equal."""
    for of in (blobs((1, 5, 2)), blobs((33, 47, 65)), plain(np.full((9, 8, 17), 200, np.uint8))):
        pyramid, depths = build(of, transfer(), error), depths_of(of, transfer())
        cut, errors = cut_pyramid(pyramid, tolerance, finest_level=finest), errors_of(of, error, pyramid.num_levels)
        count = coverage(cut)
        assert count.max(initial=0) <= 1 and np.all(count[depths[..., 3] > 0] == 1)
        assert np.all(cut.depths[:, 3] > 0) and np.all(np.diff(cut.levels.astype(int)) <= 0)
        assert cut.levels.min() >= min(finest, pyramid.num_levels)
        for level in np.unique(cut.levels).tolist():
            x, y, z = cut.cells[cut.levels == level].T
            if level == 0:
                np.testing.assert_allclose(cut.depths[cut.levels == 0], depths[z, y, x], rtol=2e-7)
            elif level > finest:
                assert np.all(errors[level - 1][z, y, x] < tolerance * (1 + HALF_RTOL))
            if level < pyramid.num_levels:
                assert np.all(errors[level][z // 2, y // 2, x // 2] >= tolerance * (1 - HALF_RTOL))
        if finest == 0 and (tolerance == 0 or (is_mixed and of.name == "blobs" and len(of.values) > 1)):
            assert (0 < np.count_nonzero(cut.levels) < len(cut)) == is_mixed


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
