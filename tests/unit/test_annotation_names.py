"""Names of labels: at places that stay, beside the object, with lines that end on the label and can be seen."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from renderer.annotation import Annotator, annotation_problems, film_facts, find_anchors, frame_facts, named_labels
from renderer.draw import BrickRasterizer
from renderer.frame import FilmAnnotation, Stage, prepare_stage, render_frames, view_of
from renderer.scene import parse_scene

NAMES = {8: "first", 30: "second one", 64: "third", 120: "the fourth", 165: "fifth"}
COLORS = {8: "#ff0000", 30: "#00ff00", 64: "#0000ff", 120: "#ffff00", 165: "#ff00ff"}
FRAMES = range(0, 8, 3)


@cache
def stage_of(projection: str = "perspective") -> Stage:
    tree: dict[str, Any] = {
        "volume": {"procedural": {"name": "atlas", "shape": [48, 48, 48]}},
        "labels": {"show": list(NAMES), "names": NAMES, "colors": COLORS, "opacity": 1},
        "camera": {
            "target": "visible",
            "projection": projection,
            "path": {"type": "turntable", "frames": 8, "start": 30, "elevation": 25},
        },
        "annotation": {"names": True, "title": "Names"},
        "error": {"tolerance": 0},
        "output": {"file": "{frame}.png", "size": [320, 240]},
    }
    stage = prepare_stage(parse_scene(tree, base=Path()), clock=lambda: 0.0, num_threads=2)
    assert isinstance(stage, Stage)
    return stage


def annotator_of(stage: Stage) -> Annotator:
    names = named_labels(stage.layers, stage.scene.camera.path, ["left", "right"])
    assert sorted(each.text for each in names) == sorted(NAMES.values())
    return Annotator(stage.scene.annotation, film_facts(stage.scene, stage.layers, stage.scene.output.kind, names))


def test_lines_end_where_their_label_is_seen_and_names_are_beside_the_object() -> None:
    for projection in ("perspective", "orthographic"):
        stage = stage_of(projection)
        names = named_labels(stage.layers, stage.scene.camera.path, ["left", "right"])
        places, num_found = annotator_of(stage).name_places(), 0
        with BrickRasterizer(num_threads=2) as rasterizer:
            for frame in render_frames(stage, FRAMES, rasterizer, clock=lambda: 0.0):
                anchors = find_anchors(names, stage.layers, view_of(stage, frame.number), 320)
                for each in names:
                    if (anchor := anchors.get((each.side, each.rank))) is not None:
                        column, row = map(int, anchor)
                        color, alpha = frame.radiance[row, column, :3], frame.radiance[row, column, 3]
                        assert alpha > 0.3 and np.abs(color / alpha - each.color).max() < 0.3, (frame.number, each.text)
                        num_found += 1
                for place in places.values():
                    box = frame.radiance[place.row :, place.column :, 3][: len(place.line), : place.line.shape[1]]
                    assert box.max() < 1 / 255
        assert num_found > 0.8 * len(FRAMES) * len(names)


def test_names_stay_at_their_places_without_overlap_and_frames_come_in_any_order() -> None:
    stage, kind = stage_of(), stage_of().scene.output.kind
    boxes = [
        (p.row, p.column, p.row + len(p.line), p.column + p.line.shape[1])
        for p in annotator_of(stage).name_places().values()
    ]
    for number, (top, left, bottom, right) in enumerate(boxes):
        assert top >= 0 and left >= 0 and bottom <= 240 and right <= 320
        assert not any(top < b[2] and b[0] < bottom and left < b[3] and b[1] < right for b in boxes[:number])

    def drawn(painter: FilmAnnotation, frame: int) -> np.ndarray:
        canvas = np.zeros((240, 320, 4), np.float32)
        painter.draw(canvas, kind, stage, frame, None)
        return canvas

    one, other = FilmAnnotation(stage), FilmAnnotation(stage)
    forward = [drawn(one, frame) for frame in FRAMES]
    backward = [drawn(other, frame) for frame in reversed(FRAMES)][::-1]
    np.testing.assert_array_equal(forward, backward)
    assert (forward[0] != forward[1]).any()


def test_names_without_room_or_side_or_labels_are_told() -> None:
    stage = stage_of()
    names = named_labels(stage.layers, stage.scene.camera.path, ["left", "right"])
    frame = frame_facts(stage.scene, stage.layers, view_of(stage, 0), 0, stage.scene.output.kind)
    for keys, names_shown, what in (
        ({"names": {"size": 0.2}}, names, "do not fit beside the object"),
        ({"names": True, "legend": True, "scale_bar": {"position": "right"}}, [], "have no side of the picture"),
        ({"names": True}, [], "nothing has a name"),
        ({"names": True, "accuracy": {"position": "bottom-left", "size": 0.3}}, names, "cover annotation.accuracy"),
        ({"names": True}, names, None),
    ):
        tree = {"volume": {"procedural": {"name": "atlas", "shape": [8, 8, 8]}}, "labels": {}, "annotation": keys}
        tree |= {"camera": {"path": {"type": "turntable", "frames": 1}}, "output": {"file": "{frame}.png"}}
        spec = parse_scene(tree, base=Path()).at(0).annotation
        facts = film_facts(stage.scene, stage.layers, stage.scene.output.kind, names_shown)
        problems = annotation_problems(spec, facts, [frame.with_accuracy(43.0)])
        found = [problem.what for problem in problems if problem.path == "annotation.names"]
        assert found == ([] if what is None else [what])
    assert not named_labels(stage.layers, stage.scene.camera.path, [])
    assert {each.side for each in named_labels(stage.layers, stage.scene.camera.path, ["right"])} == {"right"}
