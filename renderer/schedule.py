"""The error schedule: which tolerance each frame is drawn at."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import replace

from renderer.scene import ErrorSpec, Scene


def tolerance_at(error: ErrorSpec, frame: int) -> float:
    """The tolerance of a frame: linear in its logarithm between the scheduled frames, constant before and after them.

    At a scheduled frame it is the scheduled number, bit for bit. Tolerances of more than one entry are > 0.
    """
    following = bisect_right([scheduled for scheduled, _ in error.tolerance], frame)
    if following == 0:
        return error.tolerance[0][1]
    if following == len(error.tolerance):
        return error.tolerance[-1][1]
    (start, before), (end, after) = error.tolerance[following - 1 : following + 1]
    fraction = (frame - start) / (end - start)
    # A product of powers neither overflows nor, at fraction 0, rounds.
    return float(before ** (1.0 - fraction) * after**fraction)


def least_tolerance(error: ErrorSpec) -> float:
    """No frame has a smaller tolerance, however its interpolation is rounded."""
    least = min(tolerance for _, tolerance in error.tolerance)
    return least if len(error.tolerance) == 1 else least * (1 - 1e-9)


def at_tolerance(scene: Scene, tolerance: float) -> Scene:
    """The same film at a constant tolerance."""
    return replace(scene, error=replace(scene.error, tolerance=((0, tolerance),)))
