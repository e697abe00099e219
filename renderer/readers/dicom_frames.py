"""Find the frames in a DICOM file: the place of each, and the meaning of its stored values.

An ordinary file has one frame. Enhanced files have a set of functional groups for each frame, and a set that all frames
share (PS3.3, C.7.6.16). Other files of several frames have the distance between frames, or an offset for each frame;
or their frames are times of one plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import GUESSED_LENGTHS
from renderer.readers.dicom_fields import (
    Dataset,
    Dimension,
    Mark,
    declared_dimensions,
    first_numbers,
    frame_marks,
    groups_of,
    numbers_of,
    open_dicom,
    text_of,
    times_in,
    unreadable_slice,
    value_unit_in,
    vectors_of,
)
from renderer.readers.dicom_kinds import require_image, run_of, times_of_run
from renderer.readers.dicom_orientation import axes_of
from renderer.readers.dicom_pixels import has_palette, palette_dtype
from renderer.readers.dicom_statements import stated_in
from renderer.readers.dicom_values import Scale, has_value_of_air, scale_of
from renderer.readers.units import Units, units_of
from renderer.scene import short_text
from renderer.volume import Array, Float64

# The fields with the position of a frame, the usual one first.
_POSITIONS = ("ImagePositionPatient", "ImagePositionVolume")

# The fields with the pixel spacing, down and across, the usual one first.
_IN_PLANE = ("PixelSpacing", "ImagerPixelSpacing", "NominalScannedPixelSpacing", "ImagePlanePixelSpacing")

# Sequences whose first item holds fields that apply to all frames.
_ITEMS = ("DetectorInformationSequence", "RealWorldValueMappingSequence")

# The fields with the size of an image, named in the message about a damaged header.
_SIZES = ("Rows", "Columns", "SamplesPerPixel", "NumberOfFrames")

# The fields that place a slice in a file of its own if it has no position, in the order in which they are tried.
PLACE_KEYS = ("SliceLocation", "InstanceNumber")

# The dimension that is tried last to distinguish frames of one file at one place: their order in the file.
_FRAME_NUMBER = Dimension("frame number", "t", is_order=True)
# The note on a file whose slice thickness replaces the missing distance between slices.
_THICK = "the file does not give the distance of its slices; their thickness (SliceThickness) is taken"
# The note on a file whose numbers of slices in a stack replace the missing positions.
_IN_STACK = "the slices have no positions; their InStackPositionNumber is taken"


@dataclass(frozen=True)
class Frame:
    """A frame: one slice of a DICOM file.

    number: the index of the stored frame in the file, or None for an empty slice.
    size: pixels across and down.
    num_samples: samples of a pixel.
    scale: the map from stored values to values.
    position: the centre of the first pixel, float64 [3].
    across, down: the steps to the next pixel, float64 [3].
    thickness: the distance to the next slice, or the thickness of this one; 1 if the file gives neither.
    has_thickness: whether the file gives the thickness, or the scene the spacing.
    marks: the value of each dimension that may distinguish the slice from others at its place.
    corner: the pixel across and down at which the slice begins in the stored frame.
    notes: remarks on how the slice was read; None stands for no remark.
    times: the times of the slice, each under the keyword of its field.
    units: the units of lengths and values.
    has_place: whether the file gives the position; else `keys` has the fields of PLACE_KEYS.
    has_axes: whether the file gives the directions, or gives neither directions nor a position.
    keys: the numbers of the fields of PLACE_KEYS.
    stated: the names of fields in the file that change how voxels are understood, but are not applied
        (`dicom_statements.py`).
    space: the UID of the frame of reference: positions with the same UID are in the same coordinates.
    has_colors: whether the samples are red, green and blue.
    segment: the number of the segment of the slice.
    """

    file: Path
    number: int | None
    size: tuple[int, int]
    num_samples: int
    scale: Scale
    position: Float64
    across: Float64
    down: Float64
    thickness: float
    has_thickness: bool = False
    marks: dict[Dimension, Mark] = field(default_factory=dict)
    corner: tuple[int, int] = (0, 0)
    notes: tuple[str | None, ...] = ()
    times: dict[str, float] = field(default_factory=dict)
    units: Units = field(default=Units())
    has_place: bool = True
    has_axes: bool = True
    keys: dict[str, float] = field(default_factory=dict)
    stated: frozenset[str] = frozenset()
    space: str = ""
    has_colors: bool = False
    segment: int = 1

    @property
    def label(self) -> str:
        """Return the name of the frame in messages."""
        return self.file.name + (f", frame {self.number + 1}" if self.number else "")

    @property
    def spacing(self) -> tuple[float, float]:
        """Return the distances between pixels across and down."""
        return float(np.linalg.norm(self.across)), float(np.linalg.norm(self.down))

    @property
    def orientation(self) -> list[float]:
        """Return the unit vectors across and down, one after the other."""
        across, down = self.spacing
        return [*(self.across / across).tolist(), *(self.down / down).tolist()]

    @property
    def normal(self) -> Float64:
        """Return the unit normal of the frame, float64 [3]."""
        normal = np.cross(self.across, self.down)
        return np.asarray(normal / np.linalg.norm(normal), np.float64)

    def part_of(self, pixels: Array, channel: int) -> Array:
        """Return the stored values [y, x] of the slice. pixels: the stored frame, [y, x, sample]."""
        x, y = self.corner
        return pixels[y : y + self.size[1], x : x + self.size[0], channel]


class _File(NamedTuple):
    """The properties that the frames of a file share.

    shared: the functional groups that all frames share.
    items: the first items of the sequences _ITEMS: a detector with its place, and a scale to a real unit.
    dimensions: the dimensions that the file declares.
    vectors: the vectors of nuclear medicine, with a number for each frame.
    places: the index of each frame among the slices of its volume.
    offsets: the distance of each frame of a dose from the first, or its z in the patient.
    run: for times of one plane, the dimension that distinguishes them and a note; None for slices.
    run_times: the time of each frame of a run.
    notes: remarks on the whole file; None stands for no remark.
    """

    path: Path
    dataset: Dataset
    num_frames: int
    size: tuple[int, int]
    num_samples: int
    shared: list[Dataset]
    items: list[Dataset]
    dimensions: list[Dimension]
    vectors: dict[Dimension, list[float]]
    places: Sequence[float]
    offsets: list[float]
    run: tuple[Dimension, str] | None
    run_times: list[float]
    is_palette: bool
    notes: tuple[str | None, ...]


def frames_of(path: Path, *, has_spacing_override: bool) -> list[Frame]:
    """Return the frames of a file in the order in which it stores them.

    has_spacing_override: the scene gives the spacing, and lengths that the file does not give are 1. Raises InputError
        for damaged files, for files without pixels, and for missing lengths that the scene does not give.
    """
    dataset, has_pixels = open_dicom(path)
    require_image(path, dataset, has_pixels=has_pixels)
    file, each = _read_layout(path, dataset)
    marks_of_all = frame_marks([*file.shared, dataset], ())
    frames = []
    for number, own in enumerate(each):
        frame = _frame(file, number, own, is_needed=not has_spacing_override)
        marks = {each: ([numbers[number]], "") for each, numbers in file.vectors.items()}
        marks |= {file.run[0]: ([number], "")} if file.run else {}
        marks |= frame_marks(own, file.dimensions)
        marks = marks | marks_of_all | marks  # the frame's own values come first, and replace those of all frames
        marks |= {_FRAME_NUMBER: ([number], "")} if file.num_frames > 1 else {}
        frames.append(replace(frame, marks=marks))
    return frames


def _read_layout(path: Path, dataset: Dataset) -> tuple[_File, list[list[Dataset]]]:
    """Return the properties that all frames share, and the functional groups of each frame.

    Raises InputError for damaged fields.
    """
    try:
        count = int(dataset.get("NumberOfFrames") or 1)
        shared, *_ = groups_of(dataset, "SharedFunctionalGroupsSequence") or [[]]
        each = groups_of(dataset, "PerFrameFunctionalGroupsSequence") or [[]] * count
        size, num_samples = (int(dataset.Columns), int(dataset.Rows)), int(dataset.get("SamplesPerPixel") or 1)
        if min(*size, num_samples, count) < 1:
            raise ValueError
    except (AttributeError, ValueError, TypeError) as error:
        got = ", ".join(f"{each} = {short_text(text_of([dataset], each)) or 'none'}" for each in _SIZES)
        raise unreadable_slice(path, "its header is damaged, or holds no image", got) from error
    if len(each) != count:
        got = f"PerFrameFunctionalGroupsSequence of {len(each)} items, and {count} frames"
        raise unreadable_slice(path, "its header is damaged: export it again", got)
    vectors, is_palette = vectors_of(dataset, count), has_palette(dataset)
    places, note = _places(dataset, vectors, each)
    has_position = any(keyword in group for own in (shared, *each) for group in own for keyword in _POSITIONS)
    run = None if has_position else run_of(dataset, count)
    file = _File(
        path,
        dataset,
        count,
        size,
        3 if is_palette else num_samples,
        shared,
        items=[item for keyword in _ITEMS for item in (dataset.get(keyword) or [])[:1]],
        dimensions=declared_dimensions(dataset),
        vectors=vectors,
        places=places,
        offsets=numbers_of([dataset], "GridFrameOffsetVector"),
        run=run,
        run_times=times_of_run(dataset, count) if run else [],
        is_palette=is_palette,
        notes=(run[1] if run else None, None if has_position or run else note),
    )
    return file, each


def _frame(file: _File, number: int, own: list[Dataset], *, is_needed: bool) -> Frame:
    """Return a frame without `marks`, its values of dimensions. is_needed: whether missing lengths raise InputError."""
    dataset = file.dataset
    fields = [*own, *file.shared, dataset, *file.items]
    has_own = any(keyword in group for keyword in _POSITIONS for group in (*own, *file.shared))
    has_offset = len(file.offsets) == file.num_frames and not has_own
    is_stacked = not (has_own or has_offset or file.run) and any(file.places)
    lengths = _lengths(file, fields, is_stacked=is_stacked, is_needed=is_needed)
    axes = axes_of(fields)
    normal = np.cross(axes.row, axes.column)
    position = np.array(first_numbers(fields, _POSITIONS, [0.0, 0.0, 0.0]))
    if has_offset:
        # Offsets that begin with 0 are distances along the normal; others are z in the patient (PS3.3, C.8.8.3.2).
        step = file.offsets[number] - file.offsets[0]
        position += (-step if file.offsets[0] != 0 and normal[2] < -0.999 else step) * normal
    elif is_stacked:
        position += file.places[number] * lengths.between * normal
    scale = scale_of(file.path, fields, dataset)
    scale = replace(scale, dtype=palette_dtype(dataset)) if file.is_palette else scale
    times = {"FrameTime": file.run_times[number]} if file.run_times else times_in(fields)
    length_unit, world_axes = "mm" * lengths.are_stated, "LPS" * axes.are_of_patient
    value_unit = value_unit_in(fields, scale.unit, may_be_air=has_value_of_air(dataset, scale))
    units = units_of(length_unit, world_axes, value_unit)
    keys = {keyword: numbers[0] for keyword in PLACE_KEYS if (numbers := numbers_of(fields, keyword))}
    has_stated = any(len(numbers_of(fields, keyword)) == 3 for keyword in _POSITIONS)
    photometric = text_of([dataset], "PhotometricInterpretation")
    return Frame(
        file.path,
        number,
        file.size,
        file.num_samples,
        scale,
        position,
        axes.row * lengths.across,
        axes.column * lengths.down,
        abs(lengths.between),
        has_thickness=lengths.has_between,
        notes=(*file.notes, lengths.note, axes.note, scale.note),
        times=times,
        units=units,
        has_place=has_stated or file.num_frames > 1,
        has_axes=axes.are_known or not has_stated,
        keys=keys,
        stated=stated_in(fields, has_place=has_stated or file.num_frames > 1, has_axes=axes.are_known),
        space=text_of(fields, "FrameOfReferenceUID"),
        segment=max(1, int(first_numbers(fields, ["ReferencedSegmentNumber"], [1.0])[0])),
        has_colors=file.num_samples == 3 and (file.is_palette or photometric.startswith(("RGB", "YBR"))),
    )


def _places(
    dataset: Dataset, vectors: dict[Dimension, list[float]], each: list[list[Dataset]]
) -> tuple[Sequence[float], str | None]:
    """Return the index of each frame among the slices of its volume, for a file without positions, and a note or None.

    The note names the field of the indices if it is not the usual one (SliceVector).
    """
    numbers = numbers_of([dataset], "SliceVector")
    if len(numbers) == len(each):
        return [number - 1 for number in numbers], None
    stacked = [numbers_of(own, "InStackPositionNumber") for own in each]
    if all(stacked) and len({number[0] for number in stacked}) > 1:
        return [number[0] - 1 for number in stacked], _IN_STACK
    are_others = any(len(set(numbers)) > 1 for numbers in vectors.values())
    return [0.0] * len(each) if are_others else range(len(each)), None


class _Lengths(NamedTuple):
    """The lengths of a voxel.

    across, down: the lengths of a pixel. between: the distance between frames, which may be negative; 1 without
    `has_between`. note: a remark on lengths that the file does not give. are_stated: whether the file gives the lengths
    of pixels.
    """

    across: float
    down: float
    between: float
    has_between: bool
    note: str | None = None
    are_stated: bool = True


def _lengths(file: _File, fields: list[Dataset], *, is_stacked: bool, is_needed: bool) -> _Lengths:
    """Return the lengths of the voxels of a frame.

    is_stacked: whether the place of the frame depends on the distance between frames. is_needed: whether missing
    lengths raise InputError; pixels of a run without lengths are 1 x 1 instead.
    """
    pairs = (numbers_of(fields, keyword) for keyword in _IN_PLANE)
    pair = next((found for found in pairs if len(found) == 2 and min(found) > 0), [])
    stated, thick = (first_numbers(fields, [each], [0.0])[0] for each in ("SpacingBetweenSlices", "SliceThickness"))
    thick *= "LOCALIZER" not in text_of(fields, "ImageType")  # a localizer may state the thickness of the body
    between, note = stated or max(thick, 0.0), _THICK if is_stacked and not stated and thick > 0 else None
    got = None
    if not pair and file.run:
        aspect = numbers_of(fields, "PixelAspectRatio")  # the height of a pixel, and its width
        ratio = aspect[0] / aspect[1] if len(aspect) == 2 and min(aspect) > 0 else 1.0
        by = " by PixelAspectRatio" * (ratio != 1.0)
        has_regions = any(each.get("SequenceOfUltrasoundRegions") for each in fields)
        parts = " but for parts of the picture" * has_regions
        note = f"{GUESSED_LENGTHS}{parts}; 1 x {ratio:g} x 1 is assumed{by}"
        return _Lengths(1.0, ratio, between or 1.0, between != 0.0, note, are_stated=False)
    if not pair:
        text = text_of(fields, _IN_PLANE[0])
        got = f"PixelSpacing = {short_text(text)}" if text else "no PixelSpacing"
    elif is_stacked and between == 0.0:
        got = f"{file.num_frames} frames without SpacingBetweenSlices or functional groups"
    if got is None or not is_needed:
        down, across = pair or [1.0, 1.0]
        return _Lengths(across, down, between or 1.0, between != 0.0 or not is_needed, note, are_stated=bool(pair))
    raise InputError(
        "this DICOM file does not give its voxel size",
        where=str(file.path),
        got=got,
        expected="PixelSpacing of two positive numbers, and of several frames how far apart they are",
        hint="`spacing: [x, y, z]` replaces the spacing in the file",
    )
