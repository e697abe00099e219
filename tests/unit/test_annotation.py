"""Annotations: the same bytes everywhere, each entry in its place, and an error where an entry cannot be drawn."""

from __future__ import annotations

import colorsys
import math
import re
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from film_stages import PLAIN
from PIL import Image

from renderer.annotation import (
    AnnotationFacts,
    Annotator,
    ColorBar,
    Font,
    FrameFacts,
    annotation_problems,
    draw_annotation,
    film_facts,
    find_ticks,
    length_text,
    plain_text,
)
from renderer.errors import SceneError
from renderer.film import bytes_digest
from renderer.frame import Stage, prepare_stage
from renderer.scene import (
    AnnotationSpec,
    ColorBarSpec,
    EntrySpec,
    FilmScene,
    Motion,
    TimeSpec,
    TitleSpec,
    fill_format,
    moving,
    parse_scene,
    scene_to_dict,
)

SAMPLES = [index / 255 for index in range(256)]
BARS = (
    ColorBar("density", "HU", -1000, 2500, tuple((s, s * s, 0.3 + 0.4 * s) for s in SAMPLES), tuple(SAMPLES)),
    ColorBar(
        "speed", "m/s", 0.02, 350, tuple(colorsys.hsv_to_rgb(0.7 * (1 - s), 0.8, 0.9) for s in SAMPLES),
        tuple(0.5 + 0.5 * math.sin(9 * s) for s in SAMPLES), 1, True,
    ),
)  # fmt: skip
LEGEND = (("left kidney", (0.8, 0.3, 0.2)), ("liver", (0.6, 0.4, 0.1)), ("vertebra L5", (0.9, 0.9, 0.7)))
ALL = AnnotationSpec(
    title=TitleSpec(position="top", size=0.04, text="Abdomen, portal phase"),
    time=TimeSpec(position="top-right", size=0.03),
    legend=EntrySpec(position="left", size=0.03),
    color_bar=ColorBarSpec(position="right", size=0.03),
    scale_bar=EntrySpec(position="bottom-left", size=0.03),
    accuracy=EntrySpec(position="bottom", size=0.03),
    orientation=EntrySpec(position="bottom-right", size=0.12),
)


def axes_of(azimuth: float, elevation: float) -> tuple[tuple[float, float, float], ...]:
    """Return the axes of a view: right, up and backward, at angles in degrees."""
    a, e = math.radians(azimuth), math.radians(elevation)
    right, back = (-math.sin(a), math.cos(a), 0.0), (math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e))
    return right, tuple(np.cross(back, right).tolist()), back


FACTS = AnnotationFacts((640, 480), unit="mm", world_axes="LPS", bars=BARS, legend=LEGEND)
FRAME = FrameFacts(12, 0.4, accuracy="47.3 dB", world_per_pixel=0.35, axes=axes_of(35, 25))
WHITE = ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))


def annotation(scene: FilmScene = PLAIN, **keys: Any) -> AnnotationSpec:
    """The annotation that a scene with these keys has."""
    return parse_scene(scene_to_dict(scene) | {"annotation": keys}, base=Path()).at(0).annotation


def drawn(spec: AnnotationSpec, facts: AnnotationFacts = FACTS, frame: FrameFacts = FRAME) -> np.ndarray:
    """Return an annotation that is drawn over nothing."""
    image = np.zeros((facts.size[1], facts.size[0], 4), np.float32)
    draw_annotation(image, Annotator(spec, facts).patches(frame))
    return image


def box(image: np.ndarray) -> tuple[int, ...]:
    """The first and the last row and column of what is opaque."""
    rows, columns = (np.flatnonzero((image[..., 3] > 0.99).any(axis=axis)) for axis in (1, 0))
    return rows[0], rows[-1], columns[0], columns[-1]


@pytest.mark.parametrize(
    ("px", "digest"), [(9, "28228e4f83a715b1"), (16, "6ca2efe0c0f84b94"), (41, "1dd131ce7a4f592e")]
)
def test_text_has_the_same_bytes_everywhere(px: int, digest: str) -> None:
    mask = Font(None).line("Ävg. AV 50 µm <b>&amp;\\n {frame}", px).mask
    assert bytes_digest(mask.tobytes() + repr(mask.shape).encode())[:16] == digest


