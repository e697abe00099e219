"""Read NRRD (.nrrd, .nhdr): a text header, and voxels behind it or in data files.

Format: http://teem.sourceforge.net/nrrd/format.html. An axis is either in space or time (a domain axis), or a list of
components. Its kind decides; an axis of unknown kind is in space if it has a direction. Without the field `space`,
`spacings` gives the lengths. Spaces whose axes are named after the body become LPS; others are taken for LPS.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import NO_SPACING, affine, in_lps
from renderer.readers.components import Chosen, choose
from renderer.readers.data_files import find_data_files
from renderer.readers.file_errors import labels_or_note
from renderer.readers.image import Image
from renderer.readers.segments import join_layers, labels_of_layer, segments_of_slicer
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.steps_in_time import TimeSteps, even_steps_at
from renderer.readers.stored import Encoding, Layout, StoredVoxels, read_stored
from renderer.readers.text_header import MAX_HEADER_BYTES, Field, add_field, header_lines
from renderer.readers.units import Units, units_of
from renderer.readers.voxel_limits import describe_count, describe_shape
from renderer.scene import did_you_mean, format_value
from renderer.volume import Array, Channel, Float64, Label

STATEMENTS = FormatTable(
    "NRRD",
    (
        Statement("space", "place", "the axes of the world; z of left-handed ones is negated"),
        Statement("space directions", "place", "the directions and steps of the axes"),
        Statement("space origin", "place", "the place of the first sample"),
        Statement("spacings", "place", "the distance of samples"),
        Statement("axis mins", "place", "the coordinate at which an axis begins"),
        Statement("axis maxs", "place", "the coordinate at which an axis ends"),
        Statement("centers", "place", "whether samples lie in the middle of a step"),
        Statement("endian", "values", "the order of bytes"),
        Statement("kinds", "meaning", "the kind of each axis: space, time, or components"),
        Statement("units", "meaning", "the unit of each axis"),
        Statement("space units", "meaning", "the unit of lengths"),
        Statement("sample units", "meaning", "the unit of values"),
        Statement("Segment", "meaning", "names, colours, values and layers of the segments of 3D Slicer"),
        Statement("measurement frame", "meaning", "the directions of the components of vectors", is_applied=False),
        Statement("old min", "values", "the value of the smallest number before quantization", is_applied=False),
        Statement("old max", "values", "the value of the largest number before quantization", is_applied=False),
    ),
)

# The largest number of axes that NRRD allows.
_MAX_AXES = 16
# The largest number of valid words that an error message lists.
_MAX_LISTED = 10
# The hint for a line that cannot be read.
_NO_EMPTY_LINE = "an empty line is missing before the voxels, or the file is damaged"

# The names of the fields, in lower case without blanks.
_FIELDS = frozenset(
    (
        "dimension",
        "type",
        "blocksize",
        "encoding",
        "endian",
        "content",
        "oldmin",
        "oldmax",
        "min",
        "max",
        "datafile",
        "lineskip",
        "byteskip",
        "number",
        "sampleunits",
        "space",
        "spacedimension",
        "spaceunits",
        "spaceorigin",
        "spacedirections",
        "measurementframe",
        "sizes",
        "spacings",
        "thicknesses",
        "axismins",
        "axismaxs",
        "centers",
        "labels",
        "units",
        "kinds",
    )
)
# The names that NRRD has for each type of integers.
_INTEGERS = {
    "int8": "signed char, int8, int8_t",
    "uint8": "uchar, unsigned char, uint8, uint8_t",
    "int16": "short, short int, signed short, signed short int, int16, int16_t",
    "uint16": "ushort, unsigned short, unsigned short int, uint16, uint16_t",
    "int32": "int, signed int, int32, int32_t",
    "uint32": "uint, unsigned int, uint32, uint32_t",
    "int64": "longlong, long long, long long int, signed long long, signed long long int, int64, int64_t",
    "uint64": "ulonglong, unsigned long long, unsigned long long int, uint64, uint64_t",
}
_TYPES = {name: dtype for dtype, names in _INTEGERS.items() for name in names.split(", ")}
_TYPES |= {"float": "float32", "double": "float64"}
# The encoding of the voxels, by its name in NRRD.
_ENCODINGS: dict[str, Encoding] = {"raw": "raw", "gzip": "deflate", "gz": "deflate", "bzip2": "bzip2", "bz2": "bzip2"}
_ENCODINGS |= {"text": "text", "txt": "text", "ascii": "text", "hex": "hex"}
# The words of the field `kinds` that tell nothing about an axis.
_UNKNOWN_KINDS = ("", "???", "none")
# The factors that turn x, y and z into LPS, by the name of a space or its short form, with or without time.
_SPACES = {
    "right-anterior-superior": (-1.0, -1.0, 1.0),
    "left-anterior-superior": (1.0, -1.0, 1.0),
    "left-posterior-superior": (1.0, 1.0, 1.0),
}
_SPACES |= {"".join(word[0] for word in name.split("-")): factors for name, factors in _SPACES.items()}
_SPACES |= dict.fromkeys(("scanner-xyz", "3d-right-handed"), (1.0, 1.0, 1.0)) | {"3d-left-handed": (1.0, 1.0, -1.0)}
_SPACES |= {name + ("-time" if "-" in name else "t"): factors for name, factors in _SPACES.items()}
# A line with a key that 3D Slicer writes for a segment.
_SEGMENT = re.compile(r"(Segment\d{1,9}_(?:Name|LabelValue|Color|Layer)):=(.*)")
# The note on a left-handed space without directions of a body. Any axis could be turned over; z is chosen.
_LEFT_HANDED = "its space is left-handed, and the world is not: z is turned over, so that nothing is mirrored"
# The names of components by the kind of their axis. A masked kind has a further component before these, the mask.
_COMPONENTS = {
    "complex": "real imaginary",
    "quaternion": "w x y z",
    "2-vector": "x y",
    "3-vector": "x y z",
    "4-vector": "x y z w",
    "3-gradient": "x y z",
    "3-normal": "x y z",
    "2d-symmetric-matrix": "xx xy yy",
    "2d-matrix": "xx xy yx yy",
    "3d-symmetric-matrix": "xx xy xz yy yz zz",
    "3d-matrix": "xx xy xz yx yy yz zx zy zz",
}
# The words that the field `centers` may hold.
_CENTERS = ("cell", "node", *_UNKNOWN_KINDS)
# A vector in the text of a field, such as (1,0,0), or `none`.
_VECTOR = re.compile(r"\(([^()]*)\)|none", re.IGNORECASE)


def read_nrrd(path: Path, time: int | None, component: int | None) -> Image:
    """Read one time step and component of a NRRD file, in LPS.

    Raises InputError for damaged, truncated and foreign files, and if `time` or `component` do not fit.
    """
    fields, layout = read_header(path)
    directions = _vectors(fields["spacedirections"], len(layout.shape)) if "spacedirections" in fields else []
    axes = _axes(fields, layout.shape[::-1], directions)
    world_from_index, has_spacing = _world_from_index(fields, axes, directions)
    kinds = fields["kinds"].text.lower().split() if "kinds" in fields else []
    if axes == "ssst" and layout.shape[0] > 1 and time is None and not directions and {*kinds} <= {*_UNKNOWN_KINDS}:
        raise InputError(
            "this NRRD file does not say which of its four axes is time, or holds components",
            got=describe_shape(layout.shape[::-1]),
            expected=f"`time: k` with k from 0 to {layout.shape[0] - 1} if the last one is time",
            hint="if the first one holds components, add a line `kinds: list domain domain domain`",
        )
    voxels = _read_voxels(path, fields, layout, axes, (time, component))
    guessed = None if has_spacing else NO_SPACING
    left_handed = _LEFT_HANDED if "space" in fields and _is_left_handed(fields["space"]) else None
    notes = (guessed, left_handed, *voxels.notes, STATEMENTS.note(_unapplied(fields)))
    steps = _steps(fields, axes, layout.shape[::-1])
    units = _units(fields, axes, has_directions=bool(directions))
    return Image(voxels.values, world_from_index, notes, (), voxels.channels, voxels.labels, steps, units)


class _Voxels(NamedTuple):
    """The chosen voxels, with their channels, labels and notes."""

    values: Array
    channels: tuple[Channel, ...]
    labels: tuple[Label, ...]
    notes: tuple[str | None, ...]


def _read_voxels(
    path: Path, fields: dict[str, Field], layout: Layout, axes: str, wanted: tuple[int | None, int | None]
) -> _Voxels:
    """Read the voxels of one time step and component.

    If components are layers of segments, all layers are joined unless the scene chooses a component. wanted: the time
    and the component of the scene.
    """
    time, component = wanted
    num_layers = dict(zip(axes[::-1], layout.shape, strict=True)).get("c", 1)
    segments, wrong = labels_or_note(lambda: segments_of_slicer(path, _segment_keys(fields), num_layers))
    if segments and component is None and num_layers > 1:
        chosen = choose(axes[::-1], layout.shape, time, 0)
        layers, left_over = _read_layers(layout, chosen, axes[::-1])
        values, about = join_layers(layers, segments)
        labels = tuple(each.label for each in segments)
        return _Voxels(values, (), labels, (left_over, *chosen.notes, about))
    skip = None if {"byteskip", "lineskip"} & fields.keys() else "byte skip: {}"
    if skip and layout.parts[0].encoding == "raw":
        skip = "byte skip: -1"
    chosen = choose(axes[::-1], layout.shape, time, component, _component_names(fields, axes))
    values, left_over = read_stored(layout, chosen, skip)
    labels, others = labels_of_layer(segments, chosen.component)
    return _Voxels(values, chosen.channels, labels, (left_over, *chosen.notes, wrong, others))


def _component_names(fields: dict[str, Field], axes: str) -> Sequence[str]:
    """Return the names of components by the kind of their axis, such as `RGB` for rgb-color, if it is known."""
    kinds = fields["kinds"].text.lower().split() if "kinds" in fields else []
    kind = kinds[axes.index("c")] if kinds and "c" in axes else ""
    color, is_color, _ = kind.partition("-color")
    if is_color and color.isalpha():
        return color.upper()
    plain = kind.replace("masked-", "")
    return [*["mask"] * (plain != kind), *_COMPONENTS.get(plain, "").split()]


def _unapplied(fields: dict[str, Field]) -> set[str]:
    """Return the fields of the header whose effect is not applied, by their names in STATEMENTS."""
    found = {each.field for each in STATEMENTS.statements if each.field.replace(" ", "") in fields}
    if "measurement frame" in found:
        frame = [vector for vector in _vectors(fields["measurementframe"], None) if vector is not None]
        found -= {"measurement frame"} if not frame or np.array_equal(frame, np.eye(3)[: len(frame)]) else set()
    return found


def _units(fields: dict[str, Field], axes: str, *, has_directions: bool) -> Units:
    """Return the unit that all axes of space share, the unit of values, and, for the space of a body, LPS as axes."""
    own = [unit for unit, letter in zip(_quoted(fields, "units"), axes, strict=False) if letter == "s"]
    lengths = {*(_quoted(fields, "spaceunits")[:3] or own)}
    space = fields["space"].text.lower() if "space" in fields else ""
    is_body = has_directions and space.startswith(("right", "left", "ras", "las", "lps"))
    value = fields["sampleunits"].text.strip('" ') if "sampleunits" in fields else ""
    return units_of(lengths.pop() if len(lengths) == 1 else "", "LPS" * is_body, value)


def _is_left_handed(space: Field) -> bool:
    return space.text.lower().startswith("3d-left-handed")


def _quoted(fields: dict[str, Field], name: str) -> list[str]:
    return re.findall('"([^"]*)"', fields[name].text) if name in fields else []


def _steps(fields: dict[str, Field], axes: str, sizes: tuple[int, ...]) -> TimeSteps:
    """Return the steps along the axis of time, if there is one."""
    k = axes.find("t")
    if k < 0:
        return TimeSteps()
    spacing, first = (_axis_numbers(fields, name, len(axes))[k] for name in ("spacings", "axismins"))
    units = _quoted(fields, "units")
    return even_steps_at(sizes[k], spacing, units[k] if len(units) == len(axes) else "", first)


def read_header(path: Path) -> tuple[dict[str, Field], Layout]:
    """Return the fields of a header by their names, in lower case without blanks, and the layout of the voxels.

    Raises InputError for headers that are damaged or foreign, and for missing data files.
    """
    fields, listed, offset = _parse(path)
    for name in ("dimension", "sizes", "type", "encoding"):
        if name not in fields:
            raise InputError(
                "this NRRD header lacks a field",
                expected=f"a line `{name}: ...`",
                hint="add that line, or save the file again",
            )
    num_axes = fields["dimension"].whole(1, _MAX_AXES)
    shape = tuple(int(n) for n in fields["sizes"].numbers(num_axes, whole=True, least=1))[::-1]
    dtype = np.dtype(_choice(fields["type"], _TYPES))
    encoding = _choice(fields["encoding"], _ENCODINGS)
    if dtype.itemsize > 1 and encoding != "text":
        order = _choice(fields["endian"], {"little": "<", "big": ">"}) if "endian" in fields else "="
        dtype = dtype.newbyteorder(order)
    files, num_split = [path], 0
    if "datafile" in fields:
        files, num_split = find_data_files(path, fields["datafile"].text, listed, shape)
        offset = 0
    num_bytes = dtype.itemsize * math.prod(shape) // len(files)
    parts = tuple(_part(fields, file, offset, encoding, num_bytes) for file in files)
    return fields, Layout(dtype, shape, parts, num_split)


def _segment_keys(fields: dict[str, Field]) -> dict[str, str]:
    return {name: field.text.strip() for name, field in fields.items() if name.startswith("Segment")}


def _read_layers(layout: Layout, chosen: Chosen, axes: str) -> tuple[Array, str | None]:
    """Return all components of a time step, [component, z, y, x], and a note on bytes that do not belong to voxels."""
    part = tuple(slice(None) if letter == "c" else item for letter, item in zip(axes, chosen.part, strict=True))
    values, left_over = read_stored(layout, chosen._replace(part=part))
    layers = np.moveaxis(values, axes.translate({ord("t"): None, ord("-"): None}).index("c"), 0)
    return (layers if layers.ndim == 4 else layers[:, np.newaxis]), left_over


def _part(fields: dict[str, Field], file: Path, offset: int, encoding: Encoding, num_bytes: int) -> StoredVoxels:
    """Return where a file stores `num_bytes` bytes of voxels: from `offset` on, after the lines and bytes to skip."""
    num_lines = fields["lineskip"].whole(0) if "lineskip" in fields else 0
    num_skipped = fields["byteskip"].whole(-1) if "byteskip" in fields else 0
    if num_skipped >= 0:
        start = _after_lines(file, offset, num_lines)
        return StoredVoxels(file, start, encoding, num_skipped, has_rest=num_skipped > 0 or num_lines > 0)
    if encoding != "raw":
        raise fields["byteskip"].error("a number from 0 on, as the encoding is not raw")
    return StoredVoxels(file, max(0, file.stat().st_size - num_bytes))


def _parse(path: Path) -> tuple[dict[str, Field], list[str], int]:
    """Return the fields, the lines of a list of data files, and the byte at which the header ends."""
    fields: dict[str, Field] = {}
    listed: list[str] = []
    is_list, end = False, 0
    for where, text, end in header_lines(path):
        if where == f"{path}:1":
            if not re.fullmatch(r"NRRD00\.?[0-9]+", text):
                raise InputError("this is not a NRRD file", expected="NRRD0004 or so in line 1")
        elif is_list:
            listed += [text] * bool(text)
        elif not text:
            return fields, [], end
        elif segment := _SEGMENT.fullmatch(text):
            fields[segment[1]] = Field(segment[1], segment[2], where)
        elif not text.startswith("#") and ":=" not in text:
            name, mark, value = text.partition(":")
            key = name.lower().replace(" ", "").replace("centerings", "centers")
            if not mark or key not in _FIELDS:
                raise InputError(
                    "this line of a NRRD header cannot be read",
                    where=where,
                    got=format_value(text),
                    expected="a field with its value, a comment, or an empty line before the voxels",
                    hint=did_you_mean(key[:40] if mark else None, sorted(_FIELDS)) or _NO_EMPTY_LINE,
                )
            add_field(fields, key, Field(" ".join(name.split()), value.strip(), where), "NRRD")
            is_list = key == "datafile" and value.split()[:1] == ["LIST"]
    if end == MAX_HEADER_BYTES:
        raise InputError(
            "the header of this NRRD file does not end",
            got=f"{MAX_HEADER_BYTES} bytes without an empty line",
            hint=_NO_EMPTY_LINE,
        )
    return fields, listed, end


def _choice(field: Field, choices: dict[str, Any]) -> Any:
    """Return the choice that a field's word names; raises InputError for any other word."""
    word = " ".join(field.text.lower().split())
    if word not in choices:
        expected = ", ".join(list(choices)[:_MAX_LISTED]) + ", ..." * (len(choices) > _MAX_LISTED)
        raise field.error(expected, did_you_mean(word[:40], choices) or "save it again in another form")
    return choices[word]


