"""What a user reads about numbers that are out of proportion, in the scene and when a volume has been read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from renderer.errors import InputError
from renderer.frame import prepare_stage
from renderer.readers.common import check_lengths
from renderer.scene import (
    CameraSpec,
    ControlPoint,
    FileSource,
    OutputSpec,
    Scene,
    TransferSpec,
    TurntablePath,
    VolumeSpec,
)
from renderer.volume import make_volume

IN_SCENES = {
    "target": (
        "distance: 300",
        "target: [1e15, 0, 0]",
        """\
scene.yaml:12:11: camera.target: too far from the volume
    | target: [1e15, 0, 0]
    |         ^
  got: 1e+15
  expected: at most 4.8e+13, 1e+12 times half the volume's diagonal
""",
    ),
    "distance": (
        "distance: 300",
        "distance: 1e15",
        """\
scene.yaml:12:13: camera.distance: the eye is too far from the target for this volume
    | distance: 1e15
    |           ^
  got: 1e+15
  expected: at most 4.8e+13, 1e+12 times half the volume's diagonal
""",
    ),
    "too little": (
        "projection: perspective\n  distance: 300",
        "projection: orthographic\n  distance: 1e-5",
        """\
scene.yaml:10:1: camera: the picture shows too little of the volume
    | camera:
    | ^
  got: pixels of 1.047e-08 voxels
  expected: at least 1e-06 of a voxel
  hint: see camera.distance, camera.field_of_view and the zoom of keyframes
""",
    ),
    "too much": (
        "distance: 300\n  path: {type: turntable, frames: 120, elevation: 20}",
        "distance: 1e13\n"
        "  path: {type: keyframes, frames: 9, keys: [{frame: 0, azimuth: 0, elevation: 0, zoom: 1e-6}]}",
        """\
scene.yaml:10:1: camera: the volume is too small in the picture
    | camera:
    | ^
  got: pixels of 2.181e+14 times half its diagonal
  expected: at most 1e+12 times that
  hint: see camera.distance, camera.field_of_view and the zoom of keyframes
""",
    ),
    "flat voxels": (
        "shape: [64, 64, 32]",
        "shape: [64, 64, 32], spacing: [1, 1, 1e6]",
        """\
scene.yaml:3:66: volume.procedural.spacing: the voxels are too long or too flat
    | procedural: {name: engine_block, shape: [64, 64, 32], spacing: [1, 1, 1e6]}
    |                                                                ^
  got: sides with a ratio of 1e+06
  expected: a longest side of at most 1e+05 times the shortest
""",
    ),
}


@pytest.mark.parametrize("name", IN_SCENES)
def test_in_a_scene(name: str, complaint: Callable[[str, str], str]) -> None:
    old, new, text = IN_SCENES[name]
    assert complaint(old, new) == text.rstrip("\n")


CAMERA = CameraSpec(TurntablePath(4))
SCENE = Scene(
    VolumeSpec(FileSource(Path("scan.nrrd"))),
    TransferSpec((ControlPoint(0.0, (1.0, 1.0, 1.0), 0.5),), 1.0),
    CAMERA,
    OutputSpec(Path("film.mp4"), (8, 8)),
)


def prepared(scene: Scene, world_from_index: np.ndarray) -> str:  # type: ignore[type-arg]
    """What is said about a volume of 2 x 2 x 2 voxels at this place."""
    volume = make_volume(np.ones((2, 2, 2), np.uint8), world_from_index, "scan.nrrd")
    with pytest.raises(InputError) as caught:
        prepare_stage(scene, clock=lambda: 0.0, num_threads=1, volume=volume)
    return str(caught.value)


def test_voxels_that_are_too_flat() -> None:
    assert prepared(SCENE, np.diag([1.0, 1e-6, 1.0, 1.0])) == (
        "scan.nrrd: the voxels are too long or too flat\n"
        "  got: sides with a ratio of 1e+06\n"
        "  expected: a longest side of at most 1e+05 times the shortest"
    )


def test_a_volume_too_far_away() -> None:
    affine = np.eye(4)
    affine[:3, 3] = -1e13
    assert prepared(SCENE, affine) == (
        "scan.nrrd: the volume is too far from the world's origin for its voxels\n"
        "  got: 1e+13 voxels away\n"
        "  expected: at most 1e+12: further out, float64 cannot tell its voxels apart\n"
        "  hint: move the volume's origin"
    )


def test_a_camera_too_far_from_a_volume_that_was_read() -> None:
    far = replace(SCENE, camera=replace(CAMERA, near=1e13))
    assert prepared(far, np.eye(4)) == (
        "camera.near: too far from the eye for this volume\n"
        "  got: 1e+13\n"
        "  expected: at most 1.732e+12, 1e+12 times half the volume's diagonal"
    )


@pytest.mark.parametrize("entry", [1e300, 1e-200])
def test_a_spacing_beyond_all_lengths(entry: float) -> None:
    with pytest.raises(InputError) as caught:
        check_lengths(np.diag([entry, 1.0, 1.0, 1.0]), "scan.nrrd")
    assert str(caught.value) == (
        "scan.nrrd: the spacing or the origin is out of range\n"
        f"  got: [{entry:g} 0 0 0], [0 1 0 0], [0 0 1 0] (world from voxel index)\n"
        "  expected: lengths from 1e-30 to 1e+30\n"
        "  hint: give lengths in another unit"
    )
