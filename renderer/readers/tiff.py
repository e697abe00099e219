"""TIFF: one file with a slice per page, or a folder with a slice per file in natural order (`2.tif` before `10.tif`).

Plain strips of one sample a pixel are read here, other pixels by SimpleITK. It is not asked about anything else: it
reads a truncated file as a shorter stack and 16-bit floats as integers, and knows no spacing along z. The directories
of the file say all of that (TIFF revision 6.0; BigTIFF), as do the descriptions that ImageJ and OME writers put into
the first page. Spacing along z is taken from there, and is otherwise that along x: a resolution is often just that of
a screen, and slices as thick as pixels keep the shape of things.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import Image, affine, check_dtype, check_size, choose, describe_shape, existing, unreadable
from renderer.readers.itk import executed, open_itk, quiet_simpleitk, view_of
from renderer.volume import Array

SUFFIXES = (".tif", ".tiff")

_SUBFILE, _WIDTH, _HEIGHT, _BITS, _COMPRESSION, _PHOTOMETRIC, _DESCRIPTION = 254, 256, 257, 258, 259, 262, 270
_STRIPS, _ORIENTATION, _SAMPLES, _ROWS_PER_STRIP, _PREDICTOR = 273, 274, 277, 278, 317
_STRIP_BYTES, _X_RESOLUTION, _Y_RESOLUTION, _PLANAR, _RESOLUTION_UNIT = 279, 282, 283, 284, 296
_TILES, _TILE_BYTES, _SAMPLE_FORMAT = 324, 325, 339

# What all pages must share. SimpleITK relies on it: it writes beyond its memory when some are marked as previews.
_SHARED = (_SUBFILE, _BITS, _COMPRESSION, _PHOTOMETRIC, _ORIENTATION, _SAMPLES, _ROWS_PER_STRIP, _PLANAR, _PREDICTOR)

# TIFF field types: BYTE, ASCII, SHORT, LONG, RATIONAL, and BigTIFF's LONG8. Others carry nothing needed here.
_ASCII = 2
_FIELD_TYPES = {1: "B", _ASCII: "s", 3: "H", 4: "I", 5: "II", 16: "Q"}
_KINDS = {1: "u", 2: "i", 3: "f", 4: "u"}  # by sample format; 4 is "undefined", which readers take for unsigned
_MM_PER_UNIT = {2: 25.4, 3: 10.0}


@dataclass(frozen=True)
class _Page:
    """The fields of one image file directory, by tag."""

    fields: dict[int, tuple[Any, ...]]

    def number(self, tag: int, default: int) -> int:
        return int(self.fields.get(tag, (default,))[0])

    @property
    def size(self) -> tuple[int, int]:
        return self.number(_WIDTH, 0), self.number(_HEIGHT, 0)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of one sample, decoded; samples that are no number of 8, 16, 32 or 64 bits are opaque bytes (kind V)."""
        bits, kind = max(8, self.number(_BITS, 1)), _KINDS.get(self.number(_SAMPLE_FORMAT, 1), "V")
        return np.dtype(f"{kind if bits in (8, 16, 32, 64) else 'V'}{-(-bits // 8)}")

    def difference(self, other: _Page) -> str | None:
        """What sets the page apart from `other`, in words, or None when both can be slices of one volume."""
        if self.size != other.size or self.dtype != other.dtype:
            return f"{describe_shape(self.size)} {self.dtype.name}"
        odd = [tag for tag in _SHARED if self.number(tag, 0) != other.number(tag, 0)]
        return f"{self.number(odd[0], 0)} in TIFF field {odd[0]}" if odd else None

    @property
    def chunks(self) -> list[tuple[int, int]]:
        """(offset, number of bytes) of each strip or tile."""
        offsets = self.fields.get(_STRIPS) or self.fields.get(_TILES) or ()
        counts = self.fields.get(_STRIP_BYTES) or self.fields.get(_TILE_BYTES) or ()
        return list(zip(offsets, counts, strict=False))


