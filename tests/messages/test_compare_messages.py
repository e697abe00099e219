"""What a user reads where frames cannot be compared; the exit code is 2 then, and nothing is written."""

from __future__ import annotations

import importlib.util
import os
import stat
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from png_files import noise, png_file, smooth, write_film, write_frames

from hsplat_cli import main

KINDS = "two folders or templates of PNG files, two PNG pictures, or two films in one format, MP4 or GIF"
Refused = Callable[..., str]

PNG = "a PNG file, 8-bit RGB or RGBA"
FIRST = "actual/frame-0000.png"


@pytest.fixture(autouse=True)
def frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three frames in golden/ and in actual/ of the current folder."""
    monkeypatch.chdir(tmp_path)
    for side in ("golden", "actual"):
        write_frames(Path(side), [noise(number) for number in range(3)])


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Refused:
    """What a command says that changes no file."""

    def message(*arguments: str) -> str:
        before = {path: path.read_bytes() for path in Path.cwd().rglob("*") if path.is_file()}
        capsys.readouterr()
        assert main.run(["compare", *(arguments or ("golden", "actual")), "--quiet"]) == 2
        assert {path: path.read_bytes() for path in Path.cwd().rglob("*") if path.is_file()} == before
        said = capsys.readouterr()
        assert said.out == ""
        return said.err

    return message


def empty(folder: str) -> None:
    for path in Path(folder).iterdir():
        path.unlink()


# What there is to compare


def test_kinds(refused: Refused) -> None:
    Path("film.mp4").touch()
    assert refused("golden", "film.mp4") == (
        "GOLDEN and ACTUAL are of different kinds\n"
        "  got: golden, a folder; film.mp4, a film in .mp4\n"
        f"  expected: {KINDS}\n"
    )
    assert refused("golden/frame-{frame:04}.png", FIRST) == (
        "GOLDEN and ACTUAL are of different kinds\n"
        f"  got: golden/frame-{{frame:04}}.png, a template of frames; {FIRST}, a PNG picture\n"
        f"  expected: {KINDS}\n"
    )
    Path("notes.txt").touch()
    assert refused("golden", "notes.txt") == (
        f"notes.txt: cannot be compared\n  got: a file in .txt\n  expected: {KINDS}\n"
    )


def test_names(refused: Refused) -> None:
    assert refused("golden", "actul") == "actul: no such file or folder\n  hint: did you mean actual?\n"
    assert refused("golden/frame-0000.png", "actual/fame-0000.png") == (
        "actual/fame-0000.png: no such file or folder\n  hint: did you mean actual/frame-0000.png?\n"
    )


def test_a_name_that_is_not_there(refused: Refused) -> None:
    """As of a variable of the shell that is not set, and not the current folder."""
    assert refused("", "actual") == "GOLDEN: an empty name\n  expected: a file or folder\n"
    assert refused("golden", "") == "ACTUAL: an empty name\n  expected: a file or folder\n"


def test_a_link_that_leads_nowhere(refused: Refused) -> None:
    Path("link").symlink_to("gone")
    assert refused("golden", "link") == "link: a broken link\n  got: gone\n"


def test_names_that_look_alike(refused: Refused) -> None:
    for side, name in (("golden", "\u00e9.png"), ("actual", "e\u0301.png")):
        empty(side)
        Path(side, name).touch()
    assert refused() == (
        "actual: no frame of ACTUAL has the name of a golden\n"
        "  got: 'e\u0301.png'\n"
        "  expected: '\u00e9.png', as in golden\n"
        "  hint: they look alike, but their accents are different code points\n"
    )


def test_the_same_files(refused: Refused, capsys: pytest.CaptureFixture[str]) -> None:
    hint = "  hint: files are not compared with themselves, or with links to themselves\n"
    assert refused("golden", "golden/") == f"golden: GOLDEN and ACTUAL are the same files\n{hint}"
    Path("folder").symlink_to("golden")
    assert refused("golden", "folder") == f"folder: GOLDEN and ACTUAL are the same files\n{hint}"
    Path("film.mp4").touch()
    Path("link.mp4").symlink_to("film.mp4")
    assert refused("film.mp4", "link.mp4") == f"link.mp4: GOLDEN and ACTUAL are the same files\n{hint}"
    empty("actual")
    for number in range(3):
        Path(f"actual/frame-{number:04}.png").symlink_to(f"../golden/frame-{number:04}.png")
    assert refused() == f"actual: GOLDEN and ACTUAL are the same files\n{hint}"
    Path(FIRST).unlink()
    write_frames(Path("actual"), [noise(0)])
    assert main.run(["compare", "golden", "actual"]) == 0
    assert capsys.readouterr().out == (
        "3 frames pass at same-machine: 3 the same\n"
        "note: 2 frames of ACTUAL are links to the golden: 'frame-0001.png', 'frame-0002.png'\n"
    )


def test_templates(refused: Refused) -> None:
    assert refused("golden/frame-{frame:4x}.png", "actual") == (
        "golden/frame-{frame:4x}.png: not a valid template\n"
        "  expected: one {frame} or {frame:04}, in the name of the files, and no other braces\n"
    )
    assert refused("golden/frame-{frame:03}.png", "actual") == (
        "golden/frame-{frame:03}.png: no file matches this template\n  hint: did you mean golden/frame-0002.png?\n"
    )


def test_empty_folders(refused: Refused) -> None:
    Path("actual/below").mkdir()
    for path in Path("actual").glob("*.png"):
        path.rename(path.parent / "below" / path.name)
    assert refused() == ("actual: no PNG files in this folder\n  got: 1 other file\n  hint: actual/below has some\n")
    empty("golden")
    assert refused() == "golden: no PNG files in this folder\n  got: an empty folder\n"


def test_nothing_in_common(refused: Refused) -> None:
    for path in Path("actual").iterdir():
        path.rename(path.with_name(path.name.replace("frame-", "f'")))
    Path("golden/frame-0003.png").write_bytes(b"")
    assert refused() == (
        "actual: no frame of ACTUAL has the name of a golden\n"
        '  got: "f\'0000.png", "f\'0001.png", "f\'0002.png"\n'
        "  expected: 'frame-0000.png', 'frame-0001.png', 'frame-0002.png' and 1 more, as in golden\n"
    )


# Pictures


def test_other_formats(refused: Refused) -> None:
    Path(FIRST).write_bytes(b"\xff\xd8\xff\xe0")
    assert refused() == f"{FIRST}: not a PNG file\n  got: a JPEG file\n  expected: {PNG}\n"
    Path(FIRST).write_bytes(b"version https://git-lfs.github.com/spec/v1\n")
    assert refused() == (
        f"{FIRST}: not a PNG file\n  got: a Git LFS pointer\n  expected: {PNG}\n  hint: git lfs pull\n"
    )
    Path(FIRST).write_bytes(b"")
    assert refused() == f"{FIRST}: an empty file\n  expected: {PNG}\n"
    Path(FIRST).unlink()
    Path(FIRST).mkdir()
    assert refused() == f"{FIRST}: not a file\n  got: a folder\n  expected: {PNG}\n"
    Path(FIRST).rmdir()
    Path(FIRST).symlink_to("gone.png")
    assert refused() == f"{FIRST}: a broken link\n  got: gone.png\n"


def test_damaged_pictures(refused: Refused) -> None:
    content = Path(FIRST).read_bytes()
    Path(FIRST).write_bytes(content[:-30])
    assert refused() == f"{FIRST}: the PNG file is cut off\n  got: {len(content) - 30} bytes\n  expected: {PNG}\n"
    Path(FIRST).write_bytes(content[:100] + bytes(1) + content[101:])
    assert refused() == f"{FIRST}: the PNG file is damaged\n  got: {len(content)} bytes\n  expected: {PNG}\n"
    Path(FIRST).write_bytes(png_file(16, 16, bytes(100)))
    assert refused() == f"{FIRST}: the PNG file is damaged\n  got: data that cannot be decoded\n  expected: {PNG}\n"
    Path(FIRST).write_bytes(png_file(100_000, 100_000, bytes(100)))
    assert refused() == (
        f"{FIRST}: too large a picture\n"
        "  got: 100000 x 100000 pixels\n"
        "  expected: at most 33554432 pixels, as 8192 x 4096\n"
    )


def test_many_damaged_pictures(refused: Refused) -> None:
    for number in (0, 2):
        Path(f"actual/frame-{number:04}.png").write_bytes(b"")
    assert refused() == "".join(
        f"actual/frame-{number:04}.png: an empty file\n  expected: {PNG}\n" for number in (0, 2)
    )
    write_frames(Path("golden"), [noise(0)] * 12)
    for number in range(12):
        Path(f"actual/frame-{number:04}.png").write_bytes(b"")
    lines = refused().splitlines()
    assert (len(lines), lines[-1]) == (21, "... and 2 more frames that cannot be read")


@pytest.mark.parametrize(
    ("content", "got"),
    [
        (png_file(4, 4, bytes(100), depth=16), "16-bit RGB"),
        (png_file(4, 4, bytes(100), color_type=3, more=[(b"PLTE", bytes(9))]), "8-bit palette"),
        (png_file(4, 4, bytes(100), color_type=0), "8-bit grey"),
        (png_file(4, 4, bytes(100), more=[(b"tRNS", bytes(6))]), "8-bit RGB with a transparent colour (tRNS)"),
        (png_file(4, 4, bytes(100), more=[(b"acTL", struct.pack(">II", 2, 0))]), "8-bit RGB with an animation (APNG)"),
    ],
    ids=["16 bits", "palette", "grey", "tRNS", "APNG"],
)
def test_other_kinds_of_pictures(refused: Refused, content: bytes, got: str) -> None:
    Path(FIRST).write_bytes(content)
    assert refused() == (
        f"{FIRST}: not a picture in 8-bit RGB or RGBA\n"
        f"  got: {got}\n"
        "  expected: 8-bit RGB or RGBA\n"
        "  hint: stored values are compared without conversion: save it as 8-bit RGB or RGBA\n"
    )


# Films


def test_films(refused: Refused) -> None:
    pictures = [smooth(number) for number in range(6)]
    write_film(Path("golden.mp4"), pictures)
    write_film(Path("short.mp4"), pictures[:4])
    write_film(Path("one.mp4"), pictures[:1])
    assert refused("short.mp4", "one.mp4") == (
        "one.mp4: films with different numbers of frames\n  got: 1 frame\n  expected: 4 frames, as in short.mp4\n"
    )
    assert refused("golden.mp4", "short.mp4") == (
        "short.mp4: films with different numbers of frames\n  got: 4 frames\n  expected: 6 frames, as in golden.mp4\n"
    )
    content = Path("golden.mp4").read_bytes()
    Path("short.mp4").write_bytes(content[:-50])
    assert refused("golden.mp4", "short.mp4") == (
        f"short.mp4: an MP4 file that is cut off, or followed by other data\n  got: {len(content) - 50} bytes\n"
    )
    Path("short.mp4").write_bytes(Path("golden/frame-0000.png").read_bytes())
    assert refused("golden.mp4", "short.mp4") == "short.mp4: not an MP4 file\n"
    Path("short.mp4").write_bytes(b"")
    assert refused("golden.mp4", "short.mp4") == "short.mp4: an empty file\n  expected: an MP4 file\n"
    Path("short.mp4").write_bytes(content[:-400] + bytes(400))
    assert refused("golden.mp4", "short.mp4").startswith("short.mp4: the film cannot be decoded\n  got: ")


# Limits


def test_the_file_of_limits(refused: Refused) -> None:
    Path("golden/compare.yaml").write_text(
        "level: same_machine\n"
        "limit: {largest: 3}\n"
        "limits: {largets: 5, flip: 2, ssim: almost, p99: none}\n"
        "frames:\n"
        "  frame-0001.png: {largest: -1}\n"
        "  frame-0002.png: 5\n"
        "  7: {largest: 1}\n",
        encoding="utf-8",
    )
    assert (
        refused()
        == """\
