"""Write a study as text: a table for the terminal, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hsplat_cli.reports.costs import cells_title, group_by_series, has_bricks, has_splats, pareto_fronts
from hsplat_cli.reports.number_format import bytes_text, metric_text, ms_text, short_count_text
from hsplat_cli.terminal import format_table
from renderer.study import METRICS, Accuracy, FrameMeasurement, Measurement, Metric, Study, TruthRecord

FORMAT = 1
TERMINAL_COLUMNS = 120

_NULL_MEANING = (
    "what is not defined, not known or infinite; a psnr is infinite where the rmse is 0, "
    "num_cells, num_splats and pyramid_seconds are null for a program that has none, num_splats for bricks, "
    "which num_cells counts"
)


@dataclass(frozen=True)
class _Column:
    """A column of the terminal's table; its heading has two lines."""

    heading: tuple[str, str]
    text: Callable[[Measurement], str]


def _metric_column(first: str, second: str, name: str, pixels: str = "everywhere") -> _Column:
    metric = next(metric for metric in METRICS if metric.name == name)
    return _Column((first, second), lambda m: metric_text(metric, getattr(getattr(m.overall, pixels), metric.name)))


_SPLATS = _Column(("", "splats"), lambda m: short_count_text(m.num_splats))
_COLUMNS = (
    _Column(("frame", "ms"), lambda m: ms_text(m.frame_seconds)),
    _Column(("quartiles", "ms"), lambda m: " .. ".join(map(ms_text, m.frame_seconds_spread))),
    _metric_column("PSNR", "dB", "psnr"),
    _metric_column("volume", "dB", "psnr", "on_volume"),
    _metric_column("", "SSIM", "ssim"),
    _metric_column("", "FLIP", "flip"),
    _metric_column("Delta-E", "> 2.3", "delta_e_share"),
    _Column(("", "memory"), lambda m: bytes_text(m.peak_bytes)),
)


def terminal_table(study: Study) -> str:
    """Return a line for each measurement under a line for its series, at most 120 columns wide, with a line break.

    `T` marks the Pareto front of time, `S` that of splats.
    """
    measurements = study.measurements
    columns = _terminal_columns(measurements)
    time, splats = pareto_fronts(measurements)
    rows = [[*(column.heading[0] for column in columns), ""], [*(column.heading[1] for column in columns), "front"]]
    for i, m in enumerate(measurements):
        mark = f"{'T' if i in time else ' '} {'S' if i in splats else ' '}"
        rows.append([*(column.text(m) for column in columns), mark])
    numbers = format_table(rows, right_aligned=range(len(columns))).splitlines()
    label_room = TERMINAL_COLUMNS - len(f"  {numbers[1]}")
    labels = ["", "setting", *(_truncate(f"  {m.setting.label}", label_room) for m in measurements)]
    width = max(map(len, labels))
    above, headings, *lines = (
        f"{label:<{width}}  {text}".rstrip() for label, text in zip(labels, numbers, strict=True)
    )
    text = [above, headings]
    for series, members in group_by_series(measurements).items():
        text += [_truncate(series, TERMINAL_COLUMNS), *(lines[i] for i in members)]
    text.append("T: no other setting of the same program is as fast and as exact.")
    text[-1] += " S: no other has as few splats and is as exact." if splats else ""
    return "\n".join(text) + "\n"


def _terminal_columns(measurements: Sequence[Measurement]) -> list[_Column]:
    """Return the columns: numbers of cells and splats, as far as drawn, then costs and errors."""
    first, _, rest = cells_title(measurements).partition(" ")
    cells = _Column((first, rest) if rest else ("", first), lambda m: short_count_text(m.num_cells))
    splats = [_SPLATS] if has_splats(measurements) or not has_bricks(measurements) else []
    return [cells, *splats, *_COLUMNS]


def _truncate(text: str, width: int) -> str:
    return text if len(text) <= width else f"{text[: width - 3]}..."


def csv_text(study: Study) -> str:
    """Return CSV (RFC 4180): a header and a row for each measurement and frame.

    Settings have the names of their options. Times are milliseconds: `frame_ms_*` of a whole frame, `frame_STAGE_ms_*`
    of each stage, `once_STAGE_ms_*` of stages that run once for all frames, `pyramid_ms` of the pyramid, timed once.
    Metrics cover all pixels, `volume_*` those in which the volume is visible. Numbers are exact, with `nan` and `inf`;
    absent values are empty. The fronts are those of the measurement, over all its frames.
    """
    time, splats = pareto_fronts(study.measurements)
    rows = [
        _identity(m, sample)
        | {"on_time_front": number in time, "on_splats_front": number in splats}
        | _frame_row(m, sample)
        for number, m in enumerate(study.measurements)
        for sample in m.frames
    ]
    columns = _columns(study.measurements)
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, columns, restval="")
    writer.writeheader()
    writer.writerows({name: _csv_value(value) for name, value in row.items()} for row in rows)
    return text.getvalue()


