"""Read NIfTI-1 and NIfTI-2, single files (.nii, .nii.gz) and pairs (.hdr with .img), with nibabel.

nibabel parses the header, and `stored.py` reads the voxels.

The affine is the sform if it is set and invertible, else the qform, else the voxel sizes alone, with the first voxel at
the origin. RAS becomes LPS by negating x and y. Axes after z are time (the fourth) and component (the fifth), as in the
standard.
"""

from __future__ import annotations

import gzip
import logging
import math
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import (
    Image,
    check_dtype,
    describe_shape,
    has_volume,
    in_lps,
    select_index,
    unreadable_error,
)
from renderer.readers.stored import Layout, StoredVoxels, read_stored
from renderer.volume import Array, Float64

# The lengths of NIfTI-1 and NIfTI-2 headers, which are their first number.
_NIFTI_1_BYTES, _NIFTI_2_BYTES = 348, 540
# Header extensions hold reports, colours and names, and are smaller than this. A compressed file a thousandth of this
# size can claim as much.
_MAX_OFFSET = 2**26


def read_nifti(path: Path, time: int | None, component: int | None) -> Image:
    """Read the volume in a NIfTI file, scaled by the header's slope and intercept, if any.

    Scaled values are float32 if the stored ones have at most 16 bits or are float32, else float64. Raises InputError
    for truncated and foreign files, and if `time` or `component` do not fit.
    """
    image = _open(path)
    proxy, where = image.dataobj, str(path)
    shape = tuple(int(n) for n in proxy.shape)
    shape += (1,) * (5 - len(shape))
    fields = proxy.dtype.names  # RGB24 and RGBA32 are records of bytes
    if fields is None:
        check_dtype(proxy.dtype, where)
    if shape[5:].count(1) != len(shape[5:]):
        raise InputError(
            "the volume has too many axes",
            where=where,
            got=describe_shape(shape),
            expected="x, y, z, then time and component",
        )
    step = select_index("time", time, shape[3], where)
    channel = select_index("component", component, shape[4] if fields is None else len(fields), where)
    layout = Layout(proxy.dtype, shape[4::-1], (_stored_voxels(image, path),))
    whole = slice(None)
    values = read_stored(layout, (channel if fields is None else 0, step, whole, whole, whole), where)
    if fields is not None:
        values = values[fields[channel]]
    try:
        ras_from_index = _ras_from_index(image.header)
    except ValueError as error:  # the quaternion is not a rotation
        raise unreadable_error(path, error) from error
    return Image(_scaled(values, *_scale(image, where)), in_lps(ras_from_index, (-1.0, -1.0, 1.0)))


def _stored_voxels(image: Any, path: Path) -> StoredVoxels:
    """Return where the voxels are: in a file beside the header's for pairs. Raises InputError if that is missing."""
    data_file = Path(image.file_map["image"].filename)
    if not data_file.is_file():
        raise InputError(
            "the data file that belongs to this header is not there", where=str(path), expected=f"a file {data_file}"
        )
    if data_file.suffix.lower() == ".gz":
        return StoredVoxels(data_file, 0, "deflate", image.dataobj.offset)
    return StoredVoxels(data_file, image.dataobj.offset)


def _scale(image: Any, where: str) -> tuple[float, float]:
    """Return slope and intercept; a slope of 0, and NaN, mean that values are not scaled.

    Raises InputError for an infinite slope, which nibabel takes for none.
    """
    file = Path(image.file_map.get("header", image.file_map["image"]).filename)
    header, _ = _head(file)
    is_second = type(image.header).sizeof_hdr == _NIFTI_2_BYTES
    code, place = ("d", 176) if is_second else ("f", 112)
    slope = struct.unpack_from(image.header.endianness + code, header, place)[0]
    if math.isinf(slope):
        raise InputError(
            "this NIfTI header scales its values by what is no finite number",
            where=where,
            got=f"scl_slope = {slope:g}",
            expected="a finite number, or 0 for values as they are stored",
            hint="correct the header, or save the file again",
        )
    return float(image.dataobj.slope), float(image.dataobj.inter)


@contextmanager
def _quiet(logger: logging.Logger) -> Iterator[None]:
    """Keep nibabel's remarks on a header, and on its repairs, off the terminal."""
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(level)


