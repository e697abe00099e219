"""Transfer functions of other programs: each format is read, and files that are wrong are refused with their place."""

from __future__ import annotations

import copy
import json
import math
import random
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from look_scene import look_scene as scene
from spoiling import spoil

from renderer.errors import InputError, SceneError
from renderer.looks import Look, merge_curves, place_look, read_look, read_preset
from renderer.scene import ColormapSpec, ShadingSpec, TransferSpec, parse_scene, scene_to_dict
from renderer.transfer import make_transfer_function

# By how much the opacity of an imported curve may be off.
MAX_OPACITY_ERROR = 1e-3

pytestmark = pytest.mark.usefixtures("folder")

SLICER = (
    '<MRML><VolumeProperty name="A" shade="1" ambient="0.1" diffuse="0.9" specular="0.2" specularPower="10" '
    'scalarOpacity="6 0 0 50 0.2 100 0.9" gradientOpacity="4 0 1 255 1" colorTransfer="8 0 0 0 0 100 1 0.5 0"/>'
    '<VolumeProperty name="B" shade="0" scalarOpacity="4 0 0 9 1" gradientOpacity="4 0 0 9 1" '
    'colorTransfer="4 5 1 1 1"/></MRML>'
)
COMPONENT: dict[str, Any] = {
    "shade": True,
    "lighting": {"ambient": 0.25, "diffuse": 1, "specular": 0, "specularPower": 1},
    "scalarOpacityUnitDistance": 2.5,
    "rgbTransferFunction": {"points": [{"x": 0, "color": [0, 0, 0]}, {"x": 9, "color": [1, 1, 1], "midpoint": 0.25}]},
    "scalarOpacity": {"points": [{"x": 0, "y": 0}, {"x": 9, "y": 1, "midpoint": 0.5, "sharpness": 0}]},
    "gradientOpacity": {"points": [{"x": 0, "y": 0}, {"x": 9, "y": 1}]},
}
VP_JSON = json.dumps({"volumeProperties": [{"components": [COMPONENT]}]})
TFI = (
    '<?xml version="1.0"?><VoreenData><TransFuncIntensity><domain x="100" y="200"/><threshold x="0" y="0.5"/>'
    '<gammaValue value="1"/><alphaMode value="1"/><Keys>'
    '<key><intensity value="0.5"/><split value="true"/><colorL r="255" g="0" b="0" a="51"/>'
    '<colorR r="0" g="255" b="0" a="102"/></key>'
    '<key><intensity value="1"/><split value="false"/><colorL r="0" g="0" b="255" a="0"/></key>'
    "</Keys></TransFuncIntensity></VoreenData>"
)
ITF = (
    '<InviwoWorkspace version="2"><maskMin content="0"/><maskMax content="1"/><type content="0"/><Points>'
    '<Point><pos content="0.75"/><rgba x="1" y="0" z="0" w="0.4"/></Point>'
    '<Point><pos content="0.25"/><rgba x="0" y="0" z="1" w="0"/></Point></Points></InviwoWorkspace>'
)
CLUT = "[FLT]\nmin=10\nmax=61\n[INT]\nnumnodes=2\n[BYT]\nnodeintensity0=0\nnodeintensity1=255\n[RGBA255]\n"
CLUT += "nodergba0=0|0|0|0\nnodergba1=255|51|0|102\n"
NIIVUE = json.dumps({"min": 10, "max": 61, "R": [0, 255], "G": [0, 51], "B": [0, 0], "A": [0, 102], "I": [0, 255]})
PARAVIEW = """[{"ColorSpace": "RGB", "Name": "A", "RGBPoints": [-1, 0, 0, 0, 1, 1, 1, 1],
  "Points": [-1, 0, 0.5, 0, 1, 0.4, 0.5, 0],},
 {"Name": "rainbow", "Annotations": ["1", "R"], "RGBPoints": [5, 0, 0, 1, 9, 1, 0, 0]},]"""


