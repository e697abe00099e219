"""Changes of a scene since its goldens were drawn, in words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hsplat_cli.compare import Golden, GoldenPicture, GoldenRecord, GoldenVolume, Origin, changes_since

VOLUME = GoldenVolume("engine", "0" * 32, (2, 2, 2), "uint8")


@pytest.mark.parametrize(
    ("key", "was", "now", "texts"),
    [
        ("background", [1, 1, 1], [0.4, 128 / 255, 230 / 255], ("#ffffff", "#6680e6")),
        ("background", {"top": [0, 0, 0], "bottom": [0.1, 0.2, 0.3]}, [0, 0, 1], (
            "{top: #000000, bottom: #1a334c}", "#0000ff")),
        ("color", [2, 0, 0], "auto", ("[2, 0, 0]", "'auto'")),
        ("points", [{"value": 1, "color": [1, 0, 0]}], None, ("[{value: 1, color: #ff0000}]", "")),
        ("size", [1, 0, 1], [0, 0, 1], ("1 x 0 x 1", "0 x 0 x 1")),
    ],
)  # fmt: skip
def test_colours_are_hexadecimal(key: str, was: Any, now: Any, texts: tuple[str, str], folder: Path) -> None:
    old = Origin(VOLUME, "a device", {key: was}, {})
    record = GoldenRecord((old,), (Golden(0, (GoldenPicture("0" * 32, 0),)),), ":")
    Path("scene.yaml").write_text("volume: x.nrrd\n", "utf-8")
    scene = {} if now is None else {key: now}
    (change,) = changes_since(record, record.frames, replace(old, scene=scene), Path("scene.yaml"))
    assert (change.was, change.now) == texts


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
