"""The scene's `error`: how exact, as a tolerance or as what a tolerance is to be found for."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from renderer.scene import AccuracyGoal, ByFrame, ErrorSpec, SplatBudget, TimeBudget
from renderer.schema import INVALID, Kind, Node, choice, integer, listed, number, section, show
from renderer.schema_camera import MAX_FRAMES

# Cells of this level would be wider than any volume is long: indices of voxels along an axis are int32.
MAX_LEVEL = 30

# Beyond these no error of a node lies, so that they are as good as 0 and as infinity.
LEAST_TOLERANCE, LARGEST_TOLERANCE = 1e-300, 1e300

# More cells than any volume has voxels.
MOST_SPLATS = 2**40

# A frame takes longer than the one and should not take longer than the other, a day.
SHORTEST_S, LONGEST_S = 1e-4, 86400.0

MOST_PSNR_DB = 200.0

_FRAME = integer(least=0, most=MAX_FRAMES - 1)


def _by_frame(value: Kind[Any], at_frame: Kind[Any], expected: str) -> Kind[ByFrame]:
    """A constant, or values by frame in ascending order."""

    def parse(node: Node) -> ByFrame:
        if not isinstance(node.value, Mapping):
            return ((0, value.read(node)),)
        if not node.value:
            return kind.refuse(node, "empty")
        found: list[tuple[int, float]] = []
        for key, item in node.value.items():
            frame = _FRAME.read(node.key(key))  # text, too: JSON has no other keys
            if frame is not INVALID and found:
                _require_later(node.key(key), frame, found[-1][0])
            at = at_frame.read(node.child(key, item))
            if frame is not INVALID:
                found.append((frame, at))
        return tuple(found) or INVALID

    kind: Kind[ByFrame] = Kind(expected, parse)
    return kind


def _require_later(key: Node, frame: int, before: int) -> None:
    if frame == before:
        key.complain("the same frame twice", got=show(frame))
    elif frame < before:
        key.complain("frames out of order", got=f"{frame} after {before}", expected="frames in ascending order")


def _parse_tolerance(node: Node) -> ByFrame:
    by_frame = _TOLERANCES.read(node)
    if isinstance(node.value, Mapping) and by_frame is not INVALID:
        for (start, before), (end, after) in pairwise(by_frame):
            if INVALID not in (before, after) and (before == 0) != (after == 0) and end - start > 1:
                node.child(start if before == 0 else end).complain(
                    "0 in a tolerance by frame, with frames between it and another",
                    got=show({start: before, end: after}),
                    expected="a number greater than 0",
                    hint="it is interpolated in the logarithm; 0 draws every voxel where the next frame has an entry",
                )
    return by_frame


def _parse_tolerance_at_frame(node: Node) -> float:
    value = _CONSTANT.read(node)
    if value is not INVALID and 0 < value < LEAST_TOLERANCE:
        return _AT_FRAME.refuse(node, "out of range", got=show(node.value))
    return value


_CONSTANT = number(least=0, most=LARGEST_TOLERANCE)
_AT_FRAME: Kind[float] = Kind(
    f"0, or a number from {show(LEAST_TOLERANCE)} to {show(LARGEST_TOLERANCE)}", _parse_tolerance_at_frame
)
_TOLERANCE_WORDS = "a number of at least 0, or numbers by frame, such as {0: 0.5, 60: 0.02}"
_TOLERANCES = _by_frame(_CONSTANT, _AT_FRAME, _TOLERANCE_WORDS)
_NUM_SPLATS = integer(least=1, most=MOST_SPLATS)
_SECONDS = number(least=SHORTEST_S, most=LONGEST_S)

# What an `error` may have one of.
_SCHEDULES: dict[str, Kind[Any]] = {
    "tolerance": Kind(_TOLERANCE_WORDS, _parse_tolerance),
    "splats": _by_frame(_NUM_SPLATS, _NUM_SPLATS, f"{_NUM_SPLATS.expected}, or such numbers by frame"),
    "seconds": _by_frame(_SECONDS, _SECONDS, f"{_SECONDS.expected}, or such numbers by frame"),
    "psnr": number(above=0, most=MOST_PSNR_DB),
    "rmse": number(above=0, most=1),
}


def _build_error(node: Node, given: dict[str, Any]) -> ErrorSpec:
    if given.get("of") == "scalar" and given.get("measure", ErrorSpec.measure) == "optical":
        node.child("of").complain(
            "contradicts measure: optical",
            got=show("scalar"),
            expected="classified",
            hint="the error of the scalar needs measure: rms",
        )
    schedules = [key for key in given if key in _SCHEDULES]
    for other in schedules[1:]:
        node.key(other).complain(
            f"a second schedule beside {schedules[0]}",
            expected=f"one of {listed(_SCHEDULES)}",
            hint=f"--set error.{schedules[0]}=null takes the other one away",
        )
    rest = {key: value for key, value in given.items() if key not in _SCHEDULES}
    return ErrorSpec(**rest, **_schedule(given, *schedules[:1]))


def _schedule(given: dict[str, Any], name: str = "") -> dict[str, Any]:
    """What ErrorSpec holds of the schedule of that name."""
    if name in ("", "tolerance"):
        return {"tolerance": given[name]} if name else {}
    value = given[name]
    if name in ("psnr", "rmse"):
        return {"goal": AccuracyGoal(name, value)}  # type: ignore[arg-type]
    return {"goal": SplatBudget(value) if name == "splats" else TimeBudget(value)}


ERROR = section(
    _SCHEDULES
    | {
        "measure": choice("optical", "rms"),
        "of": choice("classified", "scalar"),
        "finest_level": integer(least=0, most=MAX_LEVEL),
    },
    _build_error,
)


def check_frames(node: Node, given: Mapping[str, Any]) -> None:
    """Complain about scheduled frames that the camera's path does not have; `given` is of the whole scene."""
    num_frames = getattr(getattr(given["camera"], "path", None), "frames", None)
    error = given.get("error")
    if not isinstance(num_frames, int) or not isinstance(error, ErrorSpec):
        return
    name = {SplatBudget: "splats", TimeBudget: "seconds"}.get(type(error.goal), "tolerance")
    by_frame = getattr(error.goal, "by_frame", error.tolerance)
    for frame, _ in by_frame if isinstance(by_frame, tuple) else ():
        if frame >= num_frames:
            node.child(name).key(frame).complain(
                "after the last frame", got=show(frame), expected=f"a frame from 0 to {num_frames - 1}"
            )
