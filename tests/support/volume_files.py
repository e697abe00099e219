"""Volumes as bytes of the formats that are read, in either byte order, written without SimpleITK."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nibabel
import numpy as np
import numpy.typing as npt

from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec
from renderer.volume import Volume
from tests.support.tiff_files import tiff_bytes

Array = npt.NDArray[Any]

NIBABEL: Any = nibabel

_METAIMAGE_TYPES = {
    "int8": "CHAR", "uint8": "UCHAR", "int16": "SHORT", "uint16": "USHORT", "int32": "INT", "uint32": "UINT",
    "int64": "LONG_LONG", "uint64": "ULONG_LONG", "float32": "FLOAT", "float64": "DOUBLE",
}  # fmt: skip
_NRRD_FLOATS = {"float32": "float", "float64": "double"}


def ramp(dtype: str, shape: tuple[int, ...] = (3, 4, 5)) -> Array:
    """Return values that differ, with both ends of an integer type's range among them."""
    values = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    if np.dtype(dtype).kind in "iu":
        values.flat[0], values.flat[-1] = np.iinfo(dtype).min, np.iinfo(dtype).max
    return values


def read(path: Path, spacing: tuple[float, float, float] | None = None, **choice: Any) -> Volume:
    """Read a file, perhaps with another spacing, a time step, a component or a crop."""
    return read_volume(VolumeSpec(FileSource(path, spacing), **choice))


def write_volume(path: Path, values: Array, order: str) -> None:
    """Write values [z, y, x] to a .npy, .nrrd, .mha, .nii or .tif file; `order` is `<` or `>`."""
    stored = values.astype(values.dtype.newbyteorder(order))  # type: ignore[arg-type]
    write = {".npy": np.save, ".nrrd": _nrrd, ".mha": _metaimage, ".nii": _nifti, ".tif": _tiff}[path.suffix]
    write(path, stored)


def _is_big(stored: Array) -> bool:
    return stored.dtype.str[0] == ">"


def _sizes(stored: Array) -> str:
    return " ".join(map(str, stored.shape[::-1]))


def _nrrd(path: Path, stored: Array) -> None:
    kind = _NRRD_FLOATS.get(stored.dtype.name, stored.dtype.name)
    lines = ["NRRD0004", f"type: {kind}", "dimension: 3", f"sizes: {_sizes(stored)}", "encoding: raw"]
    lines += [f"endian: {'big' if _is_big(stored) else 'little'}", "", ""]
    path.write_bytes("\n".join(lines).encode() + stored.tobytes())


def _metaimage(path: Path, stored: Array) -> None:
    lines = ["ObjectType = Image", "NDims = 3", "BinaryData = True", f"BinaryDataByteOrderMSB = {_is_big(stored)}"]
    lines += [f"DimSize = {_sizes(stored)}", f"ElementType = MET_{_METAIMAGE_TYPES[stored.dtype.name]}"]
    path.write_bytes("\n".join([*lines, "ElementDataFile = LOCAL", ""]).encode() + stored.tobytes())


def _nifti(path: Path, stored: Array) -> None:
    header = NIBABEL.Nifti1Header(endianness=">" if _is_big(stored) else "<")
    header.set_data_dtype(stored.dtype)
    header.set_data_shape(stored.shape[::-1])
    header.set_sform(np.eye(4), code=1)
    header["vox_offset"] = 352
    header["magic"] = b"n+1"
    path.write_bytes(header.binaryblock + bytes(4) + stored.tobytes())


def _tiff(path: Path, stored: Array) -> None:
    path.write_bytes(tiff_bytes(stored, ">" if _is_big(stored) else "<"))
