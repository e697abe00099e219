"""Read a folder with one DICOM series, a slice per file, placed by the positions in the slices.

SimpleITK's GDCM finds the series; each slice is read by itself, so that a message can name its file. The third axis of
the volume is the step from slice to slice, not the normal of the slices: a tilted gantry gives a sheared volume.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import Image, affine, check_size, describe_shape, select_index
from renderer.readers.dicom_header import dicom_spacing
from renderer.readers.headers import PIXEL_DATA, has_dicom_magic
from renderer.readers.itk import (
    array_view,
    itk_name,
    open_itk,
    path_from_itk_name,
    pixel_dtype,
    quiet_simpleitk,
    read_image,
    read_itk,
    shorten_itk_error,
)
from renderer.volume import Array, Float64

# Slices may be off by this part of the spacing: positions have few digits, and gantries are not perfect. A missing
# slice is off by a whole step.
_UNEVEN = 0.05

_DESCRIPTION = "0008|103e"


@dataclass(frozen=True)
class _Slice:
    """The header of one file: position float64 [3] of its first voxel, direction float64 [3, 3]."""

    file: Path
    reader: Any
    dtype: np.dtype[Any]
    size: tuple[int, int]
    spacing: tuple[float, float]
    position: Float64
    direction: Float64


def read_dicom(folder: Path, time: int | None, component: int | None, *, has_spacing_override: bool = False) -> Image:
    """Read the only series in `folder`, slices in ascending order along their normal.

    has_spacing_override: the scene gives the spacing, so that lengths in the files are not checked. Values are those
        after each slice's rescale slope and intercept. Raises InputError for no series or several, and for slices that
        differ in size or orientation, are missing, double or unevenly spaced.
    """
    with quiet_simpleitk() as sitk:
        files = _series_files(sitk, folder)
        if len(files) == 1:  # one slice, or all of them in one enhanced file
            return read_itk(files[0], time, component, has_spacing_override=has_spacing_override)
        select_index("time", time, 1, str(folder))
        slices = [_header(sitk, file, has_spacing_override) for file in files]
        slices.sort(key=lambda part: float(part.position @ part.direction[:, 2]))
        _check_alike(slices, folder)
        step = _even_step(slices, folder)
        first = slices[0]
        num_components = first.reader.GetNumberOfComponents()
        channel = select_index("component", component, num_components, str(folder))
        dtype = np.result_type(*(part.dtype for part in slices))  # the rescale slope may differ from slice to slice
        check_size((*first.size, len(slices)), dtype, str(folder))
        values: Array = np.empty((len(slices), first.size[1], first.size[0]), dtype)
        for part, target in zip(slices, values, strict=True):
            plane = array_view(sitk, read_image(part.reader, part.file)).reshape(*target.shape, num_components)
            target[...] = plane[..., channel]
    axes = np.column_stack([first.direction[:, 0] * first.spacing[0], first.direction[:, 1] * first.spacing[1], step])
    return Image(values, affine(np.ones(3), first.position, axes))


def _series_files(sitk: Any, folder: Path) -> list[Path]:
    name = itk_name(folder)
    try:
        series = sitk.ImageSeriesReader.GetGDCMSeriesIDs(name)
        files = {uid: sitk.ImageSeriesReader.GetGDCMSeriesFileNames(name, uid) for uid in series}
    except RuntimeError as error:
        for path in sorted(folder.iterdir()):
            if path.is_file() and has_dicom_magic(path):
                _require_header(sitk, path)
        raise InputError(
            "the DICOM files in this folder cannot be read",
            where=str(folder),
            got=shorten_itk_error(str(error)),
            hint="one of them is damaged",
        ) from error
    if not series:
        raise InputError(
            "this folder holds neither a DICOM series nor TIFF slices",
            where=str(folder),
            got="an empty folder" if not any(folder.iterdir()) else None,
            expected="the files of one DICOM series, or .tif files, directly in the folder",
        )
    if len(series) > 1:
        raise InputError(
            f"this folder holds {len(series)} DICOM series, and one is rendered",
            where=str(folder),
            got="; ".join(_name_series(sitk, uid, files[uid]) for uid in sorted(series)),
            hint="put each series into its own folder",
        )
    found = [path_from_itk_name(name) for name in files[series[0]]]
    _check_none_left_out(folder, {path.name for path in found})
    return found


def _check_none_left_out(folder: Path, names: set[str]) -> None:
    """Raise InputError for a damaged slice that the search for series passed over.

    At either end of the stack nothing else would show it. Reports and plans are DICOM files without pixels. A file that
    is not DICOM but is named like the slices was one.
    """
    shapes = {_shape(name) for name in names}
    for path in sorted(folder.iterdir()):
        if path.name in names or path.name.startswith(".") or not path.is_file():
            continue
        is_dicom = has_dicom_magic(path)
        is_slice = PIXEL_DATA in path.read_bytes() if is_dicom else _shape(path.name) in shapes
        if is_slice:
            is_empty = path.stat().st_size == 0
            raise InputError(
                "this DICOM slice cannot be read",
                where=str(path),
                got="an empty file" if is_empty else None if is_dicom else "a file that is not DICOM",
                hint="the file is truncated or damaged: copy it again, or remove it if it is no slice",
            )


def _shape(name: str) -> str:
    """Return a name with each number replaced by one sign."""
    return re.sub("[0-9]+", "#", name)


def _require_header(sitk: Any, path: Path) -> None:
    try:
        open_itk(sitk, path)
    except InputError as error:
        raise InputError(
            "this DICOM slice cannot be read",
            where=str(path),
            got=error.got,
            hint="a field of it is damaged: copy it again, or save it again",
        ) from error


def _name_series(sitk: Any, uid: str, files: tuple[str, ...]) -> str:
    """Return `"T1 sagittal", 40 files from N2D_0171.dcm`."""
    first = path_from_itk_name(files[0])
    reader = open_itk(sitk, first)
    description = reader.GetMetaData(_DESCRIPTION).strip() if reader.HasMetaDataKey(_DESCRIPTION) else ""
    return f'"{description or uid}", {len(files)} file{"s" if len(files) > 1 else ""} from {first.name}'


def _header(sitk: Any, file: Path, has_spacing_override: bool) -> _Slice:
    reader = open_itk(sitk, file)
    size = reader.GetSize()
    if len(size) == 3 and size[2] > 1:
        raise InputError(
            "several files of this series hold several slices each",
            where=str(file),
            got=f"{size[2]} slices",
            expected="one slice per file, or all of them in one file",
        )
    width, height, *_ = size
    across, down, *_ = dicom_spacing(reader, file, has_spacing_override=has_spacing_override)
    return _Slice(
        file,
        reader,
        pixel_dtype(sitk, reader, file),
        (width, height),
        (across, down),
        np.array(reader.GetOrigin()),
        np.reshape(reader.GetDirection(), (3, 3)),
    )


def _check_alike(slices: list[_Slice], folder: Path) -> None:
    first = slices[0]
    for part in slices[1:]:
        for what, got, expected, alike in (
            ("size", describe_shape(part.size), describe_shape(first.size), part.size == first.size),
            (
                "pixel spacing",
                str(part.spacing),
                str(first.spacing),
                np.allclose(part.spacing, first.spacing, rtol=1e-3, atol=0),
            ),
            (
                "orientation",
                _numbers(part.direction),
                _numbers(first.direction),
                np.allclose(part.direction, first.direction, rtol=0, atol=1e-3),
            ),
            (
                "number of components",
                str(part.reader.GetNumberOfComponents()),
                str(first.reader.GetNumberOfComponents()),
                part.reader.GetNumberOfComponents() == first.reader.GetNumberOfComponents(),
            ),
        ):
            if not alike:
                raise InputError(
                    f"the slices of this series differ in their {what}",
                    where=str(folder),
                    got=f"{got} in {part.file.name}",
                    expected=f"{expected} as in {first.file.name}",
                    hint="a localiser or a second scan among them? put it into its own folder",
                )


def _numbers(values: Float64) -> str:
    return "[" + " ".join(f"{value:.4g}" for value in values[:, :2].T.flat) + "]"


def _even_step(slices: list[_Slice], folder: Path) -> Float64:
    """Return the step from slice to slice, float64 [3]; raises InputError if it is not the same everywhere."""
    positions = np.array([part.position for part in slices])
    gaps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    usual = float(np.median(gaps))
    doubled = np.flatnonzero(gaps <= _UNEVEN * usual)
    if doubled.size:
        i = int(doubled[0])
        raise InputError(
            "two slices of this series are at the same position",
            where=str(folder),
            got=f"{slices[i].file.name} and {slices[i + 1].file.name}",
            expected="one slice at each position",
            hint="a time series or several echoes? put each volume into its own folder",
        )
    wide = np.flatnonzero(gaps >= (2 - _UNEVEN) * usual)
    if wide.size:
        i = int(wide[0])
        num_missing = int(np.sum(np.rint(gaps[wide] / usual) - 1))
        raise InputError(
            "slices of this series are missing",
            where=str(folder),
            got=f"about {num_missing} missing; the first gap, {gaps[i]:.4g}, is between {slices[i].file.name} and "
            f"{slices[i + 1].file.name}",
            expected=f"a slice every {usual:.4g}",
        )
    step = (positions[-1] - positions[0]) / (len(slices) - 1)
    off = np.linalg.norm(positions - (positions[0] + np.arange(len(slices))[:, np.newaxis] * step), axis=1)
    worst = int(np.argmax(off))
    if off[worst] > _UNEVEN * np.linalg.norm(step):
        raise InputError(
            "the slices of this series are not evenly spaced",
            where=str(folder),
            got=f"gaps from {gaps.min():.4g} to {gaps.max():.4g}; {slices[worst].file.name} is off by {off[worst]:.4g}",
            expected=f"a slice every {np.linalg.norm(step):.4g}, within {_UNEVEN:.0%} of that",
            hint="resample the series to even spacing first",
        )
    return np.asarray(step, np.float64)
