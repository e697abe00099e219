"""A value that moves cannot be read without its frame: mypy reports each such read."""

from __future__ import annotations

from pathlib import Path

import pytest
from mypy import api

ROOT = Path(__file__).parents[2]

# Reads of a film, each of which gives a value of some frame, or none.
READS = """
from renderer.scene import FilmScene, tolerance_at

def read(film: FilmScene) -> list[object]:
    number: float
    (layer, *_) = film.film_layers
    {read}
    return [number]
"""

AT_A_FRAME = {
    "field of view": "number = film.at(7).camera.field_of_view",
    "opacity": "number = layer.at(7).transfer_function.points[0].opacity",
    "clip plane": "number = film.at(7).clip[0].plane.point[0]  # type: ignore[union-attr]",
    "weight": "number = film.film_layers[0].at(7).weight",
    "tolerance": "number = tolerance_at(film.error, 7)",
}

WITHOUT_A_FRAME = {
    "field of view": "number = film.camera.field_of_view",
    "opacity": "number = layer.transfer_function.points[0].opacity",
    "opacity of a film": "number = film.layers[0].transfer_function.points[0].opacity",
    "clip plane": "number = film.clip[0].plane.point[0]  # type: ignore[union-attr]",
    "weight": "number = layer.weight",
    "tolerance": "number = film.error.tolerance",
    "background": "number = film.output.background[0]  # type: ignore[index]",
}


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


def errors_of(reads: dict[str, str], folder: Path, cache: Path) -> dict[str, list[str]]:
    """The errors of mypy for each read, in a file of its own."""
    for number, read in enumerate(reads.values()):
        (folder / f"read_{number}.py").write_text(READS.replace("{read}", read), "utf-8")
    options = ["--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(cache), "--no-error-summary"]
    told, problems, _ = api.run([*options, *(str(folder / f"read_{number}.py") for number in range(len(reads)))])
    assert not problems
    lines = told.splitlines()
    return {name: [each for each in lines if f"read_{number}.py" in each] for number, name in enumerate(reads)}


@pytest.mark.slow
def test_reads_at_a_frame_are_right(tmp_path: Path, cache: Path) -> None:
    assert not any(errors_of(AT_A_FRAME, tmp_path, cache).values())


@pytest.mark.slow
def test_reads_without_a_frame_are_reported(tmp_path: Path, cache: Path) -> None:
    found = errors_of(WITHOUT_A_FRAME, tmp_path, cache)
    assert all(found.values()), found
