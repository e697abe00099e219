"""Volumes that are mixed have voxels of some thickness, on every frame, so that rays take a bounded number of steps."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hsplat_cli import main
from renderer.errors import SceneError
from renderer.frame import prepare_stage
from renderer.scene import parse_scene

# A grid of 16 x 16 x 16 voxels of sides 1, 1, s has a diagonal of 16 sqrt(2) for small s, and 1e5 times s is as long.
LEAST_SIDE = 16 * math.sqrt(2) / 1e5
# Of three sides of 1, of which two have an angle of sine t, the smallest singular value is t / sqrt(2) for small t; its
# diagonal is counted as if they were at right angles.
LEAST_SHEARED = 16 * math.sqrt(3) * math.sqrt(2) / 1e5
GRID = {"procedural": {"name": "engine_block", "shape": [16, 16, 16]}}
LOOK = {"transfer_function": {"colormap": "gray", "range": [0, 255], "opacity": [[0, 0], [255, 0.1]]}}


def scaled(side: float) -> list[list[float]]:
    return [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, side, 0], [0, 0, 0, 1]]


def sheared(thickness: float) -> list[list[float]]:
    """All sides of its voxels are 1 long; the third one is almost along the first."""
    return [[1, 0, math.sqrt(1 - thickness**2), 0], [0, 1, 0, 0], [0, 0, thickness, 0], [0, 0, 0, 1]]


def scene_of(first: dict[str, Any], **sections: Any) -> dict[str, Any]:
    return {
        "volumes": [GRID | LOOK | first, GRID | LOOK],
        "camera": {"path": {"type": "turntable", "frames": 12}},
        "output": {"file": "out.gif", "size": [16, 16]},
    } | sections


def prepare(first: dict[str, Any], **sections: Any) -> None:
    with prepare_stage(parse_scene(scene_of(first, **sections), base=Path()), clock=lambda: 0.0, num_threads=1):
        pass


@pytest.fixture
def labels(folder: Path) -> dict[str, Any]:
    """Return a layer of labels, whose file gives the sides of voxels; LEAST_SIDE along z."""
    import nibabel as nifti

    values = np.arange(4096, dtype=np.uint8).reshape(16, 16, 16) % 3
    nifti.save(nifti.Nifti1Image(values, np.diag([1, 1, LEAST_SIDE * 0.99, 1])), folder / "labels.nii")
    return {"file": "labels.nii", "labels": {}}


@pytest.mark.parametrize(
    ("first", "ratio"),
    [
        ({"transform": scaled(LEAST_SIDE * 0.99)}, "1.01e+05"),
        ({"transform": scaled(-1e-5)}, "2.263e+06"),
        ({"procedural": {**GRID["procedural"], "spacing": [1, 1, 1e-4]}}, "2.263e+05"),
        ({"transform": sheared(LEAST_SHEARED * 0.99)}, "1.01e+05"),
    ],
)
def test_a_volume_that_is_too_flat_to_be_mixed(first: dict[str, Any], ratio: str) -> None:
    with pytest.raises(SceneError, match="too flat to be mixed") as refused:
        prepare(first)
    (problem,) = refused.value.problems
    assert problem.path == "volumes.0"
    assert str(problem.got).endswith(f"a ratio of {ratio}")


@pytest.mark.parametrize(
    ("first", "sections"),
    [
        ({"transform": scaled(LEAST_SIDE * 1.01)}, {}),
        ({"transform": sheared(LEAST_SHEARED * 1.01)}, {}),
        ({"transform": scaled(1e-5)}, {"blend": "add"}),
        ({"transform": scaled(1e-5)}, {"mode": "maximum"}),
    ],
)
def test_volumes_that_may_be_as_flat(first: dict[str, Any], sections: dict[str, Any]) -> None:
    prepare(first, **sections)


def test_volumes_on_one_grid_may_be_as_flat() -> None:
    """They are drawn as one, brick by brick: rays take no more steps than there are voxels."""
    flat = GRID | LOOK | {"transform": scaled(1e-5)}
    prepare({}, volumes=[flat, flat])


def test_every_frame_counts() -> None:
    """The side along z is 1 at frame 0, -0.1 at frame 11, and 1e-4 at frame 10."""
    moving = {0: scaled(1), 11: scaled(1 - 1.1 * (1 - 1e-4))}
    with pytest.raises(SceneError, match="too flat to be mixed") as refused:
        prepare({"transform": moving})
    assert [problem.what.partition(":")[0] for problem in refused.value.problems] == ["at frame 10"]


def test_check_says_so(folder: Path, labels: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    tree = scene_of({}, volumes=[labels, GRID | LOOK])
    (folder / "scene.yaml").write_text(json.dumps(tree))
    assert main.run(["check", "scene.yaml"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith("volumes.0: this volume is too flat to be mixed with others")
    assert said[2] == "  expected: a ratio of at most 100000"
