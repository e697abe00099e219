"""Conventions of HDF5: which way coordinates count, axes of NeXus and EMD, levels and padding of microscopy."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from hdf5_files import VALUES, spoil_chunks, write_bdv, write_emd, write_imaris, write_netcdf, write_nexus
from volume_files import read, refused

pytestmark = pytest.mark.usefixtures("one_process")

LEVELS = {"level": [10.0, 30.0]}
PLANE = {"y": {"units": "m"}, "x": {"units": "m"}}


def vertical(tmp_path, name="level", **attributes):
    """Return the place and the step along z of a variable whose first coordinates have attributes."""
    path = write_netcdf(tmp_path / "a.nc", coordinates={name: attributes, **PLANE}, numbers={name: [10.0, 30.0]})
    volume = read(path)
    return volume.world_from_index[2, 3], volume.world_from_index[2, 2]


@pytest.mark.parametrize(
    ("name", "attributes"),
    [
        ("depth", {"units": "m", "positive": "down"}),
        ("depth", {"units": "m", "positive": "Down"}),
        ("depth", {"units": "m"}),
        ("z", {"units": "m", "standard_name": "depth"}),
        ("plev", {"units": "hPa"}),
        ("plev", {"units": "millibar"}),
        ("p", {"units": "dbar", "standard_name": "sea_water_pressure"}),
        ("sigma", {"units": "1", "standard_name": "atmosphere_sigma_coordinate"}),
        ("lev", {"positive": "down"}),
    ],
)
def test_what_counts_downwards_is_upside_down(tmp_path, name, attributes):
    """The first level, the least number, is the highest (CF 4.3)."""
    assert vertical(tmp_path, name, **attributes) == (-10, -20)


@pytest.mark.parametrize(
    ("name", "attributes"),
    [
        ("height", {"units": "m", "positive": "up"}),
        ("depth", {"units": "m", "positive": "up"}),
        ("plev", {"units": "hPa", "positive": "up"}),
        ("z", {"units": "m"}),
        ("sigma", {"units": "1", "standard_name": "ocean_sigma_coordinate"}),
    ],
)
def test_what_counts_upwards_stays(tmp_path, name, attributes):
    assert vertical(tmp_path, name, **attributes) == (10, 20)


def test_axes_are_found_by_units_and_positive(tmp_path):
    """An array [longitude, depth, latitude] has x, z and y of the world along its axes, slowest first."""
    coordinates = {
        "a": {"units": "degrees_east"},
        "b": {"units": "m", "positive": "down"},
        "c": {"units": "degreesN"},
    }
    numbers = {"a": [0.0, 5.0], "b": [0.0, 1.0, 2.0], "c": np.arange(4.0) * 3}
    volume = read(write_netcdf(tmp_path / "a.nc", coordinates=coordinates, numbers=numbers))
    np.testing.assert_array_equal(volume.world_from_index[:3, :3], [[0, 0, 5], [3, 0, 0], [0, -1, 0]])


def test_coordinates_may_be_packed(tmp_path):
    coordinates = {"level": {"units": "m", "scale_factor": 0.5, "add_offset": 100.0}, **PLANE}
    volume = read(write_netcdf(tmp_path / "a.nc", coordinates=coordinates, numbers={"level": np.int16([2, 6])}))
    np.testing.assert_array_equal(volume.world_from_index[2], [0, 0, 2, 101])


def test_a_valid_range_of_the_wider_type_is_one_of_values(tmp_path):
    """NetCDF's guide: a range of the type of scale_factor, wider than the stored numbers, is not packed."""
    packed = {"scale_factor": np.float32(0.5), "add_offset": np.float32(10)}
    values = VALUES * 0.5 + 10
    path = write_netcdf(tmp_path / "a.nc", coordinates=PLANE, valid_range=np.float32([11, 20]), **packed)
    np.testing.assert_array_equal(read(path).values, np.where((values >= 11) & (values <= 20), values, np.nan))
    path = write_netcdf(tmp_path / "a.nc", coordinates=PLANE, valid_range=np.int16([2, 20]), **packed)
    np.testing.assert_array_equal(read(path).values, np.where((VALUES >= 2) & (VALUES <= 20), values, np.nan))


