"""The scene's `clip`: planes and boxes that clip parts of the volume away."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from renderer.scene import schema
from renderer.scene.camera_section import direction_field
from renderer.scene.message_text import format_value
from renderer.scene.schema import KeyText, TreeNode, Vector
from renderer.scene.splat_section import SplatSpec

# The keys of an entry of `clip` that say what clips.
_SHAPES = ("plane", "box")
# The largest number of clip planes and clip boxes together, in the `clip` of a scene or of a layer.
MAX_CLIPS = 16


def _check_box(node: TreeNode, corners: tuple[Any, ...]) -> Any:
    for axis, (low, high) in enumerate(zip(*corners, strict=True)):
        if isinstance(low, float) and isinstance(high, float) and low >= high:
            place = node.child(1).child(axis, high)
            place.reject("an empty box", expected=f"more than {format_value(low)}, which the lowest corner has there")
    return corners


_BOX = schema.sequence_field(
    schema.POINT_FIELD,
    "[[x, y, z], [x, y, z]]: the lowest and the highest corner, in world units",
    count=2,
    check=_check_box,
)


@dataclass(frozen=True)
class PlaneSpec:
    """A clip plane; `normal` points to the side that is clipped away."""

    point: Annotated[Vector, schema.POINT_FIELD, KeyText("A point of the plane.", example="[128, 128, 64]")]
    normal: Annotated[
        Vector,
        direction_field("[x, y, z], not all 0: to the side that is clipped away"),
        KeyText("The direction to the side that is clipped away.", example="[0, 0, 1]"),
    ]


@dataclass(frozen=True)
class ClipSpec:
    """A clip plane or a clip box; exactly one of them is given.

    box: the lowest and the highest corner.
    fixed: `object` for a plane or box in world axes, which turns with the object; `camera` for one that stays before
        the camera, in view axes (x to the right, y up, z toward the viewer) whose origin is the camera's target.
    invert: whether to keep the part that would be clipped away, and to clip the other part.
    """

    plane: Annotated[PlaneSpec | None, KeyText("A plane; the side `normal` points to is clipped away.")] = None
    box: Annotated[
        tuple[Vector, Vector] | None,
        _BOX,
        KeyText(
            "The lowest and the highest corner of a box, whose inside is clipped away.",
            example="[[0, 0, 64], [100, 130, 128]]",
        ),
    ] = None
    fixed: Annotated[
        Literal["object", "camera"],
        KeyText(
            "`object`: in world axes, and it turns with the object. `camera`: in the camera's axes, from the target."
        ),
    ] = "object"
    invert: Annotated[bool, KeyText("Whether the other side is clipped away; of a box, all but its inside.")] = False


def _check_clip(node: TreeNode, given: dict[str, Any]) -> None:
    if not isinstance(node.value, Mapping):
        return
    if "plane" in given and "box" in given:
        node.key("box").reject(f"contradicts {node.path}.plane", expected="one of plane and box")
    elif "plane" not in given and "box" not in given:
        node.reject("nothing to clip with", got="", expected="one of plane and box")


def _check_number(node: TreeNode, clip: tuple[Any, ...]) -> Any:
    return clip if len(clip) <= MAX_CLIPS else node.reject("too many planes and boxes", got=str(len(clip)))


CLIP_SECTION = schema.sequence_field(
    schema.dataclass_field(ClipSpec, _check_clip, schema.Alternatives([_SHAPES], [_SHAPES])),
    f"a list of at most {MAX_CLIPS} mappings with plane or box",
    may_be_empty=True,
    check=_check_number,
)


def check_what_is_clipped(node: TreeNode, given: Mapping[str, Any]) -> None:
    """Check that a scene with `clip` shows neither splats nor lines around cells, which cannot be clipped.

    node: the node of the whole scene. given: the sections of the scene.
    """
    splat = given.get("splat")
    if given.get("clip") and isinstance(splat, SplatSpec) and splat.footprint in ("gaussian", "gouraud"):
        got, expected = f"splat.footprint: {splat.footprint}", "splat.footprint: integrated"
        node.key("clip").reject("splats cannot be clipped", got=got, expected=expected)
    if given.get("clip") and getattr(given.get("annotation"), "octree", False) is True:
        got, expected = "annotation.octree: true", "annotation.octree: false"
        node.key("clip").reject("lines cannot be clipped", got=got, expected=expected)
