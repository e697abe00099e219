"""Voxels without data are recognised, marked by NaN, and change neither what the others are taken for nor how they
look."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from kinds_of_data import KINDS, N, axes, ball, two_materials_and

from renderer.errors import InputError
from renderer.readers import read_volume
from renderer.scene import ArraySource, FileSource, VolumeSpec
from renderer.statistics import compute_statistics, suggest_fill
from renderer.suggest import suggest
from renderer.volume import Volume

Array = npt.NDArray[Any]

Z, Y, X = axes()
SLAB = Z < -0.6  # the lowest fifth
TUBE = X**2 + Y**2 > 1  # outside of a scanner's circle
CORNER = (Z > 0.7) & (Y > 0.7) & (X > 0.7)
FLOAT_MAX = float(np.finfo(np.float32).max)
FILLS = (-9999.0, 1e20, 9.96921e36, -3.4e38, FLOAT_MAX, -FLOAT_MAX, 1e30, 1e36, -999.0, -32768.0, np.inf)


def filled(values: Array, where: Array, fill: float = np.nan, dtype: str = "f4") -> Array:
    values = values.astype(dtype)
    values[where] = fill
    return values


def read(values: Array, nodata: Any = "auto") -> Volume:
    return read_volume(VolumeSpec(ArraySource(values), nodata=nodata))


def found(values: Array) -> tuple[float | None, str]:
    """Return what voxels without data count as, and the kind of data."""
    volume = read(values)
    statistics = compute_statistics(volume.values)
    return suggest_fill(volume, statistics), suggest(volume, statistics).kind


@pytest.mark.parametrize("fill", FILLS)
@pytest.mark.parametrize("where", [SLAB, TUBE], ids=["slab", "tube"])
def test_fill_values_are_the_same_as_nan(fill: float, where: Array) -> None:
    values = KINDS["microscopy"][0]
    one, other = (read(filled(values, where, each)) for each in (np.nan, fill))
    assert other.fingerprint == one.fingerprint
    assert other.num_absent == np.count_nonzero(where)
    np.testing.assert_array_equal(np.isnan(other.values), where)


@pytest.mark.parametrize("fill", [-9999, -32768, -5000])
def test_fill_values_of_integers_make_floats_that_hold_all_others(fill: int) -> None:
    values = filled(np.clip(KINDS["microscopy"][0], 0, 1000), SLAB, fill, "i2")
    volume = read(values)
    assert volume.values.dtype == np.float32
    np.testing.assert_array_equal(volume.values, np.where(SLAB, np.nan, values))
    assert volume.note == f"{np.count_nonzero(SLAB)} of {values.size} voxels have no data: {fill}; " + (
        "`nodata: none` draws them"
    )


def test_fill_values_side_by_side() -> None:
    values = filled(np.clip(KINDS["microscopy"][0], 0, 1000), SLAB, -32768, "i2")
    values[CORNER] = -32767
    np.testing.assert_array_equal(np.isnan(read(values).values), SLAB | CORNER)


def test_wide_integers_become_the_same_floats_whatever_their_fill_value() -> None:
    values = np.clip(KINDS["microscopy"][0], 0, 1000)
    one, other = (read(filled(values, SLAB, fill, "i4")) for fill in (-9999, -(2**31)))
    assert (one.values.dtype, one.fingerprint) == (np.float32, other.fingerprint)


def test_two_fill_values_and_nan() -> None:
    values = filled(KINDS["signed"][0], SLAB, -9999)
    values[CORNER], values[0, 0, 0], values[20, 20, 20] = 1e20, np.nan, np.inf
    volume = read(values)
    assert volume.num_absent == np.count_nonzero(SLAB | CORNER) + 1
    assert volume.note == f"{volume.num_absent} of {values.size} voxels have no data: NaN or infinite, -9999, 1e+20"


@pytest.mark.parametrize(
    "values",
    [
        two_materials_and(1, 1e30),  # one voxel
        two_materials_and(40, 20000.0),  # not one in a thousand
        two_materials_and(400, 5000.0),  # not 30 ranges away: perhaps an object
        two_materials_and(400, -400.0),  # not three ranges below
        two_materials_and(400, -100.0),
        np.linspace(-40000, 40000, 10**4, dtype=np.float32).reshape(10, 10, 100),  # -9999 is among the others
        np.clip(np.arange(-70000, 70000, 140), -32768, 32767).astype("i2").reshape(10, 10, 10),  # saturated
        np.where(SLAB, 60000, np.arange(Z.size).reshape(Z.shape) % 9).astype(np.uint16),  # labels
        KINDS["labels"][0] * np.uint8(50),
        KINDS["mask"][0],
    ],
    ids=["one", "few", "near", "below", "beside", "among", "saturated", "steps", "labels", "mask"],
)
def test_what_is_no_fill_value(values: Array) -> None:
    volume = read(values)
    assert (volume.num_absent, volume.note) == (0, None)
    np.testing.assert_array_equal(volume.values, values)


@pytest.mark.parametrize("least", [1, 600])
def test_no_label_is_the_background_where_the_outside_has_no_data(least: int) -> None:
    labels = np.full((24, 24, 24), np.nan, np.float32)
    labels[4:20, 4:20, 4:20] = least + np.repeat([0, 0, 1, 2], 4)
    for values in (labels, np.nan_to_num(labels)):
        volume = read(values)
        shown = suggest(volume, compute_statistics(volume.values)).transfer.labels
        assert shown is not None and shown.show == (least, least + 1, least + 2)


def test_none_keeps_fill_values_and_refuses_nan() -> None:
    values = filled(KINDS["signed"][0], SLAB, -9999)
    np.testing.assert_array_equal(read(values, "none").values, values)
    values[1, 2, 3] = np.nan
    with pytest.raises(InputError, match=f"1 of {values.size} voxels are NaN or infinite") as error:
        read(values, "none")
    assert error.value.got == "the first at voxel x, y, z = 3, 2, 1"
    assert error.value.hint == "`nodata: auto` leaves them out"


def test_numbers_replace_what_is_recognised() -> None:
    values = filled(KINDS["signed"][0], SLAB, -9999)
    values[CORNER], values[0, 0, 0] = 7.25, np.nan
    volume = read(values, (7.25,))
    np.testing.assert_array_equal(np.isnan(volume.values), CORNER | np.isnan(values))
    whole = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    several = read(whole, (3.0, 5.0, 99.0))
    assert (several.values.dtype, several.num_absent) == (np.float16, 2)
    assert several.note == "2 of 24 voxels have no data: 3, 5"
    assert read(whole, (99.0,)).values.dtype == np.uint8


def test_a_volume_without_data_is_refused() -> None:
    with pytest.raises(InputError, match="no voxel has data"):
        read(np.full((2, 2, 2), np.nan))
    with pytest.raises(InputError, match="no voxel has data"):
        read(np.full((2, 2, 2), 5), (5.0,))


@pytest.mark.parametrize("where", [SLAB, CORNER], ids=["slab", "corner"])
@pytest.mark.parametrize("name", ["signed", "filled, signed", "distance", "distance, reversed", "head as float32"])
def test_the_kind_is_that_of_the_others(name: str, where: Array) -> None:
    assert found(filled(KINDS[name][0], where))[1] == KINDS[name][1]


def test_a_signed_field_inside_of_nan_keeps_its_signs() -> None:
    values = filled(KINDS["filled, signed"][0], X**2 + Y**2 + Z**2 > 0.9)
    assert found(values) == (0.0, "field with two signs")


@pytest.mark.parametrize("where", [SLAB, TUBE], ids=["slab", "tube"])
def test_a_bright_background_goes_on_where_nan_are(where: Array) -> None:
    values = KINDS["dark object"][0]
    background = float(np.median(values[0]))
    value, kind = found(filled(values, where))
    assert value == pytest.approx(background, abs=3)
    assert kind.endswith("dark in a bright background")


def test_nan_around_labels_are_their_background() -> None:
    values = KINDS["labels"][0]
    assert found(filled(values, values == 0)) == (0.0, "labels")
    assert found(filled(values, SLAB)) == (None, "labels")  # 0 is there already


@pytest.mark.parametrize("value", [1.0, -3.0])
def test_nan_make_a_mask(value: float) -> None:
    volume = read(filled(np.full((N, N, N), value), ~ball((0, 0, 0), 0.6)))
    assert suggest(volume, compute_statistics(volume.values)).kind == "mask"


@pytest.mark.parametrize("side", [1, 4, N])
def test_a_mask_of_any_size_holds_back_most_light(side: int) -> None:
    values = np.full((2 * N, 2 * N, 2 * N), np.nan)
    values[5 : 5 + side, 5 : 5 + side, 5 : 5 + side] = 2.0
    volume = read(values)
    transfer = suggest(volume, compute_statistics(volume.values)).transfer
    assert isinstance(transfer.mapping, tuple) and transfer.unit is not None
    assert (1 - transfer.mapping[0].opacity) ** (side / transfer.unit) == pytest.approx(np.exp(-3), rel=0.05)


def test_statistics_are_of_data_alone() -> None:
    values = filled(KINDS["microscopy"][0], TUBE, np.nan, "f8")
    found, alone = compute_statistics(values), compute_statistics(values[~TUBE])
    assert (found.minimum, found.maximum, found.percentiles) == (alone.minimum, alone.maximum, alone.percentiles)
    np.testing.assert_array_equal(found.counts, alone.counts)
    assert read(values).value_range() == (alone.minimum, alone.maximum)


@pytest.mark.usefixtures("folder")
def test_a_fill_value_is_one_in_every_step() -> None:
    """A hole grows from one voxel to a tenth: its value, of no usual kind, is known by the steps where it is large."""
    random = np.random.default_rng(0)
    for step, num in enumerate((1, 3, 4000)):
        values = random.uniform(0, 10, (32, 32, 32)).astype(np.float32)
        values.flat[:num] = -777
        np.save(f"hole_{step}.npy", values)
    source = FileSource(Path("hole_0.npy"), steps=tuple(Path(f"hole_{step}.npy") for step in range(3)))
    assert [read_volume(VolumeSpec(source, time=step)).num_absent for step in range(3)] == [1, 3, 4000]
    assert read_volume(VolumeSpec(FileSource(Path("hole_0.npy")))).num_absent == 0


@pytest.mark.usefixtures("folder")
def test_fill_values_are_those_of_voxels_that_have_changed_behind_one_header() -> None:
    """A header stays as it is while another program writes the voxels that it names anew."""
    rng, steps = np.random.default_rng(0), []
    for num in (1, 4000):
        values = rng.normal(100, 10, 40_000).astype("<f4")
        values[rng.choice(values.size, num, replace=False)] = -1234
        steps.append(values)
    Path("hole.nhdr").write_text(
        "NRRD0004\ntype: float\ndimension: 4\nsizes: 40 40 25 2\nkinds: space space space time\n"
        "endian: little\nencoding: raw\ndata file: hole.raw\n"
    )
    spec = VolumeSpec(FileSource(Path("hole.nhdr")), time=0)
    Path("hole.raw").write_bytes(steps[0].tobytes() * 2)
    assert read_volume(spec).num_absent == 0  # a single voxel is no hole
    Path("hole.raw").write_bytes(steps[0].tobytes() + steps[1].tobytes())
    assert read_volume(spec).num_absent == 1


@pytest.mark.usefixtures("folder")
def test_what_lies_among_the_values_of_a_step_is_no_fill_value_in_it() -> None:
    random = np.random.default_rng(0)
    for step, high in enumerate((10, 1000)):
        values = random.uniform(0, high, (32, 32, 32)).astype(np.float32)
        values.flat[:400] = 700
        np.save(f"wide_{step}.npy", values)
    source = FileSource(Path("wide_0.npy"), steps=tuple(Path(f"wide_{step}.npy") for step in range(2)))
    assert [read_volume(VolumeSpec(source, time=step)).num_absent for step in range(2)] == [400, 0]
