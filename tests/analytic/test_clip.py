"""Pictures of what clipping leaves, against the ray integral along the same."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest
from small_scene import engine_block, small_tree
from stage_pictures import decibels, decibels_of_means, drawn, drawn_by_single_rays, exact

from renderer.errors import SceneError
from renderer.frame import Stage, prepare_stage, view_of
from renderer.scene import parse_scene
from renderer.system import MemoryShare

PLANE = {"plane": {"point": [20, 17, 14], "normal": [1, -2, 0.5]}}
BEFORE_CAMERA = {"plane": {"point": [1, 2, 3], "normal": [0.2, 0.1, 1]}, "fixed": "camera"}
CORNER = {"box": [[10, -1, 5], [25, 20, 40]]}
IN_A_ROW = [{"box": [[5, 5, 5], [12, 30, 25]]}, {"box": [[18, 3, 5], [30, 30, 25]]}]
CLIPS: dict[str, list[dict[str, Any]]] = {
    "plane": [PLANE], "inverted plane": [PLANE | {"invert": True}], "plane before the camera": [BEFORE_CAMERA],
    "box": [CORNER], "inverted box": [CORNER | {"invert": True}],
    "box before the camera": [{"box": [[-5, -6, -3], [7, 8, 40]], "fixed": "camera"}], "boxes in a row": IN_A_ROW,
    "overlapping boxes and planes": [*IN_A_ROW, CORNER, BEFORE_CAMERA, PLANE | {"invert": True}],
}  # fmt: skip


BLOCK = engine_block(40, 36, 30, spacing=[1, 1.2, 0.9])
OTHER = engine_block(24, 30, 20, spacing=[1.7, 1.5, 1.4]) | {"color": "red", "range": [60, 200]}
GLOSSY = {"ambient": 0.2, "diffuse": 0.5, "light": "camera", "specular": 0.3, "silhouette": 0.6}


def stage_of(clip: list[dict[str, Any]], **sections: Any) -> Stage:
    tree = small_tree(
        volume=BLOCK,
        shading={"light": [1, 2, 3]},
        error={"tolerance": 0.002},
        output={"file": "a.mp4", "size": [70, 62]},
        frames=10,
        clip=clip,
    )
    tree = {key: value for key, value in (tree | sections).items() if value is not None}
    return prepare_stage(parse_scene(tree, base=Path()), clock=perf_counter, num_threads=2)


@pytest.mark.parametrize("name", CLIPS)
def test_pictures_of_what_is_left(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = stage_of(CLIPS[name])
    frame, truth = drawn(stage), exact(stage)
    assert (truth[..., 3] > 0).mean() > 0.02
    assert decibels(drawn_by_single_rays(stage)[..., :3], truth[..., :3]) > 55
    assert decibels_of_means(stage) > 64  # found: 66 and more; one ray a pixel has 42 to 51, and 68 once
    assert np.abs(exact(stage_of([])) - truth).max() > 0.1
    # Neither threads nor the room for bricks matter.
    assert drawn(stage, num_threads=1, memory=MemoryShare(1)).tobytes() == frame.tobytes()


@pytest.mark.parametrize("tolerance", [0.002, 0.05])
@pytest.mark.parametrize("silhouette", [0.0, 0.5])
def test_a_face_has_the_light_of_its_plane(silhouette: float, tolerance: float) -> None:
    """An even block: its means have the ambient light alone, and so has the medium far behind the face."""
    normal, light, tau = np.array([0.6, 0.8, 1.0]) / np.sqrt(2), np.array([1.0, 2.0, 2.0]) / 3, -np.log(0.2)
    even = [{"value": value, "color": "white", "opacity": 0.8} for value in (0, 255)]
    stage = stage_of(
        [{"plane": {"point": [32, 32, 32], "normal": normal.tolist()}}],
        volume={"procedural": {"name": "constant", "shape": [64, 64, 64]}},
        transfer_function={"unit": 1, "points": even},
        shading={"ambient": 0.3, "diffuse": 0.6, "light": light.tolist(), "silhouette": silhouette},
        camera={"projection": "orthographic", "path": {"type": "turntable", "frames": 10, "elevation": 25}},
        error={"tolerance": tolerance},
    )
    across = normal @ view_of(stage, 3).axes[2]
    assert 0.3 < across < 0.9
    lit = (0.3 + 0.6 * normal @ light) * (1 - silhouette * (1 - across) ** 3)
    way = (np.arange(200_000) + 0.5) * 1e-4
    share = np.maximum(0, 1 - (way * across / 2.5) ** 2) ** 3
    expected = np.sum(tau * np.exp(-tau * way) * (0.3 + share * (lit - 0.3))) * 1e-4
    assert exact(stage, 0.25)[31, 35, :3] == pytest.approx(expected, abs=1e-6)
    assert drawn(stage)[28:34, 32:38, :3] == pytest.approx(expected, abs=max(2e-3, 0.3 * tolerance))


@pytest.mark.parametrize(
    "sections",
    [
        {"shading": GLOSSY | {"two_sided": True}},
        {"shading": {"light": [1, 2, 3], "occlusion": 0.5, "shadow": 0.4}},
        {"volume": None, "volumes": [BLOCK | {"shading": GLOSSY}, BLOCK], "transfer_function": None},
        {"volume": None, "volumes": [BLOCK, OTHER | {"clip": [CORNER]}], "transfer_function": None},
    ],
    ids=["of the view", "with shadows", "of two layers", "of two grids"],
)
def test_lit_faces(sections: dict[str, Any]) -> None:
    if "volumes" in sections:
        look = {"color": "#80c0ff", "range": [50, 255]}
        sections = sections | {"volumes": [look | each for each in sections["volumes"]]}
    stage = stage_of(CLIPS["overlapping boxes and planes"], **sections)
    frame = drawn(stage)
    assert decibels(drawn_by_single_rays(stage)[..., :3], exact(stage)[..., :3]) > 55
    assert decibels_of_means(stage) > 60
    assert drawn(stage, num_threads=1).tobytes() == frame.tobytes()


@pytest.mark.parametrize(
    "clip",
    [
        {"plane": {"point": [-9, 0, 0], "normal": [-1, 0, 0]}},
        {"box": [[-1, -1, 60], [90, 90, 90]]},
        {"box": [[-90, -90, -90], [90, 90, 90]], "invert": True},
    ],
)
def test_a_clip_beside_the_volume_changes_no_byte(clip: dict[str, Any]) -> None:
    assert drawn(stage_of([clip])).tobytes() == drawn(stage_of([])).tobytes()


def test_the_camera_stays_where_it_is() -> None:
    whole, clip = stage_of([]), stage_of(CLIPS["box"])
    assert (whole.target, whole.distance) == (clip.target, clip.distance)


def test_a_clip_that_is_fixed_to_the_camera_stays_before_it() -> None:
    """From the front and from the back, half of the pixels: what is left of the optical axis."""
    stage = stage_of([{"plane": {"point": [0, 0, 0], "normal": [-1, 0, 0]}, "fixed": "camera"}])
    for number in (0, 5):
        alpha = drawn(stage, number)[..., 3]
        assert not alpha[:, :34].any()
        assert alpha[:, 36:].any()
        assert view_of(stage, number).clip == stage.scene.clip


def test_a_clip_that_leaves_nothing_is_an_error() -> None:
    nothing = {"plane": {"point": [0, 0, -1], "normal": [0, 0, 1]}}
    with pytest.raises(SceneError) as caught:
        stage_of([PLANE, nothing, CORNER | {"box": [[-9, -9, -9], [90, 90, 90]]}])
    assert [(problem.path, problem.what) for problem in caught.value.problems] == [
        ("clip.1", "leaves nothing of the volume"),
        ("clip.2", "leaves nothing of the volume"),
    ]
