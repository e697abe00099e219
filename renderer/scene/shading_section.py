"""The scene's `shading`: a light, and how clearly the boundaries of matter are seen."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, Literal

from renderer.scene import schema
from renderer.scene.camera_section import direction_field
from renderer.scene.error_section import ErrorSpec, SplatBudget
from renderer.scene.message_text import format_value
from renderer.scene.schema import INVALID, KeyText, TreeNode

# The largest exponent of a highlight: the larger the exponent, the smaller the highlight.
MAX_SHININESS = 1000.0
# The depth behind a face cut by clipping, in finest spacings, down to which points are lit by the face's normal.
FACE_DEPTH = 2.5

_LIGHT_WORDS = "[x, y, z], not all 0: from the object to the light; or camera"
_LIGHT = schema.word_or({"camera": "camera"}, direction_field(_LIGHT_WORDS), _LIGHT_WORDS)
Fraction = Annotated[float, schema.number_field(minimum=0, maximum=1)]


def _check_ascending(node: TreeNode, points: tuple[Any, ...]) -> Any:
    for index, ((before, _), (gradient, _)) in enumerate(pairwise(points), start=1):
        if INVALID not in (before, gradient) and gradient <= before:
            place = node.child(index).child(0, gradient)
            return place.reject("points out of order", expected=f"greater than {format_value(before)}")
    return points


_GRADIENT_OPACITY = schema.sequence_field(
    schema.pair_field(
        schema.number_field(minimum=0), schema.number_field(minimum=0, maximum=1),
        "[gradient, factor]: a number of at least 0, and a number from 0 to 1",
    ),
    "a list of [gradient, factor], one or more, gradients ascending",
    check=_check_ascending,
)  # fmt: skip


@dataclass(frozen=True)
class ShadingSpec:
    """The keys of `shading`: a light, and factors on extinction.

    light: points from the object to the light, in world axes; "camera" is light from the viewer. The colour of a point
        with the normal n, with l towards the light and h halfway between l and the direction to the viewer, is
        `color (ambient + diffuse max(0, n . l)) + specular max(0, n . h)^shininess`. The specular term counts only
        where n . l > 0.
    two_sided: whether n . l and n . h are taken without their signs. gradient_opacity: pairs of a gradient's magnitude,
        in scalar units per world unit, and of the factor on extinction there; linear in between, constant outside.
    occlusion: how strongly the surroundings of a point dim its ambient light. shadow: how strongly the volume dims the
        diffuse light of a fixed light (`renderer.lighting`).
    occlusion_radius: how far occlusion sees, in world units; None is a tenth of the volume's diagonal.
    silhouette: s in the factor `1 - s (1 - |n . v|)^3` on the lit colour, where v points to the viewer. The factor is 1
        where the gradient is 0.
    cut_faces: points near a face that clipping cuts are lit by the normal of this face. A plane or a box removes a
        convex set, an inverted box removes six. At the distance d from such a set, in finest spacings, its face has the
        weight `w = max(0, 1 - (d / FACE_DEPTH)^2)^3`, and its n points to the nearest point of the set. Faces have the
        share `1 - product of (1 - w)` of the light, each in proportion to its weight; the gradient has the remainder.
    """

    ambient: Annotated[Fraction, KeyText("The light on every point, as a share of its color.")] = 0.3
    diffuse: Annotated[Fraction, KeyText("The light on surfaces that face the light, as a share of their color.")] = 0.7
    light: Annotated[
        schema.Vector | Literal["camera"],
        _LIGHT,
        KeyText("The direction to the light, which turns with the object; `camera`: from the viewer."),
    ] = (1.0, -1.0, 1.0)
    specular: Annotated[Fraction, KeyText("The strength of white highlights.")] = 0.0
    shininess: Annotated[
        float,
        schema.number_field(above=0, maximum=MAX_SHININESS),
        KeyText("The exponent of highlights: a larger one makes them smaller."),
    ] = 32.0
    two_sided: Annotated[bool, KeyText("Whether surfaces are lit from behind as from the front.")] = False
    gradient_opacity: Annotated[
        tuple[tuple[float, float], ...] | None,
        _GRADIENT_OPACITY,
        KeyText(
            "Factors on extinction by the gradient, in values per world unit: even matter fades.",
            "no factors",
            "[[0, 0], [30, 1]]",
        ),
    ] = None
    occlusion: Annotated[Fraction, KeyText("How strongly matter around a point dims the ambient light.")] = 0.0
    shadow: Annotated[
        Fraction, KeyText("How strongly matter before a fixed light dims diffuse light and highlights.")
    ] = 0.0
    occlusion_radius: Annotated[
        float | None,
        schema.LENGTH_FIELD,
        KeyText("How far occlusion sees, in world units.", "a tenth of the volume's diagonal", "25"),
    ] = None
    silhouette: Annotated[Fraction, KeyText("How strongly surfaces seen edge-on are darkened.")] = 0.0
    cut_faces: Annotated[
        bool,
        KeyText("Whether faces that `clip` cuts are lit as surfaces; false: by the gradient."),
    ] = True

    @property
    def lambert(self) -> ShadingSpec | None:
        """Return this shading if it is Lambert shading by a fixed light, which colours of cells can hold; else None."""
        return None if self.is_pointwise else self

    @property
    def is_pointwise(self) -> bool:
        """Return whether each sample must be shaded, as the shading is more than Lambert shading by a fixed light."""
        return bool(pointwise_keys(self))

    @property
    def has_light_grid(self) -> bool:
        """Return whether the shading needs a light grid: the share of the light that reaches each cell of a grid."""
        return self.occlusion > 0 or self.shadow > 0

    @property
    def is_plain(self) -> bool:
        """Return whether the shading is Lambert shading by a fixed light that nothing dims."""
        return not (self.is_pointwise or self.has_light_grid)

    @property
    def keys_for_bricks(self) -> list[str]:
        """Return the keys whose effects only bricks can show."""
        dimming = {"occlusion": self.occlusion, "shadow": self.shadow}
        dims = [key for key, strength in dimming.items() if strength is not INVALID and strength > 0]
        return [*pointwise_keys(self), *dims]


def pointwise_keys(shading: ShadingSpec) -> list[str]:
    """Return the keys that are computed at every sample, as they depend on the view or change extinction."""
    asks = {
        "light": shading.light == "camera",
        "specular": shading.specular is not INVALID and shading.specular > 0,
        "two_sided": shading.two_sided is True,
        "silhouette": shading.silhouette is not INVALID and shading.silhouette > 0,
        "gradient_opacity": isinstance(shading.gradient_opacity, tuple),
    }
    return [key for key, is_asked in asks.items() if is_asked]


def check_shading(node: TreeNode, given: dict[str, Any]) -> None:
    """Refuse keys of the section `shading`, at `node`, that contradict other sections. given: the scene's sections."""
    shading, error = given.get("shading"), given.get("error")
    if not isinstance(shading, ShadingSpec):
        return
    if shading.light == "camera" and shading.shadow is not INVALID and shading.shadow > 0:
        hint = "its shadows would lie behind what is seen; occlusion dims corners in any light"
        node.child("shadow", shading.shadow).reject(f"contradicts {node.path}.light: camera", expected="0", hint=hint)
    footprint = getattr(given.get("splat"), "footprint", "integrated")
    for key in shading.keys_for_bricks if footprint in ("gaussian", "gouraud") else ():
        hint = "splats have one colour for all views: write splat: {footprint: integrated}, or leave splat out"
        node.key(key).reject("needs footprint: integrated", got=f"footprint: {footprint}", expected="", hint=hint)
    for key in pointwise_keys(shading):
        refuse_larger_cells(node.key(key), error, f"all visible voxels are drawn with {node.path}.{key}")


def refuse_larger_cells(key: TreeNode, error: object, hint: str) -> None:
    """Refuse a key for which only voxels can be drawn, if the scene's `error` asks for larger cells."""
    if not isinstance(error, ErrorSpec):
        return
    if isinstance(error.finest_level, int) and error.finest_level > 0:
        key.reject("contradicts error.finest_level", expected="", hint=hint)
    if isinstance(error.goal, SplatBudget):
        key.reject("contradicts error.splats", expected="", hint=f"{hint}; give tolerance, psnr or seconds")
