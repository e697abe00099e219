"""Interpolation in a brick, against plain numpy over the whole volume, closed forms, and the bricks' boxes."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from brick_reference import index_gradients
from brickwork import scalar_texels
from dense_bricks import OBLIQUE, Shape, depths_of, means_over_cells, patches
from number_types import TYPES, limits

from renderer.bricks import BRICK_SIZE, Bricks, make_bricks, mean_texels
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import TransferFunction
from renderer.volume import Array, Bools, Float64, Int32, Int64, Volume, make_volume

# Texels beyond a brick, at each of its faces.
HALO = 1

SHAPES: list[Shape] = [(1, 1, 1), (1, 40, 20), (5, 17, 33), (33, 17, 5), (16, 32, 48), (35, 30, 66)]
each_shape = pytest.mark.parametrize("shape", SHAPES, ids=str)
PADDED_BRICK_SIZE = BRICK_SIZE + 2 * HALO
# Of the field between texels: far from their places, at them, and at the faces between cells.
UNIT = np.finfo(np.float32).eps / 2


def linear(low: float, high: float, least: float = 0.0, most: float = 1.0) -> TransferFunction:
    """Return an extinction from `least` to `most` between two scalars, of one colour."""
    return TransferFunction(
        np.array([low, high], np.float64), np.tile([1.0, 0.6, 0.1], (2, 1)), np.array([least, most]), 1.0
    )


def bricks_of(
    volume: Volume, transfer: TransferFunction, precision: Literal["half", "single"], shading: ShadingSpec | None = None
) -> Bricks:
    return make_bricks(volume, transfer, spec=PyramidSpec(precision=precision), error=ErrorSpec(), shading=shading)


def all_cells(bricks: Bricks, level: int) -> Int32:
    """Return the bricks (x, y, z) of a level, [n, 3]."""
    grid = bricks.levels[level].errors.shape
    return np.ascontiguousarray(np.indices(grid).reshape(3, -1)[::-1].T, np.int32)


def texel_places(cell: Array, axis: int) -> Int64:
    """Return the cells of a brick's 18 texels along x, y or z."""
    return BRICK_SIZE * int(cell[axis]) - HALO + np.arange(PADDED_BRICK_SIZE)


def from_dense(dense: Array, cells: Array) -> Array:
    """[n, 18, 18, 18, ...]: the texels of bricks, of an array [z + 2, y + 2, x + 2, ...] that begins at -1; the last
    ones again where it ends."""
    grids = [
        np.ix_(*[np.minimum(texel_places(cell, axis) + 1, dense.shape[2 - axis] - 1) for axis in (2, 1, 0)])
        for cell in cells
    ]
    return np.stack([dense[grid] for grid in grids])


