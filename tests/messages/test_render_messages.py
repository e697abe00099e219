"""Messages of `hsplat render` where it refuses a job or cannot finish it, and the files that it leaves."""

from __future__ import annotations

import errno
import json
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest
from message_scenes import shorter_scene
from resuming import on_each_frame
from transcripts import Case, cases

from hsplat_cli import main
from renderer.film import bytes_digest, join_png_chunks, png_chunks
from renderer.record import describe_differences

FULL = "the disk is full\n  hint: free some space, or write to another disk\n"


@pytest.fixture(autouse=True)
def folder(scene_folder: Path) -> Path:
    """Make a scene of six small frames, near enough to be seen, and volumes with faults, in the current folder."""
    Path("scene.yaml").write_text(shorter_scene(6).replace("distance: 300", "distance: 40"), encoding="utf-8")
    os.mkfifo("pipe.nrrd")
    np.save("short.npy", np.zeros((8, 9, 10), np.float32))
    Path("short.npy").write_bytes(Path("short.npy").read_bytes()[:-100])
    values = np.zeros((3, 4, 5), np.float32)
    values[1, 2, 3], values[2, 0, 0] = np.nan, np.inf
    np.save("nan.npy", values)
    Path("folder.mp4").mkdir()
    return scene_folder


@cases("render.txt")
def test_messages(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    """A job that is refused leaves no file."""
    before = sorted(Path().rglob("*"))
    case.check(capsys)
    assert sorted(path for path in Path().rglob("*") if path.name != "film.mp4.unfinished") == before


def test_a_range_of_many_digits(capsys: pytest.CaptureFixture[str]) -> None:
    assert render(capsys, "--frames", "9" * 5000) == (
        2,
        f"--frames: not a range of frames\n  got: '{'9' * 56}...\n"
        "  expected: A:B or A:B:STEP, without frame B (30:41 for frames 30 to 40), or one number; "
        "this path has the frames 0 to 5\n",
    )


def render(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    """Run `hsplat render`, and return the exit code and the error stream without the lines that show progress."""
    code = main.run(["render", "scene.yaml", *arguments])
    lines = capsys.readouterr().err.splitlines(keepends=True)
    return code, "".join(line for line in lines if "frames/s" not in line and "compiling" not in line)


def at_frame(monkeypatch: pytest.MonkeyPatch, number: int, happens: Callable[[], None]) -> None:
    """Call `happens` before each following job has drawn this frame."""
    on_each_frame(monkeypatch, lambda frame: happens() if frame.number == number else None)


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
@pytest.mark.parametrize("suffix", ["png", "json"])
def test_a_disk_that_is_full(output: str, suffix: str, monkeypatch, capsys) -> None:
    """At a frame, or at its record."""
    write = Path.write_bytes

    def full(path: Path, content: bytes) -> int:
        if path.name.startswith((f".000003.{suffix}.partial", f".3.{suffix}.partial")):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        return write(path, content)

    monkeypatch.setattr(Path, "write_bytes", full)
    folder = "frames.unfinished" if output == "{frame}.png" else f"{output}.unfinished"
    place = "3.png" if output == "{frame}.png" and suffix == "png" else f"{folder}/000003.{suffix}"
    kept = "3 of 6 frames are kept; the same command resumes there\n"
    assert render(capsys, "--output", output) == (1, f"{kept}{place}: {FULL}")
    assert not Path("film.mp4").exists()
    assert not [path for path in Path().rglob("*") if "partial" in path.name]


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_an_output_folder_that_vanishes(output: str, monkeypatch, capsys) -> None:
    folder = Path("out", "frames.unfinished" if output == "{frame}.png" else f"{output}.unfinished")

    def vanish() -> None:
        while not (folder / "000001.json").exists():  # frames are kept by a thread, two frames behind the drawing
            time.sleep(0.001)
        while Path("out").exists():  # an encoder that starts late makes its file in a folder that is being emptied
            shutil.rmtree("out", ignore_errors=True)

    at_frame(monkeypatch, 3, vanish)
    place = "out/2.png" if output == "{frame}.png" else folder / "000002.png"
    assert render(capsys, "--output", f"out/{output}") == (
        1,
        f"{place}: the output folder has vanished\n  hint: it existed when the work began\n",
    )
    assert not Path("out").exists()


def test_a_checkpoint_frame_that_cannot_be_decoded(monkeypatch, capsys) -> None:
    """Its record agrees with it. Once it is removed, it is drawn again."""

    def interrupt() -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        at_frame(patch, 4, interrupt)
        assert render(capsys, "--output", "film.mp4")[0] == 130
    picture, record = (Path(f"film.mp4.unfinished/000001.{suffix}") for suffix in ("png", "json"))
    chunks = [(name, b"" if name == b"IDAT" else data) for name, data in png_chunks(picture.read_bytes())]
    picture.write_bytes(join_png_chunks(chunks))
    data = json.loads(record.read_bytes())
    data["record"]["digest"] = bytes_digest(picture.read_bytes())
    record.write_text(json.dumps(data), encoding="utf-8")
    assert render(capsys, "--output", "film.mp4") == (
        2,
        "4 of 6 frames are already finished\n"
        "4 of 6 frames are kept; the same command resumes there\n"
        "film.mp4.unfinished/000001.png: a frame that cannot be decoded\n"
        "  hint: remove it, and the command that drew it draws it again\n",
    )
    picture.unlink()
    code, text = render(capsys, "--output", "film.mp4")
    assert (code, text.splitlines()[0]) == (0, "3 of 6 frames are already finished")


def test_no_opengl(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def refuse(**options: object) -> None:
        raise Exception("libEGL.so not loaded")  # what its loader raises

    monkeypatch.setattr(moderngl, "create_context", refuse)
    assert render(capsys, "--set", "splat={footprint: gaussian}") == (
        1,
        "no OpenGL 3.3 context could be made\n"
        "  got: libEGL.so not loaded\n"
        "  expected: an EGL library and a driver: a GPU's, or Mesa's software renderer\n"
        "  hint: on Debian or Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri; "
        "the footprint integrated needs none\n",
    )


@pytest.mark.parametrize(
    ("before", "now", "text"),
    [
        ({"a": {"b": 1}}, {"a": {"b": 2}}, "a.b was 1"),
        ({"a": {}}, {"a": {"b": {"c": 2}}}, "a.b was nothing"),
        ({"a": {"b": [1, 2.0]}}, {"a": {}}, "a.b was [1, 2]"),
        ({"a": [0] * 100}, {"a": 1}, f"a was [{'0, ' * 18}0,..."),
        (dict.fromkeys("abcde", 1), dict.fromkeys("abcde", 2), "a was 1; b was 1; c was 1 and 2 more"),
        ({"\x1b[31m": "\x1b[0m"}, {}, "'\\x1b[31m' was '\\x1b[0m'"),
        ({"a": {"b": {"deep": [[[[[[]]]]]]}}}, {"a": {"b": 1}}, "a.b was {deep: [[...]]}"),
        ({"a": float("nan")}, {"a": 1}, "a was .nan"),
    ],
)
def test_what_differs_between_two_fingerprints(before: dict[str, Any], now: dict[str, Any], text: str) -> None:
    assert describe_differences(before, now) == text
