"""Folders of PNG, JPEG and BMP slices, which Pillow wrote; and pictures that are no slices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from renderer.job import volume_files
from renderer.scene import FileSource, VolumeSpec
from tests.support.volume_files import ramp, read, refused, written

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


def test_pictures_of_claims_and_damaged_ones(tmp_path):
    folder = slices(tmp_path / "in")
    data = (folder / "s0.png").read_bytes()
    for k in range(12):
        written(folder / f"s{k}.png", data[:16] + (60_000).to_bytes(4, "big") * 2 + data[24:])
    refused(folder, match="cannot be decoded|fewer bytes than its pixels need")
    slices(folder)
    written(folder / "s7.png", (folder / "s7.png").read_bytes()[:50])
    assert refused(folder, match="decoded").where == str(folder / "s7.png")
