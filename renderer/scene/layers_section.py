"""The layers of a scene: its only volume, or several in one picture, each with its own transfer function."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from renderer.scene import schema
from renderer.scene.clip_section import CLIP_SECTION, ClipSpec
from renderer.scene.colors import COLOR_FIELD
from renderer.scene.fog_section import check_fog
from renderer.scene.labels_section import MASK_SECTION, MaskSpec
from renderer.scene.light_section import check_light
from renderer.scene.message_text import did_you_mean
from renderer.scene.mode_section import ModeSpec, check_mode, check_optics
from renderer.scene.motion import moving_result
from renderer.scene.schema import INVALID, Color, TreeNode
from renderer.scene.shading_section import ShadingSpec, check_shading, pointwise_keys, refuse_larger_cells
from renderer.scene.splat_section import SplatSpec
from renderer.scene.transfer_section import (
    LABELS_FIELD,
    TRANSFER_FUNCTION_SECTION,
    VALUE_RANGE_FIELD,
    ControlPoint,
    TransferSpec,
    check_colors_given,
)
from renderer.scene.volume_section import (
    SOURCES,
    TRANSFORM_FIELD,
    VOLUME_TABLE,
    WITHOUT_TRANSFER,
    VolumeSpec,
    build_volume,
)

# The largest factor on a layer's extinction.
MAX_WEIGHT = 1e6
# The thickness over which the upper end of a ramp has an optical depth of 1, as a share of the volume's longest side. A
# ramp is the transfer function of a layer that has only `color` and `range`.
RAMP_THICKNESS = 1 / 8
# Hints for the keys of a single volume, for a scene that gives them although it has a list of volumes.
_CONTRADICTS = {
    "volume": "put it into the list, or name a file by --set volumes.0.file=FILE",
    "transfer_function": "each volume in the list has its own",
}
# The opacity of a ramp at the upper end of its range, over one unit of length: the opacity of an optical depth of 1.
_RAMP_OPACITY = -math.expm1(-1.0)


# The transfer function of a volume with `component: all`, or of voxels that are colours, if the scene gives none: it is
# still to be chosen.
OPEN_LOOK = TransferSpec(None)


@dataclass(frozen=True)
class LayerSpec:
    """One volume of a scene, and how it is shown.

    transform: a 4 x 4 matrix, row by row, that moves the volume in the world, such as the result of a registration.
    weight: a factor on the volume's extinction. clip: planes and boxes that clip only this volume.
    color, range: the colour and the two ends of a ramp, if the transfer function is a ramp. Its extinction rises from 0
        to an optical depth of 1 over an eighth of the volume's longest side.
    mask: the mask inside of which the volume is shown.
    """

    volume: VolumeSpec
    transfer_function: TransferSpec
    shading: ShadingSpec | None = None
    clip: tuple[ClipSpec, ...] = ()
    name: str = ""
    transform: tuple[tuple[float, ...], ...] | None = None
    weight: float = 1.0
    color: Color | None = None
    range: tuple[float, float] | None = None
    mask: MaskSpec | None = None

    @property
    def volumes(self) -> dict[str, VolumeSpec]:
        """Return the layer's volume and, if it has a mask, the mask's volume, by the keys `volume` and `mask`."""
        mask = self.mask and self.mask.volume
        return {"volume": self.volume} | ({"mask": mask} if isinstance(mask, VolumeSpec) else {})

    @property
    def has_open_colors(self) -> bool:
        """Return whether the layer's voxels are colours, and it has no transfer function."""
        return self.volume.has_colors and self.transfer_function.is_open

    @property
    def depends_on_voxels(self) -> bool:
        """Return whether the layer's look is known only when its voxels, or those of its mask, have been read."""
        labels, mask = self.transfer_function.labels, self.mask
        if any(volume.time == "auto" for volume in self.volumes.values()) or self.volume.has_open_level:
            return True
        is_open = self.volume.component == "all" or self.transfer_function.relative or self.has_open_colors
        has_open_labels = labels is not None and not labels.has_colors
        return is_open or has_open_labels or (mask is not None and not mask.labels.has_numbers)

    @property
    def look(self) -> dict[str, TransferSpec]:
        """Return a mapping from the key `labels` or `transfer_function` to its value; empty if none is chosen yet."""
        transfer = self.transfer_function
        return {} if transfer.is_open else {"transfer_function" if transfer.labels is None else "labels": transfer}

    def written(self) -> dict[str, object]:
        """Return the layer as the list of volumes in a scene file has it: its keys with their values."""
        others = ("volume", "transfer_function")
        own = {key: value for key, value in vars(self).items() if key not in others and value not in ("", ())}
        return self.volume.written() | (self.look if self.color is None else {}) | own


