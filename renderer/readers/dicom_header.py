"""What a DICOM header says of lengths and grey levels, where SimpleITK's GDCM would go on without a word."""

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

# Where a file says how far apart pixels are, down and across: PixelSpacing and, for some kinds of images,
# ImagerPixelSpacing, NominalScannedPixelSpacing and ImagePlanePixelSpacing.
_PIXEL_SPACING = "0028|0030"
_IN_PLANE = (_PIXEL_SPACING, "0018|1164", "0018|2010", "3002|0011")
# And how far apart frames are: SpacingBetweenSlices, GridFrameOffsetVector.
_BETWEEN_SLICES, _FRAME_OFFSETS = "0018|0088", "3004|000c"
# Files of many frames say both in the Pixel Measures Sequence (0028,9110), which SimpleITK does not show.
_PIXEL_MEASURES = b"\x28\x00\x10\x91"

_PHOTOMETRIC, _LIGHT_IS_LOW = "0028|0004", "MONOCHROME1"
# (0028,0004) in the three ways in which values are written: explicit and implicit, and in big-endian order.
_MONOCHROME_1 = re.compile(
    rb"(\x28\x00\x04\x00(?:CS\x0c\x00|\x0c\x00\x00\x00)|\x00\x28\x00\x04CS\x00\x0c)" + _LIGHT_IS_LOW.encode()
)


def is_dicom(reader: Any) -> bool:
    """Whether a SimpleITK reader reads DICOM: other formats may have copies of its fields."""
    return bool(reader.GetImageIO() == "GDCMImageIO")


def dicom_spacing(reader: Any, path: Path, *, has_spacing_override: bool) -> tuple[float, ...]:
    """The spacing that SimpleITK has found in a DICOM file, along each of its axes.

    has_spacing_override: others take their place; they are 1 where the file does not say them. Raises InputError, else,
    where it does not: GDCM would take 1.
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
    """What there is in place of lengths that the file would have to say; None where it says them."""
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
    """The numbers of a field, if each is a length; else none."""
    try:
        numbers = [float(word) for word in reader.GetMetaData(key).split("\\")] if reader.HasMetaDataKey(key) else []
    except ValueError:
        return []
    return numbers if all(math.isfinite(number) and number > 0 for number in numbers) else []


def _is_close(said: float, found: float) -> bool:
    return math.isclose(said, found, rel_tol=1e-6)


@contextmanager
def without_photometric_inversion(reader: Any, path: Path) -> Iterator[None]:
    """Within the block the reader of a DICOM file of MONOCHROME1, where low values are light, reads them as they are.

    SimpleITK would subtract them from the largest, and Hounsfield units would no longer be what slope and intercept
    make of the stored ones. It reads a copy, which says MONOCHROME2. Raises InputError where the file does not have
    the word where it is looked for.
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
