"""Read TIFF: one file with a slice per page, or a folder with a slice per file in natural order (`2.tif` before
`10.tif`).

tifffile parses and decodes, in a child process (`isolation.py`). Values are the stored numbers: a palette, or white at
0, is not applied, and a note says so (`tiff_statements.py`). Smaller previews among the pages are left out. Axes and
spacing come from the descriptions that ImageJ, OME, tifffile and Zeiss write into the first page, and from the
resolution (`tiff_description.py`, `tiff_spacing.py`). Planes of OME may be in files beside this one.
"""

from __future__ import annotations

import logging
import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError, require_package
from renderer.readers.components import choose, select_index
from renderer.readers.file_errors import damaged_error, errors_about, require_exists
from renderer.readers.image import Image
from renderer.readers.isolation import Host, allocate_voxels
from renderer.readers.orientation import oriented
from renderer.readers.slice_names import require_alike, sort_slices
from renderer.readers.sniff import TIFF_SUFFIXES
from renderer.readers.tiff_channels import find_channels
from renderer.readers.tiff_description import (
    Page,
    num_planes_by_description,
    page_layout,
    page_places,
    pages_of_first_image,
)
from renderer.readers.tiff_imagej import find_calibration, with_origin
from renderer.readers.tiff_ome import note_of as note_of_ome
from renderer.readers.tiff_spacing import find_spacing
from renderer.readers.tiff_statements import note_of, orientation, sample_names, stated_orientations
from renderer.readers.tiff_times import find_times
from renderer.readers.units import Units, units_of
from renderer.scene import join_some, short_text
from renderer.system import number_in
from renderer.volume import Array, Float64

# The number of the first private field of TIFF. Programs may write anything into private fields.
_FIRST_PRIVATE = 32768
# The numbers of the private fields with the depth of an image and of its tiles. Errors in these two fields count.
_DEPTHS = (32997, 32998)
# The number of the field with the planes of MetaMorph, a program for microscopes.
_METAMORPH_PLANES = 33629
# The number of GDAL's field with the value that stands for no data.
_GDAL_NODATA = 42113


def read_tiff(path: Path, time: int | None, component: int | None, *, has_spacing_override: bool, host: Host) -> Image:
    """Read the stack in one file, or in a folder of slices.

    time, component: the chosen step and component; channels of ImageJ and OME are components.
    has_spacing_override: the scene gives the spacing, so that lengths in the file are not checked. Raises InputError
        for truncated, foreign and inconsistent files.
    """
    if path.is_dir():
        select_index("time", time, 1)
        return _read_folder(path, component, has_spacing_override=has_spacing_override, host=host)
    if path.suffix.lower() == ".ome":
        raise InputError(
            "this is the description of an OME-TIFF in several files, which has no pixels itself",
            hint="render the first of the .tif files beside it",
        )
    with _open_pages(path) as every_page:
        pages, note_on_images = pages_of_first_image(every_page)
        first = pages[0]
        slices = _slices(pages, first)
        num_planes = len(slices) if len(slices) > 1 else _num_contiguous(first, path)
        layout = page_layout(first, num_planes)
        num_components = layout.count("C") * first.samplesperpixel
        chosen = choose("tc", (layout.count("T"), num_components), time, component, sample_names(first))
        channel, sample = divmod(chosen.component, first.samplesperpixel)
        part = choose(layout.axes.lower(), layout.counts, time, channel).part
        places = page_places(first.description, path.name, layout)
        planes = [places[k] for k in np.reshape(range(len(places)), layout.counts)[part].ravel()]
        calibration = find_calibration(first)
        shape = (len(planes), first.imagelength, first.imagewidth)
        values = allocate_voxels(host, shape, calibration.dtype(_dtype(first)))
        for name in sorted({name for name, _ in planes}):
            file = _sibling(path, name) if name else path
            host.begin_file(file)
            numbers = {k: number for k, (other, number) in enumerate(planes) if other == name}
            with _open_pages(file) if name else nullcontext(pages) as own:
                _fill(values, numbers, _slices(own, first), sample, file)
        calibration.apply(values)
        world_from_index, units, note_on_lengths = _world_from_index(first, layout.space, has_spacing_override)
        channels = find_channels(first, layout, chosen.channels)
        nodata, steps = calibration.of_ranges(_nodata(first)), find_times(first.description, layout.count("T"))
        notes_on_page = (calibration.note, note_of(first), note_of_ome(first.description))
    num_left_out = len(pages) - len(slices)
    note = f"{num_left_out} smaller previews among the pages are left out" if num_left_out else None
    all_notes = (note_on_images, note, note_on_lengths, layout.note, *notes_on_page, *chosen.notes)
    units = units_of(units.length_unit, value=calibration.unit)
    return Image(values, world_from_index, all_notes, nodata, channels, steps=steps, units=units)


