"""The error schedule: which tolerance, or which budget, each frame has."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise, zip_longest
from operator import itemgetter

from renderer.scene.spec import AccuracyGoal, ByFrame, ErrorSpec, Scene, TimeBudget


def tolerance_at(error: ErrorSpec, frame: int) -> float:
    """The tolerance of a frame, of a schedule whose goal, if it had one, has been resolved."""
    assert error.goal is None, f"to be resolved first: {error.goal}"
    return scheduled_value(error.tolerance, frame)


def scheduled_value(by_frame: ByFrame, frame: int) -> float:
    """The value at a frame: linear in its logarithm between the scheduled frames, constant before and after them.

    At a scheduled frame it is the scheduled number, bit for bit, and between two of them it never turns back.
    Values that are interpolated are at least 1e-300; between equal ones, which may be 0, it is constant.
    """
    following = bisect_right(by_frame, frame, key=itemgetter(0))
    if following == 0:
        return by_frame[0][1]
    if following == len(by_frame):
        return by_frame[-1][1]
    (start, before), (end, after) = by_frame[following - 1 : following + 1]
    if frame == start or before == after:
        return before
    # Every step is monotone in the frame, the rounding included, and half the logarithm's rise at a time is finite.
    # Two values that are almost equal differ by a number that is exact, and their logarithms by digits too few.
    close = 0.5 * before < after < 2.0 * before
    rise = math.log1p((after - before) / before) if close else math.log(after) - math.log(before)
    root = math.exp(0.5 * rise * ((frame - start) / (end - start)))
    return min(max(before * root * root, min(before, after)), max(before, after))


def is_film_wide_goal(error: ErrorSpec) -> bool:
    """Whether the goal is one of the frames together: whether some of them alone would meet it is not known."""
    return isinstance(error.goal, (AccuracyGoal, TimeBudget))


def with_draw_order(scene: Scene) -> Scene:
    """The scene in the order in which it is drawn: a single one, `unmixed`, on a budget of time.

    A second drawing of some frames would take twice their time, or a far coarser cut, which flickers.
    """
    if isinstance(scene.error.goal, TimeBudget) and scene.splat.order == "depth":
        return replace(scene, splat=replace(scene.splat, order="unmixed"))
    return scene


def min_tolerance(error: ErrorSpec) -> float:
    """No frame has a smaller tolerance: `tolerance_at` stays between those that it interpolates; 0 with a goal."""
    return 0.0 if error.goal else min(tolerance for _, tolerance in error.tolerance)


def with_tolerance(scene: Scene, tolerance: float) -> Scene:
    """The same film at a constant tolerance."""
    return replace(scene, error=replace(scene.error, tolerance=((0, tolerance),), goal=None))


def with_tolerances(scene: Scene, tolerances: Mapping[int, float]) -> Scene:
    """The same film with these frames, in ascending order, at these tolerances, which need not be interpolated."""
    return replace(scene, error=replace(scene.error, tolerance=schedule_from_tolerances(tolerances), goal=None))


def schedule_from_tolerances(tolerances: Mapping[int, float]) -> ByFrame:
    """A schedule that has, at these frames, in ascending order, these tolerances, bit for bit."""
    frames = list(tolerances)
    starts = frames[:1]
    starts += [frame for before, frame in pairwise(frames) if tolerances[frame] != tolerances[before]]
    entries: list[tuple[int, float]] = []
    for start, following in zip_longest(starts, starts[1:]):
        entries.append((start, tolerances[start]))
        if following is not None and following - 1 > start:  # constant up to there
            entries.append((following - 1, tolerances[start]))
    return ((0, entries[0][1]),) if len(entries) == 1 else tuple(entries)