def _after_lines(file: Path, begin: int, num_lines: int) -> int:
    """Return the byte at which `num_lines` lines from `begin` on end; raises InputError beyond MAX_HEADER_BYTES."""
    if num_lines == 0:
        return begin
    with file.open("rb") as opened:
        opened.seek(begin)
        for _ in range(num_lines):
            left = begin + MAX_HEADER_BYTES - opened.tell()
            if not opened.readline(left):
                raise InputError(
                    "the lines before the voxels do not end",
                    where=str(file),
                    expected=f"{describe_count(num_lines)} lines in {MAX_HEADER_BYTES >> 20} MiB",
                    hint="the line skip of the header is wrong, or the file is truncated",
                )
        return opened.tell()


def _axes(fields: dict[str, Field], sizes: tuple[int, ...], directions: list[Float64 | None]) -> str:
    """Return a letter for each axis, the fastest first: `s` space, `t` time, `c` components, `-` an axis of length 1.

    Raises InputError for more axes of a kind than a volume has. If there are several axes of time or components, axes
    of length 1 do not count.
    """
    num_axes = len(sizes)
    kinds = fields["kinds"].text.lower().split() if "kinds" in fields else []
    if kinds and len(kinds) != num_axes:
        raise fields["kinds"].error(f"{num_axes} words, one for each axis")
    kinds = kinds or [""] * num_axes
    space, times, lists = list[int](), list[int](), list[int]()
    for k, kind in enumerate(kinds):
        if kind in ("time", "domain", "space", *_UNKNOWN_KINDS):
            has_no_place = bool(directions) and directions[k] is None
            (times if kind == "time" or (has_no_place and k > 0) else lists if has_no_place else space).append(k)
        elif directions and directions[k] is not None:
            raise fields["kinds"].error(f"domain or space for axis {k + 1}, which has a direction in space")
        else:
            lists.append(k)
    if len(space) == 2 and times:  # a film of pictures is drawn as a volume
        space.append(times.pop(0))
    if len(space) == 4 and not times:
        times.append(space.pop())
    lists, times = ([k for k in found if sizes[k] > 1] or found[:1] for found in (lists, times))
    if len(lists) > 1 or len(times) > 1 or not 2 <= len(space) <= 3:
        raise InputError(
            "the axes of this NRRD file are not those of a volume",
            got=f"{num_axes} axes" + f" of the kinds {' '.join(kinds)}" * any(kinds),
            expected="two or three axes in space, at most one of components, and at most one of time",
        )
    letters = dict.fromkeys(space, "s") | dict.fromkeys(times, "t") | dict.fromkeys(lists, "c")
    return "".join(letters.get(k, "-") for k in range(num_axes))