def _slices(pages: list[Page], first: Page) -> list[Page]:
    """Return the pages of a file without previews; raises InputError unless all are like the first slice."""
    slices = [page for page in pages if not _is_preview(page, first)]
    for page in slices:
        if _describe(page) != _describe(first):
            raise InputError(
                "the pages differ",
                got=f"{_describe(page)} on page {page.index + 1}",
                expected=f"{_describe(first)} as on page 1",
                hint="previews among the slices? save the slices alone",
            )
    turns = sorted(stated_orientations(slices))
    if len(turns) > 1:
        raise InputError("the pages differ", got=f"Orientation {join_some([*map(str, turns)])}", expected="one for all")
    return slices


def _sibling(path: Path, name: str) -> Path:
    """Return the path of a file that an OME-TIFF names; raises InputError if it is not in the same folder."""
    if not (path.parent / name).is_file():
        raise InputError(
            "a file that this OME-TIFF names is not beside it",
            got=short_text(name),
            hint="an image in several files needs all of them: move or copy all, and do not rename them",
        )
    if not Path(os.path.realpath(path.parent / name)).is_relative_to(os.path.realpath(path.parent)):
        what = "a file that this OME-TIFF names is a link to another folder"
        raise InputError(what, got=short_text(name), hint="copy all of them into one folder")
    return require_exists(path.parent / name)


def _fill(values: Array, numbers: dict[int, int], slices: list[Page], sample: int, path: Path) -> None:
    """Decode pages of a file into slices of `values`.

    numbers: the index of the page of each slice, by the index of the slice. Raises InputError for pages that the file
    does not have.
    """
    num_planes = _num_contiguous(slices[0], path) if len(slices) == 1 else len(slices)
    for k, number in numbers.items():
        if number >= num_planes:
            raise InputError(
                "the description places planes on pages that this file lacks", got=f"page {number + 1} of {num_planes}"
            )
        is_page = number < len(slices)
        values[k] = _plane(slices[number], sample, path) if is_page else _contiguous_plane(slices[0], number, path)


def _read_folder(folder: Path, component: int | None, *, has_spacing_override: bool, host: Host) -> Image:
    """Read one slice from each TIFF file in a folder, sorted by their names.

    has_spacing_override: the scene gives the spacing, so that lengths in the files are not checked. Raises InputError
        if the slices differ or their names do not make up one stack.
    """
    entries = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
    files = sort_slices([entry for entry in entries if entry.suffix.lower() in TIFF_SUFFIXES])
    image, expected = None, ""
    for index, file in enumerate(files):
        host.begin_file(file)
        with _open_pages(require_exists(file)) as pages:
            page = pages[0]
            calibration = find_calibration(page)
            turn = orientation(page)
            found = f"{_describe(page)}{f' of Orientation {turn}' * (turn > 1)}"
            found += ", calibrated by ImageJ" * bool(calibration.coefficients)
            expected = expected or found
            if not all(_is_preview(other, page) for other in pages[1:]):
                raise InputError(
                    "a file among these slices has several pages",
                    got=f"{len(pages)} pages",
                    expected="a slice in each file, or one file with all slices",
                )
            require_alike(found, expected, files[0])
            chosen = choose("c", (page.samplesperpixel,), None, component, sample_names(page))
            plane = _plane(page, chosen.component, file)
            if image is None:  # allocated only after one slice has been read
                with errors_about(folder):
                    values = allocate_voxels(host, (len(files), *plane.shape), calibration.dtype(_dtype(page)))
                world_from_index, units, note = _world_from_index(page, "XYZ", has_spacing_override)
                notes = (note, calibration.note, note_of(page), note_of_ome(page.description), *chosen.notes)
                nodata, units = calibration.of_ranges(_nodata(page)), units_of(units.length_unit, "", calibration.unit)
                image = Image(values, world_from_index, notes, nodata, chosen.channels, units=units)
            image.values[index] = plane
            calibration.apply(image.values[index : index + 1])
    assert image is not None, "called without files"
    return image