def test_times_of_an_axis(tmp_path):
    series = np.stack([VALUES, VALUES + 1, VALUES + 2])
    coordinates = {"when": {"units": "hours since 2000-01-01"}, "level": {"units": "m"}, **PLANE}
    volume = read(write_netcdf(tmp_path / "a.nc", series, coordinates, {"when": [0, 6, 18]}), time=0)
    assert (volume.num_times, volume.times, volume.time_unit) == (3, (0, 21600, 64800), "s")


def test_flags_are_labels(tmp_path):
    attributes = {"flag_values": np.int8([0, 1, 5]), "flag_meanings": "no_data sea ice"}
    volume = read(write_netcdf(tmp_path / "a.nc", (VALUES % 6).astype(np.int8), **attributes))
    assert [(each.value, each.name) for each in volume.labels] == [(0, "no_data"), (1, "sea"), (5, "ice")]


def test_attributes_that_may_be_lengths_are_named(tmp_path):
    volume = read(write_netcdf(tmp_path / "a.h5", voxel_spacing=[1.0, 1.0, 2.0], creator="me"))
    assert volume.note is not None and "not applied: voxel_spacing" in volume.note
    assert read(tmp_path / "a.h5", spacing=(1.0, 1.0, 2.0)).note == "the only volume in this file, t, is read"


MM = dict.fromkeys(("z", "y", "x"), "mm")
EVEN = {"z": 3 + np.arange(2) * 2.0, "y": np.arange(3) / 2, "x": np.arange(4.0)}


@pytest.mark.parametrize(
    "group", [{"axes": ["z", "y", "x"]}, {"axes": "z:y:x"}, {"axes": [".", ".", "."], **{
        f"{name}_indices": k for k, name in enumerate("zyx")}} | {"axes": ["x", "z", "y"]}]
)  # fmt: skip
def test_axes_of_nexus(tmp_path, group):
    volume = read(write_nexus(tmp_path / "a.nxs", fields=EVEN, group=group, units=MM))
    np.testing.assert_array_equal(volume.world_from_index[:3], [[1, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 2, 3]])
    assert volume.length_unit == "mm" and "voxel size" not in str(volume.note)


def test_older_nexus_marks_the_signal_and_its_axes(tmp_path):
    path = write_nexus(tmp_path / "a.nxs", fields={**EVEN, "w": VALUES + 1}, units=MM)
    with h5py.File(path, "r+") as file:
        del file["entry/data"].attrs["signal"]
        file["entry/data/w"].attrs.update(signal=1, axes="[z,y,x]")
    volume = read(path)
    np.testing.assert_array_equal(volume.values, VALUES + 1)
    np.testing.assert_array_equal(volume.spacing, [1, 0.5, 2])


def test_edges_of_nexus_lie_between_voxels(tmp_path):
    fields = EVEN | {"z": np.array([0.0, 2.0, 4.0])}
    volume = read(write_nexus(tmp_path / "a.nxs", fields=fields, group={"axes": ["z", "y", "x"]}))
    assert volume.world_from_index[2, 2:].tolist() == [2, 1]


def test_scaled_data_of_nexus(tmp_path):
    """`(stored + offset) * scaling_factor` (NXdata)."""
    volume = read(write_nexus(tmp_path / "a.nxs", fields={"v_scaling_factor": 0.5, "v_offset": 10}))
    np.testing.assert_array_equal(volume.values, (VALUES + 10) * 0.5)


