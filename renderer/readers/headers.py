"""Find the voxels of NRRD, MetaImage, VTK and DICOM files from a few header fields.

SimpleITK reads these formats, but it reports a missing data file as an unreadable header, allocates the memory that a
header asks for before it opens the data, and pads truncated slices. So these functions find and check the data first.

NRRD: http://teem.sourceforge.net/nrrd/format.html. MetaImage: https://itk.org/Wiki/ITK/MetaIO/Documentation.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable
from functools import partial
from itertools import takewhile
from pathlib import Path

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import StoredVoxels, require_exists
from renderer.scene import format_value, printable_text

# No header comes near this size, even with a file for each slice; it bounds the search for the end of a header.
_MAX_HEADER_BYTES = 2**22

# The line before a list of data files, in NRRD and MetaImage.
_LIST = re.compile(
    rb"^(data ?file:|ElementDataFile[ \t]*=)[ \t]*LIST([ \t]+[0-9]{1,2})?[ \t]*\r?\n", re.IGNORECASE | re.MULTILINE
)
_LIST_BEGINS = re.compile(r"data ?file:\s*LIST", re.IGNORECASE)
# Numbered data files: `slice%03d.raw 1 60 1`, first, last and step. The libraries pass the pattern to printf, so
# nothing else is accepted.
_NUMBERED = re.compile(r"([^%\s]*%0?[0-9]{0,2}d[^%\s]*)\s+([0-9]{1,9})\s+([0-9]{1,9})\s+([1-9][0-9]{0,8})")

_META_LENGTHS = re.compile(rb"^[ \t]*(ElementSpacing|ElementSize)[ \t]*=", re.MULTILINE)
# Kinds of spatial axes in NRRD; unknown kinds count as spatial, in the order of the axes.
_KINDS_OF_SPACE = ("domain", "space", "???", "none")

_DECIMAL = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_MAX_DIMENSIONS = 10  # in MetaImage, and in SimpleITK's NRRD
# Bytes in a line of a NRRD header, and in the path of the file. Teem, the reader in SimpleITK, copies both into error
# messages of a fixed size: with SimpleITK 2.5.7, lines from 994 bytes on and paths from 1036 bytes on ended the
# process.
_MAX_NRRD_BYTES = 900
_NRRD_DIMENSION = re.compile(r"dimension: (.*)", re.IGNORECASE)
_MIN_UNIT_VOLUME = 1e-6  # the volume of what axes of length 1 span

# DICOM in little-endian order (PS3.5): the tag (7fe0,0010) of the pixels; the type and undefined length of compressed
# pixels; the item that ends their fragments.
PIXEL_DATA = b"\xe0\x7f\x10\x00"
_ENCAPSULATED = b"OB\x00\x00\xff\xff\xff\xff"
_SEQUENCE_END = b"\xfe\xff\xdd\xe0"


Stored = StoredVoxels | list[StoredVoxels]  # the whole volume, or one item for each slice file


def check_nrrd_header(path: Path) -> None:
    """Raise InputError for a NRRD file, of any suffix, whose header or path may crash SimpleITK.

    That are long lines, also of comments and of lists of data files, long paths, and more than 10 dimensions. Other
    formats are left to their readers.
    """
    with path.open(encoding="latin-1") as file:  # a character for each byte; lines end as teem has it, also at \r
        if file.read(4) != "NRRD":
            return
        num_bytes = len(os.fsencode(path))
        if num_bytes > _MAX_NRRD_BYTES:
            raise InputError(
                "the path of this NRRD file is too long",
                where=str(path),
                got=f"{num_bytes} bytes",
                expected=f"at most {_MAX_NRRD_BYTES} bytes",
                hint="move the file, or name it from a folder near it",
            )
        is_list = False
        for number, line in enumerate(iter(partial(file.readline, _MAX_NRRD_BYTES + 1), ""), 1):
            if line == "\n" and not is_list:  # names are listed up to the end of the file
                return
            _check_nrrd_line(line.removesuffix("\n"), f"{path}:{number}")
            is_list = is_list or _LIST_BEGINS.match(line) is not None


def _check_nrrd_line(line: str, where: str) -> None:
    if len(line) > _MAX_NRRD_BYTES:
        raise InputError(
            "a line of this NRRD header is too long",
            where=where,
            got=format_value(line),
            expected=f"at most {_MAX_NRRD_BYTES} bytes",
            hint="shorten or remove that line",
        )
    match = _NRRD_DIMENSION.match(line)
    dimension = match[1].strip() if match is not None else "1"
    if not (dimension.isdecimal() and 1 <= int(dimension) <= _MAX_DIMENSIONS):
        raise InputError(
            "this NRRD header has a dimension that cannot be read",
            where=where,
            got=printable_text(dimension),
            expected=f"a whole number from 1 to {_MAX_DIMENSIONS}",
            hint="correct that line, or save the file again",
        )


def nrrd_voxels(path: Path) -> Stored:
    """Return where the voxels of a NRRD file are, before lines that are skipped.

    Raises InputError for a missing data file, for bzip2, and as `check_nrrd_header`.
    """
    return _nrrd_voxels(path)[0]


def checkable_nrrd_voxels(path: Path) -> Stored | None:
    """Return `nrrd_voxels`; None if they are compressed after skipped lines, which SimpleITK checks."""
    stored, is_checkable = _nrrd_voxels(path)
    return stored if is_checkable else None


def _nrrd_voxels(path: Path) -> tuple[Stored, bool]:
    check_nrrd_header(path)
    header, offset = _split(_head(path))
    header, listed = _without_list(header)
    fields = _fields(header, ":")
    encoding = fields.get("encoding", "raw").lower()
    if encoding in ("bzip2", "bz2"):  # SimpleITK says so when it has taken the memory
        raise InputError(
            "voxels that are compressed by bzip2 cannot be read",
            where=str(path),
            got=f"encoding: {encoding}",
            expected="encoding: raw or gzip",
            hint="save it again with gzip",
        )
    is_packed, is_text = encoding in ("gzip", "gz"), encoding not in ("raw", "gzip", "gz")
    name = fields.get("data file") or fields.get("datafile")
    lines_skipped = fields.get("line skip") or fields.get("lineskip") or "0"
    order: str | None = {"little": "<", "big": ">"}.get(fields.get("endian", "").lower(), "|")
    if fields.get("byte skip", fields.get("byteskip", "0")) != "0" or lines_skipped != "0" or encoding != "raw":
        order = None
    stored: Stored = StoredVoxels(path, offset, is_packed, order, is_text)
    if name is not None:
        is_pattern = re.search("%[0-9]*d", name) is not None
        name = _plain_list(name, fields.get("dimension", ""))
        each = partial(StoredVoxels, offset=0, compressed=is_packed, byte_order=order, is_text=is_text)
        stored = _detached(path, name, listed, each, is_pattern=is_pattern)
    return stored, not is_packed or lines_skipped == "0"


def missing_spacing_note(path: Path) -> str | None:
    """Return a note for a NRRD or MetaImage file without voxel sizes, which are then 1; else None.

    Raises InputError if NRRD has NaN as the length of a spatial axis: SimpleITK takes it for 1.
    """
    if path.suffix.lower() in (".nrrd", ".nhdr"):
        fields = _fields(_without_list(_split(_head(path))[0])[0], ":")
        lengths, kinds = fields.get("spacings", "").split(), fields.get("kinds", "").lower().split()
        in_space = [k for k in range(len(lengths)) if k >= len(kinds) or kinds[k] in _KINDS_OF_SPACE][:3]
        if any(lengths[k].lower().lstrip("+-") == "nan" for k in in_space):
            raise InputError(
                "this NRRD header does not have the length of an axis",
                where=str(path),
                got=f"spacings: {fields['spacings']}",
                expected="a number for each axis of space",
                hint="correct that line; without it, voxels are 1 long",
            )
        is_said = bool(lengths) or "space directions" in fields
    elif path.suffix.lower() in (".mha", ".mhd"):
        is_said = _META_LENGTHS.search(_head(path)) is not None
    else:
        return None
    return None if is_said else "the file does not give its voxel size; 1 x 1 x 1 is assumed"


def metaimage_voxels(path: Path) -> Stored:
    """Return where the voxels of a MetaImage file are.

    Raises InputError for a damaged header, for one that SimpleITK would misread, and for a missing data file.
    """
    head = _head(path)
    start = head.find(b"\n", head.find(b"ElementDataFile")) + 1
    _, listed = _without_list(head)
    listed = list(map(str.rstrip, listed))  # as SimpleITK reads them
    fields = _fields(head[:start] if start else head, "=")
    missing = [key for key in ("NDims", "DimSize", "ElementType", "ElementDataFile") if key.lower() not in fields]
    if missing:
        raise InputError(
            "this is not a MetaImage header, or it is damaged",
            where=str(path),
            got="an empty file" if not head else None,
            expected=" and ".join(f"a line `{key} = ...`" for key in missing),
        )
    _check_numbers(head[:start] if start else head, path)
    _check_scale(fields, path)
    name = fields["elementdatafile"]
    compressed = fields.get("compresseddata", "False").lower() in ("true", "1")
    is_big = fields.get("binarydatabyteordermsb", fields.get("elementbyteordermsb", "")).lower()
    is_text = fields.get("binarydata", "True").lower() not in ("true", "1")
    skipped = int(float(fields.get("headersize", "0").split()[0]))
    order = None if compressed or is_text else {"false": "<", "true": ">", "0": "<", "1": ">"}.get(is_big, "|")
    if skipped:  # the voxels are a part of the file
        order = None
    num_compressed = int(float(fields.get("compresseddatasize", "0").split()[0])) if compressed else 0
    is_local = name.upper() == "LOCAL"
    _check_voxel_offset(path, start if is_local else None, skipped, compressed and not num_compressed, compressed)
    make = partial(StoredVoxels, compressed=compressed, byte_order=order, is_text=is_text)
    make = partial(make, num_compressed=num_compressed or None)
    if is_local:
        return make(path, start)
    each = partial(make, offset=max(0, skipped))  # -1: all that is before the voxels, whatever it is
    return _detached(path, _plain_list(name, fields["ndims"]), listed, each, is_pattern="%" in name)


def _check_voxel_offset(path: Path, start: int | None, skipped: int, is_open: bool, compressed: bool) -> None:
    """Raise InputError if SimpleITK would read the voxels of a MetaImage file from the wrong place.

    start: where they begin in the header's own file; None if they are in another file. skipped: HeaderSize. is_open:
        compressed voxels without a length, which are taken for a whole file.
    """
    if start is not None and skipped not in (0, start, -1):
        raise InputError(
            "this MetaImage header places the voxels elsewhere than behind it",
            where=str(path),
            got=f"HeaderSize = {skipped} with ElementDataFile = LOCAL",
            expected=f"HeaderSize = {start}, the bytes of the header, or none",
            hint="remove the line HeaderSize",
        )
    if compressed and skipped == -1:
        raise InputError(
            "this MetaImage header does not say where its compressed voxels begin",
            where=str(path),
            got="HeaderSize = -1",
            expected="HeaderSize = 0 or more, or none",
        )
    if is_open and (start is not None or skipped):
        num_bytes = path.stat().st_size - (start or 0)
        raise InputError(
            "this MetaImage header does not say how long its compressed voxels are",
            where=str(path),
            got="no CompressedDataSize",
            expected="CompressedDataSize = n, in bytes, before ElementDataFile",
            hint=f"n is {num_bytes} where nothing comes behind them" if start is not None else None,
        )


def _check_scale(fields: dict[str, str], path: Path) -> None:
    """Raise InputError if a MetaImage header asks for scaled values, which SimpleITK ignores."""
    for key, neutral in (("ElementToIntensityFunctionSlope", 1), ("ElementToIntensityFunctionOffset", 0)):
        text = fields.get(key.lower(), str(neutral))
        if not _DECIMAL.fullmatch(text) or float(text) != neutral:
            raise InputError(
                "MetaImage voxels that are to be scaled cannot be read",
                where=str(path),
                got=f"{key} = {printable_text(text)}",
                expected=f"{key} = {neutral}",
                hint="correct that line to have the values as they are in the file, or save scaled ones",
            )


def _check_numbers(header: bytes, path: Path) -> None:
    """Raise InputError unless a MetaImage header has all numbers that SimpleITK needs.

    SimpleITK takes missing numbers from the lines below, reads other words as 0, and writes to the terminal.
    """
    values = _words(header)

    def require(names: str, count: int, expected: str, is_right: Callable[[list[float]], bool]) -> None:
        for key in names.split():
            words = values.get(key.lower(), [])
            numbers = [float(word) for word in words[:count] if _DECIMAL.fullmatch(word)]
            if key.lower() not in values or (len(numbers) == count and is_right(numbers)):
                continue
            text = " ".join(words)
            raise InputError(
                "a line of this MetaImage header does not have the numbers that belong there",
                where=str(path),
                got=f"{key} = {printable_text(text)}",
                expected=f"{key} = {expected}",
                hint="correct that line, or save the file again",
            )

    def is_finite(found: list[float]) -> bool:
        return all(map(math.isfinite, found))

    require("NDims", 1, "2, 3 or 4", lambda found: found[0] in range(1, _MAX_DIMENSIONS + 1))
    n = int(float(values["ndims"][0]))
    require("HeaderSize", 1, "a whole number, or -1", lambda found: found[0] >= -1 and found[0].is_integer())
    require("CompressedDataSize", 1, "a whole number", lambda found: found[0] >= 0 and found[0].is_integer())
    require("DimSize", n, f"{n} whole numbers", lambda found: all(x >= 0 and x.is_integer() for x in found))
    expected = f"{n} numbers, none of them 0"
    require("ElementSpacing ElementSize", n, expected, lambda found: is_finite(found) and all(found))
    require("Offset Position Origin", n, f"{n} numbers", is_finite)
    require("CenterOfRotation", n, f"{n} numbers", is_finite)
    expected = f"{n * n} numbers, {n} linearly independent rows"
    require("TransformMatrix Rotation Orientation", n * n, expected, _are_independent)


def _words(header: bytes) -> dict[str, list[str]]:
    """Return the words of each MetaImage key, in lower case; they may continue on the lines below."""
    fields: dict[str, list[str]] = {}
    words = fields.setdefault("", [])
    for line in _text(header).splitlines():
        name, found, value = line.partition("=")
        if found:
            words = fields[name.strip().lower()] = []
        words += (value if found else line).split()
    return fields


def _are_independent(numbers: list[float]) -> bool:
    """Return whether the rows of a square matrix are finite and span space, whatever their lengths."""
    rows = np.reshape(numbers, (math.isqrt(len(numbers)), -1))
    largest = np.abs(rows).max(axis=1, keepdims=True)
    if not (np.isfinite(largest).all() and largest.all()):
        return False
    rows = rows / largest  # so that their squares neither overflow nor vanish
    return abs(float(np.linalg.det(rows / np.linalg.norm(rows, axis=1, keepdims=True)))) > _MIN_UNIT_VOLUME


def vtk_voxels(path: Path) -> StoredVoxels:
    """Return where the voxels of a legacy VTK file are: after the line with a lookup table, if any."""
    head = _head(path)
    start = head.find(b"\n", head.find(b"LOOKUP_TABLE")) + 1 if b"LOOKUP_TABLE" in head else 0
    kind = [*head.split(b"\n", 3), b"", b"", b""][2]
    return StoredVoxels(path, start, False, None, kind.strip().upper() == b"ASCII")


def has_dicom_magic(path: Path) -> bool:
    """Return whether a file begins like DICOM, with a preamble of 128 bytes and a mark."""
    with path.open("rb") as file:
        return file.read(132)[128:] == b"DICM"


def check_dicom_pixels(path: Path, num_bytes: int) -> None:
    """Raise InputError if a DICOM file ends before its pixels do: most versions of GDCM pad them with zeros.

    num_bytes: of the decoded pixels. Files without a visible pixel element, big-endian or deflated as a whole, are left
        to SimpleITK.
    """
    data = path.read_bytes()
    begin = data.find(PIXEL_DATA)
    if PIXEL_DATA + _ENCAPSULATED in data:
        is_whole = data.rfind(_SEQUENCE_END) > begin
    else:
        is_whole = begin < 0 or len(data) - begin >= num_bytes
    if not is_whole:
        raise InputError("this DICOM slice cannot be read", where=str(path), hint="the file is truncated or damaged")


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_MAX_HEADER_BYTES)


def _text(header: bytes) -> str:
    """Return a header as text, decoded as file names are, whatever its bytes."""
    return os.fsdecode(header)


def _split(head: bytes) -> tuple[bytes, int]:
    """Return the header, which ends at the first empty line, and where the data begin."""
    ends = [(at, at + len(mark)) for mark in (b"\n\n", b"\r\n\r\n") if (at := head.find(mark)) >= 0]
    end, begin = min(ends, default=(len(head), len(head)))
    return head[:end], begin


def _fields(header: bytes, mark: str) -> dict[str, str]:
    """Return `key: value` or `key = value` lines, keys in lower case."""
    fields = {}
    for line in _text(header).splitlines():
        key, found, value = line.partition(mark)
        if found and value.strip() and not line.startswith("#"):
            fields[key.strip().lower()] = value.strip()
    return fields


def _without_list(header: bytes) -> tuple[bytes, list[str]]:
    """Return the header up to a list of data files, and their names, up to an empty line or the end."""
    match = _LIST.search(header)
    if match is None:
        return header, []
    lines = (line.rstrip("\r") for line in _text(header[match.end() :]).split("\n"))
    return header[: match.end()], list(takewhile(bool, lines))


def _plain_list(name: str, num_axes: str) -> str:
    """Return `LIST` for a list that states that its files are slices; other names unchanged."""
    found = re.fullmatch(r"LIST\s+([0-9]{1,2})", name)
    return "LIST" if found and num_axes.strip() == str(int(found[1]) + 1) else name


def _detached(
    header: Path, name: str, listed: list[str], each: Callable[[Path], StoredVoxels], *, is_pattern: bool
) -> Stored:
    """Return the data files that `name` stands for: one file, the `listed` names below it, or a numbered pattern.

    each: makes the StoredVoxels of one file. is_pattern: whether SimpleITK takes the name for a pattern. Raises
        InputError for missing files, and for names that are unsafe to pass on.
    """
    numbered = _NUMBERED.fullmatch(name)
    if name == "LIST" and listed:
        return [each(_data_file(header, file)) for file in listed]
    if is_pattern and numbered is not None:
        first, last, step = map(int, numbered.groups()[1:])
        return [each(_data_file(header, numbered[1] % number)) for number in range(first, last + 1, step)]
    if not is_pattern and name.split(maxsplit=1)[0] != "LIST":
        return each(_data_file(header, name))
    raise InputError(
        "data files cannot be named in this way",
        where=str(header),
        got=name,
        expected="one file, LIST, or a pattern with first number, last and step, such as slice%03d.raw 1 60 1",
        hint="write LIST, and below it the name of the file of each slice on its own line",
    )


def _data_file(header: Path, name: str) -> Path:
    file = header.parent / name
    if not file.is_file():
        raise InputError(
            "the data file that this header names is not there",
            where=str(header),
            got=name,
            expected=f"a file {file}",
            hint="the two belong together: move or copy both",
        )
    return require_exists(file)
