"""The scene's `camera` and its paths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

from renderer.scene import schema
from renderer.scene.message_text import join_words
from renderer.scene.schema import INVALID, TreeNode, Vector

MAX_FRAMES = 10**6
FRAME_NUMBER_FIELD = schema.integer_field(minimum=0, maximum=MAX_FRAMES - 1)

# Degrees: float64 keeps the direction after thousands of turns to 1e-10 degrees.
MAX_ANGLE = 1e6
# A view of 0 or 180 degrees shows nothing; the tangents of these half angles are 9e-6 and 1146.
MIN_FIELD_OF_VIEW, MAX_FIELD_OF_VIEW = 0.001, 179.9
MIN_ZOOM, MAX_ZOOM = 1e-6, 1e6

AXES: dict[str, Vector] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}


def direction_field(expected: str) -> schema.FieldType[Any]:
    """Return the type of three coordinates that are not all (nearly) 0."""
    return schema.sequence_field(schema.COORDINATE_FIELD, expected, count=3, check=_check_direction)


def _check_direction(node: TreeNode, vector: tuple[Any, ...]) -> Any:
    if max(map(abs, vector)) >= schema.MIN_WORLD_LENGTH:
        return vector
    hint = f"a component of at least {schema.MIN_WORLD_LENGTH:g}" if any(vector) else None
    return node.reject("no direction", hint=hint)


_AXIS_WORDS = "x, y, z, -x, -y, -z or a direction [x, y, z], not all 0"
_AXIS = schema.word_or(AXES, direction_field(_AXIS_WORDS), _AXIS_WORDS)

# The types of fields that several paths have.
NumFrames = Annotated[int, schema.integer_field(minimum=1, maximum=MAX_FRAMES)]
Axis = Annotated[Vector, _AXIS]
Angle = Annotated[float, schema.number_field(minimum=-MAX_ANGLE, maximum=MAX_ANGLE)]
Elevation = Annotated[float, schema.number_field(minimum=-90, maximum=90)]


@dataclass(frozen=True)
class TurntablePath:
    """A path around the target: azimuth `start + 360 f / frames`, constant elevation."""

    type: ClassVar[str] = "turntable"
    frames: NumFrames
    start: Angle = 0.0
    elevation: Elevation = 0.0
    axis: Axis = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class RockerPath:
    """A path to and fro: azimuth `start + swing / 2 * sin(2 pi f / frames)`; `swing` is the whole angle swept."""

    type: ClassVar[str] = "rocker"
    frames: NumFrames
    swing: Annotated[float, schema.number_field(above=0, maximum=360)] = 40.0
    start: Angle = 0.0
    elevation: Elevation = 0.0
    axis: Axis = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Keyframe:
    """A camera at one frame; `zoom` magnifies the picture relative to the path's distance."""

    frame: Annotated[int, FRAME_NUMBER_FIELD]
    azimuth: Angle
    elevation: Elevation
    zoom: Annotated[float, schema.number_field(minimum=MIN_ZOOM, maximum=MAX_ZOOM)] = 1.0


_KEYS = schema.sequence_field(
    schema.dataclass_field(Keyframe), "a list of {frame: ..., azimuth: ..., elevation: ..., zoom: ...}, one or more"
)


@dataclass(frozen=True)
class KeyframePath:
    """A path through keys in ascending frame order, eased between them; directions are interpolated on the sphere."""

    type: ClassVar[str] = "keyframes"
    frames: NumFrames
    keys: Annotated[tuple[Keyframe, ...], _KEYS]
    loop: bool = True
    easing: Literal["smooth", "linear"] = "smooth"
    axis: Axis = (0.0, 0.0, 1.0)


CameraPath = TurntablePath | RockerPath | KeyframePath
_PATHS: dict[str, type[CameraPath]] = {cls.type: cls for cls in (TurntablePath, RockerPath, KeyframePath)}
_TYPE: schema.FieldType[Any] = schema.choice_field(*_PATHS)
_PATH_FIELDS = {name: {"type": _TYPE, **schema.field_table(cls)} for name, cls in _PATHS.items()}
# Hints for keys of other path types.
_OWNERS = {
    key: f"{key} belongs to type: {join_words(name for name, table in _PATH_FIELDS.items() if key in table)}"
    for key in set().union(*_PATH_FIELDS.values())
}


def _parse_path(node: TreeNode) -> Any:
    if not isinstance(node.value, Mapping):
        return node.reject("not a mapping")
    if "type" not in node.value:
        return _TYPE.reject(node.child("type"), "missing")
    name = _TYPE.read(node.child("type", node.value["type"]))
    if name is INVALID:  # which keys are legal depends on it
        return INVALID
    required = schema.required_keys(_PATHS[name])
    given = schema.read_fields(node, _PATH_FIELDS[name], required=required, misplaced_hints=_OWNERS)
    if name == KeyframePath.type:
        _check_keys(node.child("keys"), given["keys"], given["frames"])
    return _PATHS[name](**{key: value for key, value in given.items() if key != "type"})


def check_frame_in_path(node: TreeNode, frame: Any, num_frames: Any) -> None:
    """Check that a frame, at `node`, is before the end of the path; INVALID numbers are skipped."""
    if isinstance(frame, int) and isinstance(num_frames, int) and frame >= num_frames:
        node.reject("after the last frame", got=str(frame), expected=f"a frame from 0 to {num_frames - 1}")


def _check_keys(node: TreeNode, keys: Any, num_frames: Any) -> None:
    """Check that keyframes ascend and lie in the path."""
    frames = [getattr(key, "frame", INVALID) for key in keys] if isinstance(keys, tuple) else []
    for index, (before, frame) in enumerate(pairwise([-1, *frames])):
        place = node.child(index).child("frame")
        check_frame_in_path(place, frame, num_frames)
        check_frames_ascend(place, before, frame)


def check_frames_ascend(node: TreeNode, before: Any, frame: Any) -> bool:
    """Check that a frame, at `node`, comes after another; INVALID numbers are skipped."""
    ascends = not isinstance(frame, int) or not isinstance(before, int) or frame > before
    if not ascends:
        expected = "frames in ascending order, each once"
        node.reject("frames out of order", got=f"{frame} after {before}", expected=expected)
    return ascends


_PATH = schema.FieldType(f"a mapping with type: {join_words(_PATHS)}, and frames", _parse_path)

_TARGET_WORDS = "[x, y, z] in world units, or visible"
_POINT = schema.sequence_field(schema.COORDINATE_FIELD, _TARGET_WORDS, count=3)
_TARGET = schema.word_or({"visible": "visible"}, _POINT, _TARGET_WORDS)


@dataclass(frozen=True)
class CameraSpec:
    """A camera and its path.

    target: None is the centre of the volume, "visible" the centre of what is visible. distance: None fits the whole
        path in the frame. field_of_view: an orthographic camera shows `2 distance tan(field_of_view / 2)` world units
        of height, as a perspective one does at the target. near: nothing nearer to the eye plane is drawn.
    """

    path: Annotated[CameraPath, _PATH]
    projection: Literal["perspective", "orthographic"] = "perspective"
    field_of_view: Annotated[float, schema.number_field(minimum=MIN_FIELD_OF_VIEW, maximum=MAX_FIELD_OF_VIEW)] = 30.0
    target: Annotated[Vector | Literal["visible"] | None, _TARGET] = None
    distance: Annotated[float | None, schema.LENGTH_FIELD] = None
    near: Annotated[float, schema.number_field(minimum=0, maximum=schema.MAX_WORLD_LENGTH)] = 0.0
