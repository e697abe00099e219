"""Kinds of TIFF that cameras, scanners and microscopes write: compressed, tiled, pyramids, OME, masks, large stacks."""

from __future__ import annotations

import itertools
import struct

import numpy as np
import pytest
import tifffile
from tiff_files import HEIGHT, LONG, PAGE, STRIP_BYTES, STRIPS, WIDTH, directory, tiff, tiff_bytes
from volume_files import ramp, read, refused, written

pytestmark = pytest.mark.usefixtures("one_process")

ROWS_PER_STRIP = 278
VALUES = np.random.default_rng(0).integers(0, 50, (3, 45, 40)).cumsum(axis=2).astype(np.uint16)


LAYOUTS = ({}, {"tile": (32, 16)}, {"rowsperstrip": 7}, {"predictor": True})


@pytest.mark.parametrize(
    ("compression", "layout"),
    [
        *itertools.product(("zlib", "lzw", "zstd", "lzma"), LAYOUTS),
        *(("packbits", layout) for layout in LAYOUTS[:-1]),  # no program writes it with a predictor
    ],
)
def test_compressions_without_loss(tmp_path, compression, layout):
    tifffile.imwrite(
        tmp_path / "a.tif", VALUES, compression=compression, photometric="minisblack", metadata=None, **layout
    )
    np.testing.assert_array_equal(read(tmp_path / "a.tif").values, VALUES)


def test_jpeg(tmp_path):
    smooth = np.linspace(0, 255, 64 * 64).reshape(1, 64, 64).astype(np.uint8)
    tifffile.imwrite(tmp_path / "a.tif", smooth, compression="jpeg", photometric="minisblack", tile=(32, 32))
    values = read(tmp_path / "a.tif").values
    assert np.abs(values.astype(int) - smooth).max() <= 4  # of JPEG itself at this quality


@pytest.mark.parametrize("compression", [None, "zlib", "lzw"])
def test_values_are_stored_ones_where_white_is_0(tmp_path, compression):
    tifffile.imwrite(tmp_path / "a.tif", VALUES, compression=compression, photometric="miniswhite", metadata=None)
    np.testing.assert_array_equal(read(tmp_path / "a.tif").values, VALUES)


def test_indices_of_a_palette_are_values(tmp_path):
    labels = (VALUES % 7).astype(np.uint8)
    colours = np.zeros((3, 256), np.uint16)
    tifffile.imwrite(tmp_path / "a.tif", labels, photometric="palette", colormap=colours, metadata=None)
    np.testing.assert_array_equal(read(tmp_path / "a.tif").values, labels)


