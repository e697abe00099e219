"""DICOM segmentations: labels with names and colours, segments that overlap, fractions, and maps of labels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from dicom_files import save
from pydicom.dataset import Dataset
from stated_dicom import segmentation
from volume_files import read

pytestmark = pytest.mark.usefixtures("one_process")

Array = npt.NDArray[Any]


def planes(*rows: str) -> Array:
    """Return segments [segment, y, x] by rows of digits, one text for each segment, with `/` between rows."""
    return np.array([[[int(digit) for digit in row] for row in text.split("/")] for text in rows], np.uint8)


def segment(number: int, label: str, color: list[int] | None = None) -> Dataset:
    item = Dataset()
    item.SegmentNumber, item.SegmentLabel = number, label
    if color is not None:
        item.RecommendedDisplayCIELabValue = color
    return item


def write(path: Path, kind: str, values: Array, *segments: Dataset, **fields: Any) -> Path:
    dataset = segmentation(kind, values)
    dataset.SegmentSequence = list(segments)
    for keyword, value in fields.items():
        setattr(dataset, keyword, value)
    save(path, dataset)
    return path


LIVER, TUMOUR = segment(1, "Liver", [41661, 41167, 40792]), segment(2, "Tumour", [34886, 53484, 50172])


def test_segments_are_labels_with_names_and_colours(tmp_path: Path) -> None:
    """The colours are those that highdicom 0.28 has for these numbers."""
    path = write(tmp_path / "a.dcm", "BINARY", planes("1100/0000", "0000/0011"), LIVER, TUMOUR)
    volume = read(path)
    assert volume.values[0].tolist() == [[1, 1, 0, 0], [0, 0, 2, 2]]
    assert volume.note is None
    assert [(label.value, label.name) for label in volume.labels] == [(1, "Liver"), (2, "Tumour")]
    colors = [np.rint(255 * np.array(label.color)).tolist() for label in volume.labels]
    np.testing.assert_allclose(colors, [[221, 130, 101], [255, 0, 0]], atol=1)


def test_numbers_of_segments_are_not_those_of_dimensions(tmp_path: Path) -> None:
    """Dimensions count segments from 1 on, whatever their numbers are (PS3.3, C.7.6.17)."""
    dataset = segmentation("BINARY", planes("1100", "0011"))
    dataset.SegmentSequence = [segment(5, "Liver"), segment(300, "Tumour")]
    pointer = Dataset()
    pointer.DimensionIndexPointer = 0x0062000B  # the number of the segment
    dataset.DimensionIndexSequence = [pointer]
    for k, frame in enumerate(dataset.PerFrameFunctionalGroupsSequence):
        frame.SegmentIdentificationSequence[0].ReferencedSegmentNumber = (5, 300)[k]
        frame.FrameContentSequence = [Dataset()]
        frame.FrameContentSequence[0].DimensionIndexValues = [k + 1]
    save(tmp_path / "a.dcm", dataset)
    volume = read(tmp_path / "a.dcm")
    assert volume.values[0].tolist() == [[5, 5, 300, 300]]
    assert [(label.value, label.name) for label in volume.labels] == [(5, "Liver"), (300, "Tumour")]
    assert [channel.name for channel in read(tmp_path / "a.dcm", component=1).channels] == ["Liver", "Tumour"]


@pytest.mark.parametrize("num_columns", [8, 5])
def test_segments_of_one_bit_a_pixel(tmp_path: Path, num_columns: int) -> None:
    """Frames begin anywhere in a byte."""
    values = np.random.default_rng(0).integers(0, 2, (2, 3, num_columns))
    values[1][values[0] > 0] = 0
    dataset = segmentation("BINARY", values)
    dataset.BitsAllocated, dataset.BitsStored, dataset.HighBit = 1, 1, 0
    packed = np.packbits(values.astype(np.uint8).ravel(), bitorder="little").tobytes()
    dataset.PixelData = packed + bytes(len(packed) % 2)
    save(tmp_path / "a.dcm", dataset)
    np.testing.assert_array_equal(read(tmp_path / "a.dcm").values[0], values[0] + 2 * values[1])


def test_a_segment_without_a_colour_has_none(tmp_path: Path) -> None:
    path = write(tmp_path / "a.dcm", "BINARY", planes("1100", "0011"), LIVER, segment(2, "Bone"))
    assert [label.color is None for label in read(path).labels] == [False, True]


def test_one_segment_is_chosen(tmp_path: Path) -> None:
    path = write(tmp_path / "a.dcm", "BINARY", planes("1110", "0011"), LIVER, TUMOUR)
    volume = read(path, component=1)
    assert volume.values[0].tolist() == [[0, 0, 2, 2]]
    assert [channel.name for channel in volume.channels] == ["Liver", "Tumour"]


@pytest.mark.parametrize("is_first_inside", [False, True])
def test_the_smallest_of_segments_that_overlap_is_shown(tmp_path: Path, is_first_inside: bool) -> None:
    values = planes("1111/1111", "0110/0000")[:: -1 if is_first_inside else 1]
    volume = read(write(tmp_path / "a.dcm", "BINARY", values, LIVER, TUMOUR))
    whole, part = (2, 1) if is_first_inside else (1, 2)
    assert volume.values[0].tolist() == [[whole, part, part, whole], [whole] * 4]
    note = "2 voxels in several segments belong to the smallest of them; `component: k` draws one segment"
    assert volume.note == note


def test_fractional_segments_are_components(tmp_path: Path) -> None:
    values = planes("0246", "8000")
    path = write(tmp_path / "a.dcm", "FRACTIONAL", values, LIVER, TUMOUR, MaximumFractionalValue=8)
    np.testing.assert_array_equal(read(path).values[0], [[0, 0.25, 0.5, 0.75]])
    np.testing.assert_array_equal(read(path, component=1).values[0], [[1, 0, 0, 0]])
    assert [channel.name for channel in read(path).channels] == ["Liver", "Tumour"]
    assert read(path).labels == ()


def test_whole_fractional_segments_are_labels(tmp_path: Path) -> None:
    values = planes("8800", "0008")
    path = write(tmp_path / "a.dcm", "FRACTIONAL", values, LIVER, TUMOUR, MaximumFractionalValue=8)
    assert read(path).values[0].tolist() == [[1, 1, 0, 2]]
    assert [label.name for label in read(path).labels] == ["Liver", "Tumour"]


@pytest.mark.parametrize("background", [0, 9])
def test_maps_of_labels(tmp_path: Path, background: int) -> None:
    """One frame a slice, whose values are numbers of segments, and one that stands for the background."""
    values = np.where(planes("1200", "0022") == 0, background, planes("1200", "0022"))
    dataset = segmentation("LABELMAP", values)
    dataset.SegmentSequence, dataset.PixelPaddingValue = [LIVER, TUMOUR], background
    for z, frame in enumerate(dataset.PerFrameFunctionalGroupsSequence):
        del frame.SegmentIdentificationSequence
        frame.PlanePositionSequence[0].ImagePositionPatient = ["0", "0", f"{3 * z}"]
    save(tmp_path / "a.dcm", dataset)
    volume = read(tmp_path / "a.dcm")
    assert volume.values.tolist() == [[[1, 2, 0, 0]], [[0, 0, 2, 2]]]
    assert volume.num_absent == 0
    assert [label.name for label in volume.labels] == ["Liver", "Tumour"]


def test_labels_that_are_wrong_are_left_out(tmp_path: Path) -> None:
    path = write(tmp_path / "a.dcm", "BINARY", planes("1100", "0011"), LIVER, segment(1, "Twice"))
    volume = read(path)
    assert volume.labels == ()
    assert volume.note is not None and "the labels in this file are left out: a label twice" in volume.note