@dataclass(frozen=True)
class SharedKeys:
    """The shading and the mask that a scene gives to all volumes of a list that have none of their own."""

    shading: ShadingSpec | None = None
    mask: MaskSpec | None = None

    def added_to(self, layer: LayerSpec) -> LayerSpec:
        """Return a layer with the shared shading or mask in place of one that the layer lacks."""
        return replace(layer, shading=layer.shading or self.shading, mask=layer.mask or self.mask)

    def taken_from(self, layer: LayerSpec) -> LayerSpec:
        """Return a layer without its shading or mask if it is the shared one, as the list of volumes leaves it out."""
        shading = None if layer.shading == self.shading else layer.shading
        return replace(layer, shading=shading, mask=None if layer.mask == self.mask else layer.mask)


_OWN_TABLE: schema.FieldTable = {
    "name": schema.described(
        schema.text_field("a name", "no name", str.strip),
        "The name of the volume, in legends and for masks.",
        words="no name",
        example="CT",
    ),
    "transfer_function": schema.described(TRANSFER_FUNCTION_SECTION, "The colors and opacities of its values."),
    "labels": schema.described(LABELS_FIELD, "In place of `transfer_function`: the labels that are shown."),
    "color": schema.described(
        COLOR_FIELD,
        "In place of `transfer_function`, with `range`: nothing shows at its first value, this color at its second.",
        example='"#ff8000"',
    ),
    "range": schema.described(
        VALUE_RANGE_FIELD, "With `color`: the two values between which it appears.", example="[100, 2000]"
    ),
    "transform": TRANSFORM_FIELD,
    "weight": schema.described(
        schema.number_field(minimum=0, maximum=MAX_WEIGHT),
        "A factor on the extinction of this volume.",
        default=LayerSpec.weight,
    ),
    "shading": schema.described(
        schema.dataclass_field(ShadingSpec), "The light on this volume.", words="the scene's shading"
    ),
    "clip": schema.described(
        CLIP_SECTION, "Planes and boxes that clip this volume, besides the scene's.", words="none"
    ),
    "mask": schema.described(MASK_SECTION, "The mask of this volume.", words="the scene's mask"),
}
# The keys of an entry of the list that say how its values look.
_LOOKS = ("transfer_function", "labels", "color")

# The beginning of a hint where a volume lacks a color or its range of values.
_CHANNEL_HINT = "`component: all` chooses"


def _build_layer(node: TreeNode, given: dict[str, Any]) -> LayerSpec:
    own = {key: given.pop(key) for key in _OWN_TABLE if key in given}
    volume = build_volume(node, given)
    look = "labels" if "labels" in own else "transfer_function"
    take_labels(node, own)
    if "transfer_function" in own:
        for key in schema.valid_keys(own, "color", "range"):
            node.key(key).reject(f"contradicts {node.path}.{look}", expected="one of them")
        own.pop("color", None), own.pop("range", None)
    elif volume.component in WITHOUT_TRANSFER and not own.keys() & {"color", "range"}:
        own["transfer_function"] = OPEN_LOOK
    elif not own.keys() & {"color", "range"}:
        expected = "transfer_function, labels, or color with range"
        node.reject("no colors and opacities", got="", expected=expected, hint=f"{_CHANNEL_HINT} a color and a range")
        own["transfer_function"] = INVALID
    else:
        for key in {"color", "range"} - own.keys():
            of_range = f"`hsplat info` shows the values of a volume; without `color`, {_CHANNEL_HINT} both"
            hint = of_range if key == "range" else None
            _OWN_TABLE[key].reject(node.child(key), "missing", hint=hint)
        color, span = own.get("color", INVALID), own.get("range", INVALID)
        is_right = INVALID not in (color, span) and not (isinstance(span, tuple) and INVALID in span)
        own["transfer_function"] = ramp(color, span) if is_right else INVALID
    return LayerSpec(volume, **own)


def take_labels(node: TreeNode, given: dict[str, Any]) -> None:
    """Move the value of the key `labels` of a scene or a layer to the key `transfer_function`.

    node: the node of the scene or the layer. given: the values by their keys.
    """
    if "labels" in given:
        labels = given.pop("labels")
        if given.setdefault("transfer_function", labels) is not labels:
            node.key("labels").reject("contradicts transfer_function", expected="one of them")


def ramp(color: Color, span: tuple[float, float]) -> TransferSpec:
    """Return a transfer function of one color. Its extinction rises from 0 at one end of `span` to the other.

    At the upper end, its optical depth over one unit of length is 1.
    """
    return TransferSpec(moving_result(_ramp_points, color, span))


