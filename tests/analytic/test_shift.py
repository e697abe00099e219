"""A camera's shift moves its picture by whole pixels and changes nothing else, whatever draws it."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from film_stages import PLAIN, stage_of
from stage_pictures import NUMBER, decibels, exact

from renderer.draw import Rasterizer
from renderer.frame import render_frames
from renderer.scene import AnnotationSpec, ErrorSpec, ModeSpec, Scene, ShadingSpec, SplatSpec

SIZE = (48, 36)
# The pixels that the target moves to the right and down.
RIGHT, DOWN = 12, 9
SHIFT = (RIGHT / SIZE[0], -DOWN / SIZE[1])

# Changes of a scene, and the agreement in decibels with which its parts are the same. Bricks draw neighbouring pixels
# with different samples; they agree as they do with the truth.
CASES: dict[str, tuple[dict[str, Any], float]] = {
    "bricks": ({}, 50.0),
    "splats": ({"splat": SplatSpec("gaussian")}, 80.0),
    "triangles": ({"splat": SplatSpec("gouraud")}, 60.0),
    "lines": ({"annotation": AnnotationSpec(octree=True)}, 50.0),
    "maximum": ({"mode": ModeSpec("maximum")}, 50.0),
    "light": ({"shading": ShadingSpec(light="camera")}, 50.0),
}


def shifted(scene: Scene, shift: tuple[float, float] | None = SHIFT) -> Scene:
    return replace(scene, camera=replace(scene.camera, shift=shift))


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("name", CASES)
def test_a_shift_moves_the_picture(rasterizer_for: Callable[[Scene], Rasterizer], name: str, projection: str) -> None:
    changes, least = CASES[name]
    camera = replace(PLAIN.camera, distance=70.0, projection=projection)
    scene = replace(PLAIN, camera=camera, error=ErrorSpec(0.02), output=replace(PLAIN.output, size=SIZE))
    rest = {key: change for key, change in changes.items() if key != "shading"}
    scene = replace(scene.with_layers(shading=changes.get("shading")), **rest)
    before, after = (
        next(
            render_frames(stage_of(each), [NUMBER], rasterizer_for(each), clock=itertools.count().__next__)
        ).radiance_with_lines()
        for each in (scene, shifted(scene))
    )
    part = before[:-DOWN, :-RIGHT]
    assert part[..., 3].max() > 0.3
    assert decibels(part, after[DOWN:, RIGHT:]) > least
    assert decibels(before, after) < 30


def test_exact_rays_are_shifted() -> None:
    camera = replace(PLAIN.camera, distance=70.0)
    scene = replace(PLAIN, camera=camera, output=replace(PLAIN.output, size=SIZE))
    before, after = exact(stage_of(scene)), exact(stage_of(shifted(scene)))
    np.testing.assert_allclose(before[:-DOWN, :-RIGHT], after[DOWN:, RIGHT:], atol=1e-9)