GRADIENT = "opacities by the gradient (shading.gradient_opacity has factors on extinctions)"
BENT = "midpoints and sharpness of rgbTransferFunction"
VOREEN = "the unit of opacities, 1/200 of the volume's width: without a unit in the scene they are for a voxel"
INVIWO = "the unit of opacities, 1/150 of the volume's width: without a unit in the scene they are for a voxel"

JUNK: list[Any] = [
    None, True, -1, 0, 3, 1e300, math.nan, 10**400, "", "\0", "~", "a.clut", "B", "ct-bone", [], [0], [0, 1],
    [1, 0], [[4, 1], [0, 0]], [[None, 1]], {}, {"a": 1}, b"x",
]  # fmt: skip


def read(name: str, content: str | bytes, look: str | None = None) -> Look:
    return read_look(Path(name), content.encode() if isinstance(content, str) else content, look)


def refusal(section: dict[str, Any]) -> str:
    with pytest.raises(SceneError) as error:
        scene(section)
    return str(error.value)


# Formats

RAMP = bytes(range(256))
BLACK, RED, GREEN, BLUE, WHITE = (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)
CLEAR = (*BLACK, 0)
RISE = [(0, *CLEAR), (50, 0.5, 0.25, 0, 0.2), (100, 1, 0.5, 0, 0.9)]
STEP = [(0, *BLUE), (0, *RED), (1, *RED)]
HALVES = [(0, *BLUE), (0.5, *BLUE), (0.5, *RED), (1, *RED)]
FAINT = [(0, *CLEAR), (1, *RED, 64 / 255)]
SLOPE = [(0, *WHITE, 0), (5, *WHITE, 5 / 9), (9, *WHITE, 1)]
PAIR = [(0.25, *BLUE, 0), (0.75, *RED, 0.4)]
BLUES = [(k / 255, 0, 0, k / 255) for k in range(256)]
SHARES, TABLE = ([(low, *CLEAR), (high, 1, 0.2, 0, 0.4)] for low, high in ((0, 1), (10, 61)))
SWAPPED = SLICER.replace('"A"', '"C"').replace('"B"', '"A"')
KEYS = [(150, *RED, 0.2), (150, *GREEN, 0.4), (200, *BLUE, 0)]
BLUE_RED = [(0, *BLUE), (1, *RED)]
FADE = [(0, *CLEAR), (9, *WHITE, 1)]
LIGHT = {"light": "camera", "two_sided": True, "ambient": 0.1, "diffuse": 0.9, "specular": 0.2, "shininess": 40.0}
VP = "1\n1\n0.42\n0.44\n0.46\n38.5\n4 0 0 9 1\n4 0 1 9 1\n8 0 0 0 0 9 1 1 1\n"
VP_LIGHT = LIGHT | {"ambient": 0.44, "diffuse": 0.42, "specular": 0.46, "shininess": 154.0}


