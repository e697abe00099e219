"""A study as text: a table for the terminal, CSV for spreadsheets and data frames, JSON for programs."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hsplat_cli.reports.costs import cells_title, group_by_series, has_bricks, has_splats, pareto_fronts
from hsplat_cli.reports.number_format import bytes_text, metric_text, ms_text, short_count_text
from renderer.study import METRICS, Accuracy, FrameMeasurement, Measurement, Metric, Study, TruthRecord

FORMAT = 1
TERMINAL_COLUMNS = 120

_GAP = "  "
_NULL_MEANING = (
    "what is not defined, not known or infinite; a psnr is infinite where the rmse is 0, "
    "num_cells, num_splats and pyramid_seconds are null for a program that has none, num_splats for bricks, "
    "which num_cells counts"
)


# ------------------------------------------------------------------------------------------------------- the terminal


@dataclass(frozen=True)
class _Column:
    """heading: two lines."""

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
    """One line for each measurement under a line for its series, at most 120 columns wide; ends with a line break.

    `T` marks what is on the Pareto front of time, `S` on that of splats, where any were drawn.
    """
    measurements = study.measurements
    columns = _terminal_columns(measurements)
    time, splats = pareto_fronts(measurements)
    marks = [f"{'T' if i in time else ' '} {'S' if i in splats else ' '}" for i in range(len(measurements))]
    texts = [[column.text(m) for column in columns] for m in measurements]
    widths = [max(map(len, [*column.heading, *(row[k] for row in texts)])) for k, column in enumerate(columns)]
    room = TERMINAL_COLUMNS - sum(width + len(_GAP) for width in widths) - len(_GAP) - len("front")
    labels = [_truncate(f"{_GAP}{m.setting.label}", room) for m in measurements]
    label_width = max(map(len, ["setting", *labels]))

    def line(label: str, cells: Iterable[str], mark: str) -> str:
        aligned = [cell.rjust(width) for cell, width in zip(cells, widths, strict=True)]
        return _GAP.join([label.ljust(label_width), *aligned, mark]).rstrip()

    above, headings = zip(*(column.heading for column in columns), strict=True)
    lines = [line("", above, ""), line("setting", headings, "front")]
    for series, members in group_by_series(measurements).items():
        lines.append(_truncate(series, TERMINAL_COLUMNS))
        lines += [line(labels[i], texts[i], marks[i]) for i in members]
    legend = "T: no other setting of the same program is as fast and as exact."
    lines.append(f"{legend} S: none is with as few splats." if splats else legend)
    return "".join(f"{text}\n" for text in lines)


def _terminal_columns(measurements: Sequence[Measurement]) -> list[_Column]:
    """Of what is drawn, what there is; then what it costs and comes to."""
    first, _, rest = cells_title(measurements).partition(" ")
    cells = _Column((first, rest) if rest else ("", first), lambda m: short_count_text(m.num_cells))
    splats = [_SPLATS] if has_splats(measurements) or not has_bricks(measurements) else []
    return [cells, *splats, *_COLUMNS]


def _truncate(text: str, width: int) -> str:
    return text if len(text) <= width else f"{text[: width - 3]}..."


# ---------------------------------------------------------------------------------------------------------------- CSV


def csv_text(study: Study) -> str:
    """RFC 4180: a header and one row for each measurement and frame.

    Settings have the names of their options; times are milliseconds, `frame_ms_*` of all stages of a frame together,
    `frame_STAGE_ms_*` of each, `once_STAGE_ms_*` of what is done once for all frames, `pyramid_ms` of building the
    pyramid, timed once; metrics are over all pixels, `volume_*` over those with anything of the volume. Numbers keep
    their value to the last digit, `nan` and `inf` included; what does not exist is empty. The fronts are those of the
    measurement, over all its frames.
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
    """Identity, settings, fronts, counts, metrics, times: each kind together, whichever measurement has it first."""
    kinds: list[dict[str, None]] = [{}, {}, {}]
    for m in measurements:
        for sample in m.frames:
            for kind, names in zip(
                kinds,
                (_identity(m, sample), ("on_time_front", "on_splats_front"), _frame_row(m, sample)),
                strict=True,
            ):
                kind.update(dict.fromkeys(names))
    return [name for kind in kinds for name in kind]


def _csv_value(value: object) -> object:
    return str(value).lower() if isinstance(value, bool) else "" if value is None else value


# --------------------------------------------------------------------------------------------------------------- JSON


def json_text(study: Study, *, date: str) -> str:
    """Everything of the study but its pictures; seconds, bytes and dB. `null_means` says what a null stands for."""
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
    return json.dumps(plain(record), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


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


def plain(value: Any) -> Any:
    """`value` in the types that JSON and YAML have; None for NaN and infinities, which JSON has not."""
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (np.generic, np.ndarray)):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
