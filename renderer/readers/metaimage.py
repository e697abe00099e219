"""Read MetaImage (.mha, .mhd): a header of text, and voxels behind it or in data files.

Format: https://itk.org/Wiki/ITK/MetaIO/Documentation. Rows of `TransformMatrix` are the directions of the index axes.
Positions are those of LPS.
"""

from __future__ import annotations

import io
import math
from collections import defaultdict
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import NO_SPACING, Image, affine, select_index
from renderer.readers.data_files import find_data_files
from renderer.readers.stored import Encoding, Layout, StoredVoxels, read_stored
from renderer.readers.text_header import MAX_HEADER_BYTES, Field, add_field, decode_header
from renderer.volume import Float64

_TYPES = {
    "MET_CHAR": "int8",
    "MET_UCHAR": "uint8",
    "MET_SHORT": "int16",
    "MET_USHORT": "uint16",
    "MET_INT": "int32",
    "MET_UINT": "uint32",
    "MET_LONG": "int32",
    "MET_ULONG": "uint32",
    "MET_LONG_LONG": "int64",
    "MET_ULONG_LONG": "uint64",
    "MET_FLOAT": "float32",
    "MET_DOUBLE": "float64",
}
# Fields with several names, of which the first that is there counts.
_SPACINGS = ("ElementSpacing", "ElementSize")
_ORIGINS = ("Origin", "Position", "Offset")
_DIRECTIONS = ("Orientation", "Rotation", "TransformMatrix")
_BYTE_ORDERS = ("ElementByteOrderMSB", "BinaryDataByteOrderMSB")


def read_metaimage(path: Path, time: int | None, component: int | None) -> Image:
    """Read one time step and component of a MetaImage file.

    Raises InputError for damaged, truncated and foreign files, and if `time` or `component` do not fit.
    """
    header, layout = read_header(path)
    num_components = header.whole("ElementNumberOfChannels", 1, least=1)
    step = select_index("time", time, layout.shape[0] if header.num_axes == 4 else 1)
    channel = select_index("component", component, num_components)
    whole: list[int | slice] = [step, slice(None), slice(None), slice(None)]
    index = (*whole[4 - header.num_axes :], *([channel] if num_components > 1 else []))
    values = read_stored(layout, index)
    note = None if any(name in header.fields for name in _SPACINGS) else NO_SPACING
    return Image(values if values.ndim == 3 else values[np.newaxis], _world_from_index(header), note)


def read_header(path: Path) -> tuple[Header, Layout]:
    """Return the fields of a header, and where the voxels are: [time, z, y, x, component], without axes that it lacks.

    Raises InputError for headers that are damaged or foreign, and for missing data files.
    """
    header = Header(path)
    header.require("NDims", "DimSize", "ElementType", "ElementDataFile")
    sizes = header.numbers(("DimSize",), header.num_axes, whole=True, least=1) or []
    space = tuple(int(n) for n in sizes[::-1])
    num_components = header.whole("ElementNumberOfChannels", 1, least=1)
    shape = space + (num_components,) * (num_components > 1)
    kind = header.text("ElementType").removesuffix("_ARRAY")
    if kind not in _TYPES:
        raise header.fields["ElementType"].error(", ".join(_TYPES), "save it again in another type")
    _check_scale(header)
    is_big = any(header.is_true(name, default=False) for name in _BYTE_ORDERS)
    dtype = np.dtype(_TYPES[kind]).newbyteorder(">" if is_big else "<")
    data_file = header.text("ElementDataFile")
    is_local = data_file.upper() == "LOCAL"
    files, num_split = ([path], 0) if is_local else find_data_files(path, data_file, header.listed, space)
    num_bytes = math.prod(shape[num_split:]) * dtype.itemsize
    parts = tuple(_part(header, file, num_bytes, is_local=is_local) for file in files)
    return header, Layout(dtype, shape, parts, num_split)


def _part(header: Header, file: Path, num_bytes: int, *, is_local: bool) -> StoredVoxels:
    """Return where `num_bytes` of voxels are in the header's own file, or in a data file."""
    is_compressed = header.is_true("CompressedData", default=False)
    encoding: Encoding = "deflate" if is_compressed else "raw"
    if not header.is_true("BinaryData", default=True):
        encoding = "text"
    num_compressed = header.whole("CompressedDataSize", 0, least=0) if is_compressed else 0
    offset = header.whole("HeaderSize", 0, least=-1)
    if is_local and offset not in (0, header.num_bytes, -1):
        raise header.fields["HeaderSize"].error(
            f"{header.num_bytes}, the bytes of the header, as the voxels follow it", "remove that line"
        )
    if is_compressed and offset == -1:
        raise header.fields["HeaderSize"].error("0 or more, as the voxels are compressed")
    has_rest = offset > 0 and not is_local
    if is_local:
        offset = header.num_bytes
    elif offset == -1:
        offset = max(0, file.stat().st_size - num_bytes)
    return StoredVoxels(file, offset, encoding, num_encoded=num_compressed or None, has_rest=has_rest)


