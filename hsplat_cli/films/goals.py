"""From what a scene asks for (splats, seconds, an accuracy) to the tolerances that give it; and was it met?"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from hsplat_cli.films.sidecar_record import TIME_BUDGET_MARGIN, budget_seconds, drawing_seconds, span
from hsplat_cli.scenes import FilmPlan, Job
from renderer.errors import RenderError
from renderer.film import Record
from renderer.frame import BudgetController, LODCostEstimator, Rasterizer, Stage, Stopwatch, calibrate_costs, upload
from renderer.scene import AccuracyGoal, SplatBudget, TimeBudget, Want, show, value_at, with_tolerance, with_tolerances

# A trial drawing that takes this part of a frame's time tells enough about the whole.
_MAX_TRIAL_FRACTION = 0.3
# Frames that may be late without a word.
MAX_LATE_FRACTION = 0.1
BEST_EFFORT_HINT = "with --best-effort it is good enough"


def make_plan(
    estimator: LODCostEstimator,
    frames: Sequence[int],
    rasterizer: Rasterizer | None,
    *,
    quiet: bool,
    on_step: Callable[[], None] = lambda: None,
) -> FilmPlan:
    """Find what the goal of the scene takes, if it has one.

    rasterizer: for goals of accuracy and of time.
    on_step: called now and then in a long search; what it raises goes through.
    """
    stage = estimator.stage
    goal = stage.scene.error.goal
    if goal is None:
        return FilmPlan(stage)
    if isinstance(goal, AccuracyGoal):
        assert rasterizer is not None
        return _plan_accuracy(stage, goal, frames, rasterizer, on_step, quiet=quiet)
    if isinstance(goal, SplatBudget):
        tolerances = {
            frame: estimator.primitive.tolerance_for_cells(value_at(goal.by_frame, frame)) for frame in frames
        }
        return FilmPlan(replace(stage, scene=with_tolerances(stage.scene, tolerances)))
    assert rasterizer is not None
    least = min(value_at(goal.by_frame, frame) for frame in frames)
    calibrate_costs(
        estimator, frames[0], _MAX_TRIAL_FRACTION * least, rasterizer, clock=time.perf_counter, on_step=on_step
    )
    pacer = BudgetController(estimator, lambda frame: value_at(goal.by_frame, frame))
    draw_list, _ = pacer.choose(frames[0], Stopwatch(time.perf_counter))
    upload(draw_list, rasterizer)
    return FilmPlan(stage, pacer, is_timing_dependent=True)


def _plan_accuracy(
    stage: Stage,
    goal: AccuracyGoal,
    frames: Sequence[int],
    rasterizer: Rasterizer,
    on_step: Callable[[], None],
    *,
    quiet: bool,
) -> FilmPlan:
    """One tolerance for the whole film; 0 where none is good enough."""
    # Imported where they are used: other films need no ray integral, which takes a while to load.
    from hsplat_cli.films.tolerance_search import search_tolerance, unreachable_accuracy_error
    from renderer.study import TRUTH_TOLERANCE

    want = Want(goal.metric, goal.value)
    found = search_tolerance(stage, frames, want, TRUTH_TOLERANCE, rasterizer, quiet=quiet, on_step=on_step)
    shortfall = None
    if found.tolerance is None:
        hint = f"the film is drawn at tolerance 0, and {BEST_EFFORT_HINT}"
        shortfall = unreachable_accuracy_error(found, stage.scene, where=f"error.{goal.metric}", hint=hint)
    exact = replace(stage, scene=with_tolerance(stage.scene, found.tolerance or 0.0))
    return FilmPlan(exact, shortfall=shortfall, found=found)


def shortfall_of(job: Job, plan: FilmPlan, frames: Sequence[Record]) -> RenderError | None:
    """What was asked for and not had, now that the frames are there."""
    goal = job.scene.error.goal
    if plan.is_unfinished:
        return RenderError(
            "the film was not refined to what the scene asks for",
            where=str(job.scene.output.file),
            got=f"tolerance {span([frame['tolerance'] for frame in frames])}",
            expected=", ".join(f"{name} {show(value)}" for name, value in job.requested_error.items()),
            hint=f"it needs more time; {BEST_EFFORT_HINT}",
        )
    return _time_shortfall(goal, frames) if isinstance(goal, TimeBudget) else plan.shortfall


def _time_shortfall(goal: TimeBudget, frames: Sequence[Record]) -> RenderError | None:
    """Frames that even the quickest cut was too slow for, if they are many; or a machine that became slower."""
    late = [
        frame for frame in frames if frame["predicted_seconds"] > (1 + TIME_BUDGET_MARGIN) * budget_seconds(goal, frame)
    ]
    if len(late) <= MAX_LATE_FRACTION * len(frames):
        shares = [drawing_seconds(frame) / budget_seconds(goal, frame) for frame in frames]
        if statistics.median(shares) <= 1 + TIME_BUDGET_MARGIN:
            return None
        late = list(frames)
    taken = statistics.median(map(drawing_seconds, late))
    which = "the frame" if len(frames) == 1 else f"{len(late)} of {len(frames)} frames"
    return RenderError(
        f"{which} took longer than there was time for",
        where="error.seconds",
        got=f"{taken:.3g} s a frame in the median, at tolerance {span([frame['tolerance'] for frame in late])}",
        expected=f"{span([budget_seconds(goal, frame) for frame in late])} s",
        hint=f"a smaller output.size is drawn sooner; {BEST_EFFORT_HINT}",
    )
