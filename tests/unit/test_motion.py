"""Maps from frames to values: what they are at each frame, and what is refused."""

from __future__ import annotations

import copy
import json
import math
import pickle
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.errors import SceneError
from renderer.scene import (
    EASINGS,
    FilmScene,
    Motion,
    MotionKind,
    OverFrames,
    moving,
    moving_result,
    parse_scene,
    read_frame,
    scene_to_dict,
    value_at,
    values_at,
)

NUM_FRAMES, AXIS = 60, [1, 0, 0]
PLAIN: dict[str, Any] = {
    "volume": {"procedural": {"name": "constant", "shape": [9, 9, 9]}},
    "transfer_function": {"points": [{"value": 0, "color": "black", "opacity": 0}, {"value": 1, "color": "white"}]},
    "camera": {"path": {"type": "turntable", "frames": NUM_FRAMES}},
    "output": {"file": "a.mp4"},
}
PLAIN["transfer_function"]["points"][1]["opacity"] = 0.5


def parse(tree: object) -> FilmScene:
    return parse_scene(tree, base=Path(__file__).parent)


def changed(path: str, value: object) -> dict[str, Any]:
    """The plain scene with another value at a dotted path."""
    tree = copy.deepcopy(PLAIN)
    parent: Any = tree
    *keys, last = path.split(".")
    for key in keys:
        parent = parent[int(key)] if isinstance(parent, list) else parent.setdefault(key, {})
    parent[last] = value
    return tree


def value_in(scene: object, path: str) -> Any:
    for name in path.split("."):
        scene = scene[int(name)] if isinstance(scene, tuple) else getattr(scene, name)
    return scene


# Between keys


@pytest.mark.parametrize("kind", ["linear", "ratio"])
@pytest.mark.parametrize("easing", EASINGS)
def test_keys_are_exact_and_values_stay_between_them(kind: MotionKind, easing: Any) -> None:
    values = (0.1, 1 / 3, 1 / 3, 7.0, 2.0)
    motion = Motion((2, 5, 9, 10, 30), values, easing, kind)
    assert [motion.at(frame) for frame in motion.frames] == [*values]
    assert (motion.at(0), motion.at(99)) == (0.1, 2.0)
    assert {motion.at(frame) for frame in range(5, 10)} == {1 / 3}
    rising, falling = ([motion.at(frame) for frame in part] for part in (range(2, 11), range(10, 31)))
    assert (rising, falling) == (sorted(rising), sorted(falling, reverse=True))


@pytest.mark.parametrize(
    ("easing", "way"), [("linear", 0.25), ("smooth", 0.15625), ("in", 0.0625), ("out", 0.4375), ("hold", 0.0)]
)
def test_a_quarter_of_the_way(easing: Any, way: float) -> None:
    assert Motion((0, 8), (1.0, 3.0), easing).at(2) == pytest.approx(1 + 2 * way)
    assert Motion((0, 8), (0.01, 100.0), easing, "ratio").at(2) == pytest.approx(0.01 * 10 ** (4 * way))
    found = Motion((0, 8), ((1.0, 0.0, 0.0), (0.0, 0.0, 2.0)), easing, "direction").at(2)
    assert found == pytest.approx((math.cos(math.pi / 2 * way), 0.0, math.sin(math.pi / 2 * way)))


def test_smooth_motion_has_no_jump_in_its_velocity() -> None:
    motion = Motion((0, 10, 40, 50), (0.0, 4.0, 5.0, 9.0), "smooth")
    for key in (0, 10, 40, 50):
        before, at, after = (motion.at(key + step) for step in (-1e-5, 0.0, 1e-5))
        assert (after - at) == pytest.approx(at - before, abs=1e-9)


def test_directions_keep_to_the_sphere_and_turn_evenly() -> None:
    for end in ((0.0, 3.0, 4.0), (-1.0, 0.0, 0.0), (1.0, 1e-12, 0.0)):
        motion = Motion((0, 90), ((1.0, 0.0, 0.0), end), kind="direction")
        found = np.array([motion.at(frame) for frame in range(91)][:-1])
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-15)
        steps = np.linalg.norm(np.diff(found, axis=0), axis=1)
        np.testing.assert_allclose(steps, steps.mean(), atol=1e-12)


def test_whole_numbers_stay_whole() -> None:
    assert [Motion((0, 4), (0, 2)).at(frame) for frame in range(5)] == [0, 1, 1, 2, 2]
    assert [Motion((0, 2), (100, 400), kind="ratio").at(frame) for frame in range(3)] == [100, 200, 400]
    assert isinstance(Motion((0, 4), (0, 3)).at(1), int)


def test_a_value_over_frames_is_read_at_a_frame() -> None:
    for values in ((1.0, 3.0), (1, 3), ((1.0, (2, 3)), (2.0, (3, 4)))):
        motion = Motion((0, 8), values)
        found = OverFrames((moving(motion), 7.0))
        assert (found.at(0), found.at(8)) == ((values[0], 7.0), (values[1], 7.0))
        assert found.motions == [motion] and found.key_frames == [0, 8]
        assert found == OverFrames((motion, 7.0)) != OverFrames((Motion((0, 9), values), 7.0))
        assert pickle.loads(pickle.dumps(found)) == found
        assert found.map(itemgetter(0)).moves and not found.map(itemgetter(1)).moves
    assert moving(Motion((0, 8), (1.0, 1.0))) == 1.0


