"""`hsplat compare` reads files, and returns exit codes and reports."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from commands import HSPLAT, environment
from png_files import smooth, write_film, write_frames
from processes import MARK, marked, new_mark
from small_scene import small_scene

from hsplat_cli import main
from renderer.errors import RenderError
from renderer.film import encode_png

REPORTS = ("reports/compare.json", "reports/compare.xml", "reports/compare.html")
WRITE_REPORTS = [word for pair in zip(("--json", "--junit", "--html"), REPORTS, strict=True) for word in pair]


@pytest.fixture(autouse=True)
def folders(folder: Path) -> None:
    """Write twelve frames to golden/ in the current folder, and the same to actual/."""
    write_frames(Path("golden"), [smooth(0.2 * number) for number in range(12)], "frame-{}.png")
    shutil.copytree("golden", "actual")


def compare(*arguments: str) -> int:
    return main.run(["compare", *(arguments or ("golden", "actual"))])


def paint(name: str, by: int, first: int = 32) -> None:
    """Change a frame of actual/ in one channel of the first pixels of its first rows."""
    picture = smooth(0.2 * int("".join(filter(str.isdigit, name))))
    picture[:first, :first, 1] ^= np.uint8(by)
    Path("actual", name).write_bytes(encode_png(picture))


def test_equal_frames_pass(capsys: pytest.CaptureFixture[str]) -> None:
    assert compare("golden", "actual", *WRITE_REPORTS) == 0
    printed = capsys.readouterr()
    assert printed.out == "12 frames pass at same-machine: 12 the same\n"
    assert printed.err.startswith("comparing: 12/12 frames, ")
    assert json.loads(Path(REPORTS[0]).read_text())["passes"] is True
    assert ElementTree.parse(REPORTS[1]).getroot().get("failures") == "0"
    assert Path(REPORTS[2]).read_text(encoding="utf-8").startswith("<!")
    assert compare("golden", "actual", "--quiet") == 0
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", "")


def test_levels_and_limits_decide_the_exit_code() -> None:
    paint("frame-3.png", 1, first=1)
    assert compare("golden", "actual", "--level", "exact", "--quiet") == 1
    assert compare("golden", "actual", "--level", "exact", "--limit", "largest=1", "--quiet") == 0


def test_the_report_says_how_exact_both_films_are() -> None:
    """By the sidecars beside them, which may be missing or damaged."""
    Path("scene.yaml").write_text(small_scene(), encoding="utf-8")
    for name, tolerance in (("fine", 0.01), ("coarse", 5)):
        change = f"error.tolerance={tolerance}"
        assert main.run(["render", "scene.yaml", "--quiet", "--output", f"{name}.mp4", "--set", change]) == 0
    assert compare("fine.mp4", "coarse.mp4", "--json", "report.json", "--quiet") == 1
    accuracy = json.loads(Path("report.json").read_text())["facts"]["accuracy"]
    values = [float(accuracy[side].split()[2]) for side in ("golden", "actual")]
    assert values[0] > values[1] + 5
    Path("fine.mp4.json").write_bytes(b"{")
    Path("coarse.mp4.json").unlink()
    assert compare("fine.mp4", "coarse.mp4", "--json", "report.json", "--quiet") == 1
    accuracy = json.loads(Path("report.json").read_text())["facts"]["accuracy"]
    assert accuracy == {"golden": "not known", "actual": "not known"}


def test_reports_say_why_nothing_was_compared(capsys: pytest.CaptureFixture[str]) -> None:
    """They replace the reports of an earlier comparison, which passed."""
    assert compare("golden", "actual", *WRITE_REPORTS, "--quiet") == 0
    paint("frame-3.png", 8)
    Path("actual/frame-11.png").write_bytes(Path("actual/frame-11.png").read_bytes()[:-9])
    assert compare("golden", "actual", *WRITE_REPORTS, "--quiet") == 2
    message = capsys.readouterr().err.removesuffix("\n")
    assert message.startswith("actual/frame-11.png: the PNG file is cut off\n")
    assert json.loads(Path(REPORTS[0]).read_text()) == {
        "passes": False,
        "golden": "golden",
        "actual": "actual",
        "error": message,
    }
    root = ElementTree.parse(REPORTS[1]).getroot()
    for element in (root, root[0]):
        assert [element.get(count) for count in ("tests", "failures", "errors")] == ["1", "0", "1"]
    (case,) = root[0]
    (error,) = case
    assert (case.get("name"), error.tag, error.get("message")) == (
        "could not be compared",
        "error",
        "actual/frame-11.png: the PNG file is cut off",
    )
    assert error.text == f"{message}\ngolden: golden\nactual: actual"
    assert not Path(REPORTS[2]).exists()


@pytest.mark.parametrize("error", [MemoryError(), KeyError("a bug"), RenderError("no GL")])
def test_reports_say_what_nobody_expected(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("hsplat_cli.compare.comparison.compare_pair", fail)
    assert compare("golden", "actual", *WRITE_REPORTS, "--quiet") == 2
    assert ElementTree.parse(REPORTS[1]).getroot().get("errors") == "1"
    assert json.loads(Path(REPORTS[0]).read_text())["passes"] is False


def test_reports_that_cannot_be_written_are_found_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsplat_cli.compare.comparison.compare_pair", None)
    Path("file").touch()
    for option, suffix in (("--json", "json"), ("--junit", "xml"), ("--html", "html")):
        assert compare("golden", "actual", option, f"file/report.{suffix}") == 2


def test_an_interrupt_leaves_no_report_and_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    mark = new_mark()
    monkeypatch.setenv(MARK, mark)
    film = write_film(Path("film.mp4"), [smooth(0, 256), smooth(1, 256)])  # which a pipe does not hold
    shutil.copy(film, "copy.mp4")

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hsplat_cli.compare.comparison.compare_pair", interrupt)
    assert compare("film.mp4", "copy.mp4", *WRITE_REPORTS) == 130
    assert list(Path("reports").iterdir()) == []
    assert marked(mark) == set()


@pytest.mark.parametrize(
    ("script", "code"),
    [
        ('"$@" >/dev/full', 2),
        ('"$@" 2>/dev/full', 2),
        ('"$@" >/dev/full 2>&1', 2),
        ('"$@" <&- >&- 2>&-', 1),
        ('exec 3> >(true); wait $!; "$@" >&3', 2),
    ],
    ids=["full", "full for errors", "both full", "all closed", "no reader"],
)
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_exit_code_1_only_means_that_frames_differ(script: str, code: int, unbuffered: str) -> None:
    """It holds where the output cannot be printed, too, and what is left in Python's buffers changes nothing."""
    paint("frame-3.png", 64)
    done = subprocess.run(
        ["bash", "-c", script, "bash", *HSPLAT, "compare", "golden", "actual"],
        check=False,
        capture_output=True,
        env=environment(PYTHONUNBUFFERED=unbuffered),
    )
    assert done.returncode == code
    assert not any(text in done.stderr for text in (b"a bug", b"Traceback", b"Exception ignored"))
