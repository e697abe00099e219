"""The scene's `transfer_function`: colours, control points and colormaps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from renderer.errors import InputError
from renderer.scene import schema
from renderer.scene.colormaps import is_colormap, nearest_colormap
from renderer.scene.colors import COLOR_FIELD
from renderer.scene.input_file import read_bounded, require_file
from renderer.scene.labels_section import LABELS_TABLE, LabelsSpec, build_labels
from renderer.scene.message_text import format_value
from renderer.scene.motion import Motion, at_keys, is_plain, motions_in, moving_result, value_at, values_at
from renderer.scene.schema import INVALID, Color, KeyText, TreeNode

if TYPE_CHECKING:
    from renderer.looks import Look

_WHITE: Color = (1.0, 1.0, 1.0)
_NUMBER = schema.number_field()
_PART = schema.number_field(minimum=0, maximum=1)
_PERCENTILE = schema.number_field(minimum=0, maximum=100)


def _parse_colormap(node: TreeNode) -> Any:
    if not isinstance(node.value, str):
        return node.reject("not the name of a colormap")
    if is_colormap(node.value):
        return node.value
    close = nearest_colormap(node.value)
    return node.reject("unknown colormap", hint=f"did you mean {close}?" if close else None)


COLORMAP_FIELD = schema.FieldType(
    "a name such as viridis, gray, cividis_r or crameri:batlow",
    _parse_colormap,
    plain_schema=schema.of_json_type("string"),
    example="viridis",
)


@dataclass(frozen=True)
class ControlPoint:
    """A colour and an opacity at a scalar value, which is in the units of the voxels.

    opacity: in [0, 1], over the length `TransferSpec.unit`. Only projections may leave it out.
    """

    value: Annotated[float, _NUMBER, KeyText("A value of the voxels.", example="255")]
    color: Annotated[Color, COLOR_FIELD, KeyText("The color of matter with this value.")]
    opacity: Annotated[
        float, _PART, KeyText("The share of light that matter as thick as `unit` holds back: 0 none, 1 all.")
    ] = 1.0


@dataclass(frozen=True)
class ColormapSpec:
    """A named colormap stretched over `range`, with opacity points.

    opacity: pairs (value, opacity). Only projections may leave them out.
    scale: with `log`, colours and opacities are linear in the logarithm of the scalar, and all values are above 0.
    """

    colormap: str
    range: tuple[float, float]
    opacity: tuple[tuple[float, float], ...]
    scale: Literal["log"] | None = None


@dataclass(frozen=True)
class ImportedLook:
    """The origin of imported control points.

    name: the name of the preset, or of the file without its folder. file: the path of the file; None for a preset.
    has_opacities: whether the file or the scene gives opacities. shading: the light in the file, as keys of `shading`.
    left_out: clauses on features of the file that hsplat lacks.
    look, range, opacity: the transfer function in the file, and the scene's keys `range` and `opacity`. Control points
        are made again from them when percentiles have been replaced by values.
    """

    name: str
    file: Path | None
    has_opacities: bool
    shading: Mapping[str, Any]
    left_out: tuple[str, ...]
    look: Any
    range: tuple[float, float] | None
    opacity: tuple[tuple[float, float], ...] | None


@dataclass(frozen=True)
class TransferSpec:
    """A map from scalars to colours and extinctions.

    mapping: control points with values that do not descend, a colormap, or labels. None if it is not chosen yet, for
        channels and for voxels that are colours: `renderer.resolve.resolve_scene` chooses it.
    unit: the world length that opacities refer to; None is the volume's finest spacing.
    imported: the origin of imported control points. It changes no picture and is not recorded.
    relative: whether values are percentiles of the volume's voxels with data, until `resolve_scene` replaces them.
    """

    mapping: tuple[ControlPoint, ...] | ColormapSpec | LabelsSpec | None
    unit: Annotated[float | None, schema.LENGTH_FIELD] = None
    imported: ImportedLook | None = field(default=None, compare=False)
    relative: bool = False

    @property
    def points(self) -> tuple[ControlPoint, ...]:
        """Return the control points; empty for a colormap and for labels."""
        return self.mapping if isinstance(self.mapping, tuple) else ()

    @property
    def labels(self) -> LabelsSpec | None:
        """Return the labels, if the volume's values are labels."""
        return self.mapping if isinstance(self.mapping, LabelsSpec) else None

    @property
    def is_open(self) -> bool:
        """Return whether colours and opacities are still to be chosen."""
        return self.mapping is None

    def written(self) -> dict[str, object]:
        """Return the section as a scene file has it: its keys with their values."""
        if isinstance(self.mapping, ColormapSpec):
            keys = vars(self.mapping)
        elif isinstance(self.mapping, LabelsSpec):
            keys = self.mapping.written()
        else:
            keys = {"points": self.mapping}
        return keys | {"unit": self.unit, "relative": self.relative or None}


