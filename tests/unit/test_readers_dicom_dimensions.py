"""DICOM frames at one place: times, echoes, vectors of nuclear medicine, stacks and segments, and Siemens' mosaics."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from dicom_files import functional_groups, image_fields, save
from pydicom.dataset import Dataset
from volume_files import read, refused

pytestmark = pytest.mark.usefixtures("one_process")

Array = npt.NDArray[Any]

AXES = ["1", "0", "0", "0", "1", "0"]
TIMES = "{} times (by {}); the first is drawn; `time: k` chooses another"
COMPONENTS = "{} components (by {}); the first is drawn; `component: k` chooses another"


def planes(*shape: int) -> Array:
    """Return values [..., y, x] that are the same in each plane and differ between planes."""
    return np.broadcast_to(np.arange(np.prod(shape), dtype=np.int16).reshape(*shape, 1, 1), (*shape, 4, 5))


def write_slice(folder: Path, name: int, values: Array, z: float, **fields: Any) -> None:
    fields = {"ImagePositionPatient": ["0", "0", f"{z:g}"], "ImageOrientationPatient": AXES, **fields}
    save(folder / f"{name:03}.dcm", image_fields(values, **fields))


def groups(**sequences: Any) -> Dataset:
    """Return functional groups with one field each: `Group=(keyword, value)`."""
    frame = Dataset()
    for name, (keyword, value) in sequences.items():
        item = Dataset()
        setattr(item, keyword, value)
        setattr(frame, f"{name}Sequence", [item])
    return frame


def enhanced(values: Array, frames: Sequence[Dataset], **fields: Any) -> Dataset:
    """Return an enhanced image of `values` [frame, y, x], whose frames have these functional groups."""
    dataset = functional_groups(values.astype(np.int64) - 1000, list(range(len(values))))
    shared = dataset.SharedFunctionalGroupsSequence[0]
    shared.PixelValueTransformationSequence[0].RescaleIntercept = "0"
    for keyword, value in fields.items():
        setattr(dataset, keyword, value)
    dataset.PerFrameFunctionalGroupsSequence = list(frames)
    return dataset


def position(z: float) -> tuple[str, list[str]]:
    return "ImagePositionPatient", ["0", "0", f"{z:g}"]


@pytest.mark.parametrize("is_time_fastest", [False, True])
@pytest.mark.parametrize(
    "name",
    [
        "TemporalPositionIdentifier", "TriggerTime", "AcquisitionNumber", "AcquisitionTime", "ContentTime",
        "InstanceNumber",
    ],
)  # fmt: skip
def test_times_in_a_folder(tmp_path: Path, name: str, is_time_fastest: bool) -> None:
    values = planes(3, 4)
    for t in range(3):
        for k in range(4):
            when = 10 + t if name.startswith(("Temporal", "Acquisition")) else 10 + t * 4 + k  # or of each slice
            text = f"1200{when:02}" if name.endswith("Time") and name != "TriggerTime" else f"{when}"
            field = {name: when if name.startswith("Temporal") else text}
            write_slice(tmp_path, k * 3 + t if is_time_fastest else t * 4 + k, values[t, k], 2 * k, **field)
    assert read(tmp_path).note == TIMES.format(3, name)
    for t in range(3):
        volume = read(tmp_path, time=t)
        np.testing.assert_array_equal(volume.values, values[t])
        assert volume.note is None
        np.testing.assert_array_equal(volume.spacing, [0.5, 0.25, 2])
    assert refused(tmp_path, time=3).expected == "0 to 2"


def test_times_and_echoes(tmp_path: Path) -> None:
    values = planes(3, 2, 4)
    for t, echo, k in np.ndindex(3, 2, 4):
        fields = {"TemporalPositionIdentifier": t + 1, "EchoNumbers": str(echo + 1), "EchoTime": f"{5 * echo + 5}"}
        write_slice(tmp_path, 90 - (echo * 12 + k * 3 + t), values[t, echo, k], 2 * k, **fields)
    assert read(tmp_path).note == "; ".join(
        (TIMES.format(3, "TemporalPositionIdentifier"), COMPONENTS.format(2, "EchoNumbers"))
    )
    for t, echo in np.ndindex(3, 2):
        np.testing.assert_array_equal(read(tmp_path, time=t, component=echo).values, values[t, echo])


def test_directions_of_diffusion(tmp_path: Path) -> None:
    """One frame without, and three directions with a gradient."""
    values = planes(2, 4)
    directions = [None, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    for k, d in np.ndindex(2, 4):
        fields = {"DiffusionBValue": 0.0 if d == 0 else 1000.0, "DiffusionGradientOrientation": directions[d]}
        write_slice(tmp_path, k * 4 + d, values[k, d], 2 * k, **fields)
    assert read(tmp_path).note == COMPONENTS.format(4, "DiffusionBValue and DiffusionGradientOrientation")
    found = [read(tmp_path, component=c).values[0, 0, 0] for c in range(4)]
    assert found == [0, 3, 2, 1]  # directions in ascending order of x, y, z


def test_unequal_numbers_of_slices_are_refused(tmp_path: Path) -> None:
    """Neither part is a whole volume."""
    for t, k in ((0, 0), (0, 1), (1, 1), (1, 2), (2, 2)):
        write_slice(tmp_path, t * 3 + k, planes(1)[0], 2 * k, TemporalPositionIdentifier=t + 1)
    error = refused(tmp_path, match="two slices of this series are at the same position")
    assert error.got == "001.dcm and 004.dcm; there are 1 to 2 at a position"


@pytest.mark.parametrize("name", ["TemporalPositionIdentifier", "AcquisitionNumber", "InstanceNumber"])
@pytest.mark.parametrize("num_last", [1, 3])
def test_a_volume_that_was_not_finished_is_left_out(tmp_path: Path, name: str, num_last: int) -> None:
    values = planes(3, 4)
    for t, k in np.ndindex(3, 4):
        if t < 2 or k < num_last:
            number = t * 4 + k if name == "InstanceNumber" else t
            field = {name: number + 1 if name.startswith("Temporal") else str(number + 1)}
            write_slice(tmp_path, t * 4 + k, values[t, k], 2 * k, **field)
    left = f"an incomplete volume is left out: {num_last} slice{'s' * (num_last > 1)}, by {name}"
    assert read(tmp_path).note == f"{left}; {TIMES.format(2, name)}"
    for t in range(2):
        volume = read(tmp_path, time=t)
        np.testing.assert_array_equal(volume.values, values[t])
        assert volume.note == left


@pytest.mark.parametrize("num", [3, 4])
def test_a_place_that_was_not_finished_is_left_out(tmp_path: Path, num: int) -> None:
    """Times follow each other at each place, and the last place lacks one."""
    values = planes(4, num)
    for k, t in np.ndindex(4, num):
        if (k, t) != (3, num - 1):
            write_slice(tmp_path, k * num + t, values[k, t], 2 * k, InstanceNumber=str(k * num + t + 1))
    left = f"an incomplete place is left out: {num - 1} of {num} slices there"
    assert read(tmp_path).note == f"{left}; {TIMES.format(num, 'InstanceNumber')}"
    np.testing.assert_array_equal(read(tmp_path, time=1).values, values[:3, 1])


def test_slices_without_a_place_are_no_times(tmp_path: Path) -> None:
    for k in range(3):
        save(tmp_path / f"{k}.dcm", image_fields(planes(3)[k], InstanceNumber=str(3 - k)))
    error = refused(tmp_path, match="slices of this series do not say where they are")
    why = "InstanceNumber counts them, and no SpacingBetweenSlices or SliceThickness says how far apart they are"
    assert error.got == f"3 of 3 without ImagePositionPatient, such as 0.dcm; {why}"
    volume = read(tmp_path, spacing=(0.5, 0.25, 3))
    np.testing.assert_array_equal(volume.values, planes(3)[::-1])
    assert volume.note == "3 slices without ImagePositionPatient (0.dcm): InstanceNumber places them"
    np.testing.assert_array_equal(volume.spacing, [0.5, 0.25, 3])


@pytest.mark.parametrize("keyword", ["SliceLocation", "InstanceNumber"])
def test_a_slice_without_a_position_lies_by_the_next_best_field(tmp_path: Path, keyword: str) -> None:
    """Among others, whose positions say how far a number is; here each one is 2, downwards."""
    for k in range(4):
        fields: dict[str, Any] = {keyword: str(10 - k)} | ({"ImagePositionPatient": None} if k == 2 else {})
        write_slice(tmp_path, k, planes(4)[k], 2 * k, **fields)
    volume = read(tmp_path)
    np.testing.assert_array_equal(volume.values, planes(4))
    assert volume.note == f"1 slice without ImagePositionPatient (002.dcm): {keyword} places it"
    np.testing.assert_allclose(volume.world_from_index[:3, 2:], [[0, 0], [0, 0], [2, 0]], atol=1e-9)


def test_numbers_of_times_place_no_slice(tmp_path: Path) -> None:
    """Numbers run through two times: no line goes through the places."""
    for t, k in np.ndindex(2, 4):
        fields: dict[str, Any] = {"InstanceNumber": str(t * 4 + k)}
        fields |= {"ImagePositionPatient": None} if (t, k) == (1, 2) else {}
        write_slice(tmp_path, t * 4 + k, planes(8)[t * 4 + k], 2 * k, **fields)
    error = refused(tmp_path, match="slices of this series do not say where they are")
    assert error.got is not None and error.got.startswith("1 of 8 without ImagePositionPatient, such as 006.dcm; ")


def test_a_slice_that_says_no_place_is_named(tmp_path: Path) -> None:
    for k in range(4):
        place: dict[str, Any] = {"ImagePositionPatient": None} if k == 2 else {"SliceLocation": str(k)}
        write_slice(tmp_path, k, planes(4)[k], 2 * k, **place)
    error = refused(tmp_path, match="slices of this series do not say where they are")
    assert error.got == (
        "1 of 4 without ImagePositionPatient, such as 002.dcm; no SliceLocation or InstanceNumber fits"
    )


def test_blocks_far_apart_are_no_times(tmp_path: Path) -> None:
    """Slices within a block are not at one place, even if the other block is some hundred times as far."""
    for block, k in np.ndindex(2, 4):
        write_slice(tmp_path, block * 4 + k, planes(1)[0], 200 * block + 0.5 * k, InstanceNumber=str(block * 4 + k))
    refused(tmp_path, match="slices of this series are missing")


@pytest.mark.parametrize(
    ("fields", "note"),
    [
        ([{"MREcho": ("EffectiveEchoTime", 5.0 + e)} for e in range(2)], COMPONENTS.format(2, "EffectiveEchoTime")),
        (
            [{"FrameContent": ("TemporalPositionIndex", 1 + t)} for t in range(2)],
            TIMES.format(2, "TemporalPositionIndex"),
        ),
        (
            [{"CardiacSynchronization": ("NominalPercentageOfCardiacPhase", 9.0 + t)} for t in range(2)],
            TIMES.format(2, "NominalPercentageOfCardiacPhase"),
        ),
        ([{}, {}], TIMES.format(2, "frame number")),
    ],
)
def test_frames_of_one_file(tmp_path: Path, fields: list[dict[str, Any]], note: str) -> None:
    values = planes(2, 3)
    frames = [groups(PlanePosition=position(2 * k), **fields[d]) for d in range(2) for k in range(3)]
    save(tmp_path / "a.dcm", enhanced(values.reshape(6, 4, 5), frames))
    assert read(tmp_path / "a.dcm").note == note
    key = "time" if note.startswith("2 times") else "component"
    for d in range(2):
        np.testing.assert_array_equal(read(tmp_path / "a.dcm", **{key: d}).values, values[d])


def test_dimensions_that_a_file_names(tmp_path: Path) -> None:
    """Position, a time and a field of a manufacturer, of which the indices of the frames tell."""
    values = planes(2, 2, 3)
    frames = []
    for t, d, k in np.ndindex(2, 2, 3):
        content = ("DimensionIndexValues", [k + 1, 2 - t, d + 1])
        frames.append(groups(PlanePosition=position(2 * k), FrameContent=content))
    pointers = [Dataset() for _ in range(3)]
    for item, tag in zip(pointers, (0x00200032, 0x00181060, 0x20051234), strict=True):
        item.DimensionIndexPointer = tag
    save(tmp_path / "a.dcm", enhanced(values.reshape(12, 4, 5), frames, DimensionIndexSequence=pointers))
    told = "; ".join((TIMES.format(2, "TriggerTime"), COMPONENTS.format(2, "dimension 3")))
    assert read(tmp_path / "a.dcm").note == told
    for t, d in np.ndindex(2, 2):
        np.testing.assert_array_equal(read(tmp_path / "a.dcm", time=t, component=d).values, values[1 - t, d])


def test_times_of_one_slice(tmp_path: Path) -> None:
    """The position that all frames share is that of each of them: they are no stack."""
    values = planes(3)
    frames = [groups(FrameContent=("TemporalPositionIndex", t + 1)) for t in range(3)]
    dataset = enhanced(values, frames)
    shared = dataset.SharedFunctionalGroupsSequence[0]
    shared.PlanePositionSequence = groups(PlanePosition=position(7)).PlanePositionSequence
    shared.PixelMeasuresSequence[0].SpacingBetweenSlices = "2"
    save(tmp_path / "a.dcm", dataset)
    volume = read(tmp_path / "a.dcm", time=2)
    np.testing.assert_array_equal(volume.values, values[2:])
    assert volume.world_from_index[2, 3] == 7


def stacks(places: Sequence[Sequence[float]]) -> Dataset:
    """Return an enhanced image of stacks with these places, whose frames take turns as in a scanner."""
    pairs = [(s, z) for s, own in enumerate(places) for z in own]
    frames = [groups(PlanePosition=position(z), FrameContent=("StackID", str(s + 1))) for s, z in pairs]
    return enhanced(planes(len(pairs)), frames)


@pytest.mark.parametrize(
    ("places", "shape", "note"),
    [
        ([[0, 6, 12], [2, 8, 14], [4, 10, 16]], (5, 4, 9), None),  # between each other
        ([[0, 2, 4], [6, 8, 10]], (5, 4, 6), None),  # one behind the other
        ([[0, 2, 4], [0, 2, 4]], (5, 4, 3), COMPONENTS.format(2, "StackID")),  # at the same places
        ([[0, 2, 4], [4, 6, 8]], (5, 4, 3), COMPONENTS.format(2, "StackID")),  # one place in common
        ([[0, 2, 4], [50, 52, 54]], (5, 4, 3), COMPONENTS.format(2, "StackID")),  # apart
    ],
)
def test_places_decide_before_stacks(tmp_path: Path, places, shape, note) -> None:
    save(tmp_path / "a.dcm", stacks(places))
    volume = read(tmp_path / "a.dcm")
    assert (volume.shape_xyz, volume.note) == (shape, note)
    assert volume.spacing[2] == 2


def test_stacks_may_lie_anywhere(tmp_path: Path) -> None:
    values = planes(2, 3)
    axes = [[1.0, 0, 0, 0, 1, 0], [0.0, 1, 0, 0, 0, 1]]
    frames = []
    for s, k in np.ndindex(2, 3):
        frame = groups(PlaneOrientation=("ImageOrientationPatient", axes[s]), FrameContent=("StackID", str(s + 1)))
        place = [0.0, 0.0, 3.0 * k] if s == 0 else [2.0 * k, 5.0, 5.0]
        frame.PlanePositionSequence = [Dataset()]
        frame.PlanePositionSequence[0].ImagePositionPatient = place
        frames.append(frame)
    save(tmp_path / "a.dcm", enhanced(values.reshape(6, 4, 5), frames))
    assert read(tmp_path / "a.dcm").note == COMPONENTS.format(2, "StackID")
    second = read(tmp_path / "a.dcm", component=1)
    np.testing.assert_array_equal(second.values, values[1])
    np.testing.assert_array_equal(second.world_from_index[:3], [[0, 0, 2, 0], [0.5, 0, 0, 5], [0, 0.25, 0, 5]])
    np.testing.assert_array_equal(read(tmp_path / "a.dcm", component=0).spacing, [0.5, 0.25, 3])


def test_segments_leave_out_empty_slices(tmp_path: Path) -> None:
    """Slices 1 to 5 of the grid have a segment or two, and slice 3 has none."""
    places = {1: [1, 2, 4], 2: [2, 5]}
    pairs = [(number, place) for number, own in places.items() for place in own]
    frames = [
        groups(PlanePosition=position(2 * place), SegmentIdentification=("ReferencedSegmentNumber", number))
        for number, place in pairs
    ]
    save(tmp_path / "a.dcm", enhanced(np.full((5, 4, 5), 1), frames))
    for number, own in places.items():
        volume = read(tmp_path / "a.dcm", component=number - 1)
        assert volume.values[:, 0, 0].tolist() == [int(place in own) for place in range(1, 6)]
        np.testing.assert_allclose(volume.world_from_index[2, 2:], [2, 2])


def test_volumes_of_ultrasound(tmp_path: Path) -> None:
    """Their frames lie in the space of the transducer; a distance that they have, too, does not stack the times."""
    values = planes(2, 3)
    frames = []
    for t, k in np.ndindex(2, 3):
        content = ("TemporalPositionTimeOffset", 0.5 * t)
        place = ("ImagePositionVolume", [1.0, 2.0, 4.0 * k])
        frames.append(groups(PlanePositionVolume=place, TemporalPosition=content))
    dataset = enhanced(values.reshape(6, 4, 5), frames)
    shared = dataset.SharedFunctionalGroupsSequence[0]
    axes = ("ImageOrientationVolume", [0.0, 1.0, 0.0, -1.0, 0.0, 0.0])
    shared.PlaneOrientationVolumeSequence = groups(PlaneOrientationVolume=axes).PlaneOrientationVolumeSequence
    del shared.PlaneOrientationSequence
    shared.PixelMeasuresSequence[0].SpacingBetweenSlices = "4"
    save(tmp_path / "a.dcm", dataset)
    assert read(tmp_path / "a.dcm").note == TIMES.format(2, "TemporalPositionTimeOffset")
    volume = read(tmp_path / "a.dcm", time=1)
    np.testing.assert_array_equal(volume.values, values[1])
    np.testing.assert_array_equal(volume.world_from_index[:3], [[0, -0.25, 0, 1], [0.5, 0, 0, 2], [0, 0, 4, 0]])


def detector(**fields: Any) -> dict[str, Any]:
    item = Dataset()
    item.ImagePositionPatient, item.ImageOrientationPatient = ["1", "2", "3"], ["0", "1", "0", "0", "0", "1"]
    return {"DetectorInformationSequence": [item], "Modality": "NM", **fields}


@pytest.mark.parametrize("sign", [1, -1])
def test_nuclear_medicine_lies_as_its_detector(tmp_path: Path, sign: int) -> None:
    """A negative distance stacks against the normal, here -x."""
    values = planes(3)
    fields = detector(SpacingBetweenSlices=str(4 * sign), FrameIncrementPointer=0x00540080, SliceVector=[1, 2, 3])
    save(tmp_path / "a.dcm", image_fields(values, **fields))
    volume = read(tmp_path / "a.dcm")
    for k in range(3):
        index = int(np.flatnonzero(volume.values[:, 0, 0] == k)[0])
        np.testing.assert_array_equal(volume.world_from_index @ [0, 0, index, 1], [1 + 4 * sign * k, 2, 3, 1])
    np.testing.assert_array_equal(volume.world_from_index[:3, :2], [[0, 0], [0.5, 0], [0, 0.25]])


def test_vectors_of_nuclear_medicine(tmp_path: Path) -> None:
    values = planes(2, 3, 4)  # energy window, phase, slice
    window, phase, place = (index.ravel().tolist() for index in np.indices((2, 3, 4)) + 1)
    vectors = {"EnergyWindowVector": window, "PhaseVector": phase, "SliceVector": place}
    fields = detector(SpacingBetweenSlices="2", FrameIncrementPointer=[0x00540010, 0x00540030, 0x00540080], **vectors)
    save(tmp_path / "a.dcm", image_fields(values.reshape(24, 4, 5), **fields))
    told = "; ".join((TIMES.format(3, "PhaseVector"), COMPONENTS.format(2, "EnergyWindowVector")))
    assert read(tmp_path / "a.dcm").note == told
    for e, t in np.ndindex(2, 3):
        np.testing.assert_array_equal(read(tmp_path / "a.dcm", time=t, component=e).values, values[e, t])


def test_time_slots_of_one_plane(tmp_path: Path) -> None:
    fields = detector(FrameIncrementPointer=0x00540070, TimeSlotVector=[1, 2, 3])
    save(tmp_path / "a.dcm", image_fields(planes(3), **fields))
    assert read(tmp_path / "a.dcm").note == TIMES.format(3, "TimeSlotVector")
    np.testing.assert_array_equal(read(tmp_path / "a.dcm", time=1).values, planes(3)[1:2])


def siemens_header(normal: Sequence[float]) -> bytes:
    """Return a header of Siemens, `SV10`, with one field of three numbers."""
    items = b"".join(struct.pack("<4i", 8, 8, 77, 8) + f"{number:8.4f}".encode() for number in normal)
    tag = struct.pack("<64si4s3i", b"SliceNormalVector", 3, b"FD", 4, 3, 77)
    return b"SV10\4\3\2\1" + struct.pack("<2I", 1, 77) + tag + items


def mosaic(values: Array, **fields: Any) -> Dataset:
    """Return a mosaic of slices [k, y, x], row by row."""
    num, height, width = values.shape
    side = int(np.ceil(np.sqrt(num)))
    image = np.zeros((side * height, side * width), values.dtype)
    for k in range(num):
        y, x = divmod(k, side)
        image[y * height : (y + 1) * height, x * width : (x + 1) * width] = values[k]
    # The middle of the first slice is at (10, 20, 30), and so is that of the mosaic: the pixels are 0.5 x 0.25.
    place = [10 - 0.5 * (side * width - 1) / 2, 20 - 0.25 * (side * height - 1) / 2, 30]
    named = {"ImageType": ["ORIGINAL", "PRIMARY", "M", "MOSAIC"], "ImagePositionPatient": place}
    named |= {"ImageOrientationPatient": AXES, "SpacingBetweenSlices": "3"}
    return image_fields(image, **(named | fields))


def numbered(dataset: Dataset, num: int | None, header: bytes | None = None) -> Dataset:
    if num is not None:
        dataset.add_new(0x00190010, "LO", "SIEMENS MR HEADER")
        dataset.add_new(0x0019100A, "US", num)
    if header is not None:
        dataset.add_new(0x00290010, "LO", "SIEMENS CSA HEADER")
        dataset.add_new(0x00291010, "OB", header)
    return dataset


@pytest.mark.parametrize("sign", [0, 1, -1])
def test_mosaics_are_volumes(tmp_path: Path, sign: int) -> None:
    values = np.arange(7 * 4 * 5, dtype=np.int16).reshape(7, 4, 5)
    header = siemens_header([0, 0, sign]) if sign else None
    save(tmp_path / "a.dcm", numbered(mosaic(values), 7, header))
    volume = read(tmp_path / "a.dcm")
    assert volume.note is None
    np.testing.assert_array_equal(volume.values, values[:: sign or 1])
    first = 0 if sign >= 0 else 6
    np.testing.assert_allclose(volume.world_from_index @ [2, 1.5, first, 1], [10, 20, 30, 1])
    np.testing.assert_allclose(volume.spacing, [0.5, 0.25, 3])


def test_mosaics_without_a_number(tmp_path: Path) -> None:
    values = np.arange(4 * 4 * 4, dtype=np.int16).reshape(4, 4, 4)
    matrix = {"AcquisitionMatrix": [4, 0, 0, 4]}
    save(tmp_path / "a.dcm", mosaic(values, SpacingBetweenSlices=None, SliceThickness="5", **matrix))
    volume = read(tmp_path / "a.dcm")
    np.testing.assert_array_equal(volume.values, values)
    assert volume.note == (
        "a mosaic that does not say how many slices it has; all of its 4 tiles are taken for slices; "
        "a mosaic without a distance of slices; their thickness is taken"
    )
    assert volume.spacing[2] == 5
    save(tmp_path / "b.dcm", numbered(mosaic(values), 26))
    refused(tmp_path / "b.dcm", match="this mosaic cannot be parted into its slices")


def test_mosaics_in_a_folder_are_times(tmp_path: Path) -> None:
    values = planes(3, 7)
    for t in range(3):
        save(tmp_path / f"{t}.dcm", numbered(mosaic(values[t], AcquisitionNumber=str(3 - t)), 7))
    assert read(tmp_path).note == TIMES.format(3, "AcquisitionNumber")
    for t in range(3):
        np.testing.assert_array_equal(read(tmp_path, time=t).values, values[2 - t])


@pytest.mark.parametrize(
    ("axis", "name", "axes"),
    [(0, "sagittal", "0 1 0 0 0 -1"), (1, "coronal", "1 0 0 0 0 -1"), (2, "axial", "1 0 0 0 1 0")],
)
def test_places_tell_directions_where_nothing_else_does(tmp_path: Path, axis: int, name: str, axes: str) -> None:
    """The picture is that of a file which says them."""
    for is_said in (False, True):
        folder = tmp_path / str(is_said)
        folder.mkdir()
        for k in range(3):
            place = ["0", "0", "0"]
            place[axis] = str(2 * k)
            fields = {"ImagePositionPatient": place, "ImageOrientationPatient": axes.split() if is_said else None}
            write_slice(folder, k, planes(3)[k], 0, **fields)
    volume, said = read(tmp_path / "False"), read(tmp_path / "True")
    np.testing.assert_array_equal(volume.values, said.values)
    np.testing.assert_array_equal(volume.world_from_index, said.world_from_index)
    assert (volume.note, said.note) == (
        f"no ImageOrientationPatient; by their positions these are taken for {name} slices",
        None,
    )
    assert volume.world_axes == ""


def test_files_of_frames_beside_slices_are_left_out(tmp_path: Path) -> None:
    for k in range(4):
        write_slice(tmp_path, k, planes(4)[k], 2 * k)
    for k in range(2):
        save(tmp_path / f"frames{k}.dcm", image_fields(planes(3), uid=f"1.{k}", SpacingBetweenSlices="1"))
    volume = read(tmp_path)
    np.testing.assert_array_equal(volume.values, planes(4))
    assert volume.note == "left out of this series: 2 files of several frames (frames0.dcm)"
