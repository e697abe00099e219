"""The report as text: what is written can be read back, and nothing is lost or made up."""

from __future__ import annotations

import csv
import io
import json
import math
from typing import Any

import numpy as np
import pytest
from studies import INFINITE, NAN, UNDEFINED, brick_series, measure, own_series, peer_series, study_of

from hsplat_cli.reports import bytes_text, short_count_text, terminal_table
from hsplat_cli.reports.costs import costs_by_psnr, pareto_fronts, splats_front
from hsplat_cli.reports.number_format import count_text, metric_text, ms_text, ratio_text
from hsplat_cli.reports.tables import TERMINAL_COLUMNS, csv_text, json_text
from renderer.study import METRICS, Measurement, Study, pareto_front

METRIC = {metric.name: metric for metric in METRICS}

ALL = study_of([*own_series(), *peer_series()])
ODD = study_of(
    [
        measure("tolerance 1", 10, 0, UNDEFINED, frames=(3,)),
        measure("tolerance 0", 20, 5, INFINITE, frames=(3,)),
    ]
)


def rows_of(study: Study) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(csv_text(study), newline="")))


def loaded(study: Study) -> dict[str, Any]:
    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    record: dict[str, Any] = json.loads(json_text(study, date="2030-01-02"), parse_constant=refuse)
    return record


# ------------------------------------------------------------------------------------------------------------ numbers


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (count_text(1194745), "1 194 745"),
        (count_text(812.5), "812"),
        (count_text(None), "-"),
        (count_text(INFINITE), "-"),
        (short_count_text(0), "0"),
        (short_count_text(999.4), "999"),
        (short_count_text(999.6), "1.00 k"),
        (short_count_text(12974), "13.0 k"),
        (short_count_text(999_999), "1.00 M"),
        (short_count_text(1_194_745), "1.19 M"),
        (short_count_text(None), "-"),
        (bytes_text(812_400_000), "812 MB"),
        (bytes_text(17), "17.0 B"),
        (bytes_text(None), "-"),
        (ms_text(0.0000412), "0.0412"),
        (ms_text(0.00999999), "10.0"),
        (ms_text(1.3481), "1348"),
        (ms_text(0.0), "0"),
        (ms_text(NAN), "-"),
        (ratio_text(3.236), "3.24"),
        (metric_text(METRIC["psnr"], 36.239), "36.24"),
        (metric_text(METRIC["psnr"], INFINITE), "inf"),
        (metric_text(METRIC["ssim"], NAN), "-"),
        (metric_text(METRIC["rmse"], 0.01533), "0.0153"),
        (metric_text(METRIC["rmse"], 0.0000123), "1.2e-05"),
        (metric_text(METRIC["delta_e_share"], 0.1234), "12.3 %"),
    ],
)
def test_numbers(text: str, expected: str) -> None:
    assert text == expected


# -------------------------------------------------------------------------------------------------- fronts and prices


def test_fronts_are_those_of_each_tool() -> None:
    time, splats = pareto_fronts(ALL.measurements)
    own, peers = ALL.measurements[:4], ALL.measurements[4:]
    for members, first in ((own, 0), (peers, 4)):
        front = pareto_front([m.frame_seconds for m in members], [-m.overall.everywhere.psnr for m in members])
        assert {i for i in time if first <= i < first + len(members)} == {first + i for i in front}
    assert sorted(time) == [0, 2, 3, 4, 5, 6]
    assert sorted(splats) == [0, 1, 2, 3]


def test_what_is_undefined_is_on_no_front() -> None:
    assert pareto_fronts(ODD.measurements) == (frozenset({1}), frozenset({1}))


def test_prices_are_interpolated_on_the_front() -> None:
    by_psnr = {price.psnr: price for price in costs_by_psnr(ALL.measurements)}
    assert list(by_psnr) == [25, 30, 35, 40]
    at_25 = by_psnr[25]
    assert at_25.time.value == pytest.approx(0.010 * 4 ** (3 / 9.5))  # from 10 ms at 22 dB to 40 ms at 31.5 dB
    assert at_25.splats is not None
    assert at_25.splats.value == pytest.approx(1000 * 3 ** (3 / 5))  # from 1000 at 22 dB to 3000 at 27 dB
    assert at_25.setting is not None and at_25.setting.label == "tolerance 0.1"
    assert at_25.peer is not None and at_25.peer.is_bound and not at_25.time.is_bound
    assert at_25.ratio == pytest.approx(0.1 / at_25.time.value)
    assert math.isinf(by_psnr[40].time.value) and by_psnr[40].setting is None
    assert math.isnan(by_psnr[40].ratio)


