"""The library refuses volumes, cameras, integrals and splats that cannot be drawn; `library.txt` has the messages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from film_stages import PLAIN, stage_of
from ray_integrals import converged_image
from splatting import place_splats

from renderer.errors import HsplatError
from renderer.readers import check_lengths, errors_about
from renderer.scene import CameraSpec, TurntablePath
from renderer.view import fit_distance, make_view
from renderer.volume import make_volume

_, *_PARTS = Path(__file__).with_name("library.txt").read_text("utf-8").split("=== ")
MESSAGES = dict(part.split("\n", 1) for part in _PARTS)
CAMERA = CameraSpec(TurntablePath(1))
FAR_CAMERA = replace(CAMERA, near=1e13)
ORIGIN = (0.0, 0.0, 0.0)
FLAT = np.diag([1.0, 1e-6, 1.0, 1.0])
FAR_AWAY = np.eye(4) + np.array([[0, 0, 0, -1e13]] * 3 + [[0.0] * 4])


def prepare(camera: CameraSpec, world_from_index: np.ndarray) -> None:
    """Prepare a scene of 2 x 2 x 2 voxels."""
    stage_of(replace(PLAIN, camera=camera), make_volume(np.ones((2, 2, 2), np.uint8), world_from_index, "scan.nrrd"))


def frame(points: object) -> None:
    fit_distance(CAMERA, np.array(points, dtype=float).reshape(-1, 3), ORIGIN, (8, 8))


def check_spacing(length: float) -> None:
    with errors_about("scan.nrrd"):
        check_lengths(np.diag([length, 1.0, 1.0, 1.0]))


def integrate_to_zero_error() -> None:
    voxels = np.zeros((2, 2, 2))
    voxels.flags.writeable = False
    empty = SimpleNamespace(values=np.zeros(1), colors=np.zeros((1, 3)), extinctions=np.zeros(1))
    view = make_view(CAMERA, 0, ORIGIN, 9.0, (2, 1))
    converged_image(make_volume(voxels, np.eye(4), "cube.nrrd"), empty, view, tolerance=0.0)


def place_a_splat_nowhere() -> None:
    batch = place_splats([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], 0.0, 0.0)
    vertices = batch.vertices.copy()
    vertices[1, 2] = np.nan
    replace(batch, vertices=vertices)


CASES: dict[str, Callable[[], object]] = {
    "flat voxels": lambda: prepare(CAMERA, FLAT),
    "far from the origin": lambda: prepare(CAMERA, FAR_AWAY),
    "a near plane beyond all bounds": lambda: prepare(FAR_CAMERA, np.eye(4)),
    "too long a spacing": lambda: check_spacing(1e300),
    "too short a spacing": lambda: check_spacing(1e-200),
    "no distance": lambda: make_view(CAMERA, 0, ORIGIN, 0.0, (8, 8)),
    "nothing to frame": lambda: frame([]),
    "a point to frame": lambda: frame(ORIGIN),
    "all beyond the target": lambda: frame([[0, 50, 0], [0, 51, 1]]),
    "no error allowed": integrate_to_zero_error,
    "a splat nowhere": place_a_splat_nowhere,
}


@pytest.mark.parametrize("title", CASES)
def test_message(title: str) -> None:
    with pytest.raises(HsplatError) as caught:
        CASES[title]()
    assert f"{caught.value}\n" == MESSAGES[title]


def test_every_message_has_its_case() -> None:
    assert MESSAGES.keys() == CASES.keys()
