"""Fog against closed forms: an even slab seen straight, in pictures and by exact rays, alone and mixed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import renderer
from renderer.errors import SceneError
from renderer.scene import FilmScene, parse_scene
from renderer.volume import Float64

SIDE = 16
OPACITY = 0.08
COLOR = (0.8, 0.4, 0.2)
FOG = (0.2, 0.4, 0.8)
RANGE = (-5.0, 4.0)
CONSTANT = {"name": "constant", "shape": [SIDE] * 3}


def layer(weight: float, shape: int = SIDE) -> dict[str, Any]:
    """Return an even volume, a cube around the same centre for each shape."""
    spacing = [SIDE / shape] * 3
    points = [{"value": 0, "color": list(COLOR), "opacity": OPACITY}]
    source = {"procedural": CONSTANT | {"shape": [shape] * 3, "spacing": spacing}, "weight": weight}
    shift = (SIDE / shape - 1) / 2
    transform = [[1, 0, 0, shift], [0, 1, 0, shift], [0, 0, 1, shift], [0, 0, 0, 1]]
    return source | {"transfer_function": {"points": points, "unit": 1}, "transform": transform}


def scene_of(**sections: Any) -> FilmScene:
    """Return a scene of an even cube, which the camera sees straight from above."""
    one = layer(1.0)
    del one["weight"]
    volumes = {"volume": {"procedural": one["procedural"]}, "transfer_function": one["transfer_function"]}
    if "volumes" in sections:
        volumes = {}
    camera = {
        "projection": "orthographic",
        "target": [(SIDE - 1) / 2] * 3,
        "distance": 40,
        "path": {"type": "turntable", "frames": 1, "elevation": 90},
    }
    fog = {"color": list(FOG), "range": list(RANGE)}
    output = {"file": "fog.png", "size": [32, 32]}
    tree = {"camera": camera, "fog": fog, "error": {"tolerance": 0}, "output": output}
    return parse_scene(volumes | tree | sections, base=Path.cwd(), is_single_frame=True)


def slab_in_fog(depths: tuple[float, float] = RANGE) -> Float64:
    """Return the colour of the slab in fog of a range of depths, by integration by parts."""
    tau = -math.log(1 - OPACITY)
    begin, end = (SIDE / 2 + depth for depth in depths)
    alpha = -math.expm1(-tau * SIDE)
    foggy = (math.exp(-tau * begin) - math.exp(-tau * end)) / (tau * (end - begin)) - math.exp(-tau * SIDE)
    return np.array([foggy * of_fog + (alpha - foggy) * own for own, of_fog in zip(COLOR, FOG, strict=True)])


def drawn(scene: FilmScene) -> Float64:
    """Return the mean colour of some pixels in the middle of the picture, from 0 to 1."""
    return np.asarray(np.asarray(renderer.render_frame(scene, 0))[12:20, 12:20, :3].mean(axis=(0, 1)) / 255)


def exact(scene: FilmScene) -> Float64:
    """Return the mean colour of the same pixels by exact rays or paths, from 0 to 1."""
    return np.asarray(np.asarray(renderer.integrate(scene, 0))[12:20, 12:20, :3].mean(axis=(0, 1)))


TWO = [layer(0.25), layer(0.75, SIDE // 2)]


@pytest.mark.parametrize("sections", [{}, {"volumes": TWO}], ids=["alone", "mixed"])
def test_a_slab_in_fog(sections: dict[str, Any]) -> None:
    """The exact rays have the closed form; steps of pictures are as long as even matter allows."""
    scene = scene_of(**sections)
    assert drawn(scene) == pytest.approx(slab_in_fog(), abs=2.1e-3)
    assert exact(scene) == pytest.approx(slab_in_fog(), abs=1e-6)


def test_exact_rays_are_exact_in_a_wall_of_fog() -> None:
    """Rays are divided where fog begins and ends, both within a voxel."""
    depths = (0.23, 0.31)
    found = exact(scene_of(fog={"color": list(FOG), "range": list(depths)}))
    assert found == pytest.approx(slab_in_fog(depths), abs=1e-6)


def test_behind_its_end_fog_hides_all_light() -> None:
    """With `light`, too, at any exposure: matter that is wholly in fog shows the fog, in linear light."""
    light = {"environment": "studio", "exposure": 1.5, "surface": 0.5}
    scene = scene_of(light=light, fog={"color": list(FOG), "range": [-30, -20]})
    alpha = 1 - (1 - OPACITY) ** SIDE
    linear = np.array([((part + 0.055) / 1.055) ** 2.4 for part in FOG])
    shown = 1.055 * (alpha * linear) ** (1 / 2.4) - 0.055
    assert drawn(scene) == pytest.approx(shown, abs=3e-3)
    assert exact(scene) == pytest.approx(shown, abs=3e-3)


def test_before_its_begin_fog_changes_nothing() -> None:
    before, behind = (scene_of(fog={"range": ends}) for ends in ([20, 30], [-30, -20]))
    alpha = 1 - (1 - OPACITY) ** SIDE
    assert drawn(before) == pytest.approx(alpha * np.array(COLOR), abs=3e-3)
    assert exact(before) == pytest.approx(alpha * np.array(COLOR), abs=1e-6)
    assert exact(behind) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("sections", "told"),
    [
        ({"mode": "maximum"}, "contradicts mode: maximum"),
        ({"volumes": TWO, "blend": "add"}, "contradicts blend: add"),
        ({"splat": {"footprint": "gaussian"}}, "needs footprint: integrated"),
        ({"fog": {"range": [3, 3]}}, "not ascending"),
    ],
)
def test_fog_is_refused_where_it_has_no_meaning(sections: dict[str, Any], told: str) -> None:
    with pytest.raises(SceneError, match=told):
        scene_of(**sections)
