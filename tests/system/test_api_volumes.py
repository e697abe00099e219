"""Several volumes, labels and masks are drawn by the Python API to the same bytes as a scene of their files."""

from __future__ import annotations

import doctest
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mypy import api as mypy_api

import renderer
from renderer.scene import ArraySource, dump_yaml, scene_to_dict

z, y, x = np.mgrid[-1:1:12j, -1:1:14j, -1:1:16j]
SCAN = (100 * np.clip(5 * (0.9 - np.sqrt(x * x + y * y + z * z)), 0, 1) + 5 * np.sin(9 * x)).astype(np.float32)
LABELS = (1 * ((x - 0.3) ** 2 + y * y + z * z < 0.1) + 2 * ((x + 0.4) ** 2 + y * y + z * z < 0.1)).astype(np.uint8)
CHANNELS = [(900 * np.exp(-9 * ((x - at) ** 2 + y * y + z * z)) + 9 * x + 9).astype(np.uint16) for at in (-0.5, 0, 0.5)]
# More values than there may be labels.
NOISE = np.random.default_rng(1).random((42, 42, 42))
AFFINE = np.array([[0, 2.0, 0, 3], [1, 0, 0, 4], [0, 0, -1.5, 5], [0, 0, 0, 1]])
SIZE: Any = {"size": (24, 20)}


@pytest.fixture(autouse=True)
def _folder(folder: Path) -> None:
    pass


