"""Lay out the plot of the errors over the frames: each limited metric as a share of its limit.

Heights are linear up to the limit and logarithmic above it, so that near misses and large errors can both be read. The
template `error_plot.html` draws it as SVG.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hsplat_cli.compare.figure_format import limits_text
from hsplat_cli.compare.outcome import Comparison, Outcome
from renderer.study import COMPARISON_METRICS, severity

WIDTH, HEIGHT = 864, 344  # the width of a figure on the page: the plot's text is as large as the page's
LEFT, RIGHT, TOP, BOTTOM = 62, 850, 14, 278
_COLORS = ("series-1", "series-3", "series-4", "series-5", "series-6", "series-8")  # series-2 marks failures
_DASHES = ("none", "7 3", "2 3", "10 3 2 3", "5 5", "1 5")
_MIN_DENSE_FRAMES = 200  # from here on points are small
_MAX_DECADES = 4  # larger errors are drawn at this many decades above the limit


@dataclass(frozen=True)
class Curve:
    """A metric over the frames, with its entry in the legend.

    points: (x, y) of each frame with this metric, None for a frame without. color: a CSS variable. dash: of the stroke.
    """

    label: str
    color: str
    dash: str
    points: Sequence[tuple[float, float] | None]


@dataclass(frozen=True)
class ErrorPlot:
    """The plot, in pixels. x_ticks, y_ticks: position and text. failures: x and description of each failing frame.

    has_frame_numbers: the x axis has frame numbers, not places in the order of names.
    """

    alt: str
    curves: Sequence[Curve]
    failures: Sequence[tuple[float, str]]
    x_ticks: Sequence[tuple[float, str]]
    y_ticks: Sequence[tuple[float, str]]
    has_frame_numbers: bool
    is_dense: bool
    box: tuple[int, int, int, int, int, int] = (WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM)


def plot_errors(comparison: Comparison) -> ErrorPlot | None:
    """Lay out the plot; return None if no metric has a limit and nothing fails."""
    outcomes = comparison.outcomes
    names = [name for name in COMPARISON_METRICS if any(name in o.figures and name in o.limits for o in outcomes)]
    if not names and comparison.passes:
        return None
    numbers = [outcome.number for outcome in outcomes if outcome.number is not None]
    has_frame_numbers = len(set(numbers)) == len(outcomes)
    positions = numbers if has_frame_numbers else range(1, len(outcomes) + 1)
    first, last = min(positions), max(positions)
    largest = max(severity(outcome.figures, outcome.limits) for outcome in outcomes)
    decades = min(max(math.ceil(math.log10(max(largest, 1.0))), 1), _MAX_DECADES)

    def x(position: float) -> float:
        share = 0.5 if first == last else (position - first) / (last - first)
        return LEFT + 10 + share * (RIGHT - LEFT - 20)

    def y(share: float) -> float:
        height = share if share <= 1 else 1 + min(math.log10(share), decades)
        return BOTTOM - height / (1 + decades) * (BOTTOM - TOP)

    def point(outcome: Outcome, position: float, name: str) -> tuple[float, float] | None:
        if name not in outcome.figures or name not in outcome.limits:
            return None
        return x(position), y(severity({name: outcome.figures[name]}, {name: outcome.limits[name]}))

    frames = list(zip(outcomes, positions, strict=True))
    failures = [(x(position), f"{o.name}: {o.why}") for o, position in frames if not o.passes]
    labels = ", ".join(COMPARISON_METRICS[name].label for name in names)
    powers = [(10.0**power, f"{10**power:,}".replace(",", " ")) for power in range(1, decades + 1)]
    return ErrorPlot(
        f"Errors of {len(outcomes)} frames as shares of their limits, of which {len(failures)} fail: {labels}",
        [
            Curve(
                limits_text(name, [o.limits[name] for o in outcomes if name in o.limits]),
                color,
                dash,
                [point(outcome, position, name) for outcome, position in frames],
            )
            for name, color, dash in zip(names, _COLORS, _DASHES, strict=False)
        ],
        failures,
        [(x(position), str(position)) for position in _ticks(first, last)],
        [(y(share), text) for share, text in [(0, "0"), (0.5, "0.5"), (1, "1"), *powers]],
        has_frame_numbers,
        len(outcomes) > _MIN_DENSE_FRAMES,
    )


def _ticks(first: int, last: int) -> list[int]:
    """Return at most 11 round numbers."""
    span = max(last - first, 1)
    power = 10 ** max(math.ceil(math.log10(span / 10)) - 1, 0)
    step = next(factor * power for factor in (1, 2, 5, 10, 20) if span / (factor * power) <= 10)
    return list(range(-(-first // step) * step, last + 1, step))
