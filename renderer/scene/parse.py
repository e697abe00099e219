"""Convert plain data to a checked Scene, and back.

The tree comes from a YAML or JSON reader: nested mappings, lists and scalars. Nothing here imports numpy or OpenGL.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from renderer.errors import Problem, SceneError
from renderer.scene import schema
from renderer.scene.camera_section import CameraPath
from renderer.scene.error_section import ErrorSpec, check_scheduled_frames, schedule_to_dict
from renderer.scene.limits import proportion_problems
from renderer.scene.output_section import OutputSpec, check_frame_field
from renderer.scene.spec import Scene
from renderer.scene.splat_section import SplatSpec, unused_splat_keys
from renderer.scene.transfer_section import ColormapSpec, TransferSpec
from renderer.scene.volume_section import ArraySource, FileSource, ProceduralSource, RawSource, VolumeSpec


def parse_scene(tree: object, *, base: Path, is_single_frame: bool = False) -> Scene:
    """Return the scene that `tree` describes.

    base: the folder that volume files are relative to; they are kept as `base / file`, the output file as given.
    is_single_frame: one frame is drawn, so the output may be a PNG without a number in its name.
    Raises SceneError with every problem.
    """
    problems: list[Problem] = []
    node = schema.TreeNode(tree, "", problems, base)
    required = schema.required_keys(Scene)
    given = schema.read_fields(node, _SECTIONS, required=required, misplaced_hints=_MISPLACED_KEY_HINTS)
    check_scheduled_frames(node.child("error"), given)
    if not is_single_frame:
        check_frame_field(node.child("output"), given)
    scene = Scene(**given)
    if problems or (problems := list(proportion_problems(scene))):  # values are compared only if each is correct
        raise SceneError(problems)
    return scene


_SECTIONS = schema.field_table(Scene)

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


# Back to plain data

_SOURCE_KEYS: dict[type, str] = {RawSource: "raw", ProceduralSource: "procedural", ArraySource: "array"}


def scene_to_dict(scene: Scene) -> dict[str, Any]:
    """Return the scene as plain data for JSON or YAML, with every default written out.

    `parse_scene` makes the same scene from it: with any `base` if the volume's file is an absolute path, else in the
        same folder.
    """
    return {"version": scene.version} | spec_to_dict(scene)


def spec_to_dict(value: Any) -> dict[str, Any]:
    """Return a part of a scene, such as a CameraSpec or a TransferSpec, as plain data; as `scene_to_dict`."""
    pairs = ((field.name, getattr(value, field.name)) for field in fields(value))
    plain = {name: _plain(item) for name, item in pairs if item is not None}  # None stands for a key that is not given
    if isinstance(value, VolumeSpec):
        source: dict[str, Any] = plain.pop("source")
        return (source if isinstance(value.source, FileSource) else {_SOURCE_KEYS[type(value.source)]: source}) | plain
    if isinstance(value, TransferSpec):
        mapping = plain.pop("mapping")
        has_colormap = isinstance(value.mapping, ColormapSpec)
        return ({"colormap": mapping.pop("name")} | mapping if has_colormap else {"points": mapping}) | plain
    if isinstance(value, ErrorSpec):
        return schedule_to_dict(value) | {key: plain[key] for key in plain if key not in ("tolerance", "goal")}
    if isinstance(value, SplatSpec):
        return {key: item for key, item in plain.items() if key not in unused_splat_keys(value.footprint)}
    if isinstance(value, OutputSpec):
        return plain | {"background": plain.get("background", "transparent")}
    return {"type": value.type} | plain if isinstance(value, CameraPath) else plain


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, ArraySource):
        return {"shape": list(value.shape), "dtype": str(value.values.dtype), "spacing": list(value.spacing)}
    return spec_to_dict(value) if is_dataclass(value) else value