def _check_range(node: TreeNode, low_high: tuple[Any, ...]) -> Any:
    low, high = low_high
    if low < high:
        return low_high
    return node.reject("not ascending", hint="append _r to the name to reverse a colormap" if low > high else None)


VALUE_RANGE_FIELD = schema.sequence_field(
    _NUMBER, "[low, high]: two numbers, low less than high", count=2, check=_check_range
)
_OPACITY_POINT = schema.pair_field(_NUMBER, _PART, "[value, opacity]: a number, and a number from 0 to 1")
_UNIT_FIELD = schema.described(
    schema.LENGTH_FIELD,
    "The thickness of matter that has the given opacities, in world units.",
    words="the finest spacing",
    example="1",
)
_COLORMAP_FIELDS: schema.FieldTable = {
    "colormap": schema.described(
        COLORMAP_FIELD, "In place of `points`, with `range` and `opacity`: a colormap of cmap or ParaView."
    ),
    "range": schema.described(
        VALUE_RANGE_FIELD,
        "The values of the first and the last color, of a colormap or an import.",
        example="[0, 255]",
    ),
    "opacity": schema.described(
        schema.sequence_field(_OPACITY_POINT, "a list of [value, opacity], one or more"),
        "Pairs [value, opacity], in place of those of an import; projections need none.",
        example="[[0, 0], [255, 0.4]]",
    ),
}
_IMPORT = schema.text_field(
    "the file of a transfer function, or the name of a preset such as ct-bone",
    "not a name of a file",
    schema.is_file_name,
)
_IMPORT_FIELDS: schema.FieldTable = {
    "import": schema.described(
        _IMPORT,
        "In place of `points`: a preset, or the file of another program's transfer function.",
        example="ct-bone",
    ),
    "name": schema.described(
        schema.TEXT_FIELD,
        "With `import`: the name of a transfer function in the file.",
        words="the only one",
        example="CT-Bone",
    ),
    "shift": schema.described(
        schema.number_field(),
        "With `import`: a number added to the file's values, after `scale`.",
        words="0",
        example="-1024",
    ),
    "scale": schema.described(
        schema.word_or(
            {"log": "log", "linear": None},
            schema.number_field(above=0),
            "beside a colormap log or linear; beside import a number greater than 0",
        ),
        "With `import`: a factor on the file's values. With `colormap`: `linear` or `log`.",
        words="1 with `import`, linear with `colormap`",
        example="log",
    ),
}
_FIELDS: schema.FieldTable = {
    "unit": _UNIT_FIELD,
    "relative": schema.described(
        schema.BOOLEAN_FIELD,
        "Whether values are percentiles of the voxels with data.",
        default=TransferSpec.relative,
    ),
    "points": schema.described(
        schema.sequence_field(
            schema.dataclass_field(ControlPoint),
            "a list of {value: ..., color: ..., opacity: ...}, one or more",
            motion="linear",
        ),
        "Control points with ascending values, linear in color and extinction between; two at one value are a step.",
        example="[{value: 0, color: black, opacity: 0}, {value: 255, color: white, opacity: 0.5}]",
    ),
    **_COLORMAP_FIELDS,
    **_IMPORT_FIELDS,
}


def _read_transfer(node: TreeNode, given: dict[str, Any]) -> TransferSpec:
    relative = given.get("relative") is True
    if relative:
        _check_percentiles(node, given)
    return replace(_build_transfer(node, given), relative=relative)


