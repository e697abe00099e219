"""What a user reads about parts that do not make a film, and that nothing is written then."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hsplat_cli import main
from renderer.film import bytes_digest, encode_png

DRAW = "hsplat render parts/frames.0-2.json --frames"
TO = "--output 'parts/{frame:04}.png'"


@pytest.fixture(autouse=True)
def parts(scene_folder: Path) -> None:
    """Three parts of a small film of nine frames in parts/ of the current folder."""
    for frames in ("0:3", "3:6", "6:9"):
        draw("--frames", frames, "--output", "parts/{frame:04}.png")


def draw(*arguments: str) -> None:
    small = ["camera.path.frames=9", "output.size=[32, 32]", "volume.procedural.shape=[8, 8, 8]"]
    options = [word for change in small for word in ("--set", change)]
    assert main.run(["render", "scene.yaml", "--quiet", *options, *arguments]) == 0


def change(name: str, edit: Callable[[dict[str, Any]], object]) -> None:
    path = Path(name)
    data = json.loads(path.read_text(encoding="utf-8"))
    edit(data)
    path.write_text(json.dumps(data), encoding="utf-8")


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """What is said, by a command that changes no file."""
    before = {path: path.read_bytes() for path in Path.cwd().rglob("*") if path.is_file()}
    capsys.readouterr()
    assert main.run(["assemble", *arguments]) == 2
    assert {path: path.read_bytes() for path in Path.cwd().rglob("*") if path.is_file()} == before
    said = capsys.readouterr()
    assert said.out == ""
    return said.err


def test_missing_frames(capsys: pytest.CaptureFixture[str]) -> None:
    Path("parts/frames.3-5.json").unlink()
    assert refused(capsys, "parts", "--output", "film.mp4") == (
        f"3 frames are in no part\n  got: no part with 3:6\n  hint: draw them by:\n    {DRAW} 3:6 {TO}\n"
    )
    assert refused(capsys, "parts", "--output", "film.mp4", "--frames", "5") == (
        f"1 frame is in no part\n  got: no part with 5:6\n  hint: draw them by:\n    {DRAW} 5:6 {TO}\n"
    )


def test_many_gaps(capsys: pytest.CaptureFixture[str]) -> None:
    change("parts/frames.0-2.json", lambda data: data["frames"].pop(1))
    assert refused(capsys, "parts/frames.0-2.json", "--output", "{frame}.png") == (
        "7 frames are in no part\n"
        "  got: no part with 1:2, 3:9\n"
        f"  hint: draw them by:\n    {DRAW} 1:2 {TO}\n    {DRAW} 3:9 {TO}\n"
    )


def test_parts_of_other_films(capsys: pytest.CaptureFixture[str]) -> None:
    def make_other(data: dict[str, Any]) -> None:
        data["scene"]["transfer_function"]["points"][1]["opacity"] = 0.5
        data["scene"]["error"]["tolerance"] = 0.2
        data["schedule"]["asked"] = {"tolerance": 0.2}

    change("parts/frames.3-5.json", make_other)
    change("parts/frames.6-8.json", lambda data: data["volume"].update(fingerprint="0" * 32))
    fingerprint = json.loads(Path("parts/frames.0-2.json").read_text(encoding="utf-8"))["volume"]["fingerprint"]
    assert (
        refused(capsys, "parts", "--output", "film.mp4")
        == f"""\
parts/frames.3-5.json: a part of another film
  got: scene.transfer_function.points.1.opacity 0.5, scene.error.tolerance 0.2, schedule.asked.tolerance 0.2
  expected: scene.transfer_function.points.1.opacity 0.01, scene.error.tolerance 0.1, \
schedule.asked.tolerance 0.1, as in parts/frames.0-2.json
parts/frames.6-8.json: a part of another film
  got: volume.fingerprint '{"0" * 32}'
  expected: volume.fingerprint '{fingerprint}', as in parts/frames.0-2.json
