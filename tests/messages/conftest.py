"""A right scene, and what is said about it once a part of it is wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from renderer.errors import InputError
from renderer.scene import load_scene

SCENE = """\
version: 1
volume:
  procedural: {name: engine_block, shape: [64, 64, 32]}
transfer_function:
  unit: 1.0
  points:
    - {value: 0, color: "#000000", opacity: 0.0}
    - {value: 90, color: "#6680e6", opacity: 0.01}
    - {value: 255, color: white, opacity: 0.5}
camera:
  projection: perspective
  distance: 300
  path: {type: turntable, frames: 120, elevation: 20}
error:
  measure: optical
  tolerance: 0.1
splat:
  footprint: gaussian
output:
  file: engine.mp4
  size: [512, 512]
  background: "#000000"
"""


@pytest.fixture
def scene_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with SCENE in scene.yaml and two files that are no volumes."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.yaml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "scan.nrrd").write_bytes(bytes(30))
    (tmp_path / "walnut.raw").write_bytes(bytes(16))
    return tmp_path


@pytest.fixture
def complaint(scene_folder: Path) -> Callable[[str, str], str]:
    """The message about SCENE with a text in it replaced, the current folder's name being /scans in it."""

    def message(old: str, new: str) -> str:
        assert SCENE.count(old) == 1, old
        Path("scene.yaml").write_text(SCENE.replace(old, new), encoding="utf-8")
        with pytest.raises(InputError) as caught:
            load_scene(Path("scene.yaml"))
        return str(caught.value).replace(str(scene_folder), "/scans")

    return message
