"""Occlusion and shadows in pictures: against exact rays that interpolate the same grid, and against plainer lights."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import engine_block
from stage_pictures import decibels, decibels_of_means, drawn, drawn_by_single_rays, exact

from renderer.frame import prepare_stage
from renderer.layers import group_layers
from renderer.scene import Scene, ShadingSpec, parse_scene, with_tolerance
from renderer.transfer import make_light_grid

SLANTED = (1.0, -2.0, 1.5)
KINDS = {
    "occlusion": ShadingSpec(0.6, 0.4, SLANTED, occlusion=0.9),
    "shadow": ShadingSpec(0.2, 0.8, SLANTED, shadow=0.9),
    "both, specular": ShadingSpec(0.3, 0.6, SLANTED, 0.3, 9.0, occlusion=0.7, shadow=0.5, occlusion_radius=6.0),
    "camera": ShadingSpec(0.5, 0.5, "camera", occlusion=1.0),
    "gradients": ShadingSpec(1.0, 0.0, gradient_opacity=((5.0, 0.3), (60.0, 1.0)), occlusion=1.0),
}
EACH_KIND = pytest.mark.parametrize("shading", KINDS.values(), ids=KINDS)


BLOCK = parse_scene(
    {
        "volume": engine_block(48, 48, 24, seed=3),
        "transfer_function": {
            "points": [
                {"value": 70, "color": "#6699e6", "opacity": 0},
                {"value": 120, "color": "#80a6e6", "opacity": 0.5},
                {"value": 255, "color": "#fff2d9", "opacity": 0.9},
            ]
        },
        "camera": {"path": {"type": "turntable", "frames": 8, "elevation": 40}},
        "output": {"file": "a.mp4", "size": [64, 48]},
    },
    base=Path(),
)


def scene_of(shading: ShadingSpec, tolerance: float) -> Scene:
    return with_tolerance(BLOCK.with_layers(shading=shading), tolerance)


def drawn_with(shading: ShadingSpec, tolerance: float) -> Any:
    with prepare_stage(scene_of(shading, tolerance), clock=lambda: 0.0, num_threads=2) as stage:
        return drawn(stage)


def rmse(one: Any, other: Any) -> float:
    return float(np.sqrt(np.mean((one - other) ** 2)))


@EACH_KIND
def test_pictures_are_those_of_exact_rays(shading: ShadingSpec) -> None:
    with prepare_stage(scene_of(shading, 0.001), clock=lambda: 0.0, num_threads=2) as stage:
        image = drawn(stage)
        assert decibels(drawn_by_single_rays(stage), exact(stage, 1 / 8)) > 58
        assert decibels_of_means(stage) > 64  # found: 67 and more; one ray a pixel has 39 to 42
        assert np.array_equal(image, drawn(stage, num_threads=1))
    bright = drawn_with(replace(shading, occlusion=0.0, shadow=0.0), 0.001)
    assert np.abs(bright[..., 3] - image[..., 3]).mean() < 1e-3  # only light is lost
    assert image[..., :3].sum() < 0.97 * bright[..., :3].sum()


@pytest.mark.parametrize("tolerance", [0.3, 1.0])
def test_coarse_cells_have_it_in_their_means(tolerance: float) -> None:
    shading = replace(KINDS["both, specular"], specular=0.0)
    with prepare_stage(scene_of(shading, tolerance), clock=lambda: 0.0, num_threads=2) as stage:
        image, truth = drawn(stage), exact(stage, 1 / 8)
    plain = drawn_with(replace(shading, occlusion=0.0, shadow=0.0), tolerance)
    bright, dim, wanted = (float(picture[..., :3].sum()) for picture in (plain, image, truth))
    assert abs(dim - wanted) < 0.3 * abs(bright - wanted)
    assert decibels(image, truth) > decibels(plain, truth)


@EACH_KIND
def test_a_field_that_is_constant_scales_the_light(shading: ShadingSpec) -> None:
    """Half of the ambient and a quarter of the diffuse light arrive everywhere."""
    with prepare_stage(scene_of(shading, 0.0), clock=lambda: 0.0, num_threads=2) as stage:
        (layer,) = stage.layers
        assert layer.bricks is not None
        grid = np.full((4, 5, 6), 0.2, np.float32)
        has = shading.occlusion > 0, shading.shadow > 0
        made = make_light_grid(grid if has[0] else None, grid if has[1] else None, 9.0, (0.5 / 0.8, 0.75 / 0.8))
        layer = replace(layer, light_grid=made, bricks=replace(layer.bricks, light_grid=made))
        changed = replace(stage, layers=(layer,), groups=group_layers([layer], stage.scene))
        pictures = drawn(changed), exact(changed, 1 / 8)
    ambient, diffuse = 0.5 if has[0] else 1.0, 0.25 if has[1] else 1.0
    scaled = replace(
        shading, ambient=ambient * shading.ambient, diffuse=diffuse * shading.diffuse,
        specular=diffuse * shading.specular, occlusion=0.0, shadow=0.0,
    )  # fmt: skip
    with prepare_stage(scene_of(scaled, 0.0), clock=lambda: 0.0, num_threads=2) as stage:
        assert rmse(pictures[0], drawn(stage)) < 1e-5
        assert rmse(pictures[1], exact(stage, 1 / 8)) < 1e-8