def inside(bricks: Bricks, level: int, cells: Array, margin: int = 1) -> Bools:
    """Return which texels [n, 18, 18, 18] are cells, up to `margin` cells beyond the border."""
    parts = []
    for cell in cells:
        places = [texel_places(cell, axis) for axis in range(3)]
        numbers = [-(-n // (1 << level)) for n in bricks.volume.shape_xyz]
        x, y, z = ((-margin <= at) & (at < n + margin) for at, n in zip(places, numbers, strict=True))
        parts.append(z[:, None, None] & y[:, None] & x)
    return np.stack(parts)


def noise(shape: Shape, dtype: str, low: float, high: float, seed: int = 0) -> Array:
    shares = np.random.default_rng(seed).random(shape)
    return np.asarray(np.clip(low * (1 - shares) + high * shares, low, np.nextafter(float(high), 0)).astype(dtype))


def world_gradients(volume: Volume) -> Float64:
    """[z, y, x, 3], in some unit: by central differences, one-sided at the border and 0 along an axis of one voxel."""
    return index_gradients(volume.values.astype(np.float64) / 4) @ np.linalg.inv(volume.world_from_index[:3, :3])


@pytest.mark.parametrize("dtype", TYPES)
def test_scalars_and_gradients_are_relative_to_their_range(dtype: str) -> None:
    """Differences are taken in float64, then rounded to float32; halves of halves do not overflow here. Gradients are
    one constant times the world gradient."""
    for seed, shape in enumerate(SHAPES):
        low, high = limits(dtype) if seed % 2 else (10, 100)
        volume = make_volume(noise(shape, dtype, low, high, seed), OBLIQUE, "noise")
        transfer = linear(0.7 * low + 0.3 * high, 0.3 * low + 0.7 * high)
        bricks = bricks_of(volume, transfer, "half")
        cells = all_cells(bricks, 0)
        first, last = (end / 4 for end in bricks.scalar_range)
        scalars = np.pad(volume.values.astype(np.float64) / 4, 1, mode="edge")
        want = from_dense((scalars - first) / (last - first), cells)
        got, lit = scalar_texels(bricks, cells, lit=False), scalar_texels(bricks, cells, lit=True)
        assert got.dtype == np.float32 and got.shape == (len(cells), *(PADDED_BRICK_SIZE,) * 3)
        far = max(abs(first), abs(last)) / (last - first) * 2.0**-52
        np.testing.assert_allclose(got, want, rtol=2 * UNIT, atol=far)
        scalars_first, gradients = np.split(lit, [PADDED_BRICK_SIZE**3], axis=1)
        np.testing.assert_array_equal(scalars_first.reshape(got.shape), got)
        dense = np.pad(world_gradients(volume), [(1, 1), (1, 1), (1, 1), (0, 0)], mode="edge")
        want, got = from_dense(dense, cells), gradients.reshape(*got.shape, 3).astype(np.float64)
        largest = np.abs(want).max()
        if largest == 0:
            assert not got.any()
            continue
        at = np.unravel_index(np.argmax(np.abs(want)), want.shape)
        ratio = got[at] / want[at]
        assert ratio > 0
        np.testing.assert_allclose(got, want * ratio, rtol=1e-6, atol=largest * ratio * 1e-6)
        assert 0.01 < np.abs(got).max() <= 3


@each_shape
@pytest.mark.parametrize("precision", ["half", "single"])
def test_mean_texels_equal_the_dense_means(shape: Shape, precision: Literal["half", "single"]) -> None:
    """They do where no border is near, halo included. Ramps and constants show how fields continue there."""
    transfer = TransferFunction(np.array([0.0, 50, 250]), np.eye(3), np.array([0.0, 0.0, 1.0]), 1.0)
    volume = make_volume((patches(shape, 2) * 250).astype(np.uint8), OBLIQUE, "patches")
    bricks = bricks_of(volume, transfer, precision)
    for level in range(1, len(bricks.levels)):
        means = means_over_cells(depths_of(volume, transfer), level)
        cells = all_cells(bricks, level)
        got = mean_texels(bricks, level, cells)
        assert got.dtype == np.float32 and got.shape == (len(cells), *(PADDED_BRICK_SIZE,) * 3, 4)
        there = inside(bricks, level, cells, -1)
        error = 2.0**-11 if precision == "half" else 1e-6
        padded = np.pad(means, [(1, 1), (1, 1), (1, 1), (0, 0)])
        np.testing.assert_allclose(got[there], from_dense(padded, cells)[there], rtol=1.01 * error, atol=error * 1e-3)
        assert got.min() >= 0
        assert not got[got[..., 3] == 0].any()
        assert np.all(got[..., :3] <= got[..., 3:] * 1.01)


@each_shape
def test_a_ramp_stays_a_ramp_on_every_level(shape: Shape) -> None:
    """Also beyond the border, and where that cuts the last cells: but for axes of one cell, which have no slope.

    Means are float32: off by a few roundings, of which errors of two grow at most sevenfold per axis.
    """
    z, y, x = np.indices(shape).astype(np.float64)
    for slopes in ((0.01, 0.02, -0.015), (-0.01, 0.0, 0.01)):
        ramp = 5 + slopes[0] * x + slopes[1] * y + slopes[2] * z
        bricks = bricks_of(make_volume(ramp, OBLIQUE, "ramp"), linear(0, 10), "single")
        for level in range(1, len(bricks.levels)):
            cells = all_cells(bricks, level)
            want = np.zeros((len(cells), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE))
            for i, cell in enumerate(cells):
                along = []
                for axis, n in enumerate(bricks.volume.shape_xyz):
                    centres = (texel_places(cell, axis) + 0.5) * (1 << level) - 0.5
                    along.append(
                        slopes[axis] * (centres if n > 1 << level else np.full(PADDED_BRICK_SIZE, (n - 1) / 2))
                    )
                want[i] = 5 + along[2][:, None, None] + along[1][:, None] + along[0]
            want *= bricks.volume.finest_spacing / 10
            got = mean_texels(bricks, level, cells)
            there = inside(bricks, level, cells)
            np.testing.assert_allclose(got[there][:, 3], want[there], rtol=7**3 * 4 * UNIT)
            np.testing.assert_allclose(got[there][:, 1], 0.6 * want[there], rtol=7**3 * 4 * UNIT)
