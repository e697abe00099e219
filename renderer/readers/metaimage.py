"""Read MetaImage (.mha, .mhd): a text header, and voxels behind it or in data files.

Format: https://itk.org/Wiki/ITK/MetaIO/Documentation. The rows of `TransformMatrix` are the directions of the index
axes. Positions are in LPS.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import NO_SPACING, affine
from renderer.readers.components import choose
from renderer.readers.data_files import find_data_files, unquoted
from renderer.readers.image import Image
from renderer.readers.scaled_values import scaled
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.stored import Encoding, Layout, StoredVoxels, read_stored
from renderer.readers.text_header import Field, add_field, header_lines
from renderer.readers.units import Units, units_of
from renderer.scene import short_text
from renderer.system import number_in
from renderer.volume import Float64

# The dtype of each integer type of MetaImage, by its name without `MET_` and without the `U` of unsigned types.
_INTEGERS = {"CHAR": "int8", "SHORT": "int16", "INT": "int32", "LONG": "int32", "LONG_LONG": "int64"}
_TYPES = {f"MET_{sign}{name}": f"{sign.lower()}{dtype}" for name, dtype in _INTEGERS.items() for sign in ("", "U")}
_TYPES |= {"MET_FLOAT": "float32", "MET_DOUBLE": "float64"}
# The names of the field with the lengths of voxels; the first that a header has is used.
_SPACINGS = ("ElementSpacing", "ElementSize")
# The names of the field with the place of the first voxel; the first that a header has is used.
_ORIGINS = ("Origin", "Position", "Offset")
# The names of the field with the directions of the axes; the first that a header has is used.
_DIRECTIONS = ("Orientation", "Rotation", "TransformMatrix")
# The name of the field with the sides of the body at which the axes begin.
_LETTERS = "AnatomicalOrientation"
# The fields with the factor and the offset that turn stored numbers into values.
_SCALES = ("ElementToIntensityFunctionSlope", "ElementToIntensityFunctionOffset")
# Words of the field Kinds for axes that lie in space.
_KINDS_OF_SPACE = ("domain", "space", "none", "???")
# The names of the field that says whether the most significant byte comes first; one that is true is enough.
_BYTE_ORDERS = ("ElementByteOrderMSB", "BinaryDataByteOrderMSB")

STATEMENTS = FormatTable(
    "MetaImage",
    (
        Statement("ElementSpacing", "place", "the distance of voxels; also called ElementSize"),
        Statement("Offset", "place", "the place of the first voxel; also called Origin and Position"),
        Statement("TransformMatrix", "place", "the directions of the axes; also called Orientation and Rotation"),
        Statement("DistanceUnits", "meaning", "the unit of lengths"),
        Statement(_LETTERS, "meaning", "the sides of a body at which the axes begin"),
        Statement("ElementByteOrderMSB", "values", "the order of bytes; also called BinaryDataByteOrderMSB"),
        Statement("ElementToIntensityFunctionSlope", "values", "a factor of the values"),
        Statement("ElementToIntensityFunctionOffset", "values", "an offset of the values"),
        Statement("Kinds", "meaning", "whether an axis is space, time, or a list of components"),
        Statement("CenterOfRotation", "place", "a point around which the axes are turned", is_applied=False),
    ),
)


def read_metaimage(path: Path, time: int | None, component: int | None) -> Image:
    """Read one time step and component of a MetaImage file.

    Raises InputError for damaged, truncated and foreign files, and if `time` or `component` do not fit.
    """
    fields, layout = read_header(path)
    num_axes = _num_axes(fields)
    axes = _axes(fields, num_axes)
    note = None if any(name in fields for name in _SPACINGS) else NO_SPACING
    is_plain = layout.parts[0].encoding == "raw" and layout.parts[0].file != path and "HeaderSize" not in fields
    skip = "HeaderSize = -1" if is_plain else None
    chosen = choose(axes[::-1] + "c" * (len(layout.shape) - num_axes), layout.shape, time, component)
    values, left_over = read_stored(layout, chosen, skip)
    slope, offset = (
        _words(fields, name, default=str(neutral)).numbers(1)[0] for name, neutral in zip(_SCALES, (1, 0), strict=True)
    )
    world_from_index = _world_from_index(fields, axes)
    units = _units(fields, world_from_index)
    notes = (note, left_over, *chosen.notes, *_notes(fields, axes, world_from_index))
    values = scaled(values, slope, offset)
    return Image(values, world_from_index, notes, channels=chosen.channels, steps=chosen.steps, units=units)


def _axes(fields: dict[str, Field], num_axes: int) -> str:
    """Return a letter for each axis, the fastest first: `s` for space, `t` for time, `c` for components.

    The fourth axis is time unless Kinds names another axis. Two axes in space and a third one of another kind are
    drawn as a volume.
    """
    axes = "ssst"[:num_axes]
    kinds = fields["Kinds"].text.lower().split() if "Kinds" in fields else []
    others = [k for k, kind in enumerate(kinds) if kind not in _KINDS_OF_SPACE]
    if num_axes < 4 or len(kinds) != num_axes or len(others) != 1:
        return axes
    (other,) = others
    is_time = kinds[other] == "time" or other == num_axes - 1
    return "s" * other + ("t" if is_time else "c") + "s" * (num_axes - 1 - other)


def _notes(fields: dict[str, Field], axes: str, world_from_index: Float64) -> Iterator[str | None]:
    """Yield notes on fields of the header that are not applied, or that contradict each other."""
    center = fields["CenterOfRotation"].text.split() if "CenterOfRotation" in fields else []
    is_turned = bool(np.count_nonzero(world_from_index[:3, :3] - np.diag(np.diag(world_from_index[:3, :3]))))
    yield STATEMENTS.note({"CenterOfRotation"} if is_turned and any(map(number_in, center)) else ())
    letters = fields[_LETTERS].text if _LETTERS in fields else ""
    if letters.strip("?") and letters.upper() != _code(world_from_index):
        yield f"its {_LETTERS} is {short_text(letters)}, which does not fit its directions; these count"
    kinds = fields["Kinds"].text.lower().split() if "Kinds" in fields else []
    if kinds and sum(kind not in _KINDS_OF_SPACE for kind in kinds) != len(axes.replace("s", "")):
        yield f"the kinds of its axes are {short_text(' '.join(kinds))}; they are seen as a volume"


def _units(fields: dict[str, Field], world_from_index: Float64) -> Units:
    """Return the unit of lengths, and LPS as the world's axes if AnatomicalOrientation agrees with the directions."""
    length, letters = (fields[name].text if name in fields else "" for name in ("DistanceUnits", _LETTERS))
    return units_of(length.strip("?"), "LPS" * (letters.upper() == _code(world_from_index)))


