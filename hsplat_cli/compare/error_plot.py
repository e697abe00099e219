"""The error over the loop as an SVG: each figure that is limited, as a share of its limit, frame by frame.

Heights are linear up to the limit and logarithmic above it, so that a frame that nearly fails can be read beside one
that fails a thousandfold.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hsplat_cli.compare.figure_format import limits_text
from hsplat_cli.compare.outcome import Comparison, Outcome
from renderer.study import COMPARISON_METRICS, severity

if TYPE_CHECKING:
    from markupsafe import Markup

WIDTH, HEIGHT = 864, 344  # as wide as a figure of the page may be: its text is as large as the page's
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 850, 14, 278
_COLORS = ("series-1", "series-3", "series-4", "series-5", "series-6", "series-8")  # series-2 is for what fails
_DASHES = ("none", "7 3", "2 3", "10 3 2 3", "5 5", "1 5")
_MIN_DENSE_FRAMES = 200  # so many frames are about as many as there is room for points
_MAX_PLOT_DECADES = 4  # what is further over its limit is drawn there


@dataclass(frozen=True)
class LegendEntry:
    """A line of it. color: a variable of the page's style. dash: of the stroke."""

    color: str
    dash: str
    label: str


@dataclass(frozen=True)
class ErrorPlot:
    """The plot and its legend.

    has_frame_numbers: frames stand there by their numbers, not only in their order.
    """

    svg: Markup
    legend: Sequence[LegendEntry]
    has_frame_numbers: bool


def plot_errors(comparison: Comparison) -> ErrorPlot | None:
    """None where nothing is to be plotted: no figure has a limit, and nothing fails."""
    outcomes = comparison.outcomes
    names = [name for name in COMPARISON_METRICS if any(name in o.figures and name in o.limits for o in outcomes)]
    if not names and comparison.passes:
        return None
    axes = _axes(outcomes)
    num_failing = sum(not outcome.passes for outcome in outcomes)
    alt = f"Errors of {len(outcomes)} frames as shares of their limits, of which {num_failing} fail: " + ", ".join(
        COMPARISON_METRICS[name].label for name in names
    )
    legend = [
        LegendEntry(color, dash, limits_text(name, [o.limits[name] for o in outcomes if name in o.limits]))
        for name, color, dash in zip(names, _COLORS, _DASHES, strict=False)
    ]
    lines = [_line(axes, outcomes, name, style) for name, style in zip(names, legend, strict=True)]
    parts = [_grid(axes), *_failures(axes, outcomes), *lines]
    return ErrorPlot(_svg(alt, parts), legend, axes.has_frame_numbers)


# --------------------------------------------------------------------------------------------------------------- axes


@dataclass(frozen=True)
class _Axes:
    """positions: of the frames, from first to last. decades: above the limit."""

    positions: Sequence[int]
    first: int
    last: int
    has_frame_numbers: bool
    decades: int

    def x(self, position: float) -> float:
        if self.first == self.last:
            return (_LEFT + _RIGHT) / 2
        return _LEFT + 10 + (position - self.first) / (self.last - self.first) * (_RIGHT - _LEFT - 20)

    def y(self, share: float) -> float:
        """As far as there are decades."""
        height = share if share <= 1 else 1 + min(math.log10(share), self.decades)
        return _BOTTOM - height / (1 + self.decades) * (_BOTTOM - _TOP)

    def steps(self) -> list[tuple[float, str]]:
        """Heights, and what is written beside them."""
        powers = [(10.0**power, f"{10**power:,}".replace(",", " ")) for power in range(1, self.decades + 1)]
        return [(0, "0"), (0.5, "0.5"), (1, "1"), *powers]


def _axes(outcomes: Sequence[Outcome]) -> _Axes:
    numbers = [outcome.number for outcome in outcomes if outcome.number is not None]
    has_frame_numbers = len(set(numbers)) == len(outcomes)
    largest = max(severity(outcome.figures, outcome.limits) for outcome in outcomes)
    decades = min(max(math.ceil(math.log10(max(largest, 1.0))), 1), _MAX_PLOT_DECADES)
    positions = numbers if has_frame_numbers else range(1, len(outcomes) + 1)
    return _Axes(positions, min(positions), max(positions), has_frame_numbers, decades)


