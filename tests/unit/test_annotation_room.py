"""The object is framed into the room that the annotation leaves, on every frame and for all outputs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from film_stages import PLAIN

from renderer.annotation import AnnotationFacts, Annotator, Box, FrameFacts, free_rooms, taken_boxes
from renderer.draw import BrickRasterizer
from renderer.errors import SceneError
from renderer.frame import FilmAnnotation, FilmStage, prepare_stage, render_frames
from renderer.scene import FilmScene, parse_scene, scene_to_dict

ALL = {"title": "Engine block", "time": True, "color_bar": True, "scale_bar": True, "orientation": True}
CAMERA = {"path": {"type": "turntable", "frames": 5, "elevation": 20}}
# Scenes by name: their annotation, and other sections.
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "all": (ALL, {}),
    "one bar": ({"color_bar": {"position": "left", "length": 0.5}}, {}),
    "orthographic": (ALL, {"camera": CAMERA | {"projection": "orthographic"}}),
    "upright": (ALL, {"output": {"file": "{frame}.png", "size": [240, 420]}}),
    "a small second file": (
        {"title": "Engine block", "scale_bar": True, "accuracy": True},
        {"output": [{"file": "{frame}.png", "size": [320, 240]}, {"file": "small.webp", "size": [160, 120]}]},
    ),
}


def scene_of(annotation: dict[str, Any], **sections: Any) -> FilmScene:
    tree = scene_to_dict(PLAIN) | {"camera": CAMERA, "output": {"file": "{frame}.png", "size": [320, 240]}}
    return parse_scene(tree | {"annotation": annotation} | sections, base=Path())


def stage_of(annotation: dict[str, Any], **sections: Any) -> FilmStage:
    return prepare_stage(scene_of(annotation, **sections), clock=lambda: 0.0, num_threads=2)


def touched(stage: FilmStage) -> float:
    """Return the largest alpha of the object under an entry of the annotation, on all frames and in all outputs."""
    painter, most = FilmAnnotation(stage), 0.0
    with BrickRasterizer(num_threads=2) as rasterizer:
        for frame in render_frames(stage, range(stage.scene.num_frames), rasterizer, clock=lambda: 0.0):
            alpha = frame.radiance[..., 3]
            assert alpha.max() > 0.3
            for kind in stage.scene.output.kinds:
                canvas = np.zeros((kind.size[1], kind.size[0], 4), np.float32)
                painter.draw(canvas, kind, frame.stage, frame.number, 43.21)
                factor = alpha.shape[0] // kind.size[1]
                most = max(most, float(alpha[np.kron(canvas[..., 3] > 0, np.ones((factor, factor), bool))].max()))
    return most


@pytest.mark.parametrize("name", CASES)
def test_no_entry_touches_the_object(name: str) -> None:
    annotation, sections = CASES[name]
    stage = stage_of(annotation, **sections)
    assert touched(stage) < 1 / 255
    over = stage_of(annotation | {"layout": "over"}, **sections)
    assert over.distance < stage.distance and over.shift == (0.0, 0.0)


def test_what_the_scene_says_of_the_camera_is_kept() -> None:
    for camera in ({"distance": 90.0}, {"distance": 90.0, "target": [15, 14, 9]}):
        stage = stage_of(ALL, camera=CAMERA | camera)
        assert (stage.distance, stage.shift) == (90.0, (0.0, 0.0))
    aside = stage_of(ALL, camera=CAMERA | {"shift": [0.2, 0.1]})
    assert aside.shift == (0.2, 0.1) and aside.distance > stage_of({}).distance
    key = {"position": [15, -90, 9], "target": [15, 14, 9]}
    flight = stage_of(ALL, camera={"path": {"type": "flight", "frames": 2, "keys": [key]}})
    assert flight.shift == (0.0, 0.0)
    plain = stage_of({"octree": True})
    assert (plain.distance, plain.shift) == (stage_of({}).distance, (0.0, 0.0))


def test_rooms_are_free_and_as_large_as_possible() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        low = rng.uniform(0, 0.9, (4, 2))
        boxes = [Box(*each, *(each + rng.uniform(0.05, 0.2, 2))) for each in low]
        rooms = free_rooms(boxes, (400, 300))
        for room in rooms:
            assert all(
                box.right + 0.014 < room.left or room.right < box.left - 0.014
                or box.bottom + 0.019 < room.top or room.bottom < box.top - 0.019
                for box in boxes
            )  # fmt: skip
            assert min(room.shares) >= 0.25
        widths, heights = zip(*(room.shares for room in rooms), strict=True) if rooms else ((), ())
        assert list(widths) == sorted(widths, reverse=True) and list(heights) == sorted(heights)
    assert free_rooms([], (40, 30)) == [(0.0, 0.0, 1.0, 1.0)]
    (room,) = free_rooms([Box(0.0, 0.0, 1.0, 0.1)], (100, 100))
    assert room == pytest.approx((0.0, 0.12, 1.0, 1.0)) and room.shift == pytest.approx((0.0, -0.06))


def test_an_annotation_without_room_for_the_object_is_an_error() -> None:
    with pytest.raises(SceneError) as caught:
        stage_of({"title": {"text": "Wide", "size": 0.45}, "time": {"position": "bottom", "size": 0.3}})
    (problem,) = caught.value.problems
    assert problem.path == "annotation" and "no room" in problem.what and "layout: over" in (problem.hint or "")


def test_the_room_is_free_of_the_widest_entries_of_all_frames() -> None:
    spec = scene_of({"time": "{seconds:.3g} s", "scale_bar": True}).at(0).annotation
    facts = AnnotationFacts((320, 240))
    frames = [FrameFacts(k, k / 3, world_per_pixel=0.01 + 0.001 * k) for k in range(40)]
    annotator, boxes = Annotator(spec, facts), taken_boxes(spec, facts, frames)
    assert annotator.widest("time", frames).frame == 1  # 0.333 s
    for key in ("time", "scale_bar"):
        widths = [annotator.sketch(key, frame).width for frame in frames]
        assert max(widths) == round(320 * (boxes[key].right - boxes[key].left)) > min(widths)