def _check_percentiles(node: TreeNode, given: Mapping[str, Any]) -> None:
    """Check that values are percentiles, and that `shift` and `scale` are not given."""
    for key in ("points", "range", "opacity"):
        for number, item in enumerate(given[key] if isinstance(given.get(key), tuple) else ()):
            place, value = node.child(key).child(number), item
            if isinstance(item, ControlPoint):
                place, value = place.child("value"), item.value
            elif isinstance(item, tuple):
                place, value = place.child(0), item[0]
            if value is not INVALID and is_plain(value):
                _PERCENTILE.parse(replace(place, value=value))
    for key in schema.valid_keys(given, "shift", "scale") if "import" in given else ():
        node.key(key).reject(f"contradicts {node.path}.relative", expected="", hint="range says where its values are")


def _build_transfer(node: TreeNode, given: dict[str, Any]) -> TransferSpec:
    unit = given.get("unit")
    of_colormap = [] if isinstance(given.get("scale"), (float, Motion)) else ["scale"]  # `scale: log` is of a colormap
    if "import" in given:
        for key in schema.valid_keys(given, "points", "colormap", *of_colormap):
            node.key(key).reject(f"contradicts {node.path}.import", expected="one of them")
        return _import(node, given | dict.fromkeys(given.keys() & of_colormap, INVALID))
    for key in schema.valid_keys(given, *(_IMPORT_FIELDS.keys() - of_colormap)):
        node.key(key).reject(f"needs {node.path}.import")
    if "points" in given:
        for key in schema.valid_keys(given, *_COLORMAP_FIELDS, *of_colormap):
            expected = "either points, or colormap with range and opacity"
            node.key(key).reject(f"contradicts {node.path}.points", expected=expected)
        points: Any = given["points"] if isinstance(given["points"], (tuple, Motion)) else ()
        known = () if isinstance(points, Motion) else points
        pairs = [(getattr(point, "value", INVALID), getattr(point, "opacity", INVALID)) for point in known]
        _check_points(node.child("points"), pairs, "value")
        return TransferSpec(points, unit)
    if not any(key in given for key in _COLORMAP_FIELDS):
        node.reject("no colors and opacities", got="", expected="points, colormap with range and opacity, or import")
    elif _has_opacities_alone(given):
        opacity = given["opacity"]
        _check_opacity(node.child("opacity"), opacity)
        is_valid = isinstance(opacity, Motion) or (isinstance(opacity, tuple) and INVALID not in opacity)
        return TransferSpec(moving_result(_points, opacity if is_valid else ()), unit)
    else:
        _require_colormap(node, given)
    name, low_high, opacity = (given.get(key, INVALID) for key in _COLORMAP_FIELDS)
    ends = value_at(low_high, 0)
    if "opacity" not in given and isinstance(ends, tuple) and INVALID not in ends:
        opacity = ((ends[0], 1.0),)
    pairs = _check_opacity(node.child("opacity"), opacity)
    scale = given.get("scale")
    if scale == "log" and given.get("relative") is not True:
        low = low_high[0] if isinstance(low_high, tuple) else INVALID
        _check_positive(node.child("range"), low)
        for index, (value, _) in enumerate(pairs):
            _check_positive(node.child("opacity").child(index), value)
    return TransferSpec(ColormapSpec(name, low_high, opacity, scale), unit)


def _points(opacities: Sequence[tuple[float, float]]) -> tuple[ControlPoint, ...]:
    """Return white control points with the given values and opacities."""
    return tuple(ControlPoint(value, _WHITE, opacity) for value, opacity in opacities)


def _has_opacities_alone(section: Mapping[str, object]) -> bool:
    """Return whether a transfer function has opacities but no colours, which is enough for voxels that are colours."""
    return "opacity" in section and section.keys() <= {"opacity", "unit", "relative"}


def _require_colormap(node: TreeNode, given: Mapping[str, Any]) -> None:
    for key in [key for key in _COLORMAP_FIELDS if key not in given and key != "opacity"]:
        hint = "`hsplat info` shows the values of a volume" if key == "range" else None
        _FIELDS[key].reject(node.child(key), "missing", hint=hint)


def check_colors_given(node: TreeNode) -> None:
    """Check that the text of a transfer function gives colours. Only voxels that are colours need none."""
    if isinstance(node.value, Mapping) and _has_opacities_alone(node.value):
        _require_colormap(node, node.value)


