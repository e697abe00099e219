"""Read a folder of PNG, JPEG or BMP pictures as slices, in natural order (`2.png` before `10.png`).

Pillow decodes, in a child process (`isolation.py`). Pictures may state the size of a pixel, but never the distance
between slices.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import GUESSED_LENGTHS, NO_SPACING
from renderer.readers.components import choose, select_index
from renderer.readers.file_errors import damaged_error, errors_about, require_exists
from renderer.readers.image import Image
from renderer.readers.isolation import Host, allocate_voxels
from renderer.readers.orientation import known_orientation, oriented
from renderer.readers.slice_names import require_alike, sort_slices
from renderer.readers.sniff import slices_of_pictures
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.units import Units, are_of_screen, units_of
from renderer.volume import Float64

STATEMENTS = FormatTable(
    "PNG, JPEG and BMP",
    (
        Statement("PLTE", "values", "the colours of values"),
        Statement("Orientation", "place", "the sides of the first row and the first column, in EXIF"),
        Statement("pHYs", "place", "the size of pixels; also the density of JFIF and of BMP"),
        Statement("16 bits", "values", "colours of 16 bits, read with 8: TIFF slices keep all", is_applied=False),
        Statement("gAMA", "values", "the exponent that encodes light as numbers", is_applied=False),
        Statement("tRNS", "meaning", "a colour, or colours of a palette, that are transparent", is_applied=False),
    ),
)

# The exponent (gamma) of pictures in sRGB. All pictures are read as sRGB, also those with another exponent.
_GAMMA = 0.45455

# The formats that Pillow may decode.
_FORMATS = ("PNG", "JPEG", "BMP")
# The first bytes of PNG, JPEG and BMP files.
_STARTS = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8", b"BM")
# The number of the field Orientation in EXIF.
_ORIENTATION = 274
_MM_PER_INCH = 25.4
# The largest number of pixels that a byte of a file may stand for: JPEG reaches about 1228, and deflate 1032.
_MAX_PACKING = 2**11
# The offset of the byte in a PNG file that holds the number of bits of a sample.
_PNG_BITS_AT = 24
# The offset of the byte in a PNG file that holds the kind of colours.
_PNG_KIND_AT = 25
# The kinds of colours in PNG with several samples a pixel: RGB, grey with alpha, and RGBA.
_PNG_COLORS = (2, 4, 6)
# The number of first bytes in which the frame of a JPEG picture is searched for.
_JPEG_BYTES = 2**17


def read_pictures(
    path: Path, time: int | None, component: int | None, *, has_spacing_override: bool, host: Host
) -> Image:
    """Read one component of the pictures in a folder; colours are components.

    has_spacing_override: has no effect, as lengths of pictures are never checked. Raises InputError for pictures that
        are damaged or differ, and if `time` or `component` do not fit.
    """
    select_index("time", time, 1)
    files = sort_slices(slices_of_pictures(path))
    image, expected, number = None, "", 0
    for index, file in enumerate(files):
        host.begin_file(file)
        with errors_about(file), _opened(require_exists(file)) as picture:
            bands, turn = picture.getbands(), known_orientation(picture.getexif().get(_ORIENTATION))
            found = f"{picture.width} x {picture.height} {picture.mode}{f' of Orientation {turn}' * (turn > 1)}"
            expected = expected or found
            require_alike(found, expected, files[0])
            if image is None:
                chosen = choose("c", (len(bands),), None, component, bands if len(bands) > 1 else ())
                dtype = np.uint16 if picture.mode.startswith("I") else np.uint8
                values = allocate_voxels(host, (len(files), picture.height, picture.width), dtype)
                world_from_index, units, note = _lengths(picture)
                place = oriented(world_from_index, turn, picture.size)
                notes = (note, STATEMENTS.note(_unapplied(file, picture)), *chosen.notes)
                image, number = Image(values, place, notes, channels=chosen.channels, units=units), chosen.component
            image.values[index] = np.atleast_3d(np.asarray(picture))[..., number]
    assert image is not None, "called without files"
    return image


def _lengths(picture: Any) -> tuple[Float64, Units, str]:
    """Return the affine with the size of pixels, the unit of lengths, and a note on guessed lengths."""
    per_inch = [float(n) for n in picture.info.get("dpi", ())]
    if len(per_inch) != 2 or not all(0 < n < np.inf for n in per_inch) or are_of_screen(per_inch):
        return np.eye(4), Units(), NO_SPACING
    x, y = (_MM_PER_INCH / n for n in per_inch)
    return np.diag([x, y, x, 1.0]), units_of("mm"), f"{GUESSED_LENGTHS} along z; that along x is assumed"


def _unapplied(file: Path, picture: Any) -> set[str]:
    """Return the fields of a picture that are not applied, by their names in STATEMENTS."""
    with file.open("rb") as opened:
        start = opened.read(_PNG_KIND_AT + 1)
    found = {"tRNS"} if "transparency" in picture.info else set()
    if not math.isclose(picture.info.get("gamma", _GAMMA), _GAMMA, rel_tol=1e-2):
        found.add("gAMA")
    if start.startswith(_STARTS[0]) and start[_PNG_BITS_AT] == 16 and start[_PNG_KIND_AT] in _PNG_COLORS:
        found.add("16 bits")
    return found


@contextmanager
def _opened(file: Path) -> Iterator[Any]:
    """Provide a PIL.Image that is not decoded yet, with colours in place of indices into a palette.

    Raises InputError for damaged files and files of other formats, also from inside the `with` block, and for more
    pixels than the file can hold.
    """
    from PIL import Image as pillow  # noqa: N813

    pillow.MAX_IMAGE_PIXELS = None  # sizes are checked below, and in `allocate_voxels`
    _check_kind(file)
    try:
        with pillow.open(file, formats=_FORMATS) as picture:
            if picture.width * picture.height > _MAX_PACKING * file.stat().st_size:
                got = f"{file.stat().st_size} bytes for {picture.width} x {picture.height} pixels"
                raise damaged_error("this picture has fewer bytes than its pixels need", got)
            yield picture.convert("RGB") if picture.mode == "P" else picture
    except (OSError, SyntaxError, ValueError, IndexError) as error:
        raise damaged_error("this picture cannot be decoded", expected="PNG, JPEG or BMP") from error


def _check_kind(file: Path) -> None:
    """Raise InputError for files of other formats, and for JPEG with a number of bits that Pillow does not decode."""
    with file.open("rb") as opened:
        start = opened.read(_JPEG_BYTES)
    if not start.startswith(_STARTS):
        raise InputError(
            "this is not a picture of the format that its name says",
            expected="PNG, JPEG or BMP",
            hint="open it in the program that it is from, and save it as PNG",
        )
    bits = _jpeg_bits(start)
    if bits in range(9, 17):
        raise InputError(f"JPEG of {bits} bits is not read", hint="save the slices as TIFF or PNG of 16 bits")


def _jpeg_bits(start: bytes) -> int | None:
    """Return the bits of a sample in a JPEG picture, from its first frame header; None if it has none."""
    at = 2
    while start[:2] == b"\xff\xd8" and at + 5 <= len(start) and start[at] == 0xFF:
        marker, length = start[at + 1], int.from_bytes(start[at + 2 : at + 4], "big")
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            return start[at + 4]
        at += 1 if marker == 0xFF else 2 + length
    return None