# File, content, curve, and attributes of the look; the name in the file is A where it has several.
FORMATS: dict[str, tuple[str, str | bytes, list[tuple[float, ...]], dict[str, Any]]] = {
    "Slicer": ("a.xml", SLICER, RISE, {"unit": 1.0, "left_out": (), "shading": LIGHT}),
    "Slicer, by the gradient": ("a.xml", SWAPPED, SLOPE, {"left_out": (GRADIENT,), "shading": {}}),
    "Slicer, no gradient": ("a.xml", SWAPPED.replace('"4 0 0 9 1" c', '"0" c'), SLOPE, {"left_out": ()}),
    "Slicer, VTK's light": ("a.xml", SLICER.replace('ambient="0.1"', "").replace('specularPower="10"', ""), RISE,
                            {"shading": LIGHT}),
    "Slicer .vp": ("a.vp", VP, FADE, {"shading": VP_LIGHT, "left_out": ()}),
    "Slicer .vp, an empty line": ("a.vp", VP.replace("4 0 1 9 1", ""), FADE, {"shading": VP_LIGHT}),
    "Slicer .vp.json": ("a.vp.json", VP_JSON, FADE, {"unit": 2.5, "left_out": (BENT, GRADIENT)}),
    "Voreen": ("a.tfi", TFI, KEYS, {"span": (100, 200), "is_share": False, "left_out": (VOREEN, "its threshold")}),
    "Inviwo": ("a.itf", ITF, PAIR, {"is_share": True, "left_out": (INVIWO,)}),
    "Inviwo, values": ("a.itf", ITF.replace('type content="0"', 'type content="1"'), PAIR, {"is_share": False}),
    "Inviwo, a mask": ("a.itf", ITF.replace('Min content="0"', 'Min content="0.3"'), PAIR,
                       {"left_out": (INVIWO, "its mask")}),
    "MRIcroGL": ("a.clut", CLUT, TABLE, {"is_share": False}),
    "MRIcroGL, shares": ("a.clut", CLUT.replace("=10", "=0").replace("=61", "=0"), SHARES, {"is_share": True}),
    "niivue": ("a.json", NIIVUE, TABLE, {"is_share": False}),
    "niivue without alpha": ("a.json", '{"R": [0, 255], "G": [0, 0], "B": [0, 0]}', FAINT, {"is_share": True}),
    "ImageJ": ("a.lut", bytes(512) + RAMP, BLUES, {"is_share": True, "has_opacities": False}),
    "ImageJ, a header": ("a.lut", b"ICOL\0\0\1\0" + bytes(24 + 512) + RAMP, BLUES, {"is_share": True}),
    "ImageJ, four colours": ("a.lut", b"ICOL\0\0\0\4" + bytes(24 + 8) + b"\0\0\0\xff",
                             [(256 * k / 1020, 0, 0, k // 3) for k in range(4)], {"is_share": True}),
    "ImageJ, text": ("a.lut", "Index Red Green Blue\n0 0 0 255\n1 255 0 0\n", BLUE_RED, {}),
    "ImageJ, commas": ("a.lut", "0,0,255\n255,0,0\n", BLUE_RED, {}),
    "FSLeyes": ("a.cmap", "0 0 1\n1 0 0\n", BLUE_RED, {"is_share": True}),
    "ParaView": ("a.json", PARAVIEW, [(0, *CLEAR), (1, *WHITE, 0.4)], {"is_share": True, "left_out": ()}),
    "ParaView, a range": ("a.json", '{"RGBPoints": [5, 0, 0, 1, 9, 1, 0, 0]}', [(5, *BLUE), (9, *RED)],
                          {"span": (5, 9), "is_share": False, "has_opacities": False}),
    "ParaView, a step": ("a.json", '{"RGBPoints": [0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 1]}',
                         [(0, *RED), (1, *RED), (1, *BLUE)], {}),
    "ParaView, steps": ("a.json", '{"ColorSpace": "Step", "RGBPoints": [0, 0, 0, 1, 1, 1, 0, 0]}', STEP, {}),
    "ParaView, one step": ("a.json", '{"ColorSpace": "Step", "RGBPoints": [1, 0, 0, 1]}', [(1, *BLUE)], {}),
    "ParaView, another space": ("a.json", '{"ColorSpace": "Oklab", "RGBPoints": [0, 0, 0, 1, 1, 1, 0, 0]}', BLUE_RED,
                                {"left_out": ("interpolation in the colour space Oklab",)}),
    "ParaView, labels": ("a.json", '{"IndexedColors": [0, 0, 1, 1, 0, 0]}', HALVES, {}),
}  # fmt: skip


@pytest.mark.parametrize("case", FORMATS)
def test_a_file_is_read_as_its_program_reads_it(case: str) -> None:
    file, content, expected, attributes = FORMATS[case]
    look = read(file, content, "A" if file == "a.xml" or content == PARAVIEW else None)
    assert [value for value, _ in look.curve] == [value for value, *_ in expected]
    assert [parts for _, parts in look.curve] == [pytest.approx(tuple(parts)) for _, *parts in expected]
    assert {key: getattr(look, key) for key in attributes} == attributes


@pytest.mark.parametrize("space", ["Lab", "HSV", "Diverging", "Step"])
def test_colours_between_points_are_those_of_vtk(space: str) -> None:
    rendering = pytest.importorskip("vtkmodules.vtkRenderingCore")
    numbers = [0, 0.23, 0.3, 0.75, 0.4, 0.87, 0.86, 0.87, 0.7, 0.9, 0.5, 0.1, 1, 0.7, 0.02, 0.15]
    look = read("a.json", json.dumps([{"Name": "a", "ColorSpace": space, "RGBPoints": numbers}]))
    transfer = rendering.vtkColorTransferFunction()
    getattr(transfer, f"SetColorSpaceTo{space}")()
    transfer.HSVWrapOff()
    for k in range(0, len(numbers), 4):
        transfer.AddRGBPoint(*numbers[k : k + 4])
    at = np.linspace(0.001, 0.999, 999) + 1e-6
    expected = np.array([transfer.GetColor(value) for value in at])
    points = place_look(look, span=(0, 1), scale=1, shift=0, opacities=None)
    found = [np.interp(at, [p[0] for p in points], [p[1][k] for p in points]) for k in range(3)]
    straight = np.column_stack([np.interp(at, numbers[::4], numbers[k::4]) for k in (1, 2, 3)])
    assert np.abs(straight - expected).max() > 0.05
    assert np.abs(np.column_stack(found) - expected).max() < 0.02


# Physics and places


@pytest.mark.parametrize("ends", [(0, 1), (1, 0), (0, 0.5), (0.2, 0.999), (0.7, 0.70001)])
@pytest.mark.parametrize("unit", [0.3, 1.0, 7.0])
def test_opacities_are_as_linear_as_in_the_other_program(ends: tuple[float, float], unit: float) -> None:
    look = Look([(-5.0, (0, 0, 0, ends[0])), (5.0, (1, 1, 1, ends[1]))])
    points = place_look(look, span=None, scale=1, shift=0, opacities=None)
    assert len(points) < 40
    section = {"points": [{"value": v, "color": list(c), "opacity": a} for v, c, a in points], "unit": unit}
    transfer = make_transfer_function(scene(section).layers[0].transfer_function, finest_spacing=1.0)
    at = np.linspace(-5, 5, 5001)
    colors, extinctions = transfer.classify(at)
    opaque = -math.expm1(-40 * unit)  # what the cap of extinctions makes of opacity 1
    expected = np.minimum(np.interp(at, [-5, 5], ends), opaque)
    assert np.abs(-np.expm1(-extinctions * unit) - expected).max() <= MAX_OPACITY_ERROR * 1.01
    assert colors[:, 0] == pytest.approx(np.linspace(0, 1, 5001), abs=1e-9)


def test_curves_with_steps_are_merged() -> None:
    first = [(0.0, (0.0,)), (2.0, (2.0,)), (2.0, (5.0,))]
    second = [(1.0, (10.0,)), (3.0, (30.0,))]
    assert merge_curves(first, second) == [(0, (0, 10)), (1, (1, 10)), (2, (2, 20)), (2, (5, 20)), (3, (5, 30))]


@pytest.mark.parametrize("values", [(-1.7e308, 0, 1.7e308), (1.5e-323, 2e-323, 2.5e-323)])
def test_curves_of_the_largest_and_the_smallest_values_are_merged(values: tuple[float, float, float]) -> None:
    low, middle, high = values
    merged = merge_curves([(low, (0.0,)), (high, (1.0,))], [(middle, (1.0,))])
    assert [value for value, _ in merged] == [low, middle, high] and 0 <= merged[1][1][0] < 1


def test_values_are_put_where_the_scene_says() -> None:
    Path("a.clut").write_text(CLUT)
    Path("share.itf").write_text(ITF)

    def ends(**keys: Any) -> tuple[float, float]:
        mapping = scene({"import": "a.clut", **keys}).layers[0].transfer_function.mapping
        assert isinstance(mapping, tuple)
        return mapping[0].value, mapping[-1].value

    assert ends() == (10, 61)
    assert ends(shift=5, scale=2) == (25, 127)
    assert ends(range=[0, 1]) == (0, 1)
    assert ends(**{"import": "share.itf"}, range=[100, 300]) == (150, 250)


def test_a_scene_says_opacities_and_unit_in_place_of_the_file() -> None:
    Path("a.xml").write_text(SLICER)
    Path("a.cmap").write_text("0 0 1\n1 0 0\n")
    spec = scene({"import": "a.xml", "name": "A"}).layers[0].transfer_function
    assert spec.unit == 1.0
    assert scene({"import": "a.xml", "name": "A", "unit": 3}).layers[0].transfer_function.unit == 3
    section = {"import": "a.cmap", "range": [0, 8], "opacity": [[2, 0], [4, 1], [4, 0.5]]}
    mapping = scene(section).layers[0].transfer_function.mapping
    assert isinstance(mapping, tuple)
    assert [(point.value, round(point.opacity, 9)) for point in mapping] == [(0, 0), (2, 0), (4, 1), (4, 0.5), (8, 0.5)]
    assert mapping[1].color == (0.25, 0, 0.75)


def test_what_is_imported_is_recorded_as_points() -> None:
    Path("a.xml").write_text(SLICER)
    imported = scene({"import": "a.xml", "name": "A", "shift": -7})
    plain = scene_to_dict(imported)
    assert set(plain["transfer_function"]) == {"points", "unit"}
    Path("a.xml").unlink()
    assert parse_scene(plain, base=Path(), is_single_frame=True) == imported


def test_notes_say_what_was_left_out_and_how_to_light_it() -> None:
    Path("a.xml").write_text(SLICER)
    (note,) = scene({"import": "a.xml", "name": "B"}).import_notes
    assert note.startswith("a.xml: not imported: opacities by the gradient")
    (note,) = scene({"import": "a.xml", "name": "A"}).import_notes
    section = yaml.safe_load(note.partition("add ")[2])["shading"]
    assert ShadingSpec(**section) == ShadingSpec(0.1, 0.9, "camera", 0.2, 40.0, True)


def test_presets_can_be_drawn() -> None:
    names = yaml.safe_load((Path(read_look.__code__.co_filename).with_name("presets.yaml")).read_text())
    assert len(names) >= 12
    for name in names:
        section = {"import": name} | ({"range": [0, 255]} if read_preset(name).is_share else {})
        made = scene(section)
        assert isinstance(made.layers[0].transfer_function, TransferSpec)
        assert not isinstance(made.layers[0].transfer_function.mapping, ColormapSpec)
        assert all(before.value <= after.value for before, after in pairwise(made.layers[0].transfer_function.mapping))
        for note in made.import_notes:
            ShadingSpec(**yaml.safe_load(note.partition("add ")[2])["shading"])


# Refusals

BOMB = '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]><MRML>&b;</MRML>'
HOSTILE = {
    "an entity bomb": ("a.xml", BOMB, "has a document type"),
    "cut off XML": ("a.xml", SLICER[:-30], "a.xml:1: not valid XML"),
    "no volume property": ("a.xml", "<MRML/>", "no volume properties"),
    "a wrong count": ("a.xml", SLICER.replace('"6 0', '"8 0').replace("B", "A2", 1), "not as many numbers"),
    "a NaN": ("a.xml", SLICER.replace("0.2 100", "nan 100"), "A scalarOpacity: not such a number\n  got: 'nan'"),
    "too opaque": ("a.xml", SLICER.replace("0.2 100", "1.2 100"), "expected: a finite number from 0 to 1"),
    "no numbers": ("a.xml", SLICER.replace("8 0 0 0 0 100 1 0.5 0", ""), "a.xml: no colours"),
    "not UTF-8": ("a.tfi", b"<a>\n\xff</a>", "a.tfi:2: not a text file in UTF-8"),
    "UTF-16": ("a.xml", SLICER.encode("utf-16"), "not a text file in UTF-8"),
    "few lines": ("a.vp", "1\n1\n", "too few lines"),
    "cut off JSON": ("a.json", NIIVUE[:-20] + "\n", "a.json:"),
    "deep JSON": ("a.json", '{"R": ' + "[" * 100_000, "not valid JSON: too many levels"),
    "deep XML": ("a.tfi", "<a>" * 100_000 + "</a>" * 100_000, "no <TransFuncIntensity>"),
    "long digits": ("a.json", '{"R": [' + "9" * 5000 + "]}", ""),
    "lists of different lengths": ("a.json", NIIVUE.replace("[0, 102]", "[0]"), "not lists of one length"),
    "true for a number": ("a.json", NIIVUE.replace("102", "true"), "not such a number"),
    "no colormaps": ("a.json", "[1, 2]", "no colormaps"),
    "no components": ("a.vp.json", '{"volumeProperties": [{"components": []}]}', "no rgbTransferFunction"),
    "no points": ("a.vp.json", VP_JSON.replace('"x": 0, ', ""), "not such a number"),
    "keys without colour": ("a.tfi", TFI.replace("colorL", "color"), "<key>: no <colorL>"),
    "a missing node": ("a.clut", CLUT.replace("nodergba1", "node"), "the file: no nodergba1"),
    "many nodes": ("a.clut", CLUT.replace("numnodes=2", "numnodes=1e9"), "numnodes: not such a number"),
    "a colour of three": ("a.clut", CLUT.replace("|102", ""), "node 1: not a colour"),
    "bytes of another size": ("a.lut", bytes(767), "a.lut:1: not a colour or opacity"),
    "rows of four": ("a.cmap", "0 0 0\n0 0 0 1\n", "a.cmap:2: not a colour"),
    "a label without colour": ("a.txt", "1 a 0 0 0 0\n9 name\n", "a.txt:2: not a row of a table of labels"),
    "names without colours": ("a.txt", "1 a\n", "no colours"),
    "many rows": ("a.cmap", "0 0 0\n" * 70_000, "too many points"),
    "a table that is cut off": ("a.lut", b"ICOL\0\0\0\4" + bytes(24) + bytes(9), "the bytes: not a colour"),
    "a long transparency": ("a.txt", "1 a 255 0 0 99999\n", "a.txt:1: not such a number\n  got: '99999'"),
    "lists in lists": ("a.json", NIIVUE.replace("102", "[" * 900 + "]" * 900), "got: [[[[[[[...]]]]]]]"),
    "a list for light": ("a.vp.json", VP_JSON.replace('"lighting": {', '"lighting": [], "x": {'), "no lighting"),
    "more points than are allowed": ("a.json", json.dumps({"ColorSpace": "Lab", "RGBPoints": [
        number for k in range(2**9) for number in (k, k % 2, 0, 0)]}), "too many points\n  got: 1025"),
    "an unknown suffix": ("a.png", b"\x89PNG", "not a kind of transfer function"),
}  # fmt: skip


@pytest.mark.parametrize("case", HOSTILE)
def test_wrong_files_are_refused_with_their_place(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    name, content, expected = HOSTILE[case]
    if case == "more points than are allowed":
        for file in ("look_import", "paraview"):
            monkeypatch.setattr(f"renderer.looks.{file}.MAX_LOOK_POINTS", 2**10)
    with pytest.raises(InputError) as error:
        read(name, content, "A" if "VolumeProperty" in str(content) and ".xml" in name else None)
    assert expected in str(error.value) and str(error.value).startswith(name)
    Path(name).write_bytes(content.encode() if isinstance(content, str) else content)
    assert f"transfer_function.import: {name}" in refusal({"import": name}) or "name" in refusal({"import": name})


def test_a_file_that_is_cut_off_anywhere_is_read_or_refused() -> None:
    files = {"a.xml": SLICER, "a.vp.json": VP_JSON, "a.tfi": TFI, "a.itf": ITF, "a.clut": CLUT, "a.json": PARAVIEW}
    num_refused = 0
    for name, content in files.items():
        for length in range(0, len(content), 7):
            try:
                read(name, content[:length])
            except InputError:
                num_refused += 1
    assert num_refused > 200


POINT = {"value": 0, "color": "white", "opacity": 1}
STEEP = json.dumps({"R": [0] * 9000, "G": [0] * 9000, "B": [0] * 9000, "A": [0, 255] * 4500})
FILES = {"a.xml": SLICER, "a.json": PARAVIEW, "a.clut": CLUT, "a.itf": ITF, "a.cmap": "0 0 1\n1 0 0\n", "s.json": STEEP,
         "clear.json": NIIVUE.replace("102", "0"), "large.json": " " * (2**22 + 1)}  # fmt: skip
REFUSALS: list[tuple[dict[str, Any], str]] = [
    ({"import": "ct-bonr"}, "did you mean ct-bone?"),
    ({"import": "a.xml"}, "transfer_function.name: a.xml: has several transfer functions"),
    ({"import": "a.json", "name": "Rainbow"}, "did you mean rainbow?"),
    ({"import": "a.clut", "name": "x"}, "no name, for there is one only"),
    ({"import": "a.clut", "points": [POINT]}, "contradicts transfer_function.import"),
    ({"points": [POINT], "scale": 2}, "needs transfer_function.import"),
    ({"points": [POINT], "scale": "log"}, "contradicts transfer_function.points"),
    ({"import": "a.clut", "scale": "log"}, "contradicts transfer_function.import"),
    ({"colormap": "gray", "range": [1, 2], "scale": 2}, "needs transfer_function.import"),
    ({"colormap": "gray", "range": [0, 2], "opacity": [[1, 1]], "scale": "log"}, "range.0: no logarithm"),
    ({"colormap": "gray", "range": [1, 2], "opacity": [[-1, 1]], "scale": "log"}, "opacity.0.0: no logarithm"),
    ({"colormap": "gray", "range": [1, 2], "scale": "lgo"}, "did you mean log?"),
    ({"import": "a.clut", "scale": 0}, "out of range"),
    ({"import": "a.clut", "scale": 1e308}, "its values become too large"),
    ({"import": "a.itf"}, "transfer_function.range: missing"),
    ({"import": "a.cmap", "range": [0, 8]}, "transfer_function.opacity: missing"),
    ({"import": "s.json", "range": [0, 1]}, "too many points"),
    ({"import": "clear.json"}, "transfer_function.import: nothing is visible"),
    ({"import": "folder.clut"}, "not a file"),
    ({"import": "b.clut"}, "no such file"),
    ({"import": "large.json"}, "too large for a transfer function"),
]  # fmt: skip


@pytest.mark.parametrize(("section", "expected"), REFUSALS)
def test_a_section_that_is_wrong_is_refused(section: dict[str, Any], expected: str) -> None:
    Path("folder.clut").mkdir()
    if (name := section.get("import")) in FILES:
        Path(name).write_text(FILES[name])
    assert expected in refusal(section)


def test_spoilt_sections_are_refused_or_make_a_scene() -> None:
    Path("a.xml").write_text(SLICER)
    section = {"import": "a.xml", "name": "A", "range": [0, 9], "opacity": [[0, 0], [4, 0.5], [4, 1], [9, 1]],
               "shift": 1, "scale": 2, "unit": 3}  # fmt: skip
    choose, num_read, texts = random.Random(1), 0, list[str]()
    for _ in range(400):
        tree = copy.deepcopy(section)
        for _ in range(choose.randint(1, 3)):
            spoil(tree, choose, JUNK, ["x", "points", 0])
        try:
            made = scene(tree)
        except SceneError as error:
            texts.append(str(error))
        else:
            num_read += 1
            assert parse_scene(scene_to_dict(made), base=Path(), is_single_frame=True) == made
    assert 0 < num_read < 300 and not any("object at" in text for text in texts)
