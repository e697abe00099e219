"""The page of a comparison is sound HTML that loads nothing, with all results and pictures of the worst frames."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import imageio.v3 as imageio
import numpy as np
import numpy.typing as npt
import pytest
from html_page import Page, assert_can_be_heard, assert_sound_and_alone

from hsplat_cli.compare import (
    CROP_PX,
    NUM_PASSING_SHOWN,
    PICTURE_PX,
    Comparison,
    Gallery,
    GalleryFrame,
    Outcome,
    Pair,
    Status,
    comparison_page,
    plot_errors,
)
from renderer.film import Pixels

EVIL = "</script><b onclick='x'>\"&{{ 7 * 7 }}"
LIMITS = {"largest": 1.0, "p99": 0.0}


def picture(height: int = 12, width: int = 16, channels: int = 3, *, value: int = 100) -> Pixels:
    return np.full((height, width, channels), value, np.uint8)


def spoiled(golden: Pixels, steps: int, y: int = 3, x: int = 5) -> Pixels:
    actual = golden.astype(np.int16)
    actual[y, x, 1] += steps
    return actual.astype(np.uint8)


def judged(name: str, largest: float) -> Outcome:
    """Return the outcome of a frame with one pixel that is off by `largest` steps."""
    figures = {"largest": float(largest), "p99": 0.0}
    over = [figure for figure in figures if figures[figure] > LIMITS[figure]]
    status: Status = "different" if over else "close" if largest else "same"
    return Outcome(name, status, f"{name} is off by {largest} steps", LIMITS, figures, over, (0.0, 0.25, -0.5))


def shown(*cases: tuple[Outcome, Pair], max_frames: int = 24, **facts: Any) -> tuple[Comparison, Gallery]:
    gallery = Gallery(max_frames)
    for outcome, pair in cases:
        gallery.add(outcome, pair)
    return Comparison("goldens", "frames", "same-machine", [outcome for outcome, _ in cases], **facts), gallery


def off_by(steps: int, name: str) -> tuple[Outcome, Pair]:
    golden = picture()
    return judged(name, abs(steps)), Pair(name, golden, spoiled(golden, steps))


def absent(status: Status, name: str, channels: int = 3) -> tuple[Outcome, Pair]:
    present = picture(channels=channels)
    golden, actual = {"missing": (present, None), "extra": (None, present)}.get(status, (present, picture(6, 8)))
    return Outcome(name, status, f"{name}: {status}"), Pair(name, golden, actual)


def mixed() -> tuple[Comparison, Gallery]:
    return shown(
        off_by(0, "a0.png"),
        off_by(1, "a1.png"),
        off_by(-40, "a2.png"),
        absent("missing", "a3.png"),
        absent("extra", "a4.png", channels=4),
        absent("other size", "a5.png"),
        off_by(7, "a6.png"),
        notes=["the driver differs"],
        facts={"device": ("llvmpipe 15", "llvmpipe 17"), "hsplat": ("0.1.0", "0.1.0")},
    )


CASES: dict[str, Callable[[], tuple[Comparison, Gallery]]] = {
    "mixed": mixed,
    "same": lambda: shown(off_by(0, "a"), off_by(0, "b")),
    "close": lambda: shown(off_by(1, "a"), off_by(0, "b")),
    "one frame": lambda: shown(off_by(9, "a")),
    "only missing": lambda: shown(absent("missing", "a")),
    "no limits": lambda: shown((Outcome("a", "close", "no limits"), Pair("a", picture(), spoiled(picture(), 3)))),
    "evil": lambda: shown(
        (judged(EVIL, 9), Pair(EVIL, picture(), spoiled(picture(), 9))),
        notes=[EVIL],
        facts={EVIL: (EVIL, "other " + EVIL)},
    ),
}


@cache
def text_of(name: str) -> str:
    """Return its page; rendering one takes a moment."""
    return comparison_page(*CASES[name]())


@pytest.mark.parametrize("name", CASES, ids=lambda name: name.replace(" ", "-"))
def test_the_page_is_sound_loads_nothing_and_has_every_frame_with_its_reason(name: str) -> None:
    assert_sound_and_alone(text_of(name))
    assert_can_be_heard(text_of(name))
    words = [word.strip() for word in Page(text_of(name)).words]
    for outcome in CASES[name]()[0].outcomes:
        assert outcome.name in words and outcome.why in words


def test_names_are_escaped() -> None:
    text = text_of("evil")
    assert "<b onclick" not in text and "{{ 7 * 7 }}" in text
    page = Page(text)
    assert page.tags["b"] == 0 and page.tags["script"] == 1 and page.words.count(EVIL) >= 4
    assert f"golden of {EVIL}" in page.values("alt")


def test_unprintable_names_are_escaped() -> None:
    """The name has an invalid byte, a character that turns the direction of writing, and a bell."""
    text = comparison_page(*shown(off_by(9, "a\udcff\u202e\a.png")))
    assert r"a\udcff\u202e\x07.png" in Page(text).words
    text.encode()


# ---------------------------------------------------------------------------------------------------------- content


def test_the_worst_frames_come_first() -> None:
    """Frames without a pair come first, in the order of their names; then the order is that of the error."""
    expected = ["a3.png", "a4.png", "a5.png", "a2.png", "a6.png"]
    text = text_of("mixed")
    assert re.findall(r'<h3 id="worst-\d+-name">(.*?)</h3>', text) == expected
    rows = re.findall(r'<th scope="row" class="text" data-value="(\d+)">(?:<a [^>]*>)?(a\d.png)', text)
    assert [name for _, name in rows] == [*expected, "a1.png", "a0.png"]
    assert [int(number) for number, _ in rows] == [3, 4, 5, 2, 6, 1, 0]


def test_a_frame_without_a_pair_shows_one_picture() -> None:
    page = Page(text_of("only missing"))
    assert page.values("alt") == ["golden of a"]
    assert "no such actual frame" in page.words and "nothing to compare" in page.words
    assert page.tags["input"] == 3  # the amplifications: nothing to flip


def test_other_limits_are_named() -> None:
    text = comparison_page(
        *shown(off_by(1, "a"), other_limits=["largest 200 by g/compare.yaml", "flip none by option"])
    )
    assert "<title>1 frame passes at same-machine (with other limits: largest 200" in text
    assert "; but <strong>with other limits</strong>: largest 200 by g/compare.yaml; flip none by option.</p>" in text


# ------------------------------------------------------------------------------------------------------------- curve


def svg_of(comparison: Comparison) -> str:
    (svg,) = re.findall(
        r'(?s)<svg class="axes" viewBox="[^"]*" role="img".*?</svg>', comparison_page(comparison, Gallery())
    )
    return svg


def points_of(svg: str) -> list[list[tuple[float, float]]]:
    """Return the points of each curve."""
    paths = re.findall(r'<path d="([^"]*)" class="points"', svg)
    return [[(float(x), float(y)) for x, y in re.findall(r"M([\d.]+) ([\d.]+)h0", path)] for path in paths]


def test_the_curve_has_a_point_for_each_frame_and_a_mark_for_each_failure() -> None:
    cases = [off_by(steps, f"f{number}") for number, steps in enumerate([0, 1, 10, 100, 1] * 4, start=30)]
    comparison, _ = shown(*cases, absent("missing", "f50"))
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
    assert re.findall(r'<text x="54"[^>]*>([^<]*)<', svg) == ["0", "0.5", "1", "10", "100"]


def test_the_curve_breaks_at_frames_without_errors() -> None:
    comparison, _ = shown(off_by(1, "a"), absent("missing", "b"), off_by(1, "c"))
    svg = svg_of(comparison)
    (line, *_) = re.findall(r'<path d="([^"]*)" class="curve"', svg)
    assert line.count("M") == 2 and line.count("L") == 0
    assert "place of the frame" in svg


def test_without_limits_or_failures_there_is_no_plot() -> None:
    assert plot_errors(CASES["no limits"]()[0]) is None
    assert plot_errors(CASES["only missing"]()[0]) is not None


# ------------------------------------------------------------------------------------------------------------ gallery


def names(gallery: Gallery) -> list[str]:
    return [gallery_frame.outcome.name for gallery_frame in gallery.gallery_frames]


def test_the_gallery_keeps_the_worst_of_many() -> None:
    gallery, golden = Gallery(max_frames=5), picture()
    for steps in np.random.default_rng(7).permutation(2000):
        gallery.add(judged(f"{steps:04}", int(steps)), Pair("", golden, golden))
    assert names(gallery) == ["1999", "1998", "1997", "1996", "1995"]


def test_failing_frames_are_shown_alone() -> None:
    assert names(mixed()[1]) == ["a3.png", "a4.png", "a5.png", "a2.png", "a6.png"]
    _, gallery = shown(*(off_by(number % 2, f"{number:02}") for number in range(40)))
    assert names(gallery) == [f"{number:02}" for number in range(1, 2 * NUM_PASSING_SHOWN, 2)]
    assert names(CASES["same"]()[1]) == []


def gallery_frame_of(golden: Pixels, actual: Pixels) -> GalleryFrame:
    gallery = Gallery()
    gallery.add(judged("a", 9), Pair("a", golden, actual))
    return gallery.gallery_frames[0]


def pixels_of(frame: GalleryFrame, kind: str, *, enlarged: bool = False) -> Pixels:
    (found,) = [each for each in frame.pictures if each.kind == kind and bool(each.extent) == enlarged]
    assert found.pixels is not None
    return found.pixels


def test_the_difference_has_steps_and_signs() -> None:
    golden = picture()
    actual = spoiled(spoiled(golden, 40, 3, 5), -1, 4, 6)
    difference = pixels_of(gallery_frame_of(golden, actual), "difference")
    assert difference[3, 5].tolist() == [40, 0, 0] and difference[4, 6].tolist() == [0, 0, 1]
    assert np.count_nonzero(difference) == 2


def test_a_step_at_an_opacity_of_1_in_255_is_a_difference_of_1() -> None:
    golden = picture(channels=4)
    golden[..., 3] = 1
    difference = pixels_of(gallery_frame_of(golden, spoiled(golden, 1)), "difference")
    assert difference[3, 5].tolist() == [1, 0, 0]


@pytest.mark.parametrize("steps", [-1, 90])
def test_a_single_wrong_pixel_survives_scaling_down(steps: int) -> None:
    golden = picture(2 * PICTURE_PX + 1, 700)
    frame = gallery_frame_of(golden, spoiled(golden, steps, 2 * PICTURE_PX, 699))
    assert frame.pixels_per_side == 3 and frame.worst == (699, 2 * PICTURE_PX)
    small, difference = pixels_of(frame, "golden"), pixels_of(frame, "difference")
    assert small.shape == difference.shape == (342, 234, 3) and (small == 100).all()
    where = [2 if steps < 0 else 0]
    assert difference[341, 233, where].tolist() == [abs(steps)] and np.count_nonzero(difference) == 1


@pytest.mark.parametrize(
    ("y", "x", "corner", "place"),
    [(0, 0, (0, 0), (0, 0)), (99, 59, (12, 52), (47, 47)), (50, 30, (6, 26), (24, 24)), (10, 59, (12, 0), (10, 47))],
)
def test_the_surroundings_of_the_largest_error_are_enlarged(y, x, corner, place) -> None:
    golden = picture(100, 60)
    frame = gallery_frame_of(golden, spoiled(golden, 7, y, x))
    left, top = corner
    assert frame.worst == (x, y)
    assert frame.pictures[-1].extent == f", enlarged: x {left} to {left + 47}, y {top} to {top + 47}"
    assert pixels_of(frame, "difference", enlarged=True).shape == (CROP_PX, CROP_PX, 3)
    assert pixels_of(frame, "difference", enlarged=True)[place].tolist() == [7, 0, 0]
    assert pixels_of(frame, "actual", enlarged=True)[place].tolist() == [100, 107, 100]


def pixels_in(text: str) -> list[npt.NDArray[Any]]:
    pictures = re.findall(r"data:image/png;base64,([^\"]*)", text)
    return [imageio.imread(base64.b64decode(content), extension=".png") for content in pictures]


def test_the_page_has_the_pictures() -> None:
    golden, actual, difference = pixels_in(text_of("one frame"))
    assert (golden == picture()).all() and (actual == spoiled(picture(), 9)).all()
    assert difference[3, 5].tolist() == [9, 0, 0]


def test_the_page_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise cannot be compressed; as many frames as fit are shown, and the page says that there are more."""
    rng = np.random.default_rng(3)
    noise = rng.integers(0, 256, (40, 40, 3), np.uint8)
    cases = [(judged(f"{k}", 250 - k), Pair(f"{k}", noise, noise[::-1].copy())) for k in range(9)]
    text = comparison_page(*shown(*cases))
    one = sum(map(len, re.findall(r"data:[^\"]*", text))) // 9
    monkeypatch.setattr("hsplat_cli.compare.comparison_html.MAX_PICTURE_BYTES", 4 * one)
    page = Page(comparison_page(*shown(*cases)))
    assert page.tags["article"] == 4
    assert "4 of the 9 that differ, worst first." in page.prose and "of this file" in page.prose
