"""Files that no job would write again are on the disk before they get their names, in case the power fails then."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import small_scene
from volume_files import write_volume

from hsplat_cli import main

pytestmark = pytest.mark.usefixtures("folder")


@pytest.fixture
def named(monkeypatch: pytest.MonkeyPatch) -> dict[str, bool]:
    """Whether the files that got their names were on the disk, with all their bytes, by these names."""
    on_disk: dict[int, int] = {}
    result: dict[str, bool] = {}
    fsync, replace = os.fsync, os.replace

    def synchronize(descriptor: int) -> None:
        fsync(descriptor)
        on_disk[os.fstat(descriptor).st_ino] = os.fstat(descriptor).st_size

    def rename(source: Path, target: Path, **options: Any) -> None:
        for file, name in ((source, Path(target).name), (Path(target).with_name("lock"), "lock")):
            if os.path.exists(file):
                status = os.stat(file)
                result[name] = on_disk.get(status.st_ino) == status.st_size
        replace(source, target, **options)

    monkeypatch.setattr(os, "fsync", synchronize)
    monkeypatch.setattr(os, "replace", rename)
    return result


@pytest.fixture(autouse=True)
def scene(folder: Path) -> None:
    Path("scene.yaml").write_text(small_scene(frames=2, error="tolerance: 0.1, probes: 16"), encoding="utf-8")


@pytest.mark.parametrize("output", ["film.mp4", "film.gif"])
@pytest.mark.parametrize("options", [[], ["--progressive"]])
def test_films(output: str, options: list[str], named: dict[str, bool]) -> None:
    """Frames of an unfinished film are checked before they are used, and may be lost, but not whose folder it is."""
    assert main.run(["render", "scene.yaml", "--output", output, "--quiet", *options]) == 0
    frames = set() if options else {"lock"}
    assert {name for name, is_on_disk in named.items() if is_on_disk} == {output, f"{output}.json", *frames}
    assert ("000000.png" in named) == (not options)


def test_frames(named: dict[str, bool]) -> None:
    """Their digests are in the sidecar, so that those that are lost are drawn again."""
    assert main.run(["render", "scene.yaml", "--output", "{frame}.png", "--quiet"]) == 0
    assert {name for name, is_on_disk in named.items() if is_on_disk} == {"frames.json", "lock"}
    named.clear()
    assert main.run(["assemble", ".", "--output", "whole/{frame}.png", "--quiet"]) == 0
    assert named == {"0.png": False, "1.png": False, "frames.json": True}


def test_goldens(named: dict[str, bool]) -> None:
    assert main.run(["golden", "scene.yaml", "--quiet"]) == 0
    for name in ("golden.json", "frame-0000.png", "frame-0001.png"):
        assert named[name]


def test_scenes(named: dict[str, bool]) -> None:
    write_volume(Path("scan.nrrd"), np.arange(216, dtype=np.uint8).reshape(6, 6, 6), "<")
    assert main.run(["init", "scan.nrrd", "--output", "scan.yaml"]) == 0
    assert named == {"hsplat.schema.json": True, "scan.yaml": True}
