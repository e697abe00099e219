"""Printed sizes: pixels follow from lengths and dpi, files state the dpi, and wrong sizes are told."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from film_stages import PLAIN
from PIL import Image

from renderer.errors import SceneError
from renderer.film import Picture, film_notes
from renderer.frame import annotation_notes, prepare_stage
from renderer.scene import OutputSpec, parse_scene, scene_to_dict


def output_of(*outputs: dict[str, Any]) -> OutputSpec:
    files = [{"file": "{frame}.png"}, *({"file": f"{name}.png", "frame": 0} for name in "abc")]
    given = [file | keys for file, keys in zip(files, outputs, strict=False)]
    scene = parse_scene(scene_to_dict(PLAIN) | {"output": given}, base=Path())
    again = parse_scene(scene_to_dict(scene), base=Path())
    assert again.output == scene.output
    return scene.output


def test_pixels_follow_from_lengths_and_dpi() -> None:
    for size, expected in (
        ({"width": "85 mm", "dpi": 300}, (1004, 753, 300)),
        ({"width": "8.5cm", "height": "2 in", "dpi": 300}, (1004, 600, 300)),
        ({"width": "240 pt", "height": "240 pt", "dpi": 72}, (240, 240, 72)),
        ({"width": "3.35 in", "dpi": "1e2"}, (335, 251, 100)),
    ):
        output = output_of({"size": size})
        assert (*output.size, output.dpi) == expected
        assert output.kind.dpi == output.dpi
    assert output_of({"size": {"width": "1 in", "height": "1 in"}, "dpi": 150}).size == (150, 150)
    assert output_of({"size": [40, 30], "dpi": 150}).dpi == 150
    assert output_of({"size": [40, 30]}).dpi is None


def test_further_outputs_have_the_same_printed_size() -> None:
    paper = {"width": "2 in", "height": "1 in", "dpi": 300}
    both = output_of({"size": paper}, {}, {"size": [300, 150]}, {"size": [200, 100], "dpi": 7})
    assert [(each.size, each.dpi) for each in both.files] == [
        ((600, 300), 300),
        ((600, 300), 300),
        ((300, 150), 150),
        ((200, 100), 7),
    ]
    keyed = output_of({"size": {"width": "2 in", "height": "1 in"}, "dpi": 100}, {}, {"size": [100, 50]})
    assert [each.dpi for each in keyed.files] == [100, 100, 50]
    assert len(keyed.kinds) == 2


def test_a_dpi_without_a_place_is_told_once_and_not_recorded() -> None:
    def output(*files: str) -> OutputSpec:
        given = [{"file": file, "dpi": 300} for file in files]
        return parse_scene(scene_to_dict(PLAIN) | {"output": given}, base=Path()).output

    for suffix in ("mp4", "webm", "webp", "avif", "gif", "mov"):
        (note,) = (each for each in film_notes(output(f"film.{suffix}", "b.mp4")) if "dpi" in each)
        assert note.startswith(f"film.{suffix} and b.mp4 cannot state 300 dpi")
        written: Any = scene_to_dict(replace(PLAIN, output=output(f"film.{suffix}")))["output"]
        assert "dpi" not in written
    for files in (("a.apng",), ("{frame}.exr",), ("film.mp4", "{frame}.png")):
        assert film_notes(output(*files)) == []
        again = parse_scene(scene_to_dict(replace(PLAIN, output=output(*files))), base=Path()).output
        assert again.files[-1].dpi == 300
    assert film_notes(PLAIN.output) == []


@pytest.mark.parametrize("depth", ["uint8", "uint16"])
def test_png_files_state_the_dpi(depth: str) -> None:
    pixels = np.arange(60, dtype=depth).reshape(4, 5, 3)
    for dpi in (300, 72.5, None):
        content = Picture(pixels, dpi=dpi).content
        found = Image.open(io.BytesIO(content)).info.get("dpi")
        assert found == (None if dpi is None else pytest.approx((dpi, dpi), abs=0.02))
        np.testing.assert_array_equal(Picture(content=content).pixels, pixels)


def test_wrong_printed_sizes_are_told() -> None:
    for keys, path, what in (
        ({"size": {"width": "85 mm"}}, "output.size.dpi", "missing"),
        ({"size": {"dpi": 300}}, "output.size.width", "missing"),
        ({"size": {"width": 85, "dpi": 300}}, "output.size.width", "not a length with its unit"),
        ({"size": {"width": "85 px", "dpi": 300}}, "output.size.width", "not a length with its unit"),
        ({"size": {"width": "85 mm", "dpi": 0}}, "output.size.dpi", "out of range"),
        ({"size": {"width": "2 in", "dpi": 300}, "dpi": 150}, "output.size.dpi", "contradicts output.dpi"),
        ({"size": {"width": "900 in", "dpi": 300}}, "output.size", "out of range"),
        ({"size": {"width": "0.001 in", "dpi": 300}}, "output.size", "out of range"),
        ({"size": ["85 mm", "60 mm"]}, "output.size", "lengths in a list"),
        ({"dpi": "high"}, "output.dpi", "not a number"),
    ):
        with pytest.raises(SceneError) as caught:
            parse_scene(scene_to_dict(PLAIN) | {"output": {"file": "{frame}.png"} | keys}, base=Path())
        (problem,) = caught.value.problems
        assert (problem.path, problem.what) == (path, what)


def test_a_note_says_that_texts_are_small_in_print() -> None:
    for annotation, width, remedy in (
        ({"scale_bar": True}, "40 mm", "annotation.size: 0.059 makes"),
        ({"scale_bar": {"size": 0.01}, "size": 0.1}, "40 mm", "annotation.scale_bar.size: 0.059 makes"),
        ({"scale_bar": True, "size": 0.059}, "40 mm", ""),
        ({"scale_bar": True}, "85 mm", ""),
        ({"orientation": {"size": 0.02}}, "40 mm", ""),
    ):
        tree: dict[str, Any] = {"volume": {"procedural": {"name": "engine_block", "shape": [16, 16, 16]}}}
        tree["transfer_function"] = {"colormap": "gray", "range": [0, 255], "opacity": [[80, 0], [255, 0.5]]}
        tree |= {"camera": {"path": {"type": "turntable", "frames": 1}}, "annotation": annotation}
        tree["output"] = {"file": "a.png", "size": {"width": width, "dpi": 300}}
        with prepare_stage(parse_scene(tree, base=Path()), clock=lambda: 0.0, num_threads=1) as stage:
            notes = [note for note in annotation_notes(stage) if "small in print" in note]
        assert len(notes) == bool(remedy) and all(remedy in note for note in notes)
