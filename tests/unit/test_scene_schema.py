"""Plain data become a scene with defaults; several spellings are accepted, and wrong values refused."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import pytest
from film_stages import scheduled

from renderer.errors import SceneError
from renderer.scene import (
    CameraSpec,
    ControlPoint,
    FileSource,
    LayerSpec,
    OutputSpec,
    ProceduralSource,
    Scene,
    SplatSpec,
    TransferSpec,
    TurntablePath,
    VolumeSpec,
    parse_scene,
)

HERE = Path(__file__).resolve()

SMALL: dict[str, Any] = {
    "volume": {"procedural": {"name": "constant", "shape": [4, 5, 6]}},
    "transfer_function": {"points": [{"value": 1, "color": "white", "opacity": 0.5}]},
    "camera": {"path": {"type": "turntable", "frames": 10}},
    "output": {"file": "a.mp4"},
}


def changed(**sections: Any) -> dict[str, Any]:
    """Return SMALL with whole sections replaced."""
    return copy.deepcopy(SMALL) | sections


def parse(tree: object) -> Scene:
    return parse_scene(tree, base=HERE.parent)


STEPS = [(0, "black", 0), (1, "black", 0), (1, "red", 0.5), (2, "red", 0.5), (2, "blue", 0.9), (9, "blue", 0.9)]


def complaints(tree: object) -> list[tuple[str, str]]:
    with pytest.raises(SceneError) as caught:
        parse(tree)
    return [(problem.path, problem.what) for problem in caught.value.problems]


@pytest.mark.parametrize("version", [1, 1.0, "1", "1.0"])
def test_a_version_may_be_spelt_as_any_number(version: object) -> None:
    assert parse(changed(version=version)) == parse(SMALL)


@pytest.mark.parametrize(
    ("section", "footprint"),
    [
        ({}, "integrated"),
        ({"sigma": 0.5}, "gaussian"),
        ({"order": "boxes"}, "gaussian"),
        ({"opacity_correction": True}, "gaussian"),
        ({"footprint": "integrated"}, "integrated"),
        ({"footprint": "integrated", "sigma": 0.425, "radial": 3}, "integrated"),  # defaults contradict nothing
        ({"footprint": "gouraud", "angular": 4}, "gouraud"),
    ],
)
def test_a_section_with_any_key_asks_for_splats(section: dict[str, Any], footprint: str) -> None:
    splat = parse({**SMALL, "splat": section}).splat
    assert splat == SplatSpec(footprint, **{k: v for k, v in section.items() if k != "footprint"})  # type: ignore[arg-type]


def test_defaults_are_those_of_the_dataclasses() -> None:
    assert parse(SMALL) == Scene(
        layers=(
            LayerSpec(
                VolumeSpec(ProceduralSource("constant", (4, 5, 6))),
                TransferSpec((ControlPoint(1.0, (1.0, 1.0, 1.0), 0.5),)),
            ),
        ),
        camera=CameraSpec(TurntablePath(10)),
        output=OutputSpec(Path("a.mp4")),
    )


@pytest.mark.parametrize(
    ("written", "color"),
    [
        ("#ff0080", (1.0, 0.0, 128 / 255)),
        ("#F08", (1.0, 0.0, 136 / 255)),
        ("Black", (0.0, 0.0, 0.0)),
        ([0.25, "1e-3", 1], (0.25, 0.001, 1.0)),
    ],
)
def test_a_color_has_several_spellings(written: object, color: tuple[float, float, float]) -> None:
    assert parse(changed(output={"file": "a.gif", "background": written})).output.background == color


@pytest.mark.parametrize(
    ("written", "axis"), [("y", (0.0, 1.0, 0.0)), ("-z", (0.0, 0.0, -1.0)), ([0, 3, 4], (0.0, 3.0, 4.0))]
)
def test_an_axis_is_a_name_or_a_direction(written: object, axis: tuple[float, float, float]) -> None:
    scene = parse(changed(camera={"path": {"type": "rocker", "frames": 2, "axis": written}}))
    assert scene.camera.path.axis == axis


@pytest.mark.parametrize(("written", "frames"), [(7, 7), (1e3, 1000), ("120", 120), (60.0, 60)])
def test_a_whole_number_has_several_spellings(written: object, frames: int) -> None:
    scene = parse(changed(camera={"path": {"type": "turntable", "frames": written}}))
    assert scene.camera.path.frames == frames
    assert isinstance(scene.camera.path.frames, int)


@pytest.mark.parametrize(
    "wrong", [True, "", "x", "1_000", "0x10", "1e", "nan", math.nan, math.inf, "1e999", 10**400, [], {}]
)
def test_values_that_are_no_numbers_are_refused(wrong: object) -> None:
    ((path, _),) = complaints(changed(camera={"path": {"type": "turntable", "frames": 10}, "distance": wrong}))
    assert path == "camera.distance"


@pytest.mark.parametrize(
    ("written", "tolerance"),
    [
        (0, 0.0),
        ("1e-3", 0.001),
        ({0: 0.5, 9: 0.02}, scheduled((0, 0.5), (9, 0.02))),
        ({0: 0, 1: 0.5, 8: 0.5, 9: 0}, scheduled((0, 0.0), (1, 0.5), (8, 0.5), (9, 0.0))),
        ({2: 0, 9: 0}, 0.0),
        ({"0": 0.5, "3": 0.1}, scheduled((0, 0.5), (3, 0.1))),
    ],
)
def test_a_tolerance_is_constant_or_by_frame(written: object, tolerance: object) -> None:
    assert parse(changed(error={"tolerance": written})).error.tolerance == tolerance


def test_a_step_is_two_points_at_one_value() -> None:
    points = [{"value": value, "color": "white", "opacity": 0.5} for value in (1, 2, 2, 3)]
    scene = parse(changed(transfer_function={"points": points}))
    assert isinstance(scene.layers[0].transfer_function.mapping, tuple)
    assert [point.value for point in scene.layers[0].transfer_function.mapping] == [1, 2, 2, 3]
    points.insert(2, points[2])
    assert complaints(changed(transfer_function={"points": points})) == [
        ("transfer_function.points.3.value", "a third point at the same value")
    ]


@pytest.mark.parametrize("name", ["a.mp4", "a.GIF", "{frame}.png", "a b/{frame:06}.png", "x{frame:04d}y.png"])
def test_names_of_films_and_frames_are_accepted(name: str) -> None:
    assert parse(changed(output={"file": name})).output.file == Path(name)


@pytest.mark.parametrize(
    "name",
    [
        "a", ".mp4", "a.png", "a.mp4/", "{frame}.mp4", "{frame}/a.png", "{frame}{frame}.png", "{frame:4}.png", "{.png",
        "{x}{frame}.png", "{frame:04x}.png", "{frame!r}.png", "{{frame}}.png", "", "\0.mp4", 3,
    ],
)  # fmt: skip
def test_names_that_are_no_output_file_are_refused(name: object) -> None:
    ((path, _),) = complaints(changed(output={"file": name}))
    assert path == "output.file"


LIGHT = {"specular": 0.3, "light": "camera", "two_sided": True, "gradient_opacity": [[0, 0], [5, 1]]}


@pytest.mark.parametrize(
    ("shading", "place", "what"),
    [
        ({"light": "eye"}, "shading.light", "unknown value"),
        ({"light": [0, 0, 0]}, "shading.light", "no direction"),
        ({"specular": 1.5}, "shading.specular", "out of range"),
        ({"shininess": 1001}, "shading.shininess", "out of range"),
        ({"two_sided": "yes"}, "shading.two_sided", "not true or false"),
        ({"gradient_opacity": []}, "shading.gradient_opacity", "wrong number of items"),
        ({"gradient_opacity": [[0, 1, 2]]}, "shading.gradient_opacity.0", "not a pair"),
        ({"gradient_opacity": [[-1, 1]]}, "shading.gradient_opacity.0.0", "out of range"),
        ({"gradient_opacity": [[0, 0], [5, 2]]}, "shading.gradient_opacity.1.1", "out of range"),
        ({"gradient_opacity": [[0, 0], [5, 1], [5, 0]]}, "shading.gradient_opacity.2.0", "points out of order"),
    ],
)
def test_mistakes_of_a_light_have_their_place(shading: dict[str, Any], place: str, what: str) -> None:
    assert complaints(changed(shading=shading)) == [(place, what)]


@pytest.mark.parametrize("key", LIGHT)
def test_what_only_samples_between_voxels_show_is_refused_elsewhere(key: str) -> None:
    shading = {key: LIGHT[key], "shininess": 5}
    assert parse(changed(shading=shading, splat={"footprint": "integrated"}, annotation={"octree": True}))
    place, error = f"shading.{key}", {"finest_level": 1, "splats": 100}
    assert complaints(changed(shading=shading, splat={"sigma": 0.5})) == [(place, "needs footprint: integrated")]
    assert complaints(changed(shading=shading, error=error)) == [
        (place, "contradicts error.finest_level"),
        (place, "contradicts error.splats"),
    ]
    parse(changed(shading={"ambient": 0.5, "shininess": 5}, splat={"sigma": 0.5}))


def test_a_folder_is_a_volume_and_no_raw_file() -> None:
    assert parse(changed(volume={"file": "."})).layers[0].volume.source == FileSource(HERE.parent)
    raw = {"file": ".", "shape": [1, 1, 1], "dtype": "uint8"}
    assert complaints(changed(volume={"raw": raw})) == [("volume.raw.file", "a folder")]


@pytest.mark.parametrize("key", ["occlusion", "shadow"])
def test_splats_have_neither_occlusion_nor_shadows(key: str) -> None:
    assert getattr(parse(changed(shading={key: 0.5})).layers[0].shading, key) == 0.5
    splats = {"footprint": "gouraud"}
    assert complaints(changed(shading={key: 0.5}, splat=splats)) == [(f"shading.{key}", "needs footprint: integrated")]
    parse(changed(shading={key: 0}, splat=splats))
