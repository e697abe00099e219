"""Lays out charts: axes with ticks, curves, points and their bars. The template `chart.html` draws them as SVG."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

# Width of the space left of a chart's axes, in pixels, for the numbers and the title of the y axis.
_LEFT = 62
# Width of the space right of a chart's axes, in pixels.
_RIGHT = 14
# Height of the space above a chart's axes, in pixels.
_TOP = 14
# Height of the space below a chart's axes, in pixels, for the numbers and the title of the x axis.
_BOTTOM = 52
# Height of the further space below a chart's axes, in pixels, if crosses mark values of the x axis.
_CROSSES = 14
# Height of the text beside a point, in pixels.
_LABEL_PX = 12.0
# Approximate width of a letter of the text beside a point, in pixels.
_LETTER_PX = 6.8
# Distance between a point and the text beside it, in pixels, along each axis.
_LABEL_GAP_PX = 6.0
# Length by which an axis exceeds the range of its values at each end, as a share of this range.
_MARGIN = 0.06
# Largest number of ticks on an axis.
_MOST_TICKS = 8

# The SVG path of each marker of a point, relative to the point, and the width of the path's stroke in pixels.
MARKERS = {
    "circle": ("h0", 7.0),
    "square": ("m-2.5-2.5h5v5h-5z", 1.5),
    "diamond": ("m0-3.5l3.5 3.5l-3.5 3.5l-3.5-3.5z", 1.5),
    "up": ("m0-3.5l3.5 6.5h-7z", 1.5),
    "down": ("m0 3.5l3.5-6.5h-7z", 1.5),
    "left": ("m-3.5 0l6.5-3.5v7z", 1.5),
    "right": ("m3.5 0l-6.5-3.5v7z", 1.5),
    "cross": ("m-3-3l6 6m0-6l-6 6", 1.5),
    "small circle": ("h0", 5.0),
    "dot": ("h0", 2.5),
}
# The names of the eight colours of curves: keys of `PALETTE` in html.py.
SERIES = tuple(f"series-{number}" for number in range(1, 9))

# A point of a chart: its values on the x axis and the y axis.
Point = tuple[float, float]


class Tick(NamedTuple):
    """Marks a number on an axis.

    at: the place on the axis. text: the number as text. note: a text at the end of the tick's line across the chart; a
    line with a note is drawn strong.
    """

    at: float
    text: str
    note: str = ""


@dataclass(frozen=True)
class Axis:
    """Describes an axis, which is linear in its values; on a logarithmic axis, values are decimal logarithms.

    low, high: the values at both ends.
    """

    title: str
    low: float
    high: float
    ticks: Sequence[Tick]

    def share(self, value: float) -> float:
        """Return the place of a value along the axis, from 0 at its low end to 1 at its high end."""
        return (value - self.low) / (self.high - self.low)


@dataclass(frozen=True)
class Curve:
    """Describes a curve of a chart, with its name in the legend.

    points: None where the curve breaks. color: a key of PALETTE. marker: a key of MARKERS, or empty for no markers.
    dash: the dashes as in SVG, `none` for a whole line, empty for points without a line. width: the width of the line,
    in pixels. bars: straight lines, each from a point to another point.
    """

    name: str
    points: Sequence[Point | None]
    color: str
    marker: str = ""
    dash: str = "none"
    width: float = 1.5
    bars: Sequence[tuple[Point, Point]] = ()


@dataclass(frozen=True)
class Chart:
    """Describes a chart with its caption.

    alt: a description for readers who cannot see the chart. labels: texts beside points. marks: values of the x axis
    that are marked by a cross, each with a text about it. size: width and height, in pixels.
    """

    x: Axis
    y: Axis
    curves: Sequence[Curve]
    caption: str
    alt: str
    labels: Sequence[tuple[Point, str]] = ()
    marks: Sequence[tuple[float, str]] = ()
    size: tuple[int, int] = (640, 400)

    @property
    def box(self) -> tuple[int, int, int, int]:
        """Return left, right, top and bottom of the axes, in pixels."""
        width, height = self.size
        return _LEFT, width - _RIGHT, _TOP, height - _BOTTOM - _CROSSES * bool(self.marks)

    def across(self, x: float) -> float:
        """Return the distance of a value of the x axis from the chart's left edge, in pixels."""
        left, right, _, _ = self.box
        return left + self.x.share(x) * (right - left)

    def down(self, y: float) -> float:
        """Return the distance of a value of the y axis from the chart's upper edge, in pixels."""
        _, _, top, bottom = self.box
        return bottom - self.y.share(y) * (bottom - top)

    def line_path(self, curve: Curve) -> str:
        """Return a curve's line as an SVG path."""
        parts = []
        is_first = True
        for point in curve.points:
            if point is not None:
                parts.append(("M" if is_first else "L") + self._place(point))
            is_first = point is None
        return "".join(parts)

    def marker_path(self, curve: Curve) -> str:
        """Return the markers of a curve's points as an SVG path."""
        marker, _ = MARKERS[curve.marker]
        return "".join(f"M{self._place(point)}{marker}" for point in curve.points if point is not None)

    def bar_path(self, curve: Curve) -> str:
        """Return a curve's bars as an SVG path."""
        return "".join(f"M{self._place(start)}L{self._place(end)}" for start, end in curve.bars)

    def shown_labels(self) -> list[tuple[float, float, str]]:
        """Return right end and base line, in pixels, and text of each label that covers no earlier label.

        A label is above and left of its point.
        """
        shown: list[tuple[float, float, str]] = []
        for (x, y), text in self.labels:
            right, base = self.across(x) - _LABEL_GAP_PX, self.down(y) - _LABEL_GAP_PX
            if not any(
                abs(base - other_base) < _LABEL_PX
                and right - _LETTER_PX * len(text) < other_right
                and other_right - _LETTER_PX * len(other) < right
                for other_right, other_base, other in shown
            ):
                shown.append((right, base, text))
        return shown

    def _place(self, point: Point) -> str:
        return f"{self.across(point[0]):.1f} {self.down(point[1]):.1f}"


