"""The page of a comparison: sound HTML that loads nothing, with all that was found and pictures of the worst frames."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import imageio.v3 as imageio
import numpy as np
import numpy.typing as npt
import pytest
from html_page import Page, assert_can_be_heard, assert_sound_and_alone

from hsplat_cli.compare import comparison_html as page_module, gallery as gallery_module
from hsplat_cli.compare.comparison_html import comparison_page, verdict
from hsplat_cli.compare.error_plot import plot_errors
from hsplat_cli.compare.figure_format import limit_text, limits_text, share_text, signed_text, value_text
from hsplat_cli.compare.gallery import CROP_PX, NUM_PASSING_SHOWN, PICTURE_PX, Gallery, GalleryFrame
from hsplat_cli.compare.outcome import Comparison, Outcome, Status
from hsplat_cli.compare.pair import Pair
from renderer.film import Pixels

EVIL = "</script><b onclick='x'>\"&{{ 7 * 7 }}"
LIMITS = {"largest": 1.0, "p99": 0.0}


def picture(height: int = 12, width: int = 16, channels: int = 3, *, level: int = 100) -> Pixels:
    return np.full((height, width, channels), level, np.uint8)


def spoiled(golden: Pixels, levels: int, y: int = 3, x: int = 5) -> Pixels:
    actual = golden.astype(np.int16)
    actual[y, x, 1] += levels
    return actual.astype(np.uint8)


def judged(name: str, largest: float, number: int | None = None) -> Outcome:
    """As a judge would see one pixel that is off by so many levels."""
    figures = {"largest": float(largest), "p99": 0.0}
    over = [figure for figure in figures if figures[figure] > LIMITS[figure]]
    status: Status = "different" if over else "close" if largest else "same"
    why = f"{name} is off by {largest} levels"
    return Outcome(name, status, why, figures, LIMITS, over, (0.0, 0.25, -0.5), number)


def shown(*cases: tuple[Outcome, Pair], max_frames: int = 24, **facts: Any) -> tuple[Comparison, Gallery]:
    gallery = Gallery(max_frames)
    for outcome, pair in cases:
        gallery.add(outcome, pair)
    return Comparison("goldens", "frames", "same-machine", [outcome for outcome, _ in cases], **facts), gallery


def off_by(levels: int, name: str, number: int | None = None) -> tuple[Outcome, Pair]:
    golden = picture()
    return judged(name, abs(levels), number), Pair(name, golden, spoiled(golden, levels), number)


def absent(status: Status, name: str, number: int | None = None, channels: int = 3) -> tuple[Outcome, Pair]:
    there = picture(channels=channels)
    golden, actual = {"missing": (there, None), "extra": (None, there)}.get(status, (there, picture(6, 8)))
    return Outcome(name, status, f"{name}: {status}", number=number), Pair(name, golden, actual, number)


def mixed() -> tuple[Comparison, Gallery]:
    return shown(
        off_by(0, "a0.png", 0),
        off_by(1, "a1.png", 1),
        off_by(-40, "a2.png", 2),
        absent("missing", "a3.png", 3),
        absent("extra", "a4.png", 4, channels=4),
        absent("other size", "a5.png", 5),
        off_by(7, "a6.png", 6),
        notes=["the driver differs"],
        facts={"driver": ("llvmpipe 15", "llvmpipe 17"), "hsplat": ("0.1.0", "0.1.0")},
    )


CASES: dict[str, Callable[[], tuple[Comparison, Gallery]]] = {
    "mixed": mixed,
    "same": lambda: shown(off_by(0, "a"), off_by(0, "b")),
    "close": lambda: shown(off_by(1, "a", 1), off_by(0, "b", 2)),
    "one frame": lambda: shown(off_by(9, "a")),
    "only missing": lambda: shown(absent("missing", "a", 3)),
    "no limits": lambda: shown((Outcome("a", "close", "no limits"), Pair("a", picture(), spoiled(picture(), 3)))),
    "evil": lambda: shown(
        (judged(EVIL, 9), Pair(EVIL, picture(), spoiled(picture(), 9))),
        notes=[EVIL],
        facts={EVIL: (EVIL, "other " + EVIL)},
    ),
}


@cache
def text_of(name: str) -> str:
    """Its page, of which each takes a moment to make."""
    return comparison_page(*CASES[name]())


each_case = pytest.mark.parametrize("name", CASES, ids=lambda name: name.replace(" ", "-"))


@each_case
def test_the_page_is_sound_and_loads_nothing(name: str) -> None:
    assert_sound_and_alone(text_of(name))
    assert_can_be_heard(text_of(name))


@each_case
def test_every_frame_has_its_row_and_its_reason(name: str) -> None:
    words = [word.strip() for word in Page(text_of(name)).words]
    for outcome in CASES[name]()[0].outcomes:
        assert outcome.name in words and outcome.why in words


def test_the_same_bytes_twice() -> None:
    assert comparison_page(*CASES["mixed"]()) == text_of("mixed")


def test_names_are_escaped() -> None:
    text = text_of("evil")
    assert "<b onclick" not in text and "{{ 7 * 7 }}" in text
    page = Page(text)
    assert page.tags["b"] == 0 and page.tags["script"] == 1 and page.words.count(EVIL) >= 4
    assert f"golden of {EVIL}" in page.values("alt")


def test_names_that_are_no_text_have_a_form() -> None:
    """A byte that is no UTF-8, a character that turns the direction of writing, a bell."""
    text = comparison_page(*shown(off_by(9, "a\udcff\u202e\a.png")))
    assert r"a\xff\u202e\x07.png" in Page(text).words
    text.encode()


# ---------------------------------------------------------------------------------------------------------- content


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("mixed", "5 of 7 frames differ at same-machine: 2 different, 1 extra, 1 missing, 1 other size"),
        ("same", "All 2 frames are the same, pixel by pixel"),
        ("close", "All 2 frames are within the limits of same-machine, 1 of them the same"),
        ("one frame", "The frame differs at same-machine: different"),
        ("only missing", "The frame differs at same-machine: missing"),
        ("no limits", "The frame is within the limits of same-machine"),
    ],
)
def test_the_verdict_is_the_heading_and_the_title(name: str, expected: str) -> None:
    assert verdict(CASES[name]()[0]) == expected
    assert Page(text_of(name)).words.count(expected) == 2


def test_what_was_compared_comes_first_and_differences_stand_out() -> None:
    text = text_of("mixed")
    page = Page(text)
    assert "compared goldens frames driver llvmpipe 15 llvmpipe 17 hsplat 0.1.0 0.1.0" in page.prose
    assert '<td class="text differs">llvmpipe 17</td>' in text and text.count('class="text differs"') == 1
    order = ["<h1>", "llvmpipe 15", "the driver differs", "The error over the frames", "The worst frames", "All frames"]
    body = text[text.index("<body>") :]
    assert [body.index(words) for words in order] == sorted(body.index(words) for words in order)


def test_the_worst_come_first() -> None:
    """What has no pair, as they are named; then by the error."""
    expected = ["a3.png", "a4.png", "a5.png", "a2.png", "a6.png"]
    text = text_of("mixed")
    assert re.findall(r'<h3 id="worst-\d+-name">(.*?)</h3>', text) == expected
    rows = re.findall(r'<th scope="row" class="text" data-value="(\d+)">(?:<a [^>]*>)?(a\d.png)', text)
    assert [name for _, name in rows] == [*expected, "a1.png", "a0.png"]
    assert [int(number) for number, _ in rows] == [3, 4, 5, 2, 6, 1, 0]


def test_figures_have_value_unit_and_limit() -> None:
    prose = Page(text_of("one frame")).prose
    assert (
        "largest error of a channel 9 levels at most 1 9 99th percentile of the pixels' largest errors 0 levels"
        in prose
    )
    assert "red 0 green +0.25 blue −0.5" in prose


def test_a_frame_without_a_pair_shows_the_picture_that_there_is() -> None:
    page = Page(text_of("only missing"))
    assert page.values("alt") == ["golden of a"]
    assert "no such actual frame" in page.words and "nothing to compare" in page.words
    assert page.tags["input"] == 3  # the amplifications: nothing to flip


def test_pictures_that_can_be_flipped_are_labels_of_one_switch() -> None:
    page = Page(text_of("one frame"))
    assert page.values("for") == ["worst-1-flip", "worst-1-flip"] and "worst-1-flip" in page.values("id")


def test_transparent_pictures_lie_on_a_checkerboard() -> None:
    classes = [value for tag, name, value in Page(text_of("mixed")).attributes if (tag, name) == ("img", "class")]
    assert sum("transparent" in value for value in classes) == 1


def test_a_page_tells_of_other_limits() -> None:
    text = comparison_page(
        *shown(off_by(1, "a"), other_limits=["largest 200 by g/compare.yaml", "flip none by option"])
    )
    assert "<title>The frame" in text and "of same-machine (with other limits)" in text
    assert "; but <strong>with other limits</strong>: largest 200 by g/compare.yaml; flip none by option.</p>" in text


@pytest.mark.parametrize(("levels", "gain"), [(5, 50), (6, 10)])
def test_differences_are_amplified_as_far_as_they_can_be_told_apart(levels: int, gain: int) -> None:
    (checked,) = re.findall(r'id="gain-(\d+)" checked', comparison_page(*shown(off_by(levels, "a"))))
    assert int(checked) == gain


# ------------------------------------------------------------------------------------------------------------- curve


def svg_of(comparison: Comparison) -> str:
    (svg,) = re.findall(r'(?s)<svg viewBox="[^"]*" role="img".*?</svg>', comparison_page(comparison, Gallery()))
    return svg


def points_of(svg: str) -> list[list[tuple[float, float]]]:
    """Of each curve."""
    paths = re.findall(r'<path d="([^"]*)" class="points"', svg)
    return [[(float(x), float(y)) for x, y in re.findall(r"M([\d.]+) ([\d.]+)h0", path)] for path in paths]


def test_the_curve_has_a_point_for_each_frame_and_a_mark_for_each_failure() -> None:
    cases = [off_by(levels, f"f{number}", number) for number, levels in enumerate([0, 1, 10, 100, 1] * 4, start=30)]
    comparison, _ = shown(*cases, absent("missing", "f50", 50))
    svg = svg_of(comparison)
    assert "frame number" in svg
    assert [len(points) for points in points_of(svg)] == [20, 20]
    assert svg.count('class="cross"') == 9 and svg.count("<title>") == 9
    largest = points_of(svg)[0]
    assert [x for x, _ in largest] == sorted({x for x, _ in largest})
    none, limit, ten, hundred, _ = (y for _, y in largest[:5])
    assert none > limit > ten > hundred
    assert ten - hundred == pytest.approx(limit - ten, abs=0.11)  # both are a decade; written to a tenth
    assert f"M62 {limit:.1f}H850" in svg  # the line of the limit


def test_the_curve_breaks_where_there_is_nothing_to_compare() -> None:
    comparison, _ = shown(off_by(1, "a", 1), absent("missing", "b", 2), off_by(1, "c", 3))
    (line, *_) = re.findall(r'<path d="([^"]*)" class="curve"', svg_of(comparison))
    assert line.count("M") == 2 and line.count("L") == 0


def test_frames_without_numbers_stand_in_their_order() -> None:
    assert "place of the frame" in svg_of(shown(off_by(1, "a"), off_by(1, "b"))[0])


def test_an_error_where_none_is_allowed_lies_over_the_limit_as_far_as_it_is_large() -> None:
    outcomes = [
        Outcome(f"{levels}", "different", "", {"largest": 1.0, "p99": levels}, LIMITS, ["p99"])
        for levels in (1.0, 9.0, 99.0)
    ]
    ((_, limit), *_), ((_, one), (_, nine), (_, all_of_99)) = points_of(
        svg_of(Comparison("g", "a", "same-machine", outcomes))
    )
    assert limit > one > nine > all_of_99
    assert nine - all_of_99 == pytest.approx(limit - nine, abs=0.11)  # 10 and 100 times the limit
    page = comparison_page(Comparison("g", "a", "same-machine", outcomes), Gallery())
    assert "with a limit of no error, an error of n levels, or of n hundredths in FLIP and SSIM, counts as 1" in page


def test_nothing_to_plot() -> None:
    assert plot_errors(CASES["no limits"]()[0]) is None
    assert plot_errors(CASES["only missing"]()[0]) is not None


# ------------------------------------------------------------------------------------------------------------ gallery


def names(gallery: Gallery) -> list[str]:
    return [gallery_frame.outcome.name for gallery_frame in gallery.gallery_frames]


def test_the_gallery_keeps_the_worst_of_many(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    make = gallery_module._make_gallery_frame
    monkeypatch.setattr(gallery_module, "_make_gallery_frame", lambda o, p: (made.append(o.name), make(o, p))[1])
    order = np.random.default_rng(7).permutation(2000)
    gallery = Gallery(max_frames=5)
    golden = picture()
    for levels in order:
        name = f"{levels:04}"
        gallery.add(judged(name, int(levels)), Pair(name, golden, golden))
        assert len(gallery._frames) <= 5
    assert names(gallery) == ["1999", "1998", "1997", "1996", "1995"]
    assert len(made) < 100  # the others were not even looked at


def test_equals_go_by_the_order_of_their_names() -> None:
    _, gallery = shown(*(off_by(9, f"{number}") for number in range(9)), max_frames=3)
    assert names(gallery) == ["0", "1", "2"]


def test_where_nothing_is_allowed_the_largest_errors_are_the_worst() -> None:
    golden = picture()
    cases = [
        (
            Outcome(f"{k}", "different", "", {"largest": float(k)}, {"largest": 0.0}, ["largest"]),
            Pair("", golden, golden),
        )
        for k in (3, 9, 1, 7)
    ]
    comparison, gallery = shown(*cases, max_frames=3)
    assert [outcome.name for outcome in comparison.worst_first] == ["9", "7", "3", "1"]
    assert names(gallery) == ["9", "7", "3"]


def test_where_something_fails_nothing_else_is_shown() -> None:
    assert names(mixed()[1]) == ["a3.png", "a4.png", "a5.png", "a2.png", "a6.png"]
    _, gallery = shown(*(off_by(number % 2, f"{number:02}") for number in range(40)))
    assert names(gallery) == [f"{number:02}" for number in range(1, 2 * NUM_PASSING_SHOWN, 2)]
    assert names(CASES["same"]()[1]) == []


def exhibit_of(golden: Pixels, actual: Pixels) -> GalleryFrame:
    gallery = Gallery()
    gallery.add(judged("a", 9), Pair("a", golden, actual))
    return gallery.gallery_frames[0]


def test_the_difference_has_levels_and_signs() -> None:
    golden = picture()
    actual = spoiled(spoiled(golden, 40, 3, 5), -1, 4, 6)
    difference = exhibit_of(golden, actual).overview.difference
    assert difference is not None
    assert difference[3, 5].tolist() == [40, 0, 0] and difference[4, 6].tolist() == [0, 0, 1]
    assert np.count_nonzero(difference) == 2


def test_the_smallest_difference_is_a_level() -> None:
    """One level of colour at an opacity of 1 in 255."""
    golden = picture(channels=4)
    golden[..., 3] = 1
    assert exhibit_of(golden, spoiled(golden, 1)).overview.difference[3, 5].tolist() == [1, 0, 0]  # type: ignore[index]


@pytest.mark.parametrize("levels", [-1, 1, 90])
def test_a_single_wrong_pixel_survives_scaling_down(levels: int) -> None:
    golden = picture(2 * PICTURE_PX + 1, 700)
    gallery_frame = exhibit_of(golden, spoiled(golden, levels, 2 * PICTURE_PX, 699))
    assert gallery_frame.pixels_per_side == 3 and gallery_frame.worst == (699, 2 * PICTURE_PX)
    overview, difference = gallery_frame.overview, gallery_frame.overview.difference
    assert overview.golden is not None and difference is not None
    assert overview.golden.shape == difference.shape == (342, 234, 3) and (overview.golden == 100).all()
    where = [2 if levels < 0 else 0]
    assert difference[341, 233, where].tolist() == [abs(levels)] and np.count_nonzero(difference) == 1


@pytest.mark.parametrize(
    ("y", "x", "corner", "place"),
    [(0, 0, (0, 0), (0, 0)), (99, 59, (12, 52), (47, 47)), (50, 30, (6, 26), (24, 24)), (10, 59, (12, 0), (10, 47))],
)
def test_what_is_most_off_is_shown_pixel_by_pixel(
    y: int, x: int, corner: tuple[int, int], place: tuple[int, int]
) -> None:
    golden = picture(100, 60)
    gallery_frame = exhibit_of(golden, spoiled(golden, 7, y, x))
    assert (gallery_frame.worst, gallery_frame.corner) == ((x, y), corner)
    assert (
        gallery_frame.crop is not None
        and gallery_frame.crop.difference is not None
        and gallery_frame.crop.actual is not None
    )
    assert gallery_frame.crop.difference.shape == (CROP_PX, CROP_PX, 3)
    assert gallery_frame.crop.difference[place].tolist() == [7, 0, 0] and gallery_frame.crop.actual[place].tolist() == [
        100,
        107,
        100,
    ]


def test_small_frames_need_no_enlargement() -> None:
    assert exhibit_of(picture(2 * CROP_PX, 4), spoiled(picture(2 * CROP_PX, 4), 7, 3, 1)).crop is None
    crop = exhibit_of(picture(2 * CROP_PX + 1, 4), spoiled(picture(2 * CROP_PX + 1, 4), 7, 3, 1)).crop
    assert crop is not None and crop.golden is not None and crop.golden.shape == (CROP_PX, 4, 3)


def test_colours_are_averaged_as_far_as_they_are_opaque() -> None:
    golden = np.zeros((2 * PICTURE_PX, 2, 4), np.uint8)
    golden[::2, 0] = (200, 100, 50, 255)
    golden[::2, 1] = (255, 255, 255, 0)
    gallery_frame = exhibit_of(golden, golden)
    assert gallery_frame.overview.golden is not None and gallery_frame.overview.golden.shape == (PICTURE_PX, 1, 4)
    assert (gallery_frame.overview.golden == (200, 100, 50, 64)).all()


def pixels_in(text: str) -> list[npt.NDArray[Any]]:
    pictures = re.findall(r"data:image/png;base64,([^\"]*)", text)
    return [imageio.imread(base64.b64decode(content), extension=".png") for content in pictures]


def test_the_page_has_the_pictures() -> None:
    golden, actual, difference = pixels_in(text_of("one frame"))
    assert (golden == picture()).all() and (actual == spoiled(picture(), 9)).all()
    assert difference[3, 5].tolist() == [9, 0, 0]


def test_the_page_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise cannot be compressed; as many frames as fit are shown, and that there were more is said."""
    rng = np.random.default_rng(3)
    noise = rng.integers(0, 256, (40, 40, 3), np.uint8)
    cases = [(judged(f"{k}", 250 - k), Pair(f"{k}", noise, noise[::-1].copy())) for k in range(9)]
    text = comparison_page(*shown(*cases))
    one = sum(map(len, re.findall(r"data:[^\"]*", text))) // 9
    monkeypatch.setattr(page_module, "MAX_PICTURE_BYTES", 4 * one)
    page = Page(comparison_page(*shown(*cases)))
    assert page.tags["article"] == 4
    assert "4 of the 9 that differ, worst first." in page.prose and "of this file" in page.prose


# ------------------------------------------------------------------------------------------------------------ numbers


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (value_text("largest", 7.0, 1.0), "7"),
        (value_text("flip", 0.123456, 0.1), "0.123"),
        (value_text("flip", 0.100004, 0.1), "0.100004"),
        (value_text("flip", 0.1, 0.1), "0.1"),
        (value_text("ssim", 0.99949, 0.9995), "0.999"),
        (limit_text("largest", 4), "at most 4"),
        (limit_text("ssim", 0.99), "at least 0.99"),
        (signed_text(0.1234), "+0.123"),
        (signed_text(-3), "−3"),
        (signed_text(0), "0"),
        (signed_text(-6.1e-5), "−6.1e−05"),
        (share_text(12.34), "12.3"),
        (share_text(math.inf), "∞"),
        (limits_text("largest", [4, 4]), "largest error of a channel, at most 4 levels"),
        (limits_text("largest", [1]), "largest error of a channel, at most 1 level"),
        (limits_text("flip", [0.1]), "mean FLIP, at most 0.1"),
        (limits_text("flip", [0.1, 0.2]), "mean FLIP, limits differ between frames"),
    ],
)
def test_texts(text: str, expected: str) -> None:
    assert text == expected
