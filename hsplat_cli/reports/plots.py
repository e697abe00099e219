"""Error against cost as figures, made inside `html.plot_style`: a curve for each series, the front under them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from hsplat_cli.reports.costs import OWN, PEER, group_by_series, program_of, splats_front, time_front
from hsplat_cli.reports.html import LIGHT_PALETTE
from renderer.study import METRICS, Measurement

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Float64 = npt.NDArray[np.float64]

_COLORS = [LIGHT_PALETTE[f"series-{number}"] for number in range(1, 9)]
_MARKERS = "osD^vP<>"
_PEER_MARKERS = "x+1234"
_LABEL_PT = 8.5
_WIDTH_IN = 8.0


@dataclass(frozen=True)
class Axis:
    """What stands on the horizontal axis, which is logarithmic.

    of: a measurement's cost, NaN if it has none. spread: its quartiles. fronts: the tools and their fronts.
    """

    title: str
    of: Callable[[Measurement], float]
    spread: Callable[[Measurement], tuple[float, float]] | None
    fronts: Callable[[Sequence[Measurement]], dict[str, list[int]]]


TIME = Axis(
    "time of a frame, ms",
    lambda m: 1000 * m.frame_seconds,
    lambda m: (1000 * m.frame_seconds_spread[0], 1000 * m.frame_seconds_spread[1]),
    lambda measurements: {tool: time_front(measurements, tool) for tool in (OWN, PEER)},
)
SPLATS = Axis(
    "splats of a frame",
    lambda m: math.nan if m.num_splats is None else m.num_splats,
    None,
    lambda measurements: {OWN: splats_front(measurements)},
)


def _psnr(measurement: Measurement) -> float:
    return measurement.overall.everywhere.psnr


def plottable(measurements: Sequence[Measurement], axis: Axis) -> list[int]:
    """Numbers of the measurements that have a place on an axis of finite PSNR and logarithmic cost."""
    return [i for i, m in enumerate(measurements) if 0 < axis.of(m) < math.inf and math.isfinite(_psnr(m))]


def tradeoff_figure(measurements: Sequence[Measurement], axis: Axis) -> Figure:
    """PSNR over cost: what is not `plottable` is left out; the points of the fronts bear their labels."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH_IN, 5.2), layout="constrained")
    axes = figure.subplots()
    shown = set(plottable(measurements, axis))
    fronts = {tool: [i for i in front if i in shown] for tool, front in axis.fronts(measurements).items()}
    _draw_fronts(axes, measurements, axis, fronts)
    _draw_series(axes, measurements, axis, _psnr, with_spread=True)
    _finish(axes, axis, "PSNR, dB", many_ticks=True)
    _name_series(figure, axes)
    figure.draw_without_rendering()  # makes the layout, in which the labels then find their places
    figure.set_layout_engine("none")
    _label_points(axes, measurements, axis, fronts, sorted(shown))
    return figure


