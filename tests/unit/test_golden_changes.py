"""Changes of a scene since its goldens were drawn, in words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hsplat_cli.compare import Golden, GoldenPicture, GoldenRecord, GoldenVolume, Origin, changed_value, changes_since

VOLUME = GoldenVolume("engine", "0" * 32, (2, 2, 2), "uint8")


@pytest.mark.parametrize(
    ("path", "was", "now", "expected"),
    [
        ("points.0.color", [1, 0.647, 0], [0, 0.5, 0.5], ("points.0.color", "#ffa500", "#008080")),
        ("points.0.color", [1, 0.6471, 0], [1, 0.647, 0], ("points.0.color", "[1, 0.6471, 0]", "[1, 0.647, 0]")),
        ("transfer_function.range", [0, 100], [10, 0.5], ("transfer_function.range", "0 to 100", "10 to 0.5")),
        ("output.size", [96, 96], [96, 80], ("output.size", "96 x 96", "96 x 80")),
        ("size", [1, 0, 1], [0, 0, 1], ("size", "1 x 0 x 1", "0 x 0 x 1")),
        ("color", [2, 0, 0], "auto", ("color", "[2, 0, 0]", "'auto'")),
        ("background", {"top": [0, 0, 0], "bottom": [0.1, 0.2, 0.3]}, [0.4, 128 / 255, 230 / 255], (
            "background", "{top: #000000, bottom: #1a334c}", "#6680e6")),
        ("points", [{"value": 1, "color": [1, 0, 0]}], None, ("points", "[{value: 1, color: #ff0000}]", "")),
        ("a", [[0, 1], [1, 0.5]], [[0, 1], [1, 0.6]], ("a.1", "[1, 0.5]", "[1, 0.6]")),
        ("a", [*range(30)], [*range(29), 4], ("a.29", "29", "4")),
        ("a", [*range(30)], None, ("a", "[0, 1, 2, ... 25 more ..., 28, 29]", "")),
        ("a", None, {"b": 0.4, "color": [1, 0.5, 0]}, ("a", "", "{b: 0.4, color: #ff8000}")),
    ],
)  # fmt: skip
def test_values_are_told_as_people_write_them(path: str, was: Any, now: Any, expected: tuple[str, str, str]) -> None:
    assert changed_value(path, was, now) == expected


def test_a_long_value_is_shown_without_its_middle() -> None:
    _, was, _ = changed_value("text", "a" * 400 + "b" * 400, "c")
    assert len(was) <= 160 and was.startswith("'aaaa") and was.endswith("bbbb'") and " ... " in was


def test_goldens_of_several_origins_list_the_changes_since_each_of_them(folder: Path) -> None:
    """Of one frame's goldens, the origin counts that has most in common with this one."""
    Path("scene.yaml").write_text("volume: x.nrrd\n", "utf-8")
    now = Origin(VOLUME, "this", {"opacity": 3, "size": 1}, {})
    origins = tuple(
        replace(now, scene={"opacity": opacity, "size": size}) for opacity, size in ((1, 1), (3, 2), (1, 2))
    )
    numbers = ((0, 2), (1,), (1,))
    goldens = [
        Golden(frame, tuple(GoldenPicture("0" * 32, number) for number in each)) for frame, each in enumerate(numbers)
    ]
    found = [*changes_since(GoldenRecord(origins, tuple(goldens), ":"), goldens, now, Path("scene.yaml"))]
    assert [(change.key, change.was, change.now) for change in found] == [("opacity", "1", "3"), ("size", "2", "1")]
