"""The outcomes for CI: whatever names hold, each format stays what it is."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from hsplat_cli.compare import (
    REPORT,
    Change,
    ComparedFilm,
    ComparedFrame,
    Comparison,
    Mistake,
    Nearness,
    code_quality,
    comparison_text,
    github_lines,
    junit,
    summary_markdown,
)

HOSTILE = [
    "a\n::error::pwned",
    "a\r::set-output name=x::y",
    "a%0A::error::b",
    "a,line=9:b",
    "<script>alert(1)</script>",
    "]]>\"'&amp;",
    "a | b | `c` **d** [e](javascript:f) <img src=x>",
    "# title",
    "\x00\x0b\x1b[31m\ufffe\uffff",
    "\udcff\udcfe",
    "\u202egnp.exe",
]


@pytest.fixture(autouse=True)
def _outside_of_ci(monkeypatch: pytest.MonkeyPatch) -> None:
    """Name no repository that CI has checked out."""
    for name in ("GITHUB_WORKSPACE", "CI_PROJECT_DIR"):
        monkeypatch.delenv(name, raising=False)


def film(name: str, *frames: ComparedFrame, **more: object) -> ComparedFilm:
    return ComparedFilm(name, "same bytes", f"{name}.yaml", f"goldens/{name}", frames=frames, **more)  # type: ignore[arg-type]


def failing(name: str = "frame-0001.png", part_psnr: float = 20.0, nearer: Nearness | None = None) -> ComparedFrame:
    return ComparedFrame(name, "different", f"why {name}", 1, 30.0, part_psnr, (0, 0), 9.0, 200.0, nearer=nearer)


PASSING = ComparedFrame("frame-0000.png", "same", "the same stored values", 0)
CHANGE = Change("error.tolerance", "0.1", "0.2", 5)
MIXED = Comparison(
    (
        film("a", PASSING),
        film("b", PASSING, failing(), changes=(CHANGE, Change("device", "x", "y"))),
        film("c", error="c.yaml: this scene has no goldens"),
    )
)


def hostile(text: str) -> Comparison:
    frame = ComparedFrame(text, "different", text, 1, 30.0, 20.0, (0, 0), 9.0, 200.0)
    return Comparison((film(text, frame, changes=(Change(text, text, text, 3),)), film("z", error=text)))


def test_the_worst_comes_first() -> None:
    assert MIXED.verdict == "not compared"
    assert MIXED.summary == "3 films: 1 could not be compared, 1 fail, 1 pass"
    assert [each.name for each in MIXED.worst_first] == ["c", "b", "a"]
    assert MIXED.films[1].summary == "1 of 2 frames fails: 1 different, 1 the same"
    frames = [failing("x", 30), failing("y", 10), ComparedFrame("z", "missing", "gone"), PASSING]
    assert [frame.name for frame in film("a", *frames).failing] == ["z", "y", "x"]


def test_a_film_without_a_comparison_does_not_pass() -> None:
    empty = film("a")
    assert (empty.verdict, empty.summary) == ("not compared", "no frame was compared")


def test_a_report_is_read_as_it_was_written() -> None:
    near = Comparison((film("a", failing(nearer=Nearness(40.0, 30.0, differs=True)), changes=(CHANGE,)),))
    for comparison in (MIXED, near, *map(hostile, HOSTILE)):
        content = REPORT.content(comparison)
        assert REPORT.from_json(json.loads(content), __file__) == comparison  # type: ignore[arg-type]


def test_junit_has_a_case_for_each_frame() -> None:
    root = ElementTree.fromstring(junit(MIXED))
    counts = {suite.get("name"): [suite.get(key) for key in ("tests", "failures", "errors")] for suite in root}
    assert counts == {"c": ["1", "0", "1"], "b": ["2", "1", "0"], "a": ["1", "0", "0"]}
    (failure,) = root.iter("failure")
    assert failure.get("message") == "why frame-0001.png"
    assert failure.text == "limit: same bytes\nerror.tolerance was 0.1, is 0.2\ndevice was x, is y"
    (error,) = root.iter("error")
    assert error.get("message") == "c.yaml: this scene has no goldens"


@pytest.mark.parametrize("text", HOSTILE)
def test_junit_is_xml(text: str) -> None:
    root = ElementTree.fromstring(junit(hostile(text)).encode())
    assert len(list(root.iter("testcase"))) == 2
    assert {element.tag for element in root.iter()} <= {"testsuites", "testsuite", "testcase", "failure", "error"}


def test_lines_of_github_are_at_the_changed_keys() -> None:
    assert list(github_lines(MIXED)) == [
        "::error file=c.yaml,line=1,title=golden film c::c.yaml: this scene has no goldens",
        "::error file=b.yaml,line=5,title=golden film b::1 of 2 frames fails: 1 different, 1 the same; "
        "error.tolerance was 0.1, is 0.2; device was x, is y",
    ]


def test_each_mistake_of_a_scene_has_its_line() -> None:
    wrong = film("a", error="a.yaml:3:1: x; a.yaml:7:1: y", mistakes=(Mistake("x", 3), Mistake("y", 7)))
    assert list(github_lines(Comparison((wrong,)))) == [
        "::error file=a.yaml,line=3,title=golden film a::x",
        "::error file=a.yaml,line=7,title=golden film a::y",
    ]
    issues = json.loads(code_quality(Comparison((wrong,))))
    assert [each["location"]["lines"]["begin"] for each in issues] == [3, 7]
    assert len({each["fingerprint"] for each in issues}) == 2


@pytest.mark.parametrize("variable", ["GITHUB_WORKSPACE", "CI_PROJECT_DIR"])
def test_places_are_relative_to_the_repository(variable: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "part").mkdir()
    monkeypatch.chdir(folder / "part")
    monkeypatch.setenv(variable, str(folder))
    places = [line.split(",")[0] for line in github_lines(MIXED)]
    assert places == ["::error file=part/c.yaml", "::error file=part/b.yaml"]
    paths = [each["location"]["path"] for each in json.loads(code_quality(MIXED))]
    assert paths == ["part/c.yaml", "part/b.yaml"]


def test_github_shows_the_first_key_of_each_film_before_the_second_of_any() -> None:
    """And at most ten errors of a step, of which the last one counts the others."""
    keys = tuple(Change(f"key{number}", "1", "2", number) for number in range(1, 5))
    many = Comparison(tuple(film(f"f{number}", failing(), changes=keys) for number in range(6)))
    lines = [*github_lines(many)]
    assert [line.split(",")[1] for line in lines[:9]] == ["line=1"] * 6 + ["line=2"] * 3
    assert lines[9:] == [
        "::error title=golden films::and 15 more changes of films that do not pass: see the report",
    ]
    unused = Comparison((ComparedFilm("goldens without a scene", "same bytes", error="1 folder"),))
    assert [*github_lines(unused)] == ["::error title=golden film goldens without a scene::1 folder"]


@pytest.mark.parametrize("text", HOSTILE)
def test_a_line_of_github_is_one_command(text: str) -> None:
    for line in github_lines(hostile(text)):
        assert "\n" not in line and "\r" not in line and line.isprintable()
        head, _, _ = line.removeprefix("::error ").partition("::")
        assert [pair.partition("=")[0] for pair in head.split(",")] == ["file", "line", "title"]
        assert dict(pair.split("=", 1) for pair in head.split(","))["line"] in ("1", "3")
        assert "%0A" not in line.replace("%250A", "")


@pytest.mark.parametrize("text", HOSTILE)
def test_a_summary_is_a_table_without_markup(text: str) -> None:
    lines = summary_markdown(hostile(text)).splitlines()
    bars = [line.replace("\\\\", "").replace("\\|", "").count("|") for line in lines if line.startswith("| ")]
    assert bars == [5] * 4 + [8] * 3
    whole = "\n".join(lines)
    assert "<script" not in whole and "<img" not in whole
    assert "](javascript" not in whole.replace("\\]", "") and "**d**" not in whole
    assert all(line.isprintable() for line in lines)


def test_a_summary_names_the_worst() -> None:
    many = [film(f"f{number}", *(failing(f"x{each}", each) for each in range(5))) for number in range(4)]
    lines = summary_markdown(Comparison(tuple(many))).splitlines()
    assert lines[0] == "### 4 films: 4 fail"
    assert lines[4] == "| f0 | 5 of 5 frames fail: 5 different | same bytes | 0.0 dB |"
    assert [line for line in lines if line.startswith("**")] == ["**f0**", "**f1**", "**f2**"]
    assert lines.count("and 2 more frames that fail") == 3
    assert [line for line in lines if line.startswith("| x")][:3] == [
        f"| x{number} | different | 30.0 dB | {number}.0 dB |  | 9 of 255 |  |" for number in range(3)
    ]
    assert len([line for line in lines if line.startswith("| x")]) == 9


def test_a_summary_has_the_figures_of_a_frame() -> None:
    frame = replace(failing(nearer=Nearness(40.0, 50.0, differs=True)), flip=0.01234)
    lost = ComparedFrame("frame-0002.png", "missing", "this frame was not drawn", 2)
    lines = summary_markdown(Comparison((film("a", frame, lost, changes=(CHANGE,)),))).splitlines()
    assert "- error.tolerance was 0.1, is 0.2" in lines
    assert "| frame-0002.png | this frame was not drawn |  |  |  |  |  |" in lines
    (row,) = [line for line in lines if line.startswith("| frame-0001")]
    assert row == (
        "| frame-0001.png | different | 30.0 dB | 20.0 dB | 0.0123 | 9 of 255 | nearer to the exact picture: the "
        "golden has 40.0 dB of the exact picture, the new one 50.0 dB |"
    )


def test_github_takes_the_largest_summary() -> None:
    """It drops summaries of more than 1 MiB."""
    text = "<" * 100_000
    changes = tuple(Change(text, text, text, line) for line in range(100))
    films = [film(f"{number}{text}", failing(text), changes=changes) for number in range(1000)]
    summary = summary_markdown(Comparison(tuple(films)))
    assert len(summary.encode()) < 2**20
    assert "and 800 more films" in summary


def test_a_fingerprint_is_that_of_the_keys_and_not_of_the_figures() -> None:
    """So that GitLab knows an issue again after the next commit."""

    def fingerprints(part_psnr: float, key: str) -> list[str]:
        found = film("b", failing(part_psnr=part_psnr), PASSING, changes=(Change(key, "0", str(part_psnr), 5),))
        return [each["fingerprint"] for each in json.loads(code_quality(Comparison((found,))))]

    assert fingerprints(20, "a") == fingerprints(30, "a") != fingerprints(20, "b")


# The elements and attributes of junit-10.xsd that Jenkins reads, and those of them that it needs.
JENKINS = {
    "testsuites": ({"name", "time", "tests", "failures", "errors"}, set()),
    "testsuite": (
        {"name", "tests", "failures", "errors", "group", "time", "skipped", "timestamp", "hostname", "id", "package"},
        {"name", "tests", "failures", "errors"},
    ),
    "testcase": ({"name", "time", "classname", "group"}, {"name"}),
    "failure": ({"type", "message"}, set()),
    "error": ({"type", "message"}, set()),
}


def test_junit_has_the_attributes_that_jenkins_knows() -> None:
    root = ElementTree.fromstring(junit(MIXED))
    for element in root.iter():
        known, needed = JENKINS[element.tag]
        assert needed <= element.attrib.keys() <= known, element.tag
    assert root.attrib == {"name": "hsplat compare", "tests": "4", "failures": "1", "errors": "1"}


@pytest.mark.parametrize("text", HOSTILE)
def test_issues_of_code_quality_have_places_and_fingerprints(text: str) -> None:
    issues = json.loads(code_quality(hostile(text)))
    assert [(each["location"]["path"], each["location"]["lines"]["begin"]) for each in issues] == [
        ("z.yaml", 1),
        (f"{text}.yaml", 3),
    ]
    assert len({each["fingerprint"] for each in issues}) == 2


def test_the_terminal_names_the_changed_line_and_the_nearer_picture() -> None:
    near = film("b", failing(nearer=Nearness(40.0, 30.0, differs=True)), changes=(CHANGE,))
    text = comparison_text(Comparison((near,)))
    assert text.splitlines()[1:] == [
        "frame-0001.png  different  why frame-0001.png",
        "frame-0001.png: further from the exact picture: the golden has 40.0 dB of the exact picture, "
        "the new one 30.0 dB",
        "b.yaml:5: error.tolerance was 0.1, is 0.2",
        "1 of 1 frame fails: 1 different",
    ]
    lines = comparison_text(Comparison((near, film("a", failing())))).splitlines()
    assert [lines.index(f"{name}: 1 of 1 frame fails: 1 different") for name in "ab"] == [0, 3], "names come first"
    some = film("b", *(failing(f"x{number}") for number in range(12)))
    assert "... and 2 more frames that fail" in comparison_text(Comparison((some,)))
