"""Names of labels: at places that stay, beside the object, with lines that end on the label and can be seen."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from renderer.annotation import (
    Annotator,
    FrameFacts,
    NamedLabel,
    annotation_problems,
    border_points,
    draw_annotation,
    film_facts,
    find_anchors,
    frame_facts,
    label_points,
    named_labels,
    ordered_names,
)
from renderer.draw import BrickRasterizer
from renderer.frame import FilmAnnotation, Stage, annotation_notes, prepare_stage, render_frames, view_of
from renderer.scene import FilmScene, parse_scene, scene_to_dict
from renderer.volume import make_volume

NAMES = {8: "first", 30: "second one", 64: "third", 120: "the fourth", 165: "fifth"}
# The steps to the six neighbours of a voxel.
SIX = [*np.eye(3, dtype=int), *-np.eye(3, dtype=int)]
COLORS = {8: "#ff0000", 30: "#00ff00", 64: "#0000ff", 120: "#ffff00", 165: "#ff00ff"}
FRAMES = range(0, 8, 3)


@cache
def stage_of(projection: str = "perspective") -> Stage:
    scene = scene_of(8)
    camera = scene_to_dict(scene)["camera"] | {"projection": projection}
    stage = prepare_stage(scene_of(8, camera=camera), clock=lambda: 0.0, num_threads=2)
    assert isinstance(stage, Stage)
    return stage


def scene_of(frames: int, **sections: Any) -> FilmScene:
    tree: dict[str, Any] = {
        "volume": {"procedural": {"name": "atlas", "shape": [48, 48, 48]}},
        "labels": {"show": list(NAMES), "names": NAMES, "colors": COLORS, "opacity": 1},
        "camera": {
            "target": "visible",
            "path": {"type": "turntable", "frames": frames, "start": 30, "elevation": 25},
        },
        "annotation": {"names": True, "title": "Names"},
        "error": {"tolerance": 0},
        "output": {"file": "{frame}.png", "size": [320, 240]},
    }
    return parse_scene({**tree, **sections}, base=Path())


def annotator_of(stage: Stage) -> Annotator:
    names = named_labels(stage.layers, label_points(stage.layers), stage.scene.camera.path, ["left", "right"])
    assert sorted(each.text for each in names) == sorted(NAMES.values())
    return Annotator(stage.scene.annotation, film_facts(stage.scene, stage.layers, stage.scene.output.kind, names))


def test_lines_end_where_their_label_is_seen_and_names_are_beside_the_object() -> None:
    for projection in ("perspective", "orthographic"):
        stage = stage_of(projection)
        names = named_labels(stage.layers, label_points(stage.layers), stage.scene.camera.path, ["left", "right"])
        places, num_found = annotator_of(stage).name_places, 0
        with BrickRasterizer(num_threads=2) as rasterizer:
            for frame in render_frames(stage, FRAMES, rasterizer, clock=lambda: 0.0):
                anchors = find_anchors(
                    names, label_points(stage.layers), stage.layers, view_of(stage, frame.number), 320
                )
                for each in names:
                    if (anchor := anchors.get((each.side, each.rank))) is not None:
                        column, row = map(int, anchor)
                        inner = [places[side, 0].inner for side in ("left", "right")]
                        assert inner[0] < column < inner[1]  # so that the line crosses no name
                        color, alpha = frame.radiance[row, column, :3], frame.radiance[row, column, 3]
                        assert alpha > 0.3 and np.abs(color / alpha - each.color).max() < 0.3, (frame.number, each.text)
                        num_found += 1
                for place in places.values():
                    box = frame.radiance[place.row :, place.column :, 3][: len(place.line), : place.line.shape[1]]
                    assert box.max() < 1 / 255
        assert num_found > 0.8 * len(FRAMES) * len(names)


def test_lines_have_the_colors_of_their_labels() -> None:
    stage = stage_of()
    names = named_labels(stage.layers, label_points(stage.layers), stage.scene.camera.path, ["left", "right"])
    annotator = annotator_of(stage)
    for each in names:
        place = annotator.name_places[each.side, each.rank]
        end = (160.0, place.start[1])  # a level line to the middle of the picture
        patches = annotator.patches(FrameFacts(anchors={(each.side, each.rank): end}))
        canvas = np.zeros((240, 320, 4), np.float32)
        draw_annotation(canvas, patches)
        row, column = round(end[1]), round((place.start[0] + end[0]) / 2)
        near, is_on = canvas[row - 2 : row + 3, column, :3], np.array(each.color) > 0.5
        assert (near[:, is_on].min(axis=1) - near[:, ~is_on].max(axis=1)).max() > 0.4, each.text


def test_names_stay_at_their_places_without_overlap_and_frames_come_in_any_order() -> None:
    stage, kind = stage_of(), stage_of().scene.output.kind
    boxes = [
        (p.row, p.column, p.row + len(p.line), p.column + p.line.shape[1])
        for p in annotator_of(stage).name_places.values()
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
    names = named_labels(stage.layers, label_points(stage.layers), stage.scene.camera.path, ["left", "right"])
    frame = frame_facts(stage.scene, stage.layers, view_of(stage, 0), 0, stage.scene.output.kind)
    for keys, names_shown, what in (
        ({"names": {"size": 0.2}}, names, "do not fit beside the object"),
        ({"names": True, "legend": True, "scale_bar": {"position": "right"}}, [], "have no side of the picture"),
        ({"names": True}, [], "nothing has a name"),
        ({"names": True, "accuracy": {"position": "bottom-left", "size": 0.3}}, names, None),
        ({"names": True, "accuracy": {"position": "bottom-right", "size": 0.42}}, names, "cover annotation.accuracy"),
        ({"names": True}, names, None),
    ):
        tree: dict[str, Any] = {"volume": {"procedural": {"name": "atlas", "shape": [8, 8, 8]}}, "labels": {}}
        tree |= {"camera": {"path": {"type": "turntable", "frames": 1}}, "output": {"file": "{frame}.png"}}
        tree["annotation"] = keys
        spec = parse_scene(tree, base=Path()).at(0).annotation
        facts = film_facts(stage.scene, stage.layers, stage.scene.output.kind, names_shown)
        problems = annotation_problems(spec, facts, [frame.with_accuracy(43.0)])
        found = [problem.what for problem in problems if problem.path == "annotation.names"]
        assert found == ([] if what is None else [what])
    assert not named_labels(stage.layers, label_points(stage.layers), stage.scene.camera.path, [])
    assert {
        each.side for each in named_labels(stage.layers, label_points(stage.layers), stage.scene.camera.path, ["right"])
    } == {"right"}


def test_a_note_says_that_long_names_leave_little_room() -> None:
    long = {number: f"{text} of all" for number, text in NAMES.items()}
    labels = {"show": list(NAMES), "names": long, "colors": COLORS, "opacity": 1}
    for sections, is_noted in (
        ({"labels": labels}, True),
        ({"labels": labels, "annotation": {"names": True, "layout": "over"}}, False),
        ({"labels": labels, "output": {"file": "{frame}.png", "size": [960, 240]}}, False),
        ({}, False),
    ):
        with prepare_stage(scene_of(1, **sections), clock=lambda: 0.0, num_threads=2) as stage:
            notes = [note for note in annotation_notes(stage) if "names take" in note]
        assert len(notes) == is_noted and all("wider output.size" in note for note in notes)


def test_each_label_has_points_on_its_border_even_one_voxel_of_many() -> None:
    values = np.zeros((40, 200, 200), np.uint16)
    values[5:30, 20:90, 20:90], values[35, 150, 160], values[-1, :, :3] = 1, 2, 4
    volume = make_volume(values, np.diag([2.0, 1.0, 1.0, 1.0]), "labels")
    points = border_points(volume, 4)
    assert [len(each) for each in points] == [96, 1, 0, 96]
    padded = np.pad(values, 1)
    for label, each in enumerate(points, 1):
        x, y, z = np.rint(each / (2.0, 1.0, 1.0)).astype(int).T
        assert len({*zip(x, y, z, strict=True)}) == len(each) and (values[z, y, x] == label).all()
        around = [padded[1 + z + k, 1 + y + j, 1 + x + i] for k, j, i in SIX]
        assert np.any([near != label for near in around], axis=0).all()


def test_names_are_ordered_so_that_lines_cross_less() -> None:
    stage = stage_of()
    points = label_points(stage.layers)
    names = named_labels(stage.layers, points, stage.scene.camera.path, ["left", "right"])
    by_height = sorted(names, key=lambda each: points[0][each.number - 1][:, 2].mean(), reverse=True)
    plain = [each._replace(side=("left", "right")[k % 2], rank=k // 2) for k, each in enumerate(by_height)]

    def places_of(named: list[NamedLabel]) -> Any:
        facts = film_facts(stage.scene, stage.layers, stage.scene.output.kind, sorted(named, key=lambda e: e.rank))
        return Annotator(stage.scene.annotation, facts).name_places

    def crossings(named: list[NamedLabel], frames: Iterable[int] = range(8)) -> int:
        places, found = places_of(named), 0
        for frame in frames:
            ends = find_anchors(named, points, stage.layers, view_of(stage, frame), 320)
            lines = [(complex(places[k].inner, places[k].row + 5), complex(*end)) for k, end in ends.items()]
            found += sum(_cross(a, b) for a, b in combinations(lines, 2))
        return found

    assert crossings(names) < crossings(plain)
    starts = {key: (place.start[0] / 240, place.start[1] / 240) for key, place in places_of(names).items()}
    last = {side: max(each.rank for each in names if each.side == side) for side in ("left", "right")}
    upside_down = [each._replace(rank=last[each.side] - each.rank) for each in names]
    stills = [ordered_names(upside_down, starts, points, stage.layers, [view_of(stage, k)]) for k in range(8)]
    found = sum(crossings(each, [k]) for k, each in enumerate(stills))
    assert found <= crossings(names) and found < crossings(upside_down)
    assert {(each.text, each.side) for each in stills[0]} == {(each.text, each.side) for each in names}


def _cross(one: tuple[complex, complex], other: tuple[complex, complex]) -> bool:
    def parts(line: tuple[complex, complex], points: tuple[complex, complex]) -> bool:
        sides = [((line[1] - line[0]).conjugate() * (each - line[0])).imag for each in points]
        return sides[0] * sides[1] < 0

    return parts(one, other) and parts(other, one)


def test_ends_of_lines_move_evenly_and_clipped_labels_have_none() -> None:
    plane = {"plane": {"point": [0, 0, 24], "normal": [0, 0, 1]}}
    for clip, shown in (([], set(NAMES.values())), ([plane], {"first", "second one"})):
        stage = prepare_stage(scene_of(240, clip=clip), clock=lambda: 0.0, num_threads=2)
        points = label_points(stage.layers)
        names = named_labels(stage.layers, points, stage.scene.at(0).camera.path, ["left", "right"])
        ends = [find_anchors(names, points, stage.layers, view_of(stage, frame), 320) for frame in range(9)]
        texts = {(each.side, each.rank): each.text for each in names}
        always = [key for key in ends[0] if all(key in each for each in ends)]
        assert {texts[key] for each in ends for key in each} <= shown and len(always) >= len(shown) - 1
        places = np.array([[each[key] for key in always] for each in ends])
        assert np.abs(np.diff(places, n=2, axis=0)).max() < 0.5