@pytest.mark.parametrize("is_light", [False, True])
@pytest.mark.parametrize("key", ALL.entries)
def test_each_entry_is_in_its_place_and_readable(key: str, is_light: bool) -> None:
    facts = replace(FACTS, background=WHITE) if is_light else FACTS
    image = drawn(AnnotationSpec(**{key: getattr(ALL, key)}), facts)
    top, bottom, left, right = box(image)
    margin, position, slack = round(0.04 * 480), ALL.entries[key].position, 30 if key == "orientation" else 14
    assert (margin <= top <= margin + slack) == position.startswith("top")
    assert (479 - margin - slack <= bottom <= 479 - margin) == position.startswith("bottom")
    assert (margin <= left <= margin + slack) == position.endswith("left")
    assert (639 - margin - slack <= right <= 639 - margin) == position.endswith("right")
    extreme = (image[..., :3].min(axis=2) > 0.99) if not is_light else (image[..., :3].max(axis=2) < 0.01)
    assert key == "orientation" or (extreme & (image[..., 3] > 0.99)).any()
    assert (image[..., 3] >= image[..., :3].max(axis=2)).all() and image.max() <= 1


def test_entries_stack_away_from_the_edge_in_the_order_of_the_keys() -> None:
    for position in ("top-left", "bottom-right"):
        keys = {key: {"position": position} for key in ("time", "scale_bar", "accuracy")}
        boxes = [box(drawn(annotation(**{key: entry}))) for key, entry in keys.items()]
        rows = box(drawn(annotation(**keys)))
        assert rows[1] - rows[0] > sum(bottom - top for top, bottom, *_ in boxes)
        annotator = Annotator(annotation(**keys), FACTS)
        places = annotator.places({key: annotator.sketch(key, FRAME) for key in keys})
        first, second, third = (places[key][0] for key in keys)
        assert first < second < third if position == "top-left" else first > second > third


def test_only_what_changes_is_drawn_again() -> None:
    annotator = Annotator(ALL, FACTS)
    before, after = annotator.patches(FRAME), annotator.patches(replace(FRAME, seconds=0.5))
    assert [old is new for old, new in zip(before, after, strict=True)].count(False) == 1
    image = np.full((480, 640, 4), 0.5, np.float32)
    draw_annotation(image, before[:1])
    (rgba, row, column) = before[0]
    image[row : row + rgba.shape[0], column : column + rgba.shape[1]] = 0.5
    assert (image == 0.5).all()


def test_arrows_point_where_the_letters_say() -> None:
    """From the front of a patient, in LPS: the right side is on the left, and the head is above."""
    facing = replace(FRAME, axes=((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)))
    image = drawn(annotation(orientation={"size": 0.4}), frame=facing)
    red, blue = (np.argwhere((image[..., :3].argmax(axis=2) == channel) & (image[..., 3] > 0.9)) for channel in (0, 2))
    middle = np.array([480, 640]) - round(0.04 * 480) - 96
    assert red[:, 1].mean() < middle[1] - 20 and blue[:, 0].mean() < middle[0] - 20


def test_numbers_are_round_and_have_the_unit_that_suits_them() -> None:
    lengths = {
        "0.5 mm": "500 µm", "1000 mm": "1 m", "20 um": "20 µm", "2 cm": "20 mm", "1 voxels": "1 voxel",
        "0.2 bohr": "0.2 bohr", "5e9 m": "5e6 km", "50 ": "50",
    }  # fmt: skip
    for given, text in lengths.items():
        length, _, unit = given.partition(" ")
        assert length_text(Decimal(length), unit) == text
    axes = {
        (-1000, 2500, 5, False): "−1000 0 1000 2000", (0, 1, 7, False): "0 0.2 0.4 0.6 0.8 1", (7, 7, 5, True): "7",
        (0.02, 350, 7, True): "0.1 1 10 100", (1, 60, 7, True): "1 2 5 10 20 50", (12, 18, 5, True): "12 14 16 18",
        (1e-9, 4e-9, 5, False): "1e−9 2e−9 3e−9 4e−9",
    }  # fmt: skip
    for (low, high, most, is_log), ticks in axes.items():
        assert " ".join(map(plain_text, find_ticks(low, high, most, is_log=is_log))) == ticks


