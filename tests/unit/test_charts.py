"""Tests of charts: round numbers on axes, and curves, markers, bars and labels in their places."""

from __future__ import annotations

import math
import re
from itertools import pairwise

import pytest

from hsplat_cli.reports import Axis, Chart, Curve, Tick, linear_axis, log_axis, page_environment, round_numbers

PLAIN = Axis("x", 0, 10, [Tick(0, "0"), Tick(10, "10")]), Axis("y", 0, 4, [Tick(1, "1", "limit")])


def svg_of(chart: Chart) -> str:
    text = page_environment().from_string('{% from "chart.html" import chart_figure %}{{ chart_figure(chart) }}')
    return text.render(chart=chart)


@pytest.mark.parametrize(
    ("low", "high", "most", "least_step", "expected"),
    [
        (0, 10, 6, 0, [0, 2, 4, 6, 8, 10]),
        (-0.11, 0.23, 8, 0, [-0.1, -0.05, 0, 0.05, 0.1, 0.15, 0.2]),
        (21.2, 41.8, 8, 0, [25, 30, 35, 40]),
        (7, 8, 11, 1, [7, 8]),
        (7, 7, 11, 1, [7]),
        (1, 1000, 11, 1, [100, 200, 300, 400, 500, 600, 700, 800, 900, 1000]),
    ],
)
def test_numbers_on_axes_are_round(low, high, most, least_step, expected) -> None:
    assert round_numbers(low, high, most, least_step) == pytest.approx(expected)


@pytest.mark.parametrize("decades", [0, 0.1, 1, 2, 5, 9, 30])
def test_a_logarithmic_axis_has_room_for_its_numbers(decades: float) -> None:
    axis = log_axis("ms", [3.0, 3.0 * 10**decades])
    assert axis.low <= math.log10(3) and axis.high >= math.log10(3) + decades and axis.high - axis.low >= 1
    assert 2 <= len(axis.ticks) <= 8
    for tick in axis.ticks:
        assert float(tick.text.replace(" ", "")) == pytest.approx(10**tick.at)
        assert axis.low <= tick.at <= axis.high
    steps = [after.at - before.at for before, after in pairwise(axis.ticks)]
    assert min(steps) > 0.05 * (axis.high - axis.low)
    assert decades < 5 or steps == pytest.approx([steps[0]] * len(steps))


def test_one_value_has_an_axis() -> None:
    for value in (0.0, 5.0, -3.0):
        axis = linear_axis("dB", [value])
        assert axis.low < value < axis.high and axis.ticks


def test_curves_lie_in_the_places_of_their_values() -> None:
    """The axes are 564 pixels wide, from 62, and 334 high, from 348 upwards."""
    curve = Curve("a", [(0, 0), (5, 1), None, (10, 4)], "series-1", "circle", bars=[((5, 1), (5, 2))])
    svg = svg_of(Chart(*PLAIN, [curve], "a caption", "a chart", marks=[(5, "fails")], size=(640, 414)))
    assert 'd="M62.0 348.0L344.0 264.5M626.0 14.0" class="curve"' in svg
    assert 'd="M62.0 348.0h0M344.0 264.5h0M626.0 14.0h0" class="points"' in svg
    assert 'd="M344.0 264.5L344.0 181.0" class="bars"' in svg
    assert 'd="M62 264.5H626" class="limit"' in svg and ">limit</text>" in svg
    assert "<title>fails</title>" in svg and "M344.0 14V348" in svg
    assert not re.search(r"#[0-9a-f]{3,6}\b", svg)  # all colours are the page's, which may be dark


def test_labels_do_not_cover_each_other() -> None:
    crowd = [((k / 20, 2 + k / 50), f"0.{k}") for k in range(100)]
    labels = Chart(*PLAIN, [], "", "", labels=crowd).shown_labels()
    assert 5 < len(labels) < 40 and labels[0][2] == "0.0"
    for k, (right, base, text) in enumerate(labels):
        for other_right, other_base, other in labels[:k]:
            is_beside = right - 6.8 * len(text) >= other_right or other_right - 6.8 * len(other) >= right
            assert is_beside or abs(base - other_base) >= 12


def test_names_are_escaped() -> None:
    hostile = '<script>"x"</script>'
    chart = Chart(*PLAIN, [Curve(hostile, [(1, 1)], "series-1")], hostile, hostile, [((1, 1), hostile)], [(1, hostile)])
    svg = svg_of(chart)
    assert "<script" not in svg and svg.count("&lt;script&gt;") == 5
