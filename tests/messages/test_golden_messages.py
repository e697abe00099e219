"""Messages of `hsplat golden`, and of `hsplat compare` about goldens that it cannot use."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from message_scenes import shorter_scene
from transcripts import Case, cases


@pytest.fixture(autouse=True)
def folder(scene_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make two small scenes, goldens of one without pictures, and frames without a record."""
    for name in ("scene.yaml", "new.yaml"):
        Path(name).write_text(shorter_scene(2), "utf-8")
    for name in ("goldens/scene", "frames"):
        Path(name).mkdir(parents=True)
    shutil.copy(Path(__file__).with_name("golden.json"), "goldens/scene")
    for name in ("frame-0000.png", "frame-0001.png", "notes.txt"):
        Path("frames", name).touch()
    monkeypatch.setenv("CI", "true")


@cases("golden.txt")
def test_messages(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    case.check(capsys)