def test_links_of_nexus_inside_and_outside_of_the_file(tmp_path):
    write_nexus(tmp_path / "other.nxs", VALUES + 9)
    path = write_nexus(tmp_path / "a.nxs")
    with h5py.File(path, "r+") as file:
        file["measured"] = VALUES + 5
        del file["entry/data/v"]
        file["entry/data/v"] = h5py.SoftLink("/measured")
    np.testing.assert_array_equal(read(path, dataset="measured").values, VALUES + 5)
    with h5py.File(path, "r+") as file:
        del file["entry/data/v"], file["measured"]
        file["entry/data/v"] = h5py.ExternalLink("other.nxs", "/entry/data/v")
    refused(path, match="this file holds no volume")
    with h5py.File(path, "r+") as file:
        del file["entry/data/v"]
        file["entry/data/v"] = h5py.SoftLink("/entry/data/v")
    refused(path, match="this file holds no volume")


@pytest.mark.parametrize("place", [2.0**62, -5, float("nan"), 0.5])
def test_axes_of_nexus_that_are_not_there(tmp_path, place):
    group = {"axes": ["z", ".", "."], "z_indices": place}
    volume = read(write_nexus(tmp_path / "a.nxs", fields=EVEN, group=group))
    np.testing.assert_array_equal(volume.spacing, [1, 1, 1])


def test_places_that_are_not_there(tmp_path):
    path = write_netcdf(tmp_path / "a.nc")
    with h5py.File(path, "r+") as file:
        file["t"].attrs["coordinates"] = "/ .. . t/t nowhere " * 500
    np.testing.assert_array_equal(read(path).values, VALUES)


def test_axes_of_emd_x_first(tmp_path):
    dims = {
        f"dim{k + 1}": (np.arange(n) * step, {"name": name, "units": "[n_m]"})
        for k, (name, n, step) in enumerate((("x", 4, 1.0), ("y", 3, 1.0), ("z", 2, 2.0)))
    }
    volume = read(write_emd(tmp_path / "a.emd", VALUES.T, **dims))
    np.testing.assert_array_equal(volume.values, VALUES.T)
    np.testing.assert_array_equal(volume.world_from_index[:3, :3], [[0, 0, 1], [0, 1, 0], [2, 0, 0]])
    assert volume.length_unit == "nm"


def test_coordinates_of_emd_may_be_the_first_two(tmp_path):
    """As py4DSTEM writes even ones, from dim0 on."""
    dims = {f"dim{k}": ([0.0, 0.5 + k], {"name": name, "units": "Å"}) for k, name in enumerate("zyx")}
    volume = read(write_emd(tmp_path / "a.h5", np.zeros((4, 5, 6)), **dims))
    np.testing.assert_array_equal(volume.spacing, [2.5, 1.5, 0.5])


ENDS = {"ExtMin0": 10, "ExtMin1": 0, "ExtMin2": 0, "ExtMax0": 14, "ExtMax1": 3, "ExtMax2": 4, "Unit": "um"}
CHANNELS = {"Channel 0": {"Name": "GFP", "Color": "0 1 0"}, "Channel 1": {"Name": "RFP", "Color": "1 0 0"}}


def test_imaris(tmp_path):
    """4 x 3 x 2 voxels of 1 x 1 x 2 um; ExtMin and ExtMax are the outer ends of voxels."""
    info = {"Image": ENDS, **CHANNELS}
    path = write_imaris(tmp_path / "a.ims", (VALUES, VALUES + 1), padding=3, num_levels=2, info=info)
    for component in range(2):
        np.testing.assert_array_equal(read(path, component=component).values, VALUES + component)
    volume = read(path)
    np.testing.assert_array_equal(
        volume.world_from_index[:3], [[1, 0, 0, 10.5], [0, 1, 0, 0.5], [0, 0, 2, 1]]
    )  # fmt: skip
    assert volume.length_unit == "µm"
    assert [(each.name, each.color, each.is_light) for each in volume.channels] == [
        ("GFP", (0, 1, 0), True),
        ("RFP", (1, 0, 0), True),
    ]
    coarse = read(path, level=1, component=1)
    np.testing.assert_array_equal(coarse.values, VALUES[::2, ::2, ::2] + 1)
    np.testing.assert_array_equal(coarse.spacing, [2, 1.5, 4])  # the same ends, of 2 x 2 x 1 voxels
    assert [(each.shape, each.is_read) for each in coarse.levels] == [((4, 3, 2), False), ((2, 2, 1), True)]
    assert refused(path, match="there is no such level", level=2).expected == "0 to 1"