def linear_axis(title: str, values: Sequence[float], text: Callable[[float], str] = "{:g}".format) -> Axis:
    """Return an axis a little longer than the range of the values, with ticks at round numbers."""
    low, high = min(values), max(values)
    margin = _MARGIN * (high - low) or 0.5 * abs(high) or 0.5
    ticks = [Tick(at, text(at)) for at in round_numbers(low - margin, high + margin, _MOST_TICKS)]
    return Axis(title, low - margin, high + margin, ticks)


def log_axis(title: str, values: Sequence[float]) -> Axis:
    """Return a logarithmic axis, at least a decade long, for values above 0."""
    low, high = math.log10(min(values)), math.log10(max(values))
    widening = max(_MARGIN * (high - low), (1 - (high - low)) / 2)
    low, high = low - widening, high + widening
    for factors in ((1, 2, 5), (1, 3), (1,)):
        found = [
            (math.log10(factor) + power, factor * 10.0**power)
            for power in range(math.floor(low), math.ceil(high))
            for factor in factors
        ]
        ticks = [Tick(at, f"{value:,.10g}".replace(",", " ")) for at, value in found if low <= at <= high]
        if len(ticks) <= _MOST_TICKS:
            break
    return Axis(title, low, high, ticks[:: -(-len(ticks) // _MOST_TICKS)])


def round_numbers(low: float, high: float, most: int, least_step: float = 0.0) -> list[float]:
    """Return at most `most` round numbers from low to high, in equal steps of 1, 2 or 5 times a power of ten."""
    span = max(high - low, least_step)
    power = math.floor(math.log10(span / most))
    steps = (factor * 10.0 ** (power + more) for more in (0, 1, 2) for factor in (1, 2, 5))
    step = next(step for step in steps if step >= least_step and span / step <= most - 1)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [round(number * step, 12) for number in range(first, last + 1)]
