"""The stages of a film in motion: what two frames have in common is made once."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from film_stages import stage_of
from small_scene import engine_block, small_tree

from renderer.frame import Stage
from renderer.scene import parse_scene

NUM_FRAMES = 8
POINTWISE = {"ambient": 0.3, "specular": 0.2}


def staged(**sections: Any) -> Stage:
    return stage_of(parse_scene(small_tree(frames=NUM_FRAMES, **sections), base=Path()))


def camera(**more: Any) -> dict[str, Any]:
    return {"path": {"type": "turntable", "frames": NUM_FRAMES}} | more


PLANE = {"point": {0: [20, 0, 0], 7: [5, 0, 0]}, "normal": [1, 0, 0]}
# What no layer holds.
LIGHT: list[dict[str, Any]] = [
    {"clip": [{"plane": PLANE}]},
    {"camera": camera(field_of_view={0: 20, 7: 40})},
    {"camera": camera(target="visible"), "clip": [{"plane": PLANE}]},
    {"shading": POINTWISE | {"light": {0: [1, 0, 0], 7: [0, 0, 1]}}},
    {"shading": POINTWISE | {"ambient": {0: 0.1, 7: 0.5}, "occlusion": 0.5}},
    {"output": {"file": "a.mp4", "background": {0: "black", 7: "white"}}},
    {"error": {"tolerance": {0: 1, 7: 0.1}}},
]


@pytest.mark.parametrize("sections", LIGHT, ids=" and ".join)
def test_layers_stay(sections: dict[str, Any]) -> None:
    film = staged(**sections)
    first = film.layers[0]
    for frame in (0, 3, 7):
        (layer,) = film.at(frame).layers
        assert (layer.pyramid, layer.bricks, layer.volume) == (first.pyramid, first.bricks, first.volume)
        assert layer.pyramid is first.pyramid


def test_what_the_light_of_a_layer_depends_on_is_made_anew() -> None:
    shading = POINTWISE | {"shadow": 0.5, "light": {0: [1, 0, 0], 7: [0, 0, 1]}}
    film = staged(shading=shading)
    assert film.at(3).layers[0].pyramid is not film.at(4).layers[0].pyramid
    clipped = staged(shading=POINTWISE | {"occlusion": 0.5}, clip=[{"plane": PLANE}])
    assert clipped.at(3).layers[0].pyramid is not clipped.at(4).layers[0].pyramid


def test_only_the_layer_that_moves_is_made_anew() -> None:
    still = engine_block(24, 24, 12) | {"color": "red", "range": [50, 255]}
    moved = engine_block(12, 12, 12) | {"color": "blue", "range": {0: [0, 200], 4: [50, 255]}}
    tree = {key: value for key, value in small_tree().items() if key not in ("volume", "transfer_function")}
    film = stage_of(parse_scene(tree | {"volumes": [still, moved], "camera": camera()}, base=Path()))
    stages = [film.at(frame) for frame in range(NUM_FRAMES)]
    assert len({id(stage.layers[0].pyramid) for stage in stages}) == 1
    are_same = [before.layers[1].pyramid is after.layers[1].pyramid for before, after in pairwise(stages)]
    assert are_same == [frame >= 4 for frame in range(NUM_FRAMES - 1)]


def test_levels_of_detail_stay_where_only_the_view_changes() -> None:
    film = staged(clip=[{"plane": PLANE}])
    assert film.at(2).has_lods_of(film.at(5))
    film = staged(camera=camera(field_of_view={0: 20, 7: 40}))
    assert not film.at(2).has_lods_of(film.at(5))


def test_a_film_that_is_still_has_one_stage() -> None:
    film = staged()
    assert film.at(3) is film


def test_runs_of_frames_that_change() -> None:
    tree = small_tree(frames=NUM_FRAMES, shading={"ambient": {1: 0.1, 3: 0.1, 5: 0.4}, "specular": {0: 0, 1: 1}})
    scene = parse_scene(tree, base=Path())
    assert scene.map(lambda each: each).changing_frames == [(1, 1), (4, 5)]
    changed = [frame for frame in range(1, NUM_FRAMES) if scene.at(frame) != scene.at(frame - 1)]
    assert changed == [1, 4, 5]
