"""Each scene of the gallery draws the picture above it, and each picture is small and has its cost beside it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from gallery_page import PAGE, PICTURES, gallery_scenes
from PIL import Image

from renderer import load_scene, render_frame

SCENES = gallery_scenes()
# The most bytes of a picture.
MOST_BYTES = 100_000
# The most words of the page beside its scenes.
MOST_WORDS = 1_200
# By how much a drawn picture without annotation is smaller than the one on the page, along each axis.
DIVISOR = 6

# The scenes that take two seconds or more of processor time each, here.
SLOW = ("corner", "mask", "named", "outdoor", "overcast")
NAMES = [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in SCENES]


def test_every_entry_has_a_picture_a_cost_and_a_scene() -> None:
    text = PAGE.read_text("utf-8")
    costs = re.findall(r"(?m)^\*[\d.]+ s, [\d.]+ dB\*$", text)
    assert len(SCENES) == len(re.findall("(?m)^### ", text)) == len(costs) == 36
    files = {file.stem: file.stat().st_size for file in PICTURES.iterdir()}
    assert files.keys() == SCENES.keys()
    assert max(files.values()) <= MOST_BYTES
    assert len(re.sub("(?s)```yaml.*?```", "", text).split()) <= MOST_WORDS


def on_grey(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    """Return the colours of a picture before middle grey, from 0 to 255."""
    if picture.shape[2] == 3:
        return picture.astype(np.float64)
    alpha = picture[..., 3:] / 255.0
    return picture[..., :3] * alpha + 128 * (1 - alpha)


def difference_of(name: str, folder: Path) -> float:
    """Return the mean difference between the first frame on the page and a small one of its scene, in levels of 255."""
    file = folder / "scene.yaml"
    file.write_text(SCENES[name], "utf-8")
    scene = load_scene(file, overrides=["light.cells=64"] if "\nlight:" in SCENES[name] else [])
    assert scene.output.file == Path(f"{name}.webp")
    with Image.open(PICTURES / f"{name}.webp") as picture:
        assert getattr(picture, "n_frames", 1) == scene.num_frames
        shown = on_grey(np.asarray(picture.convert("RGBA" if picture.has_transparency_data else "RGB")))
    divisor = 1 if "\nannotation:" in SCENES[name] else DIVISOR
    height, width = (length // divisor for length in shown.shape[:2])
    drawn: Any = on_grey(np.asarray(render_frame(scene, size=(width, height))))
    means = shown.reshape(height, divisor, width, divisor, 3).mean(axis=(1, 3))
    return float(np.abs(means - drawn).mean())


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_draws_its_picture(name: str, tmp_path: Path) -> None:
    """Good ones differ by 0.7 to 5.6 levels, mostly at the edges of the light's coarser cells; other colours by 8."""
    assert difference_of(name, tmp_path) < 7
