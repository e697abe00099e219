"""Read TIFF: one file with a slice per page, or a folder with a slice per file in natural order (`2.tif` before
`10.tif`).

Plain strips and tiles of one sample a pixel are read here, other pixels by SimpleITK. SimpleITK is used for nothing
else: it reads a truncated file as a shorter stack and 16-bit floats as integers, and knows no spacing along z. The
directories of the file have all of that (TIFF revision 6.0; BigTIFF), as have the descriptions that ImageJ and OME
write into the first page. Spacing along z is taken from there, and otherwise equals that along x: a resolution is often
just that of a screen, and slices as thick as pixels keep proportions.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import Image, affine, check_dtype, check_size, require_exists, select_index
from renderer.readers.itk import array_view, open_itk, quiet_simpleitk, read_image
from renderer.readers.slice_names import sort_slices
from renderer.readers.tiff_description import MM_PER_UNIT, hyperstack, imagej_spacing, is_imagej, is_ome, ome_spacing
from renderer.readers.tiff_directory import (
    BITS,
    COMPRESSION,
    RESOLUTION_UNIT,
    SAMPLES,
    TILE_HEIGHT,
    TILE_WIDTH,
    Page,
    read_pages,
)
from renderer.volume import Array, Float64

SUFFIXES = (".tif", ".tiff")

# Compressions that every build of libtiff has, by number, and the names of others.
_COMMON_COMPRESSIONS = (1, 5, 7, 8, 32773, 32946)
_COMPRESSIONS = {
    6: "old-style JPEG",
    33003: "JPEG 2000",
    33005: "JPEG 2000",
    34712: "JPEG 2000",
    34887: "LERC",
    34925: "LZMA",
    34926: "Zstandard",
    34927: "WebP",
    34933: "PNG",
    34934: "JPEG XR",
    50000: "Zstandard",
    50001: "WebP",
    50002: "JPEG XL",
    52546: "JPEG XL",
}


def read_tiff(path: Path, time: int | None, component: int | None, *, has_spacing_override: bool = False) -> Image:
    """Read the stack in one file; `time` and `component` (the channel) choose in hyperstacks of ImageJ and OME.

    has_spacing_override: the scene gives the spacing, so that lengths in the file are not checked.
    Raises InputError for truncated, foreign and inconsistent files.
    """
    where = str(path)
    order, pages = read_pages(path)
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
    num_samples = first.number(SAMPLES, 1)
    check_size((*first.size, len(pages), num_samples), first.dtype, where)
    description = _text(first)
    axes, counts = hyperstack(description, len(pages), where)
    step = select_index("time", time, counts[axes.index("T")], where)
    world_from_index = _world_from_index(first, where, has_spacing_override)
    values = _decoded(path, order, pages, where)
    if num_samples > 1:
        return Image(values[..., select_index("component", component, num_samples, where)], world_from_index)
    channel = select_index("component", component, counts[axes.index("C")], where)
    stack = np.moveaxis(values.reshape(*counts, *values.shape[1:]), [axes.index("T"), axes.index("C")], [0, 1])
    return Image(stack[step, channel], world_from_index)


def read_tiff_folder(
    folder: Path, files: list[Path], component: int | None, *, has_spacing_override: bool = False
) -> Image:
    """Read one slice from each of `files`, sorted by their names.

    has_spacing_override: as in `read_tiff`. Raises InputError if the slices differ or their names do not make up one
        stack.
    """
    files = sort_slices(folder, files)
    values, first = None, None
    for index, file in enumerate(files):
        order, pages = read_pages(require_exists(file))
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
        num_samples = page.number(SAMPLES, 1)
        channel = select_index("component", component, num_samples, str(file))
        if values is None:
            check_dtype(first.dtype, str(file))
            check_size((*first.size, len(files), num_samples), first.dtype, str(folder))
        plane = _decoded(file, order, pages, str(file)).reshape(*first.size[::-1], num_samples)[..., channel]
        if values is None:  # allocated only after one slice has been read
            values = np.empty((len(files), *plane.shape), first.dtype)
        values[index] = plane
    assert values is not None, "called without files"
    assert first is not None
    return Image(values, _world_from_index(first, str(files[0]), has_spacing_override))


def _decoded(path: Path, order: str, pages: list[Page], where: str) -> Array:
    """Return the pixels [page, y, x] or [page, y, x, sample]."""
    first = pages[0]
    num_samples, num_tiled = first.number(SAMPLES, 1), sum(page.has_tiles for page in pages)
    if first.number(COMPRESSION, 1) == 1 and num_samples == 1 and first.number(BITS, 1) == 8 * first.dtype.itemsize:
        if num_tiled == len(pages):
            return _plain_tiles(path, order, pages)
        if not num_tiled:
            return _plain_strips(path, order, pages)
    # SimpleITK would turn tiles into 8-bit colours, float16 into integers, and refuses 64 bits.
    if num_tiled:
        raise _undecodable(where, first)
    if first.dtype.itemsize == 8 or first.dtype == np.float16:
        raise _undecodable(where, first)
    try:
        with quiet_simpleitk() as sitk:
            values = array_view(sitk, read_image(open_itk(sitk, path), path))
    except InputError as error:
        if first.number(COMPRESSION, 1) in _COMMON_COMPRESSIONS:
            raise
        raise _unknown_compression(where, first, error.got) from error
    shape = (len(pages), first.size[1], first.size[0])
    if values.dtype != first.dtype or values.size != np.prod(shape) * num_samples:
        raise _undecodable(where, first)
    return values.reshape(*shape, num_samples) if num_samples > 1 else values.reshape(shape)


def _plain_strips(path: Path, order: str, pages: list[Page]) -> Array:
    """Return uncompressed strips as [page, y, x] in native byte order; bytes beyond a page's size are not read.

    Raises InputError if the file becomes shorter during reading.
    """
    first = pages[0]
    is_native = np.dtype(order + first.dtype.str[1:]).isnative
    values = np.empty((len(pages), first.size[1], first.size[0]), first.dtype)
    with path.open("rb") as file:
        for page, target in zip(pages, values, strict=True):
            plane = memoryview(target.reshape(-1).view(np.uint8))
            begin = 0
            for offset, num_bytes in zip(page.offsets, page.lengths, strict=True):
                end = min(begin + int(num_bytes), len(plane))
                file.seek(int(offset))
                if file.readinto(plane[begin:end]) < end - begin:
                    raise InputError("the file has become shorter while it was read", where=str(path))
                begin = end
                if begin == len(plane):
                    break
            if not is_native:
                target.byteswap(inplace=True)
    return values


def _plain_tiles(path: Path, order: str, pages: list[Page]) -> Array:
    """Return uncompressed tiles as [page, y, x] in native byte order, without the parts beyond the edges.

    Raises InputError unless each page has all its tiles, and the file all of their bytes.
    """
    first = pages[0]
    stored = np.dtype(order + first.dtype.str[1:])
    width, height = first.number(TILE_WIDTH, 0), first.number(TILE_HEIGHT, 0)
    ys, xs = range(0, first.size[1], height or 1), range(0, first.size[0], width or 1)
    num_tiles, num_bytes, num_file_bytes = len(ys) * len(xs), width * height * stored.itemsize, path.stat().st_size
    is_damaged = any(len(page.offsets) < num_tiles or page.lengths.min() < num_bytes for page in pages)
    if not num_bytes or is_damaged or num_bytes * num_tiles * len(pages) > num_file_bytes:
        raise InputError(
            "the tiles of this TIFF file do not make up its pages",
            where=str(path),
            got=f"{len(first.offsets)} tiles, {int(first.lengths.min())} bytes the smallest; "
            f"a file of {num_file_bytes} bytes",
            expected=f"{num_tiles} tiles of {width} x {height} pixels, {num_bytes} bytes each, "
            f"on each of {len(pages)} pages",
            hint="the file is damaged",
        )
    values = np.empty((len(pages), first.size[1], first.size[0]), first.dtype)
    with path.open("rb") as file:
        for page, target in zip(pages, values, strict=True):
            for (y, x), offset in zip(product(ys, xs), page.offsets, strict=False):
                file.seek(int(offset))
                data = file.read(num_bytes)
                if len(data) < num_bytes:
                    raise InputError("the file has become shorter while it was read", where=str(path))
                part = target[y : y + height, x : x + width]
                part[...] = np.frombuffer(data, stored).reshape(height, width)[: part.shape[0], : part.shape[1]]
    return values


def _unknown_compression(where: str, page: Page, reason: str | None) -> InputError:
    """Return the error for a compression that this build of SimpleITK may lack."""
    number = page.number(COMPRESSION, 1)
    name = _COMPRESSIONS.get(number)
    return InputError(
        "this TIFF file's compression is not supported",
        where=where,
        got=f"compression {number}" + f", {name}" * (name is not None) + f": {reason}" * (reason is not None),
        expected="no compression, LZW, Deflate, PackBits or JPEG",
        hint="save it again without compression or with Deflate, or as NRRD or .npy",
    )


def _undecodable(where: str, page: Page) -> InputError:
    return InputError(
        "this kind of TIFF cannot be decoded",
        where=where,
        got=f"{page.dtype.name}, {'tiles' if page.has_tiles else 'strips'}, "
        f"compression {page.number(COMPRESSION, 1)}, {page.number(SAMPLES, 1)} samples a pixel",
        expected="strips of 8 to 32 bits, or uncompressed strips or tiles of one sample a pixel",
        hint="save it as NRRD or .npy",
    )


def _text(page: Page) -> str:
    return page.description.decode("utf-8", "replace")


def _world_from_index(first: Page, where: str, has_spacing_override: bool) -> Float64:
    """Return the affine of a stack, with spacing 1 if its lengths make no sense and `has_spacing_override` is set."""
    try:
        spacing = _spacing(first, where)
    except InputError:
        if not has_spacing_override:
            raise
        spacing = [1.0, 1.0, 1.0]
    if has_spacing_override and not np.isfinite(spacing).all():
        spacing = [1.0, 1.0, 1.0]
    return affine(spacing, np.zeros(3), np.eye(3))


def _spacing(first: Page, where: str) -> list[float]:
    """Return the spacing along x, y, z: in mm if the resolution is per inch or cm, else in the description's unit,
    else 1."""
    description = _text(first)
    sizes: list[float | None] = [below / above if above and below else None for above, below in first.resolution]
    spacing: list[float | None] = [None, None, None]
    if is_ome(description):
        spacing = ome_spacing(description, where)
    elif is_imagej(description):
        spacing = imagej_spacing(description, sizes, first.numbers.get(RESOLUTION_UNIT), where)
    elif (mm := MM_PER_UNIT.get(first.number(RESOLUTION_UNIT, 2))) is not None:
        spacing = [size and size * mm for size in sizes] + [None]
    x = spacing[0] or 1.0
    return [x, spacing[1] or x, spacing[2] or x]
