"""Check lengths and grey levels in DICOM headers that SimpleITK's GDCM would silently misread."""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from renderer.errors import InputError
from renderer.scene import printable_text

# Fields with the distances of pixels, down and across: PixelSpacing and, for some kinds of images, ImagerPixelSpacing,
# NominalScannedPixelSpacing and ImagePlanePixelSpacing.
_PIXEL_SPACING = "0028|0030"
_IN_PLANE = (_PIXEL_SPACING, "0018|1164", "0018|2010", "3002|0011")
# Fields with the distance of frames: SpacingBetweenSlices, GridFrameOffsetVector.
_BETWEEN_SLICES, _FRAME_OFFSETS = "0018|0088", "3004|000c"
# Multi-frame files have both in the Pixel Measures Sequence (0028,9110), which SimpleITK does not show.
_PIXEL_MEASURES = b"\x28\x00\x10\x91"

_PHOTOMETRIC, _LIGHT_IS_LOW = "0028|0004", "MONOCHROME1"
# (0028,0004) in three encodings: explicit, implicit and big-endian.
_MONOCHROME_1 = re.compile(
    rb"(\x28\x00\x04\x00(?:CS\x0c\x00|\x0c\x00\x00\x00)|\x00\x28\x00\x04CS\x00\x0c)" + _LIGHT_IS_LOW.encode()
)


def is_dicom(reader: Any) -> bool:
    """Return whether a SimpleITK reader reads DICOM: other formats may have copies of its fields."""
    return bool(reader.GetImageIO() == "GDCMImageIO")


def dicom_spacing(reader: Any, path: Path, *, has_spacing_override: bool) -> tuple[float, ...]:
    """Return the spacing that SimpleITK found in a DICOM file, along each of its axes.

    has_spacing_override: the scene gives the spacing; lengths that the file does not give are 1. Otherwise raises
        InputError for such lengths, which GDCM would take for 1.
    """
    spacing: tuple[float, ...] = reader.GetSpacing()
    found = _missing_spacing(reader, path, spacing)
    if found is None:
        return spacing
    if has_spacing_override:
        return (1.0,) * len(spacing)
    raise InputError(
        "this DICOM file does not give its voxel size",
        where=str(path),
        got=found,
        expected="PixelSpacing of two positive numbers, and of several frames how far apart they are",
        hint="`spacing: [x, y, z]` replaces the spacing in the file",
    )


def _missing_spacing(reader: Any, path: Path, spacing: tuple[float, ...]) -> str | None:
    """Return what the file has in place of the lengths that it must give; None if it gives them."""
    in_plane = [_lengths(reader, key)[::-1] for key in _IN_PLANE]
    is_said = any(len(pair) == 2 and all(map(_is_close, pair, spacing)) for pair in in_plane)
    is_stack = len(spacing) > 2 and reader.GetSize()[2] > 1
    between = _lengths(reader, _BETWEEN_SLICES)
    is_said_along_z = reader.HasMetaDataKey(_FRAME_OFFSETS) or (len(between) == 1 and _is_close(between[0], spacing[2]))
    if is_said and (not is_stack or is_said_along_z):
        return None
    if _PIXEL_MEASURES in path.read_bytes():
        return None
    if is_said:
        return f"{reader.GetSize()[2]} frames without SpacingBetweenSlices or functional groups"
    if not reader.HasMetaDataKey(_PIXEL_SPACING):
        return "no PixelSpacing"
    text = reader.GetMetaData(_PIXEL_SPACING).strip()
    return f"PixelSpacing = {printable_text(text)}"


def _lengths(reader: Any, key: str) -> list[float]:
    """Return the numbers of a field, or an empty list unless each is a length."""
    try:
        numbers = [float(word) for word in reader.GetMetaData(key).split("\\")] if reader.HasMetaDataKey(key) else []
    except ValueError:
        return []
    return numbers if all(math.isfinite(number) and number > 0 for number in numbers) else []


def _is_close(said: float, found: float) -> bool:
    return math.isclose(said, found, rel_tol=1e-6)


@contextmanager
def without_photometric_inversion(reader: Any, path: Path) -> Iterator[None]:
    """Read the stored values of a DICOM file of MONOCHROME1, where low values are light, within the block.

    SimpleITK would subtract them from the largest value, and Hounsfield units would be wrong. It reads a copy of the
    file marked as MONOCHROME2 instead. Raises InputError if the mark is not found in the file.
    """
    is_named = is_dicom(reader) and reader.HasMetaDataKey(_PHOTOMETRIC)
    if not (is_named and reader.GetMetaData(_PHOTOMETRIC).strip() == _LIGHT_IS_LOW):
        yield
        return
    data, count = _MONOCHROME_1.subn(rb"\1MONOCHROME2", path.read_bytes(), count=1)
    if count == 0:
        raise InputError(
            "DICOM files that are deflated as a whole cannot be read where low values are light",
            where=str(path),
            got=_LIGHT_IS_LOW,
            expected="MONOCHROME2, or a file that is not deflated",
            hint="save it again as Explicit VR Little Endian",
        )
    name = reader.GetFileName()
    with tempfile.NamedTemporaryFile(suffix=".dcm") as copy:
        copy.write(data)
        copy.flush()
        reader.SetFileName(copy.name)
        try:
            yield
        finally:
            reader.SetFileName(name)
