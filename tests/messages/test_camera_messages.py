"""Whole texts of what the camera, the framing and the ray integral say to a user."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from renderer.errors import InputError, RenderError
from renderer.scene import CameraSpec, TurntablePath
from renderer.truth import converged_image
from renderer.view import fit_distance, make_view
from renderer.volume import Volume

CAMERA = CameraSpec(TurntablePath(4))
ORIGIN = (0.0, 0.0, 0.0)


def test_no_distance() -> None:
    with pytest.raises(InputError) as caught:
        make_view(CAMERA, 0, ORIGIN, 0.0, (8, 8))
    assert str(caught.value) == (
        "camera.distance: the eye is not at a finite distance from the target\n"
        "  got: 0\n"
        "  expected: a length greater than 0"
    )


def test_nothing_to_frame() -> None:
    with pytest.raises(InputError) as caught:
        fit_distance(CAMERA, np.empty((0, 3)), ORIGIN, (8, 8), range(4))
    assert str(caught.value) == (
        "camera.distance: nothing is visible, so there is nothing to frame\n"
        "  expected: a volume and a transfer function that show something\n"
        "  hint: raise the opacities or set camera.distance"
    )


def test_no_extent_to_frame() -> None:
    with pytest.raises(InputError) as caught:
        fit_distance(CAMERA, np.zeros((1, 3)), ORIGIN, (8, 8), range(4))
    assert str(caught.value) == (
        "camera.distance: what is visible has no extent, so there is nothing to frame\n  hint: set camera.distance"
    )


def test_framed_from_anywhere() -> None:
    beyond = np.array([[0.0, 50.0, 0.0], [0.0, 51.0, 1.0]])
    with pytest.raises(InputError) as caught:
        fit_distance(CAMERA, beyond, ORIGIN, (8, 8), range(1))
    assert str(caught.value) == (
        "camera.distance: all that is visible lies beyond the target, and is in frame from any distance\n"
        "  hint: set camera.distance"
    )


def test_an_integral_that_does_not_settle() -> None:
    voxels = np.zeros((2, 2, 2))
    voxels.flags.writeable = False
    volume = Volume(voxels, np.eye(4), "cube.nrrd", "")
    empty = SimpleNamespace(values=np.zeros(1), colors=np.zeros((1, 3)), extinctions=np.zeros(1))
    with pytest.raises(RenderError) as caught:
        converged_image(volume, empty, make_view(CAMERA, 0, ORIGIN, 9.0, (2, 1)), tolerance=0.0)
    assert str(caught.value) == (
        "cube.nrrd: the ray integral does not converge in 12 halvings of its step\n"
        "  got: a change of 0 at a step of 0.000244 voxels; 2 of 2 pixels have not converged\n"
        "  expected: a change below 0\n"
        "  hint: ask for a larger tolerance"
    )