def _check_offset(path: Path) -> None:
    """Raise InputError if the voxels of a single file begin inside its header or nowhere or, if compressed, far behind
    it.

    nibabel keeps the bytes in between in memory. Pairs and other files are left to nibabel.
    """
    head, compressed = _head(path)
    for order in "<>" if len(head) >= _NIFTI_1_BYTES else "":
        num_header_bytes = struct.unpack_from(order + "i", head)[0]
        code, place, mark = {_NIFTI_1_BYTES: ("f", 108, 344), _NIFTI_2_BYTES: ("q", 168, 4)}.get(
            num_header_bytes, ("", 0, 0)
        )
        if not code:
            continue
        offset = struct.unpack_from(order + code, head, place)[0]
        least = num_header_bytes + 4
        if not (math.isfinite(offset) and (offset >= least or head[mark : mark + 2] != b"n+")):
            raise _misplaced(path, offset, least)
        if compressed and offset > _MAX_OFFSET:
            raise InputError(
                "there is too much between the header and the voxels",
                where=str(path),
                got=f"voxels from byte {offset:.0f} on",
                expected=f"at most {_MAX_OFFSET} bytes before them",
                hint="if no extensions of the header are that long, it is damaged",
            )


def _misplaced(path: Path, offset: float, least: int) -> InputError:
    return InputError(
        "the voxels of this NIfTI file cannot be where its header says",
        where=str(path),
        got=f"vox_offset = {offset:g}",
        expected=f"{least} or more, behind the header",
        hint="save it again, or correct the header",
    )


def _head(path: Path) -> tuple[bytes, bool]:
    """Return the first bytes of a file, at most those of a header, and whether it is compressed."""
    try:
        with gzip.open(path) as file:
            return file.read(_NIFTI_2_BYTES), True
    except (OSError, EOFError, zlib.error):  # not compressed, or damaged, which nibabel sees as well
        with path.open("rb") as file:
            return file.read(_NIFTI_2_BYTES), False


def _open(path: Path) -> Any:
    import nibabel as nib

    _check_offset(path)
    try:
        with _quiet(nib.imageglobals.logger):
            image = nib.load(path)
    except (nib.filebasedimages.ImageFileError, nib.spatialimages.HeaderDataError) as error:
        raise InputError(
            "this is not a NIfTI file, or it is damaged",
            where=str(path),
            got="an empty file" if path.stat().st_size == 0 else None,
            expected="a header of NIfTI-1 or NIfTI-2, whose type of voxels and axes are known",
        ) from error
    except (EOFError, ValueError, zlib.error) as error:
        shown = unreadable_error(path, error)
        raise InputError(
            shown.what, where=shown.where, got=shown.got, hint="the file is truncated or damaged"
        ) from error
    except OSError as error:
        raise unreadable_error(path, error) from error
    if not isinstance(image, nib.Nifti1Pair):
        raise InputError(
            "this is not a NIfTI file",
            where=str(path),
            got=type(image).__name__,
            expected="NIfTI-1 or NIfTI-2, which say where the voxels are",
        )
    proxy: Any = image.dataobj
    least = image.header.single_vox_offset
    if "header" not in image.file_map and proxy.offset < least:  # whose first bytes were repaired
        raise _misplaced(path, proxy.offset, least)
    return image


def _scaled(values: Array, slope: float, intercept: float) -> Array:
    if slope == 1.0 and intercept == 0.0:
        return values
    exact_in_single = values.dtype.itemsize <= 2 or values.dtype.newbyteorder("=") == np.float32
    scaled = np.empty(values.shape, np.float32 if exact_in_single else np.float64)
    with np.errstate(over="ignore", invalid="ignore"):  # too large values become infinite, and are refused later
        for plane, target in zip(values, scaled, strict=True):  # the float64 product needs no second volume
            target[...] = plane.astype(np.float64) * slope + intercept
    return scaled


def _ras_from_index(header: Any) -> Float64:
    if header["sform_code"] > 0 and has_volume(header.get_sform()):
        return np.array(header.get_sform(), np.float64)
    if header["qform_code"] > 0 and has_volume(header.get_qform()):
        return np.array(header.get_qform(), np.float64)
    # Method 1 of the standard: x = pixdim[1] i and so on. nibabel, compatible with Analyze, would mirror it.
    sizes = np.ones(3)
    num_axes = min(3, int(header["dim"][0]))
    sizes[:num_axes] = header["pixdim"][1 : num_axes + 1]
    return np.diag([*sizes, 1.0])
