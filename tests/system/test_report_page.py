"""Tests of a report's page and files: valid HTML that loads nothing, equal bytes, files whole or not at all."""

from __future__ import annotations

import base64
import errno
import html
import json
import math
import os
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from html_page import Page, assert_can_be_heard, assert_sound_and_alone
from studies import DATE, INFINITE, NAN, UNDEFINED, brick_series, measure, own_series, quick_series, report_of, study_of

from hsplat_cli.measure import REPORT_FILES, amplified_difference, study_charts, write_study
from hsplat_cli.reports import format_facts
from renderer.errors import RenderError
from renderer.film import decode_png, rounded
from renderer.truth import PixelMeans
from renderer.volume import Float64, UInt8

HOSTILE = "<script>alert('x')</script> & \"$x^2$\" {{ 7 * 7 }}"

CASES = {
    "all": study_of(own_series()), "bricks": study_of(brick_series()),
    "both": study_of([*brick_series(), *own_series()]), "nothing measured": study_of([], notes=()),
    "quick": study_of(quick_series(), truths=()),
    "undefined": study_of([measure("tolerance 1", 10, 0, UNDEFINED), measure("tolerance 0", 20, 5, INFINITE)]),
    "hostile names, one measurement of one frame": study_of(
        [measure(f"{HOSTILE} 1", 12, 500, 30, series=HOSTILE, frames=(5,))], volume={"name": HOSTILE, HOSTILE: HOSTILE},
        scene={"output": {"size": [8, 6]}, "volume": {"file": HOSTILE}}, machine={HOSTILE: {HOSTILE: HOSTILE}},
        notes=(HOSTILE,)),
}  # fmt: skip


@cache
def text_of(case: str) -> str:
    return report_of(CASES[case])[".html"]


@cache
def prose_of(case: str) -> str:
    return Page(text_of(case)).prose


@pytest.mark.parametrize("case", CASES)
def test_every_page_is_sound_accessible_and_complete(case: str) -> None:
    assert_sound_and_alone(text_of(case))
    assert_can_be_heard(text_of(case))
    study, page = CASES[case], Page(text_of(case))
    num_differences = sum(m.difference is not None for m in study.measurements)
    assert page.tags["img"] == len(study.truths) + len(study.measurements) + num_differences
    words = {word.strip() for word in page.words}
    assert words >= {m.setting.label for m in study.measurements} | set(study.notes)


def test_names_are_escaped() -> None:
    text = text_of("hostile names, one measurement of one frame")
    assert "alert('x')</script>" not in text
    assert "{{ 7 * 7 }}" in text and "$x^2$" in Page(text).prose
    assert "8 x 6 pixels, frame 5 " in Page(text).prose


def test_rows_on_the_front_are_marked() -> None:
    assert Page(text_of("all")).attributes.count(("tr", "class", "front")) == 3
    assert Page(text_of("undefined")).attributes.count(("tr", "class", "front")) == 1


def test_the_scene_can_be_pasted() -> None:
    scene = {"volume": {"file": "a: b.nhdr"}, "error": {"tolerance": {0: 0.5, 60: 0.02}}, "size": (8, np.int64(6))}
    text = html.unescape(report_of(study_of([], scene=scene))[".html"])
    (block,) = re.findall(r"<pre>(.*?)</pre>", text, re.DOTALL)
    assert yaml.safe_load(block) == {**scene, "size": [8, 6]}


def test_costs_are_those_of_the_front() -> None:
    assert "25 15.5 1 933 gaussian, optical, tolerance 0.1" in prose_of("all")
    assert "40 74.4 not reached integrated, optical, tolerance 0" in prose_of("both")


def test_costs_of_bricks_are_log_linear_between_settings() -> None:
    """From 20 ms at 30 dB to 80 ms at 41 dB; at 25 dB there may be a cheaper setting."""
    series = "integrated, optical, tolerance"
    costs = f"25 ≤ 20.0 {series} 1 30 20.0 {series} 1 35 37.6 {series} 0 40 70.5 {series} 0"
    assert costs in prose_of("bricks")


def test_numbers_sort_as_numbers() -> None:
    values = Page(text_of("undefined")).values("data-value")
    assert "Infinity" in values and str(NAN) not in values


