"""From what a scene asks for (splats, seconds, an accuracy) to the tolerances that give it; and was it met?"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from hsplat_cli.films.sidecar_record import TIME_BUDGET_MARGIN, budget_seconds, drawing_seconds, span
from hsplat_cli.scenes import Job
from renderer import study
from renderer.errors import RenderError
from renderer.film import Record
from renderer.frame import LODCostEstimator, Rasterizer, Stage
from renderer.scene import MetricTarget, TimeBudget, format_value
from renderer.study import BEST_EFFORT_HINT, FilmPlan

if TYPE_CHECKING:
    from renderer.study import ToleranceSearchResult

# Frames that may be late without a word.
MAX_LATE_FRACTION = 0.1


def make_plan(
    estimator: LODCostEstimator,
    frames: Sequence[int],
    rasterizer: Rasterizer | None,
    *,
    quiet: bool,
    on_step: Callable[[], None] = lambda: None,
) -> FilmPlan:
    """Find what the goal of the scene takes, if it has one, and tell of a search; as `renderer.study.make_plan`."""

    def search(stage: Stage, want: MetricTarget) -> ToleranceSearchResult:
        # Imported where they are used: other films need no ray integral, which takes a while to load.
        from hsplat_cli.films.tolerance_search import search_tolerance
        from renderer.study import TRUTH_TOLERANCE

        assert rasterizer is not None
        return search_tolerance(stage, frames, want, TRUTH_TOLERANCE, rasterizer, quiet=quiet, on_step=on_step)

    return study.make_plan(estimator, frames, rasterizer, clock=time.perf_counter, search=search, on_step=on_step)


def shortfall_of(job: Job, plan: FilmPlan, frames: Sequence[Record]) -> RenderError | None:
    """What was asked for and not had, now that the frames are there."""
    goal = job.scene.error.goal
    if plan.is_unfinished:
        return RenderError(
            "the film was not refined to what the scene asks for",
            where=str(job.scene.output.file),
            got=f"tolerance {span([frame['tolerance'] for frame in frames])}",
            expected=", ".join(f"{name} {format_value(value)}" for name, value in job.requested_error.items()),
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