def test_imaris_that_lacks_a_channel(tmp_path):
    path = write_imaris(tmp_path / "a.ims", (VALUES, VALUES))
    with h5py.File(path, "r+") as file:
        channel = file["DataSet/ResolutionLevel 0/TimePoint 0/Channel 1"]
        del channel["Data"]
        channel["Data"] = h5py.ExternalLink("other.ims", "/Data")
    refused(path, match="lacks the voxels of a channel", component=1)
    np.testing.assert_array_equal(read(path, component=0).values, VALUES)


def view_setup(number, channel, angle=0):
    return (
        f"<ViewSetup><id>{number}</id><name>c{channel}</name><size>4 3 2</size>"
        "<voxelSize><unit>um</unit><size>0.5 1 2</size></voxelSize>"
        f"<attributes><channel>{channel}</channel><angle>{angle}</angle></attributes></ViewSetup>"
    )


def test_bigdataviewer(tmp_path):
    large = (VALUES + np.uint16(2**15)).astype(np.uint16)  # negative as numbers with a sign
    xml = view_setup(0, 0) + view_setup(1, 1)
    path = write_bdv(tmp_path / "a.h5", (large, large + 7), num_levels=2, num_times=3, padding=2, xml=xml)
    volume = read(path, component=1, time=2)
    np.testing.assert_array_equal(volume.values, large + 9)
    assert volume.values.dtype == np.uint16 and volume.num_times == 3
    np.testing.assert_array_equal(volume.spacing, [0.5, 1, 2])
    assert [each.name for each in volume.channels] == ["c0", "c1"] and volume.length_unit == "µm"
    coarse = read(path, level=1, component=0, time=0)
    np.testing.assert_array_equal(coarse.spacing, [1, 2, 4])
    np.testing.assert_array_equal(coarse.world_from_index[:3, 3], [0.25, 0.5, 1])  # in the middle of two


LARGE = np.arange(16 * 12 * 14, dtype=np.uint16).reshape(16, 12, 14)
CHUNKS = {"chunks": (8, 6, 7), "compression": "gzip"}


@pytest.mark.parametrize("kind", ["imaris", "bdv"])
def test_a_crop_reads_the_chunks_of_one_time_and_channel(tmp_path, kind):
    """Whatever else is read is damaged. A crop is of the finest level, at whatever level is drawn."""
    both = (LARGE, LARGE + 5)
    if kind == "imaris":
        path = write_imaris(tmp_path / "a.ims", both, num_levels=2, info={"Image": ENDS}, **CHUNKS)
        places = [f"DataSet/ResolutionLevel {level}/TimePoint 0/Channel {{}}/Data" for level in range(2)]
    else:
        xml = "".join(view_setup(k, k).replace("4 3 2", "14 12 16") for k in range(2))
        path = write_bdv(tmp_path / "a.h5", both, num_levels=2, xml=xml, **CHUNKS)
        places = [f"t00000/s{{:02}}/{level}/cells" for level in range(2)]
    for place in places:
        spoil_chunks(path, place.format(0), but=())
    spoil_chunks(path, places[0].format(1), but=(8, 0, 7))
    crop = ((8, 14), (2, 6), (10, 13))
    volume = read(path, component=1, level=0, crop=crop)
    np.testing.assert_array_equal(volume.values, both[1][10:13, 2:6, 8:14])
    assert volume.levels[0].chunks == (7, 6, 8)
    coarse = read(path, component=1, level=1, crop=crop)
    np.testing.assert_array_equal(coarse.values, both[1][::2, ::2, ::2][5:7, 1:3, 4:7])
    error = refused(path, match="cannot be decoded", component=1, level=0)
    assert places[0].format(1) in error.where
    refused(path, match="the crop does not fit the volume along z", component=1, crop=(None, None, (0, 17)))


