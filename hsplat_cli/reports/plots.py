"""Plot error against cost, with matplotlib: a curve for each series, and the Pareto front. Inside `plot_style`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hsplat_cli.reports import costs
from hsplat_cli.reports.html import LIGHT_PALETTE, SERIES_COLORS
from renderer.accuracy import METRICS
from renderer.study import Measurement

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import BboxBase

_MARKERS = "osD^vP<>"
_LABEL_PT = 8.5
_WIDTH_IN = 8.0


@dataclass(frozen=True)
class CostAxis:
    """A logarithmic axis of cost. cost: that of a measurement, NaN without one. has_bars: from quartile to quartile."""

    title: str
    cost: costs.CostOf
    has_bars: bool = False


TIME_AXIS = CostAxis("time of a frame, ms", lambda m: 1000 * m.frame_seconds, has_bars=True)
SPLATS_AXIS = CostAxis("splats of a frame", costs.cost_in_splats)


def _error(metric: str, pixels: str, measurement: Measurement) -> float:
    return float(getattr(measurement.overall, pixels)[metric])


_psnr, _psnr_low, _psnr_high = (partial(_error, f"psnr{end}", "everywhere") for end in ("", "_low", "_high"))


def has_intervals(measurements: Sequence[Measurement]) -> bool:
    """Return whether PSNRs are estimates with intervals."""
    return bool(measurements) and all("psnr_low" in m.overall.everywhere for m in measurements)


def plottable(
    measurements: Sequence[Measurement], axis: CostAxis, value: Callable[[Measurement], float] = _psnr
) -> list[Measurement]:
    """Return the measurements with a finite value and a finite cost above 0."""
    return [m for m in measurements if 0 < axis.cost(m) < math.inf and math.isfinite(value(m))]


def plottable_front(measurements: Sequence[Measurement], axis: CostAxis) -> list[Measurement]:
    """Return the plottable measurements on the Pareto front."""
    return plottable([measurements[i] for i in costs.front_of(measurements, axis.cost)], axis)


def tradeoff_figure(measurements: Sequence[Measurement], axis: CostAxis) -> Figure:
    """Plot the PSNR of all plottable measurements over their cost, with labels at the points of the front."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH_IN, 5.2), layout="constrained")
    axes = figure.subplots()
    _draw_front(axes, plottable_front(measurements, axis), axis)
    _draw_series(axes, measurements, axis, _psnr)
    _format_axes(axes, axis, "PSNR, dB", many_ticks=True)
    _add_legend(figure, axes)
    _remove_overlapping_labels(figure, axes)
    return figure


