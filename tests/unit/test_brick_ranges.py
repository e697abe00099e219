"""With known ranges of scalars in bricks, other transfer functions give the same bricks, and read fewer voxels."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from renderer.bricks import Bricks, make_bricks
from renderer.lighting import compute_light_grid
from renderer.pyramid import pyramid_arrays
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import TransferFunction
from renderer.volume import Array, Float64, Volume, make_volume

# Voxels along z, y, x: some bricks are cut by the border.
SHAPE = (40, 64, 75)
# Transfer functions by points of a scalar and an extinction. Nothing but the scalars from 150 on is seen of `HIGH`, and
# nothing but those about 10 of `LOW`.
HIGH = ((150, 0), (150, 0.3), (250, 1))
LOW = ((9, 0), (10, 1), (11, 0))
SLOPE = ((20, 0), (250, 1))
ALL = ((0, 0.1), (250, 1))
LIGHT = ShadingSpec(light=(1, 1, 1), ambient=0.2, diffuse=0.8)


def transfer(points: tuple[tuple[float, float], ...]) -> TransferFunction:
    values, extinctions = np.array(points, np.float64).T
    return TransferFunction(values, np.tile([0.9, 0.5, 0.2], (len(points), 1)), extinctions, 1.0)


def volume_of(kind: str) -> Volume:
    """Return a volume in which each brick has noise about one of four scalars, or one scalar alone."""
    rng = np.random.default_rng(3)
    bases = rng.choice([10, 20, 100, 200], [-(-num // 16) for num in SHAPE])
    bases[..., 2:] %= 100  # bricks without high scalars around them
    values = bases.repeat(16, 0).repeat(16, 1).repeat(16, 2)[tuple(map(slice, SHAPE))]
    values = values + np.where(values == 20, 0, rng.integers(0, 5, SHAPE))
    values[:, :32, 40:] = 20  # bricks of one scalar, with all bricks around them
    values[0, 0, :2] = 0, 255
    dtype = "float32" if kind == "absent" else "uint8" if kind == "masked" else kind
    values = values.astype(dtype)
    if kind == "absent":
        values[rng.random(SHAPE) < 1e-3] = np.nan
        values[16:40, 32:64, 0:40] = np.nan
    made = make_volume(values, np.diag([1.0, 1.0, 1.5, 1.0]), "test", num_absent=int(np.isnan(values).sum()))
    if kind == "masked":
        mask = (np.indices(SHAPE)[2] % 50 > 20).astype(np.uint8)
        made = replace(made, mask=make_volume(mask, made.world_from_index, "mask"))
    return made


def bricks_of(volume: Volume, points: Any, of: str = "channels", ranges: Float64 | None = None) -> Bricks:
    options: dict[str, Any] = {"spec": PyramidSpec(), "error": ErrorSpec(measure="rms", of=of)}  # type: ignore[arg-type]
    return make_bricks(volume, transfer(points), shading=LIGHT.lambert, ranges=ranges, **options)


def arrays_of(bricks: Bricks) -> dict[str, Array]:
    """Return all arrays of bricks that depend on voxels, besides the ranges."""
    levels = {
        f"{number}.{name}": array for number, level in enumerate(bricks.levels) for name, array in vars(level).items()
    }
    return pyramid_arrays(bricks.pyramid) | levels | ({} if bricks.are_cut is None else {"are_cut": bricks.are_cut})


def middle_of(brick: tuple[int, ...], margin: int) -> tuple[slice, ...]:
    """Return the place of a brick without its outermost voxels, or with voxels around it if the margin is negative."""
    return tuple(slice(max(16 * at + margin, 0), 16 * at + 16 - margin) for at in brick)


@pytest.mark.parametrize("kind", ["uint8", "int16", "uint16", "float32", "float64", "absent", "masked"])
def test_ranges_are_the_extremes_of_voxels_around_bricks(kind: str) -> None:
    volume, reach = volume_of(kind), 2 if kind == "absent" else 1
    ranges = bricks_of(volume, ALL).ranges
    for brick in np.ndindex(ranges.shape[:3]):
        around = volume.values[middle_of(brick, -reach)].astype(np.float64)
        around = around[~np.isnan(around)]
        ends = (around.min(), around.max()) if around.size else (np.inf, -np.inf)
        np.testing.assert_allclose(ranges[brick], ends, rtol=1e-15)


@pytest.mark.parametrize("kind", ["uint8", "int16", "uint16", "float32", "float64", "absent", "masked"])
@pytest.mark.parametrize("points", [HIGH, LOW, SLOPE, ALL])
@pytest.mark.parametrize("of", ["channels", "scalar"])
def test_other_transfer_functions_give_the_same_bricks(kind: str, points: Any, of: str) -> None:
    volume = volume_of(kind)
    first = bricks_of(volume, HIGH)
    found, expected = bricks_of(volume, points, of, first.ranges), bricks_of(volume, points, of)
    assert arrays_of(found).keys() == arrays_of(expected).keys()
    for name, array in arrays_of(expected).items():
        np.testing.assert_array_equal(arrays_of(found)[name], array, name)
    np.testing.assert_array_equal(found.ranges, first.ranges)


@pytest.mark.parametrize("kind", ["uint8", "int16", "uint16", "float32", "float64", "absent", "masked"])
def test_no_voxels_of_bricks_that_show_nothing_are_read(kind: str) -> None:
    """High scalars are written into bricks of low ones, and nobody notices."""
    volume, high = volume_of(kind), transfer(HIGH)
    ranges = bricks_of(volume, ALL).ranges
    values = volume.values.copy()
    hidden = np.argwhere(ranges[..., 1] < 150)
    for brick in hidden:
        values[middle_of(tuple(brick), 2)] = 250
    changed = replace(
        make_volume(values, volume.world_from_index, "test", num_absent=volume.num_absent), mask=volume.mask
    )
    expected = arrays_of(bricks_of(volume, HIGH))
    found = arrays_of(bricks_of(changed, HIGH, ranges=ranges))
    for name, array in expected.items():
        np.testing.assert_array_equal(found[name], array, name)
    assert len(hidden) >= 10 and not np.array_equal(arrays_of(bricks_of(changed, HIGH))["means_3"], expected["means_3"])
    light = replace(LIGHT, occlusion=0.5)
    grids = [compute_light_grid(volume, high, light), compute_light_grid(changed, high, light, ranges=ranges)]
    for one, other in zip(*grids, strict=True):
        np.testing.assert_array_equal(one, other)