golden/compare.yaml:1:8: level: unknown value
    | level: same_machine
    |        ^
  got: 'same_machine'
  expected: exact, same-machine or cross-driver
  hint: did you mean same-machine?
golden/compare.yaml:2:1: limit: unknown key
    | limit: {largest: 3}
    | ^
  expected: level, limits or frames
  hint: did you mean limits?
golden/compare.yaml:3:10: limits.largets: unknown key
    | limits: {largets: 5, flip: 2, ssim: almost, p99: none}
    |          ^
  expected: largest, p99, flip, ssim, densest or bias
  hint: did you mean largest?
golden/compare.yaml:3:28: limits.flip: out of range
    | limits: {largets: 5, flip: 2, ssim: almost, p99: none}
    |                            ^
  got: 2
  expected: a number from 0 to 1, or none
golden/compare.yaml:3:37: limits.ssim: not a number
    | limits: {largets: 5, flip: 2, ssim: almost, p99: none}
    |                                     ^
  got: 'almost'
  expected: a number from 0 to 1, or none
golden/compare.yaml:5:29: frames.frame-0001.png.largest: out of range
    | frame-0001.png: {largest: -1}
    |                           ^
  got: -1
  expected: a number from 0 to 255 levels, or none
golden/compare.yaml:6:19: frames.frame-0002.png: not a mapping
    | frame-0002.png: 5
    |                 ^
  got: 5
  expected: a mapping with largest, p99, flip, ssim, densest or bias