@contextmanager
def _open_pages(path: Path) -> Iterator[list[Page]]:
    """Yield the pages of a file, at least one, each with pixels inside the file.

    Raises InputError for a file that is not TIFF, or whose directories are truncated or damaged.
    """
    import tifffile

    damage = _Damage(logging.ERROR)
    logging.getLogger("tifffile").addHandler(damage)
    try:
        with errors_about(path), tifffile.TiffFile(path) as tiff:
            # tifffile gives pages of a Zeiss LSM as its class TiffFrame, which lacks most fields, but has the right
            # places of the pixels.
            frames = list(tiff.pages)
            pages = [frame.aspage() if frame.is_frame else frame for frame in frames]
            for page, frame in zip(pages, frames, strict=True):
                page.dataoffsets, page.databytecounts = frame.dataoffsets, frame.databytecounts
            if damage.num_errors:
                raise tifffile.TiffFileError
            _check_pages(pages, tiff.filehandle.size)
            yield pages
    except tifffile.TiffFileError as error:
        raise InputError(
            "this is not a TIFF file, or its directories are damaged",
            where=str(path),
            expected="II or MM and 42 or 43, by which TIFF and BigTIFF begin, and pages and fields inside the file",
            hint="the file is truncated or damaged",
        ) from error
    finally:
        logging.getLogger("tifffile").removeHandler(damage)


class _Damage(logging.Handler):
    """A counter of the errors that tifffile logs when it leaves out damaged pages and fields.

    Errors in private fields do not count, except for those of _DEPTHS, as programs write anything into such fields.
    """

    num_errors = 0

    def emit(self, record: logging.LogRecord) -> None:
        field = re.search(r"TiffTag ([0-9]+) @", record.getMessage())
        number = int(field[1]) if field else 0
        self.num_errors += number < _FIRST_PRIVATE or number in _DEPTHS


def _check_pages(pages: list[Page], num_file_bytes: int) -> None:
    """Raise InputError unless every page has one plane, all pixels are inside the file, and pages share no bytes."""
    if not pages or not all(np.prod(page.shaped, dtype=object) for page in pages):
        raise damaged_error("this TIFF file holds no image")
    if any(page.imagedepth > 1 for page in pages) or (len(pages) == 1 and _has_unlisted_planes(pages[0])):
        raise InputError(
            "this TIFF file has several planes in a page, or planes without one",
            hint="save it again as a plain stack, with a page for each plane",
        )
    for number, page in enumerate(pages, 1):
        if page.dtype is None:
            raise InputError(
                "voxels of this type cannot be rendered",
                got=f"{page.bitspersample} bits of the sample format {page.sampleformat}",
                expected="integers of up to 32 bits and of 64, or floats of 16, 32 or 64",
            )
        if page.dtype.kind == "u" and page.bitspersample == 24:  # tifffile takes them in the wrong byte order
            raise InputError(
                "pixels of this type cannot be read",
                got=f"integers of 24 bits on page {number}",
                hint="save them with 32 bits",
            )
        offsets, lengths = page.dataoffsets, page.databytecounts
        num_segments = int(np.prod(page.chunked, dtype=object))
        is_there = len(offsets) >= num_segments <= len(lengths) and min(offsets) > 0 and min(lengths) > 0
        end = max(map(sum, zip(offsets, lengths, strict=False)), default=0)
        needed = _num_plain_bytes(page) if page.compression == 1 else 0
        if not is_there or end > num_file_bytes or sum(lengths) < needed:
            got = f"{len(offsets)} strips or tiles up to byte {end}, in a file of {num_file_bytes} bytes"
            expected = f"{num_segments} strips or tiles" + f" of {needed} bytes in all" * (needed > 0)
            raise damaged_error(f"page {number} of this TIFF file lacks pixels", got, expected)
    num_used = sum(sum(page.databytecounts) for page in pages)
    if num_used > num_file_bytes:  # pages that share bytes: a small file could claim any number of voxels
        raise InputError(
            "strips or tiles of this TIFF file share their bytes",
            got=f"{num_used} bytes of pixels, in a file of {num_file_bytes} bytes",
            hint="the file is damaged, or made to do harm",
        )


def _has_unlisted_planes(page: Page) -> bool:
    """Return whether a file of MetaMorph has several planes but only one page."""
    planes = page.tags.get(_METAMORPH_PLANES)
    return bool(page.is_stk) and (planes is None or bool(planes.count > 1))


