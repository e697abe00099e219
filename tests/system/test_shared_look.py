"""`hsplat turntable --scene`: films of several volumes with the look of one scene."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from hsplat_cli import main

LOOK = """
volume: {file: gone.npy, component: 0}
transfer_function: {import: red.lut, relative: true, range: [50, 99], opacity: [[60, 0], [99, 0.3]]}
mask: {file: mask.npy, show: [1]}
camera: {path: {type: rocker, frames: 2}, target: [1, 2, 3], distance: 5}
annotation: {logo: logo.png, title: {text: "1e3", position: bottom}}
output:
  - {file: "x/{frame:02}.png", size: [64, 64]}
  - {file: "small/{frame}.png", size: [32, 32]}
  - {file: poster.png, frame: 0}
"""


@pytest.fixture(autouse=True)
def scans(folder: Path) -> None:
    """Write a look with its files in `looks`, and in `in` a ball in noise, a copy on another scale, and one of 5."""
    Path("looks").mkdir()
    Path("in").mkdir()
    Path("looks/look.yaml").write_text(LOOK, encoding="utf-8")
    Path("looks/red.lut").write_bytes(bytes(range(256)) + bytes(512))
    np.save("looks/mask.npy", np.ones((24, 24, 24), np.uint8))
    Image.new("RGB", (8, 8), "red").save("looks/logo.png")
    ball = np.maximum(0, 200 - 16 * np.sqrt(((np.indices((24, 24, 24)) - 11.5) ** 2).sum(axis=0)))
    ball += np.random.default_rng(0).normal(0, 1, ball.shape)
    np.save("in/a.npy", ball)
    np.save("in/b.npy", 4 * ball + 100)
    np.save("in/five.npy", np.full((8, 8, 8), 5, np.uint8))


def turntable(*arguments: str) -> int:
    return main.run(["turntable", *arguments, "--quiet"])


def scene(file: str) -> Any:
    return yaml.safe_load(Path(file).read_text(encoding="utf-8"))


def pixels(file: str) -> Any:
    return np.asarray(Image.open(file)).astype(int)


@pytest.mark.slow
def test_percentiles_give_volumes_of_any_scale_one_look(capfd: pytest.CaptureFixture[str]) -> None:
    """Files of the look are the same for the scenes, which are replaced unless they were edited."""
    assert turntable("in", "--scene", "looks/look.yaml", "-o", "out/films") == 2
    assert "looks/look.yaml:3:20: transfer_function: these percentiles of five.npy are one" in capfd.readouterr().err
    films = json.loads(Path("out/films/turntable.json").read_text(encoding="utf-8"))["films"]
    assert [(each["status"], each.get("kind")) for each in films[:2]] == [("done", "look.yaml")] * 2
    given, found = yaml.safe_load(LOOK), scene("out/films/b.yaml")
    assert found["volume"] == {"file": "../../in/b.npy", "component": 0}
    assert found["transfer_function"] == given["transfer_function"] | {"import": "../../looks/red.lut"}
    assert found["mask"]["file"] == "../../looks/mask.npy"
    assert found["annotation"] == {"logo": "../../looks/logo.png", "title": {"text": "1e3", "position": "bottom"}}
    assert found["camera"] == {"path": given["camera"]["path"], "target": "visible"}
    names = ["b/{frame:04}.png", "b_small/{frame}.png", "b_poster.png"]
    assert [each["file"] for each in found["output"]] == [f"out/films/{name}" for name in names]
    for name in ("a", "b"):
        sidecar = json.loads(Path(f"out/films/{name}/frames.json").read_bytes())
        low, *_, high = sidecar["scene"]["transfer_function"]["points"]
        values = np.sort(np.load(f"in/{name}.npy"), axis=None)
        ends = values[24**3 // 2 - 1], values[int(np.ceil(24**3 * 0.99)) - 1]
        assert (low["value"], high["value"]) == pytest.approx(ends, rel=1e-12)
    assert np.abs(pixels("out/films/a_poster.png") - pixels("out/films/b_poster.png")).max() <= 1
    assert main.run(["check", "out/films/b.yaml", "--no-cost"]) == 0
    assert turntable("in/a.npy", "--scene", "looks/look.yaml", "-o", "out/films") == 0
    edited = Path("out/films/a.yaml").read_text(encoding="utf-8").replace("0.3", "0.4")
    Path("out/films/a.yaml").write_text(edited, encoding="utf-8")
    assert turntable("in/a.npy", "--scene", "looks/look.yaml", "-o", "out/films") == 2


def test_values_are_matched_with_those_of_a_reference(capfd: pytest.CaptureFixture[str]) -> None:
    """A list of volumes takes the volume as its first."""
    layers = "volumes:\n- {file: ../in/five.npy, color: red, range: [50, 200]}\n- {file: mask.npy, labels: {}}\n"
    rest = "camera: {path: {type: turntable, frames: 1}}\noutput: {file: still.png, size: [16, 16]}\n"
    Path("looks/list.yaml").write_text(layers + rest, encoding="utf-8")
    assert turntable("in", "--scene", "looks/list.yaml", "--match", "in/a.npy", "-o", "out") == 2
    assert "in/five.npy: nothing to match\n  got: 5 in every voxel\n" in capfd.readouterr().err
    text = Path("out/b.yaml").read_text(encoding="utf-8")
    note = "values of b.npy are values of a.npy times 4, plus 100"
    assert f"# {note}\n" in text
    first, second = yaml.safe_load(text)["volumes"]
    assert (first["file"], second["file"]) == ("../in/b.npy", "../looks/mask.npy")
    assert first["range"] == pytest.approx([300, 900], rel=1e-3)
    films = json.loads(Path("out/turntable.json").read_text(encoding="utf-8"))["films"]
    assert [note in each.get("notes", ()) for each in films] == [False, True, False]


FLIGHT = "{type: flight, frames: 2, keys: [{position: [0, 0, 0], target: [1, 0, 0]}]}"
REFUSED: dict[str, tuple[str, str, list[str], str]] = {
    "a mistake": ("rocker", "rokcer", [], "looks/look.yaml:5:23: camera.path.type: unknown value"),
    "a flight": ("{type: rocker, frames: 2}", FLIGHT, [], "camera.path: a flight cannot frame other volumes"),
    "an option of films": ("", "", ["--size", "32"], "--size: this is for a volume without a scene"),
    "a format": ("", "", ["--format", "gif"], "--format: this is for a volume without a scene"),
    "percentiles with a reference": ("", "", ["--match", "in/a.npy"], "transfer_function.relative: cannot be matched"),
    "no reference": ("", "", ["--match", "in/no.npy"], "in/no.npy: no such file"),
    "no scene": ("", "", ["--scene", "no.yaml"], "no.yaml: no such file"),
    "a sidecar": (LOOK, "{}", [], "looks/look.yaml: not a scene"),
    "one name of two outputs": ("poster.png, frame: 0", '"y/small/{frame}.png"', [], "two outputs are one file"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_look_is_told_once(case: str, capfd: pytest.CaptureFixture[str]) -> None:
    before, after, options, message = REFUSED[case]
    Path("looks/look.yaml").write_text(LOOK.replace(before, after) if before else LOOK, encoding="utf-8")
    assert turntable("in", "--scene", "looks/look.yaml", "-o", "out", *options) == 2
    assert capfd.readouterr().err.count(message) == 1
    assert not Path("out").exists()


def test_a_look_is_needed_and_kept(capfd: pytest.CaptureFixture[str]) -> None:
    assert turntable("in/a.npy", "--match", "in/b.npy", "-o", "out") == 2
    Path("looks/a.npy").write_bytes(Path("in/a.npy").read_bytes())
    Path("looks/look.yaml").rename("looks/a.yaml")
    assert turntable("looks/a.npy", "--scene", "looks/a.yaml", "-o", "looks", "--force") == 2
    err = capfd.readouterr().err
    assert "--match in/b.npy: needs --scene" in err
    assert "looks/a.yaml: this output would overwrite an input" in err
