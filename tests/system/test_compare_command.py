"""`hsplat compare` reads files, and returns exit codes and reports."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import HSPLAT, environment
from png_files import smooth, write_film, write_frames
from processes import MARK, marked, new_mark

from hsplat_cli import main
from hsplat_cli.compare import open_reports, read_report
from renderer.errors import RenderError
from renderer.film import decode_png, encode_png


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


def films() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(Path("report/report.json").read_bytes())["films"]
    return found


def test_equal_frames_pass(capsys: pytest.CaptureFixture[str]) -> None:
    assert compare("golden", "actual", "--report", "report") == 0
    printed = capsys.readouterr()
    assert printed.out == "12 frames pass: 12 the same\nreport: report/index.html\n"
    assert printed.err.startswith("comparing: 12/12 frames, ")
    assert not Path("report/films").exists()
    assert compare("golden", "actual", "--quiet") == 0
    assert capsys.readouterr() == ("", "")


def test_frames_that_differ_are_in_the_report() -> None:
    paint("frame-3.png", 8)
    Path("actual/frame-5.png").rename("actual/frame-20240131.png")
    assert compare("golden", "actual", "--report", "report", "--quiet") == 1
    (film,) = films()
    found = {frame["name"]: frame["status"] for frame in film["frames"] if frame["status"] != "same"}
    assert found == {"frame-3.png": "different", "frame-5.png": "missing", "frame-20240131.png": "new"}
    assert [frame["frame"] for frame in film["frames"]] == [*range(12), 20240131]
    with open_reports(Path("report")) as (report,):
        assert read_report(report).films[0].summary.startswith("3 of 13 frames fail")
    for frame in film["frames"]:
        for side, folder in (("old", "golden"), ("new", "actual")):
            if side in frame:
                kept = Path("report", frame[side]["file"]).read_bytes()
                assert np.array_equal(decode_png(kept), decode_png(Path(folder, frame["name"]).read_bytes()))


def test_no_picture_is_encoded_without_a_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """It took most of the time."""
    monkeypatch.setattr("hsplat_cli.compare.report_folder.encode_png", None)
    assert compare("golden", "actual", "--quiet") == 0


def test_names_of_pictures_are_not_names_in_the_report() -> None:
    """They may differ in case alone, and hold what a page or an archive cannot name."""
    for folder, seed in (("golden", 1), ("actual", 2)):
        shutil.rmtree(folder)
        write_frames(Path(folder), [smooth(seed)], "a.png")
        write_frames(Path(folder), [smooth(seed + 3)], "a.PNG")
        write_frames(Path(folder), [smooth(seed + 6)], "#%20?<b>\n.png")
    assert compare("golden", "actual", "--report", "report", "--quiet") == 1
    (film,) = films()
    kept = [frame[side]["file"] for frame in film["frames"] for side in ("old", "new")]
    assert len({Path("report", file).read_bytes() for file in kept}) == 6
    assert all(re.fullmatch(r"films/0/(old|new)/[0-9]+\.png", file) for file in kept)


def test_a_limit_decides_the_exit_code() -> None:
    paint("frame-3.png", 1, first=1)
    assert compare("golden", "actual", "--quiet") == 1
    assert compare("golden", "actual", "--limit", "60", "--quiet") == 0
    assert compare("golden", "actual", "--limit", "stated accuracy", "--quiet") == 1, "pictures state none"


@pytest.mark.parametrize("error", [MemoryError(), KeyError("a bug"), RenderError("no GL")])
def test_an_error_leaves_no_report(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    """Nor that of an earlier comparison, which passed."""

    def fail(*_: object) -> None:
        raise error

    assert compare("golden", "actual", "--report", "report", "--quiet") == 0
    monkeypatch.setattr("hsplat_cli.compare.file_pairs.compare_frame", fail)
    assert compare("golden", "actual", "--report", "report", "--quiet") == 2
    assert sorted(path.name for path in Path().iterdir()) == ["actual", "golden"]


def test_an_interrupt_leaves_no_report_and_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    mark = new_mark()
    monkeypatch.setenv(MARK, mark)
    film = write_film(Path("film.mp4"), [smooth(0, 256), smooth(1, 256)])  # which a pipe does not hold
    shutil.copy(film, "copy.mp4")

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hsplat_cli.compare.file_pairs.compare_frame", interrupt)
    assert compare("film.mp4", "copy.mp4", "--report", "reports/report") == 130
    assert list(Path("reports").iterdir()) == []
    assert marked(mark) == set()


@pytest.mark.parametrize(
    ("script", "code", "unbuffered"),
    [
        ('"$@" >/dev/full', 2, ""),
        ('"$@" >/dev/full', 2, "1"),
        ('"$@" 2>/dev/full', 2, "1"),
        ('"$@" >/dev/full 2>&1', 2, ""),
        ('"$@" <&- >&- 2>&-', 1, ""),
        ('exec 3> >(true); wait $!; "$@" >&3', 2, ""),
    ],
    ids=["full", "full, unbuffered", "full for errors", "both full", "all closed", "no reader"],
)
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