def _code(world_from_index: Float64) -> str:
    """Return the letters of the sides of a body at which the axes begin, such as RAI, as in AnatomicalOrientation."""
    columns = world_from_index[:3, :3].T
    along = np.abs(columns).argmax(axis=1)
    return "".join("RAILPS"[k + 3 * bool(column[k] < 0)] for k, column in zip(along, columns, strict=True))


def read_header(path: Path) -> tuple[dict[str, Field], Layout]:
    """Return the fields of a header, and the layout of the voxels.

    The voxels are [time, z, y, x, component], without the axes that the file lacks. Raises InputError for headers that
    are damaged or foreign, and for missing data files.
    """
    fields, listed, header_end = _parse(path)
    missing = [name for name in ("NDims", "DimSize", "ElementType", "ElementDataFile") if name not in fields]
    if missing:
        raise InputError(
            "this is not a MetaImage header, or it is damaged",
            expected=" and ".join(f"a line `{name} = ...`" for name in missing),
        )
    num_axes = _num_axes(fields)
    sizes = _words(fields, "DimSize", count=num_axes).numbers(num_axes, whole=True, least=1)
    space = tuple(int(n) for n in sizes[::-1])
    num_components = _words(fields, "ElementNumberOfChannels", default="1").whole(1)
    shape = space + (num_components,) * (num_components > 1)
    kind = fields["ElementType"].text.removesuffix("_ARRAY")
    if kind not in _TYPES:
        raise fields["ElementType"].error(", ".join(_TYPES), "save it again in another type")
    is_big = any(_is_true(fields, name, default=False) for name in _BYTE_ORDERS)
    dtype = np.dtype(_TYPES[kind]).newbyteorder(">" if is_big else "<")
    data_file = unquoted(path, fields["ElementDataFile"].text)
    files, num_split, begin = [path], 0, header_end
    if data_file.upper() != "LOCAL":
        files, num_split = find_data_files(path, data_file, listed, space)
        begin = 0
    num_bytes = math.prod(shape) * dtype.itemsize // len(files)
    parts = tuple(_part(fields, file, num_bytes, begin) for file in files)
    return fields, Layout(dtype, shape, parts, num_split)