def _check_scale(header: Header) -> None:
    for name, neutral in (("ElementToIntensityFunctionSlope", 1), ("ElementToIntensityFunctionOffset", 0)):
        if header.numbers((name,), 1) not in (None, [neutral]):
            raise header.fields[name].error(
                f"{neutral}, as voxels that are to be scaled cannot be read",
                "correct that line to have the values as they are in the file, or save scaled ones",
            )


def _world_from_index(header: Header) -> Float64:
    """Return the affine, float64 [4, 4]; a plane lies at z = 0, and a time axis is left out."""
    n = header.num_axes
    num_space = min(n, 3)
    spacing, origin, direction = np.ones(3), np.zeros(3), np.eye(3)
    spacing[:num_space] = (header.numbers(_SPACINGS, n) or np.ones(n).tolist())[:num_space]
    origin[:num_space] = (header.numbers(_ORIGINS, n) or np.zeros(n).tolist())[:num_space]
    rows = np.reshape(header.numbers(_DIRECTIONS, n * n) or np.eye(n).ravel(), (n, n))
    direction[:num_space, :num_space] = rows[:num_space, :num_space].T
    return affine(spacing, origin, direction)


class Header:
    """A header: its fields by name, in which a number may stand on several lines.

    num_bytes: the bytes up to the voxels. listed: the lines below the last field, which may name data files.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.num_bytes = path, 0
        self.fields: dict[str, Field] = {}
        self.listed: list[str] = []
        with path.open("rb") as file:
            head = file.read(MAX_HEADER_BYTES)
        name, continued = "", defaultdict[str, list[str]](list)
        for number, line in enumerate(io.BytesIO(head), 1):
            self.num_bytes += len(line)
            key, mark, value = decode_header(line).partition("=")
            if mark:
                name = key.strip()
                if name == "Comment":
                    self.fields.pop(name, None)
                add_field(self.fields, name, Field(name, value.strip(), f"{path}:{number}"), "MetaImage")
            elif name:
                continued[name].append(key.strip())
            if name == "ElementDataFile":
                below = decode_header(head[self.num_bytes :]).split("\n")
                self.listed = list(takewhile(bool, map(str.strip, below)))
                break
        for name, more in continued.items():
            field = self.fields[name]
            self.fields[name] = replace(field, text=" ".join(filter(None, [field.text, *more])))

    def require(self, *names: str) -> None:
        """Raise InputError for missing fields."""
        missing = [name for name in names if name not in self.fields]
        if missing:
            raise InputError(
                "this is not a MetaImage header, or it is damaged",
                got="an empty file" if not self.num_bytes else None,
                expected=" and ".join(f"a line `{name} = ...`" for name in missing),
            )

    def text(self, name: str) -> str:
        """Return the text of a field; empty if it is missing."""
        return self.fields[name].text if name in self.fields else ""

    @property
    def num_axes(self) -> int:
        """Return the number of axes; raises InputError unless it is from 2 to 4."""
        return self.whole("NDims", 0, least=2, most=4)

    def is_true(self, name: str, *, default: bool) -> bool:
        """Return whether a field is true; raises InputError for any word but True and False, T and F, 1 and 0."""
        word = self.text(name).lower() or str(default).lower()
        if word not in ("true", "t", "1", "false", "f", "0"):
            raise self.fields[name].error("True or False")
        return word in ("true", "t", "1")

    def whole(self, name: str, default: int, least: int, most: float = math.inf) -> int:
        """Return the number of a field, or the default if it is missing.

        Raises InputError unless it is a whole one from `least` to `most`.
        """
        if name not in self.fields:
            return default
        field = self.fields[name]
        return replace(field, text="".join(field.text.split()[:1])).whole(least, most)

    def numbers(
        self, names: tuple[str, ...], count: int, *, whole: bool = False, least: float = -math.inf
    ) -> list[float] | None:
        """Return the first `count` numbers of the first of these fields that is there; None if there is none."""
        field = next((self.fields[name] for name in names if name in self.fields), None)
        if field is None:
            return None
        return replace(field, text=" ".join(field.text.split()[:count])).numbers(count, whole=whole, least=least)
