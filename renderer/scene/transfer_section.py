"""The scene's `transfer_function`: colours, control points and colormaps."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

from renderer.scene import schema
from renderer.scene.colormaps import is_colormap, nearest_colormap
from renderer.scene.message_text import did_you_mean, format_value
from renderer.scene.schema import INVALID, Color, TreeNode

COLOR_NAMES = {
    "black": "#000000",
    "white": "#ffffff",
    "gray": "#808080",
    "grey": "#808080",
    "silver": "#c0c0c0",
    "red": "#ff0000",
    "maroon": "#800000",
    "orange": "#ffa500",
    "brown": "#a52a2a",
    "yellow": "#ffff00",
    "olive": "#808000",
    "lime": "#00ff00",
    "green": "#008000",
    "cyan": "#00ffff",
    "teal": "#008080",
    "blue": "#0000ff",
    "navy": "#000080",
    "magenta": "#ff00ff",
    "purple": "#800080",
    "pink": "#ffc0cb",
}

_HEX = re.compile(r"#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})")
_PART = schema.number_field(minimum=0, maximum=1)


def _parse_color(node: TreeNode) -> Color:
    if isinstance(node.value, (list, tuple)):
        return _parse_rgb(node)
    if not isinstance(node.value, str):
        return COLOR_FIELD.reject(node, "not a color")
    text = COLOR_NAMES.get(node.value.lower(), node.value)
    if not _HEX.fullmatch(text):
        return COLOR_FIELD.reject(
            node,
            "not a color",
            got=format_value(node.value),
            hint=did_you_mean(text.lower(), COLOR_NAMES),
        )
    digits = text[1:] if len(text) == 7 else "".join(2 * digit for digit in text[1:])
    red, green, blue = (int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4))
    return red, green, blue


def _parse_rgb(node: TreeNode) -> Color:
    parts = node.value if isinstance(node.value, (list, tuple)) else ()
    if len(parts) == 3 and all(isinstance(part, int) for part in parts) and 1 < max(parts) <= 255 and min(parts) >= 0:
        hint = f'write it as "#{parts[0]:02x}{parts[1]:02x}{parts[2]:02x}"'
        return COLOR_FIELD.reject(node, "not a color", hint=hint)
    return schema.sequence_field(_PART, COLOR_FIELD.expected, count=3).read(node)  # type: ignore[return-value]  # three, or INVALID


COLOR_FIELD = schema.FieldType(
    'a color: "#rrggbb", "#rgb", [red, green, blue] from 0 to 1, or a name such as white',
    _parse_color,
    'a color that begins with # needs quotes: "#ff8800"',
)


def _parse_colormap(node: TreeNode) -> str:
    if not isinstance(node.value, str):
        return COLORMAP_FIELD.reject(node, "not the name of a colormap")
    if not is_colormap(node.value):
        close = nearest_colormap(node.value)
        hint = f"did you mean {close}?" if close else None
        return COLORMAP_FIELD.reject(node, "unknown colormap", hint=hint)
    return node.value


COLORMAP_FIELD = schema.FieldType("a name such as viridis, gray, cividis_r or crameri:batlow", _parse_colormap)


@dataclass(frozen=True)
class ControlPoint:
    """Colour and opacity (in [0, 1], per `TransferSpec.unit`) at a scalar value, in data units."""

    value: Annotated[float, schema.number_field()]
    color: Annotated[Color, COLOR_FIELD]
    opacity: Annotated[float, _PART]


@dataclass(frozen=True)
class ColormapSpec:
    """A named colormap stretched over `range`, with opacity points (value, opacity)."""

    name: str
    range: tuple[float, float]
    opacity: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class TransferSpec:
    """Scalar to colour and extinction: either control points, values not descending, or a colormap.

    `unit` is the world length that opacities refer to; None means the volume's finest spacing.
    """

    mapping: tuple[ControlPoint, ...] | ColormapSpec
    unit: float | None = None


_VALUE_RANGE = schema.sequence_field(schema.number_field(), "[low, high]: two numbers, low less than high", count=2)


def _parse_opacity_point(node: TreeNode) -> tuple[float, float]:
    if not isinstance(node.value, (list, tuple)) or len(node.value) != 2:
        return _OPACITY_POINT.reject(node, "not a pair")
    value, opacity = node.value
    return schema.number_field().read(node.child(0, value)), _PART.read(node.child(1, opacity))


_OPACITY_POINT = schema.FieldType("[value, opacity]: a number, and a number from 0 to 1", _parse_opacity_point)


_FIELDS: schema.FieldTable = {
    "unit": schema.LENGTH_FIELD,
    "points": schema.sequence_field(
        schema.dataclass_field(ControlPoint), "a list of {value: ..., color: ..., opacity: ...}, one or more"
    ),
    "colormap": COLORMAP_FIELD,
    "range": _VALUE_RANGE,
    "opacity": schema.sequence_field(_OPACITY_POINT, "a list of [value, opacity], one or more"),
}
_COLORMAP_KEYS = ("colormap", "range", "opacity")


def _build_transfer(node: TreeNode, given: dict[str, Any]) -> TransferSpec:
    unit = given.get("unit")
    of_colormap = [key for key in _COLORMAP_KEYS if key in given]
    if "points" in given:
        for key in schema.valid_keys(given, *_COLORMAP_KEYS):
            expected = "either points, or colormap with range and opacity"
            node.key(key).add_problem(f"contradicts {node.path}.points", expected=expected)
        points = given["points"] if isinstance(given["points"], tuple) else ()
        pairs = [(getattr(point, "value", INVALID), getattr(point, "opacity", INVALID)) for point in points]
        _check_points(node.child("points"), pairs, "value")
        return TransferSpec(points, unit)
    if not of_colormap:
        node.add_problem("no colors and opacities", expected="points, or colormap with range and opacity")
        return TransferSpec((), unit)
    for key in _COLORMAP_KEYS:
        if key not in given:
            hint = "`hsplat info` shows the values of a volume" if key == "range" else None
            _FIELDS[key].reject(node.child(key), "missing", hint=hint)
    _check_colormap(node, given)
    name, value_range, opacity = (given.get(key, INVALID) for key in _COLORMAP_KEYS)
    return TransferSpec(ColormapSpec(name, value_range, opacity), unit)


def _check_colormap(node: TreeNode, given: dict[str, Any]) -> None:
    low_high = given.get("range", INVALID)
    if isinstance(low_high, tuple) and INVALID not in low_high and low_high[0] >= low_high[1]:
        hint = "append _r to the name to reverse a colormap" if low_high[0] > low_high[1] else None
        _VALUE_RANGE.reject(node.child("range"), "not ascending", got=format_value(low_high), hint=hint)
    pairs = given.get("opacity", INVALID)
    if isinstance(pairs, tuple):
        pairs = [pair if isinstance(pair, tuple) else (INVALID, INVALID) for pair in pairs]
        _check_points(node.child("opacity"), pairs, 0)


def _check_points(node: TreeNode, points: list[tuple[Any, Any]], value_key: object) -> None:
    """Check the values and opacities of points."""
    _check_order(node, [value for value, _ in points], value_key)
    if points and all(opacity == 0 for _, opacity in points):
        node.add_problem("nothing is visible: every opacity is 0", expected="an opacity greater than 0")


def _check_order(node: TreeNode, values: list[Any], key: object) -> None:
    """Check that values do not descend: two equal values are a step, and a third between them has no effect."""
    for index, (before, value) in enumerate(pairwise(values), start=1):
        if INVALID in (before, value):
            continue
        place = node.child(index).child(key)
        if value < before:
            place.add_problem(
                "points out of order",
                got=format_value(value),
                expected=f"at least {format_value(before)}, as in the point before",
            )
        elif value == before and index > 1 and values[index - 2] == value:
            place.add_problem("a third point at the same value", got=format_value(value), hint="two points make a step")


TRANSFER_FUNCTION_SECTION = schema.section_field(_FIELDS, _build_transfer)