def _check_positive(node: TreeNode, value: Any) -> None:
    if value is not INVALID and is_plain(value) and value <= 0:
        hint = "smaller values, also 0 and less, are drawn as the first of the range and of the opacities"
        node.child(0, value).reject("no logarithm", expected="with scale: log, a number greater than 0", hint=hint)


def _import(node: TreeNode, given: dict[str, Any]) -> TransferSpec:
    """Return the control points of a file or a preset. Opacities and a unit in the scene replace those of the file."""
    from renderer.looks import MAX_LOOK_POINTS

    span, opacities, num_problems = given.get("range"), given.get("opacity"), len(node.problems)
    if not all(map(_is_valid, given.values())):
        return TransferSpec((INVALID,))
    _check_points(node.child("opacity"), list(opacities) if isinstance(opacities, tuple) else [], 0)
    found = _read_look(node, given["import"], given.get("name"))
    if found is None or len(node.problems) > num_problems:
        return TransferSpec((INVALID,))
    file, look = found
    relative = given.get("relative") is True
    if (look.is_share or relative) and span is None:
        hint = "its values are shares of a range; `hsplat info` shows the values of a volume"
        hint = "it is stretched from one percentile to another: [50, 99]" if relative else hint
        _FIELDS["range"].reject(node.child("range"), "missing", hint=hint)
        return TransferSpec((INVALID,))

    points = _place_points(look, span, opacities, given.get("scale", 1.0), given.get("shift", 0.0))
    place, first = node.child("import", given["import"]), value_at(points, 0)
    if not all(math.isfinite(point.value) for point in first):
        place.reject("its values become too large for a number")
    if len(first) > MAX_LOOK_POINTS:
        place.reject("too many points", got=str(len(first)), expected=f"at most {MAX_LOOK_POINTS}")
    _check_points(place, [(point.value, point.opacity) for point in first], 0)
    name, has_opacities = Path(given["import"]).name, look.has_opacities or opacities is not None
    imported = ImportedLook(name, file, has_opacities, look.shading, look.left_out, look, span, opacities)
    return TransferSpec(points, given.get("unit", look.unit), imported)


def _place_points(look: Look, span: Any, opacities: Any, scale: float = 1.0, shift: float = 0.0) -> Any:
    """Return the control points of a look, which is a transfer function from a file or a preset.

    span: the range of values that replaces the look's own range, if it is given. scale, shift: the factor on values,
        and the number that is then added. opacities: pairs (value, opacity) that replace the look's own opacities, if
        they are given.
    All parameters but the look may move.
    """
    from renderer.looks import place_look

    def place(span: Any, scale: float, shift: float, opacities: Any) -> tuple[ControlPoint, ...]:
        placed = place_look(look, span=span, scale=scale, shift=shift, opacities=opacities)
        return tuple(ControlPoint(*point) for point in placed)

    return moving_result(place, span, scale, shift, opacities)


def _is_valid(value: object) -> bool:
    return value is not INVALID and (not isinstance(value, tuple) or all(map(_is_valid, value)))


def _read_look(node: TreeNode, source: str, name: str | None) -> tuple[Path | None, Look] | None:
    """Return the path of a file, or None for a preset, and the look in it. After a problem, return None for both.

    source: the name of the file or the preset. name: the name of one of several looks in the file.
    """
    from renderer.looks import MAX_LOOK_BYTES, LookNameError, read_look, read_preset

    path = node.base / source
    try:
        if not path.suffix:
            return None, read_preset(source)
        require_file(path, "a transfer function")
        return path, read_look(path, read_bounded(path, MAX_LOOK_BYTES, "a transfer function"), name)
    except InputError as error:
        is_name = isinstance(error, LookNameError) and path.suffix
        place = node.child("name", name) if is_name else node.child("import", source)
        what = f"{error.where}: {error.what}" if error.where else error.what
        place.reject(what, got=error.got or "", expected=error.expected or "", hint=error.hint)
        return None