def test_prices_without_a_peer_or_without_accuracy() -> None:
    assert all(price.peer is None and math.isnan(price.ratio) for price in costs_by_psnr(own_series()))
    assert costs_by_psnr([measure("tolerance 1", 10, 5, UNDEFINED)]) == []
    assert [price.psnr for price in costs_by_psnr([measure("tolerance 1", 10, 5, 17)])] == [15]


def test_prices_without_splats() -> None:
    """Bricks are none, however few they are."""
    assert [price.splats for price in costs_by_psnr(brick_series())] == [None] * 4
    assert splats_front([*brick_series(), *own_series()]) == [2, 3, 4, 5]


# ----------------------------------------------------------------------------------------------------------- terminal


TABLE = """\
                                       frame     quartiles   PSNR  volume                  Delta-E
setting                 cells  splats     ms            ms     dB      dB    SSIM    FLIP    > 2.3  memory  front
gaussian, optical
  tolerance 1          2.00 k  1.00 k   10.0  9.25 .. 12.2  22.00   19.00  0.9206  0.1589    7.9 %  800 MB  T S
  tolerance 0.2        6.00 k  3.00 k   90.0   83.2 .. 110  27.00   24.00  0.9553  0.0893    4.5 %  800 MB    S
  tolerance 0.1        10.0 k  5.00 k   40.0  37.0 .. 49.0  31.50   28.50  0.9734  0.0532    2.7 %  800 MB  T S
  tolerance 0           180 k  90.0 k    400    370 .. 490  36.00   33.00  0.9842  0.0317    1.6 %  800 MB  T S
vtk gpu
  sample distance 2         -       -    100   92.5 .. 122  29.00   26.00  0.9645  0.0710    3.5 %       -  T
  sample distance 1         -       -    300    278 .. 368  41.00   38.00  0.9911  0.0178    0.9 %       -  T
vtk fixed point
  sample distance 0.5       -       -    200    185 .. 245  33.00   30.00  0.9776  0.0448    2.2 %       -  T
T: no other setting of the same program is as fast and as exact. S: no other has as few splats and is as exact.
"""


def test_the_table() -> None:
    assert terminal_table(ALL) == TABLE


@pytest.mark.parametrize(
    ("measurements", "heading"),
    [
        (brick_series(), "setting bricks ms"),
        ([*brick_series(), *peer_series()], "setting bricks ms"),
        ([*brick_series(), *own_series()], "setting or cells splats ms"),
        (own_series(), "setting cells splats ms"),
        (peer_series(), "setting cells splats ms"),
    ],
)
def test_the_table_names_what_it_counts(measurements: list[Measurement], heading: str) -> None:
    above, titles, *_ = terminal_table(study_of(measurements)).splitlines()
    assert " ".join(titles.split()).startswith(heading)
    assert ("bricks" in above.split()) == ("or cells" in titles)


def test_the_table_is_never_too_wide() -> None:
    long = "a label of some length that goes on and on 0.0001"
    wide = [measure(long, 1234567, 999_499_999, 3.0, series="s" * 200), measure("tolerance 0", 1e-3, 1, 30.0)]
    assert max(map(len, terminal_table(study_of(wide)).splitlines())) == TERMINAL_COLUMNS


def test_odd_numbers_in_the_table() -> None:
    lines = terminal_table(ODD).splitlines()
    assert lines[3].split()[7:12] == ["11.5", "-", "-", "-", "-"]
    assert "inf" in lines[4]


# ---------------------------------------------------------------------------------------------------------------- CSV


