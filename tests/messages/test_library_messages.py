"""What the library says about volumes, cameras, integrals and splats that cannot be drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from splatting import place_splats

from renderer.errors import HsplatError
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
from renderer.truth import converged_image
from renderer.view import fit_distance, make_view
from renderer.volume import Volume, make_volume

CAMERA = CameraSpec(TurntablePath(1))
FAR_CAMERA = replace(CAMERA, near=1e13)
ORIGIN = (0.0, 0.0, 0.0)
FLAT = np.diag([1.0, 1e-6, 1.0, 1.0])
FAR_AWAY = np.eye(4) + np.array([[0, 0, 0, -1e13]] * 3 + [[0.0] * 4])


def prepare(camera: CameraSpec, world_from_index: np.ndarray) -> None:
    """Prepare a scene of 2 x 2 x 2 voxels."""
    transfer = TransferSpec((ControlPoint(0.0, (1.0, 1.0, 1.0), 0.5),), 1.0)
    scene = Scene(VolumeSpec(FileSource(Path("scan.nrrd"))), transfer, camera, OutputSpec(Path("film.mp4"), (8, 8)))
    volume = make_volume(np.ones((2, 2, 2), np.uint8), world_from_index, "scan.nrrd")
    prepare_stage(scene, clock=lambda: 0.0, num_threads=1, volume=volume)


def frame(points: object) -> None:
    fit_distance(CAMERA, np.array(points, dtype=float).reshape(-1, 3), ORIGIN, (8, 8))


def integrate_to_zero_error() -> None:
    voxels = np.zeros((2, 2, 2))
    voxels.flags.writeable = False
    empty = SimpleNamespace(values=np.zeros(1), colors=np.zeros((1, 3)), extinctions=np.zeros(1))
    view = make_view(CAMERA, 0, ORIGIN, 9.0, (2, 1))
    converged_image(Volume(voxels, np.eye(4), "cube.nrrd", ""), empty, view, tolerance=0.0)


def place_a_splat_nowhere() -> None:
    batch = place_splats([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], 0.0, 0.0)
    vertices = batch.vertices.copy()
    vertices[1, 2] = np.nan
    replace(batch, vertices=vertices)


CASES: list[tuple[Callable[[], object], str]] = [
    (
        lambda: prepare(CAMERA, FLAT),
        """\
scan.nrrd: the voxels are too long or too flat
  got: sides with a ratio of 1e+06
  expected: a longest side of at most 1e+05 times the shortest
""",
    ),
    (
        lambda: prepare(CAMERA, FAR_AWAY),
        """\
scan.nrrd: the volume is too far from the world's origin for its voxels
  got: 1e+13 voxels away
  expected: at most 1e+12: further out, float64 cannot tell its voxels apart
  hint: move the volume's origin
""",
    ),
    (
        lambda: prepare(FAR_CAMERA, np.eye(4)),
        """\
camera.near: too far from the eye for this volume
  got: 1e+13
  expected: at most 1.732e+12, 1e+12 times half the volume's diagonal
""",
    ),
    (
        lambda: check_lengths(np.diag([1e300, 1.0, 1.0, 1.0]), "scan.nrrd"),
        """\
scan.nrrd: the spacing or the origin is out of range
  got: [1e+300 0 0 0], [0 1 0 0], [0 0 1 0] (world from voxel index)
  expected: lengths from 1e-30 to 1e+30
  hint: give lengths in another unit
""",
    ),
    (
        lambda: check_lengths(np.diag([1e-200, 1.0, 1.0, 1.0]), "scan.nrrd"),
        """\
scan.nrrd: the spacing or the origin is out of range
  got: [1e-200 0 0 0], [0 1 0 0], [0 0 1 0] (world from voxel index)
  expected: lengths from 1e-30 to 1e+30
  hint: give lengths in another unit
""",
    ),
    (
        lambda: make_view(CAMERA, 0, ORIGIN, 0.0, (8, 8)),
        """\
camera.distance: the eye is not at a finite distance from the target
  got: 0
  expected: a length greater than 0
""",
    ),
    (
        lambda: frame([]),
        """\
camera.distance: nothing is visible, so there is nothing to frame
  expected: a volume and a transfer function that show something
  hint: raise the opacities or set camera.distance
""",
    ),
    (
        lambda: frame(ORIGIN),
        """\
camera.distance: what is visible has no extent, so there is nothing to frame
  hint: set camera.distance
""",
    ),
    (
        lambda: frame([[0, 50, 0], [0, 51, 1]]),
        """\
camera.distance: all that is visible lies beyond the target, and is in frame from any distance
  hint: set camera.distance
""",
    ),
    (
        integrate_to_zero_error,
        """\
cube.nrrd: the ray integral does not converge in 12 halvings of its step
  got: a change of 0 at a step of 0.000244 voxels; 2 of 2 pixels have not converged
  expected: a change below 0
  hint: ask for a larger tolerance
""",
    ),
    (
        place_a_splat_nowhere,
        """\
splats that are not finite
  got: 1 of 2 splats, the first is number 1: [1.0, 0.0, nan, 0.0, 0.0, 0.0, 0.0, 0.0]
  expected: finite centres and optical areas
  hint: this is a fault of hsplat; please report it with the scene file
""",
    ),
]


@pytest.mark.parametrize(("act", "message"), CASES)
def test_message(act: Callable[[], object], message: str) -> None:
    with pytest.raises(HsplatError) as caught:
        act()
    assert f"{caught.value}\n" == message
