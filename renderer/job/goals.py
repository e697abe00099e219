"""Check that a film reached what its scene requested, and describe in a line what it has and what it cost."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence

from renderer.accuracy import ROUNDING_ERROR, psnr, wanted_error
from renderer.errors import RenderError
from renderer.job.film_accuracy import accuracy_text, film_accuracy
from renderer.job.plan import BEST_EFFORT_HINT, FilmPlan
from renderer.job.record import FilmRecord, FrameRecord, min_max
from renderer.scene import (
    ErrorSpec,
    FilmScene,
    MetricTarget,
    TimeBudget,
    counted,
    first_few,
    format_value,
    pluralize_range,
    schedule_to_dict,
    value_at,
)

# A frame is in time when its seconds differ from its budget by no more than this fraction.
_TIME_MARGIN = 0.2
# Up to this fraction of the frames may be late without an error.
_MAX_LATE_FRACTION = 0.1
# Steps that later frames share: the cut, its primitives and its edges.
_SHARED_STEPS = ("cut", "primitives", "edges")
# Up to this fraction of the frames may be less exact without an error.
_MAX_MISSING_FRACTION = 0.05


def find_shortfall(
    scene: FilmScene, requested: ErrorSpec, plan: FilmPlan, frames: Sequence[FrameRecord]
) -> RenderError | None:
    """Return the error for what was requested and not reached by these frames, or None."""
    goal = scene.error.goal
    if plan.is_unfinished:
        wanted = schedule_to_dict(requested).items()
        return RenderError(
            "the film was not refined to what the scene requests",
            where=scene.output.file.name,
            got=f"tolerance {range_text([frame.tolerance for frame in frames])}",
            expected=", ".join(f"{name} {format_value(value)}" for name, value in wanted),
            hint=f"it needs more time; {BEST_EFFORT_HINT}",
        )
    if isinstance(goal, MetricTarget) and plan.shortfall is None:
        return _accuracy_shortfall(goal, frames)
    return _time_shortfall(goal, frames) if isinstance(goal, TimeBudget) else plan.shortfall


def _accuracy_shortfall(goal: MetricTarget, frames: Sequence[FrameRecord]) -> RenderError | None:
    """Return the error where the rays through the frames that were drawn say for sure that they are not as exact.

    They see what rounding to 8 bits adds, which the goal does not count.
    """
    film = film_accuracy(frames)
    if film is None:
        return None
    least = psnr(wanted_error(goal) + ROUNDING_ERROR)
    missing = [frame.frame for frame in frames if frame.accuracy is not None and frame.accuracy.interval[1] < least]
    if film.interval[1] >= least and len(missing) <= _MAX_MISSING_FRACTION * len(frames):
        return None
    which = f"; surely less on frame {first_few(missing)}" if missing else ""
    return RenderError(
        "the film is less exact than requested",
        where=f"error.{goal.metric}",
        got=f"frames PSNR {film.psnr:.1f} dB, at most {film.interval[1]:.1f}{which}",
        expected=f"{goal}, of 8 bits {least:.1f} dB",
        hint=f"ask for a little more; {BEST_EFFORT_HINT}",
    )


def _time_shortfall(goal: TimeBudget, frames: Sequence[FrameRecord]) -> RenderError | None:
    """Return the error where many frames were too slow even at the coarsest cut, or the machine became slower."""
    late = [frame for frame in frames if _predicted(frame) > (1 + _TIME_MARGIN) * _budget(goal, frame)]
    if len(late) <= _MAX_LATE_FRACTION * len(frames):
        shares = [_drawing_seconds(frame) / _budget(goal, frame) for frame in frames]
        if statistics.median(shares) <= 1 + _TIME_MARGIN:
            return None
        late = list(frames)
    median_seconds = statistics.median(map(_drawing_seconds, late))
    tolerances = range_text([frame.tolerance for frame in late])
    which = "the frame" if len(frames) == 1 else f"{len(late)} of {len(frames)} frames"
    return RenderError(
        f"{which} took longer than the time budget",
        where="error.seconds",
        got=f"{median_seconds:.3g} s a frame in the median, at tolerance {tolerances}",
        expected=f"{range_text([_budget(goal, frame) for frame in late])} s",
        hint=f"a smaller output.size is drawn sooner; {BEST_EFFORT_HINT}",
    )


def _drawing_seconds(frame: FrameRecord) -> float:
    """Return the seconds of a frame without the steps that later frames share."""
    return float(sum(seconds for name, seconds in frame.seconds.items() if name not in _SHARED_STEPS))


def _budget(goal: TimeBudget, frame: FrameRecord) -> float:
    return value_at(goal.value, frame.frame)


def _predicted(frame: FrameRecord) -> float:
    assert frame.predicted_seconds is not None, "frames on a budget of time have it"
    return frame.predicted_seconds


def _is_in_time(goal: TimeBudget, frame: FrameRecord) -> bool:
    """Return whether a frame took its budget within the margin, or less while it shows every voxel."""
    share = frame.total_seconds / _budget(goal, frame)
    return abs(share - 1) <= _TIME_MARGIN or (share < 1 and frame.tolerance == 0)


def summary_parts(scene: FilmScene, plan: FilmPlan, record: FilmRecord, num_resumed: int) -> Iterator[str]:
    """Yield `120 frames in 25.1 s`, how exact they are, `190 bricks a frame`, and how a goal was met."""
    frames, seconds = record.frames, record.seconds["total"]
    num, goal, found = len(frames), scene.error.goal, plan.found
    yield f"{counted(num, 'frame')} in {seconds:.1f} s" + (f" ({num_resumed} drawn before)" if num_resumed else "")
    if record.accuracy is not None:
        yield accuracy_text(record.accuracy)
    yield f"{pluralize_range([frame.primitives for frame in frames], scene.primitive_name)} a frame"
    if goal is not None:
        yield f"tolerance {range_text([frame.tolerance for frame in frames])}"
    if isinstance(goal, TimeBudget):
        typical = statistics.median(frame.total_seconds for frame in frames)
        yield f"{typical:.3g} s a frame (predicted: {statistics.median(map(_predicted, frames)):.3g} s)"
        yield f"{sum(_is_in_time(goal, frame) for frame in frames)} of {num} in time"
    if found is not None:
        worst, num_probes = found.want.format(found.worst.value), len(found.tried)
        yield f"{worst} or better on {num_probes} probe frames" if num_probes > 1 else worst


def range_text(values: Sequence[float]) -> str:
    """Return `0.1`, or `0.05 to 0.1`."""
    low, high = min_max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"
