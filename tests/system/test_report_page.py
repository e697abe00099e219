"""Tests of a report's page and files: valid HTML that loads nothing, equal bytes, files whole or not at all."""

from __future__ import annotations

import errno
import html
import importlib.util
import json
import os
import re
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml
from html_page import Page, assert_can_be_heard, assert_sound_and_alone
from matplotlib.figure import Figure
from studies import INFINITE, NAN, UNDEFINED, brick_series, measure, own_series, quick_series, study_of

from hsplat_cli.reports import REPORT_FILES, format_facts, plot_style, study_html, write_study
from hsplat_cli.reports.html import PALETTE, figure_to_svg
from hsplat_cli.reports.plots import TIME_AXIS, metrics_figure, tradeoff_figure
from hsplat_cli.reports.study_html import study_page
from renderer.errors import InputError, RenderError

DATE = "2030-01-02"
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
    """Return the page of a case; plots take a second, and only some cases need them."""
    with pytest.MonkeyPatch.context() as patch:
        if case not in ("all", "hostile names, one measurement of one frame"):
            for name in ("tradeoff_figure", "metrics_figure"):
                patch.setattr(study_html, name, lambda *_: Figure(figsize=(1, 1)))
        return study_page(CASES[case], date=DATE)


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
    text = html.unescape(study_page(study_of([], scene=scene), date=DATE))
    (block,) = re.findall(r"<pre>(.*?)</pre>", text, re.DOTALL)
    assert yaml.safe_load(block) == {**scene, "size": [8, 6]}


def test_costs_are_those_of_the_front() -> None:
    assert "25 15.5 1 933 gaussian, optical, tolerance 0.1" in prose_of("all")
    assert "40 74.4 not reached integrated, optical, tolerance 0" in prose_of("both")


def test_numbers_sort_as_numbers() -> None:
    values = Page(text_of("undefined")).values("data-value")
    assert "Infinity" in values and str(NAN) not in values


def test_plots_have_a_curve_for_each_series_and_the_front() -> None:
    with plot_style():
        axes = tradeoff_figure(CASES["both"].measurements, TIME_AXIS).axes[0]
        panels = metrics_figure(CASES["all"].measurements).axes
    curves = {str(line.get_label()): line for line in axes.lines}
    assert {"gaussian, optical", "integrated, optical"} <= set(curves)
    front = curves["Pareto front"]
    assert list(front.get_ydata()) == [22, 30, 31.5, 41]
    assert list(front.get_xdata()) == pytest.approx([10, 20, 40, 80])
    assert (axes.get_xscale(), axes.get_xlabel(), axes.get_ylabel()) == ("log", "time of a frame, ms", "PSNR, dB")
    assert {"1", "0.1", "0"} <= {text.get_text() for text in axes.texts}
    assert [panel.get_ylabel() for panel in panels] == [
        "PSNR on the volume, dB",
        "SSIM",
        "FLIP",
        "pixels with Delta-E over 2.3",
    ]


def test_estimates_have_bars_and_intervals() -> None:
    with plot_style():
        axes = tradeoff_figure(quick_series(), TIME_AXIS).axes[0]
    across, up = (collection.get_segments() for collection in axes.collections)
    low, high = (quick_series()[0].overall.everywhere[f"psnr_{end}"] for end in ("low", "high"))
    assert len(across) == len(up) == 2  # a PSNR without error is not shown
    assert up[0][:, 1] == pytest.approx([low, high])
    assert axes.lines[0].get_ydata()[0] == pytest.approx(30.0)
    prose = prose_of("quick")
    assert f"30.00 {low:.2f} to {high:.2f} 0.0316" in prose
    assert "Those of the PSNR hold it in 95 % of cases or more." in prose
    assert "8 x 6 pixels, frames 0, 7" in prose and "counts there by the chance" in prose
    for absent in ("SSIM", "on the volume", "Convergence", "amplified", "The same settings by other metrics"):
        assert absent not in prose


def test_labels_do_not_cover_each_other() -> None:
    crowd = [measure(f"tolerance {9 - k}", 10 + k / 2, 10 + k, 30 + k / 8, series=f"series {k}") for k in range(9)]
    with plot_style():
        figure = tradeoff_figure(crowd, TIME_AXIS)
        figure.draw_without_rendering()
        boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    assert len(boxes) == 9
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])


def test_plots_depend_on_the_page_and_not_on_the_users_settings() -> None:
    from matplotlib import rc_context

    def draw() -> str:
        with plot_style():
            return figure_to_svg(tradeoff_figure(own_series(), TIME_AXIS), name="plot", alt='a "plot"')

    svg = draw()
    assert "var(--series-1)" in svg
    assert not any(light in svg for light, _ in PALETTE.values())
    assert 'aria-label="a &#34;plot&#34;"' in svg
    with rc_context({"axes.grid": False, "lines.linewidth": 9, "svg.fonttype": "path"}):
        assert draw() == svg


@pytest.mark.parametrize("decades", [0.1, 2, 9])
def test_ticks_leave_room_for_each_other(decades: float) -> None:
    measurements = own_series()
    costs = {id(m): 10 ** (decades * k / (len(measurements) - 1)) for k, m in enumerate(measurements)}
    with plot_style():
        figure = tradeoff_figure(measurements, replace(TIME_AXIS, cost=lambda m: costs[id(m)], has_bars=False))
        figure.draw_without_rendering()
        axes = figure.axes[0]
        low, high = axes.get_xlim()
        boxes = [
            label.get_window_extent()
            for label, at in zip(axes.get_xticklabels(), axes.get_xticks(), strict=True)
            if low <= at <= high
        ]
    assert len(boxes) >= 2
    assert all(left.x1 < right.x0 for left, right in pairwise(boxes))


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


def test_a_missing_package_is_reported_before_anything_is_written(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError) as caught:
        write_study(CASES["all"], tmp_path, date=DATE)
    assert str(caught.value) == "the package matplotlib is not installed\n  hint: pip install 'hsplat[measure]'"
    assert list(tmp_path.iterdir()) == []
