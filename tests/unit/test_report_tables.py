"""Tests of the report as text: the terminal's table, CSV and JSON hold every number that was measured."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import numpy as np
import pytest
from studies import INFINITE, NAN, UNDEFINED, brick_series, measure, own_series, quick_series, report_of, study_of

from hsplat_cli.measure import Measurement, Study, terminal_table
from hsplat_cli.reports import bytes_text, count_text, metric_text, ms_text, short_count_text
from renderer.accuracy import METRICS

ALL = study_of(own_series())
ODD = study_of(
    [measure("tolerance 1", 10, 0, UNDEFINED, frames=(3,)), measure("tolerance 0", 20, 5, INFINITE, frames=(3,))]
)


def loaded(study: Study) -> dict[str, Any]:
    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    record: dict[str, Any] = json.loads(report_of(study)[".json"], parse_constant=refuse)
    return record


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (count_text(1194745), "1 194 745"), (count_text(NAN), "-"), (short_count_text(999.4), "999"),
        (short_count_text(999.6), "1.00 k"), (short_count_text(999_999), "1.00 M"), (short_count_text(NAN), "-"),
        (bytes_text(812_400_000), "812 MB"), (bytes_text(None), "-"), (ms_text(0.0000412), "0.0412"),
        (ms_text(0.00999999), "10.0"), (ms_text(1.3481), "1348"), (ms_text(0.0), "0"), (ms_text(NAN), "-"),
        (metric_text(METRICS["psnr"], 36.239), "36.24"), (metric_text(METRICS["psnr"], INFINITE), "inf"),
        (metric_text(METRICS["ssim"], NAN), "-"), (metric_text(METRICS["rmse"], 0.0000123), "1.2e-05"),
        (metric_text(METRICS["delta_e_share"], 0.1234), "12.3 %"),
    ],
)  # fmt: skip
def test_numbers_have_significant_digits(text: str, expected: str) -> None:
    assert text == expected


def rows_of(study: Study) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(report_of(study)[".csv"], newline="")))


def fronts_of(measurements: list[Measurement]) -> list[tuple[bool, bool]]:
    """Return whether each setting is on the fronts of time and of splats, by the rows of its first frame."""
    study = study_of(measurements)
    rows = {(row["series"], row["label"]): row for row in rows_of(study)}
    found = [rows[each.setting.series, each.setting.label] for each in measurements]
    return [(row["on_time_front"] == "true", row["on_splats_front"] == "true") for row in found]


def test_settings_are_on_the_fronts_of_time_and_of_splats() -> None:
    assert fronts_of(own_series()) == [(True, True), (False, True), (True, True), (True, True)]
    assert fronts_of(list(ODD.measurements)) == [(False, False), (True, True)]
    assert fronts_of(brick_series()) == [(True, False)] * 2


@pytest.mark.parametrize("seed", range(10))
def test_nothing_beats_the_front_and_something_beats_the_rest(seed: int) -> None:
    """Points lie on a small grid, so that some are equal, and some are undefined."""
    points = np.random.default_rng(seed).choice([1.0, 2.0, 3.0, 4.0, NAN], (seed + 3, 2))
    points[:, 0] = np.nan_to_num(points[:, 0], nan=5.0)
    measured = [
        measure(f"tolerance {number}", ms, 5, UNDEFINED if np.isnan(error) else 40 - error)
        for number, (ms, error) in enumerate(points.tolist())
    ]
    is_on_front = [on_front for on_front, _ in fronts_of(measured)]
    front = [tuple(point) for point, on_front in zip(points.tolist(), is_on_front, strict=True) if on_front]
    whole = [tuple(point) for point in points.tolist() if not np.isnan(point[1])]

    def beats(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
        return one != other and all(a <= b for a, b in zip(one, other, strict=True))

    assert len(set(front)) == len(front) and set(front) <= set(whole)
    assert not any(beats(one, other) for one in whole for other in front)
    assert all(one in front or any(beats(other, one) for other in front) for one in whole)


TABLE = """\
                                 time     quartiles   PSNR  volume                  Delta-E
setting           cells  splats    ms            ms     dB      dB    SSIM    FLIP    > 2.3  memory  front
gaussian, optical
  tolerance 1    2.00 k  1.00 k  10.0  9.25 to 12.2  22.00   19.00  0.9206  0.1589    7.9 %  800 MB  T S
  tolerance 0.2  6.00 k  3.00 k  90.0   83.2 to 110  27.00   24.00  0.9553  0.0893    4.5 %  800 MB    S
  tolerance 0.1  10.0 k  5.00 k  40.0  37.0 to 49.0  31.50   28.50  0.9734  0.0532    2.7 %  800 MB  T S
  tolerance 0     180 k  90.0 k   400    370 to 490  36.00   33.00  0.9842  0.0317    1.6 %  800 MB  T S