def read_tiff(path: Path, time: int | None, component: int | None) -> Image:
    """The stack in one file; hyperstacks of ImageJ and OME choose by `time` and `component` (the channel).

    Raises InputError for truncated, foreign and inconsistent files.
    """
    where = str(path)
    order, pages = _pages(path)
    first = pages[0]
    for number, page in enumerate(pages):
        if page.difference(first):
            raise InputError(
                "the pages differ",
                where=where,
                got=f"{page.difference(first)} on page {number + 1}",
                expected=f"{first.difference(page)} as on page 1",
                hint="previews among the slices? save the slices alone",
            )
    check_dtype(first.dtype, where)
    num_samples = first.number(_SAMPLES, 1)
    check_size((*first.size, len(pages), num_samples), first.dtype, where)
    description = _text(first)
    axes, counts = _hyperstack(description, len(pages), where)
    step = choose("time", time, counts[axes.index("T")], where)
    values = _decoded(path, order, pages, where)
    if num_samples > 1:
        return Image(values[..., choose("component", component, num_samples, where)], _world_from_index(first))
    channel = choose("component", component, counts[axes.index("C")], where)
    stack = np.moveaxis(values.reshape(*counts, *values.shape[1:]), [axes.index("T"), axes.index("C")], [0, 1])
    return Image(stack[step, channel], _world_from_index(first))


def read_tiff_folder(folder: Path, files: list[Path], component: int | None) -> Image:
    """One slice from each of `files`, which are sorted naturally here; raises InputError when they differ."""
    files = sorted(files, key=_natural)
    values, first = None, None
    for index, file in enumerate(files):
        order, pages = _pages(existing(file))
        page = pages[0]
        first = first or page
        if len(pages) > 1:
            raise InputError(
                "a file among these slices has several pages",
                where=str(file),
                got=f"{len(pages)} pages",
                expected="a slice in each file, or one file with all slices",
            )
        if page.difference(first):
            raise InputError(
                "the slices of this folder differ",
                where=str(file),
                got=page.difference(first),
                expected=f"{first.difference(page)} as in {files[0].name}",
            )
        num_samples = page.number(_SAMPLES, 1)
        channel = choose("component", component, num_samples, str(file))
        if values is None:
            check_dtype(first.dtype, str(file))
            check_size((*first.size, len(files)), first.dtype, str(folder))
            values = np.empty((len(files), first.size[1], first.size[0]), first.dtype)
        values[index] = _decoded(file, order, pages, str(file)).reshape(*values.shape[1:], num_samples)[..., channel]
    assert values is not None, "called without files"
    assert first is not None
    return Image(values, _world_from_index(first))


def _natural(path: Path) -> tuple[list[tuple[int, int, str]], str]:
    """A sort key in which runs of digits count as numbers; the name itself breaks ties such as `1.tif` and `01.tif`."""
    parts = re.split(r"(\d+)", path.name.lower())
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts], path.name


def _decoded(path: Path, order: str, pages: list[_Page], where: str) -> Array:
    """[page, y, x] or [page, y, x, sample]."""
    first = pages[0]
    num_samples, is_plain = first.number(_SAMPLES, 1), first.number(_COMPRESSION, 1) == 1
    # SimpleITK would turn tiles into 8-bit colours, float16 into integers, and refuses 64 bits.
    if any(_TILES in page.fields for page in pages):
        raise _undecodable(where, first)
    if is_plain and num_samples == 1 and first.number(_BITS, 1) == 8 * first.dtype.itemsize:
        return _plain_strips(path, order, pages)
    if first.dtype.itemsize == 8 or first.dtype == np.float16:
        raise _undecodable(where, first)
    with quiet_simpleitk() as sitk:
        values = view_of(sitk, executed(open_itk(sitk, path), path))
    shape = (len(pages), first.size[1], first.size[0])
    if values.dtype != first.dtype or values.size != np.prod(shape) * num_samples:
        raise _undecodable(where, first)
    return values.reshape(*shape, num_samples) if num_samples > 1 else values.reshape(shape)