def test_formats_fill_in_numbers_and_nothing_else() -> None:
    values = {"frame": 7, "seconds": 2.345, "camera.distance": -1234567.0}
    text = "{frame} {frame:04} {frame:03d} {frame:.1f} {seconds} {seconds:6.2f} {seconds:.0%} {camera.distance:.2e} %"
    assert fill_format(text, values) == "7 0007 007 7.0 2.345   2.35 235% -1.23e+06 %"
    wrong = "{frame!r} | {} | {frame:>9} | {frame:100} | {frame:.999f} | {{frame}} | {frame | {a:{frame}} | a\nb |  "
    for each in wrong.split(" | "):
        with pytest.raises(SceneError):
            annotation(time=each)
    distance = moving(Motion((0, 7), (50.0, 85.0)))
    film = PLAIN.changed(lambda each: replace(each, camera=replace(each.camera, distance=distance)))
    assert annotation(film, time="{camera.distance:.0f} {time}").time
    for name, time in (("time", "{camera.zoom}"), ("time.format", {"format": "{frame.__class__}"})):
        with pytest.raises(SceneError) as caught:
            annotation(film, time=time)
        (problem,) = caught.value.problems
        assert problem.path == f"annotation.{name}" and "camera.distance" in (problem.expected or "")


def test_what_cannot_be_drawn_is_told(tmp_path: Path) -> None:
    (tmp_path / "wrong").write_bytes(b"wrong")
    Image.new("1", (9000, 9000)).save(tmp_path / "large.png")
    wide, broken = {"text": "a title of forty characters, or so it is"}, str(tmp_path / "wrong")
    right, no_room = {"position": "right", "size": 0.3}, "does not fit into the picture"
    cases: list[tuple[dict[str, Any], str, str]] = [
        ({"title": "W" * 60}, "title", no_room),
        ({"title": {"text": "W" * 200, "size": 0.5}}, "title", no_room),
        ({"scale_bar": right, "color_bar": {"length": 0.6}}, "color_bar scale_bar", no_room),
        ({"title": wide, "time": "after {frame} frames of all of it"}, "time", "covers annotation.title"),
        ({"title": "a 中 \U00012345"}, "title", "the font lacks characters"),
        ({"time": "{time}"}, "time", "no such number"),
        ({"font": broken, "title": "a"}, "font", "not a font"),
        ({"logo": broken}, "logo", "this picture cannot be decoded"),
        ({"logo": str(tmp_path / "large.png")}, "logo", "too large for a logo"),
    ]
    for keys, paths, what in cases:
        problems = annotation_problems(annotation(**keys), FACTS, [FRAME])
        expected = [(f"annotation.{path}", what) for path in paths.split()]
        assert [(problem.path, problem.what) for problem in problems] == expected, keys
    large = replace(annotation(), legend=EntrySpec(position="left", size=0.3))
    assert [problem.what for problem in annotation_problems(large, FACTS, [FRAME])] == [no_room]
    spec = replace(annotation(color_bar=True), legend=EntrySpec(position="left"))
    nothing = annotation_problems(spec, replace(FACTS, bars=(), legend=()), [FRAME])
    assert [problem.path for problem in nothing] == ["annotation.legend", "annotation.color_bar"]
    assert not annotation_problems(ALL, replace(FACTS, size=(1280, 720)), [FRAME])