def test_what_is_made_of_moving_values_moves() -> None:
    a, b = moving(Motion((0, 10), (0.0, 10.0), "smooth")), moving(Motion((5, 9), (1.0, 3.0)))
    once = moving_result(lambda x, y: (x + y, 1.0), a, 2.0)
    assert [values_at(once, frame) for frame in (0, 3, 10)] == [(values_at(a, frame) + 2, 1) for frame in (0, 3, 10)]
    product = moving_result(lambda x, y: (x * y,), a, b)
    assert [values_at(product, frame) for frame in range(12)] == [
        (values_at(a, frame) * values_at(b, frame),) for frame in range(12)
    ]


# In scenes

MOVES: list[tuple[str, str, Any, Any]] = [
    ("clip", "clip.0.plane.point", [{"plane": {"point": {0: [8, 3, 6], 40: [0, 3, 6]}, "normal": AXIS}}], (6, 3, 6)),
    ("clip", "clip.0.box.1.2", [{"box": {0: [[0, 0, 0], [1, 1, 1]], 20: [[0, 0, 0], [9, 9, 9]]}}], 5.0),
    ("clip", "clip.0.box.1.2", [{"box": [[0, 0, 0], [1, 1, {0: 1, 20: 9}]]}], 5.0),
    ("transfer_function.points.1.opacity", "layers.0.transfer_function.mapping.1.opacity", {0: 0.1, 20: 0.3}, 0.2),
    (
        "transfer_function.points.1.color",
        "layers.0.transfer_function.mapping.1.color",
        {0: "red", 20: "lime"},
        (0.5, 0.5, 0),
    ),
    ("transfer_function.unit", "layers.0.transfer_function.unit", {0: 0.1, 20: 10}, 1.0),
    ("shading.light", "layers.0.shading.light", {0: [1, 0, 0], 20: [0, 9, 0]}, (0.5**0.5, 0.5**0.5, 0.0)),
    ("shading.specular", "layers.0.shading.specular", {0: 0, 20: 1}, 0.5),
    ("volume.crop", "layers.0.volume.crop.0", {"x": {0: [0, 9], 20: [0, 2]}}, (0, 6)),
    ("volume.crop", "layers.0.volume.crop.0", {0: [[0, 9], [0, 9], [0, 9]], 20: [[0, 2], [0, 9], [0, 9]]}, (0, 6)),
    ("output.background", "output.background", {0: "black", 20: "white"}, (0.5, 0.5, 0.5)),
    ("camera.field_of_view", "camera.field_of_view", {0: 10, 20: 30}, 20.0),
    ("camera.target", "camera.target", {0: [0, 0, 0], 20: [2, 4, 6]}, (1.0, 2.0, 3.0)),
    ("camera.distance", "camera.distance", {0: 1, 20: 100}, 10.0),
    ("camera.path.elevation", "camera.path.elevation", {0: 0, 20: 60}, 30.0),
    ("error.tolerance", "error.tolerance", {0: 0.01, 20: 1}, 0.1),
    ("mode", "mode.zero", {"type": "attenuation", "scale": 1, "zero": {0: 0, 20: 1}}, 0.5),
]


@pytest.mark.parametrize(("path", "name", "value", "expected"), MOVES, ids=[name for _, name, _, _ in MOVES])
def test_numbers_move(path: str, name: str, value: object, expected: object) -> None:
    tree = changed(path, value)
    scene = parse(tree)
    assert value_at(value_in(scene.at(10), name), 10) == pytest.approx(expected)
    assert scene.at(99) == scene.at(59)
    assert scene.at(99) != scene or path == "error.tolerance"
    assert scene.moves == (path != "error.tolerance")
    plain = scene_to_dict(scene)
    assert parse(plain) == parse(json.loads(json.dumps(plain))) == scene
    assert parse(scene_to_dict(scene.at(10))) == scene.at(10)


def test_a_still_scene_is_the_same_at_every_frame() -> None:
    scene = parse(PLAIN)
    assert scene.at(7) is scene and not scene.moves and scene.key_frames == []


def test_frames_from_the_end_and_in_seconds() -> None:
    written = {0: 0.0, "0.5s": 0.2, "1.0s": 0.3, "-21": 0.4, -1: 1.0, "easing": "in"}
    scene = parse(changed("transfer_function.points.1.opacity", written))
    look = scene.map(lambda each: each.layers[0].transfer_function.points)
    assert look.motions == [Motion((0, 15, 30, 39, 59), (0.0, 0.2, 0.3, 0.4, 1.0), "in")]
    scene = parse(changed("camera", {"path": {"type": "turntable", "seconds": 2}, "near": {0: 0, "2s": 1}}))
    assert scene.num_frames == 60
    assert scene.map(lambda each: each.camera.near).motions == [Motion((0, 59), (0.0, 1.0))]


