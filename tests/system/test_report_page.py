"""The page and the files of a report: sound HTML that loads nothing, the same every time, whole or not there."""

from __future__ import annotations

import errno
import html
import importlib.util
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
from studies import INFINITE, NAN, UNDEFINED, brick_series, measure, own_series, peer_series, study_of

from hsplat_cli.reports import (
    REPORT_FILES,
    format_facts,
    plot_style,
    png_data_uri,
    require_writable_files,
    write_study,
)
from hsplat_cli.reports.html import PALETTE, figure_to_svg
from hsplat_cli.reports.plots import TIME_AXIS, metrics_figure, short_labels, tick_text, tradeoff_figure
from hsplat_cli.reports.study_html import study_page
from renderer.errors import InputError, RenderError
from renderer.study import Study

DATE = "2030-01-02"
EVIL = "<script>alert('x')</script> & \"$x^2$\" {{ 7 * 7 }}"


CASES = {
    "all": study_of([*own_series(), *peer_series()]),
    "bricks": study_of([*brick_series(), *peer_series()]),
    "both": study_of([*brick_series(), *own_series()]),
    "nothing measured": study_of([], notes=()),
    "undefined": study_of([measure("tolerance 1", 10, 0, UNDEFINED), measure("tolerance 0", 20, 5, INFINITE)]),
    "only the peer, once exact": study_of(
        [*peer_series(), measure("sample distance 0", 900, None, INFINITE, series="vtk gpu", tool="vtk")]
    ),
    "evil, one measurement of one frame": study_of(
        [measure(f"{EVIL} 1", 12, 500, 30, series=EVIL, frames=(5,))],
        volume={"name": EVIL, EVIL: EVIL},
        scene={"output": {"size": [8, 6]}, "volume": {"file": EVIL}},
        machine={EVIL: {EVIL: EVIL}},
        notes=(EVIL,),
    ),
}


@cache
def text_of(case: str) -> str:
    """Its page, which takes a second to make."""
    return study_page(CASES[case], date=DATE)


@pytest.fixture(params=CASES, ids=lambda name: name.replace(" ", "-"))
def case(request: pytest.FixtureRequest) -> tuple[Study, str]:
    return CASES[request.param], text_of(request.param)


def test_the_page_is_sound_and_loads_nothing(case: tuple[Study, str]) -> None:
    assert_sound_and_alone(case[1])


def test_pictures_and_tables_can_be_heard(case: tuple[Study, str]) -> None:
    assert_can_be_heard(case[1])


def test_every_setting_has_its_row(case: tuple[Study, str]) -> None:
    study, text = case
    page = Page(text)
    assert page.tags["img"] == len(study.truths) + 2 * len(study.measurements)
    for m in study.measurements:
        assert m.setting.label in page.words or m.setting.label.strip() in (word.strip() for word in page.words)


def test_names_are_escaped() -> None:
    text = text_of("evil, one measurement of one frame")
    assert "alert('x')</script>" not in text
    assert "{{ 7 * 7 }}" in text
    assert any("$x^2$" in word for word in Page(text).words)


def test_rows_on_the_front_are_marked() -> None:
    assert Page(text_of("all")).attributes.count(("tr", "class", "front")) == 6
    assert Page(text_of("undefined")).attributes.count(("tr", "class", "front")) == 1


def test_the_scene_can_be_pasted() -> None:
    scene = {"volume": {"file": "a: b.nhdr"}, "error": {"tolerance": {0: 0.5, 60: 0.02}}, "size": (8, np.int64(6))}
    text = html.unescape(study_page(study_of([], scene=scene), date=DATE))
    (block,) = re.findall(r"<pre>(.*?)</pre>", text, re.DOTALL)
    assert yaml.safe_load(block) == {**scene, "size": [8, 6]}


def test_notes_come_before_everything() -> None:
    text = text_of("all")
    assert text.index("the error rises") < text.index("<svg")


def test_prices_stand_against_the_peer() -> None:
    words = " ".join(" ".join(Page(text_of("all")).words).split())
    assert "25 15.5 1 933 ≤ 100 ≤ 6.45 gaussian, optical, tolerance 0.1" in words
    assert "40 not reached not reached 285 - -" in words
    assert "times as long" not in " ".join(Page(text_of("evil, one measurement of one frame")).words)


def test_bricks_are_not_counted_as_splats() -> None:
    """Where nothing else is drawn nothing is said of splats; and what the cells are is said only there."""
    text = " ".join(" ".join(Page(text_of("bricks")).words).split())
    assert "Error against time and splats" not in text and "Error against time" in text
    assert "25 ≤ 20.0 ≤ 100 - integrated, optical, tolerance 1" in text
    assert "splats of a frame" not in text_of("bricks") and "splats of a frame" in text_of("all")
    assert "difference bricks time ms" in text
    assert "the cut and its bricks, made for all" in text and "pyramid ms, once cut ms, once" in text
    assert "The integrated footprint draws bricks of 16 x 16 x 16 cells. " in text
    assert "splats" not in text and "bricks" not in " ".join(Page(text_of("all")).words)