golden/compare.yaml:7:3: frames.7: not a frame's name
    | 7: {largest: 1}
    | ^
  got: 7
  expected: text
  hint: put it in quotes
"""
    )


def test_a_file_of_limits_that_is_no_yaml(refused: Refused) -> None:
    Path("golden/compare.yaml").write_text("limits: {largest: 3", encoding="utf-8")
    assert refused().startswith("golden/compare.yaml:1:20: not valid YAML: ")
    Path("golden/compare.yaml").unlink()
    Path("golden/compare.yml").touch()
    assert refused() == "golden/compare.yml: not read under this name\n  hint: call it compare.yaml\n"
    Path("golden/compare.yml").rename("golden/Compare.yaml")
    assert refused() == "golden/Compare.yaml: not read under this name\n  hint: call it compare.yaml\n"


def test_frames_that_are_not_there(refused: Refused) -> None:
    Path("golden/compare.yaml").write_text("frames:\n  frame-001.png: {largest: 3}\n", encoding="utf-8")
    assert refused() == (
        "golden/compare.yaml:2:3: no such frame\n  got: 'frame-001.png'\n  hint: did you mean frame-0001.png?\n"
    )


def test_limits_of_the_command_line(refused: Refused) -> None:
    assert refused(
        "golden", "actual", "--level", "cross", "--limit", "fip=0.1", "--limit", "largest", "--limit", "p99="
    ) == (
        "--level cross: unknown value\n"
        "  got: 'cross'\n"
        "  expected: exact, same-machine or cross-driver\n"
        "--limit fip=0.1: fip: unknown key\n"
        "  expected: largest, p99, flip, ssim, densest or bias\n"
        "  hint: did you mean flip?\n"
        "--limit largest: not a limit\n"
        "  expected: --limit FIGURE=VALUE, such as largest=4\n"
        "--limit p99=: p99: no value\n"
        "  expected: a number from 0 to 255 levels, or none\n"
        "  hint: none removes a limit\n"
    )
    assert refused("golden", "actual", "--level", "exact", "--limit", "largest=none") == (
        "no metric has a limit\n  hint: a comparison without limits would always pass\n"
    )


def test_a_figure_that_cannot_be_taken(refused: Refused) -> None:
    for side, seed in (("golden", 1), ("actual", 2)):
        write_frames(Path(side), [noise(seed, 8, 8)])
    assert refused("golden", "actual", "--limit", "ssim=0.9") == (
        "frame-0000.png: too small a picture for mean SSIM\n  hint: remove the limit for this frame: ssim: none\n"
    )


def test_a_package_that_is_missing(refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert refused() == "the package flip_evaluator is not installed\n  hint: pip install 'hsplat[compare]'\n"
    assert refused("golden", "actual", "--html", "page.html") == (
        "the package jinja2 is not installed\n  hint: pip install 'hsplat[compare]'\n"
    )


# Options


NOT_THIS = ": a report would overwrite an input of the comparison\n"


def test_reports(refused: Refused) -> None:
    Path("reports.json").mkdir()
    assert refused("golden", "actual", "--json", "reports.json") == (
        "--json reports.json: a report cannot replace this\n  got: a folder\n"
    )
    os.mkfifo("pipe.xml")
    Path("link.xml").symlink_to("pipe.xml")
    for name in ("pipe.xml", "link.xml"):
        assert refused("golden", "actual", "--junit", name) == (
            f"--junit {name}: a report cannot replace this\n  got: a special file\n"
        )
    assert stat.S_ISFIFO(os.stat("link.xml").st_mode)
    assert refused("golden", "actual", "--junit", f"{FIRST}/report.xml") == (
        f"{FIRST}/report.xml: the output folder is a file\n  got: {FIRST}\n"
    )


@pytest.mark.parametrize(
    ("option", "name", "got", "expected"),
    [
        ("--html", FIRST, "a .png file", "a .html file"),
        ("--json", "scan.npy", "a .npy file", "a .json file"),
        ("--json", "-", "no suffix", "a .json file"),
        ("--json", "report.xml", "a .xml file", "a .json file"),
        ("--junit", "golden", "no suffix", "a .xml file"),
    ],
)
def test_names_that_no_report_has(refused: Refused, option: str, name: str, got: str, expected: str) -> None:
    Path("scan.npy").write_bytes(b"a volume")
    assert refused("golden", "actual", option, name) == (
        f"{option} {name}: not a name for a report\n  got: {got}\n  expected: {expected}\n"
    )


def test_reports_over_what_is_compared(refused: Refused) -> None:
    Path("golden/golden.json").write_text("{}")
    Path("film.mp4.json").write_text("{}")
    Path("link").symlink_to("golden")
    Path("link.json").symlink_to("golden/golden.json")
    for name in ("golden/golden.json", "golden/../golden/golden.json", "link/golden.json", "link.json"):
        for sides in (("golden", "actual"), ("film.mp4.json", "golden")):
            assert refused(*sides, "--json", name) == f"--json {name}{NOT_THIS}"
    assert refused("film.mp4.json", "golden", "--json", "golden/../film.mp4.json") == (
        f"--json golden/../film.mp4.json{NOT_THIS}"
    )


def test_options_of_scenes(refused: Refused) -> None:
    assert refused("golden", "actual", "--frames", "0:3") == (
        "--frames: has no use unless a scene is drawn\n  got: golden and actual\n"
    )


def test_a_difference_is_no_error(capsys: pytest.CaptureFixture[str]) -> None:
    write_frames(Path("actual"), [np.zeros((16, 16, 3), np.uint8)])
    assert main.run(["compare", "golden", "actual", "--quiet", "--level", "exact"]) == 1
    said = capsys.readouterr()
    assert said.err == ""
    assert said.out.splitlines() == [
        "frame           status     reason",
        "frame-0000.png  different  largest error of a channel 255 levels, at most 0",
        "",
        "1 of 3 frames fails: 1 different, 2 the same",
    ]
