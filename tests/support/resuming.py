"""Helpers for tests of a small film that is interrupted and resumed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import small_scene

from hsplat_cli import main
from renderer.frame import Frame, render_frames

NUM_FRAMES = 5
SCENE = small_scene.small_scene(frames=NUM_FRAMES)


class Draws:
    """A record of the frames that are drawn. stop_at: the frame before which drawing is interrupted, if any."""

    def __init__(self) -> None:
        self.numbers: list[int] = []
        self.stop_at: int | None = None

    def take_numbers(self) -> list[int]:
        """Return the frames drawn since the last call."""
        numbers, self.numbers = self.numbers, []
        return numbers


def watch_draws(monkeypatch: pytest.MonkeyPatch) -> Draws:
    """Record all frames that are drawn from now on."""
    found = Draws()

    def look(frame: Frame) -> None:
        if frame.number == found.stop_at:
            raise KeyboardInterrupt
        found.numbers.append(frame.number)

    on_each_frame(monkeypatch, look)
    return found


def on_each_frame(monkeypatch: pytest.MonkeyPatch, look: Callable[[Frame], object]) -> None:
    """Call `look` with each frame that is drawn from now on, before it is stored."""

    def watched(*arguments: Any, **options: Any) -> Iterator[Frame]:
        for frame in render_frames(*arguments, **options):
            look(frame)
            yield frame

    monkeypatch.setattr("renderer.job.executor.render_frames", watched)


def arguments(output: str, *options: str) -> list[str]:
    clear = ["--set", "output.background=transparent"] if output.startswith("clear") else []
    return ["render", "scene.yaml", "--output", f"out/{output}", *clear, *options]


def render(output: str, *options: str) -> None:
    assert main.run(arguments(output, *options)) == 0


def interrupt_render(draws: Draws, output: str, *options: str, at: int = 3) -> None:
    """Render a film until an interrupt at a frame. The frames before it are finished and kept."""
    draws.stop_at = at
    assert main.run(arguments(output, *options)) == 130
    draws.stop_at = None
    draws.take_numbers()


def output_files(folder: str = "out") -> dict[str, bytes]:
    """Return the content of all files of a folder by path, except sidecars, which contain times."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in Path(folder).rglob("*")
        if path.is_file() and not path.name.endswith("s.json") and path.suffix != ".json"
    }


def uninterrupted_files(output: str, *options: str) -> dict[str, bytes]:
    given = arguments(output, *options, "--quiet")
    given[3] = given[3].replace("out/", "undisturbed/")
    assert main.run(given) == 0
    return output_files("undisturbed")


def sidecar(name: str) -> dict[str, Any]:
    """Return the data of a sidecar in the folder out/."""
    return small_scene.sidecar(Path("out", name))


def edit_sidecar(name: str, edit: Callable[[dict[str, Any]], Any]) -> None:
    small_scene.edit_sidecar(Path("out", name), edit)


def assert_clean() -> None:
    left = [path for path in Path().rglob("*") if "unfinished" in path.name or "partial" in path.name]
    assert left == []


def printed_lines(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return the lines printed to standard error, except lines of progress."""
    return [line for line in capsys.readouterr().err.splitlines() if "frames/s" not in line]


def modification_times(folder: str = "out") -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in Path(folder).rglob("*") if path.is_file()}


def sidecar_of(output: str) -> str:
    """Return the name of the sidecar of an output, which is a film or numbered frames."""
    return "frames.json" if output.endswith(".png") else f"{output}.json"


def rerender(name: str, *options: str, code: int = 0) -> None:
    """Render a film again from its sidecar, `name`, in the folder out/. code: the expected exit code."""
    assert main.run(["render", f"out/{name}", *options]) == code
