"""Describe the columns in which the page and the terminal show measurements."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hsplat_cli.reports.costs import has_bricks, has_splats
from hsplat_cli.reports.number_format import bytes_text, metric_text, ms_text
from renderer.study import METRICS, Measurement

# Headings of two lines for the metrics whose labels are too long.
_HEADINGS = {"max_error": ("largest", ""), "flip_p99": ("FLIP", "99 %"), "delta_e_share": ("Delta-E", "> 2.3")}


@dataclass(frozen=True)
class Column:
    """A column of a table of measurements. unit: below the title. value: sort key, NaN if absent."""

    title: str
    unit: str
    value: Callable[[Measurement], float]
    text: Callable[[Measurement], str]


def cost_columns(measurements: Sequence[Measurement], format_count: Callable[[float | None], str]) -> list[Column]:
    """Return the columns of counts, times and memory, the last two being `once` and `memory`."""
    shows_bricks, shows_splats = has_bricks(measurements), has_splats(measurements)
    title, unit = ("bricks", "or cells" * shows_splats) if shows_bricks else ("cells", "")
    counts = [_number(title, unit, lambda m: m.num_cells, format_count)]
    if shows_splats or not shows_bricks:
        counts.append(_number("splats", "", lambda m: m.num_splats, format_count))
    return [
        *counts,
        _number("time", "ms", lambda m: m.frame_seconds, ms_text),
        Column(
            "quartiles",
            "ms",
            lambda m: m.frame_seconds_spread[1] - m.frame_seconds_spread[0],
            lambda m: " to ".join(map(ms_text, m.frame_seconds_spread)),
        ),
        _number("once", "ms", _seconds_once, ms_text),
        _number("memory", "", lambda m: m.peak_bytes, bytes_text),
    ]


def metric_column(name: str, pixels: str) -> Column:
    """Return the column of a metric of METRICS over the pixels `everywhere` or `on_volume`."""
    metric = METRICS[name]
    title, unit = _HEADINGS.get(name, (metric.label, metric.unit))
    return _number(title, unit, lambda m: getattr(m.overall, pixels)[name], partial(metric_text, metric))


def _number(title: str, unit: str, value: Callable[[Measurement], float | None], text: Callable[[Any], str]) -> Column:
    def or_nan(measurement: Measurement) -> float:
        found = value(measurement)
        return math.nan if found is None else found

    return Column(title, unit, or_nan, lambda m: text(value(m)))


def _seconds_once(measurement: Measurement) -> float:
    """Return the seconds of the stages that serve all frames; NaN without any."""
    return sum(float(np.median(seconds)) for seconds in measurement.seconds.values()) or math.nan
