"""Read the number of frames and the series from the header of a DICOM file, without a library.

A search of folders needs no more. A field that cannot be read counts as missing; the reader will report the damage.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import IO, NamedTuple

# The groups and elements of SeriesInstanceUID, NumberOfFrames and TransferSyntaxUID.
_SERIES = (0x0020, 0x000E)
_NUM_FRAMES = (0x0028, 0x0008)
_SYNTAX = (0x0002, 0x0010)
# The tags that begin an item of a sequence, end an item, and end a sequence.
_ITEM = (0xFFFE, 0xE000)
_ITEM_END = (0xFFFE, 0xE00D)
_SEQUENCE_END = (0xFFFE, 0xE0DD)
# Three transfer syntaxes: without types of values, with the most significant byte first, and with compressed fields.
_IMPLICIT = "1.2.840.10008.1.2"
_BIG_ENDIAN = "1.2.840.10008.1.2.2"
_DEFLATED = "1.2.840.10008.1.2.1.99"
# The types of values with a length of four bytes, after two bytes of padding.
_LONG = {b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV"}
# The length of a sequence or an item that ends with a tag of its own.
_UNDEFINED = 0xFFFFFFFF
# The most elements that are read, elements in sequences included: more than headers have before rows and columns.
_MAX_ELEMENTS = 20_000
# The most bytes of a value that is read. A UID has 64 bytes at most.
_MAX_VALUE_BYTES = 128


class Summary(NamedTuple):
    """A file's number of frames, 1 if it states none, and its series, an empty text if it is unknown."""

    num_frames: int = 1
    series: str = ""


def summarize(path: Path) -> Summary:
    """Return the number of frames and the series of a DICOM file, from its header."""
    try:
        with path.open("rb") as file:
            texts = _read_texts(file)
    except (OSError, struct.error):
        return Summary()
    digits = texts.get(_NUM_FRAMES, "")
    count = int(digits) if digits.isdecimal() and len(digits) < 10 else 1
    return Summary(max(count, 1), texts.get(_SERIES, ""))


def _read_texts(file: IO[bytes]) -> dict[tuple[int, int], str]:
    """Return the texts of the fields that are needed; the file may end anywhere."""
    start = file.read(132)
    if start[128:] != b"DICM":
        file.seek(0)
    texts: dict[tuple[int, int], str] = {}
    syntax, depth = "", 0
    for _ in range(_MAX_ELEMENTS):
        head = file.read(8)
        if len(head) < 8:
            break
        is_meta = head[:2] == b"\2\0"
        if not is_meta and syntax == _DEFLATED:
            break
        order = ">" if syntax == _BIG_ENDIAN and not is_meta else "<"
        tag = struct.unpack(f"{order}2H", head[:4])
        if depth == 0 and tag > _NUM_FRAMES:
            break
        num_bytes = _length(file, head, order, has_types=is_meta or syntax != _IMPLICIT)
        if tag in (_ITEM_END, _SEQUENCE_END):
            depth -= 1
        elif num_bytes == _UNDEFINED:
            depth += 1
        elif depth == 0 and tag in (_SYNTAX, _SERIES, _NUM_FRAMES) and num_bytes <= _MAX_VALUE_BYTES:
            texts[tag[0], tag[1]] = file.read(num_bytes).decode("latin-1").strip("\0 ")
            syntax = texts.get(_SYNTAX, "")
        else:
            file.seek(num_bytes, 1)
    return texts


def _length(file: IO[bytes], head: bytes, order: str, *, has_types: bool) -> int:
    """Return the length of an element's value in bytes.

    file: right behind the first 8 bytes of the element; a length of four more bytes is read from it. head: these first
        8 bytes. has_types: whether elements have a type, two letters before the length; items never have one.
    """
    is_item = struct.unpack(f"{order}H", head[:2])[0] == _ITEM[0]
    letters = head[4:6]
    if is_item or not (has_types and letters.isalpha() and letters.isupper()):
        return int(struct.unpack(f"{order}I", head[4:])[0])
    if letters not in _LONG:
        return int(struct.unpack(f"{order}H", head[6:])[0])
    return int(struct.unpack(f"{order}I", file.read(4))[0])
