"""Write volumes in the formats that are read, in either byte order, mostly by the formats' own libraries."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import nibabel
import nrrd
import numpy as np
import pytest
import tifffile

from renderer.errors import InputError
from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec
from renderer.volume import Array, Volume

NIBABEL: Any = nibabel

_METAIMAGE_TYPES = {
    "int8": "CHAR", "uint8": "UCHAR", "int16": "SHORT", "uint16": "USHORT", "int32": "INT", "uint32": "UINT",
    "int64": "LONG_LONG", "uint64": "ULONG_LONG", "float32": "FLOAT", "float64": "DOUBLE",
}  # fmt: skip


def ramp(dtype: str, shape: tuple[int, ...] = (3, 4, 5)) -> Array:
    """Return rising values. The first and last are the ends of the range of an integer type."""
    values = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    if np.dtype(dtype).kind in "iu":
        values.flat[0], values.flat[-1] = np.iinfo(dtype).min, np.iinfo(dtype).max
    return values


def read(path: Path, spacing: tuple[float, float, float] | None = None, **choice: Any) -> Volume:
    """Return the volume in a file. choice: the time step, component or crop to read."""
    return read_volume(VolumeSpec(FileSource(path, spacing), **choice))


def refused(path: Path, match: str = ".", **choice: Any) -> InputError:
    """Return the error of a file that cannot be read. match: a pattern that the message contains."""
    with pytest.raises(InputError, match=match) as error:
        read(path, **choice)
    return error.value


def in_memory(write: Callable[..., object], *values: Any, **options: Any) -> bytes:
    """Return the bytes that a function writes into an open file."""
    out = io.BytesIO()
    write(out, *values, **options)
    return out.getvalue()


def zipped(names: Iterable[str], data: bytes = b"") -> bytes:
    """Return a ZIP archive of files that all have the same content, `data`, and no times."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name in names:
            archive.writestr(zipfile.ZipInfo(name), data)
    return out.getvalue()


def written(path: Path, data: bytes) -> Path:
    """Write a file, and return its path."""
    path.write_bytes(data)
    return path


def write_volume(path: Path, values: Array, order: str) -> None:
    """Write values [z, y, x] to a .npy, .nrrd, .mha, .nii or .tif file. order: the byte order, `<` or `>`."""
    write_image(path, values.astype(values.dtype.newbyteorder(order)))  # type: ignore[arg-type]


def _is_big(values: Array) -> bool:
    return values.dtype.str[0] == ">"


def write_image(
    path: Path,
    values: Array,
    *,
    spacing: Sequence[float] = (1.0, 1.0, 1.0),
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    direction: Array | None = None,
    compressed: bool = False,
    has_components: bool = False,
) -> None:
    """Write an image as NRRD (by pynrrd), MetaImage, NIfTI (by nibabel), TIFF (by tifffile) or .npy.

    values: [time, z, y, x], [z, y, x] or [y, x]; components, if any, are the last axis. origin, direction: in the axes
    left, posterior, superior (LPS). The voxels of a .mhd or .nhdr file are in a file beside it.
    """
    axes = (np.eye(3) if direction is None else direction) * np.asarray(spacing, float)
    if path.suffix in (".nrrd", ".nhdr"):
        _write_nrrd(path, values, axes, origin, compressed=compressed, has_components=has_components)
    elif path.suffix in (".mha", ".mhd"):
        _write_metaimage(path, values, axes, origin, compressed=compressed, has_components=has_components)
    elif path.suffix == ".nii":
        affine = np.eye(4)
        affine[:3, :3], affine[:3, 3] = axes, origin
        header = NIBABEL.Nifti1Header(endianness=">" if _is_big(values) else "<")
        affine = np.diag([-1.0, -1.0, 1.0, 1.0]) @ affine
        NIBABEL.Nifti1Image(values.T, affine, header, dtype=values.dtype).to_filename(path)
    elif path.suffix == ".npy":
        np.save(path, values)
    else:
        kind = "rgb" if has_components else "minisblack"
        options = {"byteorder": ">" if _is_big(values) else "<", "compression": "zlib" if compressed else None}
        tifffile.imwrite(path, values, photometric=kind, metadata=None, **options)


def _write_nrrd(
    path: Path, values: Array, axes: Array, origin: Sequence[float], *, compressed: bool, has_components: bool
) -> None:
    num_space = min(values.ndim - has_components, 3)
    vectors = [axes[:num_space, k] for k in range(num_space)]
    others = [np.full(num_space, np.nan)]
    kinds = ["domain"] * num_space
    if has_components:
        vectors, kinds = others + vectors, ["vector", *kinds]
    elif values.ndim == 4:
        vectors, kinds = vectors + others, [*kinds, "time"]
    header = {"encoding": "gzip" if compressed else "raw", "kinds": kinds, "space directions": np.array(vectors)}
    header |= {"space": "left-posterior-superior"} if num_space == 3 else {"space dimension": num_space}
    header["space origin"] = np.asarray(origin, float)[:num_space]
    nrrd.write(str(path), values, header, index_order="C")


def _write_metaimage(
    path: Path, values: Array, axes: Array, origin: Sequence[float], *, compressed: bool, has_components: bool
) -> None:
    n = values.ndim - has_components
    spacing = np.linalg.norm(axes, axis=0)
    matrix, lengths, place = np.eye(n), np.ones(n), np.zeros(n)
    matrix[:3, :3] = (axes / spacing).T[:n, :n]
    lengths[:3], place[:3] = spacing[:n], np.asarray(origin)[:n]
    data = zlib.compress(values.tobytes()) if compressed else values.tobytes()
    data_file = path.with_suffix(".zraw" if compressed else ".raw")
    lines = {
        "ObjectType": "Image",
        "NDims": n,
        "BinaryData": True,
        "BinaryDataByteOrderMSB": _is_big(values),
        "CompressedData": compressed,
        **({"CompressedDataSize": len(data)} if compressed else {}),
        "TransformMatrix": " ".join(map(repr, matrix.ravel().tolist())),
        "Offset": " ".join(map(repr, place.tolist())),
        "ElementSpacing": " ".join(map(repr, lengths.tolist())),
        "DimSize": " ".join(map(str, values.shape[:n][::-1])),
        "ElementNumberOfChannels": values.shape[-1] if has_components else 1,
        "ElementType": f"MET_{_METAIMAGE_TYPES[values.dtype.name]}",
        "ElementDataFile": "LOCAL" if path.suffix == ".mha" else data_file.name,
    }
    header = "".join(f"{key} = {value}\n" for key, value in lines.items()).encode()
    path.write_bytes(header + data if path.suffix == ".mha" else header)
    if path.suffix == ".mhd":
        data_file.write_bytes(data)
