"""The scene's `mode`: how a ray makes a colour of the field that it passes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

from renderer.scene import schema
from renderer.scene.message_text import join_words
from renderer.scene.schema import INVALID, KeyText, TreeNode
from renderer.scene.transfer_section import check_opacities

ModeName = Literal["emission_absorption", "maximum", "minimum", "mean", "attenuation"]
MODE_NAMES: tuple[str, ...] = get_args(ModeName)
# Names that other programs use for modes, each with the name of the mode here, for hints.
_ALIASES = {
    "mip": "maximum",
    "max": "maximum",
    "minip": "minimum",
    "min": "minimum",
    "average": "mean",
    "xray": "attenuation",
    "composite": "emission_absorption",
}
_ATTENUATION_KEYS = ("scale", "zero")

# The values that a projection needs in other sections, as (section, key, value), each with the reason.
_OTHER_SECTIONS = {
    ("splat", "footprint", "integrated"): "leave splat out: bricks draw every mode",
    ("error", "measure", "optical"): "the tolerance of a projection is a share of its colour range",
    ("pyramid", "average", "extinction"): "a projection has no opacities to average",
}


@dataclass(frozen=True)
class ModeSpec:
    """A mode: emission and absorption, or a projection, which makes one number of each ray and colours this number.

    type: `emission_absorption` or a projection: the `maximum` or `minimum` of the interpolated scalar s along a ray,
        the `mean` of s over the ray's way through the volume's box, or the `attenuation`, exp(-integral of mu), with
        mu = scale * max(s - zero, 0) per world unit.
    color_by: `value` colours a ray by its number. `depth` colours a maximum by the place where it lies, from 0 nearest
        to 1 farthest, and makes it as bright as its value.
    """

    type: Annotated[
        ModeName,
        schema.choice_field(*MODE_NAMES, aliases=_ALIASES),
        KeyText(
            "`emission_absorption`: matter glows and absorbs. A projection shows the `maximum`, "
            "`minimum`, `mean` or `attenuation` (as of X-rays) of a ray."
        ),
    ] = "emission_absorption"
    scale: Annotated[
        float | None,
        schema.number_field(above=0),
        KeyText(
            "With `attenuation`, which needs it: the attenuation in a world unit by a value 1 above `zero`.",
            example="0.00002",
        ),
    ] = None
    zero: Annotated[
        float | None,
        schema.number_field(),
        KeyText("With `attenuation`, which needs it: the value up to which nothing attenuates.", example="0"),
    ] = None
    color_by: Annotated[
        Literal["value", "depth"],
        KeyText("With `maximum`: whether a ray is colored by its maximum or by the depth of the maximum."),
    ] = "value"

    @property
    def is_projection(self) -> bool:
        """Return whether the mode is a projection, in which each ray shows one number and opacities do not count."""
        return self.type != "emission_absorption"

    @property
    def is_extremum(self) -> bool:
        """Return whether a ray shows the largest or the smallest scalar on its way."""
        return self.type in ("maximum", "minimum")


def _check_mode(node: TreeNode, given: dict[str, Any]) -> None:
    name = given.get("type", ModeSpec.type)
    if name is INVALID:
        return
    if name == "attenuation":
        for key in _ATTENUATION_KEYS:
            if given.get(key) is None:
                hint = (
                    "of Hounsfield values, 0 is water" if key == "zero" else "of Hounsfield values in mm, about 0.00002"
                )
                node.key(key).reject("missing", got="", expected="a number", hint=hint)
    else:
        for key in schema.valid_keys(given, *_ATTENUATION_KEYS):
            node.key(key).reject(f"contradicts type: {name}", hint="only type: attenuation has it")
    if given.get("color_by") == "depth" and name != "maximum":
        node.child("color_by", "depth").reject(f"contradicts type: {name}", hint="only type: maximum has it")


_NAME = schema.choice_field(*MODE_NAMES, aliases=_ALIASES)
_SECTION = schema.dataclass_field(ModeSpec, _check_mode)


def _parse_mode(node: TreeNode) -> Any:
    """Return the mode that a scene gives by its name or by a mapping, or INVALID."""
    if isinstance(node.value, Mapping):
        return _SECTION.parse(node)
    name = _NAME.parse(node)
    if name is INVALID:
        return INVALID
    _check_mode(node, {"type": name})
    return ModeSpec(name)


MODE_SECTION = schema.FieldType(
    f"{join_words(MODE_NAMES)}, or a mapping with type",
    _parse_mode,
    table=_SECTION.table,
    plain_schema=schema.either(_NAME, _SECTION),
)


def check_mode(node: TreeNode, given: Mapping[str, Any]) -> None:
    """Check that no other section contradicts the mode.

    node: the node of the whole scene. given: the sections of the scene, some of which may be invalid.
    """
    mode = given.get("mode", ModeSpec())
    if not isinstance(mode, ModeSpec) or mode.type is INVALID or not mode.is_projection:
        return
    contradicts = f"contradicts mode: {mode.type}"
    for (section, key, wanted), hint in _OTHER_SECTIONS.items():
        value = getattr(given.get(section), key, wanted)
        if value not in (wanted, INVALID):
            node.child(section).child(key, value).reject(contradicts, expected=wanted, hint=hint)
    if mode.is_extremum and getattr(given.get("annotation"), "octree", False) is True:
        hint = "coarse cells would lose its extremes, so there are none"
        node.child("annotation").child("octree", True).reject(contradicts, expected="false", hint=hint)


def check_optics(node: TreeNode, mode: object, transfer: object, shading: object) -> None:
    """Check that the mode can use a transfer function and a shading. node: the node of the scene or layer with both."""
    if not isinstance(mode, ModeSpec) or INVALID in (mode.type, transfer):
        return
    if not mode.is_projection:
        check_opacities(node.child("transfer_function", _raw(node, "transfer_function")), transfer)
        return
    if shading is not None:
        hint = "a projection has no surface to light; leave it out, as --set shading=null does"
        node.key("shading").reject(f"contradicts mode: {mode.type}", hint=hint)
    if _num_color_values(transfer) < 2:
        node.child("transfer_function").reject("no range of colours", expected="points at two values, or more")


def _raw(node: TreeNode, key: str) -> object:
    return node.value.get(key) if isinstance(node.value, Mapping) else None


def _num_color_values(transfer: object) -> int:
    points = getattr(transfer, "mapping", None)
    return len({point.value for point in points}) if isinstance(points, tuple) and INVALID not in points else 2
