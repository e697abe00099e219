"""NRRD, MetaImage and whatever else SimpleITK recognises, with spacing, origin and direction in LPS.

SimpleITK brings every format to LPS, including NRRD's other spaces. The voxels stay in its buffer: the array that comes
back is a view of it and keeps it alive. Of large volumes that are not compressed it reads the header only; the voxels
are mapped from the file.
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
    metaimage_voxels,
    missing_spacing_note,
    nrrd_voxels,
    vtk_voxels,
)
from renderer.readers.sniff import UnknownFormatError
from renderer.scene import format_value
from renderer.volume import Array

# What no sentence has, but conditions of a program that were not met, and its own exceptions.
_CODE = re.compile(r"::|\(\)|bad_alloc")

_BITS_ALLOCATED, _SERIES = "0028|0100", "0020|000e"

# Formats of which it is known where in the file the voxels are.
_VOXEL_LOCATORS: dict[str, Callable[[Path], Stored | None]] = {
    ".nrrd": nrrd_voxels,
    ".nhdr": nrrd_voxels,
    ".mha": metaimage_voxels,
    ".mhd": metaimage_voxels,
    ".vtk": vtk_voxels,
}


@contextmanager
def quiet_simpleitk() -> Iterator[Any]:
    """The SimpleITK module, imported on first use, its warnings kept off the terminal within the block."""
    import SimpleITK

    sitk: Any = SimpleITK  # it has no types
    shown = sitk.ProcessObject.GetGlobalWarningDisplay()
    sitk.ProcessObject.SetGlobalWarningDisplay(False)
    try:
        yield sitk
    finally:
        sitk.ProcessObject.SetGlobalWarningDisplay(shown)


@contextmanager
def _silent() -> Iterator[None]:
    """Keep what libraries of SimpleITK write to the terminal by themselves, as HDF5 and MetaIO do, off it."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # there is none, or there are too many open files
            shown = os.dup(2)
            stack.callback(os.close, shown)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            stack.callback(os.close, nowhere)
            os.dup2(nowhere, 2)
            stack.callback(os.dup2, shown, 2)
        yield


def read_itk(path: Path, time: int | None, component: int | None, *, has_spacing_override: bool = False) -> Image:
    """The volume in one file.

    has_spacing_override: others take the place of what a DICOM file says of lengths, which so may be anything. Raises
    InputError for unknown, truncated and broken files, and when `time` or `component` do not fit.
    """
    voxels = _VOXEL_LOCATORS[path.suffix.lower()](path) if path.suffix.lower() in _VOXEL_LOCATORS else None
    unsaid = missing_spacing_note(path)
    with quiet_simpleitk() as sitk:
        reader = open_itk(sitk, path)
        size, num_components = reader.GetSize(), reader.GetNumberOfComponents()
        dtype = pixel_dtype(sitk, reader, path)
        num_bytes = check_size((*size, num_components), dtype, str(path))
        if isinstance(voxels, list):
            _check_slices(voxels, num_bytes, size, dtype, path)
        elif voxels is not None:
            _check_whole(voxels, num_bytes, size, dtype)
            if voxels.byte_order is not None:  # they are alone in the file, as they are
                check_no_excess_voxels(voxels, num_bytes, size)
        if len(size) > 4:
            raise InputError("the volume has too many axes", where=str(path), got=str(len(size)), expected="2 to 4")
        spacing = (
            dicom_spacing(reader, path, has_spacing_override=has_spacing_override)
            if is_dicom(reader)
            else reader.GetSpacing()
        )
        world_from_index = _world_from_index(reader, spacing)
        check_axes(world_from_index, str(path))  # of which SimpleITK says no more than some numbers
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
        note = note if has_spacing_override else unsaid or note
    return Image(values if values.ndim == 3 else values[np.newaxis], world_from_index, note)


def _one_of_a_series(sitk: Any, reader: Any, path: Path) -> str | None:
    """What to say of a file with one slice of a DICOM series of which its folder has more."""
    if not (is_dicom(reader) and reader.HasMetaDataKey(_SERIES)):
        return None
    try:
        uid = reader.GetMetaData(_SERIES).strip()
        files = sitk.ImageSeriesReader.GetGDCMSeriesFileNames(itk_name(path.parent), uid)
    except (RuntimeError, TypeError):  # for another file, of which nothing was asked; for a name that is no text
        return None
    if len(files) < 2:
        return None
    return f"one of {len(files)} slices of a DICOM series; its folder, {path.parent}, stands for all of them"


