"""Read the number of frames and the series from the header of a DICOM file, without a library.

A search of folders needs no more. A field that cannot be read counts as missing; the reader will report the damage.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import IO, NamedTuple

# The tag (group and element) of SeriesInstanceUID.
_SERIES = (0x0020, 0x000E)
# The tag of NumberOfFrames.
_NUM_FRAMES = (0x0028, 0x0008)
# The tag of TransferSyntaxUID.
_SYNTAX = (0x0002, 0x0010)
# The tag that begins an item of a sequence.
_ITEM = (0xFFFE, 0xE000)
# The tag that ends an item of a sequence.
_ITEM_END = (0xFFFE, 0xE00D)
# The tag that ends a sequence.
_SEQUENCE_END = (0xFFFE, 0xE0DD)
# The transfer syntax of fields that do not state the types of their values.
_IMPLICIT = "1.2.840.10008.1.2"
# The transfer syntax of numbers with the most significant byte first.
_BIG_ENDIAN = "1.2.840.10008.1.2.2"
# The transfer syntax of fields that are compressed.
_DEFLATED = "1.2.840.10008.1.2.1.99"
# The types of values whose length is stored in four bytes, behind two bytes of padding. All other lengths have two
# bytes.
_LONG = {b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV"}
# The number that stands for an unknown length: the sequence or item ends with a tag of its own.
_UNDEFINED = 0xFFFFFFFF
# The largest number of elements (fields) of a file that are read, those in sequences included: more than headers have
# before the rows and columns.
_MAX_ELEMENTS = 20_000
# The largest length in bytes of a value that is read; longer values are skipped. A UID has 64 bytes at most.
_MAX_VALUE_BYTES = 128


class Summary(NamedTuple):
    """The number of frames of a DICOM file, and the UID of its series.

    num_frames: 1 if the file states none. series: an empty text if it is unknown.
    """

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
    """Return the texts of transfer syntax, series and number of frames, by their tags; the file may end anywhere."""
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
