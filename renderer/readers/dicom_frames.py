"""Find the frames in a DICOM file: where each lies, and what its stored values mean.

An ordinary file has one frame. Enhanced files have one set of functional groups for each frame, and one that they
share (PS3.3, C.7.6.16). Other files of several frames have the distance between them, or an offset for each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError, require_package
from renderer.readers.dicom_fields import (
    Dataset,
    Dimension,
    Mark,
    declared_dimensions,
    frame_marks,
    groups_of,
    kind_without_pixels,
    no_volume_error,
    numbers_of,
    open_dicom,
    text_of,
    times_in,
    units_in,
    unreadable_slice,
    vectors_of,
)
from renderer.readers.units import Units
from renderer.scene import short_text
from renderer.volume import Array, Float64

# Some kinds of images have their place, and their pixel spacing, down and across, in another field than the first.
_POSITIONS = ("ImagePositionPatient", "ImagePositionVolume")
_ORIENTATIONS = ("ImageOrientationPatient", "ImageOrientationVolume")
_IN_PLANE = ("PixelSpacing", "ImagerPixelSpacing", "NominalScannedPixelSpacing", "ImagePlanePixelSpacing")

# How files of several frames that say nothing else are told apart: by their order in the file.
_FRAME_NUMBER = Dimension("frame number", "t", is_order=True)

# Fields without which pydicom decodes no pixels, and what they are where a writer left them out.
_USUAL = {"SamplesPerPixel": 1, "PhotometricInterpretation": "MONOCHROME2", "PixelRepresentation": 0}


@dataclass(frozen=True)
class Frame:
    """A slice of a DICOM file.

    number: of its frame there, or None for an empty slice. size: pixels across and down. dtype: of its rescaled values.
    position: of its first pixel, float64 [3]. across, down: to the next pixel, float64 [3]. thickness: along the
        normal, if the file gives it; else 1. padding: the ends of the stored values that stand for no data.
    marks: what tells it from other frames at its place. corner: the pixel across and down where it begins in the
        stored frame. notes: remarks on how it was read; None stands for none. times: when it was taken, by keywords.
    units: of its lengths and values.
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
    times: dict[str, float] = field(default_factory=dict)
    units: Units = field(default=Units())

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
    if kind:
        raise no_volume_error(path, kind)
    syntax = dataset.file_meta.get("TransferSyntaxUID")
    if not has_pixels and not (syntax is not None and syntax.is_deflated):
        raise unreadable_slice(path)
    try:
        count = int(dataset.get("NumberOfFrames") or 1)
        shared, *_ = groups_of(dataset, "SharedFunctionalGroupsSequence") or [[]]
        each = groups_of(dataset, "PerFrameFunctionalGroupsSequence") or [[]] * count
        size, num_samples = (int(dataset.Columns), int(dataset.Rows)), int(dataset.get("SamplesPerPixel") or 1)
        if min(*size, num_samples, count) < 1 or len(each) != count:
            raise ValueError
    except (AttributeError, ValueError, TypeError) as error:
        raise unreadable_slice(path) from error
    detector = (dataset.get("DetectorInformationSequence") or [])[:1]
    dimensions, vectors = declared_dimensions(dataset), vectors_of(dataset, count)
    places, offsets = _places(dataset, vectors, count), numbers_of([dataset], "GridFrameOffsetVector")
    padding, marks_of_all = _padding(dataset), frame_marks([*shared, dataset], ())
    frames = []
    for number, own in enumerate(each):
        fields = [*own, *shared, dataset, *detector]
        has_position = any(keyword in group for keyword in _POSITIONS for group in (*own, *shared))
        has_place = has_position or len(offsets) == count or not any(places)
        pair, between = _lengths(path, fields, 1 if has_place else count, is_needed=not has_spacing_override)
        row, column = np.reshape(_first_numbers(fields, _ORIENTATIONS, [1, 0, 0, 0, 1, 0]), (2, 3))
        position, normal = np.array(_first_numbers(fields, _POSITIONS, [0.0, 0.0, 0.0])), np.cross(row, column)
        if not has_position and len(offsets) == count:
            # Those that begin with 0 are along the normal, and others are z of the patient (PS3.3, C.8.8.3.2).
            step = offsets[number] - offsets[0]
            position += (-step if offsets[0] != 0 and normal[2] < -0.999 else step) * normal
        elif not has_position:
            position += places[number] * between * normal
        slope = _first_numbers(fields, ["RescaleSlope", "DoseGridScaling"], [1.0])[0] or 1.0
        intercept = _first_numbers(fields, ["RescaleIntercept"], [0.0])[0]
        dtype = _rescaled_dtype(dataset, slope, intercept)
        marks = {each: ([numbers[number]], "") for each, numbers in vectors.items()} | frame_marks(own, dimensions)
        marks = marks | marks_of_all | marks  # the first that tells frames apart is more often their own
        marks |= {_FRAME_NUMBER: ([number], "")} if count > 1 else {}
        across, down, thickness = row * pair[1], column * pair[0], abs(between)
        frame = Frame(path, number, size, num_samples, slope, intercept, dtype, position, across, down, thickness)
        frames.append(replace(frame, padding=padding, marks=marks, times=times_in(fields), units=units_in(fields)))
    return frames


