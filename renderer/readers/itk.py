"""Read NRRD, MetaImage and whatever else SimpleITK recognises, with spacing, origin and direction in LPS.

SimpleITK converts every format to LPS, including NRRD's other spaces. The voxels stay in its buffer: the returned array
is a view that keeps it alive. Of large uncompressed volumes SimpleITK reads only the header; the voxels are mapped from
the file.
"""

from __future__ import annotations

import contextlib
import math
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import (
    Image,
    StoredVoxels,
    affine,
    check_axes,
    check_no_excess_voxels,
    check_size,
    check_stored,
    check_text,
    describe_shape,
    select_index,
    stays_mapped,
)
from renderer.readers.dicom_header import dicom_spacing, is_dicom, without_photometric_inversion
from renderer.readers.headers import (
    Stored,
    check_dicom_pixels,
    check_nrrd_header,
    checkable_nrrd_voxels,
    metaimage_voxels,
    missing_spacing_note,
    vtk_voxels,
)
from renderer.readers.sniff import UnknownFormatError
from renderer.scene import format_value
from renderer.volume import Array

# Marks of failed conditions and exceptions of a program, which no sentence has.
_CODE = re.compile(r"::|\(\)|bad_alloc")

_BITS_ALLOCATED, _SERIES = "0028|0100", "0020|000e"

# Formats whose voxels can be located in the file.
_VOXEL_LOCATORS: dict[str, Callable[[Path], Stored | None]] = {
    ".nrrd": checkable_nrrd_voxels,
    ".nhdr": checkable_nrrd_voxels,
    ".mha": metaimage_voxels,
    ".mhd": metaimage_voxels,
    ".vtk": vtk_voxels,
}


@contextmanager
def quiet_simpleitk() -> Iterator[Any]:
    """Yield the SimpleITK module, imported on first use, with its warnings kept off the terminal."""
    import SimpleITK

    sitk: Any = SimpleITK  # untyped
    shown = sitk.ProcessObject.GetGlobalWarningDisplay()
    sitk.ProcessObject.SetGlobalWarningDisplay(False)
    try:
        yield sitk
    finally:
        sitk.ProcessObject.SetGlobalWarningDisplay(shown)


