"""What several tests of whole commands start from."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def scene_folder(request: pytest.FixtureRequest, folder: Path) -> Path:
    """Return the current folder, with the module's SCENE in scene.yaml."""
    (folder / "scene.yaml").write_text(request.module.SCENE, encoding="utf-8")
    return folder
