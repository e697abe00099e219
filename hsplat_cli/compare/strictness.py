"""Judges the metrics of a comparison by named sets of limits, from `exact` to `cross-driver`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hsplat_cli.compare.frame_difference import COMPARISON_METRICS

# Limits by the name of the metric.
Limits = Mapping[str, float]


@dataclass(frozen=True)
class Strictness:
    """Holds a named set of limits. purpose: the use of the set, in one sentence."""

    purpose: str
    limits: Limits


# The named sets of limits. docs/benchmarks/goldens.md has the metrics of changes that must pass and of defects that
# must fail, in frames of eleven kinds with splats and of ten with bricks.
#
# Changes that must pass at `same-machine`:
# - other numbers of threads, and vectors of 128 to 512 bits: nothing differs;
# - one value in a thousand rounded differently: densest 0.047, FLIP 0.0003, bias 0.0008.
#
# Changes that must pass at `cross-driver`:
# - splats by softpipe, Mesa of 2021 and of 2025, zink, a processor without AVX: 1 grey step, densest 0.02; softpipe
#   draws a splat that the near plane clips 4 steps off, densest 0.66;
# - bricks by llvmpipe, softpipe and a processor without AVX: nothing differs;
# - bricks with rays moved by 0.0001 pixels: 2 steps, densest 0.05;
# - one value in five rounded differently: densest 0.45, FLIP 0.009, bias 0.10;
# - other processors: up to 3 steps, as others have reported.
#
# Limits that are not whole numbers are at least 1.29 times these values. A pixel that changes by 2 steps always fails
# at `same-machine`.
STRICTNESSES = {
    "exact": Strictness(
        "the same picture, but for colours at an alpha of 0: one program, one driver, one kind of processor",
        {"largest": 0.0},
    ),
    "same-machine": Strictness(
        "one driver and one kind of processor: here and there another rounding, by one step",
        {"largest": 1.0, "p99": 0.0, "flip": 0.001, "densest": 0.1, "bias": 0.01},
    ),
    "cross-driver": Strictness(
        "another driver, version or processor: small differences everywhere, and no more than that",
        {"largest": 5.0, "p99": 1.0, "flip": 0.012, "densest": 0.85, "bias": 0.15},
    ),
}


def exceeded_limits(values: Mapping[str, float], limits: Limits) -> list[str]:
    """Return the names of the metrics that exceed their limits, in the order of COMPARISON_METRICS."""
    return [
        name
        for name, metric in COMPARISON_METRICS.items()
        if name in values and name in limits and not metric.passes(values[name], limits[name])
    ]


# The error that counts as 1 where the limit allows no error, by the metric's unit: one grey step, or 0.01 for FLIP and
# SSIM, which is about as large.
_UNIT_ERRORS = {"steps": 1.0, "": 0.01}


def severity(values: Mapping[str, float], limits: Limits) -> float:
    """Return the largest ratio of an error to the error that its limit allows.

    If a limit allows no error, an error of n grey steps, or n hundredths of FLIP and SSIM, counts as 1 + n: it exceeds
    the limit, but a far larger error of another metric still counts more.
    """
    return max((_share(name, values[name], limit) for name, limit in limits.items() if name in values), default=0.0)


def _share(name: str, value: float, limit: float) -> float:
    error, allowed = (1 - value, 1 - limit) if COMPARISON_METRICS[name].higher_is_better else (value, limit)
    if error <= 0:
        return 0.0
    return error / allowed if allowed > 0 else 1 + error / _UNIT_ERRORS[COMPARISON_METRICS[name].unit]
