"""Read NIfTI-1 and NIfTI-2, single files (.nii, .nii.gz) and pairs (.hdr with .img), with nibabel.

nibabel parses the header, and `stored.py` reads the voxels; extensions of the header are skipped.

The affine is the sform if it is set and invertible, else the qform, else the voxel sizes alone, with the first voxel at
the origin. RAS becomes LPS by negating x and y. Axes after z are time (the fourth) and component (the fifth), as in the
standard.
"""

from __future__ import annotations

import gzip
import logging
import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import (
    LPS_FROM_RAS,
    Image,
    check_dtype,
    describe_shape,
    has_volume,
    select_index,
    unreadable_error,
)
from renderer.readers.stored import Layout, StoredVoxels, read_stored
from renderer.volume import Array, Float64

_MAX_HEADER_BYTES = 540  # of NIfTI-2
# Header extensions hold reports, colours and names, and are smaller than this. A compressed file a thousandth of this
# size can claim as much.
_MAX_OFFSET = 2**26

# Keeps nibabel's remarks on a header, and on its repairs, off the terminal.
_SILENT = logging.Logger(__name__, logging.CRITICAL + 1)


def read_nifti(path: Path, time: int | None, component: int | None) -> Image:
    """Read the volume in a NIfTI file, scaled by the header's slope and intercept, if any.

    Scaled values are float32 if the stored ones have at most 16 bits or are float32, else float64. Raises InputError
    for truncated and foreign files, and if `time` or `component` do not fit.
    """
    header, part = _open(path)
    where = str(path)
    scale = _scale(header, where)
    dtype = header.get_data_dtype()
    shape = tuple(int(n) for n in header.get_data_shape())
    shape += (1,) * (5 - len(shape))
    fields = dtype.names  # RGB24 and RGBA32 are records of bytes
    if fields is None:
        check_dtype(dtype, where)
    if shape[5:].count(1) != len(shape[5:]):
        raise InputError(
            "the volume has too many axes",
            where=where,
            got=describe_shape(shape),
            expected="x, y, z, then time and component",
        )
    step = select_index("time", time, shape[3], where)
    channel = select_index("component", component, shape[4] if fields is None else len(fields), where)
    layout = Layout(dtype, shape[4::-1], (part,))
    whole = slice(None)
    values = read_stored(layout, (channel if fields is None else 0, step, whole, whole, whole), where)
    if fields is not None:
        values = values[fields[channel]]
    try:
        ras_from_index = _ras_from_index(header)
    except ValueError as error:  # the quaternion is not a rotation
        raise unreadable_error(path, error) from error
    return Image(_scaled(values, *scale), LPS_FROM_RAS @ ras_from_index)


def _scale(header: Any, where: str) -> tuple[float, float]:
    """Return slope and intercept; a slope of 0, and NaN, mean that values are not scaled.

    Raises InputError for an infinite slope, which nibabel takes for none.
    """
    slope = float(header["scl_slope"])
    if math.isinf(slope):
        raise InputError(
            "this NIfTI header scales its values by what is no finite number",
            where=where,
            got=f"scl_slope = {slope:g}",
            expected="a finite number, or 0 for values as they are stored",
            hint="correct the header, or save the file again",
        )
    slope, intercept = header.get_slope_inter()
    return (1.0, 0.0) if slope is None else (float(slope), float(intercept))


def _open(path: Path) -> tuple[Any, StoredVoxels]:
    """Return nibabel's header of a file, checked and repaired, and where the voxels are.

    Raises InputError for other and for damaged headers, and if the file that belongs to a header is missing.
    """
    from nibabel.nifti1 import Nifti1Header
    from nibabel.nifti2 import Nifti2Header
    from nibabel.spatialimages import HeaderDataError

    kinds: tuple[Any, ...] = (Nifti2Header, Nifti1Header)
    header_file = _other_of_pair(path, ".img", ".hdr") or path
    head, is_compressed = _head(header_file)
    kind = next((each for each in kinds if each.may_contain_header(head)), None)
    try:
        if kind is None:
            raise HeaderDataError
        header = kind(head[: kind.template_dtype.itemsize], check=False)
        part = _stored_voxels(header, header_file, is_compressed=is_compressed)
        header.check_fix(_SILENT)
        header.get_slope_inter()
    except HeaderDataError as error:
        raise InputError(
            "this is not a NIfTI file, or it is damaged",
            where=str(path),
            got="an empty file" if not head else None,
            expected="a header of NIfTI-1 or NIfTI-2, whose type of voxels and axes are known",
        ) from error
    return header, part


def _stored_voxels(header: Any, path: Path, *, is_compressed: bool) -> StoredVoxels:
    """Return where the voxels are that belong to a header: behind it, or in the other file of a pair."""
    other = _other_of_pair(path, ".hdr", ".img")
    offset, least = float(header["vox_offset"]), 0 if other else header.single_vox_offset
    if not (math.isfinite(offset) and offset >= least):
        raise InputError(
            "the voxels of this NIfTI file cannot be where its header says",
            where=str(path),
            got=f"vox_offset = {offset:g}",
            expected=f"{least} or more, behind the header",
            hint="save it again, or correct the header",
        )
    if is_compressed and offset > _MAX_OFFSET:
        raise InputError(
            "there is too much between the header and the voxels",
            where=str(path),
            got=f"voxels from byte {offset:.0f} on",
            expected=f"at most {_MAX_OFFSET} bytes before them",
            hint="if no extensions of the header are that long, it is damaged",
        )
    if other is not None and not other.is_file():
        raise InputError(
            "the data file that belongs to this header is not there", where=str(path), expected=f"a file {other}"
        )
    if is_compressed:
        return StoredVoxels(other or path, 0, "deflate", int(offset), has_rest=True)
    return StoredVoxels(other or path, int(offset), has_rest=True)


def _other_of_pair(path: Path, suffix: str, other: str) -> Path | None:
    """Return the file of a pair with the suffix `other`, before `.gz` if any; None if `path` has not `suffix`."""
    packed = path.suffix if path.suffix.lower() == ".gz" else ""
    stem = path.with_suffix("") if packed else path
    if stem.suffix.lower() != suffix:
        return None
    return stem.with_suffix((other.upper() if stem.suffix.isupper() else other) + packed)


def _head(path: Path) -> tuple[bytes, bool]:
    """Return the first bytes of a file, at most those of a header, and whether it is compressed."""
    try:
        with gzip.open(path) as file:
            return file.read(_MAX_HEADER_BYTES), True
    except (OSError, EOFError, zlib.error):  # not compressed, or damaged
        with path.open("rb") as file:
            return file.read(_MAX_HEADER_BYTES), False


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
