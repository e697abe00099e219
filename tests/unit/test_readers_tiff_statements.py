"""TIFF: pages that are turned, as Pillow turns them; values that ImageJ calibrates; samples that are alpha."""

from __future__ import annotations

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageOps
from stated_tiff import imagej, ome
from volume_files import ramp, read, refused

pytestmark = pytest.mark.usefixtures("one_process")

PLANE = np.arange(12, dtype=np.uint8).reshape(3, 4)


def seen(volume):
    """Return a plane as it lies in the world: rows along y, columns along x, both from the least place on."""
    places = {}
    for (row, column), value in np.ndenumerate(volume.values[0]):
        x, y, _, _ = volume.world_from_index @ (column, row, 0, 1)
        places[y, x] = value
    num_rows = len({y for y, _ in places})
    return np.array([places[place] for place in sorted(places)]).reshape(num_rows, -1)


@pytest.mark.parametrize("number", range(1, 9))
def test_orientations_are_those_of_pillow(tmp_path, number):
    turn = [(274, "H", 1, number, True)]
    more = {"resolution": (5, 10), "resolutionunit": 3, "photometric": "minisblack", "metadata": None}
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        for plane in (PLANE, PLANE + 20):
            file.write(plane, extratags=turn, **more)
    picture = Image.fromarray(PLANE)
    picture.getexif()[274] = number
    expected = np.asarray(ImageOps.exif_transpose(picture))
    volume = read(tmp_path / "a.tif")
    np.testing.assert_array_equal(seen(volume), expected)
    np.testing.assert_array_equal(volume.spacing, [2, 1, 2])  # of the stored columns, rows and pages
    corners = volume.world_from_index @ np.array([[0, 0, 0, 1], [3, 2, 0, 1]]).T
    np.testing.assert_array_equal(corners.min(axis=1), [0, 0, 0, 1])


def test_pages_and_files_of_several_orientations_are_refused(tmp_path):
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        for number in (1, 3):
            file.write(PLANE, metadata=None, extratags=[(274, "H", 1, number, True)])
    assert refused(tmp_path / "a.tif", match="the pages differ").got == "Orientation 1, 3"
    (tmp_path / "stack").mkdir()
    for number in (1, 3):
        turn = [(274, "H", 1, number, True)]
        tifffile.imwrite(tmp_path / f"stack/s{number}.tif", PLANE, metadata=None, extratags=turn)
    assert "4 x 3 uint8 of Orientation 3" in str(refused(tmp_path / "stack", match="slices of this folder differ"))


VALUES = np.arange(48, dtype=np.uint16).reshape(2, 4, 6) * 1000


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["cf=0", "c0=-32768.0", "c1=1.0"], VALUES - 32768.0),  # as ImageJ writes numbers with a sign
        (["cf=1", "c0=1.0", "c1=2.0", "c2=0.5"], 1 + 2.0 * VALUES + 0.5 * VALUES.astype(float) ** 2),
        (["cf=20", "c0=5.0", "c1=2.0"], VALUES),
        (["cf=0", "c0=0.0", "c1=1.0"], VALUES),
        (["c0=5.0", "c1=2.0"], VALUES),
    ],
)
def test_calibrations_of_imagej(tmp_path, lines, expected):
    volume = read(imagej("slices=2", *lines, "vunit=HU", values=VALUES)(tmp_path))
    np.testing.assert_allclose(volume.values, expected, rtol=1e-6)
    assert volume.value_unit == ("HU" if "cf=0" in lines or "cf=1" in lines else "")
    assert (volume.values.dtype == np.uint16) == (expected is VALUES)


def test_a_folder_of_calibrated_slices(tmp_path):
    for k, c0 in enumerate((5.0, 5.0)):
        (tmp_path / f"{k}").mkdir()
        imagej(f"cf=0\nc0={c0}\nc1=1.0", values=VALUES[k : k + 1])(tmp_path / f"{k}").rename(tmp_path / f"s{k}.tif")
        (tmp_path / f"{k}").rmdir()
    np.testing.assert_array_equal(read(tmp_path).values, VALUES + 5.0)


def test_floats_have_no_calibration(tmp_path):
    values = VALUES.astype(np.float32)
    volume = read(imagej("slices=2", "cf=0", "c0=5.0", "c1=2.0", values=values)(tmp_path))
    np.testing.assert_array_equal(volume.values, values)


def test_the_origin_of_imagej_is_a_pixel(tmp_path):
    lines = ("slices=2", "unit=micron", "spacing=3.0", "xorigin=2.0", "zorigin=-1")
    volume = read(imagej(*lines)(tmp_path))
    np.testing.assert_array_equal(volume.world_from_index[:3, 3], [-2, 0, 3])


def test_alpha_is_named_by_extra_samples(tmp_path):
    colours = ramp("uint8", (2, 4, 5, 4))
    for kind, name in (("unassalpha", "A"), ("assocalpha", "A"), ("unspecified", "extra")):
        tifffile.imwrite(tmp_path / "a.tif", colours, photometric="rgb", extrasamples=[kind], metadata=None)
        assert [each.name for each in read(tmp_path / "a.tif").channels] == ["R", "G", "B", name]
    grey = {"photometric": "minisblack", "planarconfig": "contig", "metadata": None}
    tifffile.imwrite(tmp_path / "a.tif", colours[..., :2], extrasamples=["unassalpha"], **grey)
    channels = read(tmp_path / "a.tif").channels
    assert [(each.name, each.is_light) for each in channels] == [("grey", False), ("A", False)]


def test_jpeg_of_12_bits_and_its_colours(tmp_path):
    """Its colours are stored in another space, and decoded to red, green and blue."""
    plane = np.tile(np.linspace(0, 4095, 64).astype(np.uint16), (64, 1))
    more = {"compression": "jpeg", "compressionargs": {"level": 95, "bitspersample": 12}, "metadata": None}
    tifffile.imwrite(tmp_path / "a.tif", np.stack([plane, plane // 2, plane], -1), photometric="rgb", **more)
    volume = read(tmp_path / "a.tif", component=1)
    assert np.abs(volume.values[0].astype(int) - plane // 2).max() <= 60  # of JPEG itself
    assert [each.name for each in volume.channels] == ["R", "G", "B"]


def test_samples_of_other_colours_are_told(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", ramp("uint8", (2, 4, 5, 4)), photometric="separated", metadata=None)
    assert "not applied: PhotometricInterpretation" in str(read(tmp_path / "a.tif").note)


def test_fill_order(tmp_path):
    """By FillOrder 2 the first pixel of a byte is its lowest bit (TIFF 6)."""
    tifffile.imwrite(tmp_path / "a.tif", np.array([[1, 1, 0, 1, 0, 0, 0, 0]] * 2, bool), metadata=None)
    data = (tmp_path / "a.tif").read_bytes()
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        unit = file.pages[0].tags[296]  # a field of one short number, which becomes FillOrder 2
    field = (266).to_bytes(2, "little") + b"\3\0\1\0\0\0\2\0\0\0"
    (tmp_path / "a.tif").write_bytes(data[: unit.offset] + field + data[unit.offset + 12 :])
    np.testing.assert_array_equal(read(tmp_path / "a.tif").values[0, 0], [0, 0, 0, 0, 1, 0, 1, 1])


def test_positions_and_angles_of_ome_are_told(tmp_path):
    volume = read(ome(inside="<Plane PositionX='7'/>", after="<ModuloAlongT Type='lifetime'/>")(tmp_path))
    assert "PositionX (the position of the stage" in str(volume.note) and "ModuloAlongT" in str(volume.note)
