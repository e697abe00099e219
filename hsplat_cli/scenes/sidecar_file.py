"""Reads a sidecar, the JSON file beside a film, to make the film again.

Anybody may have changed it, so everything that is used of it is checked.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from renderer.errors import InputError, Problem, SceneError
from renderer.scene import (
    ERROR_SECTION,
    FRAME_NUMBER_FIELD,
    INVALID,
    MAPPING_FIELD,
    MAX_FRAMES,
    MAX_SIDECAR_BYTES,
    TEXT_FIELD,
    ErrorSpec,
    FieldTable,
    FieldType,
    TextPosition,
    TreeNode,
    check_frames_ascend,
    decode_utf8,
    format_value,
    join_keys,
    may_be_json,
    read_fields,
    with_excerpt,
)

# The keys of `schedule` that each film has of its own, whatever it was made from.
_OWN_SCHEDULE_KEYS = ("asked", "tolerance", "cells", "made_from")


@dataclass(frozen=True)
class Sidecar:
    """What a sidecar records of its film.

    path: of the sidecar. scene: as plain data, not checked. frames: their numbers, ascending. tolerances: at which
    these frames were drawn, not checked. fingerprint: of the film's volume. requested_error: the accuracy asked for, as
    a section `error`. other_schedule_keys: what else its `schedule` says, but for what each film has of its own.
    tool_versions: of what made it, by name, OpenGL as `GL` and the digest of the sources as `sources`.
    frames_fingerprint: of what its frames depended on; None for a film that one pass would not have made. problems:
    what is wrong with the sidecar; if there are any, only path and scene may be used.
    """

    path: Path
    scene: dict[str, Any]
    frames: tuple[int, ...]
    tolerances: tuple[Any, ...]
    fingerprint: str
    requested_error: ErrorSpec
    other_schedule_keys: Mapping[str, Any]
    tool_versions: Mapping[str, Any]
    frames_fingerprint: str | None
    problems: tuple[Problem, ...]


def parse_sidecar(content: bytes, path: Path) -> Sidecar | None:
    """Return the sidecar in the content of a file; None for what is not an object with the key `scene`.

    Raises InputError, or SceneError with all problems, where it has no scene.
    """
    if not may_be_json(content):
        return None
    is_sidecar = _SIDECAR_START.match(content) is not None
    if len(content) > MAX_SIDECAR_BYTES:
        raise InputError("too large for a sidecar", where=str(path), expected=f"at most {MAX_SIDECAR_BYTES} bytes")
    try:
        data = load_json_object(decode_utf8(content, path), path)
    except InputError:
        if is_sidecar:
            raise
        return None  # the YAML parser accepts more, and tells the line
    return _read(data, path) if "scene" in data else None


_SIDECAR_START = re.compile(rb'(\xef\xbb\xbf)?\s*\{\s*"scene"\s*:')


# JSON


def load_json_object(text: str, path: Path, *, kind: str = "a sidecar") -> dict[str, Any]:
    """Return the object in a text that begins with a brace.

    Refuses NaN, infinities and duplicate keys, which Python's parser accepts. kind: of the file, for messages.
    Raises InputError, or SceneError with all that is refused.
    """
    refused: list[Problem] = []

    def refuse(what: str, got: str | None = None, key: str = "") -> Problem:
        """Return what stands for a value in the data, until its path is known."""
        refused.append(Problem(key, what, got=got))
        return refused[-1]

    def make_object(pairs: list[tuple[str, Any]]) -> dict[str, Any] | Problem:
        found = dict(pairs)
        if len(found) == len(pairs):
            return found
        ordered = sorted(key for key, _ in pairs)
        return refuse("the same key twice", key=next(key for key, other in pairwise(ordered) if key == other))

    def make_float(digits: str) -> float | Problem:
        number = float(digits)
        return refuse("not a finite number", got=format_value(digits)) if math.isinf(number) else number

    def make_integer(digits: str) -> int | float | Problem:
        return int(digits) if len(digits) < _MOST_DIGITS else make_float(digits)

    try:
        data = json.loads(
            text,
            object_pairs_hook=make_object,
            parse_float=make_float,
            parse_int=make_integer,
            parse_constant=lambda name: refuse("not a finite number", got=name),
        )
    except json.JSONDecodeError as error:
        begin, end = text.rfind("\n", 0, error.pos) + 1, text.find("\n", error.pos)
        line = text[begin : end if end >= 0 else None]
        raise InputError(
            with_excerpt("not valid JSON", [line], TextPosition(1, error.colno)),
            where=f"{path}:{error.lineno}:{error.colno}",
            hint=f"{kind} is written as a whole: this one was cut off, or changed since",
        ) from error
    except RecursionError as error:
        raise InputError("not valid JSON: too many levels", where=str(path)) from error
    if refused:
        raise SceneError([replace(problem, location=str(path)) for problem in _problems_in(data)])
    assert isinstance(data, dict), "it begins with a brace"
    return data


_MOST_DIGITS = 300  # integers of fewer digits are finite as float64, too


def _problems_in(data: object) -> Iterator[Problem]:
    """Yield what was refused, in the order of the file; not recursive, for any number of levels."""
    stack: list[tuple[str, object]] = [("", data)]
    while stack:
        path, item = stack.pop()
        if isinstance(item, Problem):
            yield replace(item, path=join_keys(path, item.path) if item.path else path)
        elif isinstance(item, dict):
            stack += [(join_keys(path, key), value) for key, value in reversed(item.items())]
        elif isinstance(item, list):
            stack += [(join_keys(path, index), value) for index, value in reversed(list(enumerate(item)))]


# What it says


def _read(data: dict[str, Any], path: Path) -> Sidecar:
    problems: list[Problem] = []
    given = read_known_fields(TreeNode(data, "", problems), _TABLE, required=_TABLE)
    if given["scene"] is INVALID:
        raise SceneError([replace(problem, location=str(path)) for problem in problems])
    if problems:
        given |= {"gl": "", "volume": "", "versions": {}, "schedule": {"asked": None}, "frames": ()}
    schedule, sources = given["schedule"], text_at(data, "cause", "of", "sources")
    return Sidecar(
        path=path,
        scene=given["scene"],
        frames=given["frames"],
        tolerances=() if problems else tuple(record.get("tolerance") for record in data["frames"]),
        fingerprint=given["volume"],
        requested_error=schedule["asked"],
        other_schedule_keys={key: value for key, value in schedule.items() if key not in _OWN_SCHEDULE_KEYS},
        tool_versions=given["versions"] | {"GL": given["gl"]} | ({"sources": sources} if sources else {}),
        frames_fingerprint=text_at(data, "cause", "frames"),
        problems=tuple(problems),
    )


def text_at(data: Any, *keys: str) -> str | None:
    """Return the text at nested keys, or None."""
    for key in keys:
        data = data.get(key) if isinstance(data, dict) else None
    return data if isinstance(data, str) else None


def read_known_fields(node: TreeNode, table: FieldTable, *, required: Collection[str] = ()) -> dict[str, Any]:
    """Return the values of these keys of a mapping; others are ignored."""
    if isinstance(node.value, Mapping):
        node = replace(node, value={key: node.value[key] for key in table if key in node.value})
    return read_fields(node, table, required=required)


def _parse_fingerprint(node: TreeNode) -> str:
    if isinstance(node.value, str) and re.fullmatch("[0-9a-f]{32}", node.value):
        return node.value
    return _FINGERPRINT.reject(node, "not a fingerprint")


_FINGERPRINT = FieldType("32 hexadecimal digits", _parse_fingerprint)


def _parse_schedule(node: TreeNode) -> dict[str, Any]:
    """Parse `schedule`, of which the sidecar of the next film gets a copy."""
    schedule = MAPPING_FIELD.parse(node)
    if schedule is not INVALID and not is_shallow(schedule):
        return MAPPING_FIELD.reject(node, "too many levels", got="", expected=f"at most {_MOST_LEVELS}")
    return (
        schedule
        if schedule is INVALID
        else schedule | read_known_fields(node, {"asked": ERROR_SECTION}, required=["asked"])
    )


_MOST_LEVELS = 10


def is_shallow(value: object, num_levels: int = _MOST_LEVELS) -> bool:
    """Return whether plain data has at most this number of levels, as data that is copied unchecked must."""
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return num_levels >= 0 and all(is_shallow(item, num_levels - 1) for item in items)


def _parse_frames(node: TreeNode) -> tuple[int, ...]:
    """Parse the numbers of the frames; report the first wrong record alone: others may have the same mistake."""
    if not isinstance(node.value, list) or not node.value:
        return _FRAMES.reject(node, "empty" if node.value == [] else "not a list")
    found: list[int] = []
    wrong: tuple[int, ...] = INVALID
    for index, record in enumerate(node.value):
        frame = record.get("frame") if isinstance(record, dict) else None
        if type(frame) is not int or not 0 <= frame < MAX_FRAMES:  # the slow way tells what is wrong
            fields = {"frame": FRAME_NUMBER_FIELD}
            frame = read_known_fields(node.child(index, record), fields, required=fields)["frame"]
        if frame is INVALID:
            return wrong
        if found and not check_frames_ascend(node.child(index).child("frame"), found[-1], frame):
            return wrong
        found.append(frame)
    return tuple(found)


_FRAMES = FieldType("the records of the frames, each with its number as frame", _parse_frames)

_TABLE: FieldTable = {
    "scene": MAPPING_FIELD,
    "volume": FieldType(
        "a mapping with fingerprint",
        lambda node: read_known_fields(node, {"fingerprint": _FINGERPRINT}, required=["fingerprint"])["fingerprint"],
    ),
    "gl": TEXT_FIELD,
    "versions": MAPPING_FIELD,
    "schedule": FieldType("a mapping", _parse_schedule),
    "frames": _FRAMES,
}
