"""DICOM files that say nothing of lengths, low values that are light, files that are no slices, and slices alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pydicom
import pytest
from dicom_files import functional_groups, image_fields, save, write_slice
from pydicom.uid import ExplicitVRLittleEndian, ImplicitVRLittleEndian, RLELossless
from volume_files import read, refused

pytestmark = pytest.mark.usefixtures("one_process")

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
        error = refused(name)
        assert str(error) == (
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
    fields = image_fields(VALUES[0].astype(np.int16), PixelSpacing=None, ImagerPixelSpacing=["0.25", "0.5"])
    save(tmp_path / "a.dcm", fields)
    np.testing.assert_array_equal(read(tmp_path / "a.dcm").spacing[:2], [0.5, 0.25])


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1]])
def test_functional_groups_place_frames(tmp_path: Path, order: list[int]) -> None:
    save(tmp_path / "a.dcm", functional_groups(VALUES, order))
    volume = read(tmp_path / "a.dcm")
    np.testing.assert_array_equal(volume.values, VALUES)
    assert volume.values.dtype == np.int16
    np.testing.assert_array_equal(volume.spacing, [0.5, 0.25, 7])
    np.testing.assert_array_equal(volume.world_from_index[:3, 3], [1, 2, 3])


def test_frames_at_one_place_are_refused(tmp_path: Path) -> None:
    save(tmp_path / "a.dcm", functional_groups(VALUES, [0, 1, 2], spacing=0.0))
    error = refused(tmp_path / "a.dcm", match="two slices of this series are at the same position")
    assert error.got == "a.dcm and a.dcm, frame 2, which no field tells apart"


def test_frames_need_a_distance(tmp_path: Path) -> None:
    path = tmp_path / "frames.dcm"
    save(path, image_fields(VALUES.astype(np.int16)))
    error = refused(path, match="does not give its voxel size")
    assert error.got == "3 frames without SpacingBetweenSlices or functional groups"
    np.testing.assert_array_equal(read(path, (0.5, 0.25, 7)).spacing, [0.5, 0.25, 7])
    save(path, image_fields(VALUES.astype(np.int16), SpacingBetweenSlices="7"))
    np.testing.assert_array_equal(read(path).spacing, [0.5, 0.25, 7])
    np.testing.assert_array_equal(read(path).values, VALUES)


@pytest.mark.parametrize(("data", "got"), [(b"", "an empty file"), (b"no slice", "a file that is not DICOM")])
def test_files_that_were_slices(tmp_path: Path, data: bytes, got: str) -> None:
    write(tmp_path)
    (tmp_path / "README.txt").write_bytes(data)
    (tmp_path / "._1.dcm").write_bytes(data)
    np.testing.assert_array_equal(read(tmp_path).values, VALUES)
    (tmp_path / "1.dcm").write_bytes(data)
    assert str(refused(tmp_path)) == (
        f"{tmp_path / '1.dcm'}: this DICOM slice cannot be read\n"
        f"  got: {got}\n"
        "  hint: the file is truncated or damaged: copy it again, or remove it if it is no slice"
    )


@pytest.mark.parametrize(("is_implicit", "with_syntax"), [(True, True), (False, True), (True, False), (False, False)])
def test_files_without_a_preamble(tmp_path: Path, is_implicit: bool, with_syntax: bool) -> None:
    write(tmp_path)
    for path in sorted(tmp_path.iterdir()):
        dataset = pydicom.dcmread(path)
        dataset.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian if is_implicit else ExplicitVRLittleEndian
        if not with_syntax:
            del dataset.file_meta
        dataset.preamble = None
        path.unlink()
        dataset.save_as(path.with_suffix(""), implicit_vr=is_implicit, little_endian=True, enforce_file_format=False)
    np.testing.assert_array_equal(read(tmp_path).values, VALUES)
    np.testing.assert_array_equal(read(tmp_path / "1").values[0], VALUES[1])


@pytest.mark.parametrize(
    "fields",
    [
        {"SamplesPerPixel": None},
        {"PhotometricInterpretation": None},
        {"PixelRepresentation": None},
        {"RescaleSlope": "0", "RescaleIntercept": "0"},
        {"PixelData": np.arange(60, dtype=np.uint16).tobytes()},  # of two more slices
    ],
)
def test_careless_writers_are_forgiven(tmp_path: Path, fields: dict[str, object]) -> None:
    values = np.arange(20, dtype=np.uint16).reshape(4, 5)
    save(tmp_path / "a.dcm", image_fields(values, **fields))
    np.testing.assert_array_equal(read(tmp_path / "a.dcm").values[0], values)


@pytest.mark.parametrize("fields", [{}, {"RescaleSlope": "2", "RescaleIntercept": "-1"}, {"BitsStored": 32}])
def test_floats_stay_floats(tmp_path: Path, fields: dict[str, object]) -> None:
    values = np.linspace(0, 3, 20, dtype=np.float32).reshape(4, 5)
    of_integers = dict.fromkeys(("PixelData", "BitsStored", "HighBit", "PixelRepresentation"))
    save(
        tmp_path / "a.dcm",
        image_fields(values, **(of_integers | {"FloatPixelData": values.tobytes()} | fields)),  # type: ignore[arg-type]
    )
    if "BitsStored" in fields:
        refused(tmp_path / "a.dcm", match="this DICOM slice cannot be read")
    else:
        expected = values * 2.0 - 1 if fields else values
        np.testing.assert_array_equal(read(tmp_path / "a.dcm").values[0], expected)


def test_one_slice_of_a_series(tmp_path: Path) -> None:
    write(tmp_path)
    note = f"one of several slices of a DICOM series; its folder, {tmp_path}, stands for all of them"
    assert read(tmp_path / "1.dcm").note == note
    assert read(tmp_path).note is None
    other = (tmp_path / "1.dcm").read_bytes().replace(b"1.2.3.4\0", b"1.2.\xff.4\0")
    (tmp_path / "other.dcm").write_bytes(other)  # whose series has no name
    assert b"\xff.4" in other
    assert read(tmp_path / "other.dcm").note is None
    for name in ("0.dcm", "2.dcm", "other.dcm"):
        (tmp_path / name).unlink()
    assert read(tmp_path / "1.dcm").note is None
    assert read(tmp_path).note is None


def test_pixels_are_those_of_the_image_and_not_of_its_icon(tmp_path: Path) -> None:
    icon = image_fields(np.full((2, 2), 7, np.uint8))
    del icon.file_meta
    save(tmp_path / "a.dcm", image_fields(VALUES[1].astype(np.int16), IconImageSequence=[icon]))
    np.testing.assert_array_equal(read(tmp_path / "a.dcm").values[0], VALUES[1])


@pytest.mark.parametrize("is_signed", [False, True])
def test_unused_bits_are_no_part_of_values(tmp_path: Path, is_signed: bool) -> None:
    """Overlays were stored there; the sign of 12 bits need not reach into them."""
    stored = np.array([[0, 5, 2047], [-1, -2048, 9]] if is_signed else [[0, 5, 2047], [4095, 2048, 9]])
    with_overlay = (stored & 0xFFF | 0x5000).astype(np.uint16)
    fields = image_fields(with_overlay, BitsStored=12, HighBit=11, PixelRepresentation=int(is_signed))
    save(tmp_path / "a.dcm", fields)
    np.testing.assert_array_equal(read(tmp_path / "a.dcm").values[0], stored)


def test_run_length_encoded_pixels_need_no_other_package(tmp_path: Path) -> None:
    fields = image_fields(VALUES[0].astype(np.int16))
    fields.compress(RLELossless, encoding_plugin="pydicom")
    save(tmp_path / "a.dcm", fields)
    np.testing.assert_array_equal(read(tmp_path / "a.dcm").values[0], VALUES[0])
