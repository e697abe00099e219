"""Read the colours of a scene."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from renderer.scene import schema
from renderer.scene.message_text import did_you_mean
from renderer.scene.schema import Color, JsonSchema, TreeNode

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

_HEX_PATTERN = "^#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})$"
_HEX = re.compile(_HEX_PATTERN)
_PART = schema.number_field(minimum=0, maximum=1)
_RGB = schema.sequence_field(_PART, "", count=3)


def _parse_color(node: TreeNode) -> Any:
    if isinstance(node.value, (list, tuple)):
        return _parse_rgb(node, node.value)
    if not isinstance(node.value, str):
        return node.reject("not a color")
    text = COLOR_NAMES.get(node.value.lower(), node.value)
    if not _HEX.fullmatch(text):
        return node.reject("not a color", hint=did_you_mean(text.lower(), COLOR_NAMES))
    return _from_hex(text)


def _from_hex(text: str) -> Color:
    digits = text[1:] if len(text) == 7 else "".join(2 * digit for digit in text[1:])
    red, green, blue = (part / 255 for part in bytes.fromhex(digits))
    return red, green, blue


def _parse_rgb(node: TreeNode, parts: Sequence[Any]) -> Any:
    if len(parts) == 3 and all(isinstance(part, int) for part in parts) and 1 < max(parts) <= 255 and min(parts) >= 0:
        return node.reject("not a color", hint=f'write it as "#{bytes(parts).hex()}"')
    return _RGB.parser(node)


def _color_schema(moves: bool) -> JsonSchema:
    return schema.any_of(
        {"enum": [*COLOR_NAMES]}, {"type": "string", "pattern": _HEX_PATTERN}, _RGB.plain_schema(moves)
    )


COLOR_FIELD = schema.FieldType(
    'a color: "#rrggbb", "#rgb", [red, green, blue] from 0 to 1, or a name such as white',
    _parse_color,
    'a color that begins with # needs quotes: "#ff8800"',
    motion="linear",
    plain_schema=_color_schema,
    words={name: _from_hex(text) for name, text in COLOR_NAMES.items()},
    example="white",
)
