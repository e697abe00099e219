"""Read voxels from the place that a header gives: plain, compressed, or as text; in one file or in several files.

Compressed voxels are decompressed once, in pieces, and their checksum is compared. Sizes are checked before memory is
taken. Large plain voxels stay in their file.
"""

from __future__ import annotations

import bz2
import math
import tempfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import IO, Any, Literal

import numpy as np

from renderer.errors import InputError
from renderer.readers.components import Chosen
from renderer.readers.file_errors import errors_about
from renderer.readers.scaled_values import bytes_of
from renderer.readers.sniff import NIFTI_STARTS, read_start
from renderer.readers.voxel_limits import (
    check_memory,
    check_size,
    describe_count,
    describe_shape,
    fitting_shapes,
    stays_mapped,
)
from renderer.scene import counted, short_text
from renderer.volume import Array

# The number of bytes that are read or decompressed at once.
_PIECE = 2**20
# The number of bytes of a deflate stream that are read at once. It is smaller than _PIECE, as zlib copies the rest of
# the piece at the end of each gzip member, and a file may have very many members.
_DEFLATE_PIECE = 2**15

# The largest ratio of decompressed to compressed bytes of deflate, which stores at most 258 bytes in 2 bits (RFC 1951).
_MAX_DEFLATE_RATIO = 1032
# The largest ratio of decompressed to compressed bytes of bzip2. Its blocks of at most 900,000 bytes store 255 equal
# bytes in 5 and take at least 32 bytes.
_MAX_BZIP2_RATIO = 2**21

# The formats whose headers have a certain length in bytes: data that are longer than their voxels by such a length may
# begin with a header of that format.
_HEADERS = {348: "Analyze or NIfTI", 352: "NIfTI-1", 540: "NIfTI-2", 544: "NIfTI-2", 284: "MGH", 1024: "MRC"}

# The largest number of decoded bytes before the voxels: more than reports, colours or names take there. Without this
# limit, the header of a small compressed file could make the reader decode any number of bytes in vain.
_MAX_SKIPPED = 2**26

Encoding = Literal["raw", "deflate", "bzip2", "text", "hex"]


@dataclass(frozen=True)
class StoredVoxels:
    """Encoded voxels in a file: their place and their encoding.

    offset: the bytes of the file before the encoded voxels.
    encoding: "deflate" is gzip or zlib; "text" is decimal numbers, "hex" the hexadecimal digits of bytes.
    num_skipped: the decoded bytes before the first voxel.
    num_encoded: the number of encoded bytes, if the header gives it; the rest of the file otherwise.
    has_rest: whether other bytes may follow the voxels.
    """

    file: Path
    offset: int = 0
    encoding: Encoding = "raw"
    num_skipped: int = 0
    num_encoded: int | None = None
    has_rest: bool = False


@dataclass(frozen=True)
class Layout:
    """An array as files store it.

    dtype: the type of the voxels, in the byte order of the files.
    shape: the lengths of the axes, from the slowest to the fastest.
    parts: the files that hold the array one after the other, in parts of the same length.
    num_split: the number of slowest axes that are divided into the parts; 0 for one part. If it is 1, a part may have
        several steps along that axis.
    """

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    parts: tuple[StoredVoxels, ...]
    num_split: int = 0

    @property
    def part_shape(self) -> tuple[int, ...]:
        """Return the shape of the array that each part holds."""
        num_steps = math.prod(self.shape[: self.num_split]) // len(self.parts)
        return (num_steps,) * (num_steps > 1) + self.shape[self.num_split :]


def read_stored(layout: Layout, chosen: Chosen, skip: str | None = None) -> tuple[Array, str | None]:
    """Return one time step and component of an array, and a note if its files have more bytes than voxels.

    The array has the axes in space, and other axes only if `chosen` has all of their items; a plane is [1, y, x]. It
    may be mapped from its file.

    skip: the line of the format's header that skips bytes before the voxels, with `{}` in place of their number, if the
        format has one. Raises InputError for files that are missing, truncated, damaged, or too long.
    """
    values, num_left = _read_part(layout, chosen.part, in_time=chosen.is_step)
    note = _left_over_note(layout.parts[0].file, num_left, skip) if num_left else None
    return values if values.ndim > 2 else values[np.newaxis], note