def _num_plain_bytes(page: Page) -> int:
    """Return the bytes of all pixels of a page without compression; rows begin at whole bytes."""
    row = -(-page.imagewidth * page.samplesperpixel * int(page.bitspersample) // 8)
    return int(page.imagelength * row)


def _dtype(page: Page) -> np.dtype[Any]:
    """Return the dtype of the pixels; single bits become bytes of 0 and 1."""
    return np.dtype(np.uint8) if page.dtype.kind == "b" else np.dtype(page.dtype)


def _describe(page: Page) -> str:
    """Return a text with the size and the type of a page, which must be the same for all slices."""
    samples = f" of {page.samplesperpixel} samples" if page.samplesperpixel > 1 else ""
    return f"{page.imagewidth} x {page.imagelength} {_dtype(page).name}{samples}"


def _is_preview(page: Page, first: Page) -> bool:
    """Return whether a page is marked as a reduced version of another one, and is smaller than the first page.

    Thumbnails in files of Zeiss may be larger than the first page.
    """
    is_smaller = page.imagewidth * page.imagelength < first.imagewidth * first.imagelength
    return bool(page.is_reduced) and (is_smaller or bool(first.is_lsm))


def _plane(page: Page, sample: int, path: Path) -> Array:
    """Return one sample of the pixels of a page, [y, x]; raises InputError for pixels that cannot be decoded."""
    try:
        pixels = page.asarray(maxworkers=1).reshape(page.shaped)
    except Exception as error:  # codecs raise any exception for damaged bytes
        compression = getattr(page.compression, "name", str(page.compression))
        if "imagecodecs" in str(error):
            require_package("imagecodecs", extra="tiff")
        raise InputError(
            "the pixels of this TIFF file cannot be decoded",
            got=f"page {page.index + 1} of {_describe(page)}, compressed by {compression}",
            hint="the file is damaged, or of a kind that cannot be read: save it again without compression",
        ) from error
    plane: Array = pixels[sample, 0, :, :, 0] if page.planarconfig == 2 else pixels[0, 0, :, :, sample]
    return plane


def _num_contiguous(page: Page, path: Path) -> int:
    """Return the number of planes that follow one another behind the only page of a file; 1 if that is not certain.

    ImageJ writes just one page for a large stack, and so does tifffile if it is asked to (`truncate`).
    """
    num = num_planes_by_description(page)
    is_plain = page.compression == 1 and page.samplesperpixel == 1 and page.is_contiguous
    return num if is_plain and page.dataoffsets[0] + num * page.nbytes <= path.stat().st_size else 1


def _contiguous_plane(page: Page, number: int, path: Path) -> Array:
    """Return a plane [y, x] of a file whose planes follow each other behind its only page."""
    dtype = np.dtype(page.parent.byteorder + page.dtype.char)
    offset = page.dataoffsets[0] + number * page.nbytes
    plane: Array = np.fromfile(path, dtype, page.imagewidth * page.imagelength, offset=offset)
    return np.reshape(plane, page.shaped[2:4])


def _world_from_index(first: Page, space: str, has_spacing_override: bool) -> tuple[Float64, Units, str | None]:
    """Return the affine of a stack, the unit of its lengths, and a note on guessed lengths.

    space: the axes of space along a row, a column and the slices. has_spacing_override: whether lengths that make no
    sense are taken for 1; otherwise they raise InputError.
    """
    try:
        spacing, unit, note = find_spacing(first)
    except InputError:
        if not has_spacing_override:
            raise
        spacing, unit, note = [math.nan], "", None
    if has_spacing_override and not np.isfinite(spacing).all():
        spacing = [1.0, 1.0, 1.0]
    world_from_index = np.zeros((4, 4))
    world_from_index[[*map("XYZ".index, space), 3], range(4)] = [*spacing, 1.0]
    size = first.imagewidth, first.imagelength
    return oriented(with_origin(world_from_index, first), orientation(first), size), units_of(unit), note


def _nodata(page: Page) -> tuple[tuple[float, float], ...]:
    """Return the value that stands for no data, as a range, by GDAL's field; no range without this field."""
    value = number_in(str(page.tags.valueof(_GDAL_NODATA) or "").strip())
    return ((value, value),) if math.isfinite(value) else ()