def test_csv_has_a_row_for_each_measurement_and_frame() -> None:
    rows = rows_of(ALL)
    expected = [(m.setting.series, m.setting.label, s.frame) for m in ALL.measurements for s in m.frames]
    assert [(row["series"], row["label"], int(row["frame"])) for row in rows] == expected
    assert all(None not in row and None not in row.values() for row in rows)
    assert csv_text(ALL).count("\r\n") == len(rows) + 1


@pytest.mark.parametrize("study", [ALL, ODD], ids=["plain", "odd"])
def test_csv_keeps_every_value(study: Study) -> None:
    samples = [(m, sample) for m in study.measurements for sample in m.frames]
    for row, (m, sample) in zip(rows_of(study), samples, strict=True):
        for prefix, accuracy in (("", sample.accuracy.everywhere), ("volume_", sample.accuracy.on_volume)):
            for metric in METRICS:
                written = float(row[f"{prefix}{metric.name}{'_db' if metric.unit else ''}"])
                assert np.array_equal(written, getattr(accuracy, metric.name), equal_nan=True)
        assert row["num_splats"] == ("" if sample.num_splats is None else str(sample.num_splats))
        assert float(row["frame_ms_median"]) == pytest.approx(1000 * np.median(sample.frame_seconds), rel=1e-15)
        for stage, seconds in sample.seconds.items():
            low, median, high = 1000 * np.quantile(seconds, [0.25, 0.5, 0.75])
            written = [float(row[f"frame_{stage}_ms_{part}"]) for part in ("q1", "median", "q3")]
            assert written == [low, median, high]
            assert row[f"frame_{stage}_repetitions"] == str(len(seconds))
        assert row["once_cut_repetitions"] == ("3" if m.seconds else "")
        assert row["pyramid_ms"] == ("" if m.pyramid_seconds is None else "250.0")
        assert float(row["precision"]) == m.setting.options["precision"]
        assert (row["tool"], row["corrected"]) == (m.setting.options["tool"], "true")


def test_csv_quotes_what_needs_it() -> None:
    name = 'with "quotes", commas\r\nand lines'
    assert rows_of(study_of([measure("tolerance 1", 1, 1, 30, series=name)]))[0]["series"] == name


def test_csv_marks_the_fronts() -> None:
    rows = rows_of(ALL)
    assert [row["on_time_front"] == "true" for row in rows[::2]] == [True, False, True, True, True, True, True]
    assert [row["on_splats_front"] == "true" for row in rows[::2]] == [True] * 4 + [False] * 3


# --------------------------------------------------------------------------------------------------------------- JSON


def test_json_has_everything_but_the_pictures() -> None:
    record = loaded(ALL)
    assert (record["format"], record["date"]) == (1, "2030-01-02")
    assert record["machine"]["versions"] == {"numpy": "2"}
    assert record["volume"]["shape"] == [4, 5, 6]
    assert record["truths"][1]["convergence"]["change"] == [1e-5, 3e-9]
    for written, m in zip(record["measurements"], ALL.measurements, strict=True):
        assert (written["series"], written["label"]) == (m.setting.series, m.setting.label)
        assert written["options"] == m.setting.options
        assert written["num_splats"] == m.num_splats
        assert written["overall"]["on_volume"]["flip_p99"] == m.overall.on_volume.flip_p99
        assert written["pyramid_seconds"] == m.pyramid_seconds
        assert written["once_seconds"] == {stage: list(s) for stage, s in m.seconds.items()}
        assert [s["seconds"] for s in written["samples"]] == [
            {stage: list(seconds) for stage, seconds in sample.seconds.items()} for sample in m.frames
        ]
    assert [m["on_front"]["time"] for m in record["measurements"]] == [True, False, True, True, True, True, True]


def test_json_has_no_infinity() -> None:
    record = loaded(ODD)
    undefined, exact = (m["overall"]["everywhere"] for m in record["measurements"])
    assert undefined["psnr"] is None and undefined["rmse"] is None
    assert exact["psnr"] is None and exact["rmse"] == 0
    assert "infinite" in record["null_means"]


def test_json_takes_numpys_numbers() -> None:
    study = study_of(own_series(), volume={"name": "a", "shape": np.array([1, 2]), "scale": np.float32(0.5)})
    assert loaded(study)["volume"] == {"name": "a", "shape": [1, 2], "scale": 0.5}
