"""What is told about a film: what goes into the JSON file beside it, notes, and a few lines on the terminal."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from hsplat_cli.films.rerender import inherited_schedule, printable_name
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import counted, pluralize_range
from renderer.errors import RenderError
from renderer.film import Record
from renderer.scene import TimeBudget, scheduled_value
from renderer.study import FilmPlan

if TYPE_CHECKING:
    from renderer.study import ToleranceSearchResult

# A frame is in time when it takes no longer and no shorter than its budget by more than this part.
TIME_BUDGET_MARGIN = 0.2


def with_seconds(record: Record, **seconds: float) -> Record:
    """A frame's record with what some more steps took."""
    return {**record, "seconds": {**record["seconds"], **seconds}}


def makers(frames: Sequence[Record]) -> list[str]:
    """Devices and drivers, as GL names them, of the frames that tell: those that were drawn elsewhere."""
    return list(dict.fromkeys(frame["gl"] for frame in frames if "gl" in frame))


def schedule_record(
    job: Job, plan: FilmPlan, frames: Sequence[Record], shortfall: RenderError | None
) -> dict[str, Any]:
    """What was asked for and what was reached.

    Where the tolerances depend on how quick the machine was, the scene does not make the same film again; this file
    does.
    """
    record = {
        "asked": job.requested_error,
        "tolerance": limits(frame["tolerance"] for frame in frames),
        "cells": limits(frame["cells"] for frame in frames),
        "met": shortfall is None,
        "reproducible": not plan.is_timing_dependent,
    }
    measured = {} if plan.found is None else {"measured": _measured(plan.found)}
    missed = {} if shortfall is None else {"shortfall": str(shortfall)}
    return record | measured | missed | inherited_schedule(job, is_unfinished=plan.is_unfinished)


def _measured(found: ToleranceSearchResult) -> dict[str, Any]:
    worst = found.worst
    value = worst.value if math.isfinite(worst.value) else None  # the PSNR of equal pictures
    return {"metric": found.want.metric, "worst": value, "frame": worst.frame, "probes": found.frames}


def driver_notes(made_by: Sequence[str]) -> list[str]:
    """That frames are not all of one driver, if so: some of them are kept, or workers differ."""
    drivers = " and ".join(map(printable_name, made_by))
    return [f"bytes may differ from frame to frame, drawn by different drivers: {drivers}"] * (len(made_by) > 1)


def summary(
    job: Job, frames: Sequence[Record], seconds: float, found: ToleranceSearchResult | None, num_kept: int = 0
) -> str:
    """`120 frames in 25.1 s, 190 bricks a frame`, and what came of a budget or an accuracy."""
    return ", ".join(_summary(job, frames, seconds, found, num_kept))


def _summary(
    job: Job, frames: Sequence[Record], seconds: float, found: ToleranceSearchResult | None, num_kept: int
) -> Iterator[str]:
    num, goal = len(frames), job.scene.error.goal
    yield f"{counted(num, 'frame')} in {seconds:.1f} s" + (f" ({num_kept} drawn before)" if num_kept else "")
    yield f"{pluralize_range([frame['splats'] for frame in frames], job.scene.splat.primitive_name)} a frame"
    if goal is not None:
        yield f"tolerance {span([frame['tolerance'] for frame in frames])}"
    if isinstance(goal, TimeBudget):
        in_time = sum(is_in_time(goal, frame) for frame in frames)
        predicted = statistics.median(frame["predicted_seconds"] for frame in frames)
        taken = statistics.median(map(frame_seconds, frames))
        yield f"{taken:.3g} s a frame (predicted: {predicted:.3g} s)"
        yield f"{in_time} of {num} in time"
    if found is not None:
        worst, num_probes = found.want.format(found.worst.value), len(found.frames)
        yield f"{worst} or better on {num_probes} probe frames" if num_probes > 1 else worst


def span(values: Sequence[float], form: str = "g") -> str:
    """`0.1`, or `0.05 to 0.1`."""
    low, high = limits(values)
    return f"{low:{form}}" if low == high else f"{low:{form}} to {high:{form}}"


def limits(values: Iterable[float]) -> list[float]:
    """The smallest and the largest."""
    found = list(values)
    return [min(found), max(found)]


def frame_seconds(frame: Record) -> float:
    """From the start of a frame until it was in the file, or on its way there."""
    return float(sum(frame["seconds"].values()))


def drawing_seconds(frame: Record) -> float:
    """The same without what the frame did for the others, too: their cut."""
    return float(sum(seconds for name, seconds in frame["seconds"].items() if name not in ("cut", "splats", "edges")))


def budget_seconds(goal: TimeBudget, frame: Record) -> float:
    """The time that a frame had."""
    return scheduled_value(goal.by_frame, frame["frame"])


def is_in_time(goal: TimeBudget, frame: Record) -> bool:
    """Whether a frame took its time within TIME_BUDGET_MARGIN, or less and shows every voxel."""
    share = frame_seconds(frame) / budget_seconds(goal, frame)
    return abs(share - 1) <= TIME_BUDGET_MARGIN or (share < 1 and frame["tolerance"] == 0)
