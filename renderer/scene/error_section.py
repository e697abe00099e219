"""The scene's `error`: a tolerance, or a goal for which a tolerance is found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, Literal

from renderer.scene import schema
from renderer.scene.message_text import format_value, join_words
from renderer.scene.motion import Motion, motion_to_dict
from renderer.scene.schema import INVALID, KeyText, TreeNode

# The smallest tolerance above 0. Float64 holds numbers below 2e-308 with fewer digits, so that tolerances interpolated
# between them would be inexact.
MIN_TOLERANCE = 1e-300

# The largest `finest_level`. A cell of this level is 2^30 voxels wide, wider than any volume.
MAX_LEVEL = 30

# The largest number of cells or bricks that a budget can allow. No volume has as many voxels.
MAX_SPLATS = 10**12

# The smallest time that a budget can allow for a frame, in seconds: no frame takes less.
MIN_SECONDS = 1e-4
# The largest time that a budget can allow for a frame, in seconds: a day.
LONGEST_S = 86400.0

# The highest PSNR that a scene can ask for, in decibels.
MAX_PSNR_DB = 200.0

# The largest number of exact rays that measure the accuracy of a frame. More rays take longer than an exact picture of
# usual size.
MAX_PROBES = 10**6
_NUM_PROBES = schema.integer_field(minimum=0, maximum=MAX_PROBES)
_PROBES = schema.word_or({"auto": None}, _NUM_PROBES, f"auto, or {_NUM_PROBES.expected}")


@dataclass(frozen=True)
class SplatBudget:
    """A goal: each frame is drawn from the finest cut that has at most `value` cells or, for bricks, `value` bricks."""

    value: int | Motion[int]


@dataclass(frozen=True)
class TimeBudget:
    """A goal: each frame shows the finest cut that this machine draws, rounds and encodes within `value` seconds."""

    value: float | Motion[float]


@dataclass(frozen=True)
class MetricTarget:
    """A goal: the value that a metric of accuracy has to reach. It is computed over all pixels of each frame.

    metric: the name of the metric in `renderer.accuracy.METRICS`.
    """

    metric: Literal["psnr", "rmse", "ssim", "flip"]
    value: float

    def __str__(self) -> str:
        return self.format(self.value)

    def format(self, value: float) -> str:
        """Return a value of this metric as text, with name and unit."""
        return f"{self.metric} {value:.2f} dB" if self.metric == "psnr" else f"{self.metric} {value:.4g}"

    def margin(self, value: float) -> float:
        """Return how much better than the target a value is; negative if it is worse, -inf for NaN."""
        margin = value - self.value if self.metric in ("psnr", "ssim") else self.value - value
        return -math.inf if math.isnan(margin) else margin


@dataclass(frozen=True)
class ErrorSpec:
    """The accuracy of a film: a tolerance, or a `goal` for which a tolerance is found.

    goal: a budget or a target. A `MetricTarget` asks for the largest tolerance with which the film reaches it.
    finest_level: no cells smaller than `2^finest_level` voxels are drawn, whatever their error.
    probes: the number of exact rays that measure the accuracy of each frame; None chooses it by the picture's size.
    """

    tolerance: float | Motion[float] = 0.1
    measure: Annotated[
        Literal["optical", "rms"],
        KeyText("`optical`: errors are shares of a pixel that a cell can change. `rms`: the paper's root mean square."),
    ] = "optical"
    of: Annotated[
        Literal["classified", "scalar"],
        KeyText("With `rms`: whether errors are of the classified values or of the scalar."),
    ] = "classified"
    finest_level: Annotated[
        int,
        schema.integer_field(minimum=0, maximum=MAX_LEVEL),
        KeyText("The level of the smallest cells: at 3 they are 8 x 8 x 8 voxels."),
    ] = 0
    probes: Annotated[
        int | None,
        _PROBES,
        KeyText(
            "The number of pixels whose exact rays measure the accuracy of a frame. `auto`: one of 16384 pixels, at "
            "least 16; with `light` half of them; and at least 512 in all frames of the path. 0: it is not measured."
        ),
    ] = None
    goal: SplatBudget | TimeBudget | MetricTarget | None = None

    def written(self) -> dict[str, object]:
        """Return the keys of the section with their values: first the key that sets the accuracy, then all others."""
        others = {key: value for key, value in vars(self).items() if key not in ("tolerance", "goal")}
        return schedule_to_dict(self) | others


def schedule_to_dict(error: ErrorSpec) -> dict[str, object]:
    """Return the key of the `error` section that sets the accuracy, with its value."""
    key = {SplatBudget: "splats", TimeBudget: "seconds"}.get(type(error.goal), "tolerance")
    if isinstance(error.goal, MetricTarget):
        key = error.goal.metric
    value = error.tolerance if error.goal is None else error.goal.value
    return {key: motion_to_dict(value, plain=lambda each: each) if isinstance(value, Motion) else value}


def _parse_number(node: TreeNode) -> Any:
    value = _NOT_NEGATIVE.parser(node)
    if value is INVALID or value == 0 or value >= MIN_TOLERANCE:
        return value
    return node.reject("out of range", expected=f"0, or a number of at least {format_value(MIN_TOLERANCE)}")


def _tolerance_schema(_moves: bool) -> schema.JsonSchema:
    zero = {"const": 0, "errorMessage": f"expected 0, or a number of at least {format_value(MIN_TOLERANCE)}"}
    return schema.any_of(zero, {"type": "number", "minimum": MIN_TOLERANCE})


_NOT_NEGATIVE = schema.number_field(minimum=0)
TOLERANCE_FIELD: schema.FieldType[Any] = schema.FieldType(
    _NOT_NEGATIVE.expected, _parse_number, motion="ratio", plain_schema=_tolerance_schema
)
_SPLATS_HINT = "1 is the whole volume as one splat; tolerance: 0 has no limit"
_SECONDS_HINT = "it is the time for each frame; the quickest is splats: 1"
_PSNR_HINT = "it is in decibels, the more the better: at 30 flaws are seen, at 40 hardly any"
_RMSE_HINT = "nothing is as exact as that; tolerance: 0 draws every voxel"

# The keys that set the accuracy, with their types. An `error` section has at most one of them.
_SCHEDULES: dict[str, schema.FieldType[Any]] = {
    "tolerance": schema.described(
        TOLERANCE_FIELD,
        "The error below which cells are drawn as one; 0 draws every visible voxel.",
        default=ErrorSpec.tolerance,
    ),
    "splats": schema.described(
        schema.integer_field(minimum=1, maximum=MAX_SPLATS, zero_hint=_SPLATS_HINT, motion="ratio"),
        "In place of `tolerance`: the largest number of bricks in a frame, or of splats.",
        example="200",
    ),
    "seconds": schema.described(
        schema.number_field(minimum=MIN_SECONDS, maximum=LONGEST_S, zero_hint=_SECONDS_HINT, motion="ratio"),
        "In place of `tolerance`: the time for each frame on this machine.",
        example="0.5",
    ),
    "psnr": schema.described(
        schema.number_field(above=0, maximum=MAX_PSNR_DB, zero_hint=_PSNR_HINT, motion=None),
        "In place of `tolerance`: the PSNR of the frames before encoding, against exact pictures, in dB.",
        example="40",
    ),
    "rmse": schema.described(
        schema.number_field(above=0, maximum=1, zero_hint=_RMSE_HINT, motion=None),
        "In place of `tolerance`: the root mean square difference of the frames before encoding from exact pictures.",
        example="0.01",
    ),
}
# The goal that each key of _SCHEDULES stands for. The key `tolerance` stands for no goal.
_GOALS: dict[str, Any] = {
    "splats": SplatBudget,
    "seconds": TimeBudget,
    "psnr": partial(MetricTarget, "psnr"),
    "rmse": partial(MetricTarget, "rmse"),
}


def _build_error(node: TreeNode, given: dict[str, Any]) -> ErrorSpec:
    if given.get("of") == "scalar" and given.get("measure", ErrorSpec.measure) == "optical":
        hint = "the error of the scalar needs measure: rms"
        node.child("of", "scalar").reject("contradicts measure: optical", expected="classified", hint=hint)
    written = node.value if isinstance(node.value, Mapping) else {}
    schedules = [key for key in given if key in _SCHEDULES and key in written]  # `given` also has misspelt keys
    for other in schedules[1:]:
        node.key(other).reject(
            f"a second schedule beside {schedules[0]}",
            expected=f"one of {join_words(_SCHEDULES)}",
            hint=f"leave one out, as --set error.{schedules[0]}=null does",
        )
    rest = {key: value for key, value in given.items() if key not in _SCHEDULES}
    for name in schedules[:1]:
        rest |= {"goal": _GOALS[name](given[name])} if name in _GOALS else {name: given[name]}
    return ErrorSpec(**rest)


ERROR_SECTION = schema.section_field(
    _SCHEDULES | schema.field_table(ErrorSpec), _build_error, alternatives=schema.Alternatives([_SCHEDULES])
)
