"""Lays out the charts of a study: error over cost, with a curve for each series of settings, and the Pareto front.

The Pareto front has the best settings: no other setting is both cheaper and more exact than one of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from hsplat_cli.measure import costs
from hsplat_cli.measure.sweep import Measurement
from hsplat_cli.reports import MARKERS, SERIES, Chart, Curve, Point, linear_axis, log_axis
from renderer.accuracy import METRICS

# Width of the line of the Pareto front, which lies below the points of curves, in pixels.
_FRONT_WIDTH = 9.0
# Metrics besides the PSNR over all pixels, each with a chart of its own: the metric, and whether it is taken over all
# pixels or over those that show the volume.
_FURTHER = (("psnr", "on_volume"), ("ssim", "everywhere"), ("flip", "everywhere"), ("delta_e_share", "everywhere"))
# Width and height of the charts of the metrics in _FURTHER, in pixels.
_FURTHER_SIZE = (640, 300)

# A function that returns a number of a measurement, such as a metric.
ValueOf = Callable[[Measurement], float]


@dataclass(frozen=True)
class CostAxis:
    """Describes the logarithmic axis of cost of a chart.

    title: the title of the axis.
    cost: a function that returns the cost of a measurement; NaN without one.
    has_bars: whether each point has a bar from the first to the third quartile of its times.
    """

    title: str
    cost: costs.CostOf
    has_bars: bool = False


# The axis of the time of a frame, in milliseconds.
TIME_AXIS = CostAxis("time of a frame, ms", lambda m: 1000 * m.frame_seconds, has_bars=True)
# The axis of the number of splats of a frame.
SPLATS_AXIS = CostAxis("splats of a frame", costs.cost_in_splats)


def _error(metric: str, pixels: str, measurement: Measurement) -> float:
    return float(getattr(measurement.overall, pixels)[metric])


# Functions that return the PSNR of a measurement, and the lower and the upper end of its interval.
_psnr, _psnr_low, _psnr_high = (partial(_error, f"psnr{end}", "everywhere") for end in ("", "_low", "_high"))


def has_intervals(measurements: Sequence[Measurement]) -> bool:
    """Return whether the PSNRs of measurements are estimates with intervals."""
    return bool(measurements) and all("psnr_low" in m.overall.everywhere for m in measurements)


def plottable(measurements: Sequence[Measurement], axis: CostAxis, value: ValueOf = _psnr) -> list[Measurement]:
    """Return the measurements that a chart can show: those with a finite value and a finite cost above 0."""
    return [m for m in measurements if 0 < axis.cost(m) < math.inf and math.isfinite(value(m))]


def study_charts(measurements: Sequence[Measurement]) -> list[Chart]:
    """Return the charts of a study: the PSNR over time and over the number of splats, and other metrics over time."""
    charts = [_tradeoff_chart(measurements, axis) for axis in (TIME_AXIS, SPLATS_AXIS) if plottable(measurements, axis)]
    if has_intervals(measurements):
        return charts
    further = [(name, pixels, partial(_error, name, pixels)) for name, pixels in _FURTHER]
    charts += [_metric_chart(measurements, *each) for each in further if plottable(measurements, TIME_AXIS, each[2])]
    return charts


def _tradeoff_chart(measurements: Sequence[Measurement], axis: CostAxis) -> Chart:
    """Lay out the chart of PSNR over cost, with labels at the points of the Pareto front."""
    shown = plottable(measurements, axis)
    front = plottable([measurements[i] for i in costs.front_of(measurements, axis.cost)], axis)
    points = [_point(m, axis, _psnr) for m in front]
    curves = _series_curves(measurements, axis, _psnr)
    ends = [end for curve in curves for bar in curve.bars for end in bar]
    return Chart(
        log_axis(axis.title, [*(axis.cost(m) for m in shown), *(10**x for x, _ in ends)]),
        linear_axis("PSNR, dB", [*map(_psnr, shown), *(y for _, y in ends)]),
        # Lines between points are straight, because `cost_at_psnr` interpolates the logarithm of the cost over PSNR.
        [Curve("Pareto front", points, "front", width=_FRONT_WIDTH), *curves],
        _tradeoff_caption(measurements, axis, front),
        f"PSNR in dB over the {axis.title}, logarithmic, of {', '.join(costs.group_by_series(shown))}",
        labels=[(point, m.setting.label.rpartition(" ")[2]) for point, m in zip(points, front, strict=True)],
    )


def _tradeoff_caption(measurements: Sequence[Measurement], axis: CostAxis, front: Sequence[Measurement]) -> str:
    """Return a caption that explains the labels and bars, and says which measurements the chart leaves out."""
    parts = ["Higher and further to the left is better."]
    if front:
        kind, _, _ = front[0].setting.label.rpartition(" ")
        parts.append(f"Labels at the points of the front, where they fit: {kind}.")
    lacks_bricks = axis is SPLATS_AXIS and costs.has_bricks(measurements)
    parts += ["Settings with bricks are not in this plot."] * lacks_bricks
    parts += ["Bars reach from the first to the third quartile of the time."] if axis.has_bars else []
    parts += ["Bars of the PSNR hold it in 95 % of cases or more."] if has_intervals(measurements) else []
    exact = sum(m.overall.everywhere["psnr"] == math.inf for m in measurements if axis.cost(m) > 0)
    parts += [f"Not shown, because equal to the truth: {exact}."] if exact else []
    return " ".join(parts)


def _metric_chart(measurements: Sequence[Measurement], name: str, pixels: str, value: ValueOf) -> Chart:
    """Lay out the chart of a metric over the time of a frame. value: a function that returns the metric."""
    axis, metric = replace(TIME_AXIS, has_bars=False), METRICS[name]
    title = f"{metric.label}{' on the volume' if pixels == 'on_volume' else ''}"
    title += f", {metric.unit}" if metric.unit else ""
    shown = plottable(measurements, axis, value)
    return Chart(
        log_axis(axis.title, [axis.cost(m) for m in shown]),
        linear_axis(title, [*map(value, shown)], "{:.0%}".format if name.endswith("_share") else "{:g}".format),
        _series_curves(measurements, axis, value),
        f"{'Higher' if metric.higher_is_better else 'Lower'} is better.",
        f"{title} over the {axis.title}, logarithmic, of {', '.join(costs.group_by_series(shown))}",
        size=_FURTHER_SIZE,
    )


def _point(measurement: Measurement, axis: CostAxis, value: ValueOf) -> Point:
    return math.log10(axis.cost(measurement)), value(measurement)


def _series_curves(measurements: Sequence[Measurement], axis: CostAxis, value: ValueOf) -> list[Curve]:
    """Return the curve of each series, with the same colour and marker in every chart."""
    curves, markers = [], list(MARKERS)
    for number, (series, numbers) in enumerate(costs.group_by_series(measurements).items()):
        shown = plottable([measurements[i] for i in numbers], axis, value)
        if not shown:
            continue
        color = SERIES[number % len(SERIES)]
        shift = number // len(SERIES)  # series that share a colour have different markers
        marker = markers[(number + shift) % len(SERIES)]
        points = [_point(m, axis, value) for m in shown]
        bars = [bar for m in shown for bar in _bars(m, axis, value)]
        curves.append(Curve(series, points, color, marker, bars=bars))
    return curves


def _bars(measurement: Measurement, axis: CostAxis, value: ValueOf) -> list[tuple[Point, Point]]:
    """Return the bars of a point, if any: between the quartiles of its times, and over the interval of its PSNR."""
    x, y = _point(measurement, axis, value)
    bars = []
    if axis.has_bars:
        low, high = (math.log10(1000 * seconds) for seconds in measurement.frame_seconds_spread)
        bars.append(((low, y), (high, y)))
    if value is _psnr and has_intervals([measurement]):
        high = _psnr_high(measurement)  # infinite if the error may be 0: the bar then ends at the point
        bars.append(((x, _psnr_low(measurement)), (x, high if math.isfinite(high) else y)))
    return bars