def metrics_figure(measurements: Sequence[Measurement]) -> Figure:
    """Further metrics over the time of a frame, a small plot for each."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH_IN, 6.8), layout="constrained")
    panels = (("psnr", "on_volume"), ("ssim", "everywhere"), ("flip", "everywhere"), ("delta_e_share", "everywhere"))
    for axes, (name, pixels) in zip(figure.subplots(2, 2).flat, panels, strict=True):
        metric = next(metric for metric in METRICS if metric.name == name)
        title = f"{metric.label}{' on the volume' if pixels == 'on_volume' else ''}"
        scale = 100 if name.endswith("_share") else 1

        def value(m: Measurement, name: str = name, pixels: str = pixels, scale: int = scale) -> float:
            return scale * float(getattr(getattr(m.overall, pixels), name))

        _draw_series(axes, measurements, TIME, value, with_spread=False)
        unit = "%" if scale == 100 else metric.unit
        _finish(axes, TIME, f"{title}, {unit}" if unit else title, many_ticks=False)
        axes.set_title(
            f"{'higher' if metric.higher_is_better else 'lower'} is better",
            color=LIGHT_PALETTE["muted"],
            fontsize=_LABEL_PT,
            loc="right",
        )
    _name_series(figure, axes)
    return figure


def _draw_fronts(axes: Axes, measurements: Sequence[Measurement], axis: Axis, fronts: dict[str, list[int]]) -> None:
    """Straight between its points, as `pareto.cost_at_psnr` interpolates: the logarithm of the cost over PSNR."""
    styles: dict[str, dict[str, Any]] = {
        OWN: {"color": LIGHT_PALETTE["front"], "linewidth": 9.0, "solid_capstyle": "round", "zorder": 1.0},
        PEER: {"color": LIGHT_PALETTE["muted"], "linewidth": 1.4, "linestyle": "--", "zorder": 1.5},
    }
    names = {OWN: "Pareto front of hsplat", PEER: "front of VTK, between its settings"}
    for tool, front in fronts.items():
        if front:
            costs, psnrs = [axis.of(measurements[i]) for i in front], [_psnr(measurements[i]) for i in front]
            axes.plot(costs, psnrs, label=names[tool], **styles[tool])


def _draw_series(
    axes: Axes,
    measurements: Sequence[Measurement],
    axis: Axis,
    value: Callable[[Measurement], float],
    *,
    with_spread: bool,
) -> None:
    styles = {OWN: _own_styles(), PEER: _peer_styles()}
    for series, members in group_by_series(measurements).items():
        style = next(styles[program_of(measurements[members[0]])])
        name: str | None = series
        for curve in _curves(measurements, members):
            shown = [
                m for m in (measurements[i] for i in curve) if 0 < axis.of(m) < math.inf and math.isfinite(value(m))
            ]
            if not shown:
                continue
            costs, values = np.array([axis.of(m) for m in shown]), [value(m) for m in shown]
            if with_spread and axis.spread:
                low, high = np.array([axis.spread(m) for m in shown]).T
                # Rounding may put a quartile on the wrong side of the median.
                bars = np.maximum([costs - low, high - costs], 0)
                axes.errorbar(costs, values, xerr=bars, fmt="none", ecolor=style["color"], elinewidth=1.0, capsize=2.5)
            axes.plot(costs, values, label=name, **style)
            name = None  # it stands in the legend once


def _curves(measurements: Sequence[Measurement], members: Sequence[int]) -> list[list[int]]:
    """The members of a series by curve: the peer's settings run from fine to coarse at each of its image reductions."""
    curves: dict[object, list[int]] = {}
    for i in members:
        curves.setdefault(measurements[i].setting.options.get("image_reduction"), []).append(i)
    return list(curves.values())


def _own_styles() -> Iterator[dict[str, Any]]:
    number = 0
    while True:
        shift = number // len(_COLORS)  # the same colours again with other markers
        yield {
            "color": _COLORS[number % len(_COLORS)],
            "marker": _MARKERS[(number + shift) % len(_MARKERS)],
            "markersize": 4.5,
            "linewidth": 1.4,
            "zorder": 3.0,
        }
        number += 1


def _peer_styles() -> Iterator[dict[str, Any]]:
    number = 0
    while True:
        yield {
            "color": LIGHT_PALETTE["ink"],
            "marker": _PEER_MARKERS[number % len(_PEER_MARKERS)],
            "markersize": 7.0,
            "linewidth": 0.7,
            "linestyle": ":",
            "zorder": 2.5,
        }
        number += 1


def _finish(axes: Axes, axis: Axis, title: str, *, many_ticks: bool) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    low, high = axes.get_xlim()
    if high / low < 10:  # a decade at least, so that there are ticks to read
        middle = math.sqrt(low * high)
        axes.set_xlim(middle / math.sqrt(10), middle * math.sqrt(10))
    decades = math.log10(high / low) / (4 if many_ticks else 1.5)
    subs = (1.0, 2.0, 5.0) if decades < 1 else (1.0, 3.0) if decades < 1.5 or not many_ticks else (1.0,)
    axes.xaxis.set_major_locator(LogLocator(subs=subs))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: tick_text(value)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel(axis.title)
    axes.set_ylabel(title)
    axes.margins(y=0.08)


def _name_series(figure: Figure, axes: Axes) -> None:
    """A legend above the plots, in as many columns as its names leave room for."""
    handles, names = axes.get_legend_handles_labels()
    if names:
        column_in = (0.6 * max(map(len, names)) + 5) * 10 / 72
        figure.legend(handles, names, loc="outside upper left", ncols=max(1, min(3, int(_WIDTH_IN / column_in))))


