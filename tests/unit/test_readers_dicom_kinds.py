"""DICOM files by their kinds: runs of times, tiles of slides, compressions and films, files of frames in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dicom_files import dicom_bytes, functional_groups, image_fields, save
from pydicom import Dataset
from pydicom.encaps import encapsulate
from volume_files import read, refused, written

from renderer.readers import find_volume, summarize, volumes_in

pytestmark = pytest.mark.usefixtures("one_process")

RUN = np.broadcast_to(np.arange(3, dtype=np.uint8)[:, np.newaxis, np.newaxis], (3, 4, 5))
FIRST = "the first is drawn; `time: k` chooses another"
ENHANCED = np.arange(60).reshape(3, 4, 5)


@pytest.mark.parametrize(
    ("modality", "fields", "what", "field", "times"),
    [
        ("XA", {"FrameTime": "50"}, "an X-ray run", "FrameTime", (0, 0.05, 0.1)),
        ("US", {"FrameTimeVector": ["0", "50", "70"]}, "an ultrasound clip", "FrameTimeVector", (0, 0.05, 0.12)),
        ("OT", {"FrameTime": "50", "FrameIncrementPointer": 0x00181063}, "a run", "FrameTime", (0, 0.05, 0.1)),
        ("RF", {}, "an X-ray run", "frame number", ()),
    ],
)
@pytest.mark.parametrize("spacing", [None, (0.5, 0.25, 7.0)])
def test_frames_of_a_run_are_times(tmp_path: Path, modality, fields, what, field, times, spacing) -> None:
    save(tmp_path / "a.dcm", image_fields(RUN, Modality=modality, **fields))
    for k in range(3):
        volume = read(tmp_path / "a.dcm", spacing, time=k)
        np.testing.assert_array_equal(volume.values, RUN[k : k + 1])
        assert volume.note == f"3 frames of {what}: times of one plane, and no slices"
        np.testing.assert_allclose(volume.times, times)
    assert read(tmp_path / "a.dcm").note == f"{volume.note}; 3 times (by {field}); {FIRST}"


def test_a_run_without_lengths_has_pixels_of_one(tmp_path: Path) -> None:
    fields: dict[str, Any] = {"Modality": "US", "PixelSpacing": None, "PixelAspectRatio": ["3", "2"]}
    save(tmp_path / "a.dcm", image_fields(RUN, **fields))
    volume = read(tmp_path / "a.dcm", time=0)
    assert volume.spacing.tolist() == [1.0, 1.5, 1.0] and volume.length_unit == ""
    guess = "the file does not give its voxel size; 1 x 1.5 x 1 is assumed by PixelAspectRatio"
    assert volume.note == f"3 frames of an ultrasound clip: times of one plane, and no slices; {guess}"


def test_a_clip_whose_regions_have_lengths_is_told_of_them(tmp_path: Path) -> None:
    region = Dataset()
    region.PhysicalDeltaX = region.PhysicalDeltaY = 0.1
    save(tmp_path / "a.dcm", image_fields(RUN, Modality="US", PixelSpacing=None, SequenceOfUltrasoundRegions=[region]))
    note = read(tmp_path / "a.dcm", time=0).note
    assert note is not None
    assert "the file does not give its voxel size but for parts of the picture; 1 x 1 x 1 is assumed" in note
    assert "not applied: SequenceOfUltrasoundRegions" in note


def test_frames_that_have_a_distance_are_slices(tmp_path: Path) -> None:
    save(tmp_path / "a.dcm", image_fields(RUN, Modality="US", SpacingBetweenSlices="2"))
    np.testing.assert_array_equal(read(tmp_path / "a.dcm").values, RUN)


@pytest.mark.parametrize("spacing", [None, (1.0, 1.0, 1.0)])
def test_tiles_of_a_slide_are_no_slices(tmp_path: Path, spacing: tuple[float, float, float] | None) -> None:
    slide = "1.2.840.10008.5.1.4.1.1.77.1.6"
    save(tmp_path / "a.dcm", image_fields(RUN, Modality="SM", SOPClassUID=slide, TotalPixelMatrixColumns=20))
    error = refused(tmp_path / "a.dcm", match="this DICOM file holds no volume", spacing=spacing)
    assert error.got == "3 tiles of a slide, which are no slices"
    assert error.hint is not None and "spacing" not in error.hint


def encapsulated(syntax: str, **fields: Any) -> bytes:
    dataset = image_fields(np.zeros((4, 5), np.uint16), **fields)
    dataset.PixelData = encapsulate([b"\xff\xd8\xff\xd9"])
    dataset["PixelData"].VR = "OB"
    return dicom_bytes(dataset, syntax)


@pytest.mark.parametrize(
    ("number", "bits", "what", "got"),
    [
        ("51", 12, "pixels in this compression are not read", "JPEG Extended (Process 2 and 4) of 12 bits"),
        ("94", 16, "pixels in this compression are not read", "JPIP Referenced"),
        ("102", 8, "this DICOM file holds no volume", "a film (MPEG-4 AVC/H.264 High Profile / Level 4.1), "),
    ],
)
def test_compressions_that_are_not_read_are_named(tmp_path: Path, number: str, bits: int, what: str, got: str) -> None:
    data = encapsulated(f"1.2.840.10008.1.2.4.{number}", BitsStored=bits, HighBit=bits - 1)
    error = refused(written(tmp_path / "a.dcm", data), match=what)
    assert error.got is not None and error.got.startswith(got)
    assert "truncated" not in str(error) and "damaged" not in str(error)


def test_a_damaged_stream_is_damaged(tmp_path: Path) -> None:
    data = encapsulated("1.2.840.10008.1.2.4.70")
    assert refused(written(tmp_path / "a.dcm", data)).hint == "the file is truncated or damaged"


@pytest.mark.parametrize(
    ("fields", "got"),
    [
        ({}, "no PixelData behind the header"),
        ({"PixelDataProviderURL": "http://x"}, "pixels in another place (PixelDataProviderURL)"),
    ],
)
def test_a_header_without_pixels_is_named(tmp_path: Path, fields: dict[str, Any], got: str) -> None:
    save(tmp_path / "a.dcm", image_fields(np.zeros((4, 5), np.uint16), PixelData=None, **fields))
    error = refused(tmp_path / "a.dcm", match="this DICOM slice cannot be read")
    assert error.got == got
    assert "truncated" not in str(error) and "damaged" not in str(error)


def test_spectra_have_no_pixels(tmp_path: Path) -> None:
    fields = {"SOPClassUID": "1.2.840.10008.5.1.4.1.1.4.2", "PixelData": None}
    save(tmp_path / "a.dcm", image_fields(np.zeros((4, 5), np.uint16), **fields))
    assert refused(tmp_path / "a.dcm").got == "MR Spectroscopy, a kind of file without pixels"


def enhanced(path: Path, uid: str) -> None:
    dataset = functional_groups(ENHANCED, [0, 1, 2])
    dataset.SeriesInstanceUID = uid
    save(path, dataset)


def test_files_of_frames_are_volumes_each(tmp_path: Path) -> None:
    """Also those whose names say nothing, and beside few images of one frame."""
    folder = tmp_path / "scans"
    folder.mkdir()
    for k in range(3):
        enhanced(folder / f"scan{k}", f"1.2.{k}")
    save(folder / "scout.dcm", image_fields(np.zeros((4, 5), np.uint16), uid="1.3"))
    scans = [folder / f"scan{k}" for k in range(3)]
    assert volumes_in(folder) == scans
    assert volumes_in(tmp_path) == scans
    error = refused(folder, match="this folder holds 3 volumes")
    assert error.hint == f"name one of them: {scans[0]}; `hsplat turntable {folder}` draws each of them"
    np.testing.assert_array_equal(read(scans[1]).values, ENHANCED)


def test_files_of_frames_of_one_series_are_one_volume(tmp_path: Path) -> None:
    for k in range(2):
        enhanced(tmp_path / f"{k}.dcm", "1.2.3")
    assert volumes_in(tmp_path) == []
    assert find_volume(tmp_path)[:2] == (tmp_path, "dicom")


@pytest.mark.parametrize("syntax", ["1.2.840.10008.1.2", "1.2.840.10008.1.2.1"])
def test_headers_are_summarized_without_a_library(tmp_path: Path, syntax: str) -> None:
    dataset = functional_groups(ENHANCED, [0, 1, 2])
    inside = image_fields(np.zeros((9, 2, 2), np.uint8), uid="1.9")  # has both fields, too
    del inside.file_meta
    dataset.ReferencedImageSequence, dataset.DimensionOrganizationSequence = (
        [inside],
        [inside],
    )  # before and behind them
    for is_undefined in (False, True):
        for keyword in ("ReferencedImageSequence", "DimensionOrganizationSequence"):
            dataset[keyword].is_undefined_length = is_undefined
            dataset[keyword].value[0].is_undefined_length_sequence_item = is_undefined
        path = written(tmp_path / "a.dcm", dicom_bytes(dataset, syntax))
        assert summarize(path) == (3, "1.2.3.4")
    path.write_bytes(path.read_bytes()[:200])
    assert summarize(path) == (1, "")