def _vectors(field: Field, count: int | None) -> list[Float64 | None]:
    """Return `count` vectors of a field in three dimensions, or None for a vector that is not in space.

    A vector is not in space if it is `none`, NaN, or one of several and runs in time alone. count: None for any number
    of vectors.
    """
    vectors: list[Float64 | None] = []
    matches = list(_VECTOR.finditer(field.text))
    if _VECTOR.sub("", field.text).strip() or len(matches) != (count or len(matches)):
        each = ", one for each axis; none for axes that are not in space"
        raise field.error("a vector such as (1,0,0)" if count == 1 else f"{count} vectors such as (1,0,0){each}")
    for match in matches:
        words = match[1].split(",") if match[1] is not None else ["nan"]
        try:
            numbers = np.array([float(word) for word in words])
        except ValueError:
            raise field.error("vectors of numbers, such as (1,0,0)") from None
        if len(numbers) > 4:
            raise field.error("vectors of at most four numbers, of which the last is in time")
        is_in_time = len(numbers) == 4 and not numbers[:3].any() and len(matches) > 1
        has_place = not (np.isnan(numbers).all() or is_in_time)
        vectors.append(np.pad(numbers[:3], (0, max(0, 3 - len(numbers)))) if has_place else None)
    return vectors


def _world_from_index(fields: dict[str, Field], axes: str, directions: list[Float64 | None]) -> tuple[Float64, bool]:
    """Return the affine from voxel indices to LPS, float64 [4, 4], and whether the header gives a spacing."""
    space = [k for k, letter in enumerate(axes) if letter == "s"]
    spacing, first = _scalar_places(fields, space, len(axes))
    vectors = np.diag(spacing)
    for column, k in enumerate(space if directions else ()):
        direction = directions[k]
        if direction is not None:
            vectors[:, column] = direction
    origins = _vectors(fields["spaceorigin"], 1) if "spaceorigin" in fields else [None]
    origin = first if origins[0] is None else origins[0]
    factors = _choice(fields["space"], _SPACES) if "space" in fields else (1.0, 1.0, 1.0)
    has_spacing = bool(directions) or "spacings" in fields or {"axismins", "axismaxs"} <= fields.keys()
    return in_lps(affine(np.ones(3), origin, vectors), factors), has_spacing


