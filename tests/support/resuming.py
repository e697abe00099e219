"""A small film that is stopped and goes on: what the tests of it have in common."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from small_scene import small_scene

from hsplat_cli import main
from hsplat_cli.executors import frame_result
from renderer.frame import Frame

NUM_FRAMES = 5


def enter(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make it the current folder, with the scene in scene.yaml."""
    monkeypatch.chdir(folder)
    (folder / "scene.yaml").write_text(small_scene(frames=NUM_FRAMES), encoding="utf-8")


class Draws:
    """The frames that were drawn, and a stop in the middle of them."""

    def __init__(self) -> None:
        self.numbers: list[int] = []
        self.stop_at: int | None = None

    def taken(self) -> list[int]:
        """Those since the last call."""
        numbers, self.numbers = self.numbers, []
        return numbers


def watched_draws(monkeypatch: pytest.MonkeyPatch) -> Draws:
    """From now on."""
    found, original = Draws(), frame_result.render_frames

    def watched(*arguments: Any, **options: Any) -> Iterator[Frame]:
        for frame in original(*arguments, **options):
            if frame.number == found.stop_at:
                raise KeyboardInterrupt
            found.numbers.append(frame.number)
            yield frame

    monkeypatch.setattr(frame_result, "render_frames", watched)
    return found


def arguments(output: str, *options: str) -> list[str]:
    clear = ["--set", "output.background=transparent"] if output.startswith("clear") else []
    return ["render", "scene.yaml", "--output", f"out/{output}", *clear, *options]


def render(output: str, *options: str) -> None:
    assert main.run(arguments(output, *options)) == 0


def stopped(draws: Draws, output: str, *options: str, at: int = 3) -> None:
    """Finish the frames before `at`, then be interrupted."""
    draws.stop_at = at
    assert main.run(arguments(output, *options)) == 130
    draws.stop_at = None
    draws.taken()


def made(folder: str = "out") -> dict[str, bytes]:
    """All files, but for the sidecar, which tells of times."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in Path(folder).rglob("*")
        if path.is_file() and not path.name.endswith("s.json") and path.suffix != ".json"
    }


def undisturbed(output: str, *options: str) -> dict[str, bytes]:
    given = arguments(output, *options, "--quiet")
    given[3] = given[3].replace("out/", "undisturbed/")
    assert main.run(given) == 0
    return made("undisturbed")


def sidecar(name: str) -> dict[str, Any]:
    data: dict[str, Any] = json.loads((Path("out") / name).read_text(encoding="utf-8"))
    return data


def change(name: str, edit: Callable[[dict[str, Any]], Any]) -> None:
    data = sidecar(name)
    edit(data)
    (Path("out") / name).write_text(json.dumps(data), encoding="utf-8")


def assert_clean() -> None:
    left = [path for path in Path().rglob("*") if "unfinished" in path.name or "partial" in path.name]
    assert left == []


def said(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """What was said on the error stream, but for the progress."""
    return [line for line in capsys.readouterr().err.splitlines() if "frames/s" not in line]


def touched() -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in Path("out").rglob("*") if path.is_file()}


def sidecar_of(output: str) -> str:
    """Its name."""
    return "frames.json" if output.endswith(".png") else f"{output}.json"


def again(name: str, *options: str, code: int = 0) -> None:
    """Make a film once more from the sidecar in out/."""
    assert main.run(["render", f"out/{name}", *options]) == code