def test_charts_have_a_curve_for_each_series_and_the_front() -> None:
    over_time, over_splats, *further = study_charts(CASES["both"].measurements)
    assert (over_time.x.title, over_time.y.title) == ("time of a frame, ms", "PSNR, dB")
    front, *series = over_time.curves
    assert [curve.name for curve in series] == ["integrated, optical", "gaussian, optical"]
    points = np.array([point for point in front.points if point])
    assert 10 ** points[:, 0] == pytest.approx([10, 20, 40, 80])
    assert points[:, 1] == pytest.approx([22, 30, 31.5, 41])
    assert [text for _, text in over_time.labels] == ["1", "1", "0.1", "0"]
    assert [curve.name for curve in over_splats.curves] == ["Pareto front", "gaussian, optical"]
    assert [chart.y.title for chart in further] == [
        "PSNR on the volume, dB",
        "SSIM",
        "FLIP",
        "pixels with Delta-E over 2.3",
    ]
    assert len({curve.color for curve in series}) == len({curve.marker for curve in series}) == 2
    styles = {(curve.name, curve.color, curve.marker) for chart in further for curve in chart.curves}
    assert styles == {(curve.name, curve.color, curve.marker) for curve in series}


def test_estimates_have_bars_and_intervals() -> None:
    _, series = study_charts(quick_series())[0].curves
    low, high = (quick_series()[0].overall.everywhere[f"psnr_{end}"] for end in ("low", "high"))
    assert len(series.points) == 2 and len(series.bars) == 4  # a PSNR without error is not shown
    across, up = np.array(series.bars[:2])
    assert across == pytest.approx(np.array([(math.log10(18.5), 30), (math.log10(24.5), 30)]), abs=1e-9)
    assert up == pytest.approx(np.array([(math.log10(20), low), (math.log10(20), high)]), abs=1e-9)
    prose = prose_of("quick")
    assert f"30.00 {low:.2f} to {high:.2f} 0.0316" in prose
    assert "Bars of the PSNR hold it in 95 % of cases or more." in prose
    assert "8 x 6 pixels, frames 0, 7" in prose and "counts there by the chance" in prose
    for absent in ("SSIM", "on the volume", "Convergence", "amplified"):
        assert absent not in prose


def test_facts_are_texts() -> None:
    assert format_facts({"a_b": (1, 2), "c": {"d": None}}) == [("a b", "1 x 2"), ("c", "d unknown")]


def test_three_files_are_the_same_every_time(tmp_path: Path) -> None:
    paths = write_study(CASES["nothing measured"], tmp_path / "new" / "a", date=DATE)
    assert paths == [tmp_path / "new" / "a" / name for name in REPORT_FILES]
    assert sorted(paths) == sorted((tmp_path / "new" / "a").iterdir())
    assert paths[-1].read_text("utf-8") == text_of("nothing measured")


def test_a_volume_whose_name_is_not_utf_8(tmp_path: Path) -> None:
    study = CASES["nothing measured"]
    name = os.fsdecode(b"scan\xff.npy")
    paths = write_study(replace(study, volume={**study.volume, "name": name}), tmp_path, date=DATE)
    assert json.loads(paths[1].read_bytes())["volume"]["name"] == name


def test_a_full_disk_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_study(CASES["nothing measured"], tmp_path, date=DATE)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def fill(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", fill)
    with pytest.raises(RenderError, match="the disk is full"):
        write_study(CASES["undefined"], tmp_path, date=DATE)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("size", "small"), [((1, 1), (1, 1)), ((256, 256), (256, 256)), ((257, 3), (129, 2)), ((5, 769), (2, 193))]
)
def test_pictures_are_small_and_keep_what_is_even(size: tuple[int, int], small: tuple[int, int]) -> None:
    (found,) = pictures_of_truth(np.full((*size, 3), 0.4))
    assert found.shape == (*small, 3) and max(small) <= 256
    assert np.all(found == 102)


def test_pixels_of_small_pictures_are_means() -> None:
    checkered = np.indices((512, 512)).sum(axis=0) % 2
    (found,) = pictures_of_truth(np.repeat(checkered[..., None], 3, axis=2).astype(float))
    assert np.all(found == 128)  # 127.5, rounded half up as in every picture


def pictures_of_truth(picture: Float64) -> list[UInt8]:
    """Return the pictures on the page of a study with one exact picture."""
    truth = replace(CASES["all"].truths[0], means=PixelMeans(picture, np.zeros_like(picture)))
    text = report_of(study_of([], truths=(truth,)))[".html"]
    return [decode_png(base64.b64decode(each)) for each in re.findall(r"data:image/png;base64,([^\"]*)", text)]


def test_differences_are_amplified_and_have_no_sign() -> None:
    truth = np.full((4, 4, 3), 0.5)
    picture = truth + np.array([0.05, -0.05, 0.4])
    amplified = [102, 102, 255]  # eight times the difference
    assert np.all(rounded(amplified_difference(picture, truth)) == amplified)
