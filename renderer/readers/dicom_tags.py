"""Read two fields of a DICOM file's header without any library: how many frames it has, and its series.

Searching folders needs no more. What cannot be read counts as not said; the reader reports it.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import IO, NamedTuple

# Fields by their groups and elements: SeriesInstanceUID, NumberOfFrames and TransferSyntaxUID.
_SERIES = (0x0020, 0x000E)
_NUM_FRAMES = (0x0028, 0x0008)
_SYNTAX = (0x0002, 0x0010)
# Marks of an item of a sequence, of its end, and of that of the sequence.
_ITEM = (0xFFFE, 0xE000)
_ITEM_END = (0xFFFE, 0xE00D)
_SEQUENCE_END = (0xFFFE, 0xE0DD)
# Syntaxes other than the usual one: no types of values, high bytes first, and compressed fields.
_IMPLICIT = "1.2.840.10008.1.2"
_BIG_ENDIAN = "1.2.840.10008.1.2.2"
_DEFLATED = "1.2.840.10008.1.2.1.99"
# Types of values whose lengths have four bytes, behind two others.
_LONG = {b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV"}
_UNDEFINED = 0xFFFFFFFF
# A header has fewer elements before its rows and columns, also within sequences.
_MAX_ELEMENTS = 20_000
# A value that is read is shorter: a UID has 64 bytes at most.
_MAX_VALUE_BYTES = 128


class Summary(NamedTuple):
    """How many frames a file has, 1 where it does not say, and the name of its series, which may be empty."""

    num_frames: int = 1
    series: str = ""


def summarize(path: Path) -> Summary:
    """Return what the header of a DICOM file says of its frames and its series."""
    try:
        with path.open("rb") as file:
            texts = _read_texts(file)
    except (OSError, struct.error):
        return Summary()
    digits = texts.get(_NUM_FRAMES, "")
    count = int(digits) if digits.isdecimal() and len(digits) < 10 else 1
    return Summary(max(count, 1), texts.get(_SERIES, ""))


def _read_texts(file: IO[bytes]) -> dict[tuple[int, int], str]:
    """Return the texts of the fields that are wanted; the file may end anywhere."""
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
    """Return the number of bytes of an element's value, from its first 8 bytes, and four more where its type has them.

    has_types: two letters in place of a length are a type; items have none.
    """
    is_item = struct.unpack(f"{order}H", head[:2])[0] == _ITEM[0]
    letters = head[4:6]
    if is_item or not (has_types and letters.isalpha() and letters.isupper()):
        return int(struct.unpack(f"{order}I", head[4:])[0])
    if letters not in _LONG:
        return int(struct.unpack(f"{order}H", head[6:])[0])
    return int(struct.unpack(f"{order}I", file.read(4))[0])
