"""MRC and CCP4 maps, whose headers are made by hand: axes, modes, places, cells, stacks, and byte orders."""

from __future__ import annotations

import gzip
import struct

import numpy as np
import pytest
from volume_files import ramp, read, refused, written

IMOD = 1146047817


def mrc(values, order="<", *, mode=2, grid=None, cell=None, angles=(90, 90, 90), axes=(1, 2, 3), **more):
    """Return the bytes of a file. more: NSTART, origin, space group, extension, mark, and IMOD's flags."""
    sizes = values.shape[::-1]
    extension = more.get("extension", b"")
    header = bytearray(1024)
    cell = sizes if cell is None else cell
    numbers = (*sizes, mode, *more.get("start", (0, 0, 0)), *(grid or sizes))
    struct.pack_into(f"{order}10i6f3i", header, 0, *numbers, *cell, *angles, *axes)
    struct.pack_into(f"{order}f", header, 80, more.get("largest", 0))
    struct.pack_into(f"{order}2i", header, 88, more.get("group", 1), len(extension))
    struct.pack_into(f"{order}2i", header, 152, *more.get("imod", (0, 0)))
    struct.pack_into(f"{order}3f", header, 196, *more.get("origin", (0, 0, 0)))
    header[208:216] = more.get("mark", b"MAP " + (b"\x44\x44\0\0" if order == "<" else b"\x11\x11\0\0"))
    return bytes(header) + extension + values.astype(values.dtype.newbyteorder(order)).tobytes()


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("mode", "dtype"), [(0, "i1"), (1, "i2"), (2, "f4"), (6, "u2"), (12, "f2")])
def test_modes_and_byte_orders(tmp_path, order, mode, dtype):
    values = ramp(dtype)
    volume = read(written(tmp_path / "a.bin", mrc(values, order, mode=mode, extension=b"x" * 160)))
    np.testing.assert_array_equal(volume.values, values)
    assert volume.values.dtype == values.dtype and volume.note is None


def test_bytes_of_imod_have_no_sign_unless_a_flag_says_so(tmp_path):
    values = ramp("uint8")
    path = written(tmp_path / "a.mrc", mrc(values, mode=0, imod=(IMOD, 16)))
    np.testing.assert_array_equal(read(path).values, values)
    written(path, mrc(values, mode=0, imod=(IMOD, 17)))
    np.testing.assert_array_equal(read(path).values, values.view(np.int8))


@pytest.mark.parametrize("order", ["<", ">"])
def test_bytes_of_older_files_have_no_sign_if_the_largest_needs_none(tmp_path, order):
    """Byte order and sign are not marked, and the mode is 0 in either order."""
    values = ramp("uint8")
    path = written(tmp_path / "a.mrc", mrc(values, order, mode=0, largest=255, mark=bytes(8)))
    np.testing.assert_array_equal(read(path).values, values)
    wrong = mrc(values, order, mode=0, largest=127, mark=b"MAP " + (b"\x11\x11" if order == "<" else b"\x44\x44") * 2)
    np.testing.assert_array_equal(read(written(path, wrong)).values, values.view(np.int8))


@pytest.mark.parametrize("name", ["a.mrc", "a.mrc.gz"])
@pytest.mark.parametrize("axes", [(1, 2, 3), (3, 2, 1), (2, 3, 1), (3, 1, 2)])
def test_axes_lie_in_the_world(tmp_path, name, axes):
    """Columns, rows and sections each step along their own axis of the cell, from NSTART on."""
    values = ramp("float32")
    spacing = {1: 2.0, 2: 3.0, 3: 5.0}
    grid = (10, 20, 30)
    cell = [grid[k - 1] * spacing[k] for k in (1, 2, 3)]
    data = mrc(values, axes=axes, grid=grid, cell=cell, start=(7, 8, 9))
    volume = read(written(tmp_path / name, gzip.compress(data) if name.endswith("gz") else data))
    np.testing.assert_array_equal(volume.values, values)
    at = volume.world_from_index @ [4, 3, 2, 1]
    for axis, index in zip(axes, (7 + 4, 8 + 3, 9 + 2), strict=True):
        assert at[axis - 1] == pytest.approx(index * spacing[axis])


