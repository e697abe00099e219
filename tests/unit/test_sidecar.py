"""The sidecar has the right name and holds the data that were given."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from renderer.errors import InputError
from renderer.film import film_path_of_sidecar, sidecar_path, write_sidecar
from renderer.scene import parse_scene

SCENE = parse_scene(
    {
        "volume": {"procedural": {"name": "constant", "shape": [4, 4, 4]}},
        "transfer_function": {"points": [{"value": 0, "color": "#ffffff", "opacity": 0.5}]},
        "camera": {"path": {"type": "turntable", "frames": 120}},
        "output": {"file": "engine.mp4"},
    },
    base=Path(),
)


@pytest.mark.parametrize(
    ("output", "frames", "sidecar"),
    [
        ("engine.mp4", range(120), "engine.mp4.json"),
        ("engine.mp4", range(30, 60), "engine.mp4.json"),
        ("out/loop.gif", range(120), "out/loop.gif.json"),
        ("still.png", [7], "still.png.json"),
        ("frames/{frame:04}.png", range(120), "frames/frames.json"),
        ("frames/{frame:04}.png", list(range(120)), "frames/frames.json"),
        ("frames/{frame:04}.png", range(30), "frames/frames.0-29.json"),
        ("frames/{frame:04}.png", tuple(range(30, 60)), "frames/frames.30-59.json"),
        ("frames/{frame:04}.png", range(0, 120, 10), "frames/frames.0-110-by-10.json"),
        ("frames/{frame:04}.png", [7], "frames/frames.7.json"),
        ("frames/{frame:04}.png", [0, 7], "frames/frames.0-7-by-7.json"),
        ("frames/{frame:04}.png", [0, 1, 3], "frames/frames.0-3-some-62a34832.json"),
        ("frames/{frame:04}.png", [0, 2, 3], "frames/frames.0-3-some-616a5ff8.json"),
        ("out/engine_{frame}.png", range(120), "out/engine_frames.json"),
        ("out/v1.2_{frame}.png", range(120), "out/v1.2_frames.json"),
        ("out/v1.2_{frame}.png", range(9), "out/v1.2_frames.0-8.json"),
        ("out/{frame}-engine.png", range(9), "out/frames-engine.0-8.json"),
    ],
)
def test_it_lies_beside_the_output(output: str, frames: Sequence[int], sidecar: str) -> None:
    """Of numbered frames each part of the path, here of 120 frames, has one of its own."""
    scene = replace(SCENE, output=replace(SCENE.output, file=Path(output)))
    assert sidecar_path(scene, frames) == Path(sidecar)
    assert film_path_of_sidecar(Path("new") / Path(sidecar).name, Path(output)) == Path("new") / Path(output).name


def test_it_says_what_it_was_given(tmp_path: Path) -> None:
    path = tmp_path / "new" / "film.mp4.json"
    data = {"z": 0.1 + 0.2, "a": [1e-300, 5e22, -0.0], "name": "Würfel", "none": None, "nested": {"b": 1, "a": True}}
    write_sidecar(path, data)
    text = path.read_text(encoding="utf-8")
    assert json.loads(text) == data
    assert list(json.loads(text)) == list(data)
    assert text.endswith("}\n")
    assert "Würfel" in text
    write_sidecar(path, data)
    assert path.read_text(encoding="utf-8") == text
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_paths_and_numbers_of_numpy_are_plain(tmp_path: Path) -> None:
    path = tmp_path / "film.json"
    write_sidecar(path, {"file": Path("a/b"), "seconds": np.float32(0.5), "cells": np.int64(3), "point": np.eye(2)})
    assert json.loads(path.read_text()) == {"file": "a/b", "seconds": 0.5, "cells": 3, "point": [[1, 0], [0, 1]]}


@pytest.mark.parametrize("value", [float("nan"), float("inf"), np.float32("nan"), np.array([np.inf])])
def test_numbers_that_json_does_not_have_are_refused(tmp_path: Path, value: object) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_sidecar(tmp_path / "film.json", {"value": value})
    assert not list(tmp_path.iterdir())


def test_a_folder_in_its_place(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder"):
        write_sidecar(tmp_path, {})