def _part(fields: dict[str, Field], file: Path, num_bytes: int, begin: int) -> StoredVoxels:
    """Return where and how a file stores `num_bytes` bytes of voxels.

    begin: the end of the header, for voxels that follow it; 0 for a data file.
    """
    is_compressed = _is_true(fields, "CompressedData", default=False)
    encoding: Encoding = "deflate" if is_compressed else "raw"
    if not _is_true(fields, "BinaryData", default=True):
        encoding = "text"
    num_compressed = _words(fields, "CompressedDataSize", default="0").whole(0) if is_compressed else 0
    offset = _words(fields, "HeaderSize", default="0").whole(-1)
    if begin and offset not in (0, begin, -1):
        raise fields["HeaderSize"].error(
            f"{begin}, the bytes of the header, as the voxels follow it", "remove that line"
        )
    if is_compressed and offset == -1:
        raise fields["HeaderSize"].error("0 or more, as the voxels are compressed")
    has_rest = offset > 0 and not begin
    if offset == -1:
        offset = max(0, file.stat().st_size - num_bytes)
    return StoredVoxels(file, begin or offset, encoding, num_encoded=num_compressed or None, has_rest=has_rest)


def _world_from_index(fields: dict[str, Field], axes: str) -> Float64:
    """Return the affine from voxel indices to LPS, float64 [4, 4]; a plane lies at z = 0.

    axes: a letter for each axis, `s` for those in space.
    """
    num_axes, space = len(axes), [k for k, letter in enumerate(axes) if letter == "s"]
    num_space = len(space)
    spacing, origin, direction = np.ones(3), np.zeros(3), np.eye(3)
    for target, names, default in ((spacing, _SPACINGS, "1 "), (origin, _ORIGINS, "0 ")):
        numbers = _words(fields, *names, count=num_axes, default=default * num_axes).numbers(num_axes)
        target[:num_space] = np.array(numbers)[space]
    default = " ".join(map(str, np.eye(num_axes).ravel()))
    rows = _words(fields, *_DIRECTIONS, count=num_axes**2, default=default).numbers(num_axes**2)
    direction[:num_space, :num_space] = np.reshape(rows, (num_axes, num_axes))[np.ix_(space, space)].T
    return affine(spacing, origin, direction)


def _parse(path: Path) -> tuple[dict[str, Field], list[str], int]:
    """Return the fields by name, the lines below the last field, and the end of the last field in bytes.

    These lines may name data files. The numbers of a field may stand on several lines.
    """
    fields: dict[str, Field] = {}
    continued = defaultdict[str, list[str]](list)
    name, header_end = "", 0
    lines = header_lines(path)
    for where, text, end in lines:
        key, mark, value = text.partition("=")
        if mark:
            name = key.strip()
            if name == "Comment":
                fields.pop(name, None)
            add_field(fields, name, Field(name, value.strip(), where), "MetaImage")
        elif name:
            continued[name].append(key.strip())
        if name == "ElementDataFile":
            header_end = end
            break
    for name, more in continued.items():
        fields[name] = replace(fields[name], text=" ".join(filter(None, [fields[name].text, *more])))
    return fields, list(takewhile(bool, (text.strip() for _, text, _ in lines))), header_end


def _words(fields: dict[str, Field], *names: str, count: int = 1, default: str = "") -> Field:
    """Return the first of the named fields that the header has, cut to `count` words; else a field with the default."""
    field = next((fields[name] for name in names if name in fields), Field(names[0], default, ""))
    return replace(field, text=" ".join(field.text.split()[:count]))


def _num_axes(fields: dict[str, Field]) -> int:
    """Return the number of axes; raises InputError unless it is from 2 to 4."""
    return _words(fields, "NDims").whole(2, 4)


def _is_true(fields: dict[str, Field], name: str, *, default: bool) -> bool:
    """Return whether a field is true; raises InputError for words other than True and False, T and F, 1 and 0."""
    word = fields[name].text.lower() if name in fields else ""
    if word not in ("", "true", "t", "1", "false", "f", "0"):
        raise fields[name].error("True or False")
    return word in ("true", "t", "1") if word else default
