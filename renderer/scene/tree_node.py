"""A value of a scene with its place in the tree, and types of values, which may move over the frames of a film.

A value that moves is written as a map from frames to values. Each type says how its values move, and a map is read here
for all of them: no section of a scene, and no reader of a section, knows of maps.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Generic, TypeVar

from renderer.errors import Problem
from renderer.scene.message_text import did_you_mean, format_value, join_keys, join_words
from renderer.scene.motion import EASINGS, Motion, MotionKind, moving, shape_of

T = TypeVar("T")

# The largest number of frames of a film.
MAX_FRAMES = 10**6
# A list or a matrix that moves is checked at about this many frames between its keys, or at all of them if these are
# fewer.
_MOST_BETWEEN = 100
# The largest number of mistakes that are reported in one map from frames to values. Further mistakes are likely of the
# same kind.
_MOST_PROBLEMS = 20

_FRAME = re.compile(r"-?\d{1,9}|\d{1,9}(\.\d{0,9})?s", re.ASCII)
# The same for a JSON Schema, whose patterns have no flags.
_FRAME_PATTERN = "^(-?[0-9]{1,9}|[0-9]{1,9}([.][0-9]{0,9})?s)$"
_EASING_WORDS = "How values pass from one frame of the map to the next."

_WHAT_MOVES = "numbers, colors, points and directions can move: docs/motion.md"
_MAP_OF_FRAMES = "what moves is a map from frames, such as 0, -1 or 2.5s: docs/motion.md"

INVALID: Any = object()

# A JSON Schema (draft 7), as plain data.
JsonSchema = dict[str, Any]


@dataclass(frozen=True)
class FilmTime:
    """The frames of a film in which values may move, and the motions that were read so far.

    num_frames: the number of frames; None if it is not known.
    at: the frame at which values are read; None to read motions in place of values.
    keys: the key frames of all motions that were read.
    motions: all motions without problems, by path and by the id of their field type, which is kept with them. So a
        motion with many keys is read once, although values are read at many frames.
    """

    num_frames: int | None
    frames_per_second: float
    at: int | None = None
    keys: set[int] = field(default_factory=set)
    motions: dict[tuple[str, int], tuple[FieldType[Any], Motion[Any]]] = field(default_factory=dict)


@dataclass(frozen=True)
class TreeNode:
    """A value in the tree of a scene, its dotted path, and the list of the problems in the whole tree.

    base: the folder that files in the tree are relative to.
    is_key: whether the node is the last key of the path, and not its value.
    expected: a description of right values, for messages. words: texts that are allowed besides such values.
    film: the film in which values may move; None if this value must not move.
    """

    value: object
    path: str
    problems: list[Problem]
    base: Path = Path()
    is_key: bool = False
    expected: str | None = None
    words: Collection[str] = ()
    film: FilmTime | None = None

    def child(self, key: object, value: object = None) -> TreeNode:
        """Return the node of the value at `key` below this one."""
        return TreeNode(value, join_keys(self.path, key), self.problems, self.base, film=self.film)

    def key(self, key: object, value: object = None) -> TreeNode:
        """Return the node of the key `key` itself, for problems with the key and not with its value.

        value: `key` again, for problems with its text and to read it; None for the problem that the key is there.
        """
        return replace(self.child(key, value), is_key=True)

    def expecting(self, expected: str) -> TreeNode:
        """Return this node with a description of the values that a type expects.

        The code names all fields, as `replace` would be slower, and this is done for each value that is read.
        """
        return TreeNode(self.value, self.path, self.problems, self.base, self.is_key, expected, self.words, self.film)

    def reject(self, what: str, **parts: str | None) -> Any:
        """Add a problem with this value or key, and return INVALID.

        parts: `got`, by default the value; `expected`, by default the node's; and `hint`, by default the most similar
            of the node's words. An empty text leaves a part out.
        """
        got = None if self.value is None else format_value(self.value)
        parts = {"got": got, "expected": self.expected} | parts
        parts["hint"] = parts.get("hint") or did_you_mean(self.value, self.words)
        self.problems.append(Problem(self.path, what, at_key=self.is_key, **parts))
        return INVALID


@dataclass(frozen=True)
class KeyText:
    """The text on a key of a scene, which documentation, editors and `hsplat explain` show.

    sentence: says what the key sets, and in which unit. default: the words for a default that is no value of a scene,
        such as "the centre of the volume".
    example: a value, as YAML; by default the default, or an example of the type.
    """

    sentence: str
    default: str = ""
    example: str = ""


@dataclass(frozen=True)
class FieldType(Generic[T]):
    """A type of value: a function that reads it, and the words that follow "expected:" in messages.

    empty_hint: a hint for a key without a value. motion: how values move; None if they cannot.
    table: the types of the keys, of a mapping or of a list of mappings.
    plain_schema: a function that returns the JSON Schema of a value that does not move as a whole; its argument says
        whether parts of the value may move.
    words: the words that stand for values. example: a value, as YAML.
    text: the text on the key whose value this is. default: the key's default, as a scene has it; None for no default.
    is_needed: whether the key has to be given.
    """

    expected: str
    parser: Callable[[TreeNode], T]
    empty_hint: str | None = None
    motion: MotionKind | None = None
    table: Mapping[str, FieldType[Any]] | None = None
    plain_schema: Callable[[bool], JsonSchema] = lambda _moves: {}
    words: Mapping[str, Any] = field(default_factory=dict)
    example: str = ""
    text: KeyText | None = None
    default: object = None
    is_needed: bool = False

    def read(self, node: TreeNode) -> T:
        """Return the checked value, or INVALID. A value that moves is written as a map from frames to values."""
        if node.value is None:
            return self.reject(node, "no value", hint=self.empty_hint)
        if node.film is None or not isinstance(node.value, Mapping):
            return self.parse(node)
        is_by_frame = any(map(_may_be_frame, node.value))
        if is_by_frame and self.motion is not None:
            moved: T = _read_motion(self, node, node.film)
            return moved
        num_problems = len(node.problems)
        value = self.parse(node)
        if value is INVALID and [problem.path for problem in node.problems[num_problems:]] == [node.path]:
            if is_by_frame:
                node.problems[-1] = replace(node.problems[-1], what="cannot move", hint=_WHAT_MOVES)
            elif self.motion is not None:
                node.problems[-1] = replace(node.problems[-1], hint=_MAP_OF_FRAMES)
        return value

    def parse(self, node: TreeNode) -> T:
        """Return the checked value, or INVALID. The value of the node must not be None, nor a map from frames."""
        return self.parser(node.expecting(self.expected))

    def schema(self, moves: bool = True) -> JsonSchema:
        """Return the JSON Schema of a value. moves: whether the value and its parts may move, as far as they can."""
        plain = self.plain_schema(moves)
        if not moves or self.motion is None:
            return plain
        by_frame = {
            "title": "a map from frames",
            "type": "object",
            "minProperties": 1,
            "properties": {"easing": {"enum": [*EASINGS], "description": _EASING_WORDS}},
            "patternProperties": {_FRAME_PATTERN: self.plain_schema(False)},
            "additionalProperties": False,
        }
        return any_of(plain, by_frame)

    def reject(self, node: TreeNode, what: str, **parts: str | None) -> T:
        """Add a problem with a value that is not of this type, as `TreeNode.reject` does, and return INVALID."""
        invalid: T = node.expecting(self.expected).reject(what, **parts)
        return invalid


FieldTable = Mapping[str, FieldType[Any]]


def any_of(*schemas: JsonSchema) -> JsonSchema:
    """Return the JSON Schema of a value that fits one of several schemas."""
    parts = [part for each in schemas for part in (each["anyOf"] if each.keys() == {"anyOf"} else [each])]
    return {"anyOf": parts} if len(parts) > 1 else parts[0]


def either(*fields: FieldType[Any]) -> Callable[[bool], JsonSchema]:
    """Return the `plain_schema` of a value that is of one of several types."""
    return lambda moves: any_of(*(each.plain_schema(moves) for each in fields))


def still(field: FieldType[T]) -> FieldType[T]:
    """Return a field type without motions: its values cannot move, neither as a whole nor in part."""
    return replace(
        field,
        parser=lambda node: field.parser(replace(node, film=None)),
        motion=None,
        table=field.table and {key: still(item) for key, item in field.table.items()},
        plain_schema=lambda _moves: field.plain_schema(False),
    )


# Reading of values that move


def _may_be_frame(key: object) -> bool:
    return type(key) is int or (isinstance(key, str) and _FRAME.fullmatch(key) is not None)


def _read_motion(field: FieldType[Any], node: TreeNode, film: FilmTime) -> Any:
    """Return the motion that a map from frames to values describes, or its value if the film is read at one frame."""
    assert isinstance(node.value, Mapping) and field.motion is not None
    known = film.motions.get((node.path, id(field)))
    if known is not None and film.at is not None:
        return known[1].at(film.at)
    easing: Any = "linear"
    num_problems = len(node.problems)
    found: list[tuple[Any, Any]] = []
    for key, written in node.value.items():
        if key == "easing":
            place, easing = node.child(key, written), written
            if written not in EASINGS:
                hint = did_you_mean(written, EASINGS)
                easing = place.reject("unknown easing", expected=join_words(EASINGS), hint=hint)
            continue
        if len(node.problems) > num_problems + _MOST_PROBLEMS:
            return INVALID
        frame, item = read_frame(node.key(key, key)), field.read(replace(node.child(key, written), film=None))
        check_frames_ascend(node.key(key), found[-1][0] if found else -1, frame)
        if len(node.problems) == num_problems and found and shape_of(item) != shape_of(found[0][1]):
            place, expected = node.child(key, written), "a value of the same kind as at the first frame"
            place.reject("cannot move to a value of another kind", expected=expected)
        found.append((frame, item))
    frames, values = zip(*found, strict=True) if found else ((), ())
    film.keys.update(frame for frame in frames if frame is not INVALID)
    if INVALID in (*frames, *values, easing) or len(node.problems) > num_problems:
        return INVALID
    motion = Motion(frames, values, easing, field.motion)
    if motion.kind == "ratio":
        _check_ratios(node, motion)
    elif motion.kind == "linear" and isinstance(values[0], tuple) and film.at is None:
        _check_between_keys(field, node, motion)
    if len(node.problems) == num_problems:
        film.motions[node.path, id(field)] = field, motion
    return moving(motion) if film.at is None else motion.at(film.at)


def _check_between_keys(field: FieldType[Any], node: TreeNode, motion: Motion[Any]) -> None:
    """Check a list or a matrix that moves at frames between its keys, where a matrix may have no inverse."""
    if any(True for part in motion.values[0] if not isinstance(part, (int, float, tuple))):
        return
    first, last = motion.frames[0], motion.frames[-1]
    for frame in range(first, last, max(1, (last - first) // _MOST_BETWEEN)):
        problems: list[Problem] = []
        field.parser(replace(node, value=motion.at(frame), problems=problems, film=None, expected=field.expected))
        if problems:
            node.problems.append(replace(problems[0], path=node.path, what=f"at frame {frame}: {problems[0].what}"))
            return


def read_frame(node: TreeNode) -> Any:
    """Return the number of a frame, which may be counted from the end, or given in seconds."""
    assert node.film is not None
    film = node.film
    num_frames, text = film.num_frames or MAX_FRAMES, format_value(node.value).strip("'")
    if not isinstance(node.value, (int, str)) or not _FRAME.fullmatch(text):
        expected = "a frame, -1 for the last one, seconds such as 2.5s, or easing"
        return node.reject("not a frame", expected=expected)
    if text.endswith("s"):
        seconds, end = float(text[:-1]), num_frames / film.frames_per_second
        if seconds > end:
            return node.reject("after the end of the film", expected=f"at most {end:.4g}s")
        return min(round(seconds * film.frames_per_second), num_frames - 1)
    frame = int(text) + num_frames * (int(text) < 0)
    if frame < 0:
        return node.reject("before the first frame", expected=f"a frame from {-num_frames} to {num_frames - 1}")
    check_frame_in_path(node, frame, film.num_frames)
    return frame


def check_frame_in_path(node: TreeNode, frame: object, num_frames: object) -> None:
    """Check that a frame, at `node`, is before the end of the path; INVALID numbers are skipped."""
    if isinstance(frame, int) and isinstance(num_frames, int) and frame >= num_frames:
        node.reject("after the last frame", got=str(frame), expected=f"a frame from 0 to {num_frames - 1}")


def check_frames_ascend(node: TreeNode, before: object, frame: object) -> bool:
    """Check that a frame, at `node`, comes after the frame `before`; INVALID numbers are skipped."""
    ascends = not isinstance(frame, int) or not isinstance(before, int) or frame > before
    if not ascends:
        expected = "frames in ascending order, each once"
        node.reject("frames out of order", got=f"{frame} after {before}", expected=expected)
    return ascends


def _check_ratios(node: TreeNode, motion: Motion[Any]) -> None:
    """Check a motion in even ratios: no number may move to or from 0 over several frames, as 0 has no logarithm."""
    for (start, before), (end, after) in pairwise(zip(motion.frames, motion.values, strict=True)):
        if motion.easing != "hold" and (before == 0) != (after == 0) and end - start > 1:
            step = format_value({start: before, end - 1: before, end: after})
            node.child(start if before == 0 else end).reject(
                "0 in a map from frames, with frames between it and another",
                got=format_value({start: before, end: after}),
                expected="a number greater than 0",
                hint=f"it is interpolated in the logarithm; {step} goes from one to the other at once",
            )
