"""Writes a study as text: a table for the terminal, CSV and JSON. The page of a study uses the same columns."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from hsplat_cli.measure.costs import cost_in_splats, group_by_series, has_bricks, has_splats, on_pareto_fronts
from hsplat_cli.measure.sweep import FrameMeasurement, Measurement, Study
from hsplat_cli.reports import ABSENT, bytes_text, metric_text, ms_text, short_count_text
from hsplat_cli.terminal import format_table
from renderer.accuracy import METRICS, Accuracy, Truth
from renderer.system import join_lines

# The type of a column's values.
Number = TypeVar("Number", float, int | None, float | None)

# Version of the format of measure.json.
FORMAT = 1

# Headings of the columns of metrics whose labels are too long: a title, and the text below it.
_HEADINGS = {"max_error": ("largest", ""), "flip_p99": ("FLIP", "99 %"), "delta_e_share": ("Delta-E", "> 2.3")}


# Titles of the columns for the fields of Flicker.
_FLICKERS = {
    "rms": "RMS",
    "p99": "flicker 99 %",
    "largest": "largest",
    "block_p99": "blocks 99 %",
    "block_largest": "blocks' largest",
}


@dataclass(frozen=True)
class Column:
    """Describes a column of a table of measurements.

    title: the heading. unit: the text below the title.
    value: a function that returns the number of a measurement by which rows are sorted; NaN or None without one.
    text: a function that returns the text of the measurement's cell.
    """

    title: str
    unit: str
    value: Callable[[Measurement], float | None]
    text: Callable[[Measurement], str]


def cost_columns(measurements: Sequence[Measurement], format_count: Callable[[float], str]) -> list[Column]:
    """Return the columns of costs: counts of primitives, times and memory. The last two are `once` and `memory`."""
    shows_bricks, shows_splats = has_bricks(measurements), has_splats(measurements)
    title, unit = ("bricks", "or cells" * shows_splats) if shows_bricks else ("cells", "")
    counts = [_number(title, unit, lambda m: m.num_cells, format_count)]
    if shows_splats or not shows_bricks:
        counts.append(_number("splats", "", cost_in_splats, format_count))
    if shows_bricks:
        counts.append(_number("rays", "a pixel", lambda m: m.rays_per_pixel, _rays_text))
    return [
        *counts,
        _number("time", "ms", lambda m: m.frame_seconds, ms_text),
        _range("quartiles", "ms", lambda m: m.frame_seconds_spread, ms_text),
        _number("once", "ms", _seconds_once, ms_text),
        _number("memory", "", lambda m: m.peak_bytes, bytes_text),
    ]


def metric_column(name: str, pixels: str) -> Column:
    """Return the column of a metric of METRICS over the pixels `everywhere` or `on_volume`."""
    metric = METRICS[name]
    title, unit = _HEADINGS.get(name, (metric.label, metric.unit))
    return _number(title, unit, lambda m: getattr(m.overall, pixels)[name], partial(metric_text, metric))


def metric_columns(measurements: Sequence[Measurement], names: Sequence[str], pixels: str) -> list[Column]:
    """Return the columns of the metrics that all measurements have, each followed by that of its interval, if any."""
    columns = []
    for name in names:
        columns += [metric_column(name, pixels)] * all(name in getattr(m.overall, pixels) for m in measurements)
        if measurements and all(f"{name}_low" in getattr(m.overall, pixels) for m in measurements):
            columns.append(_interval_column(name, pixels))
    return columns


def flicker_columns(measurements: Sequence[Measurement], names: Sequence[str]) -> list[Column]:
    """Return the columns of some fields of Flicker, in levels of 8 bits; none if no measurement has a flicker."""
    if all(m.flicker is None for m in measurements):
        return []
    return [_number(_FLICKERS[name], "levels", partial(_flicker, name), _levels_text) for name in names]


def _flicker(name: str, measurement: Measurement) -> float:
    return math.nan if measurement.flicker is None else float(getattr(measurement.flicker, name))


def _levels_text(levels: float) -> str:
    return ABSENT if math.isnan(levels) else f"{levels:.1f}"


def _interval_column(name: str, pixels: str) -> Column:
    def ends(measurement: Measurement) -> list[float]:
        return [getattr(measurement.overall, pixels)[f"{name}_{end}"] for end in ("low", "high")]

    return _range("95 %", METRICS[name].unit, ends, partial(metric_text, METRICS[name]))


def _range(
    title: str, unit: str, ends: Callable[[Measurement], Sequence[float]], text: Callable[[float], str]
) -> Column:
    return Column(title, unit, lambda m: ends(m)[1] - ends(m)[0], lambda m: " to ".join(map(text, ends(m))))


def _number(title: str, unit: str, value: Callable[[Measurement], Number], text: Callable[[Number], str]) -> Column:
    return Column(title, unit, value, lambda m: text(value(m)))


def _rays_text(rays_per_pixel: float | None) -> str:
    return ABSENT if rays_per_pixel is None else f"{rays_per_pixel:.2f}"


def _seconds_once(measurement: Measurement) -> float:
    """Return the seconds of the steps that run once for all frames; NaN if there are none."""
    return sum(float(np.median(seconds)) for seconds in measurement.seconds.values()) or math.nan


def terminal_table(study: Study) -> str:
    """Return the table of a study: a line for each series, and below it a line for each of its measurements.

    `T` marks measurements on the Pareto front of PSNR over time, `S` those on the front of PSNR over splats.
    """
    measurements = study.measurements
    columns = _terminal_columns(measurements)
    headings = [(column.title, column.unit) if column.unit else ("", column.title) for column in columns]
    upper, lower = zip(*headings, strict=True)
    rows = [["", *upper, ""], ["setting", *lower, "front"]]
    on_fronts = on_pareto_fronts(measurements)
    for m, (on_time, on_splats) in zip(measurements, on_fronts, strict=True):
        marks = f"{'T' if on_time else ' '} {'S' if on_splats else ' '}"
        rows.append([f"  {m.setting.label}", *(column.text(m) for column in columns), marks])
    above, heading, *lines = format_table(rows, right_aligned=range(1, len(columns) + 1)).splitlines()
    text = [above, heading]
    for series, members in group_by_series(measurements).items():
        text += [series, *(lines[i] for i in members)]
    text.append("T: no other setting is as fast and as exact.")
    if any(on_splats for _, on_splats in on_fronts):
        text[-1] += " S: no other has as few splats and is as exact."
    return join_lines([*text, ""])


def _terminal_columns(measurements: Sequence[Measurement]) -> list[Column]:
    """Return the columns of the table for the terminal: costs without `once`, and the most important metrics."""
    *costs, _, memory = cost_columns(measurements, short_count_text)
    on_volume = [replace(each, title="volume") for each in metric_columns(measurements, ["psnr"], "on_volume")]
    others = ("ssim", "flip", "delta_e_share") if on_volume else ("rmse",)
    psnr, metrics = (metric_columns(measurements, names, "everywhere") for names in (("psnr",), others))
    return [*costs, *psnr, *on_volume, *metrics, *flicker_columns(measurements, ["p99"]), memory]


def csv_text(study: Study) -> str:
    """Return a study as CSV (RFC 4180): a header, and a row for each frame of each measurement.

    Columns of parameters have the names of `Setting.options`. Times are milliseconds: `frame_ms_*` of a whole frame,
    `frame_STEP_ms_*` of each step, `once_STEP_ms_*` of steps that run once for all frames, `pyramid_ms` of the pyramid,
    timed once. Metrics cover all pixels, `volume_*` only the pixels in which the volume is visible; `*_low` and
    `*_high` are the ends of the interval of an estimate. `flicker_*` is the change of errors from the frame before, in
    levels of 8 bits. `on_*_front` says whether the measurement, over all its frames, is on a Pareto front. Numbers are
    not rounded, and may be `nan` or `inf`; absent values are empty.
    """
    options = dict.fromkeys((name for m in study.measurements for name in m.setting.options), "")
    on_fronts = on_pareto_fronts(study.measurements)
    rows: list[dict[str, object]] = [
        {"series": m.setting.series, "label": m.setting.label, "frame": sample.frame}
        | {**options, **m.setting.options}
        | {"on_time_front": on_time, "on_splats_front": on_splats, **_frame_row(m, sample)}
        for m, (on_time, on_splats) in zip(study.measurements, on_fronts, strict=True)
        for sample in m.frames
    ]
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, dict.fromkeys(name for row in rows for name in row), restval="")
    writer.writeheader()
    for row in rows:
        writer.writerow({name: str(cell).lower() if isinstance(cell, bool) else cell for name, cell in row.items()})
    return text.getvalue()


def _frame_row(measurement: Measurement, sample: FrameMeasurement) -> dict[str, float | None]:
    row: dict[str, float | None] = {
        "num_cells": measurement.num_cells,
        "num_primitives": sample.num_primitives,
        "rays_per_pixel": sample.rays_per_pixel,
        "peak_bytes": measurement.peak_bytes,
    }
    row |= _accuracy_row(sample.accuracy) | _times_row("frame", sample.frame_seconds)
    row |= {} if sample.flicker is None else {f"flicker_{name}": each for name, each in asdict(sample.flicker).items()}
    for step, seconds in sample.seconds.items():
        row |= _times_row(f"frame_{step}", seconds)
    for step, seconds in measurement.seconds.items():
        row |= _times_row(f"once_{step}", seconds)
    return row | {"pyramid_ms": 1000 * measurement.pyramid_seconds}


def _accuracy_row(accuracy: Accuracy) -> dict[str, float]:
    pixels = {"": accuracy.everywhere, "volume_": accuracy.on_volume}
    return {
        f"{prefix}{name}{'_db' if metric.unit == 'dB' else ''}{end}": errors[f"{name}{end}"]
        for prefix, errors in pixels.items()
        for name, metric in METRICS.items()
        for end in ("", "_low", "_high")
        if f"{name}{end}" in errors
    }


def _times_row(name: str, seconds: Sequence[float]) -> dict[str, float]:
    milliseconds = (1000 * np.quantile(seconds, [0.5, 0.25, 0.75])).tolist()
    row = {f"{name}_ms_{part}": value for part, value in zip(("median", "q1", "q3"), milliseconds, strict=True)}
    return row | {f"{name}_repetitions": len(seconds)}


def json_text(study: Study, *, date: str) -> str:
    """Return a study without its pictures as JSON, with times in seconds. date: the date of the report."""
    on_fronts = on_pareto_fronts(study.measurements)
    record = {
        "format": FORMAT,
        "date": date,
        "scene": study.scene,
        "volume": study.volume,
        "machine": study.machine,
        "notes": study.notes,
        "truth_tolerance": study.truth_tolerance,
        "truths": [_truth_record(truth) for truth in study.truths],
        "measurements": [
            _measurement_record(m) | {"on_front": {"time": on_time, "splats": on_splats}}
            for m, (on_time, on_splats) in zip(study.measurements, on_fronts, strict=True)
        ],
    }
    return json.dumps(to_plain(record), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _truth_record(truth: Truth) -> dict[str, object]:
    return {
        "frame": truth.frame,
        "seconds": truth.seconds,
        "convergence": asdict(truth.convergence),
        "share_on_volume": truth.share_on_volume,
        "rays_per_pixel": truth.rays_per_pixel,
        "own_psnr": truth.own_psnr,
    }


def _measurement_record(measurement: Measurement) -> dict[str, object]:
    fields = asdict(measurement)
    setting, steps, samples, *_ = map(fields.pop, ("setting", "seconds", "frames", "picture", "difference"))
    return {
        **setting,
        **fields,
        "num_primitives": measurement.num_primitives,
        "rays_per_pixel": measurement.rays_per_pixel,
        "frame_seconds": {"median": measurement.frame_seconds, "quartiles": measurement.frame_seconds_spread},
        "once_seconds": steps,
        "samples": samples,
    }


def to_plain(value: object) -> object:
    """Convert a value to the types of JSON and YAML, and NaN and infinities to None."""
    if isinstance(value, Mapping):
        return {key: to_plain(item) for key, item in value.items()}
    if isinstance(value, (np.generic, np.ndarray)):
        return to_plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [to_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
