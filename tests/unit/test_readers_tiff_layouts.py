"""Layouts that TIFF files state: ImageJ without a spacing, tifffile's description, Zeiss LSM, OME in several files, and
lengths that nobody states."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from tiff_files import tiff_bytes
from volume_files import ramp, read, refused, written

NO_SPACING = "the file does not give its voxel size; 1 x 1 x 1 is assumed"

pytestmark = pytest.mark.usefixtures("one_process")

ALONG_Z = "the file does not give its voxel size along z; that along x is assumed"
UNNAMED = "the file does not say which axes are times and components; those before z, y and x are taken for them"
STACK = ramp("uint16", (2, 3, 4, 5, 6))
GRAY: dict[str, Any] = {"photometric": "minisblack"}


@pytest.mark.parametrize(
    ("tag", "per_unit", "lines", "expected", "note"),
    [
        (1, 10, "unit=micron\n", (0.1, 0.1, 1), None),
        (1, 10, "unit=\\u00B5m\nspacing=-3\n", (0.1, 0.1, 3), None),  # ImageJ takes its amount
        (1, 10, "unit=nm\nspacing=0\n", (0.1, 0.1, 1), None),  # which ImageJ passes over
        (1, 10, "", (0.1, 0.1, 1), None),
        (3, 100_000, "unit=um\n", (0.1, 0.1, 1), None),
        (3, 10, "unit=cm\n", (1, 1, 10), None),
        (1, 10, "unit=um\nspacing=NaN\n", (0.1, 0.1, 0.1), ALONG_Z),
        (3, 10, "", (1, 1, 1), ALONG_Z),  # not as ImageJ writes it
        (1, 1, "unit=pixel\n", (1, 1, 1), NO_SPACING),
        (2, 72, "spacing=2\n", (1, 1, 2), None),
        (2, 300, "unit=inch\n", (1, 1, 1), NO_SPACING),
    ],
)
def test_imagej_without_a_spacing(tmp_path, tag, per_unit, lines, expected, note):
    """Its slices are 1 unit apart."""
    description = f"ImageJ=1.54f\nimages=3\nslices=3\n{lines}loop=false\n"
    data = tiff_bytes(ramp("uint16"), description=description, resolution=(tag, (per_unit, 1), (per_unit, 1)))
    volume = read(written(tmp_path / "a.tif", data))
    np.testing.assert_allclose(volume.spacing, expected, rtol=1e-12)
    assert volume.note == note
    assert read(tmp_path / "a.tif", (1.0, 1.0, 1.0)).note is None


@pytest.mark.parametrize(
    ("tag", "per_unit", "expected", "note"),
    [
        *((2, (n, 1), (1, 1, 1), NO_SPACING) for n in (1, 72, 96, 300)),
        *((3, (n, 100), (1, 1, 1), NO_SPACING) for n in (2835, 3780, 11811)),
        (1, (1, 1), (1, 1, 1), NO_SPACING),
        (2, (254, 1), (0.1, 0.1, 0.1), ALONG_Z),
        (3, (50, 1), (0.2, 0.2, 0.2), ALONG_Z),
    ],
)
def test_resolutions_of_screens_are_no_lengths(tmp_path, tag, per_unit, expected, note):
    data = tiff_bytes(ramp("uint16"), resolution=(tag, per_unit, per_unit))
    volume = read(written(tmp_path / "a.tif", data))
    np.testing.assert_allclose(volume.spacing, expected, rtol=1e-12)
    assert volume.note == note


def test_a_slice_of_imagej_does_not_say_how_far_the_next_one_is(tmp_path):
    for k, plane in enumerate(STACK[0, 0]):
        tifffile.imwrite(tmp_path / f"{k}.tif", plane, imagej=True, resolution=(2, 2), metadata={"unit": "mm"})
    volume = read(tmp_path)
    np.testing.assert_allclose(volume.spacing, 0.5)
    assert volume.note == ALONG_Z


def test_a_stack_of_imagej_whose_planes_are_called_channels(tmp_path):
    """As tifffile writes it where it is not told the axes."""
    stack = ramp("uint16", (8, 5, 6))
    tifffile.imwrite(tmp_path / "a.tif", stack, imagej=True, resolution=(4, 4), metadata={"spacing": 2, "unit": "um"})
    volume = read(tmp_path / "a.tif")
    np.testing.assert_array_equal(volume.values, stack)
    np.testing.assert_allclose(volume.spacing, (0.25, 0.25, 2))
    assert volume.note == "the file calls its planes channels, more than ImageJ has; they are taken for slices"


def test_ome_of_several_images_is_its_first(tmp_path):
    with tifffile.TiffWriter(tmp_path / "a.ome.tif") as file:
        file.write(STACK[0, 0], metadata={"axes": "ZYX"}, **GRAY)
        file.write(STACK[0, :, :2, :3, :3], metadata={"axes": "CZYX"}, **GRAY)
        file.write(STACK[0, 0] + 1, metadata={"axes": "ZYX"}, **GRAY)
    volume = read(tmp_path / "a.ome.tif")
    np.testing.assert_array_equal(volume.values, STACK[0, 0])
    assert volume.note is not None
    assert volume.note.startswith("the first of 3 images in this file is read; ")


def test_ome_without_a_size_along_z(tmp_path):
    description = (
        '<OME><Pixels DimensionOrder="XYZCT" SizeZ="3" SizeC="1" SizeT="1" PhysicalSizeX="0.1" PhysicalSizeY="0.2"/>'
        "</OME>"
    )
    volume = read(written(tmp_path / "a.tif", tiff_bytes(ramp("uint16"), description=description)))
    assert (volume.spacing.tolist(), volume.note) == ([0.1, 0.2, 0.1], ALONG_Z)


@pytest.mark.parametrize(
    ("shape", "axes", "choice", "part"),
    [
        ((2, 4, 5, 6), "TZYX", {"time": 1}, np.s_[1]), ((3, 4, 5, 6), "CZYX", {"component": 2}, np.s_[2]),
        ((4, 3, 5, 6), "ZCYX", {"component": 2}, np.s_[:, 2]),
        ((2, 3, 4, 5, 6), "TCZYX", {"time": 1, "component": 2}, np.s_[1, 2]),
        ((2, 4, 3, 5, 6), "TZCYX", {"time": 1, "component": 2}, np.s_[1, :, 2]), ((4, 5, 6), "QYX", {}, np.s_[:]),
        ((4, 5, 6), "TYX", {"time": 3}, np.s_[3:]), ((2, 4, 5, 6), "PZYX", {"time": 1}, np.s_[1]),
        ((2, 4, 5, 6), None, {"time": 1}, np.s_[1]), ((2, 3, 4, 5, 6), None, {"time": 1, "component": 2}, np.s_[1, 2]),
        ((4, 5, 6, 1), None, {}, np.s_[..., 0]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("truncate", [False, True])
def test_arrays_of_tifffile(tmp_path, shape, axes, choice, part, truncate):
    values = ramp("uint16", shape)
    described = {"axes": axes} if axes else {}
    tifffile.imwrite(tmp_path / "a.tif", values, metadata=described, truncate=truncate, **GRAY)
    np.testing.assert_array_equal(read(tmp_path / "a.tif", **choice).values, values[part])


def test_an_array_without_axes_is_as_its_shape_says(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", STACK[0], **GRAY)
    volume = read(tmp_path / "a.tif", (1.0, 1.0, 1.0))
    np.testing.assert_array_equal(volume.values, STACK[0, 0])
    assert volume.note == f"{UNNAMED}; 3 times; the first is drawn; `time: k` chooses another"


def test_several_arrays_of_tifffile_are_times(tmp_path):
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        for values in STACK[0]:
            file.write(values, **GRAY)
    np.testing.assert_array_equal(read(tmp_path / "a.tif", time=2).values, STACK[0, 2])


def test_pages_that_tifffile_writes_one_by_one_are_a_stack(tmp_path):
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        for plane in STACK[0, 0]:
            file.write(plane, **GRAY)
    volume = read(tmp_path / "a.tif")
    np.testing.assert_array_equal(volume.values, STACK[0, 0])
    assert volume.note == NO_SPACING


@pytest.mark.parametrize("planarconfig", ["contig", "separate"])
def test_samples_of_tifffile_are_components(tmp_path, planarconfig):
    colours = ramp("uint8", (2, 4, 5, 6, 3)) if planarconfig == "contig" else ramp("uint8", (2, 4, 3, 5, 6))
    axes = "TZYXS" if planarconfig == "contig" else "TZSYX"
    options: dict[str, Any] = {"photometric": "rgb", "planarconfig": planarconfig}
    tifffile.imwrite(tmp_path / "a.tif", colours, metadata={"axes": axes}, **options)
    expected = np.moveaxis(colours, axes.index("S"), -1)[1, ..., 2]
    np.testing.assert_array_equal(read(tmp_path / "a.tif", time=1, component=2).values, expected)


def test_axes_of_space_in_another_order(tmp_path):
    """An array [x, y, z] is the same object as its transpose [z, y, x]."""
    values = ramp("uint16", (4, 5, 6))
    tifffile.imwrite(tmp_path / "a.tif", values, metadata={"axes": "XYZ"}, **GRAY)
    volume = read(tmp_path / "a.tif")
    for index in ((1, 2, 3), (3, 0, 5)):
        world = volume.world_from_index @ [*index[::-1], 1]
        assert world[:3].tolist() == list(index)


@pytest.mark.parametrize(
    ("described", "tag", "per_unit", "expected", "note"),
    [
        ({"unit": "um", "spacing": 2.0}, None, 5, (0.2, 0.2, 2), None),  # tifffile's unit of the resolution is inch
        ({"unit": "µm", "spacing": 2.0}, "NONE", 5, (0.2, 0.2, 2), None),
        ({"unit": "um", "spacing": 2.0}, "CENTIMETER", 50_000, (0.2, 0.2, 2), None),
        ({"spacing": 2.0}, None, 5, (0.2, 0.2, 2), None),
        ({"unit": "um"}, None, 5, (0.2, 0.2, 0.2), ALONG_Z),
        ({}, "CENTIMETER", 50, (0.2, 0.2, 0.2), ALONG_Z),
        ({}, None, 1, (1, 1, 1), NO_SPACING),
    ],
)
def test_lengths_of_tifffile(tmp_path, described, tag, per_unit, expected, note):
    options = {"resolution": (per_unit, per_unit), "resolutionunit": tag, **GRAY}
    tifffile.imwrite(tmp_path / "a.tif", STACK[0, 0], metadata={"axes": "ZYX", **described}, **options)
    volume = read(tmp_path / "a.tif")
    np.testing.assert_allclose(volume.spacing, expected, rtol=1e-12)
    assert volume.note == note


@pytest.mark.parametrize(
    "described",
    [
        {"shape": [5, 5, 6]},  # pages are missing
        {"shape": [4, 5, 7]},
        {"shape": [4, 5, 6], "axes": "YX"},
        {"shape": [2, 2, 5, 6], "axes": "ZZYX"},
    ],
)
def test_arrays_that_do_not_fit_their_pages_are_refused(tmp_path, described):
    data = tiff_bytes(STACK[0, 0], description=json.dumps(described))
    refused(written(tmp_path / "a.tif", data), match="does not fit its pages")


@pytest.mark.parametrize("text", ['{"shape": [0, 5]}', '{"shape": 7}', '{"shape": [4', '{"shape": ["\\u0663"]}'])
def test_shapes_without_numbers_are_refused(tmp_path, text):
    refused(written(tmp_path / "a.tif", tiff_bytes(STACK[0, 0], description=text)))


def zeiss_record(sizes: tuple[int, ...], lengths: tuple[float, float, float]) -> bytes:
    """Return the first 96 bytes of what Zeiss writes. sizes: x, y, z, channels and times."""
    place = struct.pack("<II5i3i", 67127628, 96, *sizes, 2, 128, 128)
    return place + struct.pack("<6dHHI", *lengths, 0, 0, 0, 6, 0, 0)


@pytest.mark.parametrize("num_channels", [1, 3])
@pytest.mark.parametrize("compression", [None, "lzw"])
def test_zeiss_lsm(tmp_path, num_channels, compression):
    """Lengths are in metres; after each slice comes a thumbnail in colours, larger than these slices."""
    values = np.moveaxis(STACK, 1, 2)[:, :, :num_channels]  # time, z, channel, y, x
    record = zeiss_record((6, 5, 4, num_channels, 2), (2e-7, 2e-7, 1.5e-6))
    several = {"planarconfig": "separate"} if num_channels > 1 else {}
    with tifffile.TiffWriter(tmp_path / "a.lsm", byteorder="<") as file:
        for k, page in enumerate(values.reshape(8, num_channels, 5, 6)):
            tags = [] if k else [(34412, "B", len(record), record, True)]
            options = {"metadata": None, "compression": compression, **GRAY, **several}
            file.write(page if several else page[0], extratags=tags, **options)
            thumbnail = np.zeros((16, 16, 3), np.uint8)
            file.write(thumbnail, photometric="rgb", subfiletype=1, metadata=None)
    volume = read(tmp_path / "a.lsm", time=1, component=num_channels - 1)
    np.testing.assert_array_equal(volume.values, values[1, :, num_channels - 1])
    np.testing.assert_allclose(volume.spacing, (0.2, 0.2, 1.5), rtol=1e-12)  # µm, as those of OME
    assert volume.note == "8 smaller previews among the pages are left out"


def write_ome_files(folder: Path, names: tuple[str, str], stated: tuple[str, str]) -> None:
    """Write two times of a stack into two files, with `stated` for their names in both."""
    places = "".join(
        f'<TiffData FirstT="{t}" FirstZ="{z}" IFD="{z}"><UUID FileName="{name}">urn:uuid:{t}</UUID></TiffData>'
        for t, name in enumerate(stated)
        for z in range(4)
    )
    pixels = '<Pixels DimensionOrder="XYZCT" SizeX="6" SizeY="5" SizeZ="4" SizeC="1" SizeT="2" PhysicalSizeX="1"'
    for t, name in enumerate(names):
        description = f'<OME UUID="urn:uuid:{t}"><Image>{pixels}>{places}</Pixels></Image></OME>'
        (folder / name).write_bytes(tiff_bytes(STACK[t, 0], description=description))


def test_ome_in_several_files(tmp_path):
    write_ome_files(tmp_path, ("a.ome.tif", "b.ome.tif"), ("a.ome.tif", "b.ome.tif"))
    for name in ("a.ome.tif", "b.ome.tif"):
        for time in range(2):
            np.testing.assert_array_equal(read(tmp_path / name, time=time).values, STACK[time, 0])


def test_a_file_of_ome_may_be_renamed(tmp_path):
    """Then it is known by its identifier."""
    write_ome_files(tmp_path, ("first.tif", "b.ome.tif"), ("a.ome.tif", "b.ome.tif"))
    for time in range(2):
        np.testing.assert_array_equal(read(tmp_path / "first.tif", time=time).values, STACK[time, 0])


@pytest.mark.parametrize("stated", ["b.ome.tif", "../other/b.ome.tif", r"C:\scans\b.ome.tif", "/etc/b.ome.tif", ".."])
def test_files_of_ome_are_searched_beside_it_alone(tmp_path, stated):
    for name in ("data", "other"):
        (tmp_path / name).mkdir()
    write_ome_files(tmp_path / "data", ("a.ome.tif", "b.ome.tif"), ("a.ome.tif", stated))
    (tmp_path / "data/b.ome.tif").rename(tmp_path / "other/b.ome.tif")
    error = refused(tmp_path / "data/a.ome.tif", time=1, match="a file that this OME-TIFF names is not beside it")
    assert error.got == stated.replace("\\", "/").split("/")[-1]
    assert error.where == str(tmp_path / "data/a.ome.tif")
    np.testing.assert_array_equal(read(tmp_path / "data/a.ome.tif", time=0).values, STACK[0, 0])
    if stated == "b.ome.tif":
        (tmp_path / "data/b.ome.tif").symlink_to(tmp_path / "other/b.ome.tif")
        refused(tmp_path / "data/a.ome.tif", time=1, match="is a link to another folder")


def test_a_file_of_ome_with_too_few_pages_is_named(tmp_path):
    write_ome_files(tmp_path, ("a.ome.tif", "b.ome.tif"), ("a.ome.tif", "b.ome.tif"))
    (tmp_path / "b.ome.tif").write_bytes(tiff_bytes(STACK[1, 0, :2]))
    error = refused(tmp_path / "a.ome.tif", time=1, match="places planes on pages that this file lacks")
    assert error.where == str(tmp_path / "b.ome.tif")


def test_a_companion_of_ome_is_named_for_what_it_is(tmp_path):
    path = written(tmp_path / "a.companion.ome", b'<?xml version="1.0"?><OME></OME>')
    refused(path, match="this is the description of an OME-TIFF in several files, which has no pixels itself")


@pytest.mark.parametrize("text", ["-9999", "-3.40282346638528860e+38", "-3.4028235e+38", "0"])
def test_the_value_for_no_data_of_gdal(tmp_path, text):
    values = np.arange(1, 61, dtype=np.float32).reshape(3, 4, 5)
    values[1, 2, 3] = np.float32(text)
    tags = [(42113, "s", 0, text, True)]
    tifffile.imwrite(tmp_path / "a.tif", values, extratags=tags, metadata=None, **GRAY)
    expected = values.copy()
    expected[1, 2, 3] = np.nan
    np.testing.assert_array_equal(read(tmp_path / "a.tif").values, expected)
