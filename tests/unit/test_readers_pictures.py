"""Folders of PNG, JPEG and BMP slices, which Pillow wrote; and pictures that are no slices."""

from __future__ import annotations

from pathlib import Path

import imagecodecs
import numpy as np
import pytest
from PIL import Image, ImageOps
from stated_pictures import write_deep_pictures, write_pictures
from volume_files import ramp, read, refused, written

from renderer.job import volume_files
from renderer.scene import FileSource, VolumeSpec

pytestmark = pytest.mark.usefixtures("one_process")

VALUES = ramp("uint8", (12, 6, 5))


def slices(folder, values=VALUES, ending="png", mode=None):
    folder.mkdir(exist_ok=True)
    for k, plane in enumerate(values):
        picture = Image.fromarray(plane)
        (picture if mode is None else picture.convert(mode)).save(folder / f"s{k}.{ending}")
    return folder


@pytest.mark.parametrize(("ending", "dtype"), [("png", "uint8"), ("bmp", "uint8"), ("PNG", "uint16")])
def test_slices_in_child(tmp_path, ending, dtype):
    values = ramp(dtype, (12, 6, 5))
    volume = read(slices(tmp_path / "in", values, ending))
    np.testing.assert_array_equal(volume.values, values)
    assert volume.values.dtype == dtype
    assert volume.note == "the file does not give its voxel size; 1 x 1 x 1 is assumed"


def test_jpeg(tmp_path):
    values = np.full((3, 16, 16), [[[40]], [[80]], [[200]]], np.uint8)  # even pictures are exact
    np.testing.assert_array_equal(read(slices(tmp_path / "in", values, "jpg")).values, values)


def test_colours_are_components(tmp_path):
    values = np.stack([VALUES, VALUES // 2, VALUES // 3], axis=-1)
    folder = slices(tmp_path / "in", values)
    assert "3 components (R, G, B); the first is drawn" in read(folder).note
    np.testing.assert_array_equal(read(folder, component=2).values, VALUES // 3)
    refused(folder, match="there is no such component", component=3)
    np.testing.assert_array_equal(read(slices(folder, VALUES % 7 * 30, mode="P")).values, VALUES % 7 * 30)
    np.testing.assert_array_equal(read(slices(folder, VALUES > 100)).values > 0, VALUES > 100)


def test_slices_that_are_no_stack(tmp_path):
    folder = slices(tmp_path / "in")
    Image.fromarray(VALUES[0].T).save(folder / "s3.png")
    refused(folder, match="the slices of this folder differ")
    (folder / "s3.png").unlink()
    refused(folder, match="slices of this folder are missing")
    slices(folder)
    slices(folder, VALUES[:2], "bmp")
    refused(folder, match="named in several ways")


def test_pictures_that_show_a_volume_are_not_one(tmp_path):
    folder = slices(tmp_path / "in")
    np.save(folder / "a.npy", VALUES + 1)
    slices(folder / "frames")
    np.testing.assert_array_equal(read(folder).values, VALUES + 1)
    (folder / "a.npy").rename(folder / "frames" / "a.npy")
    np.testing.assert_array_equal(read(folder).values, VALUES + 1)
    refused(folder / "s0.png", match="this is a picture, which is not read")


def test_a_folder_in_a_folder(tmp_path):
    inner = slices(tmp_path / "in" if (tmp_path / "in").mkdir() else tmp_path / "in" / "stack")
    np.testing.assert_array_equal(read(tmp_path / "in").values, VALUES)
    found = {Path(path).name for path in volume_files(VolumeSpec(FileSource(tmp_path / "in")))}
    assert {each.name for each in inner.iterdir()} <= found


@pytest.mark.parametrize("number", range(1, 9))
def test_pictures_are_turned_as_exif_says(tmp_path, number):
    write_pictures(tmp_path / "in", VALUES[:2], orientation=number)
    with Image.open(tmp_path / "in/s1.png") as picture:
        expected = np.asarray(ImageOps.exif_transpose(picture))
    volume = read(tmp_path / "in")
    found = np.zeros(expected.shape)
    for (row, column), value in np.ndenumerate(volume.values[1]):
        x, y, _, _ = volume.world_from_index @ (column, row, 1, 1)
        found[int(y), int(x)] = value
    np.testing.assert_array_equal(found, expected)


def test_the_size_of_pixels(tmp_path):
    volume = read(write_pictures(tmp_path / "in", VALUES, dpi=(254, 508)))
    np.testing.assert_allclose(volume.spacing, [0.1, 0.05, 0.1], rtol=1e-3)
    assert volume.length_unit == "mm" and "along z; that along x is assumed" in str(volume.note)
    assert read(write_pictures(tmp_path / "in", VALUES, dpi=(72, 72))).spacing.tolist() == [1, 1, 1]


def test_colours_of_16_bits_lose_half_of_them(tmp_path):
    volume = read(write_deep_pictures(tmp_path / "in", depth=16))
    assert volume.values.dtype == np.uint8 and "16 bits (colours of 16 bits, read with 8" in str(volume.note)
    assert "16 bits" not in str(read(write_deep_pictures(tmp_path / "in", depth=8)).note)


def test_pictures_that_are_whole_are_not_called_damaged(tmp_path):
    (tmp_path / "in").mkdir()
    jpeg = imagecodecs.jpeg_encode(np.zeros((8, 8), np.uint16), bitspersample=12)
    for data, what in ((jpeg, "JPEG of 12 bits is not read"), (b"RIFF\0\0\0\0WEBP", "not a picture of the format")):
        for k in range(3):
            written(tmp_path / f"in/s{k}.jpg", data)
        assert "damaged" not in str(refused(tmp_path / "in", match=what))


def test_pictures_of_claims_and_damaged_ones(tmp_path):
    folder = slices(tmp_path / "in")
    data = (folder / "s0.png").read_bytes()
    for k in range(12):
        written(folder / f"s{k}.png", data[:16] + (60_000).to_bytes(4, "big") * 2 + data[24:])
    refused(folder, match="cannot be decoded|fewer bytes than its pixels need")
    slices(folder)
    written(folder / "s7.png", (folder / "s7.png").read_bytes()[:50])
    assert refused(folder, match="decoded").where == str(folder / "s7.png")
