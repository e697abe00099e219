"""Plan the tolerances of a film's frames from the goal of its scene: cells, seconds or an accuracy."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import TYPE_CHECKING

from renderer.draw import Rasterizer
from renderer.errors import RenderError
from renderer.frame import (
    BudgetController,
    FilmStage,
    LODCostEstimator,
    ScheduleController,
    Stopwatch,
    ToleranceController,
    calibrate_costs,
)
from renderer.job.events import JobEvents
from renderer.job.film_job import FilmJob
from renderer.record import (
    BEST_EFFORT_HINT,
    FrameRecord,
    MeasuredRecord,
    ScheduleRecord,
    min_max,
    missed_goal,
    not_refined,
)
from renderer.scene import ErrorSpec, FilmScene, MetricTarget, SplatBudget, TimeBudget, value_at, with_tolerances
from renderer.system import num_cores

if TYPE_CHECKING:  # the ray integral takes a while to load, and most films do not search for an accuracy
    from renderer.accuracy import FoundTolerances, Trial

# Trial drawings become larger until one takes this fraction of the smallest budget of seconds of a frame. A longer
# trial would tell no more.
_MAX_TRIAL_FRACTION = 0.3


@dataclass(frozen=True)
class FilmPlan:
    """A plan of a film: its controller gives each frame its tolerance.

    stage: the stage to draw. If its scene had an accuracy or cells as a goal, it has the tolerances that were found.
    shortfall: the error for a goal that cannot be reached; the film is then drawn as well as possible.
    is_unfinished: whether finer passes follow.
    is_timing_dependent: whether the tolerances depend on the speed of the machine.
    found: the result of the search for an accuracy, if there was one.
    """

    stage: FilmStage
    controller: ToleranceController
    shortfall: RenderError | None = None
    is_unfinished: bool = False
    is_timing_dependent: bool = False
    found: FoundTolerances | None = None


def make_plan(
    estimator: LODCostEstimator,
    frames: Sequence[int],
    rasterizer: Callable[[], Rasterizer],
    events: JobEvents,
    on_step: Callable[[], None] = lambda: None,
) -> FilmPlan:
    """Find the tolerances for the goal of the scene, if it has one. The listener gets a note on each trial of a search.

    rasterizer: a function that opens the rasterizer for trial frames; called for goals of accuracy and of time.
    on_step: called before each trial drawing; an error that it raises ends the search.
    """
    stage = estimator.stage
    goal = stage.scene.error.goal
    if isinstance(goal, MetricTarget):
        found = search_tolerances(stage, frames, goal, rasterizer(), events, on_step)
        return _plan_accuracy(stage, goal, found)
    if isinstance(goal, TimeBudget):
        return _plan_time(estimator, goal, frames, rasterizer(), on_step)
    if isinstance(goal, SplatBudget):
        find = estimator.primitive.tolerance_for_cells
        tolerances = {frame: find(value_at(goal.value, frame)) for frame in frames}
        stage = replace(stage, scene=with_tolerances(stage.scene, tolerances))
    return FilmPlan(stage, ScheduleController(stage))


def _plan_time(
    estimator: LODCostEstimator,
    goal: TimeBudget,
    frames: Sequence[int],
    rasterizer: Rasterizer,
    on_step: Callable[[], None],
) -> FilmPlan:
    """Return the plan for a budget of seconds.

    The costs of drawing are measured by trials, and the first frame is prepared before its time begins.
    """
    least, clock = min(value_at(goal.value, frame) for frame in frames), time.perf_counter
    calibrate_costs(estimator, frames[0], _MAX_TRIAL_FRACTION * least, rasterizer, clock=clock, on_step=on_step)
    controller = BudgetController(estimator, lambda frame: value_at(goal.value, frame))
    draw_list, _ = controller.choose(frames[0], Stopwatch(clock))
    draw_list.upload(rasterizer)
    return FilmPlan(estimator.stage, controller, is_timing_dependent=True)


def search_tolerances(
    stage: FilmStage,
    frames: Sequence[int],
    want: MetricTarget,
    rasterizer: Rasterizer,
    events: JobEvents,
    on_step: Callable[[], None],
) -> FoundTolerances:
    """Search, by exact rays, for the coarsest tolerances at which the frames have this accuracy.

    The listener gets a note on each trial. on_step: called after each trial; an error that it raises ends the search.
    """
    from renderer.accuracy import ExactRays, find_tolerances

    def tell(trial: Trial) -> None:
        on_step()
        events.note(trial.text(want, stage.scene.primitive_name))

    rays = ExactRays(stage, want, num_threads=num_cores())
    # Films of splats have one tolerance: a new cut for each frame would take longer than its drawing.
    is_constant, clock = stage.scene.needs_opengl, time.perf_counter
    return find_tolerances(stage, frames, rays, rasterizer, is_constant=is_constant, clock=clock, on_trial=tell)


def _plan_accuracy(stage: FilmStage, goal: MetricTarget, found: FoundTolerances) -> FilmPlan:
    """Return the plan with the tolerances that were found; they are 0 if no tolerance reaches the accuracy."""
    shortfall = None
    if not found.is_reachable:
        where, hint = f"error.{goal.metric}", f"the film is drawn at tolerance 0, and {BEST_EFFORT_HINT}"
        shortfall = found.shortfall(stage.scene, where=where, hint=hint)
    exact = replace(stage, scene=with_tolerances(stage.scene, found.by_frame))
    return FilmPlan(exact, ScheduleController(exact), shortfall=shortfall, found=found)


def find_shortfall(
    plan: FilmPlan, scene: FilmScene, requested: ErrorSpec, frames: Sequence[FrameRecord]
) -> RenderError | None:
    """Return the error for a film that lacks the requested accuracy; None if it has this accuracy.

    scene: the scene with its goal. The scene of the plan has tolerances in place of the goal.
    """
    if plan.is_unfinished:
        return not_refined(scene.output.file.name, requested, frames)
    return plan.shortfall or missed_goal(scene.error.goal, frames)


def schedule_record(
    plan: FilmPlan, job: FilmJob, frames: Sequence[FrameRecord], shortfall: RenderError | None
) -> ScheduleRecord:
    """Return the record of the requested accuracy, the tolerances, and whether the request was met.

    If a film is made again with the same request, it is the record of the original, with the tolerances of this film.
    """
    schedule = ScheduleRecord(
        job.requested,
        min_max([frame.tolerance for frame in frames]),
        min_max([frame.cells for frame in frames]),
        met=shortfall is None,
        reproducible=not plan.is_timing_dependent,
        shortfall=None if shortfall is None else str(shortfall),
        measured=_measured_record(plan),
    )
    if job.original is None:
        return schedule
    schedule, before = replace(schedule, made_from=job.original.path.name), job.original.record.schedule
    if plan.is_unfinished or job.repeats != "film" or job.requested != before.requested:
        return schedule
    return replace(before, tolerance=schedule.tolerance, cells=schedule.cells, made_from=schedule.made_from)


def _measured_record(plan: FilmPlan) -> MeasuredRecord | None:
    """Return the record of the search for the tolerances of an accuracy; None if there was no search."""
    found = plan.found
    if found is None:
        return None
    # The PSNR of equal pictures is infinite, which JSON cannot have.
    worst = found.worst.value if isfinite(found.worst.value) else None
    return MeasuredRecord(found.want.metric, found.worst.frame, found.tried, worst)