def test_bricks_beside_splats() -> None:
    """A column that counts both says so, and no curve that is not in a plot is in its description."""
    text = " ".join(" ".join(Page(text_of("both")).words).split())
    assert "bricks or cells splats time ms" in text and "the cut and its bricks or splats, made for all" in text
    assert "bricks of 16 x 16 x 16 cells; the others draw a splat for each cell." in text
    assert "Settings with bricks are not in this plot." in text and "Bricks" not in text_of("all")
    assert "Splats: the fewest of a footprint that draws them" in text and "Splats: the" not in text_of("all")
    plots = re.findall(r'"(PSNR in dB over[^"]*)"', text_of("both"))
    assert "logarithmic, of integrated, optical, gaussian, optical" in plots[0]
    assert plots[-1] == "PSNR in dB over the splats of a frame, logarithmic, of gaussian, optical"


def test_one_frame_is_no_frames() -> None:
    facts = " ".join(Page(text_of("evil, one measurement of one frame")).words)
    assert "8 x 6 pixels, frame 5 " in " ".join(facts.split())


def test_stages_say_how_often_they_were_timed() -> None:
    """The pyramid once, the cut in every repetition, the order in every repetition on both frames."""
    text = " ".join(" ".join(Page(text_of("all")).words).split())
    stages = text[text.index("Time by stage Median") :]
    assert "× number of timings" in stages
    assert "pyramid ms, once cut ms, once order ms, each frame" in stages
    assert "tolerance 1 250 × 1 11.0 (10.5 – 11.5) × 3 2.50 (2.31 – 3.06) × 6" in stages
    assert "vtk gpu sample distance 2 - - - - 100 " in stages


def test_how_the_truth_converged_depends_on_shading() -> None:
    plain, shaded = (study_page(study_of([], scene={"shading": of}), date=DATE) for of in (None, {"ambient": 0.3}))
    assert "until one halving changed none of its channels by 0.0001." in plain
    assert "until two halvings in a row changed none of its channels by 0.0001:" in shaded
    assert "in a row" not in plain + text_of("all") and "one halving" not in shaded


def test_the_peers_rounding_is_told() -> None:
    told = "limits a picture to about 59 dB"
    assert told in text_of("all") and told in text_of("only the peer, once exact")
    assert told not in text_of("undefined")


def test_what_cannot_be_plotted_is_counted() -> None:
    assert "Not shown, because equal to the truth: 1." in text_of("only the peer, once exact")
    nothing = text_of("undefined")
    assert "<svg" not in nothing and "No measurement can be plotted." in nothing


def test_plots_have_a_curve_for_each_series_and_both_fronts() -> None:
    with plot_style():
        axes = tradeoff_figure(CASES["all"].measurements, TIME_AXIS).axes[0]
    curves = {str(line.get_label()): line for line in axes.lines}
    assert {"gaussian, optical", "vtk gpu", "vtk fixed point"} <= set(curves)
    own, peer = curves["Pareto front of hsplat"], curves["Pareto front of VTK"]
    assert list(own.get_ydata()) == [22, 31.5, 36] and list(peer.get_ydata()) == [29, 33, 41]
    assert list(own.get_xdata()) == pytest.approx([10, 40, 400])
    assert (axes.get_xscale(), axes.get_xlabel(), axes.get_ylabel()) == ("log", "time of a frame, ms", "PSNR, dB")
    assert {"1", "0.1", "0", "2", "0.5"} <= {text.get_text() for text in axes.texts}


def test_the_peers_curves_do_not_run_from_one_image_reduction_to_the_next() -> None:
    points = [
        (measure(f"step {step}", ms, None, quality, series="vtk gpu", tool="vtk"), reduction)
        for step, ms, quality, reduction in ((1, 40, 41, 1), (2, 20, 35, 1), (1, 30, 33, 2), (2, 15, 30, 2))
    ]
    measurements = [
        replace(m, setting=replace(m.setting, options={**m.setting.options, "image_reduction": reduction}))
        for m, reduction in points
    ]
    with plot_style():
        (axes,) = tradeoff_figure(measurements, TIME_AXIS).axes
    curves = [line for line in axes.lines if line.get_marker() == "x"]
    assert [list(line.get_ydata()) for line in curves] == [[41, 35], [33, 30]]
    assert axes.get_legend_handles_labels()[1].count("vtk gpu") == 1


def test_every_axis_has_a_title() -> None:
    with plot_style():
        panels = metrics_figure(CASES["all"].measurements).axes
    assert [axes.get_ylabel() for axes in panels] == [
        "PSNR on the volume, dB",
        "SSIM",
        "FLIP",
        "pixels with Delta-E over 2.3, %",
    ]
    assert {axes.get_xlabel() for axes in panels} == {"time of a frame, ms"}


