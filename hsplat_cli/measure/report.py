"""Writes the report of a study: CSV, JSON, and an HTML page.

The page has charts, the cost of some values of PSNR, exact pictures, and every setting with its pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import yaml

from hsplat_cli.measure import costs
from hsplat_cli.measure.pareto import Cost
from hsplat_cli.measure.plots import has_intervals, study_charts
from hsplat_cli.measure.sweep import Measurement, Study
from hsplat_cli.measure.tables import (
    Column,
    cost_columns,
    csv_text,
    flicker_columns,
    json_text,
    metric_columns,
    to_plain,
)
from hsplat_cli.measure.thumbnails import DIFFERENCE_GAIN, thumbnail
from hsplat_cli.reports import ABSENT, count_text, format_facts, ms_text, render_page
from renderer.accuracy import Truth
from renderer.bricks import BRICK_SIZE
from renderer.film import write_staged

# The name of the page of a report.
PAGE_FILE = "index.html"
# The files of a report, in the order in which they are written: if the page exists, the other files do.
REPORT_FILES = ("measure.csv", "measure.json", PAGE_FILE)
# The metrics in the table of the page, in the order of the columns.
_METRICS = ("psnr", "ssim", "flip", "flip_p99", "delta_e_share", "rmse", "max_error")

# The fields of Flicker in the table of the page, in the order of the columns.
_FLICKERS = ("p99", "largest", "block_p99", "block_largest", "rms")


def write_study(study: Study, folder: Path, *, date: str) -> list[Path]:
    """Write measure.csv, measure.json and index.html into `folder`, and return their paths.

    date: the date that the report shows. Equal studies and dates give equal bytes. Missing folders are created. All
    contents are made before the first file is written. Raises InputError if no file can have such a path, and
    RenderError if writing fails.
    """
    texts = (csv_text(study), json_text(study, date=date), study_page(study, date=date))
    paths = [folder / name for name in REPORT_FILES]
    # File names that are not UTF-8 have surrogates in Python; they become escapes.
    contents = [text.encode(errors="backslashreplace") for text in texts]
    for path, content in zip(paths, contents, strict=True):
        write_staged(path, content)
    return paths


def study_page(study: Study, *, date: str) -> str:
    """Return the page of a study, as HTML. date: the date that the page shows."""
    measurements = study.measurements
    on_fronts = costs.on_pareto_fronts(measurements)
    return render_page(
        "study.html",
        title=f"Cost and accuracy: {study.name}",
        study=study,
        facts=_facts(study, date),
        charts=study_charts(measurements),
        costs=_cost_lines(measurements),
        truths=[(truth.frame, thumbnail(truth.picture)) for truth in study.truths],
        convergence=[_convergence_line(truth) for truth in study.truths],
        has_bricks=costs.has_bricks(measurements),
        has_splats=costs.has_splats(measurements),
        primitives=_primitive_nouns(measurements),
        brick_size=BRICK_SIZE,
        gain=f"{DIFFERENCE_GAIN:g}",
        on_front=[on_time for on_time, _ in on_fronts],
        fronts=[" and ".join(["time"] * on_time + ["splats"] * on_splats) for on_time, on_splats in on_fronts],
        cost_columns=cost_columns(measurements, count_text),
        is_estimate=has_intervals(measurements),
        everywhere_columns=metric_columns(measurements, _METRICS, "everywhere"),
        on_volume_columns=metric_columns(measurements, _METRICS, "on_volume"),
        flicker_columns=flicker_columns(measurements, _FLICKERS),
        step_columns=_step_columns(measurements),
        scene=yaml.safe_dump(to_plain(study.scene), sort_keys=False, default_flow_style=None, width=100),
    )


def _facts(study: Study, date: str) -> list[tuple[str, str]]:
    numbers = {sample.frame for m in study.measurements for sample in m.frames}
    frames = ", ".join(map(str, sorted(numbers)))
    size = study.scene.get("output", {}).get("size", ())
    volume = format_facts({f"volume, {name}" if name != "name" else "volume": v for name, v in study.volume.items()})
    noun = f"frame{'s' * (len(numbers) != 1)}"
    picture = [("pictures", f"{' x '.join(map(str, size))} pixels, {noun} {frames}")] if size else []
    return [*volume, *picture, *format_facts(study.machine), ("date", date)]


def _cost_lines(measurements: Sequence[Measurement]) -> list[dict[str, str]]:
    """Return the rows of the table that gives the cost of each PSNR: texts by the titles of columns."""
    lines = []
    for cost in costs.costs_by_psnr(measurements):
        line = {"PSNR\ndB": f"{cost.psnr:g}", "time\nms a frame": _cost_text(cost.time, ms_text)}
        if cost.splats:
            line["splats\na frame"] = _cost_text(cost.splats, count_text)
        name = f"{cost.setting.series}, {cost.setting.label}" if cost.setting else ABSENT
        lines.append(line | {"fastest setting that reaches it": name})
    return lines


def _cost_text(cost: Cost, text: Callable[[float], str]) -> str:
    return "not reached" if math.isinf(cost.value) else f"{'≤ ' if cost.is_bound else ''}{text(cost.value)}"


def _convergence_line(truth: Truth) -> dict[str, str]:
    record = truth.convergence
    return {
        "frame": str(truth.frame),
        "computed in\ns": f"{truth.seconds:.1f}",
        "volume visible in\nof the pixels": f"{100 * truth.share_on_volume:.1f} %",
        "rays\na pixel": f"{truth.rays_per_pixel:.1f}",
        "its own PSNR\ndB": f"{truth.own_psnr:.1f}",
        "steps\nvoxels": ", ".join(f"{step:g}" for step in record.step_voxels),
        "largest change at each\nof a channel, 0 to 1": ", ".join(f"{change:.1e}" for change in record.change),
        "rays still integrated": ", ".join(map(count_text, record.num_rays)),
    }


def _primitive_nouns(measurements: Sequence[Measurement]) -> str:
    """Return a word for the primitives that the settings draw: `bricks`, `splats` or `bricks or splats`."""
    bricks = costs.has_bricks(measurements)
    return " or ".join([*["bricks"] * bricks, *["splats"] * (costs.has_splats(measurements) or not bricks)])


def _step_columns(measurements: Sequence[Measurement]) -> list[Column]:
    """Return a column for each step of drawing, with the times of the step over all frames and repetitions."""
    names = dict.fromkeys(name for m in measurements for name in _step_times(m))
    titles = {"primitives": _primitive_nouns(measurements)}
    return [_step_column(titles.get(step, step), step, is_once) for step, is_once in names]


def _step_column(title: str, step: str, is_once: bool) -> Column:
    def seconds(measurement: Measurement) -> Sequence[float]:
        return _step_times(measurement).get((step, is_once), ())

    unit = f"ms, {'once' if is_once else 'each frame'}"
    return Column(title, unit, lambda m: float(np.median(seconds(m) or math.nan)), lambda m: _times_text(seconds(m)))


def _step_times(measurement: Measurement) -> dict[tuple[str, bool], tuple[float, ...]]:
    """Return the seconds of each step of a measurement, by the step's name and whether it runs once for all frames."""
    times: dict[tuple[str, bool], tuple[float, ...]] = {("pyramid", True): (measurement.pyramid_seconds,)}
    times |= {(step, True): seconds for step, seconds in measurement.seconds.items()}
    for sample in measurement.frames:
        for step, seconds in sample.seconds.items():
            times[step, False] = times.get((step, False), ()) + tuple(seconds)
    return times


def _times_text(seconds: Sequence[float]) -> str:
    """Return the median, the quartiles and the number of some times, as text in milliseconds."""
    if not seconds:
        return ABSENT
    low, median, high = map(ms_text, np.quantile(seconds, [0.25, 0.5, 0.75]))
    quartiles = f" ({low} to {high})" if len(seconds) > 1 else ""
    return f"{median}{quartiles} × {len(seconds)}"
