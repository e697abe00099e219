"""Find the frames in a DICOM file: where each lies, and what its stored values mean.

An ordinary file has one frame. Enhanced files have one set of functional groups for each frame, and one that they
share (PS3.3, C.7.6.16). Other files of several frames have the distance between them, or an offset for each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError, require_package
from renderer.readers.dicom_fields import (
    FRAME_GROUPS,
    ORIENTATION,
    POSITION,
    SHARED_GROUPS,
    Dataset,
    Dimension,
    Mark,
    declared_dimensions,
    frame_marks,
    groups_of,
    kind_without_pixels,
    no_volume_error,
    numbers_in,
    numbers_of,
    open_dicom,
    text_of,
    unreadable_slice,
    value_of,
    vectors_of,
)
from renderer.scene import short_text
from renderer.volume import Array, Float64

# Fields by number, of which some kinds of images have their pixel spacing, down and across, in others than the first.
_IN_PLANE = (0x00280030, 0x00181164, 0x00182010, 0x30020011)
_BETWEEN_SLICES, _FRAME_OFFSETS, _SLICE_VECTOR, _DETECTORS = 0x00180088, 0x3004000C, 0x00540080, 0x00540022
_INTERCEPT, _SLOPE, _DOSE_SLOPE = 0x00281052, 0x00281053, 0x3004000E
_PHOTOMETRIC = 0x00280004
# The value of padding and the other end of its range, of integers and of floats.
_PADDING = ((0x00280120, 0x00280121), (0x00280122, 0x00280124), (0x00280123, 0x00280125))

# How files of several frames that say nothing else are told apart: by their order in the file.
_FRAME_NUMBER = Dimension("t", "frame number", is_order=True)

# Fields without which pydicom decodes no pixels, and what they are where a writer left them out.
_USUAL = {"SamplesPerPixel": 1, "PhotometricInterpretation": "MONOCHROME2", "PixelRepresentation": 0}


@dataclass(frozen=True)
class Frame:
    """A slice of a DICOM file.

    number: of its frame there, or None for an empty slice. size: pixels across and down. dtype: of its rescaled values.
    position: of its first pixel, float64 [3]. across, down: to the next pixel, float64 [3]. thickness: along the
        normal, if the file gives it; else 1. padding: the ends of the stored values that stand for no data.
    marks: what tells it from other frames at its place. corner: the pixel across and down where it begins in the
        stored frame. notes: remarks on how it was read; None stands for none.
    """

    file: Path
    number: int | None
    size: tuple[int, int]
    num_samples: int
    slope: float
    intercept: float
    dtype: np.dtype[Any]
    position: Float64
    across: Float64
    down: Float64
    thickness: float
    padding: tuple[float, float] | None = None
    marks: dict[Dimension, Mark] = field(default_factory=dict)
    corner: tuple[int, int] = (0, 0)
    notes: tuple[str | None, ...] = ()

    @property
    def label(self) -> str:
        """Return the name of the frame in messages."""
        return self.file.name + (f", frame {self.number + 1}" if self.number else "")

    @property
    def spacing(self) -> tuple[float, float]:
        """Return the distance of pixels across and down."""
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

    @property
    def nodata(self) -> tuple[float, float] | None:
        """Return the ends of the rescaled values that stand for no data; None if none do."""
        if self.padding is None:
            return None
        low, high = sorted(end * self.slope + self.intercept for end in self.padding)
        return low, high

    def stored(self, pixels: Array, channel: int) -> Array:
        """Return its stored values [y, x], a part of those of its file."""
        x, y = self.corner
        return pixels[self.number or 0, y : y + self.size[1], x : x + self.size[0], channel]

    def rescaled(self, stored: Array) -> Array:
        """Return the values of stored pixels, in the frame's dtype; raises InputError for floats in a file whose fields
        are those of integers."""
        if stored.dtype.kind == "f" and self.dtype.kind != "f":
            raise unreadable_slice(self.file, "save it again without BitsStored", "floats with the fields of integers")
        if self.slope == 1.0 and self.intercept == 0.0:
            return stored
        return np.asarray(stored * self.slope + self.intercept).astype(self.dtype)


def frames_of(path: Path, *, has_spacing_override: bool) -> list[Frame]:
    """Return the frames of a file in their order there.

    has_spacing_override: the scene gives the spacing; lengths that the file does not give are 1. Otherwise raises
        InputError for such lengths, as for damaged files and for files without pixels.
    """
    dataset, has_pixels = open_dicom(path)
    kind = kind_without_pixels(dataset)
    if kind is not None:
        raise no_volume_error(path, kind)
    syntax = dataset.file_meta.get("TransferSyntaxUID")
    if not has_pixels and not (syntax is not None and syntax.is_deflated):
        raise unreadable_slice(path)
    try:
        count = int(dataset.get("NumberOfFrames") or 1)
        shared, *_ = groups_of(dataset, SHARED_GROUPS) or [[]]
        each = groups_of(dataset, FRAME_GROUPS) or [[]] * count
        size, num_samples = (int(dataset.Columns), int(dataset.Rows)), int(dataset.get("SamplesPerPixel") or 1)
        if min(*size, num_samples, count) < 1 or len(each) != count:
            raise ValueError
    except (AttributeError, ValueError, TypeError) as error:
        raise unreadable_slice(path) from error
    detector = dataset[_DETECTORS].value[:1] if _DETECTORS in dataset else []
    dimensions, vectors = declared_dimensions(dataset), vectors_of(dataset, count)
    places, offsets = _places(dataset, vectors, count), numbers_of([dataset], _FRAME_OFFSETS)
    offsets = offsets if len(offsets) == count else []
    padding, marks_of_all = _padding(dataset), frame_marks([*shared, dataset], ())
    frames = []
    for number, own in enumerate(each):
        fields = [*own, *shared, dataset, *detector]
        has_position = any(POSITION in group for group in (*own, *shared))
        needs_distance = not (has_position or offsets) and any(places)
        pair, between = _lengths(path, fields, count if needs_distance else 1, is_needed=not has_spacing_override)
        orientation = numbers_of(fields, ORIENTATION)
        row, column = np.reshape(orientation if len(orientation) == 6 else [1, 0, 0, 0, 1, 0], (2, 3))
        position = np.array((numbers_of(fields, POSITION) or [0.0, 0.0, 0.0])[:3])
        if not has_position:
            normal = np.cross(row, column)
            step = _offset(offsets, number, position, normal) if offsets else places[number] * between
            position = position + step * normal
        slopes = numbers_of(fields, _SLOPE) or numbers_of(fields, _DOSE_SLOPE) or [0.0]
        slope, intercept = slopes[0] or 1.0, (numbers_of(fields, _INTERCEPT) or [0.0])[0]
        own_marks = vectors.get(number, {}) | (frame_marks(own, dimensions) if own else {})
        marks = own_marks | marks_of_all | own_marks  # the first that tells frames apart is more often their own
        marks |= {_FRAME_NUMBER: ([number], "")} if count > 1 else {}
        frames.append(
            Frame(
                file=path,
                number=number,
                size=size,
                num_samples=num_samples,
                slope=slope,
                intercept=intercept,
                dtype=_rescaled_dtype(dataset, slope, intercept),
                position=position,
                across=row * pair[1],
                down=column * pair[0],
                thickness=abs(between),
                padding=padding,
                marks=marks,
            )
        )
    return frames


def _places(dataset: Dataset, vectors: dict[int, dict[Dimension, Mark]], count: int) -> Sequence[float]:
    """Return for each frame of a file its number among the slices of its volume, from 0 on, unless positions tell."""
    numbers = numbers_in(value_of([dataset], _SLICE_VECTOR))
    if len(numbers) == count:
        return [number - 1 for number in numbers]
    return [0.0] * count if any(marks != vectors[0] for marks in vectors.values()) else range(count)


def _offset(offsets: list[float], number: int, position: Float64, normal: Float64) -> float:
    """Return how far along the normal a frame is from the position of the first one.

    Offsets that begin with 0 are relative, and others are z in the world where frames lie across it (PS3.3, C.8.8.3.2).
    """
    if offsets[0] == 0.0 or abs(normal[2]) < 0.999:
        return offsets[number] - offsets[0]
    return float((offsets[number] - position[2]) * np.sign(normal[2]))


def _lengths(path: Path, fields: list[Dataset], count: int, *, is_needed: bool) -> tuple[list[float], float]:
    """Return the spacing down and across, and the distance of frames, which may be negative.

    count: of the frames that need a distance. Raises InputError if the file does not give them and they are needed.
    """
    pair = next((found for tag in _IN_PLANE if len(found := numbers_of(fields, tag)) == 2 and min(found) > 0), [])
    between = numbers_of(fields, _BETWEEN_SLICES)
    distance = between[0] if len(between) == 1 else 0.0
    got = None
    if not pair:
        text = next((text for each in fields if (text := text_of(each, _IN_PLANE[0])) is not None), None)
        got = "no PixelSpacing" if text is None else f"PixelSpacing = {short_text(text)}"
    elif count > 1 and distance == 0.0:
        got = f"{count} frames without SpacingBetweenSlices or functional groups"
    if got is None or not is_needed:
        return pair or [1.0, 1.0], distance if got is None and distance else 1.0
    raise InputError(
        "this DICOM file does not give its voxel size",
        where=str(path),
        got=got,
        expected="PixelSpacing of two positive numbers, and of several frames how far apart they are",
        hint="`spacing: [x, y, z]` replaces the spacing in the file",
    )


def _padding(dataset: Dataset) -> tuple[float, float] | None:
    """Return the ends of the stored values of gray pixels that stand for no data; None if none do.

    Those of integers have 16 bits, with a sign if the pixels have one, whatever the type of the field says.
    """
    if not (text_of(dataset, _PHOTOMETRIC) or "MONOCHROME").startswith("MONOCHROME"):
        return None
    is_signed = bool(dataset.get("PixelRepresentation"))
    for tags in _PADDING[:1] if "BitsStored" in dataset else _PADDING[1:]:
        value, limit = (numbers_in(value_of([dataset], tag)) for tag in tags)
        if len(value) == 1:
            ends = np.array([*value, *(limit or value)[:1]])
            if "BitsStored" in dataset:
                ends = (ends + 2**15) % 2**16 - 2**15 if is_signed else ends % 2**16
            return float(ends[0]), float(ends[1])
    return None


def _rescaled_dtype(dataset: Dataset, slope: float, intercept: float) -> np.dtype[Any]:
    """Return the dtype of rescaled values: the smallest of integers if both numbers are whole, else float64.

    Files of floats have no BitsStored.
    """
    bits, stored = int(dataset.get("BitsAllocated") or 16), int(dataset.get("BitsStored") or 16)
    if not 1 <= stored <= bits or bits not in (1, 8, 16, 32, 64):
        raise unreadable_slice(Path(dataset.filename), got=f"{stored} of {bits} bits")
    is_signed = bool(dataset.get("PixelRepresentation"))
    is_neutral = slope == 1.0 and intercept == 0.0
    if "BitsStored" not in dataset:
        return np.dtype("f4" if bits == 32 and is_neutral else "f8")
    if is_neutral:
        return np.dtype(f"{'i' if is_signed else 'u'}{max(bits, 8) // 8}")
    low, high = (-(2 ** (stored - 1)), 2 ** (stored - 1) - 1) if is_signed else (0, 2**stored - 1)
    low, high = sorted((low * slope + intercept, high * slope + intercept))
    if slope.is_integer() and intercept.is_integer():
        for name in ("u1", "u2", "u4") if low >= 0 else ("i1", "i2", "i4"):
            if np.iinfo(name).min <= low and high <= np.iinfo(name).max:
                return np.dtype(name)
    return np.dtype(np.float64)


def pixels_of(path: Path) -> Array:
    """Return the stored pixels of a file, [frame, y, x, sample]; raises InputError if they cannot be decoded."""
    dataset, _ = open_dicom(path, with_pixels=True)
    syntax = dataset.file_meta.get("TransferSyntaxUID")
    if syntax is None:  # without a preamble
        dataset.file_meta.TransferSyntaxUID = _plain_syntax(dataset)
    for keyword, usual in _USUAL.items():
        dataset.setdefault(keyword, usual)
    try:
        pixels = np.asarray(dataset.pixel_array)
    except Exception as error:  # of its decoders
        if syntax is not None and syntax.is_compressed and not syntax.is_deflated and "RLE" not in syntax.name:
            require_package("gdcm", extra="dicom")
        raise unreadable_slice(path) from error
    samples = int(dataset.get("SamplesPerPixel") or 1)
    frames = int(dataset.get("NumberOfFrames") or 1)
    pixels = pixels.reshape(-1, int(dataset.Rows), int(dataset.Columns), samples)
    return _without_unused_bits(pixels[:frames], dataset)  # what is left over may be padding


def _plain_syntax(dataset: Dataset) -> Any:
    """Return the transfer syntax without compression in which a dataset was read."""
    from pydicom.uid import ExplicitVRBigEndian, ExplicitVRLittleEndian, ImplicitVRLittleEndian

    is_implicit, is_little = dataset.original_encoding
    return ImplicitVRLittleEndian if is_implicit else ExplicitVRLittleEndian if is_little else ExplicitVRBigEndian


def _without_unused_bits(pixels: Array, dataset: Dataset) -> Array:
    """Return the values of the stored bits alone: others may hold overlays, and the sign may not reach into them."""
    stored = int(dataset.get("BitsStored") or 16)
    unused = 8 * pixels.itemsize - stored
    if pixels.dtype.kind == "f" or unused <= 0:
        return pixels
    shift = int(dataset.get("HighBit") or stored - 1) + 1 - stored
    return np.right_shift(np.left_shift(pixels, unused - shift), unused)
