"""Reads PNG files strictly: a decoder repairs and omits parts of a file, and a comparison would not notice it.

Stored values are compared. Gamma, colour spaces and profiles (gAMA, sRGB, cHRM, iCCP) are ignored, and no picture is
converted. Interlaced pictures are supported.
"""

from __future__ import annotations

import contextlib
import io
import struct
import zlib
from collections.abc import Sequence
from pathlib import Path

from PIL import Image

from renderer.errors import InputError
from renderer.film import Pixels, decode_png, join_png_chunks, png_chunks
from renderer.scene import read_bounded, require_file

# Largest number of pixels of a picture, checked in its header before memory is taken. Comparing two pictures of
# 8192 x 4096 pixels with alpha takes 2 GB.
MAX_PIXELS = 2**25
# Largest size of a file, in bytes: twice the size of the largest picture with alpha, uncompressed.
MAX_FILE_BYTES = 2**28

_EXPECTED = "a PNG file, 8-bit RGB or RGBA"
# Names of PNG's colour types, by their codes.
_COLOR_TYPES = {0: "grey", 2: "RGB", 3: "palette", 4: "grey with alpha", 6: "RGBA"}
# Number of channels of the colour types that are compared, by their codes.
_CHANNELS = {2: 3, 6: 4}
# Chunks that change the picture or add pictures, with words for messages: a file with one of them is refused.
_REFUSED_CHUNKS = {b"tRNS": "a transparent colour (tRNS)", b"acTL": "an animation (APNG)"}
# Chunks that a reader must understand. Other chunks may be skipped only if their names begin with a lower-case letter
# (ISO/IEC 15948, 5.4).
_KNOWN_CHUNKS = (b"IHDR", b"PLTE", b"IDAT", b"IEND")
# First column, first row, and steps along both axes, of each pass of an interlaced picture (ISO/IEC 15948, 8.2).
_ADAM7_PASSES = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))

# The first bytes of a file that Git LFS has not fetched.
_LFS_POINTER = b"version https://git-lfs.github.com/"


def is_picture(name: str) -> bool:
    """Return whether a name matches `*.png`, in any case; hidden files do not."""
    return name.lower().endswith(".png") and not name.startswith(".")


def read_picture(path: Path) -> Pixels:
    """Read a PNG file: uint8 [h, w, 3] or, with straight alpha, [h, w, 4].

    Raises InputError for any other file: another format, 16 bits, a palette, grey, a truncated or damaged file, more
    than MAX_PIXELS pixels.
    """
    return decode_picture(file_content(path), path)


def file_content(path: Path, max_bytes: int = MAX_FILE_BYTES, expected: str = _EXPECTED) -> bytes:
    """Read a regular file of limited size, by default a picture. Raises InputError."""
    require_file(path, expected)
    return read_bounded(path, max_bytes, expected)


def decode_picture(content: bytes, path: Path) -> Pixels:
    """Decode the content of the PNG file `path`; return the array, and raise the errors, of `read_picture`."""
    try:
        chunks = png_chunks(content)
    except ValueError as error:
        raise _unreadable_error(str(error), content, path) from error
    shape, is_interlaced = _parse_header(chunks, path)
    data = b"".join(content for name, content in chunks if name == b"IDAT")
    if not _is_complete(data, shape, is_interlaced=is_interlaced):
        raise _damaged_error(path)
    try:
        # Decoded without the file's other chunks, which could change the picture or the cost of decoding.
        return decode_png(join_png_chunks([chunks[0], (b"IDAT", data), chunks[-1]]))
    except ValueError as error:
        raise _damaged_error(path) from error


def _parse_header(chunks: Sequence[tuple[bytes, bytes]], path: Path) -> tuple[tuple[int, int, int], bool]:
    """Return (height, width, channels), and whether the picture is interlaced. Raises InputError if unsupported."""
    content, names = chunks[0][1], [name for name, _ in chunks]
    strange = [name for name in names if name[:1].isupper() and name not in _KNOWN_CHUNKS]
    if len(content) != 13 or names.count(b"IHDR") > 1 or strange:
        raise _damaged_error(path)
    width, height, depth, color_type, compression, filtering, interlace = struct.unpack(">IIBBBBB", content)
    if not (width and height) or compression or filtering or interlace > 1 or color_type not in _COLOR_TYPES:
        raise _damaged_error(path)
    if width * height > MAX_PIXELS:
        got, expected = f"{width} x {height} pixels", f"at most {MAX_PIXELS} pixels, as 8192 x 4096"
        raise InputError("too large a picture", where=str(path), got=got, expected=expected)
    extras = [words for name, words in _REFUSED_CHUNKS.items() if name in names]
    if depth != 8 or color_type not in _CHANNELS or extras:
        raise InputError(
            "not a picture in 8-bit RGB or RGBA",
            where=str(path),
            got=" with ".join([f"{depth}-bit {_COLOR_TYPES[color_type]}", *extras]),
            expected="8-bit RGB or RGBA",
            hint="stored values are compared without conversion: save it as 8-bit RGB or RGBA",
        )
    return (height, width, _CHANNELS[color_type]), interlace == 1


def _is_complete(data: bytes, shape: tuple[int, int, int], *, is_interlaced: bool) -> bool:
    """Return whether the data has exactly as many bytes as the picture needs; decoders do not check that."""
    expected = 0
    height, width, channels = shape
    for x, y, dx, dy in _ADAM7_PASSES if is_interlaced else ((0, 0, 1, 1),):
        columns, rows = -(-(width - x) // dx), -(-(height - y) // dy)
        expected += rows * (1 + columns * channels) if columns > 0 else 0
    unpacker = zlib.decompressobj()
    try:
        found = len(unpacker.decompress(data, expected + 1))  # one byte more, to detect data beyond the picture
    except zlib.error:
        return False
    return unpacker.eof and found == expected


def _unreadable_error(reason: str, content: bytes, path: Path) -> InputError:
    if not content:
        return InputError("an empty file", where=str(path), expected=_EXPECTED)
    if content.startswith(_LFS_POINTER):
        hint = "git lfs pull"
        return InputError("not a PNG file", where=str(path), got="a Git LFS pointer", expected=_EXPECTED, hint=hint)
    if reason == "not a PNG file":
        got = None
        with contextlib.suppress(OSError), Image.open(io.BytesIO(content)) as image:
            got = f"a {image.format} file"
        return InputError(reason, where=str(path), got=got, expected=_EXPECTED)
    return InputError(f"the PNG file is {reason}", where=str(path), got=f"{len(content)} bytes", expected=_EXPECTED)


def _damaged_error(path: Path) -> InputError:
    return InputError("the PNG file is damaged", where=str(path), got="data that cannot be decoded", expected=_EXPECTED)