"""
    )


def test_pictures_that_are_not_what_they_were(capsys: pytest.CaptureFixture[str]) -> None:
    """All of them at once."""
    Path("parts/0000.png").unlink()
    Path("parts/0001.png").write_bytes(Path("parts/0001.png").read_bytes()[:-20])
    Path("parts/0003.png").write_bytes(encode_png(np.zeros((16, 24, 3), np.uint8)))
    Path("parts/0004.png").write_bytes(encode_png(np.zeros((32, 32, 4), np.uint8)))
    Path("parts/0005.png").write_bytes(encode_png(np.zeros((32, 32, 3), np.uint8)))
    shutil.copy("parts/0008.png", "parts/0006.png")
    Path("parts/0007.png").write_bytes(b"GIF89a")
    damaged = bytearray(Path("parts/0002.png").read_bytes())
    damaged[50] ^= 255
    Path("parts/0002.png").write_bytes(damaged)
    again = "draws it again"
    assert (
        refused(capsys, "parts", "--output", "film.mp4")
        == f"""\
parts/0001.png: not the picture of frame 1
  got: a file that is cut off
  hint: remove it, and hsplat render parts/frames.0-2.json {again}
parts/0002.png: not the picture of frame 2
  got: a file that is damaged
  hint: remove it, and hsplat render parts/frames.0-2.json {again}
parts/0003.png: not the picture of frame 3
  got: 24 x 16 pixels without alpha, not 32 x 32 pixels without alpha
  hint: remove it, and hsplat render parts/frames.3-5.json {again}
parts/0004.png: not the picture of frame 4
  got: 32 x 32 pixels with alpha, not 32 x 32 pixels without alpha
  hint: remove it, and hsplat render parts/frames.3-5.json {again}
parts/0005.png: not the picture of frame 5
  got: a picture that was changed since
  hint: remove it, and hsplat render parts/frames.3-5.json {again}
parts/0006.png: not the picture of frame 6
  got: that of frame 8
  hint: remove it, and hsplat render parts/frames.6-8.json {again}
parts/0007.png: not the picture of frame 7
  got: a file that is not a PNG file
  hint: remove it, and hsplat render parts/frames.6-8.json {again}
parts/frames.0-2.json: 1 of its pictures is missing
  got: no parts/0000.png
  hint: hsplat render parts/frames.0-2.json draws them again
"""
    )
    for name in ("0-2", "3-5", "6-8"):
        assert main.run(["render", f"parts/frames.{name}.json", "--quiet"]) == 0
    assert main.run(["assemble", "parts", "--output", "film.mp4", "--quiet"]) == 0


def test_frames_without_a_digest(capsys: pytest.CaptureFixture[str]) -> None:
    """They may be any film's."""
    change("parts/frames.0-2.json", lambda data: data["frames"][1].pop("digest"))
    change("parts/frames.3-5.json", lambda data: [frame.pop("digest") for frame in data["frames"]])
    assert (
        refused(capsys, "parts", "--output", "film.mp4")
        == """\
parts/frames.0-2.json: frames.1: an incomplete record of a frame
  expected: digest, tolerance, cells, splats and seconds, as this version writes them
  hint: hsplat render parts/frames.0-2.json --force draws them again
parts/frames.3-5.json: frames.0: an incomplete record of a frame
  expected: digest, tolerance, cells, splats and seconds, as this version writes them
  hint: hsplat render parts/frames.3-5.json --force draws them again
"""
    )
    for name in ("0-2", "3-5"):
        assert main.run(["render", f"parts/frames.{name}.json", "--force", "--quiet"]) == 0
    assert main.run(["assemble", "parts", "--output", "film.mp4", "--quiet"]) == 0


def test_a_frame_that_two_parts_have(capsys: pytest.CaptureFixture[str]) -> None:
    draw("--frames", "2:4", "--output", "more/{frame}.png")
    content = encode_png(np.zeros((32, 32, 3), np.uint8))
    Path("more/3.png").write_bytes(content)
    change("more/frames.2-3.json", lambda data: data["frames"][1].update(digest=bytes_digest(content)))
    assert (
        refused(capsys, "parts", "more", "--output", "film.mp4")
        == """\
parts/frames.3-5.json: frame 3 differs between two parts
  got: more/3.png and parts/0003.png
  hint: leave one of the parts out
"""
    )


