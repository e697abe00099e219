"""The scene's `fog`, which gives matter the colour of fog by its depth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from renderer.scene import schema
from renderer.scene.colors import COLOR_FIELD
from renderer.scene.mode_section import ModeSpec
from renderer.scene.schema import INVALID, Color, KeyText, TreeNode
from renderer.scene.splat_section import SplatSpec


def _check_range(node: TreeNode, ends: tuple[float, ...]) -> Any:
    low, high = ends
    return ends if low < high else node.reject("not ascending", expected="the first depth below the second")


_RANGE = schema.sequence_field(
    schema.COORDINATE_FIELD, "[first, last], depths in world units, 0 at the target", count=2, check=_check_range
)


@dataclass(frozen=True)
class FogSpec:
    """The keys of `fog`: matter shows a share of its colour, and otherwise the fog's. Opacities do not change.

    range: the depth up to which there is no fog, and the depth from which on there is nothing else; the share is linear
        in between. Depths are measured along the viewing direction from the camera's target, away from the eye.
    """

    range: Annotated[
        tuple[float, float],
        _RANGE,
        KeyText(
            "The depths where fog begins and where it is all that is seen, in world units behind the camera's target.",
            example="[-20, 60]",
        ),
    ]
    color: Annotated[Color, COLOR_FIELD, KeyText("The color of the fog.")] = (0.0, 0.0, 0.0)


def check_fog(node: TreeNode, given: Mapping[str, Any]) -> None:
    """Refuse sections of a scene that contradict its `fog`. node: the node of the whole scene."""
    if not isinstance(given.get("fog"), FogSpec):
        return
    key, mode, splat = node.key("fog"), given.get("mode"), given.get("splat")
    if isinstance(mode, ModeSpec) and mode.type is not INVALID and mode.is_projection:
        hint = "mode: {type: maximum, color_by: depth} has colours by depth"
        key.reject(f"contradicts mode: {mode.type}", expected="mode: emission_absorption", hint=hint)
    if given.get("blend") == "add":
        key.reject("contradicts blend: add", expected="blend: mix", hint="light that adds up has no depth")
    if isinstance(splat, SplatSpec) and splat.footprint in ("gaussian", "gouraud"):
        key.reject("needs footprint: integrated", got=f"footprint: {splat.footprint}", expected="")
