"""Build the content of a sidecar, and the notes and figures that the terminal shows of the same film."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from hsplat_cli.scenes import Job
from hsplat_cli.terminal import counted, pluralize_range
from renderer.errors import RenderError
from renderer.film import Record
from renderer.scene import TimeBudget, format_value, schedule_to_dict, scheduled_value, short_text
from renderer.study import FilmPlan
from renderer.system import package_versions, sources_digest

if TYPE_CHECKING:
    from renderer.study import ToleranceSearchResult

# A frame is in time when its seconds differ from its budget by no more than this fraction.
TIME_BUDGET_MARGIN = 0.2


# Frames


def frame_seconds(frame: Record) -> float:
    """Return the seconds from the start of a frame until the encoder had it."""
    return float(sum(frame["seconds"].values()))


def drawing_seconds(frame: Record) -> float:
    """Return `frame_seconds` without the steps that later frames share: the cut, its splats and its edges."""
    return float(sum(seconds for name, seconds in frame["seconds"].items() if name not in ("cut", "splats", "edges")))


def budget_seconds(goal: TimeBudget, frame: Record) -> float:
    """Return the seconds that a frame was given."""
    return scheduled_value(goal.by_frame, frame["frame"])


def is_in_time(goal: TimeBudget, frame: Record) -> bool:
    """Return whether a frame took its budget within TIME_BUDGET_MARGIN, or less while it shows every voxel."""
    share = frame_seconds(frame) / budget_seconds(goal, frame)
    return abs(share - 1) <= TIME_BUDGET_MARGIN or (share < 1 and frame["tolerance"] == 0)


# The sidecar


def schedule_record(
    requested: Mapping[str, Any], frames: Sequence[Record], shortfall: str | None, *, is_reproducible: bool
) -> dict[str, Any]:
    """Return what was requested and what was reached.

    `reproducible` is false where the tolerances depend on the speed of the machine: then the sidecar makes the same
    film again, and the scene does not.
    """
    record = {
        "asked": requested,
        "tolerance": min_max(frame["tolerance"] for frame in frames),
        "cells": min_max(frame["cells"] for frame in frames),
        "met": shortfall is None,
        "reproducible": is_reproducible,
    }
    return record if shortfall is None else record | {"shortfall": shortfall}


def job_schedule_record(
    job: Job, plan: FilmPlan, frames: Sequence[Record], shortfall: RenderError | None
) -> dict[str, Any]:
    """Return `schedule_record` of a job's film, and what was measured.

    The schedule of an original film carries over while the same is requested.
    """
    missed, is_reproducible = None if shortfall is None else str(shortfall), not plan.is_timing_dependent
    record = schedule_record(job.requested_error, frames, missed, is_reproducible=is_reproducible)
    if plan.found is not None:
        worst = plan.found.worst
        value = worst.value if math.isfinite(worst.value) else None  # the PSNR of equal pictures
        metric, probes = plan.found.want.metric, plan.found.frames
        record["measured"] = {"metric": metric, "worst": value, "frame": worst.frame, "probes": probes}
    if job.original is not None:
        if not plan.is_unfinished and job.requested_error == schedule_to_dict(job.original.requested_error):
            record |= job.original.other_schedule_keys
        record["made_from"] = job.original.path.name
    return record


# Notes


def rerender_notes(job: Job, driver: str) -> list[str]:
    """Return notes on a film that is rendered from a sidecar: a goal that the original missed, and other versions."""
    original = job.original
    if original is None:
        return []
    notes = []
    if original.other_schedule_keys.get("met") is False:
        requested = schedule_to_dict(original.requested_error).items()
        goals = ", ".join(f"{name} {format_value(value)}" for name, value in requested)
        notes.append(f"the original film did not meet what was requested: {goals}")
    before, now = original.tool_versions, package_versions() | {"GL": driver, "sources": sources_digest()}
    changed = [
        f"{name} {now[name]}, which was {short_text(before[name])}"
        for name in now
        if name in before and before[name] != now[name]
    ]
    if changed:
        notes.append(f"the bytes may differ from the original film, which had other versions: {'; '.join(changed)}")
    return notes


def driver_notes(drivers: Sequence[str]) -> list[str]:
    """Return a note where frames were drawn by different drivers: kept frames, or workers that differ."""
    names = " and ".join(drivers)
    return [f"bytes may differ from frame to frame, drawn by different drivers: {names}"] * (len(drivers) > 1)


# Figures


def summary_parts(
    job: Job, frames: Sequence[Record], seconds: float, found: ToleranceSearchResult | None, num_resumed: int
) -> Iterator[str]:
    """Yield `120 frames in 25.1 s`, `190 bricks a frame`, and how a budget or an accuracy was met."""
    num, goal = len(frames), job.scene.error.goal
    yield f"{counted(num, 'frame')} in {seconds:.1f} s" + (f" ({num_resumed} drawn before)" if num_resumed else "")
    yield f"{pluralize_range([frame['splats'] for frame in frames], job.scene.splat.primitive_name)} a frame"
    if goal is not None:
        yield f"tolerance {range_text([frame['tolerance'] for frame in frames])}"
    if isinstance(goal, TimeBudget):
        predicted = statistics.median(frame["predicted_seconds"] for frame in frames)
        yield f"{statistics.median(map(frame_seconds, frames)):.3g} s a frame (predicted: {predicted:.3g} s)"
        yield f"{sum(is_in_time(goal, frame) for frame in frames)} of {num} in time"
    if found is not None:
        worst, num_probes = found.want.format(found.worst.value), len(found.frames)
        yield f"{worst} or better on {num_probes} probe frames" if num_probes > 1 else worst


def range_text(values: Sequence[float]) -> str:
    """Return `0.1`, or `0.05 to 0.1`."""
    low, high = min_max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def min_max(values: Iterable[float]) -> list[float]:
    """Return the smallest and the largest value."""
    found = list(values)
    return [min(found), max(found)]
