"""Evaluate and change the error schedule: the tolerance or the budget of each frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from typing import Any

from renderer.scene.error_section import ErrorSpec, MetricTarget, TimeBudget
from renderer.scene.motion import Motion, moving, value_at
from renderer.scene.spec import AnyScene


def tolerance_at(error: ErrorSpec, frame: int) -> float:
    """Return the tolerance of a frame, from a schedule whose goal has been replaced by tolerances."""
    assert error.goal is None, f"to be resolved first: {error.goal}"
    return value_at(error.tolerance, frame)


def accuracy_of(error: ErrorSpec) -> ErrorSpec:
    """Return an `error` section with the tolerance or the goal of `error`, and with defaults for all other keys."""
    return ErrorSpec(error.tolerance) if error.goal is None else ErrorSpec(goal=error.goal)


def is_film_wide_goal(error: ErrorSpec) -> bool:
    """Return whether the goal is for all frames of a film together, so that some frames cannot show if it is met."""
    return isinstance(error.goal, (MetricTarget, TimeBudget))


def with_draw_order(scene: AnyScene) -> AnyScene:
    """Return the scene, with draw order `unmixed` in place of `depth` if its goal is a budget of seconds.

    With `depth`, some frames are drawn in two orders and mixed. That would double their time, or need a far coarser
    cut, which flickers.
    """
    if isinstance(scene.error.goal, TimeBudget) and scene.draw_order == "depth":
        return scene.changed(lambda each: replace(each, splat=replace(each.splat, order="unmixed")))
    return scene


def min_tolerance(error: ErrorSpec) -> float:
    """Return the smallest tolerance of any frame; 0 if the schedule has a goal in place of tolerances."""
    tolerance = error.tolerance
    return 0.0 if error.goal else min(tolerance.values) if isinstance(tolerance, Motion) else tolerance


def with_error(scene: AnyScene, **changes: Any) -> AnyScene:
    """Return the scene with other values for some keys of its `error` section."""
    return scene.changed(lambda each: replace(each, error=replace(each.error, **changes)))


def with_tolerance(scene: AnyScene, tolerance: float) -> AnyScene:
    """Return the scene at a constant tolerance."""
    return with_error(scene, tolerance=tolerance, goal=None)


def with_tolerances(scene: AnyScene, tolerances: Mapping[int, float]) -> AnyScene:
    """Return the scene with a tolerance for each of these frames, in ascending order."""
    return with_error(scene, tolerance=schedule_from_tolerances(tolerances), goal=None)


def schedule_from_tolerances(tolerances: Mapping[int, float]) -> float | Motion[float]:
    """Return a tolerance that moves and has exactly these values at these frames. The frames must ascend."""
    frames, values = zip(*(next(run) for _, run in groupby(tolerances.items(), key=itemgetter(1))), strict=True)
    tolerance: float | Motion[float] = moving(Motion(frames, values, "hold", "ratio"))
    return tolerance
