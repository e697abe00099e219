"""Evaluate and change the error schedule: the tolerance or the budget of each frame."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise, zip_longest
from operator import itemgetter

from renderer.scene.error_section import ByFrame, ErrorSpec, MetricTarget, TimeBudget
from renderer.scene.spec import Scene


def tolerance_at(error: ErrorSpec, frame: int) -> float:
    """Return the tolerance of a frame, for a schedule whose goal, if any, has been resolved."""
    assert error.goal is None, f"to be resolved first: {error.goal}"
    return scheduled_value(error.tolerance, frame)


def scheduled_value(by_frame: ByFrame, frame: int) -> float:
    """Return the value at a frame: its logarithm is linear between the scheduled frames and constant outside them.

    The value at a scheduled frame is exact, and values between two scheduled frames are monotone. Interpolated values
    are at least 1e-300; between equal values, which may be 0, the schedule is constant.
    """
    following = bisect_right(by_frame, frame, key=itemgetter(0))
    if following == 0:
        return by_frame[0][1]
    if following == len(by_frame):
        return by_frame[-1][1]
    (start, before), (end, after) = by_frame[following - 1 : following + 1]
    if frame == start or before == after:
        return before
    # Every step is monotone in the frame, rounding included; halving the logarithm's rise keeps it finite. The
    # difference of almost equal values is exact, while that of their logarithms loses digits.
    close = 0.5 * before < after < 2.0 * before
    rise = math.log1p((after - before) / before) if close else math.log(after) - math.log(before)
    root = math.exp(0.5 * rise * ((frame - start) / (end - start)))
    return min(max(before * root * root, min(before, after)), max(before, after))


def accuracy_of(error: ErrorSpec) -> ErrorSpec:
    """Return the tolerance or the goal alone: what is requested of a film."""
    return ErrorSpec(error.tolerance) if error.goal is None else ErrorSpec(goal=error.goal)


def is_film_wide_goal(error: ErrorSpec) -> bool:
    """Return whether the goal concerns all frames together, so that a part of them cannot tell whether it is met."""
    return isinstance(error.goal, (MetricTarget, TimeBudget))


def with_draw_order(scene: Scene) -> Scene:
    """Return the scene with the order in which splats are drawn: `unmixed`, a single order, for a time budget.

    Drawing some frames in a second order would double their time, or need a far coarser cut, which flickers.
    """
    if isinstance(scene.error.goal, TimeBudget) and scene.splat.order == "depth":
        return replace(scene, splat=replace(scene.splat, order="unmixed"))
    return scene


def min_tolerance(error: ErrorSpec) -> float:
    """Return the smallest tolerance of any frame; 0 with a goal."""
    return 0.0 if error.goal else min(tolerance for _, tolerance in error.tolerance)


def with_tolerance(scene: Scene, tolerance: float) -> Scene:
    """Return the scene at a constant tolerance."""
    return with_tolerances(scene, {0: tolerance})


def with_tolerances(scene: Scene, tolerances: Mapping[int, float]) -> Scene:
    """Return the scene with a tolerance for each of these frames, in ascending order."""
    return replace(scene, error=replace(scene.error, tolerance=schedule_from_tolerances(tolerances), goal=None))


def schedule_from_tolerances(tolerances: Mapping[int, float]) -> ByFrame:
    """Return a schedule with exactly these tolerances at these frames, which are in ascending order."""
    frames = list(tolerances)
    starts = frames[:1]
    starts += [frame for before, frame in pairwise(frames) if tolerances[frame] != tolerances[before]]
    entries: list[tuple[int, float]] = []
    for start, following in zip_longest(starts, starts[1:]):
        entries.append((start, tolerances[start]))
        if following is not None and following - 1 > start:  # constant up to there
            entries.append((following - 1, tolerances[start]))
    return ((0, entries[0][1]),) if len(entries) == 1 else tuple(entries)
