"""A film of a mapped volume is the same from one process and from several."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hsplat_cli.main import run
from renderer.readers import read_volume
from renderer.scene import RawSource, VolumeSpec

SHAPE = (512, 512, 256)  # 64 MiB, of which a film needs little: the rest of the file has no blocks on the disk

SCENE = """
version: 1
volume:
  raw: {file: large.raw, shape: [512, 512, 256], dtype: uint8, spacing: [1, 1, 1]}
transfer_function:
  unit: 4
  points: [{value: 40, color: "#4c66cc", opacity: 0}, {value: 250, color: "#ffe6b2", opacity: 0.6}]
camera: {path: {type: turntable, frames: 4}}
splat: {footprint: integrated}
error: {tolerance: 0.05}
output: {file: "frame{frame}.png", size: [64, 48]}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    x, y, z = SHAPE
    with (tmp_path / "large.raw").open("wb") as file:
        file.truncate(x * y * z)
        plane = np.zeros((y, x), np.uint8)
        plane[200:300, 180:330] = np.add.outer(np.arange(100), np.arange(150)) % 200 + 50
        for number in range(90, 160):
            file.seek(number * x * y)
            file.write(plane.tobytes())
    (tmp_path / "scene.yaml").write_text(SCENE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def pictures(folder: Path) -> list[bytes]:
    return [path.read_bytes() for path in sorted(folder.glob("frame*.png"))]


def test_any_number_of_processes(folder: Path) -> None:
    source = RawSource(folder / "large.raw", SHAPE, "uint8", spacing=(1.0, 1.0, 1.0))
    assert read_volume(VolumeSpec(source)).source is not None
    assert run(["render", "scene.yaml", "--workers", "1", "--quiet"]) == 0
    alone = pictures(folder)
    assert len(alone) == 4 and len(set(alone)) == 4
    assert run(["render", "scene.yaml", "--workers", "2", "--force", "--quiet"]) == 0
    assert pictures(folder) == alone
