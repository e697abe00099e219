"""Render a study as an HTML page: plots, the cost of an accuracy, the truth, and every setting with its pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import yaml

from hsplat_cli.reports.costs import (
    OWN,
    PEER,
    Cost,
    CostAtPsnr,
    cells_title,
    costs_by_psnr,
    group_by_series,
    has_bricks,
    has_splats,
    pareto_fronts,
    program_of,
)
from hsplat_cli.reports.html import figure_to_svg, format_facts, plot_style, png_data_uri, render_page, sort_key
from hsplat_cli.reports.number_format import ABSENT, bytes_text, count_text, metric_text, ms_text, ratio_text
from hsplat_cli.reports.plots import (
    SPLATS_AXIS,
    TIME_AXIS,
    CostAxis,
    metrics_figure,
    plottable,
    short_labels,
    tradeoff_figure,
)
from hsplat_cli.reports.tables import to_plain
from renderer.bricks import BRICK_SIZE
from renderer.study import DIFFERENCE_GAIN, METRICS, Measurement, Metric, Study, TruthRecord

if TYPE_CHECKING:
    from markupsafe import Markup

# The metric of the plots comes first.
_ORDER = ("psnr", "ssim", "flip", "flip_p99", "delta_e_share", "rmse", "max_error")
_METRICS = sorted(METRICS, key=lambda metric: _ORDER.index(metric.name))


@dataclass(frozen=True)
class CaptionedSvg:
    """A plot of the page."""

    svg: Markup
    caption: str


@dataclass(frozen=True)
class Column:
    """A column of a table. is_text: aligned to the left. is_sortable: the heading is a button."""

    title: str
    unit: str = ""
    is_text: bool = False
    is_sortable: bool = True


@dataclass(frozen=True)
class Cell:
    """A number, text, a picture, or the heading of a row, with its series. value: sort key; text sorts by itself."""

    text: str
    value: str = ""
    is_text: bool = False
    series: str = ""
    image: str = ""


@dataclass(frozen=True)
class StudyRow:
    """A row of a table; `on_front` shades it."""

    cells: Sequence[Cell]
    on_front: bool


@dataclass(frozen=True)
class StudyTable:
    """A sortable table. groups: text and number of columns of the headings above; for all columns, or empty."""

    caption: str
    groups: Sequence[tuple[str, int]]
    columns: Sequence[Column]
    rows: Sequence[StudyRow]

    @property
    def has_pictures(self) -> bool:
        """Whether any cell is a picture."""
        return any(cell.image for row in self.rows for cell in row.cells)


def study_page(study: Study, *, date: str) -> str:
    """Return the page as text; equal studies and dates give equal text."""
    measurements = study.measurements
    return render_page(
        "study.html",
        title=f"What accuracy costs: {study.name}",
        notes=study.notes,
        facts=_facts(study, date),
        plots=_plots(measurements),
        cost_columns=_cost_columns(measurements),
        costs_by_psnr=_cost_lines(measurements),
        has_peer=_has_peer(measurements),
        has_bricks=has_bricks(measurements),
        has_splats=has_splats(measurements),
        is_shaded=study.scene.get("shading") is not None,
        truth_tolerance=f"{study.truth_tolerance:g}",
        truths=study.truths,
        convergence=[_convergence_line(truth) for truth in study.truths],
        gain=f"{DIFFERENCE_GAIN:g}",
        measured=_measured_table(measurements),
        stages=_stage_times_table(measurements),
        scene=yaml.safe_dump(to_plain(study.scene), sort_keys=False, default_flow_style=None, width=100),
    )


def _facts(study: Study, date: str) -> list[tuple[str, str]]:
    frames = ", ".join(str(truth.frame) for truth in study.truths)
    size = study.scene.get("output", {}).get("size", ())
    volume = format_facts({f"volume, {name}" if name != "name" else "volume": v for name, v in study.volume.items()})
    noun = "frame" if len(study.truths) == 1 else "frames"
    picture = [("pictures", f"{' x '.join(map(str, size))} pixels, {noun} {frames}")] if size else []
    return [*volume, *picture, *format_facts(study.machine), ("date", date)]


def _plots(measurements: Sequence[Measurement]) -> list[CaptionedSvg]:
    plots = []
    with plot_style():
        for name, axis in (("time", TIME_AXIS), ("splats", SPLATS_AXIS)):
            if shown := plottable(measurements, axis):
                series = ", ".join(group_by_series([measurements[i] for i in shown]))
                alt = f"PSNR in dB over the {axis.title}, logarithmic, of {series}"
                svg = figure_to_svg(tradeoff_figure(measurements, axis), name=name, alt=alt)
                plots.append(CaptionedSvg(svg, _tradeoff_caption(measurements, axis)))
        if plottable(measurements, TIME_AXIS):
            series = ", ".join(group_by_series(measurements))
            alt = f"PSNR on the volume, SSIM, FLIP and pixels over Delta-E 2.3 over the {TIME_AXIS.title}, of {series}"
            svg = figure_to_svg(metrics_figure(measurements), name="metrics", alt=alt)
            plots.append(CaptionedSvg(svg, "The same settings by other metrics."))
    return plots


def _tradeoff_caption(measurements: Sequence[Measurement], axis: CostAxis) -> str:
    """Explain labels, bars and omissions."""
    shown = plottable(measurements, axis)
    words = []
    for tool, front in axis.fronts(measurements).items():
        common, _ = short_labels([measurements[i].setting.label for i in front if i in shown])
        words += [f"{common} ({'hsplat' if tool == OWN else 'VTK'})"] if common else []
    parts = ["Higher and further to the left is better."]
    parts += [f"Labels at the points of a front, where they fit: {', '.join(words)}."] if words else []
    parts += ["Settings with bricks are not in this plot."] if axis is SPLATS_AXIS and has_bricks(measurements) else []
    parts += ["Bars reach from the first to the third quartile of the time."] if axis.quartiles else []
    exact = sum(m.overall.everywhere.psnr == math.inf for m in measurements if axis.cost(m) > 0)
    parts += [f"Not shown, because equal to the truth: {exact}."] if exact else []
    return " ".join(parts)


def _has_peer(measurements: Sequence[Measurement]) -> bool:
    return any(program_of(m) == PEER for m in measurements)


def _cost_columns(measurements: Sequence[Measurement]) -> list[tuple[str, str, bool]]:
    """Title, unit and whether it is text, of each column of `_cost_lines`."""
    peer = [("VTK", "ms a frame", False), ("VTK takes", "times as long", False)] * _has_peer(measurements)
    splats = [("splats", "a frame", False)] * has_splats(measurements)
    last = ("fastest setting of hsplat that reaches it", "", True)
    return [("PSNR", "dB", False), ("hsplat", "ms a frame", False), *splats, *peer, last]


def _cost_lines(measurements: Sequence[Measurement]) -> list[list[str]]:
    with_splats, with_peer = has_splats(measurements), _has_peer(measurements)
    lines = []
    for cost in costs_by_psnr(measurements):
        line = [f"{cost.psnr:g}", _cost_text(cost.time, ms_text)]
        line += [_cost_text(cost.splats, count_text)] if with_splats else []
        line += [_cost_text(cost.peer, ms_text), _ratio_text(cost)] if with_peer else []
        lines.append([*line, f"{cost.setting.series}, {cost.setting.label}" if cost.setting else ABSENT])
    return lines


def _ratio_text(cost: CostAtPsnr) -> str:
    if cost.peer is None or not math.isfinite(cost.ratio):
        return ABSENT
    return f"{'≤ ' if cost.peer.is_bound else '≥ ' if cost.time.is_bound else ''}{ratio_text(cost.ratio)}"


def _cost_text(cost: Cost | None, text: Callable[[float], str]) -> str:
    if cost is None:
        return ABSENT
    return "not reached" if math.isinf(cost.value) else f"{'≤ ' if cost.is_bound else ''}{text(cost.value)}"


def _convergence_line(truth: TruthRecord) -> list[str]:
    record = truth.convergence
    return [
        str(truth.frame),
        f"{truth.seconds:.1f}",
        f"{100 * truth.share_on_volume:.1f} %",
        ", ".join(f"{step:g}" for step in record.step_voxels),
        ", ".join(f"{change:.1e}" for change in record.change),
        ", ".join(map(count_text, record.num_pixels)),
    ]


def _measured_table(measurements: Sequence[Measurement]) -> StudyTable:
    metrics = [Column(_metric_title(metric), metric.unit) for metric in _METRICS]
    identity = [
        Column("setting", is_text=True),
        Column("picture", is_sortable=False),
        Column("difference", is_sortable=False),
    ]
    shows_splats = has_splats(measurements) or not has_bricks(measurements)
    costs = [
        Column(cells_title(measurements)),
        *[Column("splats")] * shows_splats,
        Column("time", "ms"),
        Column("quartiles", "ms"),
        Column("once", "ms"),
        Column("memory"),
    ]
    fronts = [Column("front", is_text=True)]
    groups = [
        ("", len(identity)),
        ("cost", len(costs)),
        ("over the whole picture", len(metrics)),
        ("on the volume", len(metrics)),
        ("", len(fronts)),
    ]
    time, splats = pareto_fronts(measurements)
    rows = [
        StudyRow(
            [
                *_identity_cells(m, i),
                *_cost_cells(m, shows_splats=shows_splats),
                *_metric_cells(m),
                _front_cell(i in time, i in splats),
            ],
            i in time,
        )
        for i, m in enumerate(measurements)
    ]
    return StudyTable(_measured_caption(measurements), groups, [*identity, *costs, *metrics, *metrics, *fronts], rows)


def _measured_caption(measurements: Sequence[Measurement]) -> str:
    """Explain the columns."""
    caption = (
        f"“Once”: the cut and its {_primitive_nouns(measurements)}, made for all frames together, without the pyramid, "
        "which is under “Time by stage”. Memory: the peak of the process."
    )
    if has_bricks(measurements):
        caption += f" The integrated footprint draws bricks of {BRICK_SIZE} x {BRICK_SIZE} x {BRICK_SIZE} cells"
        caption += "; the others draw a splat for each cell." if has_splats(measurements) else "."
    return caption


def _primitive_nouns(measurements: Sequence[Measurement]) -> str:
    """Return `bricks`, `splats` or `bricks or splats`, by the footprints."""
    bricks = has_bricks(measurements)
    return " or ".join([*["bricks"] * bricks, *["splats"] * (has_splats(measurements) or not bricks)])


def _metric_title(metric: Metric) -> str:
    return {"max_error": "largest", "flip_p99": "FLIP 99 %", "delta_e_share": "ΔE > 2.3"}.get(metric.name, metric.label)


def _identity_cells(measurement: Measurement, number: int) -> list[Cell]:
    setting = measurement.setting
    name = f"{setting.series}, {setting.label}"
    return [
        Cell(setting.label, str(number), series=setting.series),
        Cell(f"picture of {name}", image=png_data_uri(measurement.picture)),
        Cell(f"difference of {name} from the truth", image=png_data_uri(measurement.difference)),
    ]


def _cost_cells(measurement: Measurement, *, shows_splats: bool) -> list[Cell]:
    low, high = measurement.frame_seconds_spread
    once = [float(np.median(seconds)) for seconds in measurement.seconds.values()]
    return [
        _number(measurement.num_cells, count_text(measurement.num_cells)),
        *[_number(measurement.num_splats, count_text(measurement.num_splats))] * shows_splats,
        _number(measurement.frame_seconds, ms_text(measurement.frame_seconds)),
        _number(high - low, f"{ms_text(low)} – {ms_text(high)}"),
        _number(sum(once), ms_text(sum(once))) if once else _number(None, ABSENT),
        _number(measurement.peak_bytes, bytes_text(measurement.peak_bytes)),
    ]


def _metric_cells(measurement: Measurement) -> list[Cell]:
    return [
        _number(getattr(difference, metric.name), metric_text(metric, getattr(difference, metric.name)))
        for difference in (measurement.overall.everywhere, measurement.overall.on_volume)
        for metric in _METRICS
    ]


def _front_cell(on_time: bool, on_splats: bool) -> Cell:
    return Cell(" and ".join([*["time"] * on_time, *["splats"] * on_splats]), is_text=True)


def _number(value: float | None, text: str) -> Cell:
    return Cell(text, sort_key(value))


def _stage_times_table(measurements: Sequence[Measurement]) -> StudyTable:
    """Return medians and quartiles of each stage, over frames and repetitions together."""
    times = [_stage_times(m) for m in measurements]
    names = list(dict.fromkeys(name for stages in times for name in stages))
    columns = [Column("setting", is_text=True)]
    titles = {("splats", True): _primitive_nouns(measurements)}
    columns += [
        Column(titles.get((stage, is_once), stage), f"ms, {'once' if is_once else 'each frame'}")
        for stage, is_once in names
    ]
    rows = []
    for i, (m, stages) in enumerate(zip(measurements, times, strict=True)):
        cells = [Cell(m.setting.label, str(i), series=m.setting.series)]
        rows.append(StudyRow([*cells, *(_stage_cell(stages.get(name, ())) for name in names)], on_front=False))
    caption = (
        "Median, quartiles in brackets, × number of timings; stages of each frame are timed on all frames together. "
        "The pyramid is built once for all settings with the same error measure"
    )
    caption += "; so are the bricks." if has_bricks(measurements) else "."
    return StudyTable(caption, (), columns, rows)


def _stage_times(measurement: Measurement) -> dict[tuple[str, bool], tuple[float, ...]]:
    """Return seconds by stage and whether the stage runs once for all frames."""
    times: dict[tuple[str, bool], tuple[float, ...]] = {}
    if measurement.pyramid_seconds is not None:
        times["pyramid", True] = (measurement.pyramid_seconds,)
    times |= {(stage, True): seconds for stage, seconds in measurement.seconds.items()}
    for sample in measurement.frames:
        for stage, seconds in sample.seconds.items():
            times[stage, False] = times.get((stage, False), ()) + tuple(seconds)
    return times


def _stage_cell(seconds: Sequence[float]) -> Cell:
    if not seconds:
        return _number(None, ABSENT)
    if len(seconds) == 1:
        return _number(seconds[0], f"{ms_text(seconds[0])} × 1")
    low, median, high = (float(value) for value in np.quantile(seconds, [0.25, 0.5, 0.75]))
    return _number(median, f"{ms_text(median)} ({ms_text(low)} – {ms_text(high)}) × {len(seconds)}")
