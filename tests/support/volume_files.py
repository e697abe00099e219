"""Volumes as bytes of the formats that are read, in either byte order, written without the libraries that read them."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import nibabel
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

NIBABEL: Any = nibabel

_METAIMAGE_TYPES = {
    "int8": "CHAR", "uint8": "UCHAR", "int16": "SHORT", "uint16": "USHORT", "int32": "INT", "uint32": "UINT",
    "int64": "LONG_LONG", "uint64": "ULONG_LONG", "float32": "FLOAT", "float64": "DOUBLE",
}  # fmt: skip
_NRRD_FLOATS = {"float32": "float", "float64": "double"}
_TIFF_KINDS = {"u": 1, "i": 2, "f": 3}


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
    """A page for each slice: the directories, then the pixels."""
    order = ">" if _is_big(stored) else "<"
    num_pages, height, width = stored.shape
    page_bytes, directory_bytes = height * width * stored.dtype.itemsize, 2 + 8 * 12 + 4
    tags = {256: width, 257: height, 258: 8 * stored.dtype.itemsize, 259: 1, 262: 1, 278: height, 279: page_bytes}
    tags[339] = _TIFF_KINDS[stored.dtype.kind]
    directories = b""
    for page in range(num_pages):
        fields = sorted({**tags, 273: 8 + num_pages * (directory_bytes + 12) + page * page_bytes}.items())
        entries = b"".join(struct.pack(order + "HHII", tag, 4, 1, value) for tag, value in fields)
        following = 8 + (page + 1) * (directory_bytes + 12) if page + 1 < num_pages else 0
        directories += struct.pack(order + "H", len(fields)) + entries + struct.pack(order + "I", following)
    mark = {"<": b"II", ">": b"MM"}[order] + struct.pack(order + "HI", 42, 8)
    path.write_bytes(mark + directories + stored.tobytes())
