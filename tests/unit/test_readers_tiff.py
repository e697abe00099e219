"""TIFF that tifffile writes: every type, stacks in folders, tiles, hyperstacks, spacing."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from tiff_files import BITS, HEIGHT, LONG, PIXELS, SHORT, WIDTH, tiff, tiff_bytes
from volume_files import ramp, read, refused, write_image, written

pytestmark = pytest.mark.usefixtures("one_process")


def assert_sizes_cannot_be_compared(path: Path, got: str, expected: str) -> None:
    error = refused(path)
    assert str(error) == (
        f"{path}: the voxel sizes in this TIFF file are in units that cannot be compared\n"
        f"  got: {got}\n"
        f"  expected: one unit for all, or {expected}\n"
        "  hint: `spacing: [x, y, z]` replaces the spacing in the file"
    )
    np.testing.assert_array_equal(read(path, (1.0, 2.0, 3.0)).spacing, [1, 2, 3])


@pytest.mark.parametrize("order", ["<", ">"])
def test_big_tiff(tmp_path, order):
    (tmp_path / "a.tif").write_bytes(tiff_bytes(ramp("int16"), order, big=True))
    np.testing.assert_array_equal(read(tmp_path / "a.tif").values, ramp("int16"))


def test_folder_of_colours(tmp_path):
    for k in range(3):
        colours = np.zeros((4, 5, 3), np.uint8)
        colours[..., 1] = 10 + k
        write_image(tmp_path / f"{k}.tif", colours, has_components=True)
    assert read(tmp_path, component=1).values[:, 0, 0].tolist() == [10, 11, 12]
    first = read(tmp_path, (1.0, 1.0, 1.0))
    assert not first.values.any()
    hint = "; `component: color` draws the colours"
    assert first.note == f"3 components (R, G, B); the first is drawn; `component: k` chooses another{hint}"


def test_resolutions_differ_along_x_and_y(tmp_path):
    data = tiff_bytes(ramp("uint16"), resolution=(2, (10, 1), (5, 1)))  # pixels per inch; lengths in mm
    np.testing.assert_allclose(read(written(tmp_path / "a.tif", data)).spacing, (2.54, 5.08, 2.54), rtol=1e-15)


IMAGEJ = "ImageJ=1.53\nimages=3\nslices=3\nspacing=2.0\n"


@pytest.mark.parametrize(
    ("tag", "per_unit", "lines", "expected"),
    [
        (1, 10, "unit=micron\n", (0.1, 0.1, 2)),  # by Fiji, and by tifffile without a unit of the resolution
        (1, 10, "", (0.1, 0.1, 2)),
        (3, 100_000, "unit=um\n", (0.1, 0.1, 2)),  # of tifffile, told CENTIMETER
        (3, 100_000, "unit=\u03bcm\n", (0.1, 0.1, 2)),
        (3, 10, "unit=cm\n", (1, 1, 20)),  # of Fiji, which writes the tag as well for these two units
        (2, 10, "unit=inch\n", (2.54, 2.54, 50.8)),
        (3, 10, "", (1, 1, 20)),
        (None, 10, "unit=um\n", (0.1, 0.1, 2)),
        (None, 10, "", (2.54, 2.54, 50.8)),  # TIFF's own unit
        (1, 10, "unit=um\nyunit=micron\nzunit=\\u00B5m\n", (0.1, 0.1, 2)),
    ],
)
def test_units_of_imagej(tmp_path, tag, per_unit, lines, expected):
    """Resolutions are per unit of the tag, and the step along z is in the unit that the description names."""
    data = tiff_bytes(ramp("uint16"), description=IMAGEJ + lines, resolution=(tag or 1, (per_unit, 1), (per_unit, 1)))
    if tag is None:
        entry = struct.pack("<HHI", 296, SHORT, 1)
        assert data.count(entry) == 3
        data = data.replace(entry, struct.pack("<HHI", 297, SHORT, 1))  # a field of which nothing is known
    np.testing.assert_allclose(read(written(tmp_path / "a.tif", data)).spacing, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("tag", "lines", "got"),
    [
        (2, "unit=um\n", "pixels per inch; x in \u03bcm, y in \u03bcm, z in \u03bcm"),
        (3, "unit=mm\n", "pixels per cm; x in mm, y in mm, z in mm"),
        (1, "unit=um\nzunit=nm\n", "x in \u03bcm, y in \u03bcm, z in nm"),
        (1, "unit=um\nyunit=sec\n", "x in \u03bcm, y in sec, z in \u03bcm"),
    ],
)
def test_units_of_imagej_that_disagree(tmp_path, tag, lines, got):
    data = tiff_bytes(ramp("uint16"), description=IMAGEJ + lines, resolution=(tag, (10, 1), (10, 1)))
    (tmp_path / "a.tif").write_bytes(data)
    assert_sizes_cannot_be_compared(tmp_path / "a.tif", got, "pixels per cm and unit=um")


def ome_sizes(**attributes: str) -> str:
    """Return a description with sizes of x, y and z and units such as `XUnit`; a second image has other ones."""
    sizes = " ".join(f'PhysicalSize{name}="{value}"' for name, value in attributes.items())
    counts = 'DimensionOrder="XYZCT" SizeX="5" SizeY="4" SizeZ="3" SizeC="1" SizeT="1"'
    second = 'PhysicalSizeX="9" PhysicalSizeXUnit="km" PhysicalSizeYUnit="km" PhysicalSizeZUnit="km"'
    return f"<OME><Image><Pixels {counts} {sizes}/></Image><Image><Pixels {second}/></Image></OME>"


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [
        ({"X": "0.1", "Y": "0.1", "Z": "500", "XUnit": "µm", "YUnit": "µm", "ZUnit": "nm"}, (0.1, 0.1, 0.5)),
        ({"X": "0.1", "Y": "0.1", "Z": "500", "ZUnit": "nm"}, (0.1, 0.1, 0.5)),  # µm by default
        ({"X": "100", "Y": "0.1", "Z": "0.0005", "XUnit": "nm", "ZUnit": "mm"}, (100, 100, 500)),
        ({"X": "0.1", "Y": "0.2", "Z": "1", "XUnit": "mm", "YUnit": "mm", "ZUnit": "mm"}, (0.1, 0.2, 1)),
        ({"X": "0.1", "Y": "0.2", "Z": "1", "XUnit": "&#181;m", "YUnit": "&#xB5;m", "ZUnit": "\u03bcm"}, (0.1, 0.2, 1)),
        ({"X": "1", "Y": "10", "Z": "10", "XUnit": "nm", "YUnit": "\u00c5", "ZUnit": "\u212b"}, (1, 1, 1)),
        ({"X": "1", "Y": "1", "Z": "1", "XUnit": "in", "YUnit": "ft", "ZUnit": "mm"}, (1, 12, 1 / 25.4)),
        ({"X": "72", "Y": "12", "Z": "1000", "XUnit": "pt", "YUnit": "li", "ZUnit": "thou"}, (72, 72, 72)),
        ({"X": "1", "Y": "1760", "Z": "1", "XUnit": "mi", "YUnit": "yd", "ZUnit": "km"}, (1, 1, 1 / 1.609344)),
        ({"X": "1", "Y": "1", "Z": "1", "XUnit": "ua", "YUnit": "pc", "ZUnit": "ly"}, (1, 206264.806, 63241.077)),
        ({"X": "1", "Y": "1e-3", "Z": "1e-6", "XUnit": "Em", "YUnit": "Zm", "ZUnit": "Ym"}, (1, 1, 1)),
        ({"X": "1e6", "Y": "1e3", "Z": "1", "XUnit": "Gm", "YUnit": "Tm", "ZUnit": "Pm"}, (1e6, 1e6, 1e6)),
        ({"X": "1e3", "Y": "1", "Z": "1e-3", "XUnit": "zm", "YUnit": "am", "ZUnit": "fm"}, (1e3, 1e3, 1e3)),
        ({"X": "2", "Y": "3", "Z": "4", "XUnit": "pixel", "YUnit": "pixel", "ZUnit": "pixel"}, (2, 3, 4)),
        ({"Y": "2", "Z": "1", "YUnit": "nm", "ZUnit": "µm"}, (1, 2, 1000)),  # in the unit of the first that is said
    ],
)
def test_ome_units(tmp_path, sizes, expected):
    (tmp_path / "a.tif").write_bytes(tiff_bytes(ramp("uint16"), description=ome_sizes(**sizes)))
    np.testing.assert_allclose(read(tmp_path / "a.tif").spacing, expected, rtol=1e-8)


def test_an_ome_unit_in_latin_1(tmp_path):
    description = ome_sizes(X="0.1", Y="0.1", Z="500", XUnit="µm", YUnit="µm", ZUnit="nm")
    utf_8 = tiff_bytes(ramp("uint16"), description=description)
    (tmp_path / "a.tif").write_bytes(utf_8.replace("µ".encode() + b'm" ', b'\xb5m"  '))  # as long
    np.testing.assert_array_equal(read(tmp_path / "a.tif").spacing, [0.1, 0.1, 0.5])


@pytest.mark.parametrize("unit", ["pixel", "reference frame", "furlong"])
def test_ome_units_that_cannot_be_compared(tmp_path, unit):
    sizes = ome_sizes(X="0.1", Y="0.2", Z="3", ZUnit=unit)
    (tmp_path / "a.tif").write_bytes(tiff_bytes(ramp("uint16"), description=sizes))
    got = f"PhysicalSizeX=0.1 \u03bcm, PhysicalSizeY=0.2 \u03bcm, PhysicalSizeZ=3 {unit}"
    assert_sizes_cannot_be_compared(tmp_path / "a.tif", got, "units of length such as nm, µm and mm")


def test_an_ome_size_beyond_all_numbers(tmp_path):
    sizes = ome_sizes(X="1", Y="1", Z="1e300", XUnit="ym", YUnit="ym", ZUnit="Ym")
    (tmp_path / "a.tif").write_bytes(tiff_bytes(ramp("uint16"), description=sizes))
    refused(tmp_path / "a.tif", match="the spacing, origin and direction give the voxels no volume")


@pytest.mark.parametrize(
    ("order", "description"),
    [
        ("TZC", "ImageJ=1.53\nimages=24\nchannels=2\nslices=4\nframes=3\nhyperstack=true\n"),
        ("TCZ", '<OME><Pixels DimensionOrder="XYZCT" SizeX="5" SizeY="4" SizeZ="4" SizeC="2" SizeT="3"/></OME>'),
        ("CTZ", '<OME><Pixels DimensionOrder="XYZTC" SizeX="5" SizeY="4" SizeZ="4" SizeC="2" SizeT="3"/></OME>'),
        ("ZCT", '<OME><Pixels DimensionOrder="XYTCZ" SizeX="5" SizeY="4" SizeZ="4" SizeC="2" SizeT="3"/></OME>'),
    ],
)
def test_hyperstacks(tmp_path, order, description):
    stack = ramp("uint16", (3, 4, 2, 4, 5))  # t, z, c, y, x
    pages = np.moveaxis(stack, [0, 1, 2], [order.index(axis) for axis in "TZC"]).reshape(24, 4, 5)
    (tmp_path / "a.tif").write_bytes(tiff_bytes(pages, description=description))
    for time in range(3):
        for component in range(2):
            volume = read(tmp_path / "a.tif", time=time, component=component)
            np.testing.assert_array_equal(volume.values, stack[time, :, component])
    ones = (1.0, 1.0, 1.0)
    first = read(tmp_path / "a.tif", ones, component=0)
    np.testing.assert_array_equal(first.values, stack[0, :, 0])
    assert first.note == "3 times; the first is drawn; `time: k` chooses another"
    second = read(tmp_path / "a.tif", ones, time=1)
    np.testing.assert_array_equal(second.values, stack[1, :, 0])
    assert second.note == "2 components; the first is drawn; `component: k` chooses another"
    both = "3 times; the first is drawn; `time: k` chooses another"
    assert read(tmp_path / "a.tif", ones).note == f"{both}; {second.note}"


# Tiles

TILE = 32, 16  # rows, columns; TIFF asks for multiples of 16
TILED = np.random.default_rng(0).integers(0, 2000, (3, 45, 40))


@pytest.mark.parametrize(
    ("dtype", "order"), [("uint8", "<"), ("int16", ">"), ("uint32", "<"), ("float16", ">"), ("float64", "<")]
)
def test_tiles(tmp_path, dtype, order):
    values = TILED.astype(dtype)
    volume = read(written(tmp_path / "a.tif", tiff_bytes(values, order, tile=TILE)))
    assert volume.values.dtype == np.dtype(dtype)
    np.testing.assert_array_equal(volume.values, values)


COUNTS = struct.pack("<6H", *[1024] * 6)


@pytest.mark.parametrize(
    "changes",
    [
        [struct.pack("<2HI", *field) for field in ((324, 4, 6), (324, 4, 5), (325, 3, 6), (325, 3, 5))],
        [COUNTS, struct.pack("<H", 1023) + COUNTS[2:]],
        [struct.pack("<2H2I", 322, 4, 1, 16), struct.pack("<2H2I", 322, 4, 1, 0)],
    ],
    ids=["left out", "short", "no width"],
)
def test_tiles_that_do_not_make_up_the_pages(tmp_path, changes):
    data = tiff_bytes(TILED.astype(np.uint16), tile=TILE)
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        assert data.count(old) == 3
        data = data.replace(old, new)
    refused(written(tmp_path / "a.tif", data))


@pytest.mark.parametrize(("code", "is_refused"), [(65000, False), (34665, False), (32997, True), (339, True)])
def test_only_private_fields_may_be_damaged(tmp_path, code, is_refused):
    (tmp_path / "a.tif").write_bytes(tiff({code: (LONG, 1000, 10**8)}))
    if is_refused:
        refused(tmp_path / "a.tif", match="its directories are damaged")
    else:
        np.testing.assert_array_equal(read(tmp_path / "a.tif").values[0], PIXELS)


def test_integers_of_24_bits_are_refused(tmp_path):
    """tifffile takes their bytes in another order than the file's."""
    (tmp_path / "a.tif").write_bytes(tiff({WIDTH: (SHORT, 1, 5), HEIGHT: (SHORT, 1, 1), BITS: (SHORT, 1, 24)}))
    refused(tmp_path / "a.tif", match="24 bits")
