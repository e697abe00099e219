"""Parse the scene's `camera` and its paths."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from renderer.scene import schema, spec
from renderer.scene.message_text import format_value, join_words
from renderer.scene.schema import INVALID, TreeNode

MAX_FRAMES = 10**6
FRAME_NUMBER_FIELD = schema.integer_field(minimum=0, maximum=MAX_FRAMES - 1)

# Degrees: float64 keeps the direction after thousands of turns to 1e-10 degrees.
MAX_ANGLE = 1e6
# A view of 0 or 180 degrees shows nothing; the tangents of these half angles are 9e-6 and 1146.
MIN_FIELD_OF_VIEW, MAX_FIELD_OF_VIEW = 0.001, 179.9
MIN_ZOOM, MAX_ZOOM = 1e-6, 1e6

AXES: dict[str, spec.Vector] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}


def direction_field(expected: str) -> schema.FieldType[spec.Vector]:
    """Return the type of three coordinates that are not all (nearly) 0."""

    def parse(node: TreeNode) -> spec.Vector:
        vector = numbers.read(node)
        if (
            isinstance(vector, tuple)
            and INVALID not in vector
            and all(abs(part) < spec.MIN_WORLD_LENGTH for part in vector)
        ):
            hint = None if not any(vector) else f"a component of at least {spec.MIN_WORLD_LENGTH:g}"
            return field.reject(node, "no direction", hint=hint)
        return vector  # type: ignore[return-value]  # three, or INVALID

    numbers = schema.sequence_field(schema.COORDINATE_FIELD, expected, count=3)
    field = schema.FieldType(expected, parse)
    return field


_AXIS_WORDS = "x, y, z, -x, -y, -z or a direction [x, y, z], not all 0"
_AXIS_NUMBERS = direction_field(_AXIS_WORDS)


def _parse_axis(node: TreeNode) -> spec.Vector:
    if isinstance(node.value, (list, tuple)):
        return _AXIS_NUMBERS.read(node)
    axis = AXES.get(node.value) if isinstance(node.value, str) else None
    return axis or _AXIS.reject(node, "not an axis")


_AXIS = schema.FieldType(_AXIS_WORDS, _parse_axis)
_ANGLE = schema.number_field(minimum=-MAX_ANGLE, maximum=MAX_ANGLE)
_ELEVATION = schema.number_field(minimum=-90, maximum=90)

_KEY_FIELDS: schema.FieldTable = {
    "frame": FRAME_NUMBER_FIELD,
    "azimuth": _ANGLE,
    "elevation": _ELEVATION,
    "zoom": schema.number_field(minimum=MIN_ZOOM, maximum=MAX_ZOOM),
}
_KEY = schema.section_field(
    _KEY_FIELDS, lambda node, given: spec.Keyframe(**given), required=("frame", "azimuth", "elevation")
)

_PATHS: dict[str, type[spec.TurntablePath | spec.RockerPath | spec.KeyframePath]] = {
    "turntable": spec.TurntablePath,
    "rocker": spec.RockerPath,
    "keyframes": spec.KeyframePath,
}
_COMMON: dict[str, schema.FieldType[Any]] = {
    "type": schema.choice_field(*_PATHS),
    "frames": schema.integer_field(minimum=1, maximum=MAX_FRAMES),
    "axis": _AXIS,
}
_PATH_FIELDS: dict[str, dict[str, schema.FieldType[Any]]] = {
    "turntable": _COMMON | {"start": _ANGLE, "elevation": _ELEVATION},
    "rocker": _COMMON | {"swing": schema.number_field(above=0, maximum=360), "start": _ANGLE, "elevation": _ELEVATION},
    "keyframes": _COMMON
    | {
        "keys": schema.sequence_field(
            _KEY, "a list of {frame: ..., azimuth: ..., elevation: ..., zoom: ...}, one or more"
        ),
        "loop": schema.BOOLEAN_FIELD,
        "easing": schema.choice_field("smooth", "linear"),
    },
}
# Hints for keys of other path types.
_OWNERS = {
    key: f"{key} belongs to type: {join_words(name for name, table in _PATH_FIELDS.items() if key in table)}"
    for key in set().union(*_PATH_FIELDS.values())
}


def _parse_path(node: TreeNode) -> Any:
    if not isinstance(node.value, Mapping):
        return _PATH.reject(node, "not a mapping")
    if "type" not in node.value:
        return _COMMON["type"].reject(node.child("type"), "missing")
    name = _COMMON["type"].read(node.child("type", node.value["type"]))
    if name is INVALID:  # which keys are legal depends on it
        return INVALID
    required = ("frames", "keys") if name == "keyframes" else ("frames",)
    given = schema.read_fields(node, _PATH_FIELDS[name], required=required, misplaced_hints=_OWNERS)
    if name == "keyframes":
        _check_keys(node.child("keys"), given["keys"], given["frames"])
    return _PATHS[name](**{key: value for key, value in given.items() if key != "type"})


def check_frame_in_path(node: TreeNode, frame: Any, num_frames: Any) -> None:
    """Check that a frame, at `node`, is before the end of the path; INVALID numbers are skipped."""
    if isinstance(frame, int) and isinstance(num_frames, int) and frame >= num_frames:
        expected = f"a frame from 0 to {num_frames - 1}"
        node.add_problem("after the last frame", got=format_value(frame), expected=expected)


def _check_keys(node: TreeNode, keys: Any, num_frames: Any) -> None:
    """Check that keyframes ascend and lie in the path."""
    frames = [getattr(key, "frame", INVALID) for key in keys] if isinstance(keys, tuple) else []
    for index, frame in enumerate(frames):
        check_frame_in_path(node.child(index).child("frame"), frame, num_frames)
    for index, (before, frame) in enumerate(pairwise(frames), start=1):
        if isinstance(frame, int) and isinstance(before, int) and frame <= before:
            node.child(index).child("frame").add_problem(
                "keys out of order",
                got=format_value(frame),
                expected=f"a frame after {before}, that of the key before",
            )


_PATH = schema.FieldType(f"a mapping with type: {join_words(_PATHS)}, and frames", _parse_path)

_TARGET_WORDS = "[x, y, z] in world units, or visible"
_TARGET_NUMBERS = schema.sequence_field(schema.COORDINATE_FIELD, _TARGET_WORDS, count=3)
_TARGET = schema.FieldType(
    _TARGET_WORDS, lambda node: "visible" if node.value == "visible" else _TARGET_NUMBERS.read(node)
)

_FIELDS: schema.FieldTable = {
    "projection": schema.choice_field("perspective", "orthographic"),
    "field_of_view": schema.number_field(minimum=MIN_FIELD_OF_VIEW, maximum=MAX_FIELD_OF_VIEW),
    "target": _TARGET,
    "distance": schema.LENGTH_FIELD,
    "near": schema.number_field(minimum=0, maximum=spec.MAX_WORLD_LENGTH),
    "path": _PATH,
}

CAMERA_SECTION = schema.section_field(_FIELDS, lambda node, given: spec.CameraSpec(**given), required=("path",))
