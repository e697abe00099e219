"""The scene's `light`: an environment and a key light around matter that scatters their light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

from renderer.scene import schema
from renderer.scene.camera_section import direction_field
from renderer.scene.colors import COLOR_FIELD
from renderer.scene.message_text import join_words
from renderer.scene.mode_section import ModeSpec
from renderer.scene.schema import INVALID, Color, KeyText, TreeNode, Vector
from renderer.scene.shading_section import MAX_SHININESS, ShadingSpec, refuse_larger_cells
from renderer.scene.splat_section import SplatSpec

# The largest strength of a key light.
MAX_KEY_STRENGTH = 1e6
# The smallest angular radius of a key light, in degrees. Edges of shadows are no sharper than the cells of the grid.
MIN_KEY_RADIUS = 0.1
# The largest exposure, in stops, in either direction.
MAX_STOPS = 20.0
# The bounds of the largest number of cells along an axis of the grid of light. With 256, a grid of equal sides takes
# 5.4 GB while its light is found.
MIN_CELLS = 16
MAX_CELLS = 256

_COLOR = schema.still(COLOR_FIELD)
_DIRECTION_WORDS = "[x, y, z], not all 0: from the object to the light; or camera"
_DIRECTION = schema.word_or({"camera": "camera"}, direction_field(_DIRECTION_WORDS), _DIRECTION_WORDS)
_UP = schema.still(direction_field("[x, y, z], not all 0: to the top of the environment"))
_STRENGTH = schema.still(schema.number_field(minimum=0, maximum=MAX_KEY_STRENGTH))
_RADIUS = schema.still(schema.number_field(minimum=MIN_KEY_RADIUS, maximum=90))


@dataclass(frozen=True)
class EnvironmentSpec:
    """The colours of an environment, which light comes from in all directions.

    top, horizon, bottom: the colours at `up`, across it, and opposite to it; a quadratic in the cosine in between.
    """

    top: Annotated[Color, _COLOR, KeyText("The color of the environment at `up`.")] = (1.0, 1.0, 1.0)
    horizon: Annotated[Color, _COLOR, KeyText("The color of the environment across `up`.")] = (1.0, 1.0, 1.0)
    bottom: Annotated[Color, _COLOR, KeyText("The color of the environment opposite to `up`.")] = (1.0, 1.0, 1.0)


# The environments that have a name.
ENVIRONMENTS = {
    "studio": EnvironmentSpec((0.94, 0.95, 1.0), (0.72, 0.72, 0.74), (0.45, 0.43, 0.42)),
    "outdoor": EnvironmentSpec((0.72, 0.84, 1.0), (0.88, 0.91, 0.95), (0.42, 0.37, 0.31)),
    "overcast": EnvironmentSpec((1.0, 1.0, 1.0), (0.76, 0.76, 0.76), (0.40, 0.40, 0.40)),
}
_NAME = schema.choice_field(*ENVIRONMENTS)
_COLORS = schema.dataclass_field(EnvironmentSpec)


def _parse_environment(node: TreeNode) -> Any:
    """Return the environment that a scene gives by its name or by a mapping, or INVALID."""
    if isinstance(node.value, Mapping):
        return _COLORS.parse(node)
    name = _NAME.parse(node)
    return INVALID if name is INVALID else ENVIRONMENTS[name]


_ENVIRONMENT = schema.FieldType(
    f"{join_words(ENVIRONMENTS)}, or a mapping with top, horizon and bottom",
    _parse_environment,
    table=_COLORS.table,
    plain_schema=schema.either(_NAME, _COLORS),
    words=ENVIRONMENTS,
)


@dataclass(frozen=True)
class KeySpec:
    """A key light: a disc of even radiance, far away.

    direction: points from the object to the light, in world axes; "camera" is light from the viewer. radius: the
        angular radius, in degrees.
    strength: 1 lights a surface that faces the light as much as an even white sky does.
    """

    direction: Annotated[
        Vector | Literal["camera"],
        _DIRECTION,
        KeyText("The direction from the object to the key light; `camera`: light from the viewer."),
    ] = (1.0, -1.0, 1.0)
    color: Annotated[Color, _COLOR, KeyText("The color of the key light.")] = (1.0, 1.0, 1.0)
    strength: Annotated[
        float,
        _STRENGTH,
        KeyText("The strength of the key light: 1 lights a surface as much as an even white sky does."),
    ] = 1.0
    radius: Annotated[
        float, _RADIUS, KeyText("The angular radius of the key light, in degrees: a larger one makes softer shadows.")
    ] = 14.0


_SHARE = schema.still(schema.number_field(minimum=0, maximum=1))
_SHININESS = schema.still(schema.number_field(above=0, maximum=MAX_SHININESS))
_STOPS = schema.still(schema.number_field(minimum=-MAX_STOPS, maximum=MAX_STOPS))
_EXPOSURE = schema.word_or({"auto": None}, _STOPS, f"auto, or {_STOPS.expected}")
_CELLS = schema.integer_field(minimum=MIN_CELLS, maximum=MAX_CELLS)


class SurfaceSpec(NamedTuple):
    """The keys of `light` that say how surfaces reflect light."""

    # The largest share of a point that is a surface, above 0, at most 1.
    share: float
    # The coefficient and the exponent of highlights, as in ShadingSpec.
    specular: float
    shininess: float

    @property
    def shading(self) -> ShadingSpec:
        """Return a shading by which surfaces are found, as it has gradients and cut faces; its light is not used."""
        return ShadingSpec(light="camera")


@dataclass(frozen=True)
class LightSpec:
    """The keys of `light`. Colours of the transfer function are then reflectances of opaque matter in even white light.

    up: the direction to the top of the environment, in world axes. key: None for no key light.
    scattering: the factor on albedos of matter that light meets on its way. Points of rays have their whole albedo.
    surface: u in the share w = u g of a point that is a surface. With the albedo a and the mean radiance phi, the point
        shows (1 - w) a phi + w (c E(n) / pi + highlights). E(n) is the irradiance of a plane whose normal is n, and c a
        reflectance with which opaque matter shows the same colour as without surfaces in even light
        (`surface_reflectance`). g is the change of the opacity of four finest spacings between the points one spacing
        before and behind along the gradient, and n points to less opacity. Of labels, g is 3.2 times the gradient of
        smoothed opacities over the finest spacing, at most 1. Faces that clip cuts have their own normals, and g is
        the opacity of four finest spacings there; they share points with the gradient as with `ShadingSpec.cut_faces`.
    specular, shininess: highlights of the key light on surfaces, `specular max(0, n . h)^shininess` times its
        irradiance over pi where n . l > 0, with the directions of ShadingSpec to the middle of the key light.
    exposure: the power of 2 by which all light is multiplied. None chooses it on the first frame, so that nine tenths
        of the visible matter are at most as bright as in even white light.
    cells: the largest number of cells along an axis of the grid that the light is found on, with an empty cell at each
        border. Cells are never narrower than a voxel.
    """

    environment: Annotated[
        EnvironmentSpec,
        _ENVIRONMENT,
        KeyText("The surroundings: `studio`, `outdoor`, `overcast`, or colors."),
    ] = ENVIRONMENTS["studio"]
    up: Annotated[Vector, _UP, KeyText("The direction to the top of the environment.")] = (0.0, 0.0, 1.0)
    key: Annotated[
        KeySpec | None,
        KeyText("A lamp far away, which turns with the object unless its direction is `camera`.", "no lamp"),
    ] = None
    scattering: Annotated[
        float, _SHARE, KeyText("How strongly matter scatters light on its way; 0: matter only shadows.")
    ] = 1.0
    surface: Annotated[float, _SHARE, KeyText("How much of a boundary reflects light as a surface.")] = 0.0
    specular: Annotated[float, _SHARE, KeyText("The strength of highlights of the key light on surfaces.")] = 0.0
    shininess: Annotated[float, _SHININESS, KeyText("The exponent of highlights: a larger one makes them smaller.")] = (
        32.0
    )
    exposure: Annotated[
        float | None,
        _EXPOSURE,
        KeyText("The brightness of the film, in stops. `auto`: matter is about as bright as in even white light."),
    ] = None
    cells: Annotated[int, _CELLS, KeyText("The most cells along an axis of the grid of light.")] = 128

    @property
    def surfaces(self) -> SurfaceSpec | None:
        """Return how surfaces reflect light; None if no point is a surface."""
        return SurfaceSpec(self.surface, self.specular, self.shininess) if self.surface > 0 else None

    @property
    def follows_camera(self) -> bool:
        """Return whether the key light comes from the viewer."""
        return self.key is not None and self.key.direction == "camera"

    def written(self) -> dict[str, object]:
        """Return the keys of the section with their values."""
        return vars(self) | {"exposure": "auto" if self.exposure is None else self.exposure}


def chosen_exposure_text(stops: float) -> str:
    """Return `-0.359375 stops (auto)` for an exposure that was chosen, with the option that keeps it."""
    number = f"{stops:.10g}"  # all digits: the option draws the same bytes
    keep = f"; --set light.exposure={number} keeps it in another light" if abs(stops) <= MAX_STOPS else ""
    return f"{number} stop{'s' * (number != '1')} (auto){keep}"


def check_light(node: TreeNode, given: Mapping[str, Any], layers: Sequence[tuple[TreeNode, Any]]) -> None:
    """Refuse sections of a scene that contradict its `light`.

    node: the node of the whole scene. given: the sections of the scene. layers: the nodes of layers, and the layers.
    """
    light = given.get("light")
    if not isinstance(light, LightSpec):
        return
    if light.surface is not INVALID and light.surface > 0:
        hint = "all visible voxels are drawn with light.surface"
        refuse_larger_cells(node.child("light").key("surface"), given.get("error"), hint)
    key, places = node.key("light"), [node, *(place for place, _ in layers if place.path != node.path)]
    lit = [given.get("shading"), *(layer.shading for place, layer in layers if place.path != node.path)]
    for place, shading in zip(places, lit, strict=True):
        if shading is not None:
            hint = "light takes the place of shading: leave one out, as --set shading=null does"
            place.key("shading").reject("contradicts light", expected="", hint=hint)
    mode, splat = given.get("mode"), given.get("splat")
    if isinstance(mode, ModeSpec) and mode.type is not INVALID and mode.is_projection:
        hint = "a projection shows numbers of rays, which no light reaches"
        key.reject(f"contradicts mode: {mode.type}", expected="mode: emission_absorption", hint=hint)
    if given.get("blend") == "add":
        hint = "light that only adds up is not absorbed, so that nothing scatters it"
        key.reject("contradicts blend: add", expected="blend: mix", hint=hint)
    if isinstance(splat, SplatSpec) and splat.footprint in ("gaussian", "gouraud"):
        hint = "splats have one colour for all views: write splat: {footprint: integrated}, or leave splat out"
        key.reject("needs footprint: integrated", got=f"footprint: {splat.footprint}", expected="", hint=hint)
    if any(getattr(layer.volume, "has_colors", False) for _, layer in layers):
        key.reject("voxels that are colors have no albedos", expected="voxels with a transfer function")