def tick_text(value: float) -> str:
    """`0.5`, `20`, `5000`, `20 k`, `1 M`."""
    for unit, name in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if value >= max(unit, 1e4):
            return f"{value / unit:g}{name}"
    return f"{value:g}"


# ------------------------------------------------------------------------------------------------------------- labels


def short_labels(labels: Sequence[str]) -> tuple[str, list[str]]:
    """The words that all labels begin with, and the labels without them: "tolerance", ["0.1", "0.05"]."""
    columns = zip(*(label.split(" ")[:-1] for label in labels), strict=False)
    common = [words[0] for words in itertools.takewhile(lambda words: len(set(words)) == 1, columns)]
    return " ".join(common), [" ".join(label.split(" ")[len(common) :]) for label in labels]


def _label_points(
    axes: Axes, measurements: Sequence[Measurement], axis: Axis, fronts: dict[str, list[int]], shown: Sequence[int]
) -> None:
    """Beside each point of a front its label, where it covers as little as possible of all that is drawn."""
    scale = axes.figure.dpi / 72
    frame = axes.get_window_extent()
    taken = _drawn_points_px(axes, measurements, axis, fronts, shown)
    for tool, front in fronts.items():
        for i, text in zip(front, short_labels([measurements[i].setting.label for i in front])[1], strict=True):
            size = np.array([0.56 * _LABEL_PT * len(text), 0.9 * _LABEL_PT]) * scale
            point = axes.transData.transform((axis.of(measurements[i]), _psnr(measurements[i])))
            centers = [point + offset for offset in _offsets(size, scale)]
            inside = [c for c in centers if frame.contains(*(c - size / 2)) and frame.contains(*(c + size / 2))]
            best = min(inside or centers, key=lambda center: _num_covered(taken, center, size + 2 * scale))
            axes.annotate(
                text,
                tuple(axes.transData.inverted().transform(best)),
                ha="center",
                va="center",
                fontsize=_LABEL_PT,
                color=LIGHT_PALETTE["ink" if tool == OWN else "muted"],
                zorder=5,
            )
            columns, rows = np.meshgrid(*(np.linspace(-0.5, 0.5, 8)[:, None] * size).T)
            # What is under a label counts more than a curve: two labels on each other cannot be read.
            taken = np.concatenate([taken, np.repeat(best + np.stack([columns, rows], -1).reshape(-1, 2), 4, axis=0)])


def _drawn_points_px(
    axes: Axes, measurements: Sequence[Measurement], axis: Axis, fronts: dict[str, list[int]], shown: Sequence[int]
) -> Float64:
    """Float64 [n, 2]: pixels along the curves of series and fronts and along the bars."""
    curves = [curve for members in group_by_series(measurements).values() for curve in _curves(measurements, members)]
    lines = [
        [(axis.of(measurements[i]), _psnr(measurements[i])) for i in line if i in shown]
        for line in (*curves, *fronts.values())
    ]
    if axis.spread:
        lines += [[(cost, _psnr(measurements[i])) for cost in axis.spread(measurements[i])] for i in shown]
    return np.concatenate([_sample_polyline(axes.transData.transform(line)) for line in lines if line])


def _offsets(size: Float64, scale: float) -> list[Float64]:
    """Centres of a label around its point, those that are read most easily first."""
    directions = [(-1, 1), (1, -1), (0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, -1)]
    return [
        np.array([x * (size[0] / 2 + gap), y * (size[1] / 2 + gap)])
        for gap in (5 * scale, 12 * scale, 20 * scale)
        for x, y in directions
    ]


def _num_covered(taken: Float64, center: Float64, size: Float64) -> int:
    return int(np.sum(np.all(np.abs(taken - center) <= size / 2, axis=1)))


def _sample_polyline(points: Float64) -> Float64:
    """Float64 [n, 2]: points about 2 px apart on the line through some [m, 2], and these themselves several times."""
    parts = [np.repeat(points, 4, axis=0)]
    for start, end in itertools.pairwise(points):
        num = max(2, int(np.linalg.norm(end - start) / 2))
        parts.append(start + np.linspace(0, 1, num)[:, None] * (end - start))
    return np.concatenate(parts)