def sections_of(tree: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the keys of each volume and mask of a scene."""
    for entry in tree.get("volumes", [tree]):
        yield entry.get("volume", entry)
        yield from filter(None, [entry.get("mask")])
    if "volumes" in tree:
        yield from filter(None, [tree.get("mask")])


def with_files(scene: renderer.FilmScene) -> str:
    """The scene as a scene file has it, with the values of each array in a file of its own."""
    tree = scene_to_dict(scene)
    arrays = [each for layer in scene.at(0).layers for each in layer.volumes.values()]
    if scene.has_list and scene.at(0).shared.mask is not None:  # type: ignore[union-attr]
        arrays = [layer.volume for layer in scene.at(0).layers] + [arrays[1]]
    for number, (section, volume) in enumerate(zip(sections_of(tree), arrays, strict=True)):
        source = volume.source
        assert isinstance(source, ArraySource) and section.pop("array")["shape"] == list(source.shape)
        np.save(f"{number}.npy", source.values)
        section["file"] = f"{number}.npy"
    return dump_yaml(tree)


@pytest.mark.parametrize(
    ("volumes", "options", "names", "blend"),
    [
        (CHANNELS, {}, ["", "", ""], "add"),
        ({"DAPI": CHANNELS[0], "actin": CHANNELS[1]}, {"spacing": (1, 1, 2)}, ["DAPI", "actin"], "add"),
        (SCAN, {"labels": LABELS, "mask": z > 0}, ["", "labels"], "mix"),
        (SCAN, {"mask": renderer.Layer(LABELS, labels={"show": [2]})}, [""], "mix"),
        (LABELS, {"labels": {1: "liver", 2: "spleen"}}, [""], "mix"),
        ([renderer.Layer(SCAN, "scan", transfer_function=[(50, "white", 0), (90, "white", 0.02)], mask=LABELS),
          renderer.Layer(CHANNELS[0], transfer_function="magma"), renderer.Layer(LABELS, labels={})], {},
         ["scan", "", ""], "mix"),
    ],
)  # fmt: skip
def test_volumes_are_drawn_like_files(volumes: Any, options: dict[str, Any], names: list[str], blend: str) -> None:
    scene = renderer.suggest_scene(volumes, output="{frame}.png", **SIZE, **options)
    assert ([layer.name for layer in scene.at(0).layers], scene.blend) == (names, blend)
    assert {layer.mask is not None for layer in scene.at(0).layers} >= {"mask" in options}
    image = renderer.render_frame(volumes, 20, **SIZE, **options)
    assert image.max() > 60 and np.array_equal(renderer.render_frame(scene, 20), image)
    Path("scene.yaml").write_text(with_files(scene), "utf-8")
    assert np.array_equal(renderer.render_frame("scene.yaml", 20), image)


def test_labels_lie_in_a_translucent_shell_and_keep_their_names() -> None:
    scene = renderer.suggest_scene(SCAN, labels=renderer.Layer(LABELS, labels={"liver": 1, "spleen": 2}), **SIZE)
    shell, labels = scene.at(0).layers
    assert [style.name for style in labels.transfer_function.labels.styles] == ["liver", "spleen"]  # type: ignore[union-attr]
    assert shell.shading is not None and shell.shading.gradient_opacity is not None and shell.weight != 1.0
    gray = renderer.suggest_scene(SCAN, labels=LABELS, transfer_function="gray", **SIZE).at(0).layers[0]
    assert gray.transfer_function.mapping.colormap == "gray" and gray.weight != 1.0  # type: ignore[union-attr]


def test_a_scene_of_arrays_can_be_changed() -> None:
    scene = renderer.suggest_scene({"scan": SCAN}, mask=LABELS, **SIZE)
    plain = renderer.render_frame(scene)
    assert np.array_equal(renderer.render_frame(scene, camera=scene.camera), plain)
    options: Any = [{"mask": x > 0}, {"spacing": (1, 1, 3)}, {"transfer_function": "magma"}, {"background": "white"}]
    shown = [renderer.render_frame(scene, **each).tobytes() for each in ({}, *options)]
    assert len({*shown}) == 5, "each makes another picture"
    film = renderer.render(scene, frames=[0], output="film.gif")
    assert film.frames == (0,) and renderer.render(scene, frames=[0], output="film.gif") == film


def test_arrays_lie_where_the_first_volume_does() -> None:
    """It may be a file. A layer with a place of its own lies there."""
    first = renderer.Layer(SCAN, affine=AFFINE, unit="mm")
    layers = renderer.suggest_scene([first, LABELS, renderer.Layer(SCAN, spacing=(3, 3, 3))]).at(0).layers
    assert [layer.volume.source.affine is not None for layer in layers] == [True, True, False]  # type: ignore[union-attr]
    assert layers[0].volume.source.affine == layers[1].volume.source.affine == tuple(map(tuple, AFFINE))  # type: ignore[union-attr]
    assert layers[0].volume.unit == "mm" and layers[2].volume.source.spacing == (3.0, 3.0, 3.0)  # type: ignore[union-attr]
    np.save("scan.npy", SCAN)
    of_file = renderer.render_frame("scan.npy", spacing=(1, 2, 1), mask=LABELS, **SIZE)
    assert np.array_equal(of_file, renderer.render_frame(SCAN, spacing=(1, 2, 1), mask=LABELS, **SIZE))


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: renderer.render_frame([]), "volume: no volume\n  got: []"),
        (lambda: renderer.render_frame({}), "volume: no volume\n  got: {}"),
        (lambda: renderer.render_frame({1: SCAN}), "volume: not the name of a volume\n  got: 1"),
        (lambda: renderer.render_frame([SCAN, LABELS[1:]]),
         "the array 2: this array does not have the shape of the first volume\n  got: shape [11, 14, 16]\n"
         "  expected: shape [12, 14, 16], [z, y, x]\n  hint: `renderer.Layer("),
        (lambda: renderer.render_frame(SCAN, mask=LABELS.T),
         "the mask: this array does not have the shape of the first volume\n  got: shape [16, 14, 12]\n"
         "  expected: shape [12, 14, 16], [z, y, x]\n  hint: its axes may be"),
        (lambda: renderer.render_frame({"a": SCAN, "b": SCAN * np.nan}), "the array b: no voxel has data"),
        (lambda: renderer.render_frame({"a": SCAN, "b": "no.nii"}), "volumes.1.file: no such file"),
        (lambda: renderer.render_frame({"a": SCAN, "b": SCAN}, spacing=(1, 0, 1)), "spacing.1: out of range\n  got: 0\n"
         "  expected: a number from 1e-30 to 1e+30"),
        (lambda: renderer.render_frame(SCAN, labels=SCAN), "the array labels: this volume is no map of labels"),
        (lambda: renderer.render_frame(NOISE, labels=NOISE), "the array labels: this volume is no map of labels"),
        (lambda: renderer.render_frame(SCAN, mask=SCAN), "the mask: this volume is no map of labels"),
        (lambda: renderer.render_frame(CHANNELS, labels={1: "a"}), "labels: names of labels, but not of which volume"),
        (lambda: renderer.render_frame(CHANNELS, transfer_function="gray"), "transfer_function: of several volumes"),
        (lambda: renderer.render_frame(LABELS, labels={}, transfer_function="gray"), "transfer_function: contradicts"),
        (lambda: renderer.render_frame(LABELS, labels={"show": [7]}), "labels.show.0: no such label"),
        (lambda: renderer.render_frame(renderer.suggest_scene(SCAN), labels=LABELS),
         "labels: a scene takes no further"),
        (lambda: renderer.render_frame(renderer.Layer(SCAN, affine=np.eye(3))), "the array: affine: not an affine\n"
         "  got: shape [3, 3]\n"),
    ],
)  # fmt: skip
def test_wrong_volumes(call: Any, told: str) -> None:
    with pytest.raises(renderer.InputError) as error:
        call()
    assert str(error.value).startswith(told) and str(error.value).count(told) == 1, str(error.value)


@pytest.mark.slow
def test_the_examples_run() -> None:
    Path("scene.yaml").write_text(with_files(renderer.suggest_scene(SCAN, **SIZE)), "utf-8")
    scene = renderer.suggest_scene(SCAN, **SIZE)
    names: dict[str, Any] = {"renderer": renderer, "np": np, "Path": Path, "array": SCAN, "scene": scene}
    functions = ("load_scene", "suggest_scene", "render_frame", "render", "preview", "integrate")
    for name in functions:
        examples = doctest.DocTestParser().get_examples(getattr(renderer, name).__doc__)
        assert examples, name
        for example in examples:
            exec(example.source, names)
    assert names["film"].path == Path("draft.gif") and names["psnr"] > 30


SCRIPT = """
import numpy as np
import renderer

array = np.zeros((3, 4, 5), np.float32)
scene = renderer.suggest_scene({"a": array, "b": renderer.Layer(array, spacing=(1, 1, 2))}, mask=array > 0)
reveal_type(scene)
reveal_type(renderer.render_frame([array, array], size=(64, 64), labels={1: "liver"}))
reveal_type(renderer.render("scene.yaml", on_progress=lambda done, total: None))
reveal_type(renderer.preview(array))
reveal_type(renderer.integrate(scene).standard_error)
renderer.render_frame(array, size="large")
"""


@pytest.mark.slow
def test_type_checkers_know_the_types(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("script.py").write_text(SCRIPT, "utf-8")
    monkeypatch.setenv("MYPYPATH", "")
    told, _, _ = mypy_api.run(["--strict", "--no-error-summary", "--hide-error-context", "script.py"])
    lines = told.splitlines()
    revealed = [line.partition('"')[2].rstrip('"') for line in lines if "note: Revealed type" in line]
    assert [each.rpartition(".")[2] for each in revealed] == ["FilmScene", "FrameImage", "Film", "Page", "float"]
    assert [line for line in lines if "error" in line] == [line for line in lines if '"size"' in line] != []
