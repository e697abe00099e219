"""The size of pictures, as an output of a scene has it: in pixels, or in print with units and pixels per inch."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from renderer.scene import schema
from renderer.scene.schema import INVALID, TreeNode

# The largest width or height of a picture, in pixels.
MAX_SIDE = 16384
# The smallest and largest resolution of a printed picture, in pixels per inch.
_MIN_DPI, _MAX_DPI = 1, 10000
# The units of printed lengths, in inches.
_INCHES = {"mm": 1 / 25.4, "cm": 1 / 2.54, "in": 1.0, "pt": 1 / 72}
# A printed length, such as `85 mm`: at most nine digits before the point and after it.
_LENGTH = re.compile(r"([0-9]{1,9}(?:\.[0-9]{1,9})?) ?(mm|cm|in|pt)")
# The size in pixels as programs often write it: `640x480`.
_SIDES = re.compile(r"([0-9]{1,9}) ?[x×,] ?([0-9]{1,9})")
# The height of a printed picture without a height of its own, as a share of its width.
_PAPER_RATIO = 0.75

DPI_FIELD = schema.number_field(minimum=_MIN_DPI, maximum=_MAX_DPI, motion=None)


class PaperSize(NamedTuple):
    """The size of a printed picture: its width and height in inches, and its resolution in pixels per inch.

    height: None for three quarters of the width. dpi: None for that of the output.
    """

    width: float
    height: float | None = None
    dpi: float | None = None

    def pixels(self, dpi: float) -> tuple[int, int]:
        """Return the size in pixels, at a resolution."""
        height = _PAPER_RATIO * self.width if self.height is None else self.height
        return round(self.width * dpi), round(height * dpi)


def _parse_length(node: TreeNode) -> Any:
    found = _LENGTH.fullmatch(node.value) if isinstance(node.value, str) else None
    if found is None:
        return node.reject("not a length with its unit")
    return float(found[1]) * _INCHES[found[2]]


_PRINTED = schema.FieldType[Any](
    "a length such as 85 mm, 8.5 cm, 3.35 in or 240 pt",
    _parse_length,
    plain_schema=lambda _moves: {"type": "string", "pattern": f"^{_LENGTH.pattern}$"},
)
_PAPER: schema.FieldTable = {
    "width": replace(
        schema.described(_PRINTED, "The width in print, with its unit: mm, cm, in or pt.", example="85 mm"),
        is_needed=True,
    ),
    "height": schema.described(
        _PRINTED, "The height in print, with its unit.", words="three quarters of the width", example="64 mm"
    ),
    "dpi": schema.described(DPI_FIELD, "The pixels per inch.", words="the output's dpi", example="300"),
}


_PIXELS = schema.sequence_field(
    schema.integer_field(minimum=1, maximum=MAX_SIDE),
    f"[width, height]: two whole numbers from 1 to {MAX_SIDE}, or {{width: 85 mm, dpi: 300}}",
    count=2,
)


def _parse_size(node: TreeNode) -> Any:
    if isinstance(node.value, list) and any(isinstance(side, str) and _LENGTH.fullmatch(side) for side in node.value):
        width, *others = map(str, node.value)
        height = "".join(f", height: {side}" for side in others[:1])
        return node.reject("lengths in a list", hint=f"in print: {{width: {width}{height}, dpi: 300}}")
    if isinstance(node.value, str) and (sides := _SIDES.fullmatch(node.value)) is not None:
        return node.reject("not a list", hint=f"[{sides[1]}, {sides[2]}]")
    if not isinstance(node.value, Mapping) or not any(str(key).isalpha() for key in node.value):
        return _PIXELS.parser(node)  # also of a map from frames, as a size cannot move
    given = schema.read_fields(node, _PAPER, required=["width"])
    return INVALID if INVALID in given.values() else PaperSize(**given)


SIZE_FIELD = replace(
    _PIXELS,
    parser=_parse_size,
    plain_schema=lambda moves: schema.any_of(_PIXELS.plain_schema(moves), schema.mapping_schema(_PAPER, moves=moves)),
)
