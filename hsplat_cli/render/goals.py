"""From what a scene asks for (splats, seconds, an accuracy) to the tolerances that give it; and was it met?"""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from hsplat_cli.render.record import IN_TIME, Record, frame_seconds, span
from renderer.drawing import Rasterizer, Stage
from renderer.errors import RenderError
from renderer.pacing import Details, Guide, Pacer, try_drawings
from renderer.scene import SplatBudget, TimeBudget
from renderer.schedule import at_tolerances, value_at

# A trial drawing that takes this part of a frame's time tells enough about the whole.
_ENOUGH = 0.3
BEST_EFFORT = "with --best-effort it is good enough"


@dataclass(frozen=True)
class Plan:
    """How frames get their tolerances: from the schedule of the stage's scene, whose goal is resolved, or from a guide.

    shortfall: what was asked for and cannot be had; what is drawn then is the best there is.
    by_clock: the tolerances depend on how quick this machine was.
    """

    stage: Stage
    guide: Guide | None = None
    shortfall: RenderError | None = None
    by_clock: bool = False


def make_plan(details: Details, frames: Sequence[int], rasterizer: Rasterizer, *, quiet: bool) -> Plan:
    """Find what the goal of the scene takes, if it has one."""
    stage = details.stage
    goal = stage.scene.error.goal
    if goal is None:
        return Plan(stage)
    if isinstance(goal, SplatBudget):
        tolerances = {frame: details.tolerance(value_at(goal.by_frame, frame)) for frame in frames}
        return Plan(replace(stage, scene=at_tolerances(stage.scene, tolerances)))
    if isinstance(goal, TimeBudget):
        least = min(value_at(goal.by_frame, frame) for frame in frames)
        try_drawings(details, frames[0], _ENOUGH * least, rasterizer, clock=time.perf_counter)
        return Plan(stage, Pacer(details, lambda frame: value_at(goal.by_frame, frame)), by_clock=True)
    raise NotImplementedError


def shortfall_of(plan: Plan, frames: Sequence[Record]) -> RenderError | None:
    """What was asked for and not had, now that the frames are there."""
    goal = plan.stage.scene.error.goal
    if plan.shortfall is None and isinstance(goal, TimeBudget):
        return _time_shortfall(goal, frames)
    return plan.shortfall


def _time_shortfall(goal: TimeBudget, frames: Sequence[Record]) -> RenderError | None:
    shares = [frame_seconds(frame) / value_at(goal.by_frame, frame["frame"]) for frame in frames]
    if statistics.median(shares) <= 1 + IN_TIME:
        return None
    taken = statistics.median(map(frame_seconds, frames))
    return RenderError(
        "the frames took longer than they had",
        where="error.seconds",
        got=f"{taken:.3g} s a frame in the median, at tolerance {span([frame['tolerance'] for frame in frames])}",
        expected=f"{span([seconds for _, seconds in goal.by_frame])} s",
        hint=f"a smaller output.size is drawn sooner; {BEST_EFFORT}",
    )
