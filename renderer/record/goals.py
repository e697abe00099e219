"""Check that a film reached the accuracy of its scene, and describe its accuracy and cost in a line."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Sequence

from renderer.accuracy import ROUNDING_ERROR, psnr, wanted_error
from renderer.errors import RenderError
from renderer.record.accuracy_records import accuracy_text, film_accuracy, flicker_text
from renderer.record.film_record import FilmRecord, FrameRecord, min_max
from renderer.scene import (
    ErrorSpec,
    FilmScene,
    MetricTarget,
    SplatBudget,
    TimeBudget,
    counted,
    first_few,
    format_value,
    pluralize_range,
    schedule_to_dict,
    value_at,
)

# The hint of errors about a missed goal.
BEST_EFFORT_HINT = "with --best-effort it is good enough"
# A frame is in time if its seconds differ from its budget of seconds by at most this fraction of the budget.
_TIME_MARGIN = 0.2
# At most this fraction of a film's frames may take longer than their budget of seconds without an error.
_MAX_LATE_FRACTION = 0.1
# The steps of a frame whose results later frames can share: the cut, and the primitives and edges of its cells.
_SHARED_STEPS = ("cut", "primitives", "edges")
# The chance that the true PSNR of a frame lies above its interval, which holds the true value in 95 % of cases: the
# frame may then seem less exact than it is.
_CHANCE_BELOW_INTERVAL = 0.025
# The number of frames that seem less exact than they are may exceed its mean by this many standard deviations.
_MAX_DEVIATIONS = 3.0

# The goal of a scene: a number of cells or of seconds for a frame, or an accuracy; None for a tolerance.
Goal = SplatBudget | TimeBudget | MetricTarget | None


def not_refined(file: str, requested: ErrorSpec, frames: Sequence[FrameRecord]) -> RenderError:
    """Return the error for a film that is a coarser pass than its scene requests. file: the name of the film."""
    return RenderError(
        "the film was not refined to what the scene requests",
        where=file,
        got=f"tolerance {range_text([frame.tolerance for frame in frames])}",
        expected=", ".join(f"{name} {format_value(value)}" for name, value in schedule_to_dict(requested).items()),
        hint=f"it needs more time; {BEST_EFFORT_HINT}",
    )


def missed_goal(goal: Goal, frames: Sequence[FrameRecord]) -> RenderError | None:
    """Return the error for a goal that these frames did not reach; None if they reached it."""
    if isinstance(goal, MetricTarget):
        return _accuracy_shortfall(goal, frames)
    return _time_shortfall(goal, frames) if isinstance(goal, TimeBudget) else None


def _accuracy_shortfall(goal: MetricTarget, frames: Sequence[FrameRecord]) -> RenderError | None:
    """Return the error if exact rays show that the film, or too many frames, are surely less exact than the goal.

    None if they are exact enough. The rays also measure the error of rounding to 8 bits, which the goal does not count.
    """
    film = film_accuracy(frames)
    if film is None:
        return None
    least = psnr(wanted_error(goal) + ROUNDING_ERROR)
    missing = [frame.frame for frame in frames if frame.accuracy is not None and frame.accuracy.interval[1] < least]
    if film.interval[1] >= least and len(missing) <= _most_missing_by_chance(len(frames)):
        return None
    which = f"; surely less on frame {first_few(missing)}" if missing else ""
    return RenderError(
        "the film is less exact than requested",
        where=f"error.{goal.metric}",
        got=f"frames PSNR {film.psnr:.1f} dB, at most {film.interval[1]:.1f}{which}",
        expected=f"{goal}, of 8 bits {least:.1f} dB",
        hint=f"ask for a little more; {BEST_EFFORT_HINT}",
    )


def _most_missing_by_chance(num_frames: int) -> float:
    """Return how many frames of a film that is as exact as requested may seem less exact by chance."""
    mean = _CHANCE_BELOW_INTERVAL * num_frames
    return mean + _MAX_DEVIATIONS * math.sqrt(mean)


def _time_shortfall(goal: TimeBudget, frames: Sequence[FrameRecord]) -> RenderError | None:
    """Return the error if many frames took longer than their budget of seconds; else None.

    There are two causes: even the coarsest cut may take too long, or the machine may have become slower.
    """
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
    """Return the seconds of a frame without the steps whose results later frames can share."""
    return float(sum(seconds for name, seconds in frame.seconds.items() if name not in _SHARED_STEPS))


def _budget(goal: TimeBudget, frame: FrameRecord) -> float:
    return value_at(goal.value, frame.frame)


def _predicted(frame: FrameRecord) -> float:
    assert frame.predicted_seconds is not None, "frames on a budget of time have it"
    return frame.predicted_seconds


def _is_in_time(goal: TimeBudget, frame: FrameRecord) -> bool:
    """Return whether a frame took its budget of seconds within the margin, or less if it shows every voxel."""
    share = frame.total_seconds / _budget(goal, frame)
    return abs(share - 1) <= _TIME_MARGIN or (share < 1 and frame.tolerance == 0)


def summary_parts(scene: FilmScene, record: FilmRecord, num_resumed: int) -> Iterator[str]:
    """Yield the parts of a line on a film: `120 frames in 25.1 s`, accuracy, `190 bricks a frame`, how a goal was met.

    scene: the scene with its goal. num_resumed: the number of frames that earlier jobs drew.
    """
    frames, seconds = record.frames, record.seconds["total"]
    num, goal, found = len(frames), scene.error.goal, record.schedule.measured
    yield f"{counted(num, 'frame')} in {seconds:.1f} s" + (f" ({num_resumed} drawn before)" if num_resumed else "")
    if record.accuracy is not None:
        yield accuracy_text(record.accuracy)
        if (flicker := flicker_text(record.accuracy)) is not None:
            yield flicker
    yield f"{pluralize_range([frame.primitives for frame in frames], scene.primitive_name)} a frame"
    if goal is not None:
        yield f"tolerance {range_text([frame.tolerance for frame in frames])}"
    if isinstance(goal, TimeBudget):
        typical = statistics.median(frame.total_seconds for frame in frames)
        yield f"{typical:.3g} s a frame (predicted: {statistics.median(map(_predicted, frames)):.3g} s)"
        yield f"{sum(_is_in_time(goal, frame) for frame in frames)} of {num} in time"
    if isinstance(goal, MetricTarget) and found is not None:
        worst = goal.format(math.inf if found.worst is None else found.worst)
        num_probes = len(found.probes)
        yield f"{worst} or better on {num_probes} probe frames" if num_probes > 1 else worst


def range_text(values: Sequence[float]) -> str:
    """Return the range of some values as `0.05 to 0.1`, or as `0.1` if they are equal."""
    low, high = min_max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"
