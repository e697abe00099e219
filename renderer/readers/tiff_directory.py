"""Read the directories of a TIFF file, one for each page: where its pixels are, and what they mean.

TIFF revision 6.0, and BigTIFF. Only the fields that are needed are read, most of them for one value, and all together
are little more than the file itself: the claims of a damaged file cost neither memory nor time.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError
from renderer.readers.common import describe_shape, unreadable_error

# Tags of the fields that are read. These have one number, ...
SAMPLES, COMPRESSION, RESOLUTION_UNIT, BITS = 277, 259, 296, 258
_SUBFILE, _WIDTH, _HEIGHT, _PHOTOMETRIC, _ORIENTATION = 254, 256, 257, 262, 274
TILE_WIDTH, TILE_HEIGHT = 322, 323
_ROWS_PER_STRIP, _PLANAR, _PREDICTOR, _SAMPLE_FORMAT = 278, 284, 317, 339
# ... of these all numbers, ...
_STRIPS, _STRIP_BYTES, _TILES, _TILE_BYTES = 273, 279, 324, 325
# ... and these are read on the first page only: fractions and a text.
_X_RESOLUTION, _Y_RESOLUTION, _DESCRIPTION = 282, 283, 270

# All pages must share these. SimpleITK relies on it: it writes beyond its memory if some pages are marked as previews.
_FORM = (_ROWS_PER_STRIP, TILE_WIDTH, TILE_HEIGHT, _PLANAR, _PREDICTOR)
_SHARED = (_SUBFILE, BITS, COMPRESSION, _PHOTOMETRIC, _ORIENTATION, SAMPLES, *_FORM)

_SINGLE = frozenset((*_SHARED, _WIDTH, _HEIGHT, _SAMPLE_FORMAT, RESOLUTION_UNIT))
_LISTS = frozenset((_STRIPS, _STRIP_BYTES, _TILES, _TILE_BYTES))
_FRACTIONS = frozenset((_X_RESOLUTION, _Y_RESOLUTION))
_NEEDED = _SINGLE | _LISTS | _FRACTIONS | {_DESCRIPTION}

# TIFF field types: ASCII; RATIONAL; BYTE, SHORT, LONG and BigTIFF's LONG8. No other type is needed.
_ASCII, _RATIONAL, _INTEGERS = 2, 5, {1: "u1", 3: "u2", 4: "u4", 16: "u8"}
_ITEM_BYTES = {1: 1, _ASCII: 1, 3: 2, 4: 4, _RATIONAL: 8, 16: 8}
_KINDS = {1: "u", 2: "i", 3: "f", 4: "u"}  # by sample format; 4 is "undefined", which readers take for unsigned
_BITS_OF_KINDS = {"u": (8, 16, 32, 64), "i": (8, 16, 32, 64), "f": (16, 32, 64)}

# Pages share few bytes of their directories: at most the lengths of their strips, which take no more bytes than the
# offsets, which pages cannot share. So a sound file needs fewer bytes than this multiple of its size; damaged
# directories that overlap, or share long lists, need more.
_MAX_READ_RATIO = 2
# Tags have 16 bits, and none occurs twice in a directory.
_MAX_ENTRIES = 2**16 - 1

_NO_OFFSETS = np.zeros(0, np.uint8)


@dataclass(frozen=True, slots=True)
class Page:
    """The content of one directory.

    numbers: the first value of each field of numbers, by tag.
    offsets, lengths: unsigned integers [n] in any byte order: the place and the bytes of each strip or tile.
    resolution: (numerator, denominator) of pixels per unit along x and y; zeros if missing.
    description: of the first page; empty on others.
    """

    numbers: dict[int, int]
    offsets: npt.NDArray[np.unsignedinteger[Any]]
    lengths: npt.NDArray[np.unsignedinteger[Any]]
    has_tiles: bool
    resolution: tuple[tuple[int, int], tuple[int, int]]
    description: bytes

    def number(self, tag: int, default: int) -> int:
        """Return the value of a field, or TIFF's default for it."""
        return self.numbers.get(tag, default)

    @property
    def size(self) -> tuple[int, int]:
        """Return the number of pixels along x and y."""
        return self.number(_WIDTH, 0), self.number(_HEIGHT, 0)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Return the dtype of a decoded sample; opaque bytes (kind V) for samples that are not numbers of 8, 16, 32 or
        64 bits."""
        bits, kind = max(8, self.number(BITS, 1)), _KINDS.get(self.number(_SAMPLE_FORMAT, 1), "V")
        return np.dtype(f"{kind if bits in _BITS_OF_KINDS.get(kind, ()) else 'V'}{-(-bits // 8)}")

    @property
    def num_plain_bytes(self) -> int:
        """Return the number of bytes of all samples of the page without compression."""
        return self.size[0] * self.size[1] * self.number(SAMPLES, 1) * self.number(BITS, 1) // 8

    def difference(self, other: Page) -> str | None:
        """Return how the page differs from `other`, in words; None if both can be slices of one volume."""
        if self.size != other.size or self.dtype != other.dtype:
            return f"{describe_shape(self.size)} {self.dtype.name}"
        odd = [tag for tag in _SHARED if self.number(tag, 0) != other.number(tag, 0)]
        return f"{self.number(odd[0], 0)} in TIFF field {odd[0]}" if odd else None


def read_pages(path: Path) -> tuple[str, list[Page]]:
    """Return the byte order, `<` or `>`, and all pages, at least one, with pixels inside the file.

    Raises InputError for a file that is not TIFF, that ends before the data of its directories, or whose directories
    are damaged.
    """
    num_file_bytes = path.stat().st_size
    pages: list[Page] = []
    try:
        with path.open("rb") as file:
            mark = file.read(4)
            order = {b"II": "<", b"MM": ">"}.get(mark[:2], "")
            version = struct.unpack(order + "H", mark[2:])[0] if order and len(mark) == 4 else 0
            if version not in (42, 43):
                raise InputError(
                    "this is not a TIFF file",
                    where=str(path),
                    got="an empty file" if num_file_bytes == 0 else None,
                    expected="II or MM and 42 or 43, by which TIFF and BigTIFF begin",
                )
            directories = _Directories(path, file, order, version == 43, num_file_bytes)
            offset, seen = directories.first(), set[int]()
            while offset:
                if offset in seen:
                    raise InputError(
                        "the pages of this TIFF file form a loop",
                        where=str(path),
                        got=f"a page after page {len(pages)} that came before",
                        hint="the file is damaged",
                    )
                seen.add(offset)
                page, offset = directories.page(offset, pages)
                pages.append(page)
    except OSError as error:
        raise unreadable_error(path, error) from error
    except EOFError as error:
        raise InputError(
            "the file ends within its directory",
            where=str(path),
            got=f"{num_file_bytes} bytes, {len(pages)} complete pages",
            hint="the file is truncated",
        ) from error
    _check_complete(path, pages, num_file_bytes)
    return order, pages


class _Directories:
    """An open file, and the number of bytes read. Methods raise EOFError beyond the end of the file."""

    def __init__(self, path: Path, file: BinaryIO, order: str, is_big: bool, num_file_bytes: int) -> None:
        self._path, self._file, self._order, self._num_file_bytes = path, file, order, num_file_bytes
        self._num_read, self._is_big = 0, is_big
        self._count, self._entry, self._pointer = ("Q", "HHQ8s", "Q") if is_big else ("H", "HHI4s", "I")

    def first(self) -> int:
        """Return the offset of the first directory; 0 for none."""
        return self._number(8 if self._is_big else 4, self._pointer)

    def page(self, offset: int, pages: list[Page]) -> tuple[Page, int]:
        """Return the directory at `offset`, which follows `pages`, and the offset of the next one; 0 for none."""
        num_entries = self._number(offset, self._count)
        if num_entries > _MAX_ENTRIES:
            raise InputError(
                "a directory of this TIFF file has too many fields",
                where=str(self._path),
                got=f"{num_entries} fields on page {len(pages) + 1}",
                expected=f"at most {_MAX_ENTRIES}",
                hint="the file is damaged",
            )
        begin = offset + struct.calcsize(self._order + self._count)
        num_bytes = num_entries * struct.calcsize(self._order + self._entry)
        entries: dict[int, tuple[int, int, bytes]] = {}
        for tag, kind, count, inline in struct.iter_unpack(self._order + self._entry, self._read(begin, num_bytes)):
            self._require_there(kind, count, inline)
            if tag in _NEEDED:
                entries.setdefault(tag, (kind, count, inline))
        numbers, lists, fractions, description = self._fields(entries, pages)
        if pages and numbers == pages[0].numbers:
            numbers = pages[0].numbers  # many pages take little memory
        offsets = lists.get(_STRIPS, lists.get(_TILES, _NO_OFFSETS))
        lengths = lists.get(_STRIP_BYTES, lists.get(_TILE_BYTES, _NO_OFFSETS))
        num_offsets = min(len(offsets), len(lengths))
        resolution = fractions.get(_X_RESOLUTION, (0, 0)), fractions.get(_Y_RESOLUTION, (0, 0))
        page = Page(numbers, offsets[:num_offsets], lengths[:num_offsets], _TILES in lists, resolution, description)
        return page, self._number(begin + num_bytes, self._pointer)

    def _fields(
        self, entries: dict[int, tuple[int, int, bytes]], pages: list[Page]
    ) -> tuple[dict[int, int], dict[int, npt.NDArray[np.unsignedinteger[Any]]], dict[int, tuple[int, int]], bytes]:
        """Return single numbers, lists of numbers and fractions by tag, and the description."""
        numbers, lists, fractions, description = {}, {}, {}, b""
        for tag, (kind, count, inline) in entries.items():
            if tag == _DESCRIPTION and kind == _ASCII and not pages:
                description = self._values(kind, count, inline, count)
            elif tag in _FRACTIONS and kind == _RATIONAL and not pages:
                self._require_values(tag, count, pages)
                above, below = struct.unpack(self._order + "II", self._values(kind, count, inline, 1))
                fractions[tag] = (above, below)
            elif (tag in _SINGLE or tag in _LISTS) and kind in _INTEGERS:
                self._require_values(tag, count, pages)
                stored = np.dtype(self._order + _INTEGERS[kind])
                values = np.frombuffer(self._values(kind, count, inline, count if tag in _LISTS else 1), stored)
                if tag in _LISTS:
                    lists[tag] = values
                else:
                    numbers[tag] = int(values[0])
        return numbers, lists, fractions, description

    def _require_values(self, tag: int, count: int, pages: list[Page]) -> None:
        if count == 0:
            raise InputError(
                "a field of this TIFF file has no value",
                where=str(self._path),
                got=f"0 values in TIFF field {tag} on page {len(pages) + 1}",
                expected="one value or more",
                hint="the file is damaged",
            )

    def _require_there(self, kind: int, count: int, inline: bytes) -> None:
        """Check fields that are not needed, too: nothing else shows that a file ends inside their values."""
        num_bytes = _ITEM_BYTES.get(kind, 0) * count
        if num_bytes > len(inline) and self._pointer_value(inline) + num_bytes > self._num_file_bytes:
            raise EOFError

    def _values(self, kind: int, count: int, inline: bytes, num_wanted: int) -> bytes:
        """Return the first `num_wanted` of a field's `count` values, which are inside its entry if they fit there."""
        num_bytes = _ITEM_BYTES[kind] * num_wanted
        return (
            inline[:num_bytes]
            if _ITEM_BYTES[kind] * count <= len(inline)
            else self._read(self._pointer_value(inline), num_bytes)
        )

    def _pointer_value(self, inline: bytes) -> int:
        return int(struct.unpack(self._order + self._pointer, inline)[0])

    def _number(self, place: int, code: str) -> int:
        return int(struct.unpack(self._order + code, self._read(place, struct.calcsize(self._order + code)))[0])

    def _read(self, place: int, num_bytes: int) -> bytes:
        if place + num_bytes > self._num_file_bytes:
            raise EOFError
        self._num_read += num_bytes
        if self._num_read > _MAX_READ_RATIO * self._num_file_bytes:
            raise InputError(
                "the directories of this TIFF file overlap",
                where=str(self._path),
                got=f"more than {self._num_read - num_bytes} bytes of directories",
                expected=f"less than the file has: {self._num_file_bytes} bytes",
                hint="the file is damaged",
            )
        self._file.seek(place)
        data = self._file.read(num_bytes)
        if len(data) < num_bytes:
            raise EOFError
        return data