@contextmanager
def _silent() -> Iterator[None]:
    """Keep output of SimpleITK's libraries, such as HDF5 and MetaIO, off the terminal."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # stderr is closed, or too many files are open
            shown = os.dup(2)
            stack.callback(os.close, shown)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            stack.callback(os.close, nowhere)
            os.dup2(nowhere, 2)
            stack.callback(os.dup2, shown, 2)
        yield


def read_itk(path: Path, time: int | None, component: int | None, *, has_spacing_override: bool = False) -> Image:
    """Read the volume in one file.

    has_spacing_override: the scene gives the spacing, so that lengths in a DICOM file are not checked. Raises
        InputError for unknown, truncated and broken files, and if `time` or `component` do not fit.
    """
    voxels = _VOXEL_LOCATORS[path.suffix.lower()](path) if path.suffix.lower() in _VOXEL_LOCATORS else None
    spacing_note = missing_spacing_note(path)
    with quiet_simpleitk() as sitk:
        reader = open_itk(sitk, path)
        size, num_components = reader.GetSize(), reader.GetNumberOfComponents()
        dtype = pixel_dtype(sitk, reader, path)
        num_bytes = check_size((*size, num_components), dtype, str(path))
        if isinstance(voxels, list):
            _check_slices(voxels, num_bytes, size, dtype, path)
        elif voxels is not None:
            _check_whole(voxels, num_bytes, size, dtype)
            if voxels.byte_order is not None:  # nothing but plain voxels follows
                check_no_excess_voxels(voxels, num_bytes, size)
        if len(size) > 4:
            raise InputError("the volume has too many axes", where=str(path), got=str(len(size)), expected="2 to 4")
        spacing = (
            dicom_spacing(reader, path, has_spacing_override=has_spacing_override)
            if is_dicom(reader)
            else reader.GetSpacing()
        )
        world_from_index = _world_from_index(reader, spacing)
        check_axes(world_from_index, str(path))  # SimpleITK would only report some numbers
        step = select_index("time", time, size[3] if len(size) == 4 else 1, str(path))
        channel = select_index("component", component, num_components, str(path))
        if isinstance(voxels, StoredVoxels) and _can_be_mapped(voxels, num_bytes, num_components, dtype):
            assert voxels.byte_order is not None
            stored = dtype.newbyteorder(voxels.byte_order)  # type: ignore[arg-type]
            mapped: Array = np.memmap(voxels.file, stored, "r", voxels.offset, size[::-1])
            values = mapped[step] if len(size) == 4 else mapped
        else:
            if len(size) == 4:
                reader.SetExtractSize([*size[:3], 0])
                reader.SetExtractIndex([0, 0, 0, step])
            values = array_view(sitk, read_image(reader, path))
            if num_components > 1:
                values = values[..., channel]
        note = _one_of_a_series(sitk, reader, path) if values.ndim == 2 or len(values) == 1 else None
        note = note if has_spacing_override else spacing_note or note
    return Image(values if values.ndim == 3 else values[np.newaxis], world_from_index, note)


def _one_of_a_series(sitk: Any, reader: Any, path: Path) -> str | None:
    """Return a note for a file with one of several slices of a DICOM series in its folder; else None."""
    if not (is_dicom(reader) and reader.HasMetaDataKey(_SERIES)):
        return None
    try:
        uid = reader.GetMetaData(_SERIES).strip()
        files = sitk.ImageSeriesReader.GetGDCMSeriesFileNames(itk_name(path.parent), uid)
    except (RuntimeError, TypeError):  # about another file; a name that is not text
        return None
    if len(files) < 2:
        return None
    return f"one of {len(files)} slices of a DICOM series; its folder, {path.parent}, stands for all of them"


def _check_whole(voxels: StoredVoxels, num_bytes: int, size: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Raise InputError unless a file has all of its voxels; called before memory is allocated."""
    if voxels.is_text:
        check_text(voxels, num_bytes // dtype.itemsize, size)
    else:
        check_stored(voxels, num_bytes, size)


def _check_slices(
    files: list[StoredVoxels], num_bytes: int, size: tuple[int, ...], dtype: np.dtype[Any], path: Path
) -> None:
    """Raise InputError unless each step of the last axis has a complete file.

    SimpleITK has counted those of NRRD, where the last axis may hold components.
    """
    if len(files) != size[-1] and path.suffix.lower() not in (".nrrd", ".nhdr"):
        raise InputError(
            f"this header names too {'few' if len(files) < size[-1] else 'many'} data files",
            where=str(path),
            got=str(len(files)),
            expected=f"{size[-1]}, one for each slice of {describe_shape(size)} voxels",
        )
    for file in files:
        _check_whole(file, num_bytes // len(files), size[:-1], dtype)


def _can_be_mapped(voxels: StoredVoxels, num_bytes: int, num_components: int, dtype: np.dtype[Any]) -> bool:
    """Return whether the voxels are large enough to map, and stored as an array has them."""
    is_known = voxels.byte_order in ("<", ">") or (voxels.byte_order == "|" and dtype.itemsize == 1)
    return stays_mapped(num_bytes) and num_components == 1 and is_known


def itk_name(path: Path) -> str:
    """Return the name by which SimpleITK opens a file or folder: in UTF-8, whatever the locale.

    Raises InputError for a name that is not UTF-8: SimpleITK would end the process.
    """
    try:
        return os.fsencode(path).decode("utf-8")
    except UnicodeDecodeError as error:
        bad = next(part for part in path.parts if not _is_utf8(os.fsencode(part)))
        raise InputError(
            "a file or folder of this name cannot be read in its format",
            where=str(path),
            got=f"{format_value(bad)}, which is not UTF-8",
            expected="a path in UTF-8",
            hint="rename that file or folder",
        ) from error


def path_from_itk_name(name: str) -> Path:
    """Return the path for one of SimpleITK's names."""
    return Path(os.fsdecode(name.encode("utf-8", "surrogateescape")))


def _is_utf8(name: bytes) -> bool:
    try:
        name.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def open_itk(sitk: Any, path: Path) -> Any:
    """Return a SimpleITK reader that has read the header of `path`; raises InputError for an unknown format."""
    name = itk_name(path)
    check_nrrd_header(path)
    with _silent():
        format_name = sitk.ImageFileReader.GetImageIOFromFileName(name)
    if not format_name:
        raise UnknownFormatError(path, is_empty=path.stat().st_size == 0)
    reader = sitk.ImageFileReader()
    reader.SetFileName(name)
    reader.SetImageIO(format_name)
    try:
        with _silent():
            reader.ReadImageInformation()
    except RuntimeError as error:
        raise InputError(
            "cannot read the header",
            where=str(path),
            got=shorten_itk_error(str(error)),
            hint="the file is damaged, or of a kind that cannot be read",
        ) from error
    if is_dicom(reader) and reader.HasMetaDataKey(_BITS_ALLOCATED):
        bits = math.prod(reader.GetSize()) * reader.GetNumberOfComponents() * int(reader.GetMetaData(_BITS_ALLOCATED))
        check_dicom_pixels(path, bits // 8)
    return reader


def read_image(reader: Any, path: Path) -> Any:
    """Return the SimpleITK image; raises InputError if its voxels cannot be read."""
    try:
        with without_photometric_inversion(reader, path), _silent():
            return reader.Execute()
    except RuntimeError as error:
        if "bad_alloc" in str(error):
            raise MemoryError from error
        raise InputError(
            "cannot read the voxels",
            where=str(path),
            got=shorten_itk_error(str(error)),
            hint="the file is truncated or damaged",
        ) from error


def pixel_dtype(sitk: Any, reader: Any, path: Path) -> np.dtype[Any]:
    """Return the numpy dtype of one component; raises InputError for complex, label and other types."""
    name = sitk.GetPixelIDValueAsString(reader.GetPixelID())
    match = re.fullmatch(r"(?:vector of )?(\d+)-bit (unsigned integer|signed integer|float)", name)
    if match is None:
        raise InputError(
            "voxels of this type cannot be rendered", where=str(path), got=name, expected="integers or real numbers"
        )
    return np.dtype({"u": "uint", "s": "int", "f": "float"}[match[2][0]] + match[1])


class _OwnedView:
    """A numpy view of a SimpleITK image, with the image, which owns the memory."""

    def __init__(self, view: Array, image: Any) -> None:
        self.__array_interface__ = view.__array_interface__
        self.image = image


def array_view(sitk: Any, image: Any) -> Array:
    """Return the voxels of a SimpleITK image as [z, y, x] or [y, x] (several components last), without a copy."""
    return np.asarray(_OwnedView(sitk.GetArrayViewFromImage(image), image))


def shorten_itk_error(message: str) -> str | None:
    """Return the last statement of a SimpleITK message, without source files, addresses and call chains.

    The innermost cause is the last line, apart from the system's last error, which is often unrelated. Prefixes such as
    `[nrrd] function:` and `ITK ERROR: class(address):` are removed. None for a line of program code.
    """
    lines = [line.strip() for line in message.splitlines() if line.strip() and not line.startswith("Reason:")]
    last = lines[-1] if lines else "no reason given"
    said = re.sub(r"^(\[\w+\] \w+: |(itk|ITK|sitk)(::| )ERROR: (\w+\(0x[0-9a-f]+\): )?)", "", last)
    return None if _CODE.search(said) else said


def _world_from_index(reader: Any, lengths: tuple[float, ...]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the affine [4, 4] of a header of 2 to 4 dimensions: a plane lies at z = 0, a time axis is left out."""
    n = reader.GetDimension()
    spatial = min(n, 3)
    spacing, origin, direction = np.ones(3), np.zeros(3), np.eye(3)
    spacing[:spatial] = lengths[:spatial]
    origin[:spatial] = reader.GetOrigin()[:spatial]
    direction[:spatial, :spatial] = np.reshape(reader.GetDirection(), (n, n))[:spatial, :spatial]
    return affine(spacing, origin, direction)