def _ramp_points(color: Color, span: tuple[float, float]) -> tuple[ControlPoint, ControlPoint]:
    low, high = span
    return ControlPoint(low, color, 0.0), ControlPoint(high, color, _RAMP_OPACITY)


def _check_names(node: TreeNode, layers: tuple[LayerSpec, ...]) -> Any:
    """Refuse two layers with one name, and replace the names of layers in masks by the volumes of these layers."""
    names: dict[str, int] = {}
    for number, layer in enumerate(layers):
        if layer.name and isinstance(layer.name, str):
            if layer.name in names:
                place = node.child(number).child("name", layer.name)
                place.reject("two volumes of one name", expected="a name of its own for each")
            names[layer.name] = number
    return tuple(
        replace(
            layer,
            mask=_named_mask(node.child(number).child("mask"), layer.mask, {k: layers[n] for k, n in names.items()}),
        )
        for number, layer in enumerate(layers)
    )


def name_mask(node: TreeNode, given: dict[str, Any]) -> None:
    """Replace the name of a layer in the mask of the whole scene by the volume of that layer."""
    named = {each.name: each for each in _valid_layers(given.get("volumes")) if isinstance(each.name, str)}
    if "mask" in given:
        given["mask"] = _named_mask(node.child("mask"), given["mask"], named)


def _named_mask(node: TreeNode, mask: Any, layers: Mapping[str, LayerSpec]) -> Any:
    if not isinstance(mask, MaskSpec) or not isinstance(mask.volume, str):
        return mask
    if mask.volume not in layers:
        expected, hint = "that of a volume in the list", did_you_mean(mask.volume, layers)
        return node.child("name", mask.volume).reject("no volume of this name", expected=expected, hint=hint)
    named, labels = layers[mask.volume], mask.labels
    look = named.transfer_function
    is_known = labels.show is INVALID or labels.has_numbers
    if labels.names is None and not is_known and isinstance(look, TransferSpec) and look.labels is not None:
        labels = replace(labels, names=look.labels.names)
    return replace(mask, volume=named.volume, transform=named.transform, labels=labels)


_LIST = schema.sequence_field(
    schema.section_field(
        {**VOLUME_TABLE, **_OWN_TABLE},
        _build_layer,
        alternatives=schema.Alternatives([*SOURCES.one_of, _LOOKS], SOURCES.needed),
    ),
    "a list of volumes, each with a transfer_function",
)


def _parse_volumes(node: TreeNode) -> Any:
    layers = _LIST.parser(node)
    return _check_names(node, layers) if isinstance(layers, tuple) and INVALID not in layers else layers


VOLUMES_SECTION = replace(_LIST, parser=_parse_volumes)


def check_layers(node: TreeNode, given: Mapping[str, Any]) -> None:
    """Check that a scene has one volume or several, and that the look of each fits the mode and the other sections.

    node: the node of the whole scene. given: the sections of the scene, some of which may be invalid.
    """
    for key in schema.valid_keys(given, "volume", "transfer_function") if "volumes" in given else ():
        node.key(key).reject("contradicts volumes", expected="one of volume and volumes", hint=_CONTRADICTS[key])
    has_several = "volumes" in given or getattr(given.get("volume"), "component", None) == "all"
    if not has_several and given.get("blend", "mix") == "add":
        node.child("blend", "add").reject(
            "needs volumes", expected="mix", hint="give the volume in a list: volumes: [...]"
        )
    splat = given.get("splat")
    if has_several and isinstance(splat, SplatSpec) and splat.footprint in ("gaussian", "gouraud"):
        got, expected = f"splat.footprint: {splat.footprint}", "splat.footprint: integrated"
        key = "volumes" if "volumes" in given else "volume"
        node.key(key).reject("splats show one volume", got=got, expected=expected)
    check_mode(node, given)
    check_light(node, given, _placed_layers(node, given))
    check_fog(node, given)
    for place, layer in _placed_layers(node, given):
        check_shading(place.child("shading"), {**given, "shading": layer.shading})
        check_optics(place, given.get("mode", ModeSpec()), layer.transfer_function, layer.shading)
        lit = (place, layer.shading) if layer.shading is not None else (node, given.get("shading"))
        transfer = layer.transfer_function
        if isinstance(transfer, TransferSpec) and transfer.labels is not None:
            _check_labels(place, given, layer.volume, lit)
        elif getattr(layer.volume, "has_colors", False):
            _check_colors(node, given, f"contradicts component: {layer.volume.component}", lit)
        else:
            section = place.value.get("transfer_function") if isinstance(place.value, Mapping) else None
            check_colors_given(place.child("transfer_function", section))


