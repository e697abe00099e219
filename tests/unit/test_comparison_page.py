"""The page of a comparison is sound HTML that loads only pictures beside it, with all that its script needs."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from html_page import Page, assert_can_be_heard, assert_sound_and_alone

from hsplat_cli.compare import (
    Change,
    ComparedFilm,
    ComparedFrame,
    Comparison,
    ComparisonRequest,
    Flickers,
    Nearness,
    ReportPicture,
    compare,
    report_page,
)
from hsplat_cli.terminal import Reporter
from renderer.film import encode_png

EVIL = "</script><b onclick='x'>\"&{{ 7 * 7 }}"
DIGEST = "0" * 32


def picture(file: str) -> ReportPicture:
    return ReportPicture(DIGEST, file)


def frame(number: int, part_psnr: float | None = 20.0, *, passes: bool = False, **more: Any) -> ComparedFrame:
    name = f"frame-{number:04}.png"
    values: dict[str, Any] = {
        "name": name,
        "status": "close" if passes else "different",
        "why": f"why {number}",
        "frame": number,
        "psnr": None if part_psnr is None else part_psnr + 10,
        "part_psnr": part_psnr,
        "part": (8, 16),
        "largest": 9.0,
        "old": picture(f"films/0/old/{name}"),
        "new": picture(f"films/0/new/{name}"),
    }
    return ComparedFrame(**(values | more))


def film(name: str = "engine", *frames: ComparedFrame, **more: Any) -> ComparedFilm:
    return ComparedFilm(name, "45 dB", f"scenes/{name}.yaml", f"goldens/{name}", frames=frames, **more)


def data_of(text: str) -> dict[str, Any]:
    """Return the values that the script of a page starts with."""
    (found,) = re.findall(r"(?m)^const report = (.*);$", text)
    data: dict[str, Any] = json.loads(found)
    return data


def page_of(*films: ComparedFilm) -> tuple[Page, dict[str, Any]]:
    text = report_page(Comparison(films, ("scenes",)))
    assert_sound_and_alone(re.sub(r'(?s)<template id="viewer-template">.*?</template>', "", text))
    assert_can_be_heard(text)
    return Page(text), data_of(text)


MIXED = (
    film("kept", frame(0, 200.0, passes=True)),
    film("bad", frame(0, 50.0, passes=True), frame(1, 30.0), frame(2, 20.0), frame(3, None, status="missing")),
    film("torn", error="scenes/torn.yaml: this scene has no goldens"),
)


def test_all_films_come_by_verdict_with_their_reasons() -> None:
    page, data = page_of(*MIXED)
    assert [each["name"] for each in data["films"]] == ["torn", "bad", "kept"]
    assert [each["verdict"] for each in data["films"]] == ["not compared", "fails", "passes"]
    assert "scenes/torn.yaml: this scene has no goldens" in page.words
    assert page.tags["article"] == 3
    for part in ("not compared (1)", "fails (1)", "passes (1)"):
        assert part in page.prose


def test_names_are_text_in_the_page_and_in_its_script() -> None:
    changes = (Change(EVIL, EVIL, EVIL, 3),)
    evil = replace(film(EVIL, replace(frame(1), name=EVIL, why=EVIL), changes=changes), notes=(EVIL,))
    page, data = page_of(evil, film(f"b{EVIL}", error=EVIL))
    assert page.tags["b"] == 0 and page.tags["script"] == 1
    assert page.words.count(EVIL) >= 5
    shown = data["films"][1]
    assert shown["name"] == EVIL and shown["frames"][0]["why"] == EVIL


def test_a_film_whose_name_no_command_line_can_hold_is_shown_but_not_accepted() -> None:
    page, data = page_of(film("a\x1b[31m\u202e", frame(1)))
    assert r"a\x1b[31m\u202e" in page.words
    assert "accepts" not in data["films"][0]["frames"][0]


def test_frames_that_fail_with_a_number_and_a_new_picture_or_none_any_more_can_be_accepted() -> None:
    frames = [
        frame(0, 50.0, passes=True),
        frame(1),
        frame(2, None, status="missing", new=None),
        frame(3, new=ReportPicture(DIGEST)),
        frame(4, None, status="other size"),
        replace(frame(5), frame=None),
    ]
    _, data = page_of(film("engine", *frames))
    assert [index for index, each in enumerate(data["films"][0]["frames"]) if each.get("accepts")] == [1, 2, 4]
    _, data = page_of(replace(film("engine", *frames), scene=""))
    assert not any(each.get("accepts") for each in data["films"][0]["frames"])


def test_the_bar_of_failing_frames_has_a_legend() -> None:
    page, _ = page_of(film("a", frame(0, 50.0, passes=True), frame(1, 20.0)), film("b", frame(0, 50.0, passes=True)))
    assert page.prose.count("At the bottom: frames that fail, those of them that you accept.") == 1


def test_addresses_of_pictures_are_quoted() -> None:
    _, data = page_of(film("a", frame(1, old=picture("films/0/old/50% #1?.png"))))
    assert data["films"][0]["frames"][0]["old"] == "films/0/old/50%25%20%231%3F.png"
    assert data["films"][0]["frames"][0]["new"] == "films/0/new/frame-0001.png"


def test_the_chart_marks_the_first_and_the_worst_frame_that_fails() -> None:
    page, _ = page_of(film("a", frame(0, 50.0, passes=True), frame(4, 30.0), frame(6, 20.0), frame(7, 25.0)))
    assert "frame-0004.png: the first that fails" in page.words
    assert "frame-0006.png: the worst" in page.words
    assert "Crosses mark frame-0004.png, the first that fails; frame-0006.png, the worst." in page.prose
    page, _ = page_of(film("a", frame(0), frame(1, 50.0, passes=True)))
    assert "frame-0000.png: the first that fails, and the worst" in page.words


def test_a_chart_needs_two_figures() -> None:
    page, data = page_of(film("a", frame(0)), film("b", frame(0, None), frame(1)))
    assert not any("chart" in each for each in data["films"]) and "Error over the frames" not in page.words


def test_flicker_and_nearness_are_told() -> None:
    near = frame(1, nearer=Nearness(40.0, 50.0, differs=True))
    exact = frame(2, nearer=Nearness(200.0, 50.0, differs=True))
    page, data = page_of(film("a", near, exact, flicker=Flickers(1.25, 0.5)))
    assert "flicker: the goldens have 0.50 levels of 255, the new pictures have 1.25" in page.prose
    assert "flicker: the new pictures have 1.25 levels" in page_of(film("a", near, flicker=Flickers(1.25)))[0].prose
    text = "nearer to the exact picture: the golden has 40.0 dB of the exact picture, the new one 50.0 dB"
    assert f"frame-0001.png: {text}" in page.prose and data["films"][0]["frames"][0]["nearer"] == text
    assert "further from the exact picture: the golden has 200 dB or more of the exact picture" in page.prose


def test_changes_show_colours_with_a_swatch_and_say_what_is_not_there() -> None:
    changes = (Change("points.0.color", "#ffa500", "#008080", 4), Change("light", "", "1"), Change("title", "1", ""))
    voxels = Change("volume.fingerprint", "0" * 32, "1" * 32)
    page, _ = page_of(film("a", frame(1), changes=(*changes, voxels)))
    assert "digest of the volume's voxels" in page.prose
    swatches = [value for value in page.values("style") if value.startswith("background: #")]
    assert swatches == ["background: #ffa500", "background: #008080"]
    assert "not there" in page.words and "gone" in page.words


def test_equal_outcomes_give_equal_pages_and_other_ones_forget_decisions() -> None:
    """The key by which a browser keeps decisions is that of the outcomes."""
    text = report_page(Comparison(MIXED))
    assert report_page(Comparison(MIXED)) == text
    other = replace(MIXED[0], frames=(frame(0, 199.0, passes=True),))
    assert data_of(report_page(Comparison((other, *MIXED[1:]))))["key"] != data_of(text)["key"]


def test_the_page_of_a_report_finds_its_pictures(tmp_path: Path) -> None:
    """Names of files may hold characters that addresses cannot."""
    for side, value in (("golden", 100), ("actual", 140)):
        Path(tmp_path, side).mkdir()
        Path(tmp_path, side, "50% #1.png").write_bytes(encode_png(np.full((16, 16, 3), value, np.uint8)))
    places = [str(tmp_path / "golden"), str(tmp_path / "actual")]
    comparison = compare(ComparisonRequest(places, report=tmp_path / "report"), Reporter(is_quiet=True))
    data = data_of(Path(tmp_path, "report/index.html").read_text("utf-8"))
    assert comparison.arguments == () and data["arguments"] == []
    (only,) = data["films"][0]["frames"]
    for side in ("old", "new"):
        assert Path(tmp_path, "report", unquote(only[side])).is_file()


def test_the_command_finds_the_scenes_and_goldens_that_were_compared(tmp_path: Path) -> None:
    scene, goldens, report = (tmp_path / name for name in ("it's.yaml", "goldens here", "report"))
    scene.write_text("volume: <b>", "utf-8")
    compare(ComparisonRequest([str(scene)], goldens=goldens, report=report), Reporter(is_quiet=True))
    data = data_of(Path(report, "index.html").read_text("utf-8"))
    assert data["arguments"] == [str(scene), "--goldens", str(goldens)]
