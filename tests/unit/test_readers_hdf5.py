"""HDF5 and netCDF-4 that h5py wrote: datasets by name, axes, fill values, coordinates, and what must not be opened."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from volume_files import ramp, read, refused, written

pytestmark = pytest.mark.usefixtures("one_process")

VALUES = ramp("int16")
UNEVEN = "interp(level=numpy.linspace(FIRST, LAST, 3))"


def save(path, values=VALUES, name="t", dims=None, **attributes):
    """Write a dataset with attributes. dims: coordinates by their names, in the order of the axes, with units."""
    with h5py.File(path, "w") as file:
        dataset = file.create_dataset(name, data=values, compression="gzip")
        dataset.attrs.update(attributes)
        for axis, (label, (numbers, unit)) in enumerate((dims or {}).items()):
            file[label] = np.asarray(numbers)
            file[label].make_scale(label)
            file[label].attrs["units"] = unit
            dataset.dims[axis].attach_scale(file[label])
    return path


def image_of(monkeypatch, path, **choice):
    """Return what the reader gives, before the steps that all formats share."""
    images = []
    monkeypatch.setattr("renderer.readers.volume_reading.crop_image", lambda image, _: images.append(image) or image)
    read(path, **choice)
    return images[0]


@pytest.mark.parametrize("dtype", ["int8", "uint16", ">i4", "int64", "float16", ">f4", "float64"])
def test_types_and_byte_orders(tmp_path, dtype):
    values = ramp(np.dtype(dtype).name).astype(dtype)
    volume = read(save(tmp_path / "a.bin", values))
    np.testing.assert_array_equal(volume.values, values)
    assert volume.values.dtype == values.dtype.newbyteorder("=")
    assert "does not give its voxel size" in volume.note


def test_booleans_are_0_and_1_in_child(tmp_path):
    np.testing.assert_array_equal(read(save(tmp_path / "a.h5", VALUES % 2 == 0)).values, VALUES % 2 == 0)


def test_matlab_has_a_block_before_hdf5(tmp_path):
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["vol"] = VALUES
    data = (tmp_path / "a.mat").read_bytes()
    np.testing.assert_array_equal(read(tmp_path / "a.mat").values, VALUES)
    np.testing.assert_array_equal(read(written(tmp_path / "a.mat", b"MATLAB 7.3" + data[10:])).values, VALUES)


def test_datasets_are_named(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["plane"], file["in/low"], file["in/high"] = VALUES[0], VALUES, VALUES + 1
    np.testing.assert_array_equal(read(tmp_path / "a.h5", dataset="in/high").values, VALUES + 1)
    np.testing.assert_array_equal(read(tmp_path / "a.h5", dataset="/plane").values, VALUES[:1])
    assert str(refused(tmp_path / "a.h5")) == (
        f"{tmp_path / 'a.h5'}: this file holds 2 volumes, and one is rendered\n"
        "  got: in/high (5 x 4 x 3), in/low (5 x 4 x 3)\n"
        "  expected: `dataset: NAME`, such as `dataset: in/high`"
    )
    error = refused(tmp_path / "a.h5", match="there is no such dataset", dataset="in/hihg")
    assert error.hint == "did you mean in/high?"
    np.save(tmp_path / "a.npy", VALUES)
    refused(tmp_path / "a.npy", match="only HDF5 and netCDF-4 files, and stores, have them", dataset="in/high")


def test_even_coordinates_are_the_place(tmp_path):
    dims = {"level": ([500.0, 700.0, 900.0], "m"), "y": (1 - np.arange(4) / 4, "km"), "x": (np.arange(5) * 250.0, "m")}
    volume = read(save(tmp_path / "a.nc", dims=dims))
    expected = [[250, 0, 0, 0], [0, -250, 0, 1000], [0, 0, 200, 500], [0, 0, 0, 1]]
    np.testing.assert_allclose(volume.world_from_index, expected)
    assert "volume in this file" in volume.note and "spacing" not in volume.note


def test_axes_that_say_where_they_lie(tmp_path):
    """An array [x, y, z] lies in the world as [z, y, x] does: x is x, by its name or by the attribute `axis`."""
    steps = (np.arange(5) * 2.0 + 1, np.arange(4) * 3.0 + 2, np.arange(3) * 5.0 + 3)
    expected = [[0, 0, 2, 1], [0, 3, 0, 2], [5, 0, 0, 3], [0, 0, 0, 1]]
    for names in (("x", "y", "z"), ("lon", "lat", "level")):
        dims = {name: (numbers, "m") for name, numbers in zip(names, steps, strict=True)}
        path = save(tmp_path / "a.nc", VALUES.T, dims=dims)
        with h5py.File(path, "r+") as file:
            for name, axis in zip(names, "XYZ" if names[0] == "lon" else "", strict=False):
                file[name].attrs["axis"] = axis
        volume = read(path)
        np.testing.assert_array_equal(volume.values, VALUES.T)
        np.testing.assert_array_equal(volume.world_from_index, expected)


def test_coordinates_of_other_units_are_told(tmp_path):
    numbers = [np.arange(n, dtype=np.float32) / 10 + 300 for n in VALUES.shape]
    units = (("level", "hPa"), ("lat", "degrees_north"), ("lon", "degrees_east"))
    dims = {name: (own, unit) for own, (name, unit) in zip(numbers, units, strict=True)}
    assert "x in degrees, y in degrees, z in hPa" in read(save(tmp_path / "a.nc", dims=dims)).note


def test_uneven_coordinates_are_refused_unless_a_spacing_is_given(tmp_path):
    dims = {"level": ([1.0, 2.0, 4.0], "m"), "y": (np.arange(4.0), "m"), "x": (np.arange(5.0), "m")}
    path = save(tmp_path / "a.nc", dims=dims)
    assert UNEVEN in refused(path, match="level along z").hint
    np.testing.assert_array_equal(read(path, spacing=(1.0, 2.0, 3.0)).spacing, [1, 2, 3])


def test_packed_values_and_fill_values(tmp_path, monkeypatch):
    """By the conventions of netCDF: the value is `stored * scale_factor + add_offset`, fill values are stored ones."""
    path = save(tmp_path / "a.nc", scale_factor=0.5, add_offset=10.0, _FillValue=np.int16([-999]), missing_value=-5)
    image = image_of(monkeypatch, path)
    np.testing.assert_array_equal(image.values, (VALUES * 0.5 + 10).astype(np.float32))
    assert image.values.dtype == np.float32
    assert image.nodata == ((-489.5, -489.5), (7.5, 7.5))


def test_stored_numbers_without_a_sign(tmp_path):
    values = ramp("uint8")
    volume = read(save(tmp_path / "a.nc", values.view(np.int8), _Unsigned="true", _FillValue=np.int8(-1)))
    np.testing.assert_array_equal(volume.values, np.where(values == 255, np.nan, values))
    path = save(tmp_path / "a.nc", values.view(np.int8), _Unsigned="true", scale_factor=0.5, add_offset=10.0)
    np.testing.assert_array_equal(read(path).values, values * 0.5 + 10)
    np.testing.assert_array_equal(read(save(path, values.view(np.int8))).values, values.view(np.int8))


@pytest.mark.parametrize("scale", [0.5, -0.5])
@pytest.mark.parametrize("names", [{"valid_range": np.int16([3, 50])}, {"valid_min": 3, "valid_max": 50}])
def test_what_is_not_valid_is_no_data(tmp_path, names, scale):
    stored = np.where((VALUES >= 3) & (VALUES <= 50), VALUES, np.nan)
    np.testing.assert_array_equal(read(save(tmp_path / "a.nc", **names)).values, stored)
    path = save(tmp_path / "a.nc", scale_factor=scale, add_offset=1.0, **names)
    np.testing.assert_array_equal(read(path).values, stored * scale + 1)


@pytest.mark.parametrize(("field", "limit", "words"), [("valid_min", 3, "less than"), ("valid_max", 50, "more than")])
def test_values_beyond_a_limit_are_named_by_it(tmp_path, field, limit, words):
    note = read(save(tmp_path / "a.nc", **{field: np.int16(limit)})).note
    assert note is not None and f"voxels have no data: {words} " in note and "inf" not in note


def test_the_fill_value_of_unwritten_parts_is_no_data(tmp_path, monkeypatch):
    with h5py.File(tmp_path / "a.nc", "w") as file:
        dataset = file.create_dataset("t", (4, 4, 4), "f4", chunks=(2, 4, 4), fillvalue=9.96921e36)
        dataset[:2] = 1
    image = image_of(monkeypatch, tmp_path / "a.nc")
    assert image.nodata == ((float(np.float32(9.96921e36)),) * 2,)


def test_times_and_components_by_their_names(tmp_path):
    values = ramp("int32", (2, 3, 4, 5))
    dims = {"when": ([0.0, 31.0], "days since 2000-01-01")}
    dims |= {name: (np.arange(n), "m") for name, n in zip("zyx", values.shape[1:], strict=True)}
    path = save(tmp_path / "a.nc", values, dims=dims)
    assert "2 times; the first is drawn" in read(path).note
    np.testing.assert_array_equal(read(path, time=1).values, values[1])
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["v"] = np.moveaxis(values, 0, -1)[np.newaxis]
        for axis, label in enumerate(("t", "z", "y", "x", "channel")):
            file["v"].dims[axis].label = label
    np.testing.assert_array_equal(read(tmp_path / "a.h5", component=1).values, values[1])


def test_other_axes_are_those_of_npy(tmp_path):
    values = ramp("int32", (2, 3, 4, 5))
    path = save(tmp_path / "a.h5", values)
    refused(path, match="the array has four axes")
    np.testing.assert_array_equal(read(path, time=1).values, values[1])
    np.testing.assert_array_equal(read(path, component=4).values, values[..., 4])
    np.testing.assert_array_equal(read(save(path, VALUES[np.newaxis, :, :, :, np.newaxis])).values, VALUES)
    tags = '{"axes": [{"key": "z"}, {"key": "c"}, {"key": "y"}, {"key": "x"}]}'
    np.testing.assert_array_equal(read(save(path, values, axistags=tags), component=2).values, values[:, 2])


def test_times_of_a_plane_are_seen_as_a_volume(tmp_path):
    dims = {"time": ([0.0, 31.0, 59.0], "days since 2000"), "y": (np.arange(4.0), "m"), "x": (np.arange(5.0), "m")}
    np.testing.assert_array_equal(read(save(tmp_path / "a.nc", dims=dims)).spacing, [1, 1, 1])


def test_other_files_are_not_opened(tmp_path):
    save(tmp_path / "secret.h5")
    with h5py.File(tmp_path / "link.h5", "w") as file:
        file["t"] = h5py.ExternalLink("secret.h5", "t")
        file["s"] = h5py.SoftLink("/t")
    refused(tmp_path / "link.h5", match="this file holds no volume")
    refused(tmp_path / "link.h5", match="there is no such dataset", dataset="t")
    layout = h5py.VirtualLayout(VALUES.shape, VALUES.dtype)
    layout[:] = h5py.VirtualSource(tmp_path / "secret.h5", "t", VALUES.shape)
    with h5py.File(tmp_path / "virtual.h5", "w") as file:
        file.create_virtual_dataset("t", layout)
    refused(tmp_path / "virtual.h5", match="in other files, which are not opened")
    with h5py.File(tmp_path / "external.h5", "w") as file:
        file.create_dataset("t", VALUES.shape, "i2", external=[(str(tmp_path / "secret.h5"), 0, VALUES.nbytes)])
    refused(tmp_path / "external.h5", match="in other files, which are not opened")


def test_claims_of_voxels_that_are_not_there(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("t", (10**4, 10**4, 10**4), "f8", chunks=(100, 100, 100))
    refused(tmp_path / "a.h5", match="fewer bytes than its voxels need")
    path = save(tmp_path / "a.h5")
    refused(written(path, path.read_bytes()[:-200]), match="cannot be decoded")
    with h5py.File(path, "w") as file:
        file["text"] = np.full((2, 2, 2), b"abc")
    refused(path, match="this file holds no volume")