def _check_complete(path: Path, pages: list[Page], num_file_bytes: int) -> None:
    """Raise InputError unless every page has pixels, all inside the file."""
    if not pages or not all(len(page.offsets) and min(*page.size, page.number(SAMPLES, 1)) > 0 for page in pages):
        raise InputError("this TIFF file holds no image", where=str(path), hint="the file is truncated or damaged")
    end = max(_end(page, num_file_bytes) for page in pages)
    if end > num_file_bytes:
        raise _too_short(path, num_file_bytes, f"{end} bytes")
    plain = [(number, page) for number, page in enumerate(pages) if page.number(COMPRESSION, 1) == 1]
    for number, page in plain:
        found = int(page.lengths.sum(dtype=np.float64))  # which no lengths overflow
        if found < page.num_plain_bytes:
            raise InputError(
                f"page {number + 1} has fewer pixels than its size says",
                where=str(path),
                got=f"{found} bytes",
                expected=f"{page.num_plain_bytes} bytes ({describe_shape(page.size)} pixels)",
                hint="the file is damaged",
            )
    num_bytes = sum(page.num_plain_bytes for _, page in plain)
    if num_bytes > num_file_bytes:  # strips that lie one over the other
        raise _too_short(path, num_file_bytes, f"{num_bytes} bytes of pixels ({len(plain)} pages)")


def _end(page: Page, num_file_bytes: int) -> int:
    """Return where the page's last strip or tile ends; if any ends beyond the file, the end of such a one."""
    most = num_file_bytes + 1  # so that sums do not overflow
    places, sizes = (np.minimum(values, most, dtype=np.uint64) for values in (page.offsets, page.lengths))
    last = int(np.argmax(places + sizes))
    return int(page.offsets[last]) + int(page.lengths[last])


def _too_short(path: Path, num_file_bytes: int, expected: str) -> InputError:
    return InputError(
        "the file is shorter than its directory says",
        where=str(path),
        got=f"{num_file_bytes} bytes",
        expected=expected,
        hint="the file is truncated",
    )
