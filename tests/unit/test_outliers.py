"""Isolated voxels are found and hidden, and do not change what the other values are taken for."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from kinds_of_data import KINDS, axes, extinction, head_in_hounsfield_units, suggested, two_materials, two_materials_and

from renderer.scene import ColormapSpec
from renderer.statistics import OutlierValue, compute_statistics

Array = npt.NDArray[Any]

Z, Y, X = axes()
SLAB = Z < -0.4


@pytest.mark.parametrize("colormap", [None, "viridis"])
def test_only_the_far_side_of_the_others_becomes_transparent(colormap: str | None) -> None:
    plain = KINDS["microscopy"][0].astype(np.float32)
    values = plain.copy()
    values[20, 20, 20] = 1e20
    found, before = (suggested(each, colormap=colormap) for each in (values, plain))
    assert isinstance(found.transfer.mapping, ColormapSpec) == (colormap is not None)
    top = float(plain.max())
    assert extinction(found.transfer, 1e20) == [0]
    assert extinction(found.transfer, top) == pytest.approx(extinction(before.transfer, top), rel=0.1)


@pytest.mark.parametrize("outliers", [(1e30,), (1e6,), (-1e30, 1e30), (-32768.0, 32767.0)])
def test_single_voxels_do_not_hide_what_a_scan_is(outliers: tuple[float, ...]) -> None:
    values = head_in_hounsfield_units().astype(np.int16 if 32767.0 in outliers else np.float32)
    values[3, 4, 5 : 5 + len(outliers)] = outliers
    found = suggested(values)
    assert found.kind == "CT in Hounsfield units"
    assert len(found.outlier_notes) == len(outliers)


def test_outliers_on_both_sides_beside_voxels_without_data() -> None:
    values = KINDS["microscopy"][0].astype(np.float64)
    values[SLAB] = np.nan
    values[30, 30, 30:32] = -1e12, 1e30
    assert compute_statistics(values).outliers == (OutlierValue(-1e12, 1, -1e12), OutlierValue(1e30, 1, 1e30))


@pytest.mark.parametrize(
    "values",
    [
        two_materials_and(40, 5000.0),  # side by side, but not many, and no value that is known
        two_materials("uint8"),
        KINDS["labels"][0] * np.uint8(50),
        KINDS["mask"][0],
        np.where(SLAB, 255, np.arange(Z.size).reshape(Z.shape) % 9).astype(np.uint8),  # nine values are too few
        np.arange(27.0).reshape(3, 3, 3) ** 9,
    ],
    ids=["some", "uint8", "labels", "mask", "steps", "powers"],
)
def test_what_is_not_far_from_all_others(values: Array) -> None:
    assert compute_statistics(values).outliers == ()
    assert suggested(values).outlier_notes == ()


def salted(values: Array, num: int, lowest: float, highest: float) -> tuple[Array, Array]:
    """Return the values with some voxels of others, all over the volume, and which they are."""
    random = np.random.default_rng(0)
    found, where = values.copy(), random.choice(values.size, num, replace=False)
    found.ravel()[where] = random.uniform(lowest, highest, num)
    return found, where


# 0.1 % of 48^3 are 110.
@pytest.mark.parametrize(
    ("name", "num", "highest"),
    [
        *(("microscopy", *salt) for salt in ((1, 61000), (3, 65535), (12, 61000), (100, 65535))),
        *(("magnetic resonance", *salt) for salt in ((1, 65535), (100, 61000))),
        ("12 bits", 12, 61000),
        ("head as uint16", 3, 65535),
    ],
)
def test_isolated_voxels_change_neither_kind_nor_levels(name: str, highest: float, num: int) -> None:
    plain = KINDS[name][0].astype(np.uint16) // 2
    values, where = salted(plain, num, 60000 if highest == 61000 else highest, highest)
    counted = sum(outlier.num for outlier in compute_statistics(values).outliers)
    assert counted == num
    found, before = suggested(values), suggested(plain)
    assert (found.kind, len(found.outlier_notes)) == (before.kind, 1)
    assert found.outlier_notes[0].startswith(f"{num} of {plain.size} voxels ")
    shown, wanted = (np.array(extinction(each.transfer, *np.unique(plain).tolist())) for each in (found, before))
    np.testing.assert_allclose(shown, wanted, rtol=0.02, atol=0.05 * wanted.max())
    assert max(extinction(found.transfer, *values.ravel()[where].tolist())) == 0


@pytest.mark.parametrize("name", ["signed", "distance", "temperature"])
def test_isolated_voxels_at_both_ends(name: str) -> None:
    plain = KINDS[name][0]
    values, _ = salted(plain, 40, 1e4, 1e6)
    values.ravel()[::3001] = -1e5
    low, high = compute_statistics(values).outliers
    assert (low.value, low.last, low.num) == (-1e5, -1e5, np.count_nonzero(values == -1e5))
    assert high.num == np.count_nonzero(values > 1000) and low.num + high.num <= 1e-3 * plain.size
    assert suggested(values).kind == KINDS[name][1]


def test_points_in_noise_are_what_there_is_to_see() -> None:
    """All that is not noise is no noise."""
    noise = np.random.default_rng(1).poisson(100, (48, 48, 48)).astype(np.float32)
    values, _ = salted(noise, 60, 3000, 6000)
    found = suggested(values)
    assert found.outlier_notes == ()
    assert min(extinction(found.transfer, 5000.0)) > 0 == max(extinction(found.transfer, 100.0))
    points = salted(np.zeros((48, 48, 48), np.uint16), 60, 3000, 6000)[0]
    assert compute_statistics(points).outliers == ()


def test_values_near_the_limits_of_their_type_do_not_overflow() -> None:
    values = (np.linspace(-1, 1, 1000) * 1.7e308).reshape(10, 10, 10)
    assert compute_statistics(values).outliers == ()
    whole = np.arange(1000, dtype=np.int64).reshape(10, 10, 10)
    whole[0, 0] = np.iinfo(np.int64).min
    assert compute_statistics(whole).outliers == ()  # a row of ten is not isolated
