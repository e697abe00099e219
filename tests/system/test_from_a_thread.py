"""Commands and functions work in any thread, although only the main one may set handlers of signals."""

from __future__ import annotations

import signal
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import small_scene

import renderer
from hsplat_cli import main

SCENE = small_scene(frames=2)


def in_a_thread(function: Callable[..., Any], *arguments: Any) -> Any:
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(function, *arguments).result()


def test_commands(scene_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.save("ramp.npy", np.arange(4096, dtype=np.uint8).reshape(16, 16, 16))
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    for command in (
        "render scene.yaml --quiet",
        "render scene.yaml --quiet --progressive --output progressive.mp4",
        "render scene.yaml --quiet --output parts/{frame}.png",
        "assemble parts --output assembled.mp4",
        "golden scene.yaml --frames 0",
        "compare scene.yaml",
        "turntable ramp.npy --output films --frames 1 --size 16",
    ):
        assert in_a_thread(main.run, command.split()) == 0, (command, capsys.readouterr().err)
    assert Path("assembled.mp4").read_bytes() == Path("film.mp4").read_bytes()
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before


def test_the_library(scene_folder: Path) -> None:
    assert in_a_thread(renderer.render, "scene.yaml").path.is_file()