def _check_whole(voxels: StoredVoxels, num_bytes: int, size: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Raise InputError unless a file has all of its voxels, before memory is taken for them."""
    if voxels.is_text:
        check_text(voxels, num_bytes // dtype.itemsize, size)
    else:
        check_stored(voxels, num_bytes, size)


def _check_slices(
    files: list[StoredVoxels], num_bytes: int, size: tuple[int, ...], dtype: np.dtype[Any], path: Path
) -> None:
    """Raise InputError unless each step of the last axis has a file, and that is whole. NRRD's reader has counted them;
    there the last axis may be that of components."""
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
    """Whether these are many voxels, and are in their file as an array has them."""
    is_known = voxels.byte_order in ("<", ">") or (voxels.byte_order == "|" and dtype.itemsize == 1)
    return stays_mapped(num_bytes) and num_components == 1 and is_known


def itk_name(path: Path) -> str:
    """The name by which SimpleITK opens a file or folder, which has its names in UTF-8 whatever the locale.

    Raises InputError for a name that is not: SimpleITK ends the process that hands it one.
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
    """The path for which SimpleITK has this name."""
    return Path(os.fsdecode(name.encode("utf-8", "surrogateescape")))


def _is_utf8(name: bytes) -> bool:
    try:
        name.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def open_itk(sitk: Any, path: Path) -> Any:
    """A SimpleITK reader that has read the header of `path`; raises InputError when it is of no known format."""
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
    """The SimpleITK image; raises InputError when its voxels cannot be read."""
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
    """The numpy dtype of one component; raises InputError for complex, label and other types."""
    name = sitk.GetPixelIDValueAsString(reader.GetPixelID())
    match = re.fullmatch(r"(?:vector of )?(\d+)-bit (unsigned integer|signed integer|float)", name)
    if match is None:
        raise InputError(
            "voxels of this type cannot be rendered", where=str(path), got=name, expected="integers or real numbers"
        )
    return np.dtype({"u": "uint", "s": "int", "f": "float"}[match[2][0]] + match[1])


class _Kept:
    """A numpy view of a SimpleITK image, and the image, which owns the memory."""

    def __init__(self, view: Array, image: Any) -> None:
        self.__array_interface__ = view.__array_interface__
        self.image = image


def array_view(sitk: Any, image: Any) -> Array:
    """The voxels of a SimpleITK image as [z, y, x] or [y, x] (several components last), without a copy."""
    return np.asarray(_Kept(sitk.GetArrayViewFromImage(image), image))


def shorten_itk_error(message: str) -> str | None:
    """The last statement of one of SimpleITK's messages, which open with source files, addresses and call chains.

    The innermost cause is the last line, apart from the system's last error, which is often another's;
    `[nrrd] function:` and `ITK ERROR: class(address):` in front of it say nothing to a user, and nor does a line of a
    program's code, in place of which there is None.
    """
    lines = [line.strip() for line in message.splitlines() if line.strip() and not line.startswith("Reason:")]
    last = lines[-1] if lines else "no reason given"
    said = re.sub(r"^(\[\w+\] \w+: |(itk|ITK|sitk)(::| )ERROR: (\w+\(0x[0-9a-f]+\): )?)", "", last)
    return None if _CODE.search(said) else said


def _world_from_index(reader: Any, lengths: tuple[float, ...]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """[4, 4] from the spacing and a header of 2 to 4 dimensions: a plane lies at z = 0, a time axis is left out."""
    n = reader.GetDimension()
    spatial = min(n, 3)
    spacing, origin, direction = np.ones(3), np.zeros(3), np.eye(3)
    spacing[:spatial] = lengths[:spatial]
    origin[:spatial] = reader.GetOrigin()[:spatial]
    direction[:spatial, :spatial] = np.reshape(reader.GetDirection(), (n, n))[:spatial, :spatial]
    return affine(spacing, origin, direction)
