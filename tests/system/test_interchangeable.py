"""What the Python API makes and what the command makes are interchangeable: films, parts and unfinished work."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from resuming import (
    NUM_FRAMES,
    Draws,
    arguments,
    assert_clean,
    output_files,
    sidecar,
    sidecar_of,
    uninterrupted_files,
    watch_draws,
)
from small_scene import small_scene

import renderer
from hsplat_cli import main

OUTPUTS = ["film.mp4", "{frame}.png"]
# The default footprint first.
SCENES: list[tuple[str | None, str | None]] = [
    (None, None),
    (None, "psnr: 30, probes: 16"),
    ("gaussian", "splats: 200, probes: 16"),
]


class Command:
    """The command `hsplat render`."""

    def make(self, output: str, frames: Sequence[int] = range(NUM_FRAMES)) -> None:
        """Make the film of these frames, or keep it."""
        words = ["--frames", f"{frames[0]}:{frames[-1] + 1}"] if len(frames) < NUM_FRAMES else []
        assert main.run(arguments(output, *words, "--quiet")) == 0

    def interrupt(self, output: str, draws: Draws) -> None:
        """Begin the film, until an interrupt."""
        draws.stop_at = 3
        assert main.run(arguments(output, "--quiet")) == 130
        draws.stop_at = None


class Api:
    """The function `renderer.render`."""

    def make(self, output: str, frames: Sequence[int] = range(NUM_FRAMES)) -> None:
        """Make the film of these frames, or keep it."""
        renderer.render("scene.yaml", output=f"out/{output}", frames=frames)

    def interrupt(self, output: str, draws: Draws) -> None:
        """Begin the film, until its callback raises."""

        def stop(num_finished: int, num_frames: int) -> None:
            if num_finished == 2:
                raise InterruptedError(f"{num_finished} of {num_frames}")

        with pytest.raises(InterruptedError, match=f"2 of {NUM_FRAMES}"):
            renderer.render("scene.yaml", output=f"out/{output}", on_progress=stop)


Maker = Command | Api
# Each does its part first, then the other goes on.
both_ways = pytest.mark.parametrize(
    ("one", "other"), [(Command(), Api()), (Api(), Command())], ids=["command first", "API first"]
)


@pytest.fixture(autouse=True)
def draws(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Draws:
    write_scene()
    return watch_draws(monkeypatch)


def write_scene(footprint: str | None = None, error: str | None = None) -> None:
    text = small_scene(frames=NUM_FRAMES, error=error, footprint=footprint)
    Path("scene.yaml").write_text(text, encoding="utf-8")


def without_seconds(data: Any) -> Any:
    """Return the content of a sidecar without times, and without the memory that was free."""
    if isinstance(data, dict):
        is_own = {"seconds", "memory"}
        return {key: [*value] if key in is_own else without_seconds(value) for key, value in data.items()}
    return [without_seconds(item) for item in data] if isinstance(data, list) else data


@pytest.mark.slow
@pytest.mark.parametrize(("footprint", "error"), SCENES)
@pytest.mark.parametrize("output", OUTPUTS)
def test_files_and_sidecars_are_the_same(output: str, footprint: str | None, error: str | None) -> None:
    """But for times, of which the same steps are told."""
    write_scene(footprint, error)
    found = []
    for number, maker in enumerate((Command(), Api())):
        maker.make(output)
        found.append((output_files(), without_seconds(sidecar(sidecar_of(output)))))
        Path("out").rename(f"out{number}")
    assert found[0] == found[1]


@both_ways
@pytest.mark.parametrize("output", OUTPUTS)
def test_a_film_that_one_began_is_resumed_by_the_other(output: str, one: Maker, other: Maker, draws: Draws) -> None:
    """No frame is drawn twice."""
    expected = uninterrupted_files(output)
    draws.take_numbers()
    one.interrupt(output, draws)
    first = draws.take_numbers()
    assert first
    other.make(output)
    rest = draws.take_numbers()
    assert rest and first + rest == [*range(NUM_FRAMES)]
    assert output_files() == expected
    assert_clean()


def array_scene(output: str) -> renderer.Scene:
    z, y, x = np.ogrid[-1:1:12j, -1:1:14j, -1:1:16j]
    values = np.exp(-4 * (x * x + y * y + z * z)).astype(np.float32)
    path = {"path": {"type": "turntable", "frames": NUM_FRAMES}}
    return renderer.suggest_scene(values, size=(32, 32), camera=path, output=output)


def test_parts_of_an_array_are_assembled(draws: Draws) -> None:
    """By their sidecars, which lack the voxels; the film is up to date for the same array."""
    renderer.render(array_scene("whole.mp4"))
    for frames in (range(2), range(2, NUM_FRAMES)):
        renderer.render(array_scene("parts/{frame}.png"), frames=frames)
    draws.take_numbers()
    assert main.run(["assemble", "parts", "--output", "film.mp4", "--quiet"]) == 0
    assert Path("film.mp4").read_bytes() == Path("whole.mp4").read_bytes()
    renderer.render(array_scene("film.mp4"))
    assert draws.take_numbers() == []
