"""The error schedule: which tolerance each frame is drawn at."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import replace

from renderer.scene import ErrorSpec, Scene


def tolerance_at(error: ErrorSpec, frame: int) -> float:
    """The tolerance of a frame: linear in its logarithm between the scheduled frames, constant before and after them.

    At a scheduled frame it is the scheduled number, bit for bit, and between two of them it never turns back.
    Tolerances of more than one entry are from 1e-300 to 1e300.
    """
    following = bisect_right([scheduled for scheduled, _ in error.tolerance], frame)
    if following == 0:
        return error.tolerance[0][1]
    if following == len(error.tolerance):
        return error.tolerance[-1][1]
    (start, before), (end, after) = error.tolerance[following - 1 : following + 1]
    if frame == start:
        return before
    # Every step is monotone in the frame, the rounding included, and half the logarithm's rise at a time is finite.
    # Two tolerances that are almost equal differ by a number that is exact, and their logarithms by digits too few.
    close = 0.5 * before < after < 2.0 * before
    rise = math.log1p((after - before) / before) if close else math.log(after) - math.log(before)
    root = math.exp(0.5 * rise * ((frame - start) / (end - start)))
    return min(max(before * root * root, min(before, after)), max(before, after))


def least_tolerance(error: ErrorSpec) -> float:
    """No frame has a smaller tolerance: `tolerance_at` stays between those that it interpolates."""
    return min(tolerance for _, tolerance in error.tolerance)


def at_tolerance(scene: Scene, tolerance: float) -> Scene:
    """The same film at a constant tolerance."""
    return replace(scene, error=replace(scene.error, tolerance=((0, tolerance),)))