def test_no_parts(capsys: pytest.CaptureFixture[str]) -> None:
    """All arguments are told at once."""
    draw("--output", "film.mp4", "--frames", "0:2")
    Path("empty").mkdir()
    Path("cut.json").write_text('{\n  "scene": {', encoding="utf-8")
    Path("other.json").write_text("{}", encoding="utf-8")
    change("parts/frames.0-2.json", lambda data: data["frames"][1].pop("cells"))
    change("parts/frames.3-5.json", lambda data: data["scene"]["camera"]["path"].update(frames=4))
    change("parts/frames.6-8.json", lambda data: data["volume"].pop("fingerprint"))
    expected = "a folder of numbered frames, or the .json files beside them"
    names = ["absent", "*.jpg", "empty", "cut.json", "other.json", "film.mp4.json", "parts"]
    assert (
        refused(capsys, *names, "--output", "all.mp4")
        == f"""\
absent: no such file
*.jpg: no file matches this pattern
  hint: it is relative to {Path.cwd()}
empty: no numbered frames with their sidecar in this folder
  hint: `hsplat render SCENE --frames 0:30 --output 'parts/{{frame:04}}.png'` draws a part
cut.json:2:13: not valid JSON
    | "scene": {{
    |           ^
  hint: a sidecar is written as a whole: this one was cut off, or changed since
other.json: not the sidecar of numbered frames
  expected: {expected}
film.mp4.json: the sidecar of a film in one file
  expected: {expected}
parts/frames.0-2.json: frames.1: an incomplete record of a frame
  expected: digest, tolerance, cells, splats and seconds, as this version writes them
  hint: hsplat render parts/frames.0-2.json --force draws them again
parts/frames.3-5.json: scene.camera.path.frames: not the length of this path
  got: 4
  expected: a whole number greater than 5, the last frame
parts/frames.6-8.json: volume.fingerprint: missing
  expected: 32 hexadecimal digits
"""
    )


AMOUNT = "a number from 0 to 1e+100"
ODD_THINGS = f"""\
parts/frames.0-2.json: scene.error: missing
  expected: a mapping
parts/frames.0-2.json: pyramid: not a mapping
  got: 5
  expected: a mapping
parts/frames.0-2.json: versions.numba: not text
  got: []
  expected: text
parts/frames.0-2.json: schedule.met: not true or false
  got: 'yes'
  expected: true or false
parts/frames.0-2.json: schedule.measured.metric: missing
  expected: text
parts/frames.0-2.json: schedule.measured.worst: not a number
  got: 'x'
  expected: {AMOUNT}
parts/frames.0-2.json: schedule.measured.probes: not a list
  got: 3
  expected: a list
parts/frames.0-2.json: schedule.shortfall: not text
  got: 7
  expected: text
parts/frames.0-2.json: notes.1: not text
  got: {{}}
  expected: text
parts/frames.0-2.json: seconds.total: not a number
  got: 'x'
  expected: {AMOUNT}
parts/frames.0-2.json: seconds.read: out of range
  got: -1
  expected: {AMOUNT}
parts/frames.3-5.json: scene.error: not a mapping
  got: 5
  expected: a mapping
parts/frames.3-5.json: pyramid.finest_level_drawn: not a number
  got: nothing
  expected: {AMOUNT}
parts/frames.3-5.json: schedule.measured.metric: not text
  got: 5
  expected: text
parts/frames.3-5.json: schedule.measured.probes.1: not a number
  got: '2'
  expected: {AMOUNT}
parts/frames.3-5.json: schedule.measured.probes.2: not a number
  got: []
  expected: {AMOUNT}
parts/frames.3-5.json: schedule.measured.probes.3: out of range
  got: a huge number
  expected: {AMOUNT}
parts/frames.3-5.json: notes: not a list
  got: 'plain'
  expected: a list
parts/frames.3-5.json: seconds: not a mapping
  got: []
  expected: a mapping
"""