def metrics_figure(measurements: Sequence[Measurement]) -> Figure:
    """Plot further metrics over the time of a frame, one panel each."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import PercentFormatter

    figure = Figure(figsize=(_WIDTH_IN, 6.8), layout="constrained")
    panels = (("psnr", "on_volume"), ("ssim", "everywhere"), ("flip", "everywhere"), ("delta_e_share", "everywhere"))
    for axes, (name, pixels) in zip(figure.subplots(2, 2).flat, panels, strict=True):
        metric = METRICS[name]
        title = f"{metric.label}{' on the volume' if pixels == 'on_volume' else ''}"
        if metric.unit:
            title += f", {metric.unit}"
        elif name.endswith("_share"):
            axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        _draw_series(axes, measurements, replace(TIME_AXIS, has_bars=False), partial(_error, name, pixels))
        _format_axes(axes, TIME_AXIS, title, many_ticks=False)
        axes.set_title(
            f"{'higher' if metric.higher_is_better else 'lower'} is better",
            color=LIGHT_PALETTE["muted"],
            fontsize=_LABEL_PT,
            loc="right",
        )
    _add_legend(figure, axes)
    return figure


def _draw_front(axes: Axes, front: Sequence[Measurement], axis: CostAxis) -> None:
    """Draw straight lines, as `cost_at_psnr` interpolates the logarithm of the cost over PSNR, and label their points.

    Labels lie on the side of the front where nothing else does: no setting is both faster and more exact.
    """
    if not front:
        return
    amounts, psnrs = [axis.cost(m) for m in front], [_psnr(m) for m in front]
    line: dict[str, Any] = {
        "color": LIGHT_PALETTE["front"],
        "linewidth": 9.0,
        "solid_capstyle": "round",
        "zorder": 1.0,
    }
    label: dict[str, Any] = {"xytext": (-5, 4), "ha": "right", "color": LIGHT_PALETTE["ink"]}
    axes.plot(amounts, psnrs, label="Pareto front", **line)
    for m, cost, psnr in zip(front, amounts, psnrs, strict=True):
        text = m.setting.label.rpartition(" ")[2]
        axes.annotate(text, (cost, psnr), textcoords="offset points", fontsize=_LABEL_PT, zorder=5, **label)


def _draw_series(
    axes: Axes, measurements: Sequence[Measurement], axis: CostAxis, value: Callable[[Measurement], float]
) -> None:
    for number, (series, numbers) in enumerate(costs.group_by_series(measurements).items()):
        members = [measurements[i] for i in numbers]
        style = _series_style(number)
        shown = plottable(members, axis, value)
        if not shown:
            continue
        amounts, values = np.array([axis.cost(m) for m in shown]), [value(m) for m in shown]
        bars: dict[str, Any] = {}
        if axis.has_bars:
            low, high = 1000 * np.array([m.frame_seconds_spread for m in shown]).T
            # Rounding may put a quartile on the wrong side of the median.
            bars["xerr"] = np.maximum([amounts - low, high - amounts], 0)
        if value is _psnr and has_intervals(shown):
            bars["yerr"] = [[_psnr(m) - _psnr_low(m) for m in shown], [_psnr_high(m) - _psnr(m) for m in shown]]
        if bars:
            axes.errorbar(amounts, values, **bars, fmt="none", ecolor=style["color"], elinewidth=1.0, capsize=2.5)
        axes.plot(amounts, values, label=series, **style)


def _series_style(number: int) -> dict[str, Any]:
    """Return the style of the series with this number."""
    shift = number // len(SERIES_COLORS)  # the same colours again, with other markers
    style = {"color": SERIES_COLORS[number % len(SERIES_COLORS)], "marker": _MARKERS[(number + shift) % len(_MARKERS)]}
    return style | {"markersize": 4.5, "linewidth": 1.4, "zorder": 3.0}


def _format_axes(axes: Axes, axis: CostAxis, title: str, *, many_ticks: bool) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    axes.set_xscale("log")
    low, high = axes.get_xlim()
    if high / low < 10:  # at least a decade, so that the axis has ticks
        middle = math.sqrt(low * high)
        axes.set_xlim(middle / math.sqrt(10), middle * math.sqrt(10))
    decades = math.log10(high / low) / (4 if many_ticks else 1.5)
    subs = (1.0, 2.0, 5.0) if decades < 1 else (1.0, 3.0) if decades < 1.5 or not many_ticks else (1.0,)
    axes.xaxis.set_major_locator(LogLocator(subs=subs))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.10g}".replace(",", " "))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel(axis.title)
    axes.set_ylabel(title)
    axes.margins(y=0.08)


def _add_legend(figure: Figure, axes: Axes) -> None:
    """Add a legend above the plots, in as many columns as fit."""
    handles, names = axes.get_legend_handles_labels()
    if names:
        column_in = (0.6 * max(map(len, names)) + 5) * 10 / 72
        figure.legend(handles, names, loc="outside upper left", ncols=max(1, min(3, int(_WIDTH_IN / column_in))))


def _remove_overlapping_labels(figure: Figure, axes: Axes) -> None:
    figure.draw_without_rendering()  # computes the layout, on which the sizes of labels depend
    boxes: list[BboxBase] = []
    for label in list(axes.texts):
        box = label.get_window_extent()
        if any(box.overlaps(other) for other in boxes):
            label.remove()
        else:
            boxes.append(box)
