"""The suggestion for each kind of data gives a picture that shows something."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from film_stages import PLAIN
from kinds_of_data import KINDS, N, suggested, volume_of

from renderer.draw import Rasterizer
from renderer.frame import prepare_stage, render_frames
from renderer.scene import CameraSpec, OutputSpec, Scene, TurntablePath

Array = npt.NDArray[Any]


def picture(values: Array, rasterizer_for: Callable[[Scene], Rasterizer], size: int = 64) -> Array:
    """uint8 [size, size, 3]: the second of four frames."""
    suggestion = suggested(values)
    scene = replace(
        PLAIN,
        camera=CameraSpec(TurntablePath(4, elevation=20), target="visible"),
        output=OutputSpec(Path("still.png"), (size, size)),
    ).with_layers(transfer_function=suggestion.transfer, shading=suggestion.shading)
    volume = volume_of(values.astype(np.float32))  # one dtype to compile for
    stage = prepare_stage(scene, clock=time.perf_counter, num_threads=1, volumes=[volume])
    (frame,) = render_frames(stage, [1], rasterizer_for(scene), clock=time.perf_counter)
    return np.asarray(frame.image)


@pytest.mark.parametrize("name", ["head", "microscopy", "uint8", "signed", "labels", "phases", "distance"])
def test_picture(name: str, rasterizer_for: Callable[[Scene], Rasterizer]) -> None:
    """The object covers a part of the picture that is neither a speck nor all of it, neither dim nor burnt out, and is
    not of one brightness.

    Seen were 0.17 to 0.70 of the picture, a mean of 60 to 175 and deviations of 25 to 72; the bounds leave half as
    much room again.
    """
    image = picture(KINDS[name][0], rasterizer_for)
    brightest = image.max(axis=2).astype(float)
    covered = brightest > 12
    assert 0.1 < covered.mean() < 0.85
    assert 40 < brightest[covered].mean() < 210
    assert brightest[covered].std() > 16
    assert (image.min(axis=2) > 250).mean() < 0.02


def test_a_label_has_its_own_colour_to_its_skin(rasterizer_for: Callable[[Scene], Rasterizer]) -> None:
    """The surface of a label does not have the colour of a number between it and the background."""
    values = np.zeros((N, N, N), np.uint8)
    values[4:18, 8:-8, 8:-8] = 1
    values[30:44, 8:-8, 8:-8] = 2
    image = picture(values, rasterizer_for, 96).astype(int)
    upper, lower = image[:40], image[56:]
    for part, own, other in ((upper, 2, 0), (lower, 0, 2)):  # blue above, orange below
        seen = part.max(axis=2) > 12
        assert seen.mean() > 0.1
        assert (part[seen][:, own] > part[seen][:, other]).all()