def _first_numbers(fields: list[Dataset], keywords: Sequence[str], usual: list[float]) -> list[float]:
    """Return the numbers of the first of these fields that has as many as usual, or the usual ones."""
    found = (numbers_of(fields, keyword) for keyword in keywords)
    return next((numbers for numbers in found if len(numbers) == len(usual)), usual)


def _places(dataset: Dataset, vectors: dict[Dimension, list[float]], count: int) -> Sequence[float]:
    """Return for each frame of a file its number among the slices of its volume, from 0 on, unless positions tell."""
    numbers = numbers_of([dataset], "SliceVector")
    if len(numbers) == count:
        return [number - 1 for number in numbers]
    return [0.0] * count if any(len(set(numbers)) > 1 for numbers in vectors.values()) else range(count)


def _lengths(path: Path, fields: list[Dataset], count: int, *, is_needed: bool) -> tuple[list[float], float]:
    """Return the spacing down and across, and the distance of frames, which may be negative.

    count: of the frames that need a distance. Raises InputError if the file does not give them and they are needed.
    """
    pairs = (numbers_of(fields, keyword) for keyword in _IN_PLANE)
    pair = next((found for found in pairs if len(found) == 2 and min(found) > 0), [])
    distance = _first_numbers(fields, ["SpacingBetweenSlices"], [0.0])[0]
    got = None
    if not pair:
        text = text_of(fields, _IN_PLANE[0])
        got = f"PixelSpacing = {short_text(text)}" if text else "no PixelSpacing"
    elif count > 1 and distance == 0.0:
        got = f"{count} frames without SpacingBetweenSlices or functional groups"
    if got is None or not is_needed:
        return pair or [1.0, 1.0], distance or 1.0
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
    kind = next((kind for kind in ("Float", "DoubleFloat") if f"{kind}PixelPaddingValue" in dataset), "")
    ends = [*numbers_of([dataset], f"{kind}PixelPaddingValue"), *numbers_of([dataset], f"{kind}PixelPaddingRangeLimit")]
    if not ends or not (text_of([dataset], "PhotometricInterpretation") or "MONOCHROME").startswith("MONOCHROME"):
        return None
    if not kind:
        ends = [(end + 2**15) % 2**16 - 2**15 if dataset.get("PixelRepresentation") else end % 2**16 for end in ends]
    return min(ends), max(ends)


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
    if slope.is_integer() and intercept.is_integer() and max(-low, high) < 2**32:
        return np.min_scalar_type(int(high) if low >= 0 else int(min(low, -1 - high)))
    return np.dtype(np.float64)


def pixels_of(path: Path) -> Array:
    """Return the stored pixels of a file, [frame, y, x, sample]; raises InputError if they cannot be decoded."""
    from pydicom.uid import ExplicitVRBigEndian, ExplicitVRLittleEndian, ImplicitVRLittleEndian

    dataset, _ = open_dicom(path, with_pixels=True)
    syntax = dataset.file_meta.get("TransferSyntaxUID")
    if syntax is None:  # without a preamble
        is_implicit, is_little = dataset.original_encoding
        explicit = ExplicitVRLittleEndian if is_little else ExplicitVRBigEndian
        dataset.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian if is_implicit else explicit
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


def _without_unused_bits(pixels: Array, dataset: Dataset) -> Array:
    """Return the values of the stored bits alone: others may hold overlays, and the sign may not reach into them."""
    stored = int(dataset.get("BitsStored") or 16)
    unused = 8 * pixels.itemsize - stored
    if pixels.dtype.kind == "f" or unused <= 0:
        return pixels
    shift = int(dataset.get("HighBit") or stored - 1) + 1 - stored
    return np.right_shift(np.left_shift(pixels, unused - shift), unused)