def test_labels_do_not_cover_each_other() -> None:
    crowd = [measure(f"tolerance {9 - k}", 10 + k / 2, 10 + k, 30 + k / 8, series=f"series {k}") for k in range(9)]
    with plot_style():
        figure = tradeoff_figure(crowd, TIME_AXIS)
        figure.draw_without_rendering()
        boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    assert len(boxes) == 9
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])


def test_colours_follow_the_page() -> None:
    with plot_style():
        svg = figure_to_svg(tradeoff_figure(own_series(), TIME_AXIS), name="plot", alt='a "plot"')
    assert "var(--series-1)" in svg
    assert not any(light in svg for light, _ in PALETTE.values())
    assert 'aria-label="a &#34;plot&#34;"' in svg


def test_a_users_matplotlib_settings_change_nothing() -> None:
    from matplotlib import rc_context

    def draw() -> str:
        with plot_style():
            return figure_to_svg(tradeoff_figure(own_series(), TIME_AXIS), name="plot", alt="")

    plain = draw()
    with rc_context({"axes.grid": False, "lines.linewidth": 9, "svg.fonttype": "path"}):
        assert draw() == plain


@pytest.mark.parametrize("decades", [0.1, 1, 2, 4, 6, 9])
def test_ticks_leave_room_for_each_other(decades: float) -> None:
    measurements = own_series()
    costs = {id(m): 10 ** (decades * k / (len(measurements) - 1)) for k, m in enumerate(measurements)}
    with plot_style():
        figure = tradeoff_figure(measurements, replace(TIME_AXIS, cost=lambda m: costs[id(m)], quartiles=None))
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


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        (["tolerance 1", "tolerance 0.1"], ("tolerance", ["1", "0.1"])),
        (["tolerance 1"], ("tolerance", ["1"])),
        (["sample distance 1", "sample rate 2"], ("sample", ["distance 1", "rate 2"])),
        (["a", "b"], ("", ["a", "b"])),
        ([], ("", [])),
    ],
)
def test_short_labels(labels: list[str], expected: tuple[str, list[str]]) -> None:
    assert short_labels(labels) == expected


def test_small_texts() -> None:
    assert [tick_text(v) for v in (0.5, 5000, 2e4, 1e6, 5e9)] == ["0.5", "5000", "20 k", "1 M", "5 G"]
    assert format_facts({"a_b": (1, 2), "c": {"d": None}}) == [("a b", "1 x 2"), ("c", "d unknown")]
    assert png_data_uri(np.zeros((1, 1, 3), np.uint8)).startswith("data:image/png;base64,iVBORw0KGgo")


# -------------------------------------------------------------------------------------------------------------- files


def test_three_files_the_same_every_time(tmp_path: Path) -> None:
    paths = write_study(CASES["only the peer, once exact"], tmp_path / "new" / "a", date=DATE)
    assert paths == [tmp_path / "new" / "a" / name for name in REPORT_FILES]
    assert sorted(paths) == sorted((tmp_path / "new" / "a").iterdir())
    assert paths[-1].read_text("utf-8") == text_of("only the peer, once exact")


def test_trying_leaves_nothing(tmp_path: Path) -> None:
    require_writable_files(tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "index.html").write_text("before", "utf-8")
    require_writable_files(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]
    assert (tmp_path / "index.html").read_text("utf-8") == "before"


def test_a_folder_that_is_a_file(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(InputError) as caught:
        require_writable_files(file)
    assert str(caught.value) == (
        f"{file}: the folder of the report is a file\n"
        "  got: a file\n  expected: a folder, or an unused name\n  hint: name another folder"
    )
    with pytest.raises(InputError) as caught:
        require_writable_files(file / "below")
    assert str(caught.value) == f"{file}/below/measure.csv: the output folder is a file\n  got: {file}"
    assert list(tmp_path.iterdir()) == [file]


def test_an_output_that_is_a_folder(tmp_path: Path) -> None:
    (tmp_path / "index.html").mkdir()
    with pytest.raises(InputError, match="the output is a folder"):
        require_writable_files(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]


def test_a_folder_without_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(Path, "touch", refuse)
    with pytest.raises(RenderError, match="no permission to write here"):
        require_writable_files(tmp_path / "a")
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_study(CASES["nothing measured"], tmp_path, date=DATE)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def fill(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", fill)
    with pytest.raises(RenderError, match="the disk is full"):
        write_study(CASES["undefined"], tmp_path, date=DATE)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("missing", ["jinja2", "matplotlib"])
def test_a_missing_package(missing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == missing else find(name))
    with pytest.raises(InputError) as caught:
        write_study(CASES["all"], tmp_path, date=DATE)
    assert str(caught.value) == f"the package {missing} is not installed\n  hint: pip install 'hsplat[measure]'"
    assert list(tmp_path.iterdir()) == []


def test_numbers_sort_as_numbers() -> None:
    page = Page(text_of("undefined"))
    assert "Infinity" in page.values("data-value") and str(NAN) not in page.values("data-value")
