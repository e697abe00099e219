"""The JSON beside an output: where it lies, and that it says what it was given."""

import json
from pathlib import Path

import numpy as np
import pytest

from renderer.errors import InputError
from renderer.output_files import sidecar_path
from renderer.sidecar import write_sidecar


@pytest.mark.parametrize(
    ("output", "sidecar"),
    [
        ("engine.mp4", "engine.mp4.json"),
        ("out/loop.gif", "out/loop.gif.json"),
        ("frames/{frame:04}.png", "frames/frames.json"),
        ("out/engine_{frame}.png", "out/engine_frames.json"),
        ("out/{frame:04}/picture.png", "out/frames/picture.json"),
    ],
)
def test_it_lies_beside_the_output(output: str, sidecar: str) -> None:
    assert sidecar_path(Path(output)) == Path(sidecar)


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


def test_other_objects_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="set has no form in JSON"):
        write_sidecar(tmp_path / "film.json", {"value": {1, 2}})


def test_a_folder_in_its_place(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder"):
        write_sidecar(tmp_path, {})
