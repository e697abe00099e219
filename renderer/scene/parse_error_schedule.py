"""Parse the scene's `error`: a tolerance, or a goal that determines it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

from renderer.scene import schema
from renderer.scene.message_text import format_value, join_words
from renderer.scene.parse_camera import FRAME_NUMBER_FIELD, check_frame_in_path
from renderer.scene.schema import INVALID, TreeNode
from renderer.scene.spec import MIN_TOLERANCE, AccuracyGoal, ByFrame, ErrorSpec, SplatBudget, TimeBudget

# Cells of this level are wider than any volume: voxel indices along an axis are int32.
MAX_LEVEL = 30

# More cells than any volume has voxels.
MAX_SPLATS = 10**12

# A frame takes longer than the first; the second is a day.
MIN_SECONDS, LONGEST_S = 1e-4, 86400.0

MAX_PSNR_DB = 200.0


def _by_frame(
    value: schema.FieldType[Any], example: str, at_frame: schema.FieldType[Any] | None = None
) -> schema.FieldType[ByFrame]:
    """Return the type of a constant, or of values by frame in ascending order."""
    item = at_frame or value

    def parse(node: TreeNode) -> ByFrame:
        if not isinstance(node.value, Mapping):
            return ((0, value.read(node)),)
        if not node.value:
            return field.reject(node, "empty", got="")
        found: list[tuple[int, float]] = []
        for key, written in node.value.items():
            frame = FRAME_NUMBER_FIELD.read(node.key(key))  # text, too: JSON has no other keys
            at = item.read(node.child(key, written))
            if frame is not INVALID:
                _require_ascending(node.key(key), frame, found)
                found.append((frame, at))
        return tuple(found) or INVALID

    field = schema.FieldType(f"{value.expected}, or by frame, such as {example}", parse)
    return field


def _require_ascending(key: TreeNode, frame: int, found: list[tuple[int, float]]) -> None:
    last = found[-1][0] if found else -1
    if frame == last:
        key.add_problem("the same frame twice", got=format_value(frame))
    elif frame < last:
        key.add_problem("frames out of order", got=f"{frame} after {last}", expected="frames in ascending order")


def _not_zero(kind: schema.FieldType[Any], what: str, hint: str) -> schema.FieldType[Any]:
    """Return the same type without 0, with a hint for 0."""

    def parse(node: TreeNode) -> Any:
        if node.value == 0 and node.value is not False:
            return kind.reject(node, what, hint=hint)
        return kind.parse(node)

    return replace(kind, parse=parse)


def _parse_tolerance(node: TreeNode) -> ByFrame:
    by_frame = _TOLERANCES.read(node)
    if isinstance(node.value, Mapping) and by_frame is not INVALID:
        for (start, before), (end, after) in pairwise(by_frame):
            if INVALID not in (before, after) and (before == 0) != (after == 0) and end - start > 1:
                node.child(start if before == 0 else end).add_problem(
                    "0 in a tolerance by frame, with frames between it and another",
                    got=format_value({start: before, end: after}),
                    expected="a number greater than 0",
                    hint="it is interpolated in the logarithm; "
                    f"{format_value({start: before, end - 1: before, end: after})} goes from one to the other at once",
                )
    return by_frame


def _parse_tolerance_at_frame(node: TreeNode) -> float:
    value = _TOLERANCE.read(node)
    if value is not INVALID and 0 < value < MIN_TOLERANCE:
        return _AT_FRAME.reject(node, "out of range")
    return value


_TOLERANCE = schema.number_field(minimum=0)
_AT_FRAME = schema.FieldType(f"0, or a number of at least {format_value(MIN_TOLERANCE)}", _parse_tolerance_at_frame)
_TOLERANCES = _by_frame(_TOLERANCE, "{0: 0.5, 60: 0.02}", _AT_FRAME)
_NUM_SPLATS = _not_zero(
    schema.integer_field(minimum=1, maximum=MAX_SPLATS),
    "a budget of 0",
    "1 is the whole volume as one splat; tolerance: 0 has no limit",
)
_SECONDS = _not_zero(
    schema.number_field(minimum=MIN_SECONDS, maximum=LONGEST_S),
    "a budget of 0",
    "it is the time for each frame; the quickest is splats: 1",
)

# An `error` has one of these keys.
_SCHEDULES: dict[str, schema.FieldType[Any]] = {
    "tolerance": replace(_TOLERANCES, parse=_parse_tolerance),
    "splats": _by_frame(_NUM_SPLATS, "{0: 1000, 60: 100000}"),
    "seconds": _by_frame(_SECONDS, "{0: 0.1, 60: 2}"),
    "psnr": _not_zero(
        schema.number_field(above=0, maximum=MAX_PSNR_DB),
        "an accuracy of 0",
        "it is in decibels, the more the better: at 30 flaws are seen, at 40 hardly any",
    ),
    "rmse": _not_zero(
        schema.number_field(above=0, maximum=1),
        "an accuracy of 0",
        "nothing is as exact as that; tolerance: 0 draws every voxel",
    ),
}


def _build_error(node: TreeNode, given: dict[str, Any]) -> ErrorSpec:
    if given.get("of") == "scalar" and given.get("measure", ErrorSpec.measure) == "optical":
        node.child("of").add_problem(
            "contradicts measure: optical",
            got=format_value("scalar"),
            expected="classified",
            hint="the error of the scalar needs measure: rms",
        )
    written = node.value if isinstance(node.value, Mapping) else {}
    schedules = [key for key in given if key in _SCHEDULES and key in written]  # misspelt ones are given, too
    for other in schedules[1:]:
        node.key(other).add_problem(
            f"a second schedule beside {schedules[0]}",
            expected=f"one of {join_words(_SCHEDULES)}",
            hint=f"leave one out, as --set error.{schedules[0]}=null does",
        )
    rest = {key: value for key, value in given.items() if key not in _SCHEDULES}
    return ErrorSpec(**rest, **_schedule(given, *schedules[:1]))


def _schedule(given: dict[str, Any], name: str = "") -> dict[str, Any]:
    """Return the fields of ErrorSpec for the schedule of that name."""
    if name in ("", "tolerance"):
        return {"tolerance": given[name]} if name else {}
    value = given[name]
    if name in ("psnr", "rmse"):
        return {"goal": AccuracyGoal(name, value)}  # type: ignore[arg-type]
    return {"goal": SplatBudget(value) if name == "splats" else TimeBudget(value)}


ERROR_SECTION = schema.section_field(
    _SCHEDULES
    | {
        "measure": schema.choice_field("optical", "rms"),
        "of": schema.choice_field("classified", "scalar"),
        "finest_level": schema.integer_field(minimum=0, maximum=MAX_LEVEL),
    },
    _build_error,
)


def check_scheduled_frames(node: TreeNode, given: Mapping[str, Any]) -> None:
    """Check that the camera's path has all scheduled frames; `given` holds the sections of the whole scene."""
    num_frames = getattr(getattr(given["camera"], "path", None), "frames", None)
    error = given.get("error")
    if not isinstance(error, ErrorSpec):
        return
    name = {SplatBudget: "splats", TimeBudget: "seconds"}.get(type(error.goal), "tolerance")
    by_frame = getattr(error.goal, "by_frame", error.tolerance)
    for frame, _ in by_frame if isinstance(by_frame, tuple) else ():
        check_frame_in_path(node.child(name).key(frame), frame, num_frames)
