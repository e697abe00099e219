"""Convert plain data to a checked Scene, and back.

The tree comes from a YAML or JSON reader: nested mappings, lists and scalars. Each large section of a scene has its own
    module (`parse_volume`, `parse_transfer`, `parse_camera`, `parse_error_schedule`, `parse_output`). Defaults are
    those of the dataclasses in `renderer.scene.spec`. Nothing here imports numpy or OpenGL.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields as dataclass_fields, is_dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from renderer.errors import Problem, SceneError
from renderer.scene import schema, spec
from renderer.scene.limits import proportion_problems
from renderer.scene.message_text import format_value
from renderer.scene.parse_camera import CAMERA_SECTION, direction_field
from renderer.scene.parse_error_schedule import ERROR_SECTION, check_scheduled_frames
from renderer.scene.parse_output import OUTPUT_SECTION, check_frame_field
from renderer.scene.parse_transfer import TRANSFER_FUNCTION_SECTION
from renderer.scene.parse_volume import volume_field_type
from renderer.scene.schema import INVALID, TreeNode

VERSION = 1


def parse_scene(tree: object, *, base: Path, is_single_frame: bool = False) -> spec.Scene:
    """Return the scene that `tree` describes.

    base: the folder that volume files are relative to; they are kept as `base / file`, the output file as given.
    is_single_frame: one frame is drawn, so the output may be a PNG without a number in its name.
    Raises SceneError with every problem.
    """
    problems: list[Problem] = []
    scene = _scene_field_type(base, is_single_frame).read(TreeNode(tree, "", problems))
    if problems:
        raise SceneError(problems)
    return scene


# Keys that users put at the top level, and where they belong.
_MISPLACED_KEY_HINTS = {
    key: f"did you mean {place}.{key}?"
    for place, keys in {
        "error": ("tolerance", "psnr", "rmse", "seconds"),
        "camera.path": ("frames", "elevation"),
        "output": ("size", "background", "frames_per_second"),
        "splat": ("footprint",),
    }.items()
    for key in keys
}


def _scene_field_type(base: Path, is_single_frame: bool) -> schema.FieldType[spec.Scene]:
    table: schema.FieldTable = {
        "version": _VERSION,
        "volume": volume_field_type(base),
        "transfer_function": TRANSFER_FUNCTION_SECTION,
        "shading": _SHADING,
        "camera": CAMERA_SECTION,
        "error": ERROR_SECTION,
        "pyramid": _PYRAMID,
        "splat": _SPLAT,
        "overlay": schema.choice_field("none", "octree"),
        "output": OUTPUT_SECTION,
    }
    required = ("volume", "transfer_function", "camera", "output")
    return schema.section_field(
        table,
        lambda node, given: _build_scene(node, given, is_single_frame),
        required=required,
        misplaced_hints=_MISPLACED_KEY_HINTS,
    )


def _parse_version(node: TreeNode) -> int:
    if schema.parse_whole_number(node.value) == VERSION:
        return VERSION
    return _VERSION.reject(node, "unknown version of the scene format")


_VERSION = schema.FieldType(str(VERSION), _parse_version)


def _build_scene(node: TreeNode, given: dict[str, Any], is_single_frame: bool) -> spec.Scene:
    check_scheduled_frames(node.child("error"), given)
    if not is_single_frame:
        check_frame_field(node.child("output"), given)
    scene = spec.Scene(**given)
    if not node.problems:  # values are compared only if each is correct
        node.problems.extend(proportion_problems(scene))
    return scene


_SHADING = schema.section_field(
    {
        "ambient": schema.number_field(minimum=0, maximum=1),
        "diffuse": schema.number_field(minimum=0, maximum=1),
        "light": direction_field("[x, y, z], not all 0: from the object to the light"),
    },
    lambda node, given: spec.ShadingSpec(**given),
)

_PYRAMID = schema.section_field(
    {"average": schema.choice_field("extinction", "opacity"), "precision": schema.choice_field("half", "single")},
    lambda node, given: spec.PyramidSpec(**given),
)


# splat

_GOURAUD_KEYS = ("angular", "radial", "profile")
_HINTS_GOURAUD = dict.fromkeys(_GOURAUD_KEYS, "only footprint: gouraud has it")
_HINTS_INTEGRATED = _HINTS_GOURAUD | {
    "sigma": "it draws the field itself, which no footprint blurs",
    "opacity_correction": "it integrates opacity along each ray, which includes the correction",
    "order": "bricks do not overlap, so their only order is exact",
}
_ALIASES = {"box": "integrated", "boxes": "integrated", "bricks": "integrated", "integral": "integrated"}
_WEIGHT = schema.number_field(minimum=0, maximum=1)
# Weights are divided by the largest one.
MIN_PROFILE_WEIGHT = 1e-6
_PROFILE_WORDS = "a list of [radius, weight], both from 0 to 1, with radius ascending from 0 to 1"
_PROFILE = schema.sequence_field(
    schema.sequence_field(_WEIGHT, "[radius, weight], both from 0 to 1", count=2), _PROFILE_WORDS
)


def _build_splat(node: TreeNode, given: dict[str, Any]) -> spec.SplatSpec:
    """Build the section. A section with any key asks for splats, so an empty one has no effect."""
    if not given:
        return spec.Scene.splat
    footprint = given.get("footprint", spec.SplatSpec.footprint)
    hints = _unused_splat_keys(footprint)
    for key in schema.valid_keys(given, *hints):
        if "footprint" in given:
            node.key(key).add_problem(f"contradicts footprint: {footprint}", hint=hints[key])
        else:  # nobody has written what it contradicts
            hint = f"this section gives no footprint, so it is {footprint}, which has no {key}"
            node.key(key).add_problem("needs footprint: gouraud", hint=hint)
    profile = given.get("profile", INVALID)
    if isinstance(profile, tuple) and all(isinstance(pair, tuple) and INVALID not in pair for pair in profile):
        _check_profile(node.child("profile"), profile, given.get("radial", spec.SplatSpec.radial))
    return spec.SplatSpec(**given)


def _unused_splat_keys(footprint: str) -> dict[str, str]:
    """Return the keys that mean nothing for a footprint, with a hint for each."""
    return {"gaussian": _HINTS_GOURAUD, "integrated": _HINTS_INTEGRATED}.get(footprint, {})


def _check_profile(node: TreeNode, profile: tuple[tuple[float, float], ...], num_rings: int) -> None:
    radii = [radius for radius, _ in profile]
    if radii[0] != 0 or radii[-1] != 1 or radii != sorted(set(radii)):
        node.add_problem("radius does not ascend from 0 to 1", got=format_value(radii), expected=_PROFILE_WORDS)
    elif all(weight == 0 for _, weight in profile):
        node.add_problem("every weight is 0", expected="a weight greater than 0")
    elif isinstance(num_rings, int) and max(_profile_at_rings(profile, num_rings)) < MIN_PROFILE_WEIGHT:
        node.add_problem(
            "no weight at the radii that the footprint has",
            got=format_value(profile),
            expected=f"a weight of at least {MIN_PROFILE_WEIGHT:g} at one of the radii k / {num_rings}",
            hint="a larger splat.radial has more radii",
        )


def _profile_at_rings(profile: tuple[tuple[float, float], ...], num_rings: int) -> Iterator[float]:
    """Yield the profile, linear between its points, at the radii k / num_rings from 0 to 1."""
    for ring in range(num_rings + 1):
        radius = ring / num_rings
        (first, before), (end, after) = next(pair for pair in pairwise(profile) if radius <= pair[1][0])
        yield before + (after - before) * ((radius - first) / (end - first))


_SPLAT = schema.section_field(
    {
        "footprint": schema.choice_field("gaussian", "gouraud", "integrated", aliases=_ALIASES),
        "sigma": schema.number_field(minimum=0.38, maximum=2),
        "angular": schema.integer_field(minimum=3, maximum=64),
        "radial": schema.integer_field(minimum=1, maximum=32),
        "profile": _PROFILE,
        "opacity_correction": schema.BOOLEAN_FIELD,
        "order": schema.choice_field("depth", "unmixed", "boxes"),
    },
    _build_splat,
)


# Back to plain data

_SOURCE_KEYS: dict[type, str] = {spec.RawSource: "raw", spec.ProceduralSource: "procedural", spec.ArraySource: "array"}
_PATH_TYPES = {spec.TurntablePath: "turntable", spec.RockerPath: "rocker", spec.KeyframePath: "keyframes"}


def scene_to_dict(scene: spec.Scene) -> dict[str, Any]:
    """Return the scene as plain data for JSON or YAML, with every default written out.

    `parse_scene` makes the same scene from it: with any `base` if the volume's file is an absolute path, else in the
        same folder.
    """
    tree: dict[str, Any] = _plain(scene)
    return {key: tree[key] for key in ("version", *tree) if key in tree}


def spec_to_dict(value: Any) -> dict[str, Any]:
    """Return a part of a scene, such as a CameraSpec or a TransferSpec, as plain data; as `scene_to_dict`."""
    return _plain_dataclass(value)


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, spec.ArraySource):
        return {"shape": list(value.shape), "dtype": str(value.values.dtype), "spacing": list(value.spacing)}
    return _plain_dataclass(value) if is_dataclass(value) else value


def _plain_dataclass(value: Any) -> dict[str, Any]:
    plain = _plain_fields(value)
    if isinstance(value, spec.VolumeSpec):
        source: dict[str, Any] = plain.pop("source")
        return (
            source if isinstance(value.source, spec.FileSource) else {_SOURCE_KEYS[type(value.source)]: source}
        ) | plain
    if isinstance(value, spec.TransferSpec):
        mapping = plain.pop("mapping")
        has_colormap = isinstance(value.mapping, spec.ColormapSpec)
        return ({"colormap": mapping.pop("name")} | mapping if has_colormap else {"points": mapping}) | plain
    if isinstance(value, spec.ErrorSpec):
        return schedule_to_dict(value) | {key: plain[key] for key in plain if key not in ("tolerance", "goal")}
    if isinstance(value, spec.SplatSpec):
        return {key: item for key, item in plain.items() if key not in _unused_splat_keys(value.footprint)}
    if isinstance(value, spec.OutputSpec):
        return plain | {"background": plain.get("background", "transparent")}
    return {"type": _PATH_TYPES[type(value)]} | plain if type(value) in _PATH_TYPES else plain


def _plain_fields(value: Any) -> dict[str, Any]:
    """Return the fields without those that are None, which stands for a key that is not given."""
    pairs = ((field.name, getattr(value, field.name)) for field in dataclass_fields(value))
    return {name: _plain(item) for name, item in pairs if item is not None}


def splat_section_without_defaults(plain: Mapping[str, Any]) -> dict[str, Any]:
    """Return a `splat` section of `scene_to_dict` without defaults, which another footprint may not have."""
    defaults = _plain_fields(spec.SplatSpec())
    return {key: value for key, value in plain.items() if key == "footprint" or repr(defaults.get(key)) != repr(value)}


def schedule_to_dict(error: spec.ErrorSpec) -> dict[str, Any]:
    """Return the key of the `error` section that sets the accuracy, with its value."""
    goal = error.goal
    if isinstance(goal, spec.AccuracyGoal):
        return {goal.metric: goal.value}
    name = {spec.SplatBudget: "splats", spec.TimeBudget: "seconds"}.get(type(goal), "tolerance")
    (frame, first), *more = by_frame = error.tolerance if goal is None else goal.by_frame
    return {name: first if frame == 0 and not more else dict(by_frame)}  # keys become text in JSON, and are read so