def test_a_logo_keeps_its_colors_and_its_transparency(tmp_path: Path) -> None:
    pixels = np.zeros((8, 16, 4), np.uint8)
    pixels[:, :8] = (0, 128, 255, 255)
    pixels[:, 8:, 0] = 255  # red that nobody sees
    Image.fromarray(pixels).save(tmp_path / "logo.png")
    image = drawn(annotation(logo=str(tmp_path / "logo.png")))
    height = round(0.12 * 480)
    (rgba, row, column) = Annotator(annotation(logo=str(tmp_path / "logo.png")), FACTS).patches(FRAME)[0]
    assert rgba.shape == (height, 2 * height, 4) and (row, column) == (19, 19)
    np.testing.assert_array_equal(image[19 + height // 2, 19 + height // 4], np.float32([0, 128 / 255, 1, 1]))
    assert image[..., 0].max() == 0


def test_what_would_fit_is_told_and_fits() -> None:
    crowded = {"title": "a title of forty characters, or so it is", "time": "after {frame} frames of all of it"}
    small = {"accuracy": {"position": "bottom"}, "scale_bar": True}
    for keys, size, key, got in (
        ({"title": "W" * 60}, (640, 480), "title", "840 x 14 pixels, in a picture of 640 x 480"),
        (crowded, (640, 480), "time", "181 x 14 pixels, in a picture of 640 x 480"),
        (small, (90, 70), "accuracy", "36 x 10 pixels, in a picture of 90 x 70"),
    ):
        facts = replace(FACTS, size=size)
        (problem,) = annotation_problems(annotation(**keys), facts, [FRAME])
        assert (problem.path, problem.got) == (f"annotation.{key}", got)
        hint = problem.hint or ""
        fits = re.search(r"size: ([0-9.]+) fits", hint)
        larger = re.search(r"fits into a picture of (\d+) x (\d+)", hint)
        assert fits or larger, hint
        if fits:
            entry = keys[key] if isinstance(keys[key], dict) else {{"title": "text", "time": "format"}[key]: keys[key]}
            assert not annotation_problems(annotation(**keys | {key: entry | {"size": float(fits[1])}}), facts, [FRAME])
        if larger:
            facts = replace(facts, size=(int(larger[1]), int(larger[2])))
            assert not annotation_problems(annotation(**keys), facts, [FRAME])


def test_entries_have_the_color_and_size_of_the_annotation_or_their_own() -> None:
    red, green = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    spec = annotation(title={"text": "a", "color": "lime"}, accuracy=True, color="red", size=0.05)
    annotator = Annotator(spec, FACTS)
    title, accuracy = annotator.patches(FRAME)
    for patch, color in ((title, green), (accuracy, red)):
        assert (patch.rgba == (*color, 1.0)).all(axis=2).any()
    alone = Annotator(annotation(title={"text": "a", "size": 0.05}), FACTS)
    assert annotator.sketch("title", FRAME).height == alone.sketch("title", FRAME).height
    for background, level in ((None, 0.0), (WHITE, 0.0), (FACTS.background, 1.0)):
        (patch,) = Annotator(
            annotation(title={"text": "I", "size": 0.1}), replace(FACTS, background=background)
        ).patches(FRAME)
        assert (patch.rgba == (level, level, level, 1.0)).all(axis=2).any()
        assert not (patch.rgba == (1 - level, 1 - level, 1 - level, 1.0)).all(axis=2).any()


def test_a_legend_names_volumes_without_names_by_file_and_component(tmp_path: Path) -> None:
    values = np.random.default_rng(1).integers(0, 255, (2, 9, 9, 9), np.uint8)
    np.save(tmp_path / "cells.npy", values)
    np.save(tmp_path / "tissue.npy", values[0])  # the voxels of component 0
    look = {"color": "lime", "range": [10, 200]}
    volumes = [{"file": "cells.npy", "component": k} | look for k in range(2)]
    volumes += [{"file": "tissue.npy"} | look, {"file": "tissue.npy", "name": "Tissue"} | look]
    tree = {"volumes": volumes, "camera": {"path": {"type": "turntable", "frames": 1}}}
    scene = parse_scene(tree | {"output": {"file": "a.png"}}, base=tmp_path)
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=1) as stage:
        assert isinstance(stage, Stage)
        facts = film_facts(stage.scene, stage.layers, stage.scene.output.kind)
    names = ["cells.npy, component 0", "cells.npy, component 1", "tissue.npy", "Tissue"]
    assert [name for name, _ in facts.legend] == names


def test_a_scene_of_labels_has_no_color_bar_and_channels_may_have_a_legend() -> None:
    rest = {"camera": {"path": {"type": "turntable", "frames": 1}}, "output": {"file": "a.png"}}
    volume = {"procedural": {"name": "atlas", "shape": [8, 8, 8]}}
    labels = {"volume": volume, "labels": {}, "annotation": {"names": True, "legend": True, "color_bar": True}}
    with pytest.raises(SceneError) as caught:
        parse_scene(labels | rest, base=Path())
    assert [problem.path for problem in caught.value.problems] == ["annotation.color_bar"]
    channels = {"volume": {"file": __file__, "component": "all"}, "annotation": {"legend": True}}
    assert parse_scene(channels | rest, base=Path()).at(0).annotation.legend is not None
