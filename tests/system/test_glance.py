"""A film that shows nothing, next to nothing, or the box of its volume is told before it is drawn, by every command."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from hsplat_cli.main import hsplat
from renderer.accuracy import look_ahead
from renderer.frame import prepare_stage
from renderer.readers import read_volume
from renderer.resolve import resolve_scene
from renderer.scene import Scene, parse_scene
from renderer.suggest import PRESET_WORDS

AIR, MATTER = 30, 200
NOTHING, NEXT_TO_NOTHING, BOX, DARK = "nothing", "next to nothing", "its box", "dark"
GRAY = {"colormap": "gray", "range": [0, 200]}
# Opacities by value, and what is wrong with what they show of a ball in air.
LOOKS: dict[str, tuple[list[list[float]], list[str]]] = {
    "the ball": ([[100, 0], [160, 0.9]], []),
    "a veil of the ball": ([[100, 0], [160, 0.02]], []),
    "matter that is too thin": ([[100, 0], [160, 0.004]], [DARK]),
    "air": ([[0, 0.3], [255, 0.9]], [BOX]),
    "a fog": ([[0, 0.01], [255, 0.01]], [BOX]),
    "values that are not there": ([[240, 0], [255, 0.9]], [NOTHING]),
    "opacities that change no pixel": ([[100, 0], [160, 1e-5]], [NOTHING]),
    "opacities that change few pixels": ([[100, 0], [160, 3e-4]], [NEXT_TO_NOTHING]),
}


def ball(n: int = 40) -> np.ndarray:
    """Return a ball in air, with noise."""
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, n)] * 3, indexing="ij")
    values = np.where(x**2 + y**2 + z**2 < 0.5, MATTER, AIR)
    return np.rint(values + np.random.default_rng(0).normal(0, 2, values.shape)).astype(np.uint8)


def scene_of(opacity: Any, file: str = "ball.npy", **sections: Any) -> dict[str, Any]:
    return {
        "version": 1,
        "volume": {"file": file},
        "transfer_function": GRAY | {"opacity": opacity},
        "camera": {"path": {"type": "turntable", "frames": 6}},
        "output": {"file": "film.mp4", "size": [64, 64]},
    } | sections


def seen(scene: Scene, num_threads: int = 2) -> list[str]:
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=1) as stage:
        return [each.word for each in look_ahead(stage, range(scene.num_frames), num_threads=num_threads)]


def run(*arguments: str) -> str:
    """Run a command, and return what it prints on both streams."""
    result = CliRunner().invoke(hsplat, [*arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture(autouse=True)
def files(folder: Path) -> None:
    np.save("ball.npy", ball())
    np.save("block.npy", np.where(np.indices((30, 30, 30)).sum(axis=0) % 2, MATTER, MATTER // 2).astype(np.uint8))


@pytest.mark.parametrize("name", LOOKS)
def test_what_a_film_shows(name: str) -> None:
    opacity, expected = LOOKS[name]
    assert seen(parse_scene(scene_of(opacity), base=Path())) == expected


def test_a_block_that_fills_its_box_is_no_mistake() -> None:
    assert seen(parse_scene(scene_of([[0, 0.9], [255, 0.9]], "block.npy"), base=Path())) == []


def test_a_ball_of_any_background_and_mode() -> None:
    """White on white is nothing; rays through the box of a projection are all opaque, and no mistake."""
    opaque = [[100, 0], [160, 0.9]]
    white = {
        "transfer_function": {
            "points": [{"value": 100, "color": "white", "opacity": 0}, {"value": 160, "color": "white", "opacity": 0.9}]
        }
    }
    output = {"file": "film.mp4", "size": [64, 64], "background": "white"}
    assert seen(parse_scene(scene_of(opaque, output=output) | white, base=Path())) == [NOTHING]
    assert seen(parse_scene(scene_of(opaque, mode={"type": "maximum"}), base=Path())) == []


COLORS = "brighter colors in transfer_function.points"
MORE_LIGHT = "a larger shading.ambient, or shading.light: camera,"
BEHIND = {"ambient": 0.12, "light": [0, 1, 0]}
DARK_RED = {
    "points": [{"value": 100, "color": "#240000", "opacity": 0}, {"value": 160, "color": "#240000", "opacity": 0.9}]
}


@pytest.mark.parametrize(
    ("sections", "reasons"),
    [
        ({"shading": BEHIND}, [MORE_LIGHT]),
        # A lit patch at the rim does not make a picture bright.
        ({"shading": {"ambient": 0.05, "light": [1, 0.7, 0]}}, [MORE_LIGHT]),
        ({"shading": {"ambient": 0.2, "light": [0, 1, 0]}}, []),
        ({"transfer_function": DARK_RED}, [COLORS]),
        ({"transfer_function": DARK_RED, "shading": {"light": "camera"}}, [COLORS]),
        ({"transfer_function": DARK_RED, "shading": BEHIND}, [MORE_LIGHT, COLORS]),
        (
            {"transfer_function": GRAY | {"opacity": [[100, 0], [160, 0.9]], "range": [0, 5000]}},
            ["a narrower transfer_function.range"],
        ),
        ({"transfer_function": GRAY | {"opacity": [[100, 0], [160, 0.003]]}}, ["transfer_function.unit"]),
        ({"output": {"file": "film.mp4", "size": [64, 64], "background": "white"}}, []),
        ({}, []),
    ],
)
def test_a_dark_picture_says_why(sections: Any, reasons: list[str]) -> None:
    """It names the keys of a scene: those of all reasons if none of them alone would make the picture bright."""
    camera = {"path": {"type": "turntable", "frames": 1, "elevation": 20}}
    scene = parse_scene(scene_of([[100, 0], [160, 0.9]], camera=camera) | sections, base=Path())
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=1) as stage:
        notes = [each.note for each in look_ahead(stage, [0], num_threads=1) if each.word == DARK]
    assert len(notes) == bool(reasons)
    for note in notes:
        told = [key for key in (MORE_LIGHT, COLORS, "transfer_function.range", "transfer_function.unit") if key in note]
        assert len(told) == len(reasons) and all(reason in note for reason in reasons)


def test_a_picture_that_is_next_to_black_says_why() -> None:
    sections = {"transfer_function": DARK_RED, "shading": BEHIND | {"ambient": 0.04}}
    scene = parse_scene(scene_of([]) | sections, base=Path())
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=1) as stage:
        (glance,) = look_ahead(stage, [0], num_threads=1)
    assert glance.word == NEXT_TO_NOTHING and MORE_LIGHT in glance.note and COLORS in glance.note


def test_dark_colors_of_labels_and_of_several_volumes() -> None:
    """A note names the key of each, and only of those that are visible."""
    labels = scene_of([]) | {"volume": {"file": "labels.npy"}, "labels": {"colors": {1: "#240000"}}}
    del labels["transfer_function"]
    np.save("labels.npy", (ball() > 100).astype(np.uint8))
    unseen = {
        "file": "ball.npy",
        "transfer_function": {"colormap": "gray", "range": [0, 250], "opacity": [[240, 0], [250, 1]]},
    }
    ramp = {"file": "ball.npy", "color": "#240000", "range": [100, 120]}
    volumes = scene_of([]) | {"volumes": [unseen, ramp, {"file": "ball.npy", "transfer_function": DARK_RED}]}
    del volumes["transfer_function"], volumes["volume"]
    keys = "a brighter volumes.1.color and brighter colors in volumes.2.transfer_function.points make"
    for tree, reason in ((labels, "brighter labels.colors make"), (volumes, keys)):
        scene = resolve_scene(parse_scene(tree, base=Path()), read_volume)
        with prepare_stage(scene, clock=lambda: 0.0, num_threads=1) as stage:
            (glance,) = look_ahead(stage, range(6), num_threads=1)
        assert glance.word == DARK and reason in glance.note


def changed(note: str, tree: dict[str, Any]) -> dict[str, Any]:
    """Return a scene with the values that a note states by `--set`."""
    options = re.findall(r"--set (\S+)=(\S+)", note)
    assert options
    for path, value in options:
        *sections, key = path.split(".")
        part: Any = tree
        for each in sections:
            part = part[int(each) if each.isdecimal() else each]
        part[key] = float(value)
    return tree


@pytest.mark.parametrize(("opacity", "unit"), [(0.004, None), (3e-4, None), (3e-4, 0.3), (0.02, 10), (1e-5, None)])
def test_the_unit_that_a_note_states_makes_thin_matter_visible(opacity: float, unit: float | None) -> None:
    """Its matter holds back as much light as that of a suggested picture."""
    tree = scene_of([[100, 0], [160, opacity]])
    tree["transfer_function"] |= {} if unit is None else {"unit": unit}
    with prepare_stage(parse_scene(tree, base=Path()), clock=lambda: 0.0, num_threads=1) as stage:
        glances = look_ahead(stage, range(6), num_threads=2)
    (glance,) = glances
    assert glance.word in (DARK, NEXT_TO_NOTHING, NOTHING) and glance.factor > 5
    film = parse_scene(changed(glance.note, tree), base=Path())
    with prepare_stage(film, clock=lambda: 0.0, num_threads=1) as stage:
        assert look_ahead(stage, range(6), num_threads=2) == []
        now = stage.layers[0].transfer.unit
    assert now == pytest.approx((unit or 1) / glance.factor)


def test_weights_are_stated_for_several_volumes() -> None:
    tree = scene_of([])
    of_ball = {"file": "ball.npy", "weight": 0.004, "color": "white", "range": [100, 160]}
    volumes = [of_ball, of_ball | {"color": "red", "weight": 0.002, "range": [120, 200]}]
    tree = {key: tree[key] for key in ("version", "camera", "output")} | {"volumes": volumes}
    scene = parse_scene(tree, base=Path())
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=1) as stage:
        (glance,) = look_ahead(stage, range(6), num_threads=2)
    before = [layer["weight"] for layer in volumes]
    assert seen(parse_scene(changed(glance.note, tree), base=Path())) == []
    assert [layer["weight"] / old for layer, old in zip(volumes, before, strict=True)] == pytest.approx(
        [glance.factor] * 2, rel=0.01
    )


def test_thin_matter_that_would_be_dark_if_it_were_dense() -> None:
    """A note says so, and why."""
    dark = GRAY | {"range": [0, 1500], "opacity": [[100, 0], [160, 0.006]]}
    scene = parse_scene(scene_of([]) | {"transfer_function": dark}, base=Path())
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=1) as stage:
        notes = [each.note for each in look_ahead(stage, range(6), num_threads=1)]
    assert len(notes) == 1 and "it is denser, but the colors of the values that are seen are dark" in notes[0]


@pytest.mark.parametrize(
    ("shading", "is_too_bright"),
    [({"ambient": 0.9, "diffuse": 0.8}, True), ({"ambient": 0.45, "diffuse": 0.6}, False), ({}, False)],
)
def test_a_picture_that_is_too_bright(shading: Any, is_too_bright: bool) -> None:
    """White matter in more light than white; suggested shading is no mistake."""
    sections = {"shading": {"light": "camera"} | shading} if shading else {}
    scene = parse_scene(scene_of([[100, 0], [160, 0.9]], **sections), base=Path())
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=1) as stage:
        glances = look_ahead(stage, range(6), num_threads=2)
    assert [each.word for each in glances] == ["too bright"] * is_too_bright
    assert all("smaller shading.ambient, shading.diffuse or shading.specular" in each.note for each in glances)


def test_frames_that_show_nothing_are_told_where_they_are_many() -> None:
    """A film may fade in; one that shows nothing for most of its time is told."""

    def fading(opacity: Any) -> Scene:
        """Return a film whose ball has opacities by the frame."""
        points = [
            {"value": 100, "color": "white", "opacity": 0},
            {"value": 160, "color": "white", "opacity": opacity},
        ]
        return parse_scene(scene_of([]) | {"transfer_function": {"points": points}}, base=Path())

    assert seen(fading({0: 0, 1: 0.9, 5: 0.9})) == []
    assert seen(fading({0: 0, 4: 0, 5: 0.9})) == [NOTHING]
    assert seen(fading({0: 0, 3: 0, 4: 0.9})) == [NEXT_TO_NOTHING]


def test_it_does_not_depend_on_threads() -> None:
    scene = parse_scene(scene_of(LOOKS["a fog"][0]), base=Path())
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=1) as stage:
        one, three = (look_ahead(stage, range(6), num_threads=num) for num in (1, 3))
    assert one == three and one


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a fog", "opacities that change few pixels"])
def test_commands_tell_it(name: str) -> None:
    opacity, (word,) = LOOKS[name]
    Path("scene.yaml").write_text(yaml.safe_dump(scene_of(opacity, error={"probes": 16})))
    sentence = "the picture shows the box of ball.npy: its background, near 30" if word == BOX else f"show {word}"
    assert sentence in run("check", "scene.yaml").partition("note     ")[2]
    assert sentence in run("preview", "scene.yaml").partition("note: ")[2]
    assert sentence in Path("scene.html").read_text()
    assert sentence in run("render", "scene.yaml").partition("note: ")[2]
    assert any(sentence in each for each in json.loads(Path("film.mp4.json").read_text())["notes"])


@pytest.mark.slow
def test_turntable_tells_it() -> None:
    opacity, (word,) = LOOKS["opacities that change few pixels"]
    Path("look.yaml").write_text(yaml.safe_dump(scene_of(opacity, error={"probes": 16})))
    np.save("other.npy", ball())
    table = run("turntable", "ball.npy", "other.npy", "--scene", "look.yaml", "-o", "films")
    assert "seen" in table and table.count(word) >= 2
    again = run("turntable", "ball.npy", "other.npy", "--scene", "look.yaml", "-o", "films", "--quiet")
    assert again.count(word) >= 2


def test_init_tells_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is suggested shows no box; a file of another program may."""
    Path("fog.clut").write_text(
        "[FLT]\nmin=0\nmax=200\n[INT]\nnumnodes=2\n[BYT]\nnodeintensity0=0\nnodeintensity1=255\n"
        "[RGBA255]\nnodergba0=0|0|0|0\nnodergba1=0|0|0|255\n"
    )
    assert "warning" not in run("init", "ball.npy")
    assert "show nothing" in run("init", "ball.npy", "--preset", "fog.clut")
    assert all("box" not in run("init", "ball.npy", "--preset", word) for word in PRESET_WORDS if word != "labels")
