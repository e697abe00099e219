"""Plan the tolerances of a film's frames from the goal of its scene: cells, seconds or an accuracy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from renderer.errors import RenderError
from renderer.frame import (
    BudgetController,
    Clock,
    LODCostEstimator,
    Rasterizer,
    Stage,
    Stopwatch,
    ToleranceController,
    calibrate_costs,
)
from renderer.scene import (
    MetricTarget,
    Scene,
    SplatBudget,
    scheduled_value,
    with_tolerance,
    with_tolerances,
)

if TYPE_CHECKING:  # the ray integral takes a while to load, and most films do not need it
    from renderer.study.tolerance_search import ToleranceSearchResult

# A trial drawing that takes this part of a frame's time tells enough about the whole.
_MAX_TRIAL_FRACTION = 0.3
BEST_EFFORT_HINT = "with --best-effort it is good enough"


@dataclass(frozen=True)
class FilmPlan:
    """Gives each frame its tolerance: from the schedule of the stage's scene, without a goal, or from a controller.

    shortfall: the goal that cannot be reached; the film is then drawn as well as possible.
    is_unfinished: finer passes follow.
    is_timing_dependent: its tolerances depend on the speed of the machine.
    found: the result of the search for an accuracy.
    """

    stage: Stage
    controller: ToleranceController | None = None
    shortfall: RenderError | None = None
    is_unfinished: bool = False
    is_timing_dependent: bool = False
    found: ToleranceSearchResult | None = None


def make_plan(
    estimator: LODCostEstimator,
    frames: Sequence[int],
    rasterizer: Rasterizer | None,
    *,
    clock: Clock,
    search: Callable[[Stage, MetricTarget], ToleranceSearchResult],
    on_step: Callable[[], None] = lambda: None,
) -> FilmPlan:
    """Resolve the goal of the stage's scene, if it has one.

    rasterizer: for goals of accuracy and of time.
    search: finds the tolerance of an accuracy; called for goals of accuracy.
    on_step: called before each trial drawing; what it raises ends the search.
    """
    stage = estimator.stage
    goal = stage.scene.error.goal
    if goal is None:
        return FilmPlan(stage)
    if isinstance(goal, MetricTarget):
        return _plan_accuracy(stage, goal, search(stage, goal))
    if isinstance(goal, SplatBudget):
        tolerances = {
            frame: estimator.primitive.tolerance_for_cells(scheduled_value(goal.by_frame, frame)) for frame in frames
        }
        return FilmPlan(replace(stage, scene=with_tolerances(stage.scene, tolerances)))
    assert rasterizer is not None
    least = min(scheduled_value(goal.by_frame, frame) for frame in frames)
    calibrate_costs(estimator, frames[0], _MAX_TRIAL_FRACTION * least, rasterizer, clock=clock, on_step=on_step)
    controller = BudgetController(estimator, lambda frame: scheduled_value(goal.by_frame, frame))
    draw_list, _ = controller.choose(frames[0], Stopwatch(clock))
    draw_list.upload(rasterizer)
    return FilmPlan(stage, controller, is_timing_dependent=True)


def _plan_accuracy(stage: Stage, goal: MetricTarget, found: ToleranceSearchResult) -> FilmPlan:
    """Plan one tolerance for the whole film; 0 if none is good enough."""
    shortfall = None
    if found.tolerance is None:
        hint = f"the film is drawn at tolerance 0, and {BEST_EFFORT_HINT}"
        shortfall = unreachable_accuracy_error(found, stage.scene, where=f"error.{goal.metric}", hint=hint)
    exact = replace(stage, scene=with_tolerance(stage.scene, found.tolerance or 0.0))
    return FilmPlan(exact, shortfall=shortfall, found=found)


def unreachable_accuracy_error(found: ToleranceSearchResult, scene: Scene, *, where: str, hint: str) -> RenderError:
    """Return the error where no tolerance is good enough. hint: what to do about it."""
    want, worst = found.want, found.worst
    level, noun = scene.error.finest_level, scene.splat.primitive_name
    drawn = f"{worst.num_cells} {noun}{'s' * (worst.num_cells != 1)}"
    limit = "docs/footprints.md says what limits it"
    if level:
        limit = f"error.finest_level: {level} lets no cell be smaller"
    return RenderError(
        "the requested accuracy is beyond full resolution",
        where=where,
        got=f"{want.format(worst.value)} on frame {worst.frame}, with {drawn} at tolerance 0",
        expected=str(want),
        hint=f"{hint}; {limit}",
    )
