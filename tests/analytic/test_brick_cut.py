"""The cut in bricks covers all that is visible exactly once, and each brick meets the tolerance."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from dense_bricks import OBLIQUE, Shape, depths_of, errors_of_bricks, patches

from renderer.bricks import BRICK_LEVELS, BRICK_SIZE, BrickCut, Bricks, cut_bricks, make_bricks
from renderer.scene import ErrorSpec, PyramidSpec
from renderer.transfer import TransferFunction
from renderer.volume import Float64, Int64, make_volume

SHAPES: list[Shape] = [(1, 1, 1), (1, 70, 20), (5, 17, 33), (40, 90, 70)]
TOLERANCES = [0.0, 4e-3, 0.2, 0.8, 2.0, 4.0, 8.0, 1e9]

SOFT = TransferFunction(
    np.array([0.0, 100, 200, 250]),
    np.array([[0, 0, 0], [0, 0.5, 1], [1, 0.5, 0.1], [0.2, 1, 0.4]]),
    np.array([0, 0, 1.5, 0.1]),
    1.0,
)


@cache
def soft(shape: Shape) -> Bricks:
    """Return patches of noise, and a smooth part for which coarse bricks are enough."""
    values = patches(shape, 1, side=24)
    smooth = 0.4 + 0.2 * np.indices(shape)[1] / shape[1]
    values = np.where(np.indices(shape)[2] > shape[2] * 0.6, smooth, values)
    volume = make_volume((values * 250).astype(np.uint8), OBLIQUE, "soft")
    return make_bricks(volume, SOFT, spec=PyramidSpec(), error=ErrorSpec())


@cache
def largest_errors(shape: Shape) -> list[dict[tuple[int, int, int], float]]:
    """Return the largest errors of bricks by level, from plain numpy."""
    bricks = soft(shape)
    return [errors_of_bricks(bricks.volume, SOFT, level) for level in range(len(bricks.levels))]


def regions(cut: BrickCut) -> Int64:
    """Return the first voxel (x, y, z) of each whole brick, and one past the last, [n, 2, 3]."""
    width = np.int64(BRICK_SIZE) << cut.levels[:, None].astype(np.int64)
    first = cut.cells * width
    return np.stack([first, np.minimum(first + width, cut.volume.shape_xyz)], axis=1)


def coverage(cut: BrickCut, corners: Float64) -> Int64:
    """Return in how many boxes [n, 2, 3], in index coordinates, each voxel lies wholly, [z, y, x]."""
    count = np.zeros(cut.volume.values.shape, np.int64)
    for low, high in zip(np.ceil(corners[:, 0] + 0.5), np.floor(corners[:, 1] + 0.5), strict=True):
        x, y, z = (slice(int(a), max(int(a), int(b))) for a, b in zip(low, high, strict=True))
        count[z, y, x] += 1
    return count


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("tolerance", TOLERANCES)
@pytest.mark.parametrize("finest_level", [0, 9])
def test_each_visible_voxel_lies_in_one_brick_that_meets_the_tolerance(
    shape: Shape, tolerance: float, finest_level: int
) -> None:
    """All nodes of a brick above level 0 do, and what shows between its voxels; and a parent of a brick has a node that
    does not. Stored errors are off by 2^-11 and a few roundings of float32, which are those of means and not of their
    small differences. Coarse bricks come first, each level in the order of Morton's code."""
    bricks, largest = soft(shape), largest_errors(shape)
    cut = cut_bricks(bricks, tolerance, finest_level=finest_level)
    assert coverage(cut, regions(cut) - 0.5).max(initial=0) <= 1
    visible = depths_of(bricks.volume, SOFT)[..., 3] > 0
    assert np.all(coverage(cut, cut.visible_bounds)[visible] == 1)
    low, high = cut.visible_bounds.transpose(1, 0, 2)
    first, end = regions(cut).transpose(1, 0, 2) - 0.5
    assert np.all(low < high) and np.all(low >= first) and np.all(high <= end)
    assert cut.levels.min(initial=255) >= min(finest_level, len(bricks.levels) - 1)
    for level, cell, step_error in zip(cut.levels.tolist(), cut.cells.tolist(), cut.step_errors, strict=True):
        assert step_error == bricks.levels[level].step_errors[tuple(cell[::-1])]
        if level > finest_level:
            assert largest[level][tuple(cell)] < tolerance * (1 + 2.0**-11) + 4e-6
        if level < len(bricks.levels) - 1:
            assert largest[level + 1][tuple(c >> 1 for c in cell)] >= tolerance * (1 - 2.0**-11) - 4e-6
    bits = cut.cells.astype(np.int64)[:, :, None] >> np.arange(10) & 1
    codes = (bits << 3 * np.arange(10) + np.arange(3)[:, None]).sum(axis=(1, 2))
    keys = list(zip((-cut.levels.astype(int)).tolist(), codes.tolist(), strict=True))
    assert keys == sorted(keys) and len(set(keys)) == len(keys)


def test_an_error_as_large_as_the_tolerance_is_not_below_it() -> None:
    bricks = soft(SHAPES[-1])
    for level, grid in enumerate(bricks.levels):
        for error in np.unique(grid.errors[grid.errors > 0]):
            where = np.argwhere(grid.errors == error)[:, ::-1].tolist()
            exact, above = cut_bricks(bricks, error), cut_bricks(bricks, np.nextafter(error, np.inf))
            assert not any(cell in where for cell in exact.cells[exact.levels == level].tolist())
            drawn = regions(above)
            for cell in where:  # at the next number it is a brick, or in one
                first = np.array(cell) << (level + BRICK_LEVELS)
                around = np.all((drawn[:, 0] <= first) & (first < drawn[:, 1]), axis=1)
                assert np.all(above.levels[around] >= level)