def test_steps_that_differ_in_their_type_are_refused(tmp_path):
    """Numbers of the same size are not taken for numbers of another type."""
    path = write_imaris(tmp_path / "a.ims", (LARGE,))
    with h5py.File(path, "r+") as file:
        times = file["DataSet/ResolutionLevel 0"]
        times["TimePoint 1/Channel 0/Data"] = LARGE.astype(np.float16)
    assert "TimePoint 1" in refused(path, match="lacks the voxels of a channel", time=1).got


def test_the_finest_level_that_fits_is_read(tmp_path, monkeypatch):
    path = write_imaris(tmp_path / "a.ims", (LARGE,), num_levels=3)
    monkeypatch.setattr("renderer.readers.volume_reading.free_bytes", lambda: LARGE.nbytes)
    volume = read(path)
    np.testing.assert_array_equal(volume.values, LARGE[::2, ::2, ::2])
    assert volume.spacing.tolist() == [2, 2, 2] and "level 1, the finest that fits" in volume.note


def test_a_crop_of_one_dataset_reads_its_chunks_alone(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("a", data=np.stack([LARGE, LARGE + 9]), chunks=(1, 8, 6, 7), compression="gzip")
        file["a"].dims[0].label = "t"
    spoil_chunks(tmp_path / "a.h5", "a", but=(1, 8, 0, 7))
    volume = read(tmp_path / "a.h5", time=1, crop=((8, 14), (0, 6), (10, 13)))
    np.testing.assert_array_equal(volume.values, LARGE[10:13, :6, 8:14] + 9)
    assert volume.world_from_index[:3, 3].tolist() == [8, 0, 10]
    refused(tmp_path / "a.h5", match="there is no such level", time=1, level=1)


def test_bigdataviewer_without_its_description(tmp_path):
    path = write_bdv(tmp_path / "a.h5", (VALUES, VALUES + 1), num_levels=3)
    error = refused(path, match="this file holds 2 volumes")
    assert error.got == "s00 (4 x 3 x 2), s01 (4 x 3 x 2)"
    volume = read(path, dataset="s01")
    np.testing.assert_array_equal(volume.values, VALUES + 1)
    assert volume.note is not None and "the .xml of BigDataViewer, which has it, is not beside it" in volume.note


@pytest.mark.parametrize("xml", ["<!DOCTYPE a [<!ENTITY b 'c'>]>&b;", "<ViewSetup>", "<a>" * 10**5])
def test_descriptions_of_bigdataviewer_that_are_damaged(tmp_path, xml):
    path = write_bdv(tmp_path / "a.h5", xml=xml)
    assert refused(path, match="description beside this BigDataViewer file").where == str(tmp_path / "a.xml")


def test_descriptions_of_others_and_elsewhere_are_not_read(tmp_path):
    (tmp_path / "in").mkdir()
    path = write_bdv(tmp_path / "in/a.h5", xml=view_setup(0, 0))
    (tmp_path / "in/a.xml").rename(tmp_path / "a.xml")
    (tmp_path / "in/a.xml").symlink_to(tmp_path / "a.xml")
    assert "not beside it" in str(read(path).note)
    (tmp_path / "in/a.xml").unlink()
    (tmp_path / "in/a.xml").write_text("<other/>")
    assert "not beside it" in str(read(path).note)


def test_other_views_of_bigdataviewer_are_other_volumes(tmp_path):
    path = write_bdv(tmp_path / "a.h5", (VALUES, VALUES), xml=view_setup(0, 0, 0) + view_setup(1, 0, 90))
    refused(path, match="this file holds 2 volumes")
