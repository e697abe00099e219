"""DICOM: doses, padding that stands for no data, files beside a series, and files without pixels."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dicom_files import dicom_bytes, image_fields, save
from pydicom.dataset import Dataset
from pydicom.pixels.processing import apply_color_lut, apply_modality_lut
from pydicom.uid import ExplicitVRLittleEndian, ImplicitVRLittleEndian
from this_process import read_here
from volume_files import read, refused, written

from renderer.readers import Image

pytestmark = pytest.mark.usefixtures("one_process")

AXES = ["1", "0", "0", "0", "1", "0"]
PLAN, STRUCTURES, INDEX = "1.2.840.10008.5.1.4.1.1.481.5", "1.2.840.10008.5.1.4.1.1.481.3", "1.2.840.10008.1.3.10"


def image_of(path: Path) -> Image:
    """Return the image as the reader returns it, with the values that stand for no data."""
    choice = {"time": None, "component": None, "has_spacing_override": False}
    return read_here("renderer.readers.dicom:read_dicom", path, **choice)


def dose(path: Path, offsets: list[float], **fields: Any) -> None:
    values = np.broadcast_to(np.arange(len(offsets), dtype=np.uint32)[:, np.newaxis, np.newaxis], (len(offsets), 4, 5))
    fields = {"DoseGridScaling": "0.25", "Modality": "RTDOSE", "ImageOrientationPatient": AXES, **fields}
    fields |= {"GridFrameOffsetVector": [f"{each:g}" for each in offsets], "ImagePositionPatient": ["1", "2", "-70"]}
    save(path, image_fields(values, **fields))


@pytest.mark.parametrize("offsets", [[0, 2, 4, 6], [0, -2, -4, -6], [-70, -68, -66, -64], [-70, -72, -74, -76]])
@pytest.mark.parametrize("down", ["1", "-1"])
def test_doses_lie_by_their_offsets(tmp_path: Path, offsets: list[float], down: str) -> None:
    """Those that begin with 0 are along the normal, and others are z of the patient; the first is at -70 in all."""
    dose(tmp_path / "a.dcm", offsets, ImageOrientationPatient=["1", "0", "0", "0", down, "0"])
    volume = read(tmp_path / "a.dcm")
    assert volume.values.dtype == np.float64
    for k, offset in enumerate(offsets):
        (index,) = np.flatnonzero(volume.values[:, 0, 0] == 0.25 * k)
        z = offset if offsets[0] else -70 + int(down) * offset
        np.testing.assert_array_equal(volume.world_from_index @ [0, 0, index, 1], [1, 2, z, 1])


def test_uneven_doses_are_uneven(tmp_path: Path) -> None:
    dose(tmp_path / "a.dcm", [0, 2, 4, 6, 12, 14])
    error = refused(tmp_path / "a.dcm", match="the slices of this series are not evenly spaced")
    assert error.got is not None and error.got.startswith("gaps from 2 to 6; ")
    assert error.hint == "resample the series to even spacing, for example in 3D Slicer"


@pytest.mark.parametrize("syntax", [ExplicitVRLittleEndian, ImplicitVRLittleEndian])
@pytest.mark.parametrize(
    ("dtype", "fields", "nodata"),
    [
        ("i2", {"PixelPaddingValue": -2000}, (-2000, -2000)),
        ("i2", {"PixelPaddingValue": 63536}, (-2000, -2000)),  # as if it had no sign
        ("u2", {"PixelPaddingValue": 63536}, (63536, 63536)),
        ("u2", {"PixelPaddingValue": 100, "RescaleSlope": "2", "RescaleIntercept": "-1024"}, (-824, -824)),
        ("i2", {"PixelPaddingValue": 5, "RescaleSlope": "-.5", "RescaleIntercept": "1"}, (-1.5, -1.5)),
        ("i2", {"PixelPaddingValue": -2000, "PixelPaddingRangeLimit": -1900}, (-2000, -1900)),
        ("i2", {"PixelPaddingValue": -1900, "PixelPaddingRangeLimit": -2000}, (-2000, -1900)),
        ("i2", {}, None),
        ("u1", {"PixelPaddingValue": 3, "PhotometricInterpretation": "PALETTE COLOR"}, None),
    ],
)
def test_padding_is_no_data(tmp_path, dtype, fields, nodata, syntax) -> None:
    dataset = image_fields(np.zeros((4, 5), dtype))
    for keyword, value in fields.items():
        if keyword.startswith("PixelPadding"):  # of the type that the value has
            dataset.add_new(keyword, "SS" if value < 0 or (dtype == "i2" and value < 2**15) else "US", value)
        else:
            setattr(dataset, keyword, value)
    path = written(tmp_path / "a.dcm", dicom_bytes(dataset, syntax))
    assert image_of(path).nodata == (() if nodata is None else (nodata,))


def test_padding_of_floats(tmp_path: Path) -> None:
    values = np.zeros((4, 5), np.float32)
    of_integers = dict.fromkeys(("PixelData", "BitsStored", "HighBit", "PixelRepresentation"))
    fields: Any = of_integers | {"FloatPixelData": values.tobytes(), "FloatPixelPaddingValue": -1.5}
    save(tmp_path / "a.dcm", image_fields(values, **fields))
    assert image_of(tmp_path / "a.dcm").nodata == ((-1.5, -1.5),)


def test_padding_that_differs_from_slice_to_slice_is_nan(tmp_path: Path) -> None:
    """After the rescale, -1000 is padding of the one and a value of the other."""
    for k, slope in enumerate((1, 2)):
        stored = np.array([[-500, -1000], [7, 8]], np.int16)
        fields = {"RescaleSlope": str(slope), "PixelPaddingValue": (-500, -500)[k], "RescaleIntercept": "0"}
        fields |= {"ImagePositionPatient": ["0", "0", str(k)], "ImageOrientationPatient": AXES}
        save(tmp_path / f"{k}.dcm", image_fields(stored, **fields))
    image = image_of(tmp_path)
    assert image.nodata == ()
    expected = [[[np.nan, -1000], [7, 8]], [[np.nan, -2000], [14, 16]]]
    np.testing.assert_array_equal(image.values, expected)


def stack(folder: Path, num: int = 16) -> np.ndarray[Any, Any]:
    values = np.broadcast_to(np.arange(num, dtype=np.int16)[:, np.newaxis, np.newaxis], (num, 4, 5))
    for k in range(num):
        image(folder / f"{k:02}.dcm", values[k], ["0", "0", f"{2 * k}"])
    return values


def image(path: Path, values: Any, place: list[str] | None, **fields: Any) -> None:
    axes = None if place is None else AXES
    fields = {"ImagePositionPatient": place, "ImageOrientationPatient": axes, **fields}
    save(path, image_fields(np.asarray(values, np.int16), **fields))


SCOUT = {"ImageType": ["ORIGINAL", "PRIMARY", "LOCALIZER"], "ImageOrientationPatient": ["1", "0", "0", "0", "0", "-1"]}
SCREEN = {"ImageType": ["DERIVED", "SECONDARY"], "PixelSpacing": None}


@pytest.mark.parametrize(
    ("shape", "place", "fields", "kind"),
    [
        ((4, 5), ["0", "9", "9"], SCOUT, "localizer"),
        ((40, 50), ["0", "9", "9"], SCOUT, "localizer"),
        ((4, 5), ["0", "9", "9"], SCOUT | {"SeriesInstanceUID": "1.2.9"}, "localizer"),
        ((4, 5), None, SCREEN, "capture"),
        ((9, 9), None, {"SOPClassUID": "1.2.840.10008.5.1.4.1.1.7"}, "capture"),
        ((4, 5), None, SCREEN | {"SeriesInstanceUID": "1.2.9"}, "capture"),
        ((4, 7), ["0", "0", "1"], {}, "image of another size or orientation"),
        ((4, 5), ["0", "0", "1"], {"ImageOrientationPatient": AXES[::-1]}, "image of another size or orientation"),
        ((4, 5), ["0", "0", "1"], {"SeriesInstanceUID": "1.2.9"}, "image of another series"),
    ],
)
def test_strays_are_left_out(tmp_path, shape, place, fields, kind) -> None:
    values = stack(tmp_path)
    image(tmp_path / "stray.dcm", np.zeros(shape), place, **fields)
    volume = read(tmp_path)
    np.testing.assert_array_equal(volume.values, values)
    assert volume.note == f"left out of this series: 1 {kind} (stray.dcm)"


def test_several_strays_are_counted(tmp_path: Path) -> None:
    values = stack(tmp_path)
    for k in range(2):
        image(tmp_path / f"scout{k}.dcm", np.full((4, 5), k), ["0", "9", "9"], **SCOUT)
    image(tmp_path / "x.dcm", np.zeros((4, 5)), None, **SCREEN)
    volume = read(tmp_path)
    np.testing.assert_array_equal(volume.values, values)
    assert volume.note == "left out of this series: 2 localizers (scout0.dcm), 1 capture (x.dcm)"


def test_series_without_a_uid_are_told_apart_by_their_number(tmp_path: Path) -> None:
    for k in range(6):  # slices of one lie between those of the other
        fields: dict[str, Any] = {"SeriesInstanceUID": None, "SeriesNumber": str(k % 2 + 1)}
        image(tmp_path / f"{k}.dcm", np.full((4, 5), k), ["0", "0", f"{k}"], **fields)
    error = refused(tmp_path, match="this folder holds 2 DICOM series")
    assert error.got == '"1", 3 files from 0.dcm; "2", 3 files from 1.dcm'


def test_copies_of_slices_are_left_out(tmp_path: Path) -> None:
    for k in range(4):
        image(tmp_path / f"{k}.dcm", np.full((4, 5), k), ["0", "0", str(k)], InstanceNumber=k)
    shutil.copy(tmp_path / "2.dcm", tmp_path / "2 (1).dcm")
    volume = read(tmp_path)
    np.testing.assert_array_equal(volume.values[:, 0, 0], range(4))
    assert volume.note == "left out of this series: 1 duplicate (2.dcm)"


def test_localizers_alone_are_no_volume(tmp_path: Path) -> None:
    for k, axes in enumerate((["1", "0", "0", "0", "0", "-1"], ["0", "1", "0", "0", "0", "-1"], AXES)):
        image(tmp_path / f"{k}.dcm", np.ones((4, 5)), ["0", "9", "9"], **(SCOUT | {"ImageOrientationPatient": axes}))
    refused(tmp_path, match="the slices of this series differ in their orientation")


def test_positions_win_over_a_negative_distance(tmp_path: Path) -> None:
    for k in range(3):
        image(tmp_path / f"{k}.dcm", np.full((4, 5), k), ["0", "0", f"{-2 * k}"], SpacingBetweenSlices="-3")
    volume = read(tmp_path)
    assert volume.values[:, 0, 0].tolist() == [2, 1, 0]
    np.testing.assert_array_equal(volume.world_from_index[2, 2:], [2, -4])


def test_a_localizer_alone_is_a_volume(tmp_path: Path) -> None:
    image(tmp_path / "a.dcm", np.ones((4, 5)), ["0", "9", "9"], **SCOUT)
    assert read(tmp_path).shape_xyz == (5, 4, 1)


def without_pixels(path: Path, kind: str, **fields: Any) -> None:
    dataset = Dataset()
    dataset.file_meta = image_fields(np.zeros((1, 1), np.int16)).file_meta
    dataset.file_meta.MediaStorageSOPClassUID = kind
    for keyword, value in fields.items():
        setattr(dataset, keyword, value)
    save(path, dataset)


@pytest.mark.parametrize(
    ("kind", "name", "hint"),
    [
        (PLAN, "RT Plan", "name the images that it belongs to"),
        (STRUCTURES, "RT Structure Set", "contours, not voxels: save them as a mask first, for example in 3D Slicer"),
        ("1.2.840.10008.5.1.4.1.1.88.11", "Basic Text SR", "name the images that it belongs to"),
        (INDEX, "Media Storage Directory", "an index of other files: name the folder that holds them"),
    ],
)
def test_files_without_pixels_are_named(tmp_path: Path, kind: str, name: str, hint: str) -> None:
    without_pixels(tmp_path / "a.dcm", kind, SOPClassUID=None if kind == INDEX else kind)
    assert str(refused(tmp_path / "a.dcm")) == (
        f"{tmp_path / 'a.dcm'}: this DICOM file holds no volume\n"
        f"  got: {name}, a kind of file without pixels\n"
        "  expected: an image, a dose or a segmentation\n"
        f"  hint: {hint}"
    )
    is_index = kind == INDEX  # of the files beside it, which nobody misses
    error = refused(tmp_path, match="this folder holds no volume")
    assert error.got == (None if is_index else f"1 {name} (a.dcm)")
    values = stack(tmp_path, 2)
    np.testing.assert_array_equal(read(tmp_path).values, values)
    assert read(tmp_path).note == (None if is_index else f"left out of this series: 1 {name} (a.dcm)")


def test_a_damaged_slice_is_no_file_of_another_kind(tmp_path: Path) -> None:
    stack(tmp_path, 3)
    without_pixels(tmp_path / "01.dcm", "1.2.840.10008.5.1.4.1.1.2", SeriesInstanceUID="1.2.3.4")
    assert refused(tmp_path, match="this DICOM slice cannot be read").where == str(tmp_path / "01.dcm")


def lut(count: int, first: int, values: Any, vr: str = "US") -> Dataset:
    """Return a table that says of itself that it has `count` values."""
    item = Dataset()
    item.ModalityLUTType = "US"
    item.add_new("LUTDescriptor", "SS" if first < 0 else "US", [count, first, 16])
    item.add_new("LUTData", vr, values)
    return item


@pytest.mark.parametrize("syntax", [ExplicitVRLittleEndian, ImplicitVRLittleEndian])
@pytest.mark.parametrize("is_signed", [False, True])
def test_tables_of_values_are_applied(tmp_path: Path, syntax: str, is_signed: bool) -> None:
    """The values are those of pydicom: the ends of the table stand for all beyond them."""
    stored = np.array([[-7, -2, -1, 0], [1, 2, 3, 900]], np.int16) if is_signed else np.array([[0, 1, 2, 3]], np.uint16)
    table = np.array([500, 40, 3], "<u2")
    first = -2 if is_signed else 1
    dataset = image_fields(stored, ModalityLUTSequence=[lut(3, first, table.tobytes(), "OW")], Modality="MR")
    path = written(tmp_path / "a.dcm", dicom_bytes(dataset, syntax))
    expected = [[500, 500, 40, 3], [3, 3, 3, 3]] if is_signed else [[500, 500, 40, 3]]
    np.testing.assert_array_equal(apply_modality_lut(stored, dataset), expected)
    np.testing.assert_array_equal(read(path).values[0], expected)


def test_padding_of_a_table_is_no_data(tmp_path: Path) -> None:
    """Stored 0 is padding, and has the value of stored 1, which is none."""
    stored = np.array([[0, 1, 2]], np.uint16)
    fields = {"ModalityLUTSequence": [lut(2, 1, [5, 6])], "PixelPaddingValue": 0}
    save(tmp_path / "a.dcm", image_fields(stored, **fields))
    np.testing.assert_array_equal(read(tmp_path / "a.dcm").values, [[[np.nan, 5, 6]]])


def test_a_short_table_is_damaged(tmp_path: Path) -> None:
    save(tmp_path / "a.dcm", image_fields(np.zeros((1, 2), np.uint16), ModalityLUTSequence=[lut(9, 0, [1, 2])]))
    error = refused(tmp_path / "a.dcm", match="the table of values of this DICOM file is damaged")
    assert error.got == "2 of 9 values"


def real_world(slope: float, intercept: float, unit: str = "mm2/s") -> dict[str, Any]:
    code, item = Dataset(), Dataset()
    code.CodeValue = unit
    item.RealWorldValueSlope, item.RealWorldValueIntercept = slope, intercept
    item.MeasurementUnitsCodeSequence = [code]
    return {"RealWorldValueMappingSequence": [item], "Modality": "MR"}


@pytest.mark.parametrize(
    ("rescale", "expected", "unit", "note"),
    [
        (None, 2.0 * 10 + 1, "mm2/s", None),
        (("1", "0"), 2.0 * 10 + 1, "mm2/s", None),
        (("2", "1"), 2.0 * 10 + 1, "", None),  # the same
        (
            ("3", "0"),
            3.0 * 10,
            "",
            "RealWorldValueMappingSequence, another scale of the values, is not applied: RescaleSlope is",
        ),
    ],
)
def test_real_world_values_count_where_no_other_scale_does(tmp_path: Path, rescale, expected, unit, note) -> None:
    fields = real_world(2.0, 1.0)
    if rescale is not None:
        fields |= dict(zip(("RescaleSlope", "RescaleIntercept"), rescale, strict=True))
    save(tmp_path / "a.dcm", image_fields(np.full((4, 5), 10, np.uint16), **fields))
    volume = read(tmp_path / "a.dcm")
    assert (volume.values[0, 0, 0], volume.value_unit, volume.note) == (expected, unit, note)


@pytest.mark.parametrize("bits", [8, 16])
def test_palettes_are_colours(tmp_path: Path, bits: int) -> None:
    """The colours are those of pydicom."""
    stored = np.array([[0, 1, 2, 3]], np.uint8)
    fields: dict[str, Any] = {"PhotometricInterpretation": "PALETTE COLOR"}
    for k, color in enumerate(("Red", "Green", "Blue")):
        table = (np.array([3, 30, 70, 200]) + k) * (257 if bits == 16 else 1)
        fields[f"{color}PaletteColorLookupTableDescriptor"] = [4, 0, bits]
        fields[f"{color}PaletteColorLookupTableData"] = table.astype(f"<u{bits // 8}").tobytes()
    dataset = image_fields(stored, **fields)
    save(tmp_path / "a.dcm", dataset)
    expected = apply_color_lut(stored, dataset)
    for k in range(3):
        volume = read(tmp_path / "a.dcm", component=k)
        np.testing.assert_array_equal(volume.values[0], expected[..., k])
    assert [channel.name for channel in volume.channels] == ["R", "G", "B"]


def test_brightness_and_colour_difference_become_red_green_and_blue(tmp_path: Path) -> None:
    """pydicom converts; the components have the names of what they are."""
    values = np.zeros((4, 5, 3), np.uint8)
    values[..., 0], values[..., 1], values[..., 2] = 76, 85, 255  # red
    fields = {"SamplesPerPixel": 3, "PhotometricInterpretation": "YBR_FULL", "PlanarConfiguration": 0}
    save(tmp_path / "a.dcm", image_fields(values[..., 0], PixelData=values.tobytes(), **fields))
    assert [read(tmp_path / "a.dcm", component=k).values[0, 0, 0] for k in range(3)] == [254, 0, 0]
    assert [channel.name for channel in read(tmp_path / "a.dcm").channels] == ["R", "G", "B"]


@pytest.mark.parametrize(
    ("letters", "axes"),
    [
        (["L", "P"], [[1, 0, 0], [0, 1, 0]]),
        (["P", "F"], [[0, 1, 0], [0, 0, -1]]),
        (["AR", "FP"], [[0, -1, 0], [0, 0, -1]]),
        (["L", "R"], None),
        (["L", ""], None),
    ],
)
def test_letters_tell_directions_where_no_numbers_do(tmp_path: Path, letters, axes) -> None:
    save(tmp_path / "a.dcm", image_fields(np.zeros((4, 5), np.uint16), PatientOrientation=letters, Modality="MR"))
    volume = read(tmp_path / "a.dcm")
    expected = np.array(axes or [[1, 0, 0], [0, 1, 0]]) * [[0.5], [0.25]]
    np.testing.assert_array_equal(volume.world_from_index[:3, :2].T, expected)
    assert volume.world_axes == ("LPS" if axes else "")
    assert (volume.note is not None) == (axes is not None)


@pytest.mark.parametrize(
    "fields",
    [{"LossyImageCompression": "01"}, {"ICCProfile": bytes(8)}, {"VOILUTSequence": [Dataset()]}],
    ids=lambda fields: next(iter(fields)),
)
def test_how_pixels_were_kept_or_are_shown_elsewhere_is_no_news(tmp_path: Path, fields: dict[str, Any]) -> None:
    plane = np.arange(20, dtype=np.uint16).reshape(4, 5)
    for name, own in (("plain.dcm", {}), ("stated.dcm", fields)):
        save(tmp_path / name, image_fields(plane, PixelSpacing=["1", "1"], ImageOrientationPatient=AXES, **own))
    assert read(tmp_path / "stated.dcm").note == read(tmp_path / "plain.dcm").note