T: no other setting is as fast and as exact. S: no other has as few splats and is as exact.
"""


def test_the_terminal_shows_every_setting() -> None:
    assert terminal_table(ALL) == TABLE
    lines = terminal_table(ODD).splitlines()
    assert lines[3].split()[7:12] == ["11.5", "-", "-", "-", "-"]
    assert "inf" in lines[4]


@pytest.mark.parametrize(
    ("measurements", "heading"),
    [
        (brick_series(), "setting bricks a pixel ms"),
        ([*brick_series(), *own_series()], "setting or cells splats a pixel ms"),
        (own_series(), "setting cells splats ms"),
    ],
)
def test_the_table_names_what_it_counts(measurements: list[Measurement], heading: str) -> None:
    above, titles, *_ = terminal_table(study_of(measurements)).splitlines()
    assert " ".join(titles.split()).startswith(heading)
    assert ("bricks" in above.split()) == ("or cells" in titles)


def test_estimates_stand_beside_their_intervals() -> None:
    study = study_of(quick_series(), truths=())
    above, titles, _, *lines = terminal_table(study).splitlines()
    assert above.split() == ["time", "quartiles", "PSNR", "95", "%"]
    assert " ".join(titles.split()) == "setting cells splats ms ms dB dB RMSE 95 % memory front"
    assert "30.00  29.59 to 30.39  0.0316   0.0302 to 0.0331" in lines[0]
    assert "inf" in lines[2]
    rows = rows_of(study)
    everywhere = study.measurements[0].overall.everywhere
    for name, key in (("psnr_db", "psnr"), ("rmse", "rmse")):
        for end in ("", "_low", "_high"):
            assert float(rows[0][name + end]) == everywhere[key + end]
    assert not {"ssim", "volume_rmse"} & set(rows[0])
    assert loaded(study)["measurements"][0]["overall"]["everywhere"] == everywhere


@pytest.mark.parametrize("study", [ALL, ODD], ids=["plain", "odd"])
def test_csv_keeps_every_value(study: Study) -> None:
    samples = [(m, sample) for m in study.measurements for sample in m.frames]
    rows = rows_of(study)
    for row, (m, sample) in zip(rows, samples, strict=True):
        assert (row["series"], row["label"], int(row["frame"])) == (m.setting.series, m.setting.label, sample.frame)
        for prefix, accuracy in (("", sample.accuracy.everywhere), ("volume_", sample.accuracy.on_volume)):
            for metric in METRICS.values():
                written = float(row[f"{prefix}{metric.name}{'_db' if metric.unit else ''}"])
                assert np.array_equal(written, accuracy[metric.name], equal_nan=True)
        assert row["num_primitives"] == str(sample.num_primitives)
        assert row["rays_per_pixel"] == ("" if sample.rays_per_pixel is None else str(sample.rays_per_pixel))
        assert float(row["frame_ms_median"]) == pytest.approx(1000 * np.median(sample.frame_seconds), rel=1e-15)
        for step, seconds in sample.seconds.items():
            low, median, high = 1000 * np.quantile(seconds, [0.25, 0.5, 0.75])
            assert [float(row[f"frame_{step}_ms_{part}"]) for part in ("q1", "median", "q3")] == [low, median, high]
            assert row[f"frame_{step}_repetitions"] == str(len(seconds))
        assert row["once_cut_repetitions"] == "3"
        assert row["pyramid_ms"] == "250.0"
        assert float(row["precision"]) == m.setting.options["precision"]
        assert row["corrected"] == "true"


def test_json_has_everything_but_the_pictures() -> None:
    study = study_of(own_series(), volume={"shape": np.array([4, 5, 6]), "scale": np.float32(0.5)})
    record = loaded(study)
    assert (record["format"], record["date"]) == (1, "2030-01-02")
    assert record["machine"]["versions"] == {"numpy": "2"}
    assert record["volume"] == {"shape": [4, 5, 6], "scale": 0.5}
    convergence = {"step_voxels": [0.5, 0.25], "change": [1e-5, 3e-9], "num_rays": [48, 40]}
    truth = {"frame": 7, "seconds": 1.5, "share_on_volume": 0.4, "rays_per_pixel": 12.0, "own_psnr": 60.0}
    assert record["truths"][1] == truth | {"convergence": convergence}
    for written, m in zip(record["measurements"], study.measurements, strict=True):
        assert (written["series"], written["label"]) == (m.setting.series, m.setting.label)
        assert written["options"] == m.setting.options
        assert (written["num_cells"], written["num_primitives"]) == (m.num_cells, m.num_primitives)
        assert written["rays_per_pixel"] == m.rays_per_pixel
        assert written["frame_seconds"] == {"median": m.frame_seconds, "quartiles": list(m.frame_seconds_spread)}
        assert written["overall"]["on_volume"]["flip_p99"] == m.overall.on_volume["flip_p99"]
        assert (written["pyramid_seconds"], written["peak_bytes"]) == (m.pyramid_seconds, m.peak_bytes)
        assert written["once_seconds"] == {step: list(s) for step, s in m.seconds.items()}
        assert [s["seconds"] for s in written["samples"]] == [
            {step: list(seconds) for step, seconds in sample.seconds.items()} for sample in m.frames
        ]
        assert "picture" not in written
    assert [m["on_front"]["time"] for m in record["measurements"]] == [True, False, True, True]


def test_json_has_no_infinity() -> None:
    record = loaded(ODD)
    undefined, exact = (m["overall"]["everywhere"] for m in record["measurements"])
    assert undefined["psnr"] is None and undefined["rmse"] is None
    assert exact["psnr"] is None and exact["rmse"] == 0