def _ticks(first: int, last: int) -> list[int]:
    """At most 11 round numbers."""
    span = max(last - first, 1)
    power = 10 ** max(math.ceil(math.log10(span / 10)) - 1, 0)
    step = next(factor * power for factor in (1, 2, 5, 10, 20) if span / (factor * power) <= 10)
    return list(range(-(-first // step) * step, last + 1, step))


# ------------------------------------------------------------------------------------------------------------ drawing


def _grid(axes: _Axes) -> Markup:
    parts = []
    for share, text in axes.steps():
        y = axes.y(share)
        is_limit = share == 1
        parts += [
            _element("path", d=f"M{_LEFT} {y:.1f}H{_RIGHT}", class_="limit" if is_limit else "grid"),
            _text(text, _LEFT - 8, y + 4, anchor="end", class_="tick strong" if is_limit else "tick"),
        ]
    for position in _ticks(axes.first, axes.last):
        x = axes.x(position)
        parts += [
            _element("path", d=f"M{x:.1f} {_BOTTOM}v5", class_="axis"),
            _text(str(position), x, _BOTTOM + 34, anchor="middle", class_="tick"),
        ]
    title = "number of the frame" if axes.has_frame_numbers else "place of the frame in the order of names"
    middle = (_TOP + _BOTTOM) / 2
    parts += [
        _text("limit", _RIGHT, axes.y(1) - 5, anchor="end", class_="tick strong"),
        _text(title, (_LEFT + _RIGHT) / 2, HEIGHT - 8, anchor="middle"),
        _text("error, times its limit", 14, middle, anchor="middle", transform=f"rotate(-90 14 {middle})"),
    ]
    return _joined(parts)


def _failures(axes: _Axes, outcomes: Sequence[Outcome]) -> list[Markup]:
    """A line over the whole height, and a cross below it, with words to be seen under the mouse."""
    parts = []
    for position, outcome in zip(axes.positions, outcomes, strict=True):
        if not outcome.passes:
            x = axes.x(position)
            label = _element("title", f"{outcome.name}: {outcome.why}")
            line = _element("path", d=f"M{x:.1f} {_TOP}V{_BOTTOM}", class_="failure")
            cross = _element("path", d=f"M{x - 4:.1f} {_BOTTOM + 8}l8 8m0 -8l-8 8", class_="cross")
            parts.append(_element("g", _joined([label, line, cross])))
    return parts


def _line(axes: _Axes, outcomes: Sequence[Outcome], name: str, legend: LegendEntry) -> Markup:
    """Through a point for each frame that has the figure and a limit to it, broken where one has not."""
    line, points, is_drawing = [], [], False
    for position, outcome in zip(axes.positions, outcomes, strict=True):
        there = name in outcome.figures and name in outcome.limits
        if there:
            share = severity({name: outcome.figures[name]}, {name: outcome.limits[name]})
            place = f"{axes.x(position):.1f} {axes.y(share):.1f}"
            line.append(f"{'L' if is_drawing else 'M'}{place}")
            points.append(f"M{place}h0")
        is_drawing = there
    style = f"stroke: var(--{legend.color})"
    dots = "points dense" if len(outcomes) > _MIN_DENSE_FRAMES else "points"
    return _joined(
        [
            _element("path", d="".join(line), class_="curve", style=f"{style}; stroke-dasharray: {legend.dash}"),
            _element("path", d="".join(points), class_=dots, style=style),
        ]
    )


def _svg(alt: str, parts: Iterable[Markup]) -> Markup:
    box = f"0 0 {WIDTH} {HEIGHT}"
    return _element("svg", _joined(parts), viewBox=box, role="img", aria_label=alt)


def _text(label: str, x: float, y: float, *, anchor: str, **attributes: str) -> Markup:
    return _element("text", label, x=f"{x:.1f}", y=f"{y:.1f}", text_anchor=anchor, **attributes)


def _element(tag: str, content: str = "", **attributes: str) -> Markup:
    """Everything that is not Markup is escaped; `text_anchor` is `text-anchor`, `class_` is `class`."""
    from markupsafe import Markup

    named = ((name.rstrip("_").replace("_", "-"), value) for name, value in attributes.items())
    written = _joined((Markup(' {}="{}"').format(name, value) for name, value in named), "")
    return Markup("<{0}{1}>{2}</{0}>").format(Markup(tag), written, content)


def _joined(parts: Iterable[Markup], between: str = "\n") -> Markup:
    from markupsafe import Markup

    return Markup(between).join(parts)
