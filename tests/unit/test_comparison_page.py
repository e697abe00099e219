"""The page of a comparison is sound HTML that loads nothing, with all results and pictures of the worst frames."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import imageio.v3 as imageio
import numpy as np
import numpy.typing as npt
import pytest
from comparing import compare_pictures
from html_page import Page, assert_can_be_heard, assert_sound_and_alone

from renderer.film import Pixels

EVIL = "<b onclick='x'>\"&{{ 7 * 7 }}.png"
LIMITS = {"largest": 1.0, "p99": 0.0}


def picture(height: int = 12, width: int = 16, channels: int = 3, *, value: int = 100) -> Pixels:
    return np.full((height, width, channels), value, np.uint8)


GOLDEN = picture()


def spoiled(golden: Pixels, steps: int, y: int = 3, x: int = 5) -> Pixels:
    """Return a picture in which one pixel is off by `steps` steps."""
    actual = golden.astype(np.int16)
    actual[y, x, 1] += steps
    return actual.astype(np.uint8)


def off_by(**steps: int) -> tuple[Mapping[str, Pixels], Mapping[str, Pixels]]:
    """Return goldens and frames of these names, with one pixel that is off by so many steps."""
    golden = dict.fromkeys([f"{name}.png" for name in steps], GOLDEN)
    return golden, {f"{name}.png": spoiled(GOLDEN, number) for name, number in steps.items()}


def mixed() -> tuple[Mapping[str, Pixels], Mapping[str, Pixels]]:
    golden, actual = off_by(a0=0, a1=1, a2=-40, a6=7)
    golden = {**golden, "a3.png": GOLDEN, "a5.png": GOLDEN}
    return golden, {**actual, "a4.png": picture(channels=4), "a5.png": picture(6, 8)}


CASES: dict[str, Callable[[], tuple[Mapping[str, Pixels], Mapping[str, Pixels]]]] = {
    "mixed": mixed,
    "same": lambda: off_by(a=0, b=0),
    "close": lambda: off_by(a=1, b=0),
    "one frame": lambda: off_by(a=9),
    "missing": lambda: ({"a.png": GOLDEN, "b.png": GOLDEN}, {"b.png": GOLDEN}),
    "evil": lambda: ({EVIL: GOLDEN}, {EVIL: spoiled(GOLDEN, 9)}),
}


class Compared(NamedTuple):
    """A comparison, and the text of its page."""

    comparison: Any
    text: str


def compared(folder: Path, golden: Mapping[str, Pixels], actual: Mapping[str, Pixels], **limits: float) -> Compared:
    folder.mkdir(exist_ok=True)
    comparison = compare_pictures(folder, golden, actual, limits or LIMITS, html=folder / "page.html")
    return Compared(comparison, (folder / "page.html").read_text("utf-8"))


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Compared]:
    return {name: compared(tmp_path_factory.mktemp("case"), *make()) for name, make in CASES.items()}


@pytest.mark.parametrize("name", CASES, ids=lambda name: name.replace(" ", "-"))
def test_the_page_is_sound_loads_nothing_and_has_every_frame_with_its_reason(
    name: str, cases: dict[str, Compared]
) -> None:
    comparison, text = cases[name]
    assert_sound_and_alone(text)
    assert_can_be_heard(text)
    words = [word.strip() for word in Page(text).words]
    for outcome in comparison.outcomes:
        assert outcome.name in words and outcome.why in words


def test_names_are_escaped(cases: dict[str, Compared]) -> None:
    text = cases["evil"].text
    assert "<b onclick" not in text and "{{ 7 * 7 }}" in text
    page = Page(text)
    assert page.tags["b"] == 0 and page.tags["script"] == 1 and page.words.count(EVIL) >= 2
    assert f"golden of {EVIL}" in page.values("alt")


def test_unprintable_names_are_escaped(tmp_path: Path) -> None:
    """The name has an invalid byte, a character that turns the direction of writing, and a bell."""
    name = "a\udcff\u202e\a.png"
    text = compared(tmp_path, {name: GOLDEN}, {name: spoiled(GOLDEN, 9)}).text
    assert r"a\udcff\u202e\x07.png" in Page(text).words
    text.encode()


# ---------------------------------------------------------------------------------------------------------- content


def test_the_worst_frames_come_first(cases: dict[str, Compared]) -> None:
    """Frames without a pair come first, in the order of their names; then the order is that of the error."""
    expected = ["a3.png", "a4.png", "a5.png", "a2.png", "a6.png"]
    text = cases["mixed"].text
    assert shown_in(text) == expected
    rows = re.findall(r'<th scope="row" class="text" data-value="(\d+)">(?:<a [^>]*>)?(a\d.png)', text)
    assert [name for _, name in rows] == [*expected, "a1.png", "a0.png"]
    assert [int(number) for number, _ in rows] == [3, 4, 5, 2, 6, 1, 0]


def test_a_frame_without_a_pair_shows_one_picture(cases: dict[str, Compared]) -> None:
    page = Page(cases["missing"].text)
    assert page.values("alt") == ["golden of a.png"]
    assert "no such actual frame" in page.words and "nothing to compare" in page.words
    assert page.tags["input"] == 3  # the amplifications: nothing to flip


def test_other_limits_are_named(cases: dict[str, Compared]) -> None:
    text = cases["close"].text
    others = "largest 1, p99 0 by option"
    assert f"<title>2 frames pass at exact (with other limits: {others}): 1 the same, 1 close" in text
    assert f"; but <strong>with other limits</strong>: {others}.</p>" in text


def test_figures_are_given_with_limits_shares_and_signs(cases: dict[str, Compared]) -> None:
    words = [word.strip() for word in Page(cases["mixed"].text).words]
    for expected in ("−0.208", "+0.0365", "at most 1", "40", "7", "largest error of a channel, at most 1 step"):
        assert expected in words, expected


# ------------------------------------------------------------------------------------------------------------- curve


def svg_of(text: str) -> str:
    (svg,) = re.findall(r'(?s)<svg class="axes" viewBox="[^"]*" role="img".*?</svg>', text)
    return svg


def points_of(svg: str) -> list[list[tuple[float, float]]]:
    """Return the points of each curve."""
    paths = re.findall(r'<path d="([^"]*)" class="points"', svg)
    return [[(float(x), float(y)) for x, y in re.findall(r"M([\d.]+) ([\d.]+)h0", path)] for path in paths]


def test_the_curve_has_a_point_for_each_frame_and_a_mark_for_each_failure(tmp_path: Path) -> None:
    golden, actual = off_by(**{f"f{number}": [0, 1, 10, 100, 1][number % 5] for number in range(30, 50)})
    svg = svg_of(compared(tmp_path, {**golden, "f50.png": GOLDEN}, actual).text)
    assert "frame number" in svg
    assert [len(points) for points in points_of(svg)] == [20, 20]
    assert svg.count('class="cross"') == 9 and svg.count("<title>") == 9
    largest = points_of(svg)[0]
    assert [x for x, _ in largest] == sorted({x for x, _ in largest})
    none, limit, ten, hundred, _ = (y for _, y in largest[:5])
    assert none > limit > ten > hundred
    assert ten - hundred == pytest.approx(limit - ten, abs=0.11)  # both are a decade; written to a tenth
    assert f"M62 {limit:.1f}H850" in svg  # the line of the limit
    assert re.findall(r'<text x="54"[^>]*>([^<]*)<', svg) == ["0", "0.5", "1", "10", "100"]


def test_the_curve_breaks_at_frames_without_errors(tmp_path: Path) -> None:
    golden, actual = off_by(a=1, c=1)
    svg = svg_of(compared(tmp_path, {**golden, "b.png": GOLDEN}, actual).text)
    (line, *_) = re.findall(r'<path d="([^"]*)" class="curve"', svg)
    assert line.count("M") == 2 and line.count("L") == 0
    assert "place of the frame" in svg


# ------------------------------------------------------------------------------------------------------------ gallery


def shown_in(text: str) -> list[str]:
    """Return the names of the frames whose pictures are shown."""
    return re.findall(r'<h3 id="worst-\d+-name">(.*?)</h3>', text)


def test_the_gallery_keeps_the_worst_of_many(tmp_path: Path) -> None:
    steps = {f"f{number:03}": int(each) for number, each in enumerate(np.random.default_rng(7).permutation(60))}
    text = compared(tmp_path, *off_by(**steps)).text
    worst = sorted(steps, key=lambda name: -steps[name])[:24]
    assert shown_in(text) == [f"{name}.png" for name in worst]


def test_frames_that_pass_are_shown_only_where_none_fails(cases: dict[str, Compared], tmp_path: Path) -> None:
    text = compared(tmp_path, *off_by(**{f"f{number:02}": number % 2 for number in range(40)})).text
    assert shown_in(text) == [f"f{number:02}.png" for number in range(1, 12, 2)]
    assert shown_in(cases["same"].text) == []


def pixels_in(text: str) -> list[npt.NDArray[Any]]:
    """Return the pictures of a page: golden, actual and difference of each frame."""
    pictures = re.findall(r"data:image/png;base64,([^\"]*)", text)
    return [imageio.imread(base64.b64decode(content), extension=".png") for content in pictures]


def pictures_of(folder: Path, golden: Pixels, actual: Pixels) -> list[npt.NDArray[Any]]:
    """Return golden, actual and difference of one frame, and the enlarged parts, if there are any."""
    return pixels_in(compared(folder, {"a.png": golden}, {"a.png": actual}, largest=0).text)


def test_the_difference_has_steps_and_signs(tmp_path: Path) -> None:
    actual = spoiled(spoiled(GOLDEN, 40, 3, 5), -1, 4, 6)
    shown_golden, shown_actual, difference = pictures_of(tmp_path, GOLDEN, actual)
    assert (shown_golden == GOLDEN).all() and (shown_actual == actual).all()
    assert difference[3, 5].tolist() == [40, 0, 0] and difference[4, 6].tolist() == [0, 0, 1]
    assert np.count_nonzero(difference) == 2


def test_a_step_at_an_opacity_of_1_in_255_is_a_difference_of_1(tmp_path: Path) -> None:
    golden = picture(channels=4)
    golden[..., 3] = 1
    _, _, difference = pictures_of(tmp_path, golden, spoiled(golden, 1))
    assert difference[3, 5].tolist() == [1, 0, 0]


@pytest.mark.parametrize("steps", [-1, 90])
def test_a_single_wrong_pixel_survives_scaling_down(steps: int, tmp_path: Path) -> None:
    golden = picture(1025, 700)
    text = compared(tmp_path, {"a.png": golden}, {"a.png": spoiled(golden, steps, 1024, 699)}, largest=0).text
    assert "largest error at x 699, y 1024" in text and "1/3 of its size" in text
    small, _, difference, *_ = pixels_in(text)
    assert small.shape == difference.shape == (342, 234, 3) and (small == 100).all()
    where = [2 if steps < 0 else 0]
    assert difference[341, 233, where].tolist() == [abs(steps)] and np.count_nonzero(difference) == 1


@pytest.mark.parametrize(
    ("y", "x", "corner", "place"),
    [(0, 0, (0, 0), (0, 0)), (99, 59, (12, 52), (47, 47)), (50, 30, (6, 26), (24, 24)), (10, 59, (12, 0), (10, 47))],
)
def test_the_surroundings_of_the_largest_error_are_enlarged(y, x, corner, place, tmp_path: Path) -> None:
    golden, (left, top) = picture(100, 60), corner
    text = compared(tmp_path, {"a.png": golden}, {"a.png": spoiled(golden, 7, y, x)}, largest=0).text
    extent = f", enlarged: x {left} to {left + 47}, y {top} to {top + 47}"
    assert Page(text).values("alt")[3:] == [f"{kind} of a.png{extent}" for kind in ("golden", "actual", "difference")]
    _, actual, difference = pixels_in(text)[3:]
    assert difference.shape == (48, 48, 3)
    assert difference[place].tolist() == [7, 0, 0]
    assert actual[place].tolist() == [100, 107, 100]


def test_the_page_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise cannot be compressed; as many frames as fit are shown, and the page says that there are more."""
    noise = np.random.default_rng(3).integers(0, 200, (40, 40, 3), np.uint8)
    golden = dict.fromkeys([f"{number}.png" for number in range(9)], noise)
    actual = {name: noise + np.uint8(20 - int(name[0])) for name in golden}
    text = compared(tmp_path / "all", golden, actual).text
    one = sum(map(len, re.findall(r"data:[^\"]*", text))) // 9
    monkeypatch.setattr("hsplat_cli.compare.comparison_html.MAX_PICTURE_BYTES", 4 * one)
    page = Page(compared(tmp_path / "some", golden, actual).text)
    assert page.tags["article"] == 4
    assert "4 of the 9 that differ, worst first." in page.prose and "of this file" in page.prose