def check_deflated(file: Path, num_bytes: int) -> None:
    """Raise InputError if the gzip stream with the first bytes of a file is truncated or its checksum is wrong.

    A stream is not checked beyond the bytes that a header can have.
    """
    found = 0
    try:
        for piece in _decoded(StoredVoxels(file, encoding="deflate"), np.dtype(np.uint8), num_bytes):
            found += len(piece)
            if found > _MAX_SKIPPED:
                break
    except InputError as error:
        error.what = "the compressed header is damaged"
        raise


def _left_over_note(file: Path, num_left: int, skip: str | None) -> str:
    left_over = f"the data have {counted(num_left, 'byte')} more than their voxels"
    if skip is None:
        return left_over
    is_nifti = read_start(file, 4)[0] in NIFTI_STARTS
    header = _HEADERS.get(num_left, "NIfTI" if is_nifti else None)
    hint = f", as many as a header of {header} has" if num_left in _HEADERS else ", which begin like NIfTI" * is_nifti
    if header is not None:
        hint += f": if that comes before the voxels, `{skip.format(num_left)}` passes over it"
    return left_over + hint


def _read_part(layout: Layout, index: tuple[int | slice, ...], *, in_time: bool) -> tuple[Array, int]:
    """Return `array[index]` of the array that `layout` describes, and the number of bytes behind the voxels.

    The array may be mapped from its file. index: an integer or a full slice for each axis. Integers for the slowest
        axes save memory. in_time: whether to keep the decoded voxels, as other steps may be read next.
    """
    num_bytes = check_size(layout.shape[::-1], layout.dtype)
    num_left = 0
    for part in layout.parts:
        with errors_about(part.file):
            num_left += _check_length(part, layout.part_shape[::-1], layout.dtype)
    only = layout.parts[0]
    if len(layout.parts) == 1 and only.encoding == "raw" and stays_mapped(num_bytes):
        mapped: Array = np.memmap(only.file, layout.dtype, "r", only.offset + only.num_skipped, layout.shape)
        return mapped[index], num_left
    first, num_chosen = 0, 0
    for item, length in zip(index, layout.shape, strict=True):
        if not isinstance(item, int):
            break
        first, num_chosen = first * length + item, num_chosen + 1
    check_memory(num_bytes // math.prod(layout.shape[:num_chosen]))
    values = np.empty(layout.shape[num_chosen:], layout.dtype)
    begin = first * values.nbytes
    for part in layout.parts:
        with errors_about(part.file):
            num_left += _copy_part(part, values, begin, layout.part_shape[::-1], in_time=in_time)
        begin -= num_bytes // len(layout.parts)
    return values[index[num_chosen:]], num_left


def _copy_part(part: StoredVoxels, values: Array, begin: int, shape_xyz: tuple[int, ...], *, in_time: bool) -> int:
    """Copy the voxels of one part into `values`, and return how many decoded bytes follow the voxels.

    begin: the byte of the part at which `values` begins. It may lie before or behind the part.
    """
    num_bytes = values.itemsize * math.prod(shape_xyz)
    low, high = max(begin, 0), min(begin + values.nbytes, num_bytes)
    if low >= high:
        return 0
    target = bytes_of(values)[low - begin : high - begin]
    if part.encoding == "raw":
        with part.file.open("rb") as file:
            file.seek(part.offset + part.num_skipped + low)
            if file.readinto(target) < len(target):
                raise InputError("the file has become shorter while it was read")
        return 0
    if in_time and values.nbytes < num_bytes:
        stat = part.file.stat()
        state = stat.st_dev, stat.st_ino, stat.st_size, stat.st_mtime_ns
        voxels, num_left = _decoded_copy(part, values.dtype, shape_xyz, state)
        target[:] = voxels[low:high].data
        return num_left
    place = 0

    def write(voxels: bytes) -> None:
        nonlocal place
        inside = voxels[max(0, low - place) : max(0, high - place)]
        at = max(place - low, 0)
        target[at : at + len(inside)] = inside
        place += len(voxels)

    return _decode(part, values.dtype, shape_xyz, write)


def _decode(
    part: StoredVoxels, dtype: np.dtype[Any], shape_xyz: tuple[int, ...], write: Callable[[bytes], object]
) -> int:
    """Decode the voxels of a part in pieces, in order, and return how many decoded bytes follow the voxels."""
    num_bytes, found = dtype.itemsize * math.prod(shape_xyz), -part.num_skipped
    for piece in _decoded(part, dtype, num_bytes):
        write(piece[max(0, -found) : max(0, num_bytes - found)])
        found += len(piece)
        if found > 2 * num_bytes + _PIECE:  # a small file may decompress to any length
            part = replace(part, has_rest=False)
            break
    return _check_num_bytes(part, found, shape_xyz, dtype)


@lru_cache(maxsize=1)  # steps are read one after the other, mostly from one file
def _decoded_copy(
    part: StoredVoxels, dtype: np.dtype[Any], shape_xyz: tuple[int, ...], _state: tuple[int, ...]
) -> tuple[Array, int]:
    """Return the bytes of a part's voxels, mapped from a temporary file, and how many decoded bytes follow them."""
    with tempfile.TemporaryFile() as file:
        num_left = _decode(part, dtype, shape_xyz, file.write)
        return np.memmap(file, np.uint8, "r"), num_left


def _check_length(part: StoredVoxels, shape_xyz: tuple[int, ...], dtype: np.dtype[Any]) -> int:
    """Return how many bytes follow the voxels of a plain part; 0 for an encoded part.

    Raises InputError if the file is too short for the voxels.
    """
    num_values = math.prod(shape_xyz)
    num_bytes = num_values * dtype.itemsize
    found = part.file.stat().st_size - part.offset
    if part.encoding == "raw":
        return _check_num_bytes(part, found - part.num_skipped, shape_xyz, dtype)
    if part.num_skipped > _MAX_SKIPPED:
        raise InputError(
            "there is too much before the voxels",
            got=f"voxels from byte {describe_count(part.num_skipped)} on",
            expected=f"at most {_MAX_SKIPPED} bytes before them",
            hint="if nothing before them is that long, the header is damaged",
        )
    least = {
        "deflate": -(-num_bytes // _MAX_DEFLATE_RATIO),
        "bzip2": -(-num_bytes // _MAX_BZIP2_RATIO),
        "text": 2 * num_values - 1,  # at least a digit for each number, and a separator between two numbers
        "hex": 2 * num_bytes,
    }[part.encoding]
    if found < max(least, part.num_encoded or 0):
        encoded = "text" if part.encoding in ("text", "hex") else "compressed voxels"
        expected = f"at least {least} bytes ({describe_shape(shape_xyz)} voxels)"
        if part.num_encoded is not None:
            expected = f"{part.num_encoded} bytes of compressed voxels"
        raise _too_short(f"{max(found, 0)} bytes of {encoded}", expected)
    return 0


def _check_num_bytes(part: StoredVoxels, found: int, shape_xyz: tuple[int, ...], dtype: np.dtype[Any]) -> int:
    """Return how many of `found` bytes, which begin with the voxels, follow the voxels.

    Raises InputError for too few bytes, and for so many that an axis may be longer, unless the surplus is a known
    header.
    """
    num_bytes = dtype.itemsize * math.prod(shape_xyz)
    is_raw = part.encoding == "raw"
    expected = f"{num_bytes} bytes ({describe_shape(shape_xyz)} voxels)"
    if found < num_bytes:
        raise _too_short(f"{max(found, 0)} bytes" + " after decoding" * (not is_raw), expected)
    num_left = found - num_bytes
    if part.has_rest or num_left in _HEADERS or num_left < min(num_bytes // n for n in shape_xyz[:3]):
        return num_left
    fits = fitting_shapes(shape_xyz, dtype.itemsize, found) if is_raw else []
    raise InputError(
        "the file is longer than its header says",
        got=f"{found} bytes" if is_raw else f"{found} bytes or more after decoding",
        expected=expected,
        hint=f"these would fit: {'; '.join(map(describe_shape, fits))}" if fits else "the header is wrong",
    )


def _too_short(got: str, expected: str) -> InputError:
    return InputError(
        "the file is shorter than its header says",
        got=got,
        expected=expected,
        hint="the file is truncated or its header is wrong",
    )


def _decoded(part: StoredVoxels, dtype: np.dtype[Any], enough: int) -> Iterator[bytes]:
    """Yield the decoded bytes of a file in pieces, to the end of the compressed stream that contains byte `enough`.

    Raises InputError for damage.
    """
    is_text = part.encoding in ("text", "hex")
    try:
        with part.file.open("rb") as file:
            file.seek(part.offset)
            if part.encoding == "deflate":
                yield from _inflated(_pieces(file, part.num_encoded, _DEFLATE_PIECE), part.num_skipped + enough)
            elif part.encoding == "bzip2":
                yield from _pieces(bz2.BZ2File(file))
            elif part.encoding == "hex":
                yield from _from_hex(_pieces(file))
            else:
                yield from (_numbers(words, dtype).tobytes() for words in _whole_words(_pieces(file)))
    except (zlib.error, EOFError, OSError, ValueError, OverflowError) as error:
        raise InputError(
            "the text of the voxels is not numbers of their type" if is_text else "the compressed voxels are damaged",
            got=short_text(" ".join(str(error).split())),
            hint="the header is wrong, or the file is damaged" if is_text else "copy or download the file again",
        ) from error


def _inflated(pieces: Iterator[bytes], enough: int) -> Iterator[bytes]:
    """Yield the bytes of a zlib stream or of gzip members, to the end of the member that contains byte `enough`.

    Raises zlib.error for damage and a wrong checksum, EOFError if a stream breaks off.
    """
    total = 0
    data = next(pieces, b"")
    while data and total < enough:
        stream = zlib.decompressobj(zlib.MAX_WBITS | 32)  # recognises gzip and zlib
        while not stream.eof:
            piece = stream.decompress(data, _PIECE)
            total += len(piece)
            yield piece
            data = stream.unconsumed_tail
            if not data and not stream.eof and len(piece) < _PIECE:  # after a full piece, the stream may hold more
                data = next(pieces, b"")
                if not data:
                    raise EOFError(f"the compressed data break off after {total} bytes of voxels")
        data = stream.unused_data or next(pieces, b"")


def _pieces(file: IO[bytes], num_bytes: int | None = None, piece: int = _PIECE) -> Iterator[bytes]:
    """Yield the bytes of a file in pieces, from its present position on, at most `num_bytes` in all."""
    left = math.inf if num_bytes is None else num_bytes
    while data := file.read(int(min(piece, left))):
        left -= len(data)
        yield data


def _from_hex(pieces: Iterator[bytes]) -> Iterator[bytes]:
    """Yield the bytes of a text of hexadecimal digits; raises ValueError for any other text."""
    rest = b""
    for piece in pieces:
        digits = rest + b"".join(piece.split())
        num_even = len(digits) // 2 * 2
        yield bytes.fromhex(digits[:num_even].decode("ascii"))
        rest = digits[num_even:]


def _whole_words(pieces: Iterator[bytes]) -> Iterator[bytes]:
    """Yield pieces of a text that end between words; raises ValueError for a word longer than a piece."""
    rest = b""
    for piece in pieces:
        text = rest + piece.replace(b",", b" ")
        end = max(text.rfind(blank) for blank in (b" ", b"\n", b"\t", b"\r")) + 1
        if end == 0 and len(text) > _PIECE:
            raise ValueError("a number of more than a million digits")
        yield text[:end]
        rest = text[end:]
    yield rest


def _numbers(words: bytes, dtype: np.dtype[Any]) -> Array:
    """Return the numbers in a text as an array of a type; exponents begin with E, or with Fortran's D.

    Raises ValueError for any other word, and OverflowError for a number that does not fit the type.
    """
    if dtype.kind == "f":
        with np.errstate(over="ignore"):  # too large values become infinite, and are refused later
            return np.array([float(word) for word in words.upper().replace(b"D", b"E").split()], dtype)
    return np.array([int(word) for word in words.split()], dtype)
