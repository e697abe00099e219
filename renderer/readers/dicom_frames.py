"""Find the frames in a DICOM file: where each lies, and what its stored values mean.

An ordinary file has one frame. Enhanced files have one set of functional groups for each frame, and one that they
share (PS3.3, C.7.6.16). Other files of several frames have the distance between them, or an offset for each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError, require_package
from renderer.scene import short_text
from renderer.volume import Array, Float64

# Fields by number, of which some kinds of images have their pixel spacing, down and across, in others than the first.
_IN_PLANE = (0x00280030, 0x00181164, 0x00182010, 0x30020011)
_BETWEEN_SLICES, _FRAME_OFFSETS = 0x00180088, 0x3004000C
_POSITION, _ORIENTATION = 0x00200032, 0x00200037
_INTERCEPT, _SLOPE = 0x00281052, 0x00281053
_SHARED_GROUPS, _FRAME_GROUPS = 0x52009229, 0x52009230
# The functional groups that have these fields: Pixel Measures, Plane Position and Orientation, Pixel Value
# Transformation.
_GROUPS = (0x00289110, 0x00209113, 0x00209116, 0x00289145)

# Fields without which pydicom decodes no pixels, and what they are where a writer left them out.
_USUAL = {"SamplesPerPixel": 1, "PhotometricInterpretation": "MONOCHROME2", "PixelRepresentation": 0}

# A pydicom.Dataset.
_Dataset = Any


@dataclass(frozen=True)
class Frame:
    """A slice of a DICOM file.

    size: pixels across and down. dtype: of its rescaled values.
    position: of its first pixel, float64 [3]. across, down: to the next pixel, float64 [3]. thickness: along the
        normal, if the file gives it; else 1.
    """

    file: Path
    number: int
    size: tuple[int, int]
    num_samples: int
    slope: float
    intercept: float
    dtype: np.dtype[Any]
    position: Float64
    across: Float64
    down: Float64
    thickness: float

    @property
    def label(self) -> str:
        """Return the name of the frame in messages."""
        return self.file.name + f", frame {self.number + 1}" * (self.number > 0)

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

    def rescaled(self, stored: Array) -> Array:
        """Return the values of stored pixels, in the frame's dtype; raises InputError for floats in a file whose fields
        are those of integers."""
        if stored.dtype.kind == "f" and self.dtype.kind != "f":
            raise unreadable_slice(self.file, "save it again without BitsStored", "floats with the fields of integers")
        if self.slope == 1.0 and self.intercept == 0.0:
            return stored
        return np.asarray(stored * self.slope + self.intercept).astype(self.dtype)


def open_dicom(path: Path) -> _Dataset:
    """Return the fields before the pixels of a DICOM file; raises InputError if it is damaged."""
    return _open(path)[0]


def _open(path: Path, *, with_pixels: bool = False) -> tuple[_Dataset, bool]:
    """Return the fields of a DICOM file, and whether anything comes behind them."""
    import pydicom

    try:
        with path.open("rb") as file:
            dataset = pydicom.dcmread(file, stop_before_pixels=not with_pixels, force=True)
            return dataset, bool(file.read(1))
    except Exception as error:  # of its parser, for damaged bytes
        raise unreadable_slice(path, "a field of it is damaged: copy it again, or save it again") from error


def unreadable_slice(path: Path, hint: str = "the file is truncated or damaged", got: str | None = None) -> InputError:
    """Return the error for a file that cannot be read."""
    return InputError("this DICOM slice cannot be read", where=str(path), got=got, hint=hint)


def text_of(fields: _Dataset, tag: int) -> str | None:
    """Return the text of a field as it is in the file; None if it is missing."""
    if tag not in fields:
        return None
    raw = fields.get_item(tag).value
    text = raw.decode("latin-1") if isinstance(raw, bytes) else str(raw)
    return text.strip(" \0")


def _numbers(fields: Sequence[_Dataset], tag: int) -> list[float]:
    """Return the numbers of a field, in the first of these datasets that has it; an empty list if they are none."""
    text = next((text for each in fields if (text := text_of(each, tag)) is not None), "")
    try:
        numbers = [float(word) for word in text.strip("[]").replace(",", "\\").split("\\")] if text else []
    except ValueError:
        return []
    return numbers if all(map(math.isfinite, numbers)) else []


def frames_of(path: Path, *, has_spacing_override: bool) -> list[Frame]:
    """Return the frames of a file in their order there.

    has_spacing_override: the scene gives the spacing; lengths that the file does not give are 1. Otherwise raises
        InputError for such lengths, as for damaged files and for files without pixels.
    """
    dataset, has_pixels = _open(path)
    syntax = dataset.file_meta.get("TransferSyntaxUID")
    if not has_pixels and not (syntax is not None and syntax.is_deflated):
        raise unreadable_slice(path)
    try:
        count = int(dataset.get("NumberOfFrames") or 1)
        shared, *_ = _groups(dataset, _SHARED_GROUPS) or [[]]
        each = _groups(dataset, _FRAME_GROUPS) or [[]] * count
        size, num_samples = (int(dataset.Columns), int(dataset.Rows)), int(dataset.get("SamplesPerPixel") or 1)
        if min(*size, num_samples, count) < 1 or len(each) != count:
            raise ValueError
    except (AttributeError, ValueError, TypeError) as error:
        raise unreadable_slice(path) from error
    frames = []
    for number, own in enumerate(each):
        fields = [*own, *shared, dataset]
        pair, step = _lengths(path, fields, number, count, has_spacing_override=has_spacing_override)
        orientation = _numbers(fields, _ORIENTATION)
        row, column = np.reshape(orientation if len(orientation) == 6 else [1, 0, 0, 0, 1, 0], (2, 3))
        position = np.array((_numbers(fields, _POSITION) or [0.0, 0.0, 0.0])[:3])
        if not any(_POSITION in group for group in own):
            position = position + step * np.cross(row, column)
        slope, intercept = (_numbers(fields, _SLOPE) or [0.0])[0] or 1.0, (_numbers(fields, _INTERCEPT) or [0.0])[0]
        dtype = _rescaled_dtype(dataset, slope, intercept)
        thickness = (_numbers(fields, _BETWEEN_SLICES) or [1.0])[0] or 1.0
        across, down = row * pair[1], column * pair[0]
        frames.append(
            Frame(path, number, size, num_samples, slope, intercept, dtype, position, across, down, thickness)
        )
    return frames


def _groups(dataset: _Dataset, tag: int) -> list[list[_Dataset]]:
    """Return for each item of a sequence of functional groups the datasets in the groups that are needed."""
    items = dataset[tag].value if tag in dataset else []
    return [[item[group].value[0] for group in _GROUPS if group in item] for item in items]


def _lengths(
    path: Path, fields: list[_Dataset], number: int, count: int, *, has_spacing_override: bool
) -> tuple[list[float], float]:
    """Return the spacing down and across, and how far from the first frame this one is without a position of its own.

    Raises InputError if the file does not give them.
    """
    dataset = fields[-1]
    pair = next((found for tag in _IN_PLANE if len(found := _numbers(fields, tag)) == 2 and min(found) > 0), [])
    offsets, between = _numbers([dataset], _FRAME_OFFSETS), _numbers(fields, _BETWEEN_SLICES)
    has_positions = any(_POSITION in group for group in fields[:-1])
    step = 0.0
    got = None
    if not pair:
        text = next((text for each in fields if (text := text_of(each, _IN_PLANE[0])) is not None), None)
        got = "no PixelSpacing" if text is None else f"PixelSpacing = {short_text(text)}"
    elif len(offsets) == count:
        step = offsets[number]
    elif len(between) == 1 and between[0] > 0:
        step = number * between[0]
    elif count > 1 and not has_positions:
        got = f"{count} frames without SpacingBetweenSlices or functional groups"
    if got is None:
        return pair, step
    if has_spacing_override:
        return pair or [1.0, 1.0], float(number)
    raise InputError(
        "this DICOM file does not give its voxel size",
        where=str(path),
        got=got,
        expected="PixelSpacing of two positive numbers, and of several frames how far apart they are",
        hint="`spacing: [x, y, z]` replaces the spacing in the file",
    )


def _rescaled_dtype(dataset: _Dataset, slope: float, intercept: float) -> np.dtype[Any]:
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
    dataset, _ = _open(path, with_pixels=True)
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


def _plain_syntax(dataset: _Dataset) -> Any:
    """Return the transfer syntax without compression in which a dataset was read."""
    from pydicom.uid import ExplicitVRBigEndian, ExplicitVRLittleEndian, ImplicitVRLittleEndian

    is_implicit, is_little = dataset.original_encoding
    return ImplicitVRLittleEndian if is_implicit else ExplicitVRLittleEndian if is_little else ExplicitVRBigEndian


def _without_unused_bits(pixels: Array, dataset: _Dataset) -> Array:
    """Return the values of the stored bits alone: others may hold overlays, and the sign may not reach into them."""
    stored = int(dataset.get("BitsStored") or 16)
    unused = 8 * pixels.itemsize - stored
    if pixels.dtype.kind == "f" or unused <= 0:
        return pixels
    shift = int(dataset.get("HighBit") or stored - 1) + 1 - stored
    return np.right_shift(np.left_shift(pixels, unused - shift), unused)
