"""DICOM files that say nothing of lengths, low values that are light, files that are no slices, and slices alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
from click.testing import CliRunner

from hsplat_cli.commands.info import info
from renderer.errors import InputError
from tests.support.dicom_files import write_slice
from tests.support.volume_files import read

VALUES = np.arange(60).reshape(3, 4, 5) * 30 - 1000
PIXEL_SPACING = b"\x28\x00\x30\x00\x06\x00\x00\x00.25\\.5"
OTHER_FIELD = b"\x28\x00\x31\x00\x06\x00\x00\x00.25\\.5"


def write(folder: Path, intercept: int = 0) -> None:
    """Write a slice in `k.dcm` for each of VALUES, 2 apart."""
    for k, plane in enumerate(VALUES):
        write_slice(folder / f"{k}.dcm", plane, (0, 0, 2 * k), axes=(1, 0, 0, 0, 1, 0), intercept=intercept)


def change(path: Path, old: bytes, new: bytes) -> None:
    data = path.read_bytes()
    assert data.count(old) == 1
    path.write_bytes(data.replace(old, new))


@pytest.mark.parametrize("intercept", [0, 24, -1024])
def test_low_values_that_are_light(tmp_path: Path, intercept: int) -> None:
    """Hounsfield units are what slope and intercept make of the stored values, however these are to be shown."""
    write(tmp_path, intercept)
    for path in tmp_path.iterdir():
        change(path, b"MONOCHROME2 ", b"MONOCHROME1 ")
    np.testing.assert_array_equal(read(tmp_path).values, VALUES)
    np.testing.assert_array_equal(read(tmp_path / "1.dcm").values, VALUES[1:2])


@pytest.mark.parametrize(
    ("field", "got"),
    [
        (OTHER_FIELD, "no PixelSpacing"),
        (PIXEL_SPACING.replace(b".25", b"  0"), "PixelSpacing = 0\\.5"),
        (PIXEL_SPACING.replace(b".25", b"-.2"), "PixelSpacing = -.2\\.5"),
        (PIXEL_SPACING.replace(b".25", b"nan"), "PixelSpacing = nan\\.5"),
        (PIXEL_SPACING.replace(b".25\\.5", b".25   "), "PixelSpacing = .25"),
    ],
)
def test_missing_lengths(tmp_path: Path, field: bytes, got: str) -> None:
    write(tmp_path)
    for path in tmp_path.iterdir():
        change(path, PIXEL_SPACING, field)
    for name in (tmp_path, tmp_path / "0.dcm"):
        with pytest.raises(InputError) as error:
            read(name)
        assert str(error.value) == (
            f"{tmp_path / '0.dcm'}: this DICOM file does not give its voxel size\n"
            f"  got: {got}\n"
            "  expected: PixelSpacing of two positive numbers, and of several frames how far apart they are\n"
            "  hint: `spacing: [x, y, z]` replaces the spacing in the file"
        )
        volume = read(name, (0.5, 0.25, 2))
        np.testing.assert_array_equal(volume.spacing, [0.5, 0.25, 2])
        np.testing.assert_array_equal(volume.values, VALUES if name == tmp_path else VALUES[:1])


def test_lengths_in_another_field(tmp_path: Path) -> None:
    """ImagerPixelSpacing, which is that of an X-ray image, comes where no PixelSpacing has to be."""
    image = sitk.GetImageFromArray(VALUES[0].astype(np.uint16))
    image.SetSpacing((0.5, 0.25))
    image.SetMetaData("0008|0016", "1.2.840.10008.5.1.4.1.1.1")  # computed radiography
    image.SetMetaData("0008|0060", "CR")
    image.SetMetaData("0018|1164", "0.25\\0.5")
    sitk.WriteImage(image, str(tmp_path / "a.dcm"))
    np.testing.assert_array_equal(read(tmp_path / "a.dcm").spacing[:2], [0.5, 0.25])


def test_functional_groups_give_the_lengths_of_frames(tmp_path: Path) -> None:
    image = sitk.GetImageFromArray(VALUES.astype(np.int16))
    image.SetSpacing((0.5, 0.25, 7.0))
    image.SetMetaData("0008|0060", "MR")
    sitk.WriteImage(image, str(tmp_path / "a.dcm"))
    np.testing.assert_array_equal(read(tmp_path / "a.dcm").spacing, [0.5, 0.25, 7])
    change(tmp_path / "a.dcm", b"\x28\x00\x10\x91", b"\x28\x00\x11\x91")
    with pytest.raises(InputError, match="does not give its voxel size"):
        read(tmp_path / "a.dcm")


def test_frames_need_a_distance(tmp_path: Path) -> None:
    write(tmp_path)
    data = (tmp_path / "0.dcm").read_bytes()
    begin, pixels = data.index(b"\xe0\x7f\x10\x00"), VALUES.astype("<i2").tobytes()
    data = data[:begin] + b"\xe0\x7f\x10\x00" + len(pixels).to_bytes(4, "little") + pixels
    data = data.replace(b"\x18\x00\x88\x00\x02\x00\x00\x001 ", b"")  # which SimpleITK sometimes writes
    rows, orientation = b"\x28\x00\x10\x00", b"\x20\x00\x0d\x00"
    data = data.replace(rows, b"\x28\x00\x08\x00\x02\x00\x00\x003 " + rows, 1)  # the number of frames
    (tmp_path / "frames.dcm").write_bytes(data)
    with pytest.raises(InputError, match="does not give its voxel size") as error:
        read(tmp_path / "frames.dcm")
    assert error.value.got == "3 frames without SpacingBetweenSlices or functional groups"
    np.testing.assert_array_equal(read(tmp_path / "frames.dcm", (0.5, 0.25, 7)).spacing, [0.5, 0.25, 7])
    between = b"\x18\x00\x88\x00\x02\x00\x00\x007 "
    (tmp_path / "frames.dcm").write_bytes(data.replace(orientation, between + orientation, 1))
    np.testing.assert_array_equal(read(tmp_path / "frames.dcm").spacing, [0.5, 0.25, 7])
    np.testing.assert_array_equal(read(tmp_path / "frames.dcm").values, VALUES)


@pytest.mark.parametrize(("data", "got"), [(b"", "an empty file"), (b"no slice", "a file that is not DICOM")])
def test_files_that_were_slices(tmp_path: Path, data: bytes, got: str) -> None:
    write(tmp_path)
    (tmp_path / "README.txt").write_bytes(data)
    (tmp_path / "._1.dcm").write_bytes(data)
    np.testing.assert_array_equal(read(tmp_path).values, VALUES)
    (tmp_path / "1.dcm").write_bytes(data)
    with pytest.raises(InputError) as error:
        read(tmp_path)
    assert str(error.value) == (
        f"{tmp_path / '1.dcm'}: this DICOM slice cannot be read\n"
        f"  got: {got}\n"
        "  hint: the file is truncated or damaged: copy it again, or remove it if it is no slice"
    )


def test_one_slice_of_a_series(tmp_path: Path) -> None:
    write(tmp_path)
    note = f"one of 3 slices of a DICOM series; its folder, {tmp_path}, stands for all of them"
    assert read(tmp_path / "1.dcm").note == note
    assert read(tmp_path).note is None
    told = CliRunner().invoke(info, [str(tmp_path / "1.dcm")])
    assert told.exit_code == 0, told.output
    assert told.stderr == f"{tmp_path / '1.dcm'}: {note}\n"
    other = (tmp_path / "1.dcm").read_bytes().replace(b"1.2.3.4\0", b"1.2.\xff.4\0")
    (tmp_path / "other.dcm").write_bytes(other)  # whose series has no name
    assert b"\xff.4" in other
    assert read(tmp_path / "other.dcm").note is None
    for name in ("0.dcm", "2.dcm", "other.dcm"):
        (tmp_path / name).unlink()
    assert read(tmp_path / "1.dcm").note is None
    assert read(tmp_path).note is None


def test_fields_of_dicom_in_another_format(tmp_path: Path) -> None:
    """SimpleITK copies them where it saves what it read as DICOM, and what was done in between is not in them."""
    write(tmp_path)
    image = sitk.GetImageFromArray(VALUES[:1].astype(np.int16))
    image.SetSpacing((3.0, 4.0, 5.0))
    for key, text in {"0028|0004": "MONOCHROME1", "0028|0030": "0\\0", "0020|000e": "1.2.3.4"}.items():
        image.SetMetaData(key, text)
    sitk.WriteImage(image, str(tmp_path / "a.nrrd"))
    volume = read(tmp_path / "a.nrrd")
    np.testing.assert_array_equal(volume.values, VALUES[:1])
    assert (volume.spacing.tolist(), volume.note) == ([3, 4, 5], None)


def test_a_field_at_which_the_search_for_series_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path)
    (tmp_path / "1.dcm").write_bytes((tmp_path / "1.dcm").read_bytes()[:140])

    def fail(_folder: str) -> None:
        raise RuntimeError("ITK ERROR: GDCMSeriesFileNames(0x1): GetVR().Compatible( de.GetVR() )")

    monkeypatch.setattr(sitk.ImageSeriesReader, "GetGDCMSeriesIDs", fail)
    with pytest.raises(InputError) as error:
        read(tmp_path)
    assert str(error.value) == (
        f"{tmp_path / '1.dcm'}: this DICOM slice cannot be read\n"
        "  hint: a field of it is damaged: copy it again, or save it again"
    )
    write(tmp_path)
    with pytest.raises(InputError) as error:
        read(tmp_path)
    assert str(error.value) == (
        f"{tmp_path}: the DICOM files in this folder cannot be read\n  hint: one of them is damaged"
    )