def _check_labels(node: TreeNode, given: Mapping[str, Any], volume: Any, lit: tuple[TreeNode, Any]) -> None:
    """Refuse keys that need scalars between labels, in the scene or the layer at `node`, which shows labels.

    lit: the node of the scene or the layer that has the shading, and the shading.
    """
    key, (place, shading) = node.key("labels"), lit
    mode, splat = given.get("mode", ModeSpec()), given.get("splat")
    if isinstance(mode, ModeSpec) and mode.type is not INVALID and mode.is_projection:
        hint = "labels are names, of which none is larger than another; a transfer_function shows their numbers"
        key.reject(f"contradicts mode: {mode.type}", expected="mode: emission_absorption", hint=hint)
    if isinstance(splat, SplatSpec) and splat.footprint in ("gaussian", "gouraud"):
        key.reject("needs footprint: integrated", got=f"footprint: {splat.footprint}", expected="")
    if getattr(volume, "has_colors", False):
        hint = "labels are whole numbers: leave it out, or name one component by its number"
        key.reject(f"contradicts component: {volume.component}", expected="", hint=hint)
    if getattr(volume, "interpolate", False):
        key.reject("contradicts interpolate", expected="", hint="there is nothing between two labels")
    if isinstance(shading, ShadingSpec):
        if isinstance(shading.gradient_opacity, tuple):
            gradients = place.child("shading").key("gradient_opacity")
            gradients.reject("contradicts labels", hint="labels have no gradients")
        refuse_larger_cells(place.key("shading"), given.get("error"), "lit labels are drawn as voxels")


def _check_colors(node: TreeNode, given: Mapping[str, Any], contradicts: str, lit: tuple[TreeNode, Any]) -> None:
    """Refuse keys that have no effect on voxels that are colours.

    lit: the node of the scene or the layer that has the shading, and the shading.
    """
    place, shading = lit
    for key in pointwise_keys(shading) if isinstance(shading, ShadingSpec) else ():
        hint = "colours are lit before they are interpolated: ambient, diffuse, occlusion and shadow remain"
        place.child("shading").key(key).reject(contradicts, expected="", hint=hint)
    if getattr(given.get("mode"), "is_projection", False):
        node.key("mode").reject(contradicts, expected="emission_absorption", hint="`component: k` projects one of them")
    if getattr(given.get("error"), "of", None) == "scalar":
        node.child("error").key("of").reject(contradicts, expected="classified")


def _placed_layers(node: TreeNode, given: Mapping[str, Any]) -> list[tuple[TreeNode, LayerSpec]]:
    """Return the layers as pairs (node, layer); a single volume has the scene's node.

    Values of a layer may be INVALID, and layers that are INVALID themselves are left out.
    """
    if "volumes" not in given:
        return [(node, _only_layer(given))]
    layers, place = given["volumes"], node.child("volumes")
    if not isinstance(layers, tuple) or not isinstance(node.value, Mapping):
        return []
    written = zip(layers, node.value["volumes"], strict=True)
    placed = ((place.child(number, entry), layer) for number, (layer, entry) in enumerate(written))
    return [(at, layer) for at, layer in placed if isinstance(layer, LayerSpec)]


def _only_layer(given: Mapping[str, Any]) -> LayerSpec:
    """Return the only layer of a scene without a list of volumes. given: the sections of the scene."""
    volume, transfer = given.get("volume", INVALID), given.get("transfer_function", INVALID)
    return LayerSpec(volume, transfer, given.get("shading"), mask=given.get("mask"))


def _valid_layers(volumes: object) -> Sequence[LayerSpec]:
    return [each for each in volumes if isinstance(each, LayerSpec)] if isinstance(volumes, tuple) else ()


def take_layers(given: dict[str, Any]) -> tuple[tuple[LayerSpec, ...], SharedKeys | None]:
    """Remove the keys of volumes from the sections of a scene, and return the layers that they describe.

    A layer of a list that has no shading or no mask gets the scene's. Also returns the scene's shading and mask; None
    for a scene without a list of volumes.
    """
    keys = ("volume", "transfer_function", "shading", "mask", "volumes")
    own = {key: given.pop(key) for key in keys if key in given}
    if "volumes" not in own:
        return (_only_layer(own),), None
    shared = SharedKeys(own.get("shading"), own.get("mask"))
    return tuple(map(shared.added_to, _valid_layers(own["volumes"]))), shared