def _check_points(node: TreeNode, points: list[tuple[Any, Any]], value_key: object) -> None:
    """Check the values and opacities of control points.

    Values must not descend. Two points at one value make a step; a third point at this value would have no effect.
    """
    values = [value for value, _ in points]
    for index, (before, value) in enumerate(pairwise(values), start=1):
        place = node.child(index).child(value_key, value)
        if INVALID in (before, value) or not is_plain(before, value):
            continue
        if value < before:
            place.reject("points out of order", expected=f"at least {format_value(before)}, as in the point before")
        elif value == before and index > 1 and values[index - 2] == value:
            place.reject("a third point at the same value", hint="two points make a step")
    may_appear = node.film is not None and node.film.keys  # values that move may show something on another frame
    if points and all(opacity == 0 for _, opacity in points) and not may_appear:
        node.reject("nothing is visible: every opacity is 0", expected="an opacity greater than 0")


def _check_opacity(node: TreeNode, opacity: object) -> list[tuple[Any, Any]]:
    """Return the values and opacities of a list of pairs, and check them."""
    pairs = [(INVALID, INVALID) if pair is INVALID else pair for pair in opacity] if isinstance(opacity, tuple) else []
    _check_points(node, pairs, 0)
    return pairs


def check_opacities(node: TreeNode, transfer: object) -> None:
    """Check that the text of a transfer function, or the file that it imports, gives opacities."""
    section = node.value if isinstance(node.value, Mapping) else {}
    points, imported = section.get("points"), getattr(transfer, "imported", None)
    if imported is not None and not imported.has_opacities:
        hint = "the file has colours alone"
        _COLORMAP_FIELDS["opacity"].reject(node.child("opacity"), "missing", hint=hint)
    if "colormap" in section and not {"points", "opacity"} & section.keys():
        _COLORMAP_FIELDS["opacity"].reject(node.child("opacity"), "missing")
    for index, point in enumerate(points if isinstance(points, (list, tuple)) else ()):
        if isinstance(point, Mapping) and "value" in point and "opacity" not in point:
            _PART.reject(node.child("points").child(index).child("opacity"), "missing")


_KINDS = schema.Alternatives([("points", "colormap", "import")], [("points", "colormap", "import", "opacity")])
TRANSFER_FUNCTION_SECTION = schema.section_field(_FIELDS, _read_transfer, alternatives=_KINDS)


def map_values(transfer: TransferSpec, function: Callable[[float], float]) -> TransferSpec:
    """Return a transfer function whose scalar values are mapped by a function that does not descend.

    Labels stay as they are. Values that move are mapped at their keys. Of several points that are mapped to one value,
    the first and the last remain.
    """

    def mapped(part: Any) -> Any:
        if isinstance(part, Motion):
            return at_keys(mapped, part)
        if isinstance(part, ControlPoint):
            return replace(part, value=mapped(part.value))
        return tuple(map(mapped, part)) if isinstance(part, tuple) else function(part)

    def mapped_pairs(pairs: Any) -> Any:
        points = _without_ties(mapped(moving_result(_points, pairs)))
        return moving_result(lambda points: tuple((point.value, point.opacity) for point in points), points)

    mapping, imported = transfer.mapping, transfer.imported
    if transfer.relative and imported is not None:
        opacities = None if imported.opacity is None else mapped_pairs(imported.opacity)
        mapping = _place_points(imported.look, mapped(imported.range), opacities)
    elif isinstance(mapping, ColormapSpec):
        mapping = replace(mapping, range=mapped(mapping.range), opacity=mapped_pairs(mapping.opacity))
    elif not isinstance(mapping, LabelsSpec):
        mapping = _without_ties(mapped(mapping))
    return replace(transfer, mapping=mapping, relative=False)


def _without_ties(points: Any) -> Any:
    """Return control points without those that have the value of both neighbours at all keys of their motions."""
    frames = {frame for motion in motions_in(points) for frame in motion.frames} or {0}
    values = list(zip(*([point.value for point in values_at(points, frame)] for frame in frames), strict=True))
    last = len(values) - 1
    kept = [k for k in range(last + 1) if k in (0, last) or not values[k - 1] == values[k] == values[k + 1]]
    return at_keys(lambda points: tuple(points[k] for k in kept), points)


def _build_labels(node: TreeNode, given: dict[str, Any]) -> TransferSpec:
    unit = given.pop("unit", None)
    return TransferSpec(build_labels(node, given), unit)


# The type of the key `labels`, which a scene of labels has in place of `transfer_function`.
LABELS_FIELD = schema.section_field({**LABELS_TABLE, "unit": _UNIT_FIELD}, _build_labels)