def test_an_imported_transfer_function_is_shifted() -> None:
    look = {"import": "ct-bone", "shift": {0: 0, 10: 100, "easing": "smooth"}}
    scene = parse(changed("transfer_function", look))
    for frame in (0, 3, 10):
        shifted = parse(changed("transfer_function", look | {"shift": values_at(scene_shift(look), frame)}))
        found, expected = (each.layers[0].transfer_function.points for each in (scene.at(frame), shifted))
        assert [point.value for point in found] == pytest.approx([point.value for point in expected])
        assert [point.color for point in found] == [point.color for point in expected]
    assert parse(scene_to_dict(scene)) == scene


def scene_shift(look: dict[str, Any]) -> Any:
    return moving(Motion((0, 10), (0.0, 100.0), look["shift"]["easing"]))


def test_a_fade_from_nothing() -> None:
    points = PLAIN["transfer_function"]["points"]
    hidden = [point | {"opacity": 0} for point in points]
    scene = parse(changed("transfer_function.points", {0: hidden, 30: points}))
    assert scene.at(15).layers[0].transfer_function.points[1].opacity == 0.25


# What is refused

WRONG: list[tuple[str, Any, str, str]] = [
    ("camera.near", {5: 1, 3: 2}, "camera.near.3", "frames out of order"),
    ("camera.near", {0: 1, 60: 2}, "camera.near.60", "after the last frame"),
    ("camera.near", {-61: 1}, "camera.near.-61", "before the first frame"),
    ("camera.near", {0: 1, "2.5s": 2}, "camera.near.2.5s", "after the end of the film"),
    ("camera.near", {0: 1, "end": 2}, "camera.near.end", "not a frame"),
    ("camera.near", {0: 1, 1.5: 2}, "camera.near.1.5", "not a frame"),
    ("camera.near", {0: 1, 9: 2, "easing": "smoth"}, "camera.near.easing", "unknown easing"),
    ("camera.near", {0: 1, 9: -1}, "camera.near.9", "out of range"),
    ("camera.near", {0: 1, 9: {0: 1}}, "camera.near.9", "not a number"),
    ("camera.target", {0: "visible", 9: [1, 2, 3]}, "camera.target.9", "cannot move to a value of another kind"),
    ("output.background", {0: "red", 9: "transparent"}, "output.background.9",
     "cannot move to a value of another kind"),
    ("error.tolerance", {0: 0, 9: 1}, "error.tolerance.0",
     "0 in a map from frames, with frames between it and another"),
    ("output.size", {0: [2, 2], 9: [4, 4]}, "output.size", "cannot move"),
    ("output.file", {0: "a.mp4", 9: "b.mp4"}, "output.file", "cannot move"),
    ("camera.follow", True, "camera.follow", "needs target: visible"),
    ("clip", [{"plane": {"point": AXIS, "normal": [{0: 1, 9: -1}, 0, 0]}}], "clip.0.plane.normal.0", "cannot move"),
    ("mask", {"file": __file__, "transform": {0: np.eye(4).tolist(), 10: np.diag([-1, -1, 1, 1]).tolist()}},
     "mask.transform", "at frame 5: flat: it leaves the volume no depth"),
    ("splat.footprint", {0: "integrated"}, "splat.footprint", "cannot move"),
    ("volume.procedural.seed", {0: 1, 9: 2}, "volume.procedural.seed", "cannot move"),
    ("clip", [{"box": {0: [[0, 0, 0], [9, 9, 9]], 9: [[0, 0, 9], [9, 9, 9]]}}], "clip.0.box.9.1.2", "an empty box"),
    ("clip", [{"box": [[0, 0, {0: 0, 9: 9}], [9, 9, 9]]}], "clip.0.box.1.2", "at frame 9: an empty box"),
    ("transfer_function.points.0.value", {0: 0, 9: 2}, "transfer_function.points.1.value",
     "at frame 9: points out of order"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "where", "what"), WRONG, ids=[f"{each[0]} {each[3]}" for each in WRONG])
def test_maps_that_cannot_be(path: str, value: object, where: str, what: str) -> None:
    with pytest.raises(SceneError) as caught:
        parse(changed(path, value))
    assert [(problem.path, problem.what) for problem in caught.value.problems] == [(where, what)]
    if what == "cannot move":
        assert "docs/motion.md" in str(caught.value.problems[0].hint)


def test_the_keys_of_a_motion_are_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many frames a scene is looked at: films by programs have a key a frame."""
    read = list[object]()
    monkeypatch.setattr("renderer.scene.tree_node.read_frame", lambda node: read.append(node.value) or read_frame(node))
    path = "transfer_function.points.1.opacity"
    keys = {frame: 0.1 + frame % 7 / 10 for frame in range(NUM_FRAMES)}
    scene = parse(changed(path, keys))
    assert read == [*keys]
    assert value_in(scene.at(8), f"layers.0.{path}") == keys[8]
