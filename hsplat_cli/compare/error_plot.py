"""Lay out the plot of the errors over the frames: each limited metric as a share of its limit.

Heights are linear up to the limit and logarithmic above it, so that near misses and large errors can both be read. The
template `error_plot.html` draws it as SVG.
"""

from __future__ import annotations

import math
from typing import Any

from hsplat_cli.compare.figure_format import limits_text
from hsplat_cli.compare.outcome import Comparison
from renderer.study import COMPARISON_METRICS, severity

WIDTH, HEIGHT = 864, 344  # the width of a figure on the page: the plot's text is as large as the page's
LEFT, RIGHT, TOP, BOTTOM = 62, 850, 14, 278
_MIN_DENSE_FRAMES = 200  # from here on points are small
_MAX_DECADES = 4  # larger errors are drawn at this many decades above the limit


def plot_errors(comparison: Comparison) -> dict[str, Any] | None:
    """Lay out the plot in pixels, as the template expects it; return None if no metric has a limit and nothing fails.

    x_ticks, y_ticks: position and text. frames: x and outcome of each frame. labels: of the metrics, by name.
    height: a function that returns the y of a metric in an outcome.
    """
    outcomes = comparison.outcomes
    names = [name for name in COMPARISON_METRICS if any(name in outcome.figures for outcome in outcomes)]
    if not names and comparison.passes:
        return None
    numbers = [comparison.frame_numbers.get(outcome.name, place) for place, outcome in enumerate(outcomes, 1)]
    first, last = min(numbers), max(numbers)
    largest = max(severity(outcome.figures, outcome.limits) for outcome in outcomes)
    decades = min(max(math.ceil(math.log10(max(largest, 1.0))), 1), _MAX_DECADES)

    def x(number: float) -> float:
        share = 0.5 if first == last else (number - first) / (last - first)
        return LEFT + 10 + share * (RIGHT - LEFT - 20)

    def y(share: float) -> float:
        height = share if share <= 1 else 1 + min(math.log10(share), decades)
        return BOTTOM - height / (1 + decades) * (BOTTOM - TOP)

    metrics = ", ".join(COMPARISON_METRICS[name].label for name in names)
    powers = [(10.0**power, f"{10**power:,}".replace(",", " ")) for power in range(1, decades + 1)]
    return {
        "alt": f"Errors of {len(outcomes)} frames as shares of their limits, of which {comparison.num_failing} fail: "
        f"{metrics}",
        "frames": [(x(number), outcome) for number, outcome in zip(numbers, outcomes, strict=True)],
        "labels": {name: limits_text(name, [o.limits[name] for o in outcomes if name in o.limits]) for name in names},
        "height": lambda outcome, name: y(severity({name: outcome.figures[name]}, outcome.limits)),
        "x_ticks": [(x(number), str(number)) for number in _ticks(first, last)],
        "y_ticks": [(y(share), text) for share, text in [(0, "0"), (0.5, "0.5"), (1, "1"), *powers]],
        "has_frame_numbers": bool(comparison.frame_numbers),
        "is_dense": len(outcomes) > _MIN_DENSE_FRAMES,
        "box": (WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM),
    }


def _ticks(first: int, last: int) -> list[int]:
    """Return at most 11 round numbers."""
    span = max(last - first, 1)
    power = 10 ** max(math.ceil(math.log10(span / 10)) - 1, 0)
    step = next(factor * power for factor in (1, 2, 5, 10, 20) if span / (factor * power) <= 10)
    return list(range(-(-first // step) * step, last + 1, step))
