"""Find the tolerances that meet what a scene requests (splats, seconds, an accuracy), and check that they did."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from hsplat_cli.films.sidecar_record import TIME_BUDGET_MARGIN, budget_seconds, drawing_seconds, range_text
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import Reporter
from renderer import study
from renderer.errors import RenderError
from renderer.film import Record
from renderer.frame import LODCostEstimator, Rasterizer, Stage
from renderer.scene import MetricTarget, TimeBudget, format_value
from renderer.study import BEST_EFFORT_HINT, FilmPlan

if TYPE_CHECKING:
    from renderer.study import ToleranceSearchResult

# Up to this fraction of the frames may be late without an error.
_MAX_LATE_FRACTION = 0.1


def make_plan(
    estimator: LODCostEstimator,
    frames: Sequence[int],
    rasterizer: Rasterizer | None,
    reporter: Reporter,
    on_step: Callable[[], None] = lambda: None,
) -> FilmPlan:
    """Find the tolerances that meet the goal of the scene, and report the search; as `renderer.study.make_plan`."""

    def search(stage: Stage, target: MetricTarget) -> ToleranceSearchResult:
        # Imported here: the ray integral takes a while to load.
        from hsplat_cli.films.accuracy import search_tolerance
        from renderer.study import TRUTH_TOLERANCE

        assert rasterizer is not None
        return search_tolerance(stage, frames, target, TRUTH_TOLERANCE, rasterizer, reporter, on_step=on_step)

    return study.make_plan(estimator, frames, rasterizer, clock=time.perf_counter, search=search, on_step=on_step)


def shortfall_of(job: Job, plan: FilmPlan, frames: Sequence[Record]) -> RenderError | None:
    """Return the error for what was requested and not reached by these frames, or None."""
    goal = job.scene.error.goal
    if plan.is_unfinished:
        return RenderError(
            "the film was not refined to what the scene requests",
            where=str(job.scene.output.file),
            got=f"tolerance {range_text([frame['tolerance'] for frame in frames])}",
            expected=", ".join(f"{name} {format_value(value)}" for name, value in job.requested_error.items()),
            hint=f"it needs more time; {BEST_EFFORT_HINT}",
        )
    return _time_shortfall(goal, frames) if isinstance(goal, TimeBudget) else plan.shortfall


def _time_shortfall(goal: TimeBudget, frames: Sequence[Record]) -> RenderError | None:
    """Return the error where many frames were too slow even at the coarsest cut, or the machine became slower."""
    late = [
        frame for frame in frames if frame["predicted_seconds"] > (1 + TIME_BUDGET_MARGIN) * budget_seconds(goal, frame)
    ]
    if len(late) <= _MAX_LATE_FRACTION * len(frames):
        shares = [drawing_seconds(frame) / budget_seconds(goal, frame) for frame in frames]
        if statistics.median(shares) <= 1 + TIME_BUDGET_MARGIN:
            return None
        late = list(frames)
    median_seconds = statistics.median(map(drawing_seconds, late))
    tolerances = range_text([frame["tolerance"] for frame in late])
    which = "the frame" if len(frames) == 1 else f"{len(late)} of {len(frames)} frames"
    return RenderError(
        f"{which} took longer than the time budget",
        where="error.seconds",
        got=f"{median_seconds:.3g} s a frame in the median, at tolerance {tolerances}",
        expected=f"{range_text([budget_seconds(goal, frame) for frame in late])} s",
        hint=f"a smaller output.size is drawn sooner; {BEST_EFFORT_HINT}",
    )