def test_masks_of_single_bits(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", VALUES % 3 == 0, photometric="minisblack", metadata=None)
    np.testing.assert_array_equal(read(tmp_path / "a.tif").values, (VALUES % 3 == 0).astype(np.uint8))


@pytest.mark.parametrize("planarconfig", ["contig", "separate"])
def test_colours_are_components(tmp_path, planarconfig):
    colours = np.stack([VALUES, VALUES + 1, VALUES + 2], axis=-1 if planarconfig == "contig" else 1)
    tifffile.imwrite(tmp_path / "a.tif", colours, photometric="rgb", planarconfig=planarconfig, metadata=None)
    for component in range(3):
        np.testing.assert_array_equal(read(tmp_path / "a.tif", component=component).values, VALUES + component)


@pytest.mark.parametrize("subifds", [0, 2])
def test_pyramids_have_full_resolution(tmp_path, subifds):
    """Smaller levels are pages below each page, or pages after it that are marked as reduced."""
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        for plane in VALUES:
            options = {"tile": (16, 16), "photometric": "minisblack", "compression": "zlib", "metadata": None}
            file.write(plane, subifds=subifds or None, **options)
            for step in (2, 4):
                file.write(plane[::step, ::step], subfiletype=1, **options)
    volume = read(tmp_path / "a.tif", (1.0, 1.0, 1.0))
    np.testing.assert_array_equal(volume.values, VALUES)
    assert volume.note == (None if subifds else "6 smaller previews among the pages are left out")


def test_planes_that_are_no_pages_are_refused(tmp_path):
    """Reading the first one alone would be a wrong picture."""
    plain = {"photometric": "minisblack"}
    tifffile.imwrite(tmp_path / "0.tif", np.zeros((16, 32, 32), np.uint8), volumetric=True, tile=(16, 16, 16), **plain)
    tifffile.imwrite(tmp_path / "1.tif", VALUES, truncate=True, **plain)
    np.testing.assert_array_equal(read(tmp_path / "1.tif").values, VALUES)
    refused(written(tmp_path / "1.tif", (tmp_path / "1.tif").read_bytes()[:-1]), match="does not fit its pages")
    of_metamorph = [(33628, "I", 3, (0,) * 3, True), (33629, "I", 18, (0,) * 18, True)]
    tifffile.imwrite(tmp_path / "2.tif", VALUES, truncate=True, metadata=None, extratags=of_metamorph, **plain)
    for k in (0, 2):
        refused(tmp_path / f"{k}.tif", match="several planes in a page, or planes without one")


@pytest.mark.parametrize(("num_strips", "num_pages"), [(4, 1), (1, 4)])
def test_strips_that_share_their_bytes_are_refused(tmp_path, num_strips, num_pages):
    """A small file could stand for any number of voxels."""
    side, begin = 64, 100
    places = struct.pack("<8I", *[begin] * 4, *[side**2] * 4)
    fields = {WIDTH: (LONG, 1, side), HEIGHT: (LONG, 1, side * num_strips), ROWS_PER_STRIP: (LONG, 1, side)}
    fields |= {
        STRIPS: (LONG, num_strips, 24 if num_strips > 1 else begin),
        STRIP_BYTES: (LONG, num_strips, 40 if num_strips > 1 else side**2),
    }
    data = tiff(fields, places.ljust(begin - 24, b"\0") + bytes(side**2))
    for _ in range(1, num_pages):
        data = data[:-4] + struct.pack("<I", len(data)) + directory(PAGE | fields)
    refused(written(tmp_path / "a.tif", data), match="share their bytes")


def test_colours_of_several_channels_of_ome_are_all_components(tmp_path):
    colours = ramp("uint16", (2, 4, 5, 6, 3))  # channel, z, y, x, sample
    tifffile.imwrite(tmp_path / "a.ome.tif", colours, photometric="rgb", metadata={"axes": "CZYXS"})
    for k in range(6):
        np.testing.assert_array_equal(read(tmp_path / "a.ome.tif", component=k).values, colours[k // 3, ..., k % 3])
    volume = read(tmp_path / "a.ome.tif", (1.0, 1.0, 1.0))
    assert volume.note == "6 components; the first is drawn; `component: k` chooses another"


STACK = ramp("uint16", (2, 3, 4, 5, 6))  # time, channel, z, y, x


OME = (
    "<OME><Image><Pixels DimensionOrder='XYZCT' SizeX='6' SizeY='5' SizeZ='4' SizeC='3' SizeT='2' PhysicalSizeX='0.5' "
    "PhysicalSizeXUnit='nm'>{}</Pixels></Image></OME>"
)


@pytest.mark.parametrize("is_reversed", [False, True])
def test_ome_planes_may_be_on_any_page(tmp_path, is_reversed):
    """Attributes may be in single quotes."""
    pages = STACK.reshape(24, 5, 6)
    order = np.arange(24)[::-1] if is_reversed else np.arange(24)
    places = "".join(
        f"<TiffData IFD='{order[(t * 3 + c) * 4 + z]}' FirstT='{t}' FirstC='{c}' FirstZ='{z}' PlaneCount='1'/>"
        for t, c, z in np.ndindex(2, 3, 4)
    )
    (tmp_path / "a.tif").write_bytes(tiff_bytes(pages[order], description=OME.format(places)))
    volume = read(tmp_path / "a.tif", time=1, component=2)
    np.testing.assert_array_equal(volume.values, STACK[1, 2])
    assert volume.spacing[0] == 0.5


@pytest.mark.parametrize("places", ["<TiffData IFD='3'/>", "<TiffData IFD='24'/>", "<TiffData IFD='0' FirstZ='1'/>"])
def test_ome_planes_without_a_page_are_refused(tmp_path, places):
    (tmp_path / "a.tif").write_bytes(tiff_bytes(STACK.reshape(24, 5, 6), description=OME.format(places)))
    refused(tmp_path / "a.tif", time=0, component=0, match="does not give each plane a page")


@pytest.mark.parametrize("order", ["<", ">"])
def test_large_stacks_of_imagej_have_one_page(tmp_path, order):
    """Beyond 4 GB ImageJ writes one page, and all planes behind its pixels."""
    values = ramp("int16", (7, 4, 5))
    data = tiff_bytes(values[:1], order, description="ImageJ=1.53\nimages=7\nslices=7\n")
    strips = struct.pack(f"{order}HHI", 273, 4, 1)
    assert data.count(strips) == 1
    place = data.index(strips) + len(strips)
    planes = values.astype(values.dtype.newbyteorder(order)).tobytes()
    data = data[:place] + struct.pack(f"{order}I", len(data)) + data[place + 4 :] + planes
    np.testing.assert_array_equal(read(written(tmp_path / "a.tif", data)).values, values)
    refused(written(tmp_path / "a.tif", data[:-1]), match="does not fit its pages")


def test_missing_codecs_are_named(tmp_path, monkeypatch):
    tifffile.imwrite(tmp_path / "a.tif", VALUES, compression="lzw", photometric="minisblack", metadata=None)
    monkeypatch.setattr("renderer.errors.importlib.util.find_spec", lambda _: None)

    def fail(*_args: object, **_options: object) -> None:
        raise ValueError("<COMPRESSION.LZW: 5> requires the 'imagecodecs' package")

    monkeypatch.setattr(tifffile.TiffPage, "asarray", fail)
    error = refused(tmp_path / "a.tif")
    hint = "hint: pip install 'hsplat[tiff]'"
    assert str(error) == f"{tmp_path / 'a.tif'}: the package imagecodecs is not installed\n  {hint}"