def _identity(measurement: Measurement, sample: FrameMeasurement) -> dict[str, Any]:
    setting = measurement.setting
    return {"series": setting.series, "label": setting.label, "frame": sample.frame, **setting.options}


def _frame_row(measurement: Measurement, sample: FrameMeasurement) -> dict[str, Any]:
    row: dict[str, Any] = {
        "num_cells": measurement.num_cells,
        "num_splats": sample.num_splats,
        "peak_bytes": measurement.peak_bytes,
    }
    row |= _accuracy_row(sample.accuracy) | _times_row("frame", sample.frame_seconds)
    for stage, seconds in sample.seconds.items():
        row |= _times_row(f"frame_{stage}", seconds)
    for stage, seconds in measurement.seconds.items():
        row |= _times_row(f"once_{stage}", seconds)
    seconds_once = measurement.pyramid_seconds
    return row | {"pyramid_ms": None if seconds_once is None else 1000 * seconds_once}


def _accuracy_row(accuracy: Accuracy) -> dict[str, float]:
    pixels = {"": accuracy.everywhere, "volume_": accuracy.on_volume}
    return {
        f"{prefix}{_with_unit(metric)}": getattr(difference, metric.name)
        for prefix, difference in pixels.items()
        for metric in METRICS
    }


def _with_unit(metric: Metric) -> str:
    return f"{metric.name}_{metric.unit.lower()}" if metric.unit else metric.name


def _times_row(name: str, seconds: Sequence[float]) -> dict[str, float]:
    first, median, third = (float(value) for value in np.quantile(seconds, [0.25, 0.5, 0.75]) * 1000)
    return {
        f"{name}_ms_median": median,
        f"{name}_ms_q1": first,
        f"{name}_ms_q3": third,
        f"{name}_repetitions": len(seconds),
    }


def _columns(measurements: Sequence[Measurement]) -> list[str]:
    """Return the names of all columns: identity and settings, fronts, then counts, metrics and times."""
    samples = [(m, sample) for m in measurements for sample in m.frames]
    identity = [name for m, sample in samples for name in _identity(m, sample)]
    values = [name for m, sample in samples for name in _frame_row(m, sample)]
    return list(dict.fromkeys([*identity, "on_time_front", "on_splats_front", *values]))


def _csv_value(value: object) -> object:
    return str(value).lower() if isinstance(value, bool) else "" if value is None else value


def json_text(study: Study, *, date: str) -> str:
    """Return the study without its pictures as JSON, in seconds, bytes and dB; `null_means` explains its nulls."""
    time, splats = pareto_fronts(study.measurements)
    record = {
        "format": FORMAT,
        "date": date,
        "null_means": _NULL_MEANING,
        "scene": study.scene,
        "volume": study.volume,
        "machine": study.machine,
        "notes": study.notes,
        "truth_tolerance": study.truth_tolerance,
        "truths": [_truth_record(truth) for truth in study.truths],
        "measurements": [
            _measurement_record(m) | {"on_front": {"time": number in time, "splats": number in splats}}
            for number, m in enumerate(study.measurements)
        ],
    }
    return json.dumps(to_plain(record), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _truth_record(truth: TruthRecord) -> dict[str, Any]:
    return {
        "frame": truth.frame,
        "seconds": truth.seconds,
        "share_on_volume": truth.share_on_volume,
        "convergence": asdict(truth.convergence),
    }


def _measurement_record(measurement: Measurement) -> dict[str, Any]:
    return {
        "series": measurement.setting.series,
        "label": measurement.setting.label,
        "options": measurement.setting.options,
        "num_cells": measurement.num_cells,
        "num_splats": measurement.num_splats,
        "frame_seconds": {
            "median": measurement.frame_seconds,
            "quartiles": measurement.frame_seconds_spread,
        },
        "once_seconds": measurement.seconds,
        "pyramid_seconds": measurement.pyramid_seconds,
        "peak_bytes": measurement.peak_bytes,
        "overall": asdict(measurement.overall),
        "samples": [
            {
                "frame": sample.frame,
                "num_splats": sample.num_splats,
                "seconds": sample.seconds,
                "accuracy": asdict(sample.accuracy),
            }
            for sample in measurement.frames
        ],
    }


def to_plain(value: Any) -> Any:
    """Convert a value to the types of JSON and YAML, NaN and infinities to None."""
    if isinstance(value, Mapping):
        return {key: to_plain(item) for key, item in value.items()}
    if isinstance(value, (np.generic, np.ndarray)):
        return to_plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [to_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