def _plain_strips(path: Path, order: str, pages: list[_Page]) -> Array:
    """[page, y, x], uncompressed, in native byte order."""
    first = pages[0]
    values = np.empty((len(pages), first.size[1], first.size[0]), first.dtype)
    stored = np.dtype(order + first.dtype.str[1:])
    with path.open("rb") as file:
        for page, target in zip(pages, values, strict=True):
            plane = bytearray()
            for offset, num_bytes in page.chunks:
                file.seek(offset)
                plane += file.read(num_bytes)
            target[...] = np.frombuffer(plane, stored, target.size).reshape(target.shape)
    return values


def _undecodable(where: str, page: _Page) -> InputError:
    return InputError(
        "this kind of TIFF cannot be decoded",
        where=where,
        got=f"{page.dtype.name}, {'tiles' if _TILES in page.fields else 'strips'}, "
        f"compression {page.number(_COMPRESSION, 1)}, {page.number(_SAMPLES, 1)} samples a pixel",
        expected="strips of 8 to 32 bits, or uncompressed strips of one float16, float64 or 64-bit integer a pixel",
        hint="save it as NRRD or .npy",
    )


def _pages(path: Path) -> tuple[str, list[_Page]]:
    """The byte order, `<` or `>`, and all pages; raises InputError when the file ends before what they point to."""
    num_file_bytes = path.stat().st_size
    pages: list[_Page] = []
    try:
        with path.open("rb") as file:
            mark = file.read(4)
            order = {b"II": "<", b"MM": ">"}.get(mark[:2], "")
            version = struct.unpack(order + "H", mark[2:])[0] if order and len(mark) == 4 else 0
            if version not in (42, 43):
                raise InputError(
                    "this is not a TIFF file", where=str(path), got="an empty file" if num_file_bytes == 0 else None
                )
            is_big = version == 43
            file.seek(8 if is_big else 4)
            offset = _unpack(file, order + ("Q" if is_big else "I"))[0]
            seen = set()
            while offset and offset not in seen:
                seen.add(offset)
                file.seek(offset)
                page, offset = _directory(file, order, is_big, num_file_bytes)
                pages.append(page)
    except OSError as error:
        raise unreadable(path, error) from error
    except struct.error as error:
        raise InputError(
            "the file ends within its directory",
            where=str(path),
            got=f"{num_file_bytes} bytes, {len(pages)} complete pages",
            hint="the file is truncated",
        ) from error
    _check_complete(path, pages, num_file_bytes)
    return order, pages


def _check_complete(path: Path, pages: list[_Page], num_file_bytes: int) -> None:
    """Raise InputError unless every page has pixels, all within the file."""
    if not pages or not all(page.chunks and min(page.size) > 0 for page in pages):
        raise InputError("this TIFF file holds no image", where=str(path), hint="the file is truncated or damaged")
    end = max(offset + num_bytes for page in pages for offset, num_bytes in page.chunks)
    if end > num_file_bytes:
        raise InputError(
            "the file is shorter than its directory says",
            where=str(path),
            got=f"{num_file_bytes} bytes",
            expected=f"{end} bytes",
            hint="the file is truncated",
        )
    for number, page in enumerate(pages):
        num_samples, bits = page.number(_SAMPLES, 1), page.number(_BITS, 1)
        needed = page.size[0] * page.size[1] * num_samples * bits // 8
        found = sum(num_bytes for _, num_bytes in page.chunks)
        if page.number(_COMPRESSION, 1) == 1 and page.number(_PLANAR, 1) == 1 and found < needed:
            raise InputError(
                f"page {number + 1} has fewer pixels than its size says",
                where=str(path),
                got=f"{found} bytes",
                expected=f"{needed} bytes ({describe_shape(page.size)} pixels)",
                hint="the file is damaged",
            )


