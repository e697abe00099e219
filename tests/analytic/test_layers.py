"""Pictures of several volumes: against exact rays, against one volume, and the same however they are drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stage_pictures import decibels, decibels_of_means, drawn, drawn_by_single_rays, exact

from renderer.accuracy import FrameProber
from renderer.frame import Stage, prepare_stage
from renderer.readers import read_volume
from renderer.resolve import resolve_scene
from renderer.scene import Scene, parse_scene
from renderer.system import MemoryShare
from renderer.volume import Float32, Float64

RAMP = [{"value": 70, "color": "#cc7857", "opacity": 0}, {"value": 240, "color": "#faf2e0", "opacity": 0.4}]
BLUE = [{"value": 90, "color": "#3060ff", "opacity": 0}, {"value": 170, "color": "#a0ffa0", "opacity": 0.3}]
ENGINE = {
    "procedural": {"name": "engine_block", "shape": [40, 40, 24]},
    "transfer_function": {"points": RAMP, "unit": 1},
}
# Turned about two axes, and smaller.
TURNED = [[0.42, -0.36, 0.1, 14.0], [0.3, 0.4, -0.2, 4.0], [0.05, 0.22, 0.5, 1.0], [0, 0, 0, 1]]
RINGS = {
    "procedural": {"name": "marschner_lobb", "shape": [48, 40, 33]},
    "transfer_function": {"points": BLUE, "unit": 1},
    "transform": TURNED,
}
PLANE = {"plane": {"point": [19, 19, 13], "normal": [0.3, 0.2, 1]}}
FIXED = {"plane": {"point": [0, 0, 3], "normal": [0, 0, 1]}, "fixed": "camera"}
BOXES = [{"box": [[10, -9, -9], [20, 60, 60]]}, {"box": [[15, 10, -9], [60, 20, 60]]}]


def scene_of(volumes: list[dict[str, Any]], tolerance: float = 0.02, **changes: Any) -> Scene:
    tree = {
        "version": 1,
        **({"volumes": volumes} if volumes else {}),
        "camera": {"path": {"type": "turntable", "frames": 12, "elevation": 25}},
        "output": {"file": "film-{frame}.png", "size": [72, 64]},
        "error": {"tolerance": tolerance},
    }
    return resolve_scene(parse_scene(tree | changes, base=Path()), read_volume)


def staged(scene: Scene) -> Stage:
    return prepare_stage(scene, clock=lambda: 0.0, num_threads=1)


def draw(scene: Scene, **options: Any) -> Float32:
    with staged(scene) as stage:
        return drawn(stage, **options)


def draw_both(scene: Scene) -> tuple[Float32, Float64]:
    """Return a picture by one ray a pixel, and its exact rays, of what can be shown."""
    with staged(scene) as stage:
        return np.clip(drawn_by_single_rays(stage), 0, 1), np.clip(exact(stage), 0, 1)


COLORED = {key: RINGS[key] for key in ("procedural", "transform")} | {"color": "red", "range": [90, 200]}
ATLAS: dict[str, Any] = {"procedural": {"name": "atlas", "shape": [40, 40, 24], "seed": 3}, "labels": {"opacity": 0.4}}
ONE_LABEL: dict[str, Any] = {"procedural": {"name": "constant", "shape": [10, 10, 10]}, "labels": {}, "shading": {}}
MASK = {"procedural": {"name": "atlas", "shape": [40, 40, 24]}, "transform": TURNED}
PATH = {"type": "turntable", "frames": 12}
LARGER = {"name": "constant", "shape": [33, 33, 33]}
NEAR_END = {"plane": {"point": [29.8, 0, 0], "normal": [1, 0, 0]}}
OTHER = ENGINE | {"transfer_function": {"points": BLUE}}
SCENES: dict[str, tuple[list[dict[str, Any]], dict[str, Any]]] = {
    "two grids": ([ENGINE, RINGS], {}),
    "orthographic": ([ENGINE, RINGS], {"camera": {"projection": "orthographic", "path": PATH}}),
    "from inside": ([ENGINE, RINGS], {"camera": {"distance": 8, "path": PATH}}),
    "one grid": ([ENGINE, OTHER | {"weight": 0.3}], {}),
    "three": ([ENGINE, OTHER, RINGS], {}),
    "added": ([ENGINE, RINGS], {"blend": "add"}),
    "added on one grid": ([ENGINE, OTHER], {"blend": "add"}),
    "maximum": ([ENGINE, RINGS | {"weight": 0.5}], {"mode": "maximum"}),
    "mean": ([ENGINE, RINGS | {"weight": 0.5}], {"mode": "mean"}),
    "lit": ([ENGINE, RINGS | {"shading": {"ambient": 0.5, "diffuse": 0.5}}], {}),
    "light of the camera": ([ENGINE, RINGS], {"shading": {"light": "camera", "specular": 0.3}}),
    "lit on one grid": ([ENGINE | {"shading": {}}, OTHER], {}),
    "occlusion": ([ENGINE | {"shading": {"occlusion": 0.8}}, RINGS], {}),
    "a plane for one": ([ENGINE | {"clip": [PLANE]}, RINGS], {}),
    "boxes for one": ([ENGINE | {"clip": BOXES}, RINGS], {}),
    "boxes for all": ([ENGINE, RINGS], {"clip": BOXES}),
    "a plane before the camera": ([ENGINE, RINGS], {"clip": [FIXED]}),
    "without some data": ([ENGINE | {"nodata": [12, 13, 14, 96, 97, 98]}, RINGS], {}),
    "one grid without some data": ([ENGINE | {"nodata": [96, 97, 98]}, OTHER], {}),
    "color and range": ([ENGINE, COLORED], {}),
    "labels": ([ATLAS], {}),
    "lit labels": ([ATLAS | {"shading": {}}], {}),
    "labels that are cut open": ([ATLAS | {"shading": {"light": "camera", "specular": 0.3}}], {"clip": [PLANE]}),
    "labels on the grid of a scan": ([ENGINE, ATLAS | {"weight": 0.4}], {}),
    "lit labels on another grid": ([ENGINE, ATLAS | {"transform": TURNED, "shading": {}}], {}),
    "a mask": ([ENGINE | {"mask": MASK}], {}),
    "a mask on a grid of two": ([ENGINE | {"mask": MASK}, OTHER], {}),
    "a lit mask beside another grid": ([ENGINE | {"mask": MASK, "shading": {}}, RINGS], {}),
    "maximum in a mask": ([ENGINE | {"mask": MASK}, RINGS], {"mode": "maximum"}),
    "mean in a mask": ([ENGINE | {"mask": MASK}, RINGS], {"mode": "mean"}),
    "labels in a mask": ([ATLAS | {"mask": MASK}], {}),
    "a lit label up to the border": ([ONE_LABEL], {}),
    "a lit label that is cut near the border": ([ONE_LABEL | {"procedural": LARGER}], {"clip": [NEAR_END]}),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_pictures_are_those_of_exact_rays(name: str) -> None:
    volumes, changes = SCENES[name]
    image, truth = draw_both(scene_of(volumes, **changes))
    assert truth[..., :3].max() > 0.2
    is_lit = "shading" in changes or any("shading" in volume for volume in volumes)
    has_steps = "label" in name or "mask" in name  # a step at every second voxel
    assert decibels(image[..., :3], truth[..., :3]) > (45 if is_lit or has_steps else 55)
    assert decibels(image[..., 3], truth[..., 3]) > (45 if has_steps else 50)


def test_two_layers_are_drawn_where_one_cell_stands_for_all_voxels() -> None:
    """Then no brick has voxels, and the memory for their texels is empty."""
    thin = [ENGINE | {"weight": 0.001}, OTHER | {"weight": 0.001}]
    with staged(scene_of(thin, tolerance=0.1)) as stage:
        image, truth = drawn_by_single_rays(stage), exact(stage)
    assert 0.5 < image.sum() / truth.sum() < 2
    assert np.abs(image - truth).max() < 0.1


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("orthographic", 60),
        ("one grid", 65),
        ("added", 60),
        ("added on one grid", 60),
        ("maximum", 40),
        ("mean", 40),
        ("lit on one grid", 70),
        ("boxes for all", 60),
        pytest.param("a mask", 50, marks=pytest.mark.slow),
        ("a lit label up to the border", 40),
    ],
)
def test_pictures_are_means_over_pixels(name: str, least: float) -> None:
    """With one ray a pixel they have 29 to 48 decibels."""
    volumes, changes = SCENES[name]
    with staged(scene_of(volumes, **changes)) as stage:
        assert decibels_of_means(stage) > least


@pytest.mark.parametrize("blend", ["mix", "add"])
@pytest.mark.parametrize("tolerance", [0.0, 0.3, 1.0])
def test_the_tolerance_is_kept_to(tolerance: float, blend: str) -> None:
    """With larger tolerances, pixels between others are interpolated."""
    size = {"file": "film-{frame}.png", "size": [256, 224]}
    image, truth = draw_both(scene_of([ENGINE, RINGS], tolerance, blend=blend, output=size))
    assert decibels(image, truth) > {0.0: 95, 0.3: 38, 1.0: 28}[tolerance]


@pytest.mark.parametrize(("shading", "is_shared"), [({}, True), ({"occlusion": 0.5}, False)])
def test_layers_that_are_clipped_share_what_does_not_depend_on_it(shading: dict[str, Any], is_shared: bool) -> None:
    lit = ENGINE | {"shading": shading}
    with staged(scene_of([lit, lit | {"clip": [PLANE]}])) as stage:
        one, other = stage.layers
        assert (one.bricks is other.bricks) == is_shared


def test_a_list_of_one_volume_is_that_volume() -> None:
    tree = {key: ENGINE[key] for key in ENGINE if key != "procedural"} | {
        "volume": {"procedural": ENGINE["procedural"]}
    }
    assert draw(scene_of([ENGINE])).tobytes() == draw(scene_of([], **tree)).tobytes()


def test_a_volume_is_lit_by_the_scene_as_by_itself() -> None:
    light = {"light": "camera", "specular": 0.3}
    pictures, probes = [], []
    by_themselves = scene_of([{**each, "shading": light} for each in (ENGINE, RINGS)])
    for scene in (scene_of([ENGINE, RINGS], shading=light), by_themselves):
        with staged(scene) as stage:
            pictures.append(drawn(stage))
            probes.append(FrameProber(stage, 40).exact_pixels(1, np.zeros((64, 72, 3), np.uint8)).means.colors)
    assert pictures[0].tobytes() == pictures[1].tobytes()
    assert probes[0].tobytes() == probes[1].tobytes()


def test_a_volume_of_which_nothing_shows_changes_nothing() -> None:
    hidden = ENGINE | {
        "transfer_function": {
            "points": [{"value": 254, "color": "red", "opacity": 0}, {"value": 255, "color": "red", "opacity": 1}]
        }
    }
    framed = {"camera": {"target": [20, 15, 8], "distance": 90, "path": PATH}}
    assert draw(scene_of([hidden, RINGS], **framed)).tobytes() == draw(scene_of([RINGS], **framed)).tobytes()


def test_the_order_of_volumes_and_the_number_of_threads_change_no_byte() -> None:
    volumes = [ENGINE, RINGS, RINGS | {"transform": np.diag([0.5, 0.6, 0.7, 1.0]).tolist(), "weight": 2}]
    expected = draw(scene_of(volumes), num_threads=1).tobytes()
    assert draw(scene_of(volumes[::-1]), num_threads=3).tobytes() == expected


def test_bricks_that_do_not_fit_the_cache_are_drawn_in_bands() -> None:
    scene = scene_of([ENGINE, RINGS], 0.1)
    expected = draw(scene).tobytes()
    assert draw(scene, memory=MemoryShare(48 * 4 * 18**3)).tobytes() == expected


def test_a_matrix_moves_a_volume() -> None:
    """Against spacings, which say the same."""
    moved = RINGS | {"transform": np.diag([0.5, 0.25, 0.75, 1.0]).tolist()}
    spaced = RINGS | {"procedural": {**RINGS["procedural"], "spacing": [0.5, 0.25, 0.75]}}
    del spaced["transform"]
    assert draw(scene_of([ENGINE, moved])).tobytes() == draw(scene_of([ENGINE, spaced])).tobytes()
