"""The film of the README is small, and the README links to each scene that made it."""

from __future__ import annotations

import numpy as np
import pytest
from opening_film import FILM, NUM_FRAMES, ROOT, SCENES, SIZE, joined
from PIL import Image

# The most bytes of the film.
MOST_BYTES = 1_500_000


def test_the_readme_names_the_scenes_of_its_film() -> None:
    text = (ROOT / "README.md").read_text("utf-8")
    assert f"]({FILM.relative_to(ROOT)})" in text
    assert [name for name in SCENES if f"](configs/{name}.yaml)" not in text] == []


def test_the_film_is_small_and_has_all_scenes() -> None:
    assert FILM.stat().st_size <= MOST_BYTES
    with Image.open(FILM) as film:
        assert film.size == SIZE
        assert getattr(film, "n_frames", 1) == len(SCENES) * NUM_FRAMES


def test_scenes_are_dissolved_into_each_other_in_a_loop() -> None:
    films = [[Image.new("RGB", (1, 1), (level, 0, 0)) for _ in range(28)] for level in (0, 100)]
    reds = [np.asarray(frame)[0, 0, 0] for frame in joined(films)]
    assert reds == pytest.approx([0] * 20 + [20, 40, 60, 80] + [100] * 20 + [80, 60, 40, 20], abs=1)
