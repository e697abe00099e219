"""The scene's `splat`: the primitive that is drawn for a cell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, Literal, get_args

from renderer.scene import schema
from renderer.scene.message_text import format_value
from renderer.scene.motion import is_plain
from renderer.scene.schema import INVALID, KeyText, TreeNode

Footprint = Literal["gaussian", "gouraud", "integrated"]
_GOURAUD_KEYS = ("angular", "radial", "profile")
_HINTS_GOURAUD = dict.fromkeys(_GOURAUD_KEYS, "only footprint: gouraud has it")
_HINTS_INTEGRATED = _HINTS_GOURAUD | {
    "sigma": "it draws the field itself, which no footprint blurs",
    "opacity_correction": "it integrates opacity along each ray, which includes the correction",
    "order": "bricks do not overlap, so their only order is exact",
}
_ALIASES = {"box": "integrated", "boxes": "integrated", "bricks": "integrated", "integral": "integrated"}
_WEIGHT = schema.number_field(minimum=0, maximum=1)
# The gouraud footprint has vertices at the radii k / radial. At one of these radii at least, its profile must have this
# weight or more: all weights are divided by the largest weight at a vertex.
MIN_PROFILE_WEIGHT = 1e-6
_PROFILE_WORDS = "a list of [radius, weight], both from 0 to 1, with radius ascending from 0 to 1"
_PROFILE = schema.sequence_field(
    schema.sequence_field(_WEIGHT, "[radius, weight], both from 0 to 1", count=2), _PROFILE_WORDS
)


@dataclass(frozen=True)
class SplatSpec:
    """A primitive to draw, and its parameters.

    footprint: `integrated`, the default of a scene, integrates the field through bricks of cells in their exact order
        and has no other settings. `gaussian` and `gouraud` draw splats; `gaussian` is the default of a `splat` section
        with any key.
    sigma: the standard deviation of the `gaussian` footprint, in cells.
    angular, radial: the `gouraud` footprint is a disc of triangles with `radial` rings of `angular` vertices.
    profile: pairs of radius and weight of the `gouraud` footprint, both in [0, 1], with the radius from 0 to 1.
    """

    footprint: Annotated[
        Footprint,
        schema.choice_field(*get_args(Footprint), aliases=_ALIASES),
        KeyText(
            "`integrated`: the field itself, in bricks. `gaussian`: a splat for each cell. `gouraud`: the"
            " paper's triangles."
        ),
    ] = "gaussian"
    sigma: Annotated[
        float,
        schema.number_field(minimum=0.38, maximum=2),
        KeyText("Of the gaussian footprint: its standard deviation, in cells."),
    ] = 0.425
    angular: Annotated[
        int,
        schema.integer_field(minimum=3, maximum=64),
        KeyText("Of the gouraud footprint: the number of vertices of a ring."),
    ] = 8
    radial: Annotated[
        int,
        schema.integer_field(minimum=1, maximum=32),
        KeyText("Of the gouraud footprint: the number of rings of vertices."),
    ] = 3
    profile: Annotated[
        tuple[tuple[float, float], ...],
        _PROFILE,
        KeyText("Of the gouraud footprint: pairs [radius, weight], with radius from 0 to 1."),
    ] = ((0.0, 1.0), (0.5, 0.6), (1.0, 0.0))
    opacity_correction: Annotated[
        bool, KeyText("Whether opacities are for the ray's length in the cell; false: in a voxel.")
    ] = True
    order: Annotated[
        Literal["depth", "unmixed", "boxes"],
        KeyText(
            "`depth`: by view depth, where neighbours that swap are mixed. `unmixed`: by view depth "
            "alone. `boxes`: by the octree, as in the paper."
        ),
    ] = "depth"

    def written(self) -> dict[str, object]:
        """Return the keys that the footprint has, with their values."""
        unused = unused_splat_keys(self.footprint)
        return {key: value for key, value in vars(self).items() if key not in unused}

    @property
    def primitive_name(self) -> str:
        """Return the name of what is drawn for a cell, in the singular, for messages."""
        return "brick" if self.footprint == "integrated" else "splat"


def _build_splat(node: TreeNode, given: dict[str, Any]) -> SplatSpec:
    """Return the primitive that the section `splat` describes. Keys that its footprint does not have are refused.

    A section with any key asks for splats; an empty section has no effect.
    """
    if not given:
        return SplatSpec("integrated")
    footprint = given.get("footprint", SplatSpec.footprint)
    hints = unused_splat_keys(footprint)
    for key in schema.valid_keys(given, *hints):
        if given[key] == getattr(SplatSpec, key):  # a default is no contradiction: sidecars have all defaults
            continue
        if "footprint" in given:
            node.key(key).reject(f"contradicts footprint: {footprint}", hint=hints[key])
        else:  # the footprint is a default, which the user has not written
            hint = f"this section gives no footprint, so it is {footprint}, which has no {key}"
            node.key(key).reject("needs footprint: gouraud", hint=hint)
    profile = given.get("profile", INVALID)
    is_known = isinstance(profile, tuple) and all(isinstance(pair, tuple) and INVALID not in pair for pair in profile)
    if is_known and is_plain(profile):
        _check_profile(node.child("profile"), profile, given.get("radial", SplatSpec.radial))
    return SplatSpec(**given)


def unused_splat_keys(footprint: str) -> dict[str, str]:
    """Return the keys of the section `splat` that have no effect on a footprint, with a hint for each."""
    return {"gaussian": _HINTS_GOURAUD, "integrated": _HINTS_INTEGRATED}.get(footprint, {})


def _check_profile(node: TreeNode, profile: tuple[tuple[float, float], ...], num_rings: int) -> None:
    radii = [radius for radius, _ in profile]
    if radii[0] != 0 or radii[-1] != 1 or radii != sorted(set(radii)):
        node.reject("radius does not ascend from 0 to 1", got=format_value(radii), expected=_PROFILE_WORDS)
    elif all(weight == 0 for _, weight in profile):
        node.reject("every weight is 0", expected="a weight greater than 0")
    elif isinstance(num_rings, int) and max(_profile_at_rings(profile, num_rings)) < MIN_PROFILE_WEIGHT:
        expected = f"a weight of at least {MIN_PROFILE_WEIGHT:g} at one of the radii k / {num_rings}"
        hint = "a larger splat.radial has more radii"
        what = "no weight at the radii that the footprint has"
        node.reject(what, got=format_value(profile), expected=expected, hint=hint)


def _profile_at_rings(profile: tuple[tuple[float, float], ...], num_rings: int) -> Iterator[float]:
    """Yield the profile, linear between its points, at the radii k / num_rings from 0 to 1."""
    for ring in range(num_rings + 1):
        radius = ring / num_rings
        (first, before), (end, after) = next(pair for pair in pairwise(profile) if radius <= pair[1][0])
        yield before + (after - before) * ((radius - first) / (end - first))


SPLAT_SECTION = schema.section_field(schema.field_table(SplatSpec), _build_splat)
