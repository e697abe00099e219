"""What a user reads about frames that are there already, and about jobs that cannot keep theirs."""

from __future__ import annotations

import errno
import json
import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hsplat_cli import main
from hsplat_cli.executors import frame_result as drawn
from hsplat_cli.films import describe_differences
from renderer.film import bytes_digest, join_png_chunks, png_chunks
from renderer.frame import Frame

SMALL = [
    "--set", "camera.path.frames=6", "--set", "output.size=[32, 32]", "--set", "volume.procedural.shape=[8, 8, 8]",
]  # fmt: skip


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
def test_what_differs(before: dict[str, Any], now: dict[str, Any], text: str) -> None:
    assert describe_differences(before, now) == text


class Render:
    """Runs `hsplat render` on a small variant of SCENE; something may happen before a frame is drawn."""

    def __init__(self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
        self._capsys, self._monkeypatch, self._original = capsys, monkeypatch, drawn.render_frames

    def __call__(self, *arguments: str) -> tuple[int, str]:
        """Exit code and what was said on the error stream, but for the progress."""
        code = main.run(["render", "scene.yaml", *SMALL, *arguments])
        lines = self._capsys.readouterr().err.splitlines(keepends=True)
        return code, "".join(line for line in lines if "frames/s" not in line and "compiling" not in line)

    def at_frame(self, number: int, happens: Any) -> None:
        def watched(*arguments: Any, **options: Any) -> Iterator[Frame]:
            for frame in self._original(*arguments, **options):
                if frame.number == number:
                    happens()
                yield frame

        self._monkeypatch.setattr(drawn, "render_frames", watched)


@pytest.fixture
def render(scene_folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Render:
    return Render(capsys, monkeypatch)


def interrupt() -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_a_life_of_a_film(render: Render, output: str) -> None:
    render.at_frame(4, interrupt)
    kept = "4 of 6 frames are kept; the same command resumes there\nhsplat: interrupted\n"
    assert render("--output", output) == (130, kept)
    render.at_frame(5, interrupt)
    again = "4 of 6 frames are already finished\n5 of 6 frames are kept; the same command resumes there\n"
    assert render("--output", output) == (130, f"{again}hsplat: interrupted\n")
    render.at_frame(9, interrupt)
    why = "scene.error.tolerance was 0.1"
    changed = f"5 existing frames of another film are drawn again: {why}\n"
    assert render("--output", output, "--set", "error.tolerance=0.2") == (0, changed)
    up_to_date = f"{output} is up to date; --force draws it again\n"
    assert render("--output", output, "--set", "error.tolerance=0.2") == (0, up_to_date)
    anew = f"{output} is another film and is drawn again: scene.error.tolerance was 0.2\n"
    assert render("--output", output, "--set", "error.tolerance=0.3") == (0, anew)


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_a_film_that_is_drawn_again_for_nothing(render: Render, output: str) -> None:
    """With --force, and interrupted."""
    assert render("--output", output) == (0, "")
    render.at_frame(4, interrupt)
    command = "the same command without --force"
    if output == "film.mp4":
        command += ", once film.mp4 is removed,"
    kept = f"4 of 6 frames are kept; {command} resumes there\nhsplat: interrupted\n"
    assert render("--output", output, "--force") == (130, kept)
    up_to_date = f"{output} is up to date; --force draws it again\n"
    assert render("--output", output) == (0, up_to_date)


def test_a_kept_frame_that_no_decoder_takes(render: Render) -> None:
    """It is what its record says, and yet no picture."""
    render.at_frame(4, interrupt)
    render("--output", "film.mp4")
    picture, told = (Path(f"film.mp4.unfinished/000001.{suffix}") for suffix in ("png", "json"))
    content = join_png_chunks(
        [(name, b"" if name == b"IDAT" else data) for name, data in png_chunks(picture.read_bytes())]
    )
    picture.write_bytes(content)
    data = json.loads(told.read_bytes())
    data["record"]["digest"] = bytes_digest(content)
    told.write_text(json.dumps(data), encoding="utf-8")
    render.at_frame(9, interrupt)
    code, said = render("--output", "film.mp4")
    assert (code, said) == (
        1,
        "4 of 6 frames are already finished\n"
        "3 of 6 frames are kept; the same command resumes there\n"
        "film.mp4.unfinished/000001.png: a checkpoint frame cannot be decoded\n"
        "  hint: run the same command again to redraw it\n",
    )
    assert render("--output", "film.mp4") == (0, "3 of 6 frames are already finished\n")


def test_a_folder_that_is_none(render: Render) -> None:
    Path("film.mp4.unfinished").touch()
    assert render("--output", "film.mp4") == (
        2,
        "film.mp4.unfinished: something else has the name of the folder for unfinished frames\n"
        "  got: a file\n"
        "  hint: rename it, or choose another --output\n",
    )


@pytest.mark.parametrize("output", ["film.mp4", "film.gif", "{frame}.png"])
def test_an_output_folder_that_vanishes(render: Render, output: str) -> None:
    folder = Path("out", "frames.unfinished" if output == "{frame}.png" else f"{output}.unfinished")

    def vanish() -> None:
        while not (folder / "000002.json").exists():  # frames are kept by a thread behind the drawing
            time.sleep(0.001)
        shutil.rmtree("out")

    render.at_frame(3, vanish)
    place = "out/3.png" if output == "{frame}.png" else folder / "000003.png"
    assert render("--output", f"out/{output}") == (
        1,
        f"{place}: the output folder has vanished\n  hint: it existed when the work began\n",
    )
    assert not Path("out").exists()


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
@pytest.mark.parametrize("suffix", ["png", "json"])
def test_a_disk_that_is_full(render: Render, monkeypatch: pytest.MonkeyPatch, output: str, suffix: str) -> None:
    """At a frame, or at its record."""
    write = Path.write_bytes

    def full(path: Path, content: bytes) -> int:
        if path.name.startswith((f".000003.{suffix}.partial", f".3.{suffix}.partial")):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        return write(path, content)

    monkeypatch.setattr(Path, "write_bytes", full)
    folder = "frames.unfinished" if output == "{frame}.png" else f"{output}.unfinished"
    place = "3.png" if output == "{frame}.png" and suffix == "png" else f"{folder}/000003.{suffix}"
    assert render("--output", output) == (
        1,
        "3 of 6 frames are kept; the same command resumes there\n"
        f"{place}: the disk is full\n  hint: free some space, or write to another disk\n",
    )
    assert not Path("film.mp4").exists()
    assert not [path for path in Path().rglob("*") if "partial" in path.name]
