"""Read NIfTI-1 and NIfTI-2, single files (.nii, .nii.gz) and pairs (.hdr with .img), with nibabel.

SimpleITK refuses sheared affines, may prefer the qform to a sheared sform, and silently pads a truncated file with
zeros. nibabel returns the affine of the header unchanged.

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
    LPS_FROM_RAS,
    Image,
    StoredVoxels,
    check_dtype,
    check_size,
    check_stored,
    describe_shape,
    has_volume,
    select_index,
    stays_mapped,
    unreadable_error,
)
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
    num_bytes = check_size(shape, proxy.dtype, where)
    if shape[5:].count(1) != len(shape[5:]):
        raise InputError(
            "the volume has too many axes",
            where=where,
            got=describe_shape(shape),
            expected="x, y, z, then time and component",
        )
    data_file = _checked_data_file(image, path, num_bytes, shape)
    step = select_index("time", time, shape[3], where)
    channel = select_index("component", component, shape[4] if fields is None else len(fields), where)
    try:
        last = step, channel if fields is None else 0
        if stays_mapped(num_bytes) and data_file.suffix.lower() != ".gz":
            stored = np.memmap(data_file, proxy.dtype, "r", proxy.offset, shape[4::-1])
            values: Array = stored[last[1], last[0]]
        else:
            values = _stored_values(proxy, data_file, last)
    except (OSError, EOFError, ValueError, zlib.error) as error:
        raise InputError(
            "cannot read the voxels",
            where=str(data_file),
            got=" ".join(str(error).split()),
            hint="the file is truncated or damaged",
        ) from error
    if fields is not None:
        values = values[fields[channel]]
    try:
        ras_from_index = _ras_from_index(image.header)
    except ValueError as error:  # the quaternion is not a rotation
        raise unreadable_error(path, error) from error
    return Image(_scaled(values, float(proxy.slope), float(proxy.inter)), LPS_FROM_RAS @ ras_from_index)


def _checked_data_file(image: Any, path: Path, num_bytes: int, shape: tuple[int, ...]) -> Path:
    """Return the file with the voxels, which differs from the header's for pairs; raises InputError unless it is
    complete."""
    data_file = Path(image.file_map["image"].filename)
    if not data_file.is_file():
        raise InputError(
            "the data file that belongs to this header is not there", where=str(path), expected=f"a file {data_file}"
        )
    if data_file.suffix.lower() == ".gz":
        check_stored(StoredVoxels(data_file, 0, True), image.dataobj.offset + num_bytes, shape)
    else:
        check_stored(StoredVoxels(data_file, image.dataobj.offset, False), num_bytes, shape)
    return data_file


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


def _stored_values(proxy: Any, data_file: Path, last: tuple[int, int]) -> Array:
    """Return the stored values [z, y, x] of one time step and component, and read nothing else from the file."""
    import nibabel

    nib: Any = nibabel

    unscaled: Any = nib.arrayproxy.ArrayProxy(str(data_file), (proxy.shape, proxy.dtype, proxy.offset), mmap=False)
    num_spatial = min(len(proxy.shape), 3)
    rest = tuple(slice(k, k + 1) for k in (*last, *([0] * len(proxy.shape)))[: len(proxy.shape) - num_spatial])
    values = np.asarray(unscaled[(slice(None),) * num_spatial + rest])
    spatial: Array = values.reshape((*values.shape[:num_spatial], *([1] * (3 - num_spatial))), order="F")
    return np.transpose(spatial)


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