def _directory(file: BinaryIO, order: str, is_big: bool, num_file_bytes: int) -> tuple[_Page, int]:
    """The image file directory at the file's position, and the offset of the next one (0: none).

    Raises struct.error where the file ends too early.
    """
    count = _unpack(file, order + ("Q" if is_big else "H"))[0]
    entries = [_unpack(file, order + ("HHQ8s" if is_big else "HHI4s")) for _ in range(min(count, 65535))]
    following = _unpack(file, order + ("Q" if is_big else "I"))[0]
    fields = {}
    for tag, kind, length, inline in entries:
        if kind not in _FIELD_TYPES:
            continue
        num_bytes = struct.calcsize(order + _FIELD_TYPES[kind]) * length
        if num_bytes > len(inline):
            place = struct.unpack(order + ("Q" if is_big else "I"), inline)[0]
            if place + num_bytes > num_file_bytes:
                raise struct.error("a field lies beyond the end of the file")
            file.seek(place)
            inline = file.read(num_bytes)  # noqa: PLW2901
        if (kind == _ASCII) == (tag == _DESCRIPTION):
            code = f"{length}s" if kind == _ASCII else _FIELD_TYPES[kind] * length
            fields[tag] = struct.unpack(order + code, inline[:num_bytes])
    return _Page(fields), int(following)


def _unpack(file: BinaryIO, code: str) -> tuple[Any, ...]:
    return struct.unpack(code, file.read(struct.calcsize(code)))


def _text(page: _Page) -> str:
    return bytes(page.fields.get(_DESCRIPTION, (b"",))[0]).decode("utf-8", "replace")


def _hyperstack(description: str, num_pages: int, where: str) -> tuple[str, list[int]]:
    """The axes of the pages from slowest to fastest, a permutation of `TZC`, and how many there are of each."""
    if description.startswith("ImageJ="):
        declared = {key: int(value) for key, value in re.findall(r"^(channels|slices|frames)=(\d+)", description, re.M)}
        axes = "TZC"
        by_axis = {"T": declared.get("frames", 1), "C": declared.get("channels", 1)}
        images = re.search(r"^images=(\d+)", description, re.M)
        total = int(images[1]) if images else num_pages
        by_axis["Z"] = declared.get("slices", total // (by_axis["T"] * by_axis["C"]) if images else num_pages)
    elif "<OME" in description:
        order = re.search(r'DimensionOrder="XY([CZT]{3})"', description)
        axes = order[1][::-1] if order else "TZC"
        by_axis = {axis: int(_ome(description, f"Size{axis}") or 1) for axis in "TZC"}
    else:
        return "TZC", [1, num_pages, 1]
    counts = [by_axis[axis] for axis in axes]
    if int(np.prod(counts)) != num_pages:
        raise InputError(
            "the description in this TIFF file does not fit its pages",
            where=where,
            got=f"{num_pages} pages",
            expected=" x ".join(f"{by_axis[axis]} {axis}" for axis in axes),
            hint="save it again as a plain stack, all slices in one file",
        )
    return axes, counts


def _ome(description: str, attribute: str) -> float | None:
    found = re.search(rf'\b{attribute}="([0-9.eE+-]+)"', description)
    return float(found[1]) if found else None


def _world_from_index(first: _Page) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Spacing in mm where the resolution is per inch or cm, in the file's unit for ImageJ and OME, else 1."""
    description = _text(first)
    spacing: list[float | None] = [None, None, None]
    mm = _MM_PER_UNIT.get(first.number(_RESOLUTION_UNIT, 2))
    is_imagej = description.startswith("ImageJ=")
    if "<OME" in description:
        spacing = [_ome(description, f"PhysicalSize{axis}") for axis in "XYZ"]
    elif mm is not None or is_imagej:
        for axis, tag in enumerate((_X_RESOLUTION, _Y_RESOLUTION)):
            numerator, denominator = (*first.fields.get(tag, ()), 0, 0)[:2]
            if numerator and denominator:
                spacing[axis] = denominator / numerator * (mm or 1.0)
        along_z = re.search(r"^spacing=([0-9.eE+-]+)", description, re.M) if is_imagej else None
        spacing[2] = abs(float(along_z[1])) * (mm or 1.0) if along_z else None
    x = spacing[0] or 1.0
    return affine([x, spacing[1] or x, spacing[2] or x], np.zeros(3), np.eye(3))
