"""The library imports fast, lists all mistakes in an error, and its docstrings are whole."""

from __future__ import annotations

import inspect
import json
import os
import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from commands import python

import renderer
from renderer import Film

ARRAY = np.arange(60, dtype=np.uint8).reshape(3, 4, 5)


@pytest.mark.parametrize("module", ["renderer", "renderer.scene.spec"])
def test_importing_the_door_or_the_scene_loads_no_large_library(module: str) -> None:
    program = (
        f"import sys, {module}; dir({module}); sys.exit(any(m in sys.modules for m in ('numpy', 'ctypes', 'yaml')))"
    )
    assert python("-c", program).returncode == 0


def test_every_function_has_parameters_returns_errors_and_an_example() -> None:
    for name in ("render", "render_frame", "load_scene", "suggest_scene", "preview", "integrate"):
        function = getattr(renderer, name)
        text = function.__doc__
        assert all(f"\n    {title}\n" in text for title in ("Parameters", "Returns", "Raises", "Examples")), name
        part = text.partition("Parameters\n")[2].partition("    Returns\n")[0]
        listed = ", ".join(re.findall(r"(?m)^    (\w+(?:, \w+)*)(?: : .+)?$", part)).split(", ")
        assert listed == list(inspect.signature(function).parameters), name


@pytest.mark.parametrize("name", ["render_frame", "render", "preview", "integrate"])
def test_functions_that_suggest_a_scene_take_its_parameters(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A parameter has one name, type and default in all functions, and none is dropped on its way to the scene."""
    suggested = dict(inspect.signature(renderer.suggest_scene).parameters)
    del suggested["volume"]
    if name != "render":
        del suggested["output"]
    taken = inspect.signature(getattr(renderer, name)).parameters
    assert {each: taken.get(each) for each in suggested} == suggested
    given: list[dict[str, Any]] = []

    def make_scene(_source: Any, options: dict[str, Any], **_: Any) -> None:
        given.append(options)
        raise InterruptedError

    monkeypatch.setattr("renderer.api.make_scene", make_scene)
    for function in (getattr(renderer, name), renderer.suggest_scene):
        with pytest.raises(InterruptedError):
            function(ARRAY, **suggested)
    assert all(options.items() >= suggested.items() for options in given)


@pytest.mark.slow
def test_a_volume_and_its_parameters_are_as_the_scene_that_they_suggest(folder: Path) -> None:
    options: dict[str, Any] = {
        "spacing": (1, 1, 2),
        "size": (24, 16),
        "background": "navy",
        "camera": {"shift": [0, 0]},
    }
    options |= {"transfer_function": "viridis", "mask": ARRAY > 5}
    scene = renderer.suggest_scene(ARRAY, **options)
    films = [
        renderer.render(ARRAY, output="a.webm", frames=range(2), **options),
        renderer.render(scene, output="b.webm", frames=range(2)),
    ]
    assert films[0].path.read_bytes() == films[1].path.read_bytes()
    pictures = [renderer.integrate(ARRAY, **options), renderer.integrate(scene)]
    np.testing.assert_array_equal(*pictures)
    assert pictures[0].shape == (16, 24, 3)
    labelled = renderer.preview(np.array(ARRAY > 9), labels={1: "the large half"}, size=(32, 32))
    assert "the large half" in labelled.html


def test_further_outputs_follow_the_first_one(folder: Path) -> None:
    """They keep a size and a background of their own."""
    outputs = [{"file": "a.png"}, {"file": "b.png", "size": [16, 16]}, {"file": "c.png", "background": "red"}]
    tree = {"version": 1, "volume": {"file": "a.npy"}, "output": outputs}
    tree |= {"camera": {"path": {"type": "turntable", "frames": 1}}}
    tree |= {"transfer_function": {"points": [{"value": 0, "color": "white", "opacity": 0.5}]}}
    np.save("a.npy", ARRAY)
    Path("scene.yaml").write_text(json.dumps(tree | {"error": {"probes": 0}}))
    film = renderer.render("scene.yaml", size=(32, 32), background="blue")
    files = json.loads(film.sidecar.read_text("utf-8"))["scene"]["output"]
    assert [each["size"] for each in files] == [[32, 32], [16, 16], [32, 32]]
    assert [each["background"] for each in files] == [[0, 0, 1], [0, 0, 1], [1, 0, 0]]


def problem(**options: Any) -> str:
    with pytest.raises(renderer.InputError) as error:
        renderer.suggest_scene(ARRAY, **options)
    return str(error.value)


def test_all_mistakes_are_told_at_once_by_the_names_of_the_parameters() -> None:
    told = problem(spacing=(1, 0, 2), size=(3, "x"), transfer_function="virids", tolerance=-1, background="blu")
    assert told == (
        "spacing.1: out of range\n"
        "  got: 0\n"
        "  expected: a number from 1e-30 to 1e+30\n"
        "transfer_function.colormap: unknown colormap\n"
        "  got: 'virids'\n"
        "  expected: a name such as viridis, gray, cividis_r or crameri:batlow\n"
        "  hint: did you mean viridis?\n"
        "tolerance: out of range\n"
        "  got: -1\n"
        "  expected: a number of at least 0\n"
        "size.1: not a whole number\n"
        "  got: 'x'\n"
        "  expected: a whole number from 1 to 16384\n"
        "background: not a color\n"
        "  got: 'blu'\n"
        '  expected: a color: "#rrggbb", "#rgb", [red, green, blue] from 0 to 1, or a name such as white, '
        "transparent, or {top, bottom} with two colors\n"
        "  hint: did you mean blue?"
    )


@pytest.mark.parametrize(
    ("options", "place"),
    [
        ({"transfer_function": [(1, "red", 0.5), (0, "red", 0.5)]}, "transfer_function.points.1.value"),
        ({"transfer_function": [(1, "red")]}, "transfer_function.points.0"),
        ({"transfer_function": {"colormap": "gray"}}, "transfer_function.range"),
        ({"camera": {"path": {"type": "spiral"}}}, "camera.path.type"), ({"camera": 3}, "camera"),
        ({"transfer_function": {"preset": "bnoe"}}, "preset bnoe"),
        ({"transfer_function": {"preset": 3}}, "transfer_function.preset"), ({"size": (33, 32)}, "size"),
        ({"background": "transparent"}, "background"), ({"output": "film.avi"}, "output"), ({"spacing": 2}, "spacing"),
        ({"spacing": (1, 1, 1e20)}, "spacing"),
    ],
)  # fmt: skip
def test_where_a_mistake_is(options: dict[str, Any], place: str) -> None:
    assert problem(**options).startswith(f"{place}: ")


def test_what_is_no_volume() -> None:
    with pytest.raises(renderer.InputError) as error:
        renderer.render_frame(ARRAY[0])
    assert str(error.value) == (
        "the array: not the axes of a volume\n  got: shape [4, 5]\n  expected: three axes, [z, y, x]\n"
        "  hint: `array[numpy.newaxis]` is a volume of one slice"
    )
    with pytest.raises(renderer.InputError, match="the array: voxels of this type cannot be rendered"):
        renderer.render_frame(ARRAY.astype(complex))
    with pytest.raises(renderer.InputError, match="the array: no voxel has data"):
        renderer.render_frame(np.full((3, 3, 3), np.nan))
    absent = [
        renderer.render_frame(np.where(ARRAY == 7, fill, ARRAY), transfer_function=[(0, "red", 0.5)])
        for fill in (np.nan, np.inf, -np.inf)
    ]
    np.testing.assert_array_equal(absent[1], absent[0])
    np.testing.assert_array_equal(absent[2], absent[0])
    with pytest.raises(renderer.SceneError, match=r"volume: no such file"):
        renderer.suggest_scene("missing.nrrd")
    with pytest.raises(renderer.InputError, match=r"missing.yaml: no such file"):
        renderer.load_scene("missing.yaml")


def test_what_stands_in_the_place_of_a_volume() -> None:
    mistakes: dict[str, dict[str, Any]] = {
        "volume: a list of names and volumes": {"volume": [{"CT": ARRAY}]},
        "volume: a list of names and volumes\n": {"volume": [ARRAY, ("CT", ARRAY)]},
        "labels: names without numbers": {"labels": ["liver", "spleen"]},
        "mask: not a volume": {"mask": {1: "liver"}},
        "transfer_function.points.1: not a mapping\n  got: [1, 'red']\n  expected: a mapping with value and color\n"
        "  hint: `(value, color, opacity)` is a control point, too\nsize: ": {
            "transfer_function": [(0, "red", 0.5), (1, "red")],
            "size": 0,
        },
        "the array: not the axes of a volume\n  got: [1, None]": {"volume": [1, None]},
        "the array: not the axes of a volume\n  got: shape [1, 1, 3, 4, 5]\n"
        "  expected: three axes, [z, y, x]\n  hint: `array[0, 0]`": {"volume": ARRAY[np.newaxis, np.newaxis]},
    }
    for start, options in mistakes.items():
        with pytest.raises(renderer.InputError) as error:
            renderer.suggest_scene(**{"volume": ARRAY} | options)
        assert str(error.value).startswith(start)


def test_light_by_name_and_by_keys() -> None:
    studio = renderer.suggest_scene(ARRAY, light="studio")
    assert studio.light is not None and studio.light.key is not None and studio.light.surface > 0
    assert studio.layers[0].shading is None
    sky = {"environment": "overcast", "key": {"strength": 3}}
    own = renderer.suggest_scene(ARRAY, light=sky, transfer_function=[(0, "red", 0), (9, "red", 0.5)])
    assert (own.light.key.strength, own.layers[0].shading) == (3.0, None)
    shaded = renderer.suggest_scene(ARRAY, transfer_function={"preset": "surface"})
    lit = renderer.suggest_scene(ARRAY, transfer_function={"preset": "surface"}, light=sky)
    assert shaded.layers[0].shading is not None and lit.layers[0].shading is None
    pictures = [renderer.render_frame(each, light=sky, size=(8, 8)) for each in (shaded, lit)]
    np.testing.assert_array_equal(*pictures)
    named = renderer.suggest_scene(ARRAY, labels={1: "one"}, light="outdoor")
    assert named.light is not None and named.layers[0].shading is None
    refused: list[tuple[dict[str, Any], str]] = [
        ({"light": "studoi"}, "light: unknown environment\n  got: studoi\n"),
        ({"light": "studio", "transfer_function": [(0, "red", 0.5)]}, "light: this light is suggested with a look"),
        ({"light": "studio", "labels": ARRAY}, "light: several volumes"),
        ({"light": sky, "labels": ARRAY}, "light: several volumes"),
        ({"light": {"environment": "night"}}, "light.environment: "),
    ]
    for options, start in refused:
        with pytest.raises(renderer.InputError) as error:
            renderer.suggest_scene(ARRAY, **options)
        assert str(error.value).startswith(start)


@pytest.mark.parametrize("frames", [120, -121, [], [3, 3], [3, 2], "0:3", 1.5, [0.5], range(5, 5), slice(200, None)])
def test_frames_that_are_not_on_the_path(frames: Any) -> None:
    scene = renderer.suggest_scene(ARRAY)
    with pytest.raises(renderer.InputError) as error:
        renderer.render(scene, frames=frames)
    assert str(error.value).startswith("frames: no such frames\n  got: ")
    assert "expected: whole numbers from 0 to 119, ascending, or from -1 for the last one" in str(error.value)
    assert not Path("film.mp4").exists()


def test_scenes_of_arrays_and_colormaps() -> None:
    scene = renderer.suggest_scene(ARRAY, spacing=np.array([1, 2, 3], np.float32), camera={"field_of_view": 40})
    assert scene.layers[0].volume.source.spacing == (1.0, 2.0, 3.0)
    assert (scene.camera.path.frames, scene.camera.target, scene.camera.field_of_view) == (120, "visible", 40.0)
    assert scene.splat.footprint == "integrated"
    exact = renderer.suggest_scene(ARRAY, camera=scene.camera, transfer_function=scene.layers[0].transfer_function)
    assert (exact.camera, exact.layers[0].transfer_function) == (scene.camera, scene.layers[0].transfer_function)
    surface, glow = (renderer.suggest_scene(ARRAY, transfer_function={"preset": word}) for word in ("surface", "glow"))
    assert surface.layers[0].shading is not None and glow.layers[0].shading is None
    gray = renderer.suggest_scene(ARRAY, transfer_function="gray").layers[0].transfer_function
    assert gray != scene.layers[0].transfer_function
    assert renderer.suggest_scene(ARRAY > 30).layers[0].volume.source.values.dtype == np.uint8
    assert renderer.suggest_scene(ARRAY.tolist()).layers[0].volume.source.shape == (5, 4, 3)


@pytest.mark.parametrize(("name", "tag"), [("a.mp4", "<video"), ("a.gif", "<img"), ("a&{frame:02}.png", "<img")])
def test_films_in_a_notebook(name: str, tag: str, tmp_path: Path) -> None:
    (tmp_path / name.format(frame=3)).write_bytes(b"film")
    shown = Film(tmp_path / name, (3, 4), tmp_path / "a.json", ("one < two",))._repr_html_()
    assert tag in shown and "base64,ZmlsbQ==" in shown and "2 frames" in shown and shown.endswith("</figure>")
    assert "one &lt; two" in shown and ("a&amp;{frame:02}.png" in shown) == name.endswith(".png")


def test_a_film_in_a_notebook_has_a_printable_name(tmp_path: Path) -> None:
    file = tmp_path / os.fsdecode(b"a\x1b\xff.gif")
    file.write_bytes(b"film")
    assert r"a\x1b\udcff.gif: 1 frame" in Film(file, (0,), tmp_path / "a.json")._repr_html_()


class Notebook(ModuleType):
    """IPython in the kernel of a notebook. It keeps what each handle shows."""

    def __init__(self) -> None:
        super().__init__("IPython")
        self.shown: list[list[str]] = []
        self.display = SimpleNamespace(HTML=str, display=self._display)

    def get_ipython(self) -> SimpleNamespace:
        return SimpleNamespace(kernel=None)

    def _display(self, html: str, *, display_id: bool) -> SimpleNamespace:
        assert display_id
        self.shown.append([html])
        return SimpleNamespace(update=self.shown[-1].append)


def test_a_notebook_shows_how_much_is_drawn(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    monkeypatch.setitem(sys.modules, "IPython", notebook := Notebook())
    turn = {"path": {"type": "turntable", "frames": 2}}
    renderer.render(renderer.suggest_scene(ARRAY, size=(16, 16), camera=turn, output="film.gif"))
    (told,) = notebook.shown
    assert [html.rpartition("> ")[2] for html in told] == ["0 of 2 frames", "1 of 2 frames", "2 of 2 frames"]
    assert told[1].startswith('<progress max="2" value="1">')
