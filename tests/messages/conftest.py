"""The folder that most tests of messages begin in."""

from __future__ import annotations

from pathlib import Path

import pytest
from message_scenes import SCENE


@pytest.fixture
def scene_folder(folder: Path) -> Path:
    """Return the current folder, with SCENE in scene.yaml and two files that hold no volumes."""
    (folder / "scene.yaml").write_text(SCENE, encoding="utf-8")
    (folder / "scan.nrrd").write_bytes(bytes(30))
    (folder / "walnut.raw").write_bytes(bytes(16))
    return folder