def _scalar_places(fields: dict[str, Field], space: list[int], num_axes: int) -> tuple[Float64, Float64]:
    """Return the spacing and the position of the first voxel, float64 [3] each, for a header without directions.

    A missing spacing is 1, and a missing position 0. The field `centers` says where samples lie: for `cell` in the
    middle of a step, for `node` at its ends.
    """
    spacings, mins, maxs = (_axis_numbers(fields, name, num_axes) for name in ("spacings", "axismins", "axismaxs"))
    centers = fields["centers"].text.lower().split() if "centers" in fields else []
    if "centers" in fields and (len(centers) != num_axes or not set(centers) <= set(_CENTERS)):
        raise fields["centers"].error(f"{num_axes} words, one for each axis: cell, node or ???")
    sizes = fields["sizes"].numbers(num_axes)
    spacing, first = np.ones(3), np.zeros(3)
    for column, k in enumerate(space):
        is_node = centers[k : k + 1] == ["node"]
        step = spacings[k]
        if "spacings" in fields and np.isnan(step):
            raise fields["spacings"].error(
                "a number for each axis of space", "correct that line; without it, voxels are 1 long"
            )
        if np.isnan(step):
            step = (maxs[k] - mins[k]) / max(sizes[k] - is_node, 1)
        spacing[column] = 1.0 if np.isnan(step) else step
        if not np.isnan(mins[k]):
            first[column] = mins[k] + (0.0 if is_node else spacing[column] / 2)
    return spacing, first


def _axis_numbers(fields: dict[str, Field], name: str, num_axes: int) -> list[float]:
    """Return a field's number for each axis; NaN for `nan`, and for a missing field."""
    if name not in fields:
        return [math.nan] * num_axes
    try:
        numbers = [float(word) for word in fields[name].text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != num_axes:
        raise fields[name].error(f"{num_axes} numbers, one for each axis")
    return numbers
