"""The scene's `camera` and its paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

from renderer.scene import schema
from renderer.scene.message_text import join_words
from renderer.scene.schema import INVALID, KeyText, TreeNode, Vector

# The longest duration of a camera path, in seconds: a day.
MAX_SECONDS = 86400.0

# The largest azimuth or roll of a camera, in degrees: nearly 3000 turns. Float64 resolves such an angle to 1e-10
# degrees.
MAX_ANGLE = 1e6
# The smallest `field_of_view`, in degrees; an angle of 0 would show nothing. The tangent of half this angle is 9e-6.
MIN_FIELD_OF_VIEW = 0.001
# The largest `field_of_view`, in degrees; an angle of 180 would show nothing. The tangent of half this angle is 1146.
MAX_FIELD_OF_VIEW = 179.9
# The smallest zoom of a keyframe, a factor by which the object is magnified in the picture.
MIN_ZOOM = 1e-6
# The largest zoom of a keyframe, a factor by which the object is magnified in the picture.
MAX_ZOOM = 1e6

AXES: dict[str, Vector] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}


def direction_field(expected: str) -> schema.FieldType[Any]:
    """Return the field type of a direction: three coordinates that are not all (nearly) 0."""
    coordinate = schema.still(schema.COORDINATE_FIELD)  # a direction moves as a whole, on the sphere
    return schema.sequence_field(coordinate, expected, count=3, check=_check_direction, motion="direction")


def _check_direction(node: TreeNode, vector: tuple[Any, ...]) -> Any:
    if max(map(abs, vector)) >= schema.MIN_WORLD_LENGTH:
        return vector
    hint = f"a component of at least {schema.MIN_WORLD_LENGTH:g}" if any(vector) else None
    return node.reject("no direction", hint=hint)


_AXIS_WORDS = "x, y, z, -x, -y, -z or a direction [x, y, z], not all 0"
_AXIS = schema.word_or(AXES, direction_field(_AXIS_WORDS), _AXIS_WORDS)

# The types of keys that several kinds of camera path share.
_NUM_FRAMES = schema.integer_field(minimum=1, maximum=schema.MAX_FRAMES)
NumFrames = Annotated[int, _NUM_FRAMES, KeyText("The number of frames of the path.", example="120")]
Axis = Annotated[
    Vector, _AXIS, KeyText("The axis that the camera turns about, or the direction that is up in the picture.")
]
_ANGLE = schema.number_field(minimum=-MAX_ANGLE, maximum=MAX_ANGLE)
Start = Annotated[float, _ANGLE, KeyText("The azimuth at the start, in degrees.")]
Elevation = Annotated[
    float,
    schema.number_field(minimum=-90, maximum=90),
    KeyText("The height of the camera over the horizon, in degrees.", example="10"),
]
# The texts on the keys of two kinds of path: through directions, and of a flight.
_KEYS_TEXT = (
    "Of `keyframes`: the directions of the camera at some frames. Of `flight`: the points that the eye flies through."
)
_EASING_TEXT = (
    "`smooth`: the speed changes smoothly at keys, and a flight starts and ends at rest. `linear`, the default of a "
    "flight: the speed is even."
)


class _Path:
    """The base class of all camera paths. All but `PathSequence` can also be a piece of a sequence."""

    type: ClassVar[str]

    def written(self) -> object:
        """Return the path as a scene file has it: its keys with their values."""
        return {"type": self.type} | vars(self)


@dataclass(frozen=True)
class TurntablePath(_Path):
    """A path around the target: at frame f the azimuth is `start + 360 f / frames`; the elevation is constant."""

    type: ClassVar[str] = "turntable"
    frames: NumFrames
    start: Start = 0.0
    elevation: Elevation = 0.0
    axis: Axis = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class RockerPath(_Path):
    """A path to and fro: at frame f the azimuth is `start + swing / 2 * sin(2 pi f / frames)`.

    swing: the angle between the two ends of the path, in degrees.
    """

    type: ClassVar[str] = "rocker"
    frames: NumFrames
    swing: Annotated[
        float, schema.number_field(above=0, maximum=360), KeyText("The whole angle that is swept, in degrees.")
    ] = 40.0
    start: Start = 0.0
    elevation: Elevation = 0.0
    axis: Axis = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Keyframe:
    """The direction of the camera at one frame of a path, and its zoom.

    zoom: a factor by which the object is magnified, compared with its size at the camera's `distance`.
    """

    frame: Annotated[
        int, schema.FRAME_NUMBER_FIELD, KeyText("The frame of this key, which `keyframes` need.", example="0")
    ]
    azimuth: Annotated[
        float, _ANGLE, KeyText("Of `keyframes`, which need it: the azimuth of the camera, in degrees.", example="0")
    ]
    elevation: Elevation
    zoom: Annotated[
        float,
        schema.number_field(minimum=MIN_ZOOM, maximum=MAX_ZOOM),
        KeyText("The factor by which the object is magnified."),
    ] = 1.0


_KEYS = schema.sequence_field(
    schema.dataclass_field(Keyframe), "a list of {frame: ..., azimuth: ..., elevation: ..., zoom: ...}, one or more"
)


@dataclass(frozen=True)
class KeyframePath(_Path):
    """A path through given directions at some frames, its keys. Between two keys, it is interpolated on the sphere.

    keys: the keys, with ascending frames. loop: whether the path leads from the last key back to the first.
    easing: with `smooth`, the camera's speed changes smoothly at the keys.
    """

    type: ClassVar[str] = "keyframes"
    frames: NumFrames
    keys: Annotated[tuple[Keyframe, ...], schema.still(_KEYS), KeyText(_KEYS_TEXT)]
    loop: Annotated[bool, KeyText("Whether the path leads from the last key back to the first.")] = True
    easing: Annotated[Literal["smooth", "linear"], KeyText(_EASING_TEXT)] = "smooth"
    axis: Axis = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class HoldPath(_Path):
    """A piece of a path in which the camera stands still.

    It stays where the piece before it ended or, at the start of a path, where the first moving piece begins.
    """

    type: ClassVar[str] = "hold"
    frames: NumFrames


@dataclass(frozen=True)
class FlightKey:
    """A point of a flight: positions of the eye and of its target, in world units.

    roll: the clockwise turn of the picture about its middle, in degrees.
    frame: the frame, counted from the start of the flight, at which the eye is here; None to keep a constant speed.
    """

    position: Annotated[
        Vector,
        schema.POINT_FIELD,
        KeyText("Of a `flight`, which needs it: the place of the eye, in world units.", example="[0, -400, 60]"),
    ]
    target: Annotated[
        Vector,
        schema.POINT_FIELD,
        KeyText(
            "Of a `flight`, which needs it: the place that the eye looks at, in world units.", example="[0, 0, 60]"
        ),
    ]
    roll: Annotated[float, _ANGLE, KeyText("The clockwise turn of the picture, in degrees.")] = 0.0
    frame: Annotated[
        int | None,
        schema.FRAME_NUMBER_FIELD,
        KeyText(
            "The frame of the flight at which the eye is here.",
            "the one that it reaches at an even speed",
            "0",
        ),
    ] = None


def _check_flight_key(node: TreeNode, given: dict[str, Any]) -> None:
    target = given["target"]
    if isinstance(target, tuple) and INVALID not in target and given["position"] == target:
        node.child("target", target).reject("no direction", expected="another place than the eye's")


_FLIGHT_KEYS = schema.sequence_field(
    schema.dataclass_field(FlightKey, _check_flight_key),
    "a list of {position: [x, y, z], target: [x, y, z], roll: ...}, one or more",
)


@dataclass(frozen=True)
class FlightPath(_Path):
    """A flight of the eye along a smooth curve through keys. It starts where the piece of the path before it ended.

    The eye's speed is constant over the whole flight or, if keys have frames, between two keys.
    easing: with `smooth`, the eye starts and ends at rest. axis: the direction that is up in the picture.
    """

    type: ClassVar[str] = "flight"
    frames: NumFrames
    keys: Annotated[tuple[FlightKey, ...], schema.still(_FLIGHT_KEYS), KeyText(_KEYS_TEXT)]
    easing: Annotated[Literal["linear", "smooth"], KeyText(_EASING_TEXT)] = "linear"
    axis: Axis = (0.0, 0.0, 1.0)


PathPiece = TurntablePath | RockerPath | KeyframePath | HoldPath | FlightPath


@dataclass(frozen=True)
class PathSequence(_Path):
    """A path of several pieces, one after the other."""

    type: ClassVar[str] = "sequence"
    pieces: tuple[PathPiece, ...]

    @property
    def frames(self) -> int:
        """Return the number of frames of all pieces."""
        return sum(piece.frames for piece in self.pieces)

    def written(self) -> object:
        """Return the path as a scene file has it: the list of its pieces."""
        return self.pieces


CameraPath = PathPiece | PathSequence
_PATHS: dict[str, type[PathPiece]] = {
    cls.type: cls for cls in (TurntablePath, RockerPath, KeyframePath, HoldPath, FlightPath)
}


def _merged(tables: Sequence[schema.FieldTable]) -> dict[str, schema.FieldType[Any]]:
    """Return the types of the keys in all tables. Where two types differ, it is the first, with the keys of both.

    A key is needed if it is needed in all tables.
    """
    found: dict[str, schema.FieldType[Any]] = {}
    for key, field in (pair for table in tables for pair in table.items()):
        first = found.setdefault(key, field)
        if first.table and field.table:
            found[key] = replace(first, table=_merged([first.table, field.table]))
    return {
        key: replace(field, is_needed=all(key in table and table[key].is_needed for table in tables))
        for key, field in found.items()
    }


_TYPE: schema.FieldType[Any] = schema.described(
    schema.choice_field(*_PATHS),
    "`turntable`: once around. `rocker`: to and fro. `keyframes`: through directions. `hold`: at rest. `flight`: the "
    "eye flies through points.",
)
_SECONDS = schema.described(
    schema.number_field(above=0, maximum=MAX_SECONDS, motion=None),
    "The duration, in seconds, in place of `frames`.",
    example="4",
)
_PATH_FIELDS = {name: {"type": _TYPE, **schema.field_table(cls), "seconds": _SECONDS} for name, cls in _PATHS.items()}
_PATH_KEYS = _merged([*_PATH_FIELDS.values()])
# For each key of a path, the hint for a path of a type that lacks this key. It names the types that have the key.
_OWNERS = {
    key: f"{key} belongs to type: {join_words(name for name, table in _PATH_FIELDS.items() if key in table)}"
    for key in set().union(*_PATH_FIELDS.values())
}


def _parse_path(node: TreeNode) -> Any:
    if not isinstance(node.value, (list, tuple)):
        return _parse_piece(node)
    pieces = tuple(_parse_piece(node.child(number, piece)) for number, piece in enumerate(node.value))
    if not pieces:
        return node.reject("empty", got="")
    if INVALID in pieces or any(piece.frames is INVALID for piece in pieces):
        return INVALID
    path = PathSequence(pieces)
    if path.frames > schema.MAX_FRAMES:
        return node.reject("too many frames", got=str(path.frames), expected=f"at most {schema.MAX_FRAMES}")
    return path


def _parse_piece(node: TreeNode) -> Any:
    if not isinstance(node.value, Mapping):
        return node.reject("not a mapping")
    if "type" not in node.value:
        return _TYPE.reject(node.child("type"), "missing")
    name = _TYPE.read(node.child("type", node.value["type"]))
    if name is INVALID:  # the type decides which keys are legal
        return INVALID
    required = [key for key in schema.required_keys(_PATHS[name]) if key != "frames" or "seconds" not in node.value]
    given = schema.read_fields(node, _PATH_FIELDS[name], required=required, misplaced_hints=_OWNERS)
    if "seconds" in given:
        if "frames" in given:
            node.key("seconds").reject("contradicts frames", expected="one of them")
        given["frames"] = seconds = given["seconds"]
        if seconds is not INVALID:
            given["frames"] = max(1, round(seconds * (node.film.frames_per_second if node.film is not None else 1.0)))
            if given["frames"] > schema.MAX_FRAMES:
                place, given["frames"] = node.child("seconds", node.value["seconds"]), INVALID
                place.reject("too many frames", expected=f"at most {schema.MAX_FRAMES} frames")
    if "keys" in given:
        _check_keys(node.child("keys"), given["keys"], given["frames"])
    return _PATHS[name](**{key: value for key, value in given.items() if key not in ("type", "seconds")})


def _check_keys(node: TreeNode, keys: object, num_frames: object) -> None:
    """Check that the frames of keys ascend and lie in the path, and that either all keys have frames or none."""
    frames = [getattr(key, "frame", INVALID) for key in keys] if isinstance(keys, tuple) else []
    for index, frame in enumerate(frames):
        if (frame is None) != (frames[0] is None) and INVALID not in (frame, frames[0]):
            node.child(index).reject("a frame at some keys only", got="", expected="a frame at each key, or at none")
            return
    for index, (before, frame) in enumerate(pairwise([-1, *frames])):
        place = node.child(index).child("frame")
        schema.check_frame_in_path(place, frame, num_frames)
        schema.check_frames_ascend(place, before, frame)


_LENGTHS = ("frames", "seconds")
_ONE_LENGTH = schema.Alternatives([_LENGTHS], [_LENGTHS])


def _piece_table(name: str) -> schema.FieldTable:
    """Return the types of the keys of a path of one type. Its `type` is that alone."""
    required = {"type", *schema.required_keys(_PATHS[name])} - {*_LENGTHS}
    table = {key: replace(field, is_needed=key in required) for key, field in _PATH_FIELDS[name].items()}
    return table | {"type": replace(table["type"], plain_schema=lambda _moves: {"const": name}, example=name)}


_PIECES = {name: _piece_table(name) for name in _PATHS}
# An example of a path of each type.
PATH_EXAMPLES = tuple(schema.mapping_example(table, _ONE_LENGTH) for table in _PIECES.values())


def _path_schema(moves: bool) -> schema.JsonSchema:
    piece = schema.any_of(*(schema.mapping_schema(table, _ONE_LENGTH, moves=moves) for table in _PIECES.values()))
    return schema.any_of(piece, {"type": "array", "items": piece, "minItems": 1})


_PATH = schema.FieldType(
    f"a mapping with type: {join_words(_PATHS)}, and frames; or a list of such",
    _parse_path,
    table=_PATH_KEYS,
    plain_schema=_path_schema,
    example=PATH_EXAMPLES[0],
)

_TARGET = schema.word_or({"visible": "visible"}, schema.POINT_FIELD, f"{schema.POINT_FIELD.expected}, or visible")

_SHIFT = schema.sequence_field(
    schema.number_field(minimum=-0.5, maximum=0.5, motion=None), "[right, up]: two numbers from -0.5 to 0.5", count=2
)


@dataclass(frozen=True)
class CameraSpec:
    """A camera and its path.

    target: the point that the camera looks at. None is the centre of the volume. "visible" is the centre of all voxels
        that are visible on any frame or, with `follow`, of the voxels that are visible on the present frame.
    distance: from the eye to the target; None is the distance at which everything stays in the picture on all frames.
    field_of_view: the vertical angle of view, in degrees. An orthographic camera shows as much as a perspective one
        does at the target: `2 distance tan(field_of_view / 2)` world units of height.
    near: nothing is drawn that is closer than this to the plane through the eye at right angles to the view.
    shift: how far the target is from the middle of the picture, to the right and up, as shares of its width and height.
        The view does not turn. None is the middle of the room that `annotation` leaves if `distance` is None, too; else
        it is the middle of the picture.
    follow: see `target`. loop: with `ping-pong`, the camera goes along its path and back again.
    """

    path: Annotated[CameraPath, _PATH, KeyText("The path of the camera, or a list of paths in a row.")]
    projection: Annotated[
        Literal["perspective", "orthographic"],
        KeyText("`orthographic`: no foreshortening; sizes at the target are those of `perspective`."),
    ] = "perspective"
    field_of_view: Annotated[
        float,
        schema.number_field(minimum=MIN_FIELD_OF_VIEW, maximum=MAX_FIELD_OF_VIEW),
        KeyText("The vertical angle of view, in degrees."),
    ] = 30.0
    target: Annotated[
        Vector | Literal["visible"] | None,
        _TARGET,
        KeyText(
            "The point that the camera looks at, in world units; `visible`: the centre of what is visible.",
            "the centre of the volume",
            "visible",
        ),
    ] = None
    distance: Annotated[
        float | None,
        schema.LENGTH_FIELD,
        KeyText(
            "The distance from the eye to the target, in world units.",
            "so that everything visible fits",
            "716",
        ),
    ] = None
    near: Annotated[
        float,
        schema.number_field(minimum=0, maximum=schema.MAX_WORLD_LENGTH),
        KeyText("The distance from the eye's plane below which nothing is drawn."),
    ] = 0.0
    shift: Annotated[
        tuple[float, float] | None,
        _SHIFT,
        KeyText(
            "How far right and up of the middle the target is, as shares of the picture's width and height.",
            "the middle of the room that `annotation` leaves",
            "[0.1, 0]",
        ),
    ] = None
    follow: Annotated[
        bool,
        KeyText("With `target: visible`: whether the target is the centre of each frame, not of the film."),
    ] = False
    loop: Annotated[
        Literal["restart", "ping-pong"],
        KeyText("`restart`: the film ends with the path. `ping-pong`: the camera goes back, too."),
    ] = "restart"

    @property
    def num_frames(self) -> int:
        """Return the number of frames of the film, with the way back of `loop: ping-pong`."""
        num = self.path.frames
        return 2 * num - 2 if self.loop == "ping-pong" and num > 2 else num

    def path_frame(self, frame: int) -> int:
        """Return the number of the path's frame that a frame of the film shows."""
        return frame if frame < self.path.frames else 2 * self.path.frames - 2 - frame


def _check_camera(node: TreeNode, given: dict[str, Any]) -> None:
    """Check the length of the film, and that `follow` is given only with `target: visible`."""
    path, loop = given["path"], given.get("loop")
    frames = getattr(path, "frames", INVALID)
    if isinstance(frames, int) and CameraSpec(path, loop=loop or "restart").num_frames > schema.MAX_FRAMES:
        node.key("loop").reject("too many frames", expected=f"at most {schema.MAX_FRAMES}, there and back")
    if given.get("follow") is True and given.get("target") not in ("visible", INVALID):
        node.key("follow").reject("needs target: visible", hint="else the target is where it is said to be")


CAMERA_FIELD = schema.dataclass_field(CameraSpec, _check_camera)