def test_the_origin_comes_before_the_start(tmp_path):
    path = written(tmp_path / "a.map", mrc(ramp("float32"), start=(7, 8, 9), origin=(1, -2, 3.5)))
    np.testing.assert_array_equal(read(path).world_from_index[:3, 3], [1, -2, 3.5])
    no_mark = mrc(ramp("float32"), start=(7, 8, 9), origin=(1, -2, 3.5), mark=bytes(8))
    np.testing.assert_array_equal(read(written(path, no_mark)).world_from_index[:3, 3], [7, 8, 9])


def test_cells_of_other_angles(tmp_path):
    """Lengths and angles between the axes are those of the header."""
    path = written(tmp_path / "a.ccp4", mrc(ramp("float32"), cell=(10, 8, 9), angles=(80, 95, 120)))
    axes = read(path).world_from_index[:3, :3]
    a, b, c = axes.T
    np.testing.assert_allclose(np.linalg.norm(axes, axis=0), [10 / 5, 8 / 4, 9 / 3], rtol=1e-6)
    for one, other, angle in ((b, c, 80), (c, a, 95), (a, b, 120)):
        cosine = one @ other / np.linalg.norm(one) / np.linalg.norm(other)
        assert np.degrees(np.arccos(cosine)) == pytest.approx(angle, abs=1e-4)
    assert a[1] == a[2] == b[2] == 0 < np.linalg.det(axes)
    refused(written(path, mrc(ramp("float32"), angles=(10, 10, 170))), match="give the voxels no volume")


def test_volume_stacks_are_times(tmp_path):
    values = ramp("int16", (6, 4, 5))
    path = written(tmp_path / "a.mrcs", mrc(values, mode=1, grid=(5, 4, 2), group=401))
    assert read(path).note == "3 times; the first is drawn; `time: k` chooses another"
    np.testing.assert_array_equal(read(path, time=2).values, values[4:])
    written(path, mrc(values, mode=1, grid=(5, 4, 1), group=0))  # a stack of images
    np.testing.assert_array_equal(read(path).values, values)


@pytest.mark.parametrize(("space_group", "depth", "are_images"), [(0, 1, True), (1, 1, False), (0, 3, False)])
def test_images_are_no_slices(tmp_path, space_group, depth, are_images):
    """MRC2014: a stack of images has the space group 0 and mz 1; a volume has its number of sections as mz."""
    grid = (5, 4, depth)
    (tmp_path / "a.mrcs").write_bytes(mrc(np.zeros((3, 4, 5), np.float32), grid=grid, cell=grid, group=space_group))
    assert ("separate images" in str(read(tmp_path / "a.mrcs").note)) == are_images


def test_a_file_without_a_cell_has_no_spacing(tmp_path):
    volume = read(written(tmp_path / "a.rec", mrc(ramp("float32"), cell=(0, 0, 0), mark=bytes(8))))
    assert "does not give its voxel size" in volume.note
    np.testing.assert_array_equal(volume.spacing, [1, 1, 1])


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"mode": 4}, "mode 4, complex floats"),
        ({"mode": 101}, "integers of four bits"),
        ({"mode": 99}, "mode 99, of no known type"),
        ({"axes": (1, 1, 3)}, "this is not an MRC file, or it is damaged"),
    ],
)
def test_what_cannot_be_read_is_refused(tmp_path, change, match):
    refused(written(tmp_path / "a.mrc", mrc(ramp("float32"), **change)), match=match)
    refused(written(tmp_path / "a.mrc", mrc(ramp("float32"))[:-3]), match="shorter than its header says")
