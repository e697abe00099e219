"""How strict a comparison of frames is: which figures are limited, and where the limits are.

The numbers come from docs/benchmarks/goldens.md: each figure beside changes that must pass and defects that must not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from renderer.study.frame_difference import COMPARISON_METRICS

Limits = Mapping[str, float]  # of figures, by name


@dataclass(frozen=True)
class Strictness:
    """A named set of limits. purpose: when to use it, in one sentence."""

    name: str
    purpose: str
    limits: Limits


# What must pass, in frames of eleven kinds (docs/benchmarks/goldens.md). At `same-machine`: other numbers of threads
# and vectors of 128 to 512 bits, which change nothing, and one value in a thousand rounded otherwise: densest 0.047,
# FLIP 0.0003, bias 0.0008. At `cross-driver`: softpipe, Mesa of 2021 and of 2025, zink, a processor without AVX, which
# stay at 1 level and densest 0.02, but for a splat that the near plane cuts, which softpipe has off by 4 levels and
# 0.66; and one value in five rounded otherwise, more than any of them does: densest 0.45, FLIP 0.009, bias 0.10. Others
# have seen up to 3 levels between processors. Limits that are no whole numbers have at least 1.29 times room. In
# return, what moves a pixel by 2 levels always fails at `same-machine`; what levels cannot see is listed there, too.
STRICTNESS_LEVELS = {
    level.name: level
    for level in (
        Strictness(
            "exact",
            "the same picture, but for colours at an alpha of 0: one program, one driver, one kind of processor",
            {"largest": 0.0},
        ),
        Strictness(
            "same-machine",
            "one driver and one kind of processor: here and there another rounding, by one level",
            {"largest": 1.0, "p99": 0.0, "flip": 0.001, "densest": 0.1, "bias": 0.01},
        ),
        Strictness(
            "cross-driver",
            "another driver, version or processor: small differences everywhere, and no more than that",
            {"largest": 5.0, "p99": 1.0, "flip": 0.012, "densest": 0.85, "bias": 0.15},
        ),
    )
}


def exceeded_limits(figures: Mapping[str, float], limits: Limits) -> list[str]:
    """Names of the figures that are not within their limits, in the order of COMPARISON_METRICS."""
    return [
        name
        for name in COMPARISON_METRICS
        if name in figures and name in limits and not COMPARISON_METRICS[name].passes(figures[name], limits[name])
    ]


# What an error is measured by where nothing is allowed: a level, and about what a level everywhere is to the eye.
_UNIT_ERRORS = {"levels": 1.0, "": 0.01}


def severity(figures: Mapping[str, float], limits: Limits) -> float:
    """How many times as far off as its limit allows the worst figure is.

    Where a limit allows nothing, an error of n levels, or hundredths of FLIP and SSIM, counts as 1 + n: over the limit,
    but no more so than what is further off in another figure.
    """
    return max((_share(name, figures[name], limit) for name, limit in limits.items() if name in figures), default=0.0)


def _share(name: str, value: float, limit: float) -> float:
    error, allowed = (1 - value, 1 - limit) if COMPARISON_METRICS[name].higher_is_better else (value, limit)
    if error <= 0:
        return 0.0
    return error / allowed if allowed > 0 else 1 + error / _UNIT_ERRORS[COMPARISON_METRICS[name].unit]