def test_sidecars_that_tell_odd_things(capsys: pytest.CaptureFixture[str]) -> None:
    """All of them at once: any of them may have been changed by hand."""

    def spoil(data: dict[str, Any]) -> None:
        data |= {"pyramid": 5, "seconds": {"total": "x", "read": -1}, "notes": ["plain", {}]}
        data["versions"]["numba"] = []
        data["schedule"] |= {"met": "yes", "measured": {"worst": "x", "probes": 3}, "shortfall": 7}
        del data["scene"]["error"]

    def spoil_more(data: dict[str, Any]) -> None:
        data |= {"seconds": [], "notes": "plain"}
        data["pyramid"]["finest_level_drawn"] = None
        data["schedule"]["measured"] = {"metric": 5, "worst": None, "probes": [1, "2", [], 10**200]}
        data["scene"]["error"] = 5

    change("parts/frames.0-2.json", spoil)
    change("parts/frames.3-5.json", spoil_more)
    assert refused(capsys, "parts", "--output", "film.mp4") == ODD_THINGS


def test_names_of_pictures_that_no_scene_may_have(capsys: pytest.CaptureFixture[str]) -> None:
    names = ["{frame:zz}.png", "{frame:400000}.png", "{frame}-{frame}.png"]
    for part, name in zip(("0-2", "3-5", "6-8"), names, strict=True):
        change(f"parts/frames.{part}.json", lambda data, name=name: data["scene"]["output"].update(file=name))
    expected = "one {frame} or {frame:04}, in the name of the file, and no other braces"
    assert refused(capsys, "parts", "--output", "film.mp4") == "".join(
        f"parts/frames.{part}.json: scene.output.file: not a valid template\n  got: '{name}'\n  expected: {expected}\n"
        for part, name in zip(("0-2", "3-5", "6-8"), names, strict=True)
    )


def test_a_sidecar_without_its_frames_and_one_too_deep(capsys: pytest.CaptureFixture[str]) -> None:
    def nest(data: dict[str, Any]) -> None:
        for _ in range(30):
            data["camera"] = {"inside": data["camera"]}

    change("parts/frames.0-2.json", lambda data: data.pop("frames"))
    change("parts/frames.3-5.json", nest)
    assert (
        refused(capsys, "parts", "--output", "film.mp4")
        == """\
parts/frames.0-2.json: frames: missing
  expected: the records of the frames, each with its number as frame
parts/frames.3-5.json: too many levels
  expected: at most 20
"""
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ["--output", "film.webm"],
            """\
--output film.webm: output.file: unknown output format
  got: 'film.webm'
  expected: a .mp4 or .gif, frames such as frames/{frame:04}.png or, for one frame (--frames 7), still.png
""",
        ),
        (
            ["--output", "still.png"],
            """\
--output still.png: output.file: frames need a number in their names
  got: 'still.png'
  hint: write still-{frame:04}.png
""",
        ),
        (
            ["--output", "film.gif", "--frames-per-second", "60", "--quality", "11"],
            """\
--frames-per-second 60: output.frames_per_second: too fast for a GIF
  got: 60
  expected: at most 50: viewers slow down faster ones
--quality 11: output.quality: out of range
  got: 11
  expected: a number from 0 to 10
""",
        ),
        (
            ["--output", "film.mp4", "--frames", "9:12"],
            """\
--frames: no frame is in this range
  got: '9:12'
  expected: A:B or A:B:STEP or one number; this path has the frames 0 to 8
""",
        ),
    ],
)
def test_options(options: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = refused(capsys, "parts", *options)
    assert sorted(text.splitlines()) == sorted(message.splitlines())


def test_transparent_frames_in_a_film(capsys: pytest.CaptureFixture[str]) -> None:
    draw("--set", "output.background=transparent", "--output", "clear/{frame}.png")
    assert (
        refused(capsys, "clear", "--output", "film.mp4")
        == """\
--output film.mp4: output.background: a transparent background in .mp4
  expected: a color
  hint: only PNG frames can be transparent: file: frames/{frame:04}.png
"""
    )
