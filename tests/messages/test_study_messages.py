"""Messages of `hsplat measure`, and about scenes with an accuracy, where they cannot do their work."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from message_scenes import shorter_scene
from transcripts import Case, cases

from hsplat_cli.measure import scene_notes
from renderer.scene import load_scene


@pytest.fixture(autouse=True)
def folder(scene_folder: Path) -> Path:
    """Fill the current folder with a small scene of bricks."""
    text = shorter_scene(6).replace("shading:\n  ambient: 0.3\n", "")
    (scene_folder / "scene.yaml").write_text(text, "utf-8")
    return scene_folder


@pytest.fixture
def _writes_nothing(folder: Path) -> Iterator[None]:
    before = sorted(folder.rglob("*"))
    yield
    assert sorted(folder.rglob("*")) == before


@pytest.mark.usefixtures("_writes_nothing")
@cases("studies.txt")
def test_messages(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    case.check(capsys)


@cases("accuracy.txt")
def test_messages_about_accuracy(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    case.check(capsys)


@pytest.mark.parametrize(
    ("schedule", "notes"),
    [
        ("tolerance=0.1", []),
        (
            "tolerance={0: 0.5, 3: 0.02}",
            ["the scene changes its tolerance over the film; here each tolerance is measured by itself"],
        ),
        ("psnr=38", ["the scene asks for error.psnr, not for a tolerance; here each tolerance is measured by itself"]),
    ],
)
def test_a_study_notes_what_it_does_not_measure(schedule: str, notes: list[str]) -> None:
    scene = load_scene(Path("scene.yaml"), overrides=["error.tolerance=null", f"error.{schedule}"])
    assert scene_notes(scene) == notes


@pytest.mark.parametrize(
    ("light", "probes"), [("null", "1024 exact rays"), ("{}", "paths of light through 1024 pixels")]
)
def test_a_quick_study_notes_how_few_pixels_it_compares(light: str, probes: str) -> None:
    scene = load_scene(Path("scene.yaml"), overrides=[f"light={light}"])
    (note,) = scene_notes(scene, is_quick=True)
    assert note.startswith(f"errors are estimates from {probes} of each frame")
