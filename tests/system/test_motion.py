"""A film in motion: each frame is that of a still scene, however the film is made."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from small_scene import small_scene

from hsplat_cli import main
from renderer.scene import load_scene, scene_to_dict

NUM_FRAMES = 6
SCENE = small_scene(frames=NUM_FRAMES, size="48, 32")
LAST = NUM_FRAMES - 1

pytestmark = pytest.mark.usefixtures("scene_folder")

# What moves: the layers, what is drawn of them, and what they are drawn over.
MOTIONS = {
    "a transfer function": ["transfer_function.points.0.value={0: 0, 5: 60}", "shading={occlusion: 0.5}",
                            "transfer_function.points.2.color={0: red, 5: blue}",
                            "transfer_function.points.2.opacity={0: 0.2, 5: 0.9}"],
    "a plane": ["clip=[{plane: {point: {0: [60, 0, 0], -1: [10, 0, 0], easing: smooth}, normal: [1, 0, 0]}}]",
                "camera.target=visible"],
    "light": ["shading={light: {0: [1, 0, 0], -1: [0, 0, 1]}, specular: {0: 0, -1: 1}}"],
    "a camera": ["camera.field_of_view={0: 10, -1: 60}", "camera.path.elevation={0: -40, -1: 40}",
                 "output.background={0: black, -1: white}"],
    "a crop": ["volume.crop={0: {x: [0, 10]}, 5: {x: [2, 16]}}"],
    "splats": ["splat={footprint: gaussian, sigma: {0: 0.4, -1: 1}}", "error.tolerance={0: 0.5, -1: 0.1}"],
    "an attenuation": ["mode={type: attenuation, scale: {0: 0.0001, -1: 0.001}, zero: 0}", "transfer_function={points: "
                       "[{value: 0, color: black}, {value: 1, color: white}]}"],
    "a flight": ["camera.path=[{type: turntable, frames: 2}, {type: flight, frames: 4, keys: [{position: [30, 30, 60], "
                 "target: [8, 8, 8]}]}]"],
}  # fmt: skip


def render(*arguments: str) -> None:
    assert main.run(["render", *arguments, "--quiet"]) == 0


def pictures(folder: Path) -> list[bytes]:
    return [(folder / f"{frame}.png").read_bytes() for frame in range(NUM_FRAMES)]


def film(folder: Path, *changes: str) -> tuple[list[str], dict[str, Any]]:
    """Draw a film; return the changes as arguments, and its sidecar."""
    arguments = [part for change in changes for part in ("--set", change)]
    render("scene.yaml", *arguments, "--output", str(folder / "{frame}.png"))
    return arguments, json.loads((folder / "frames.json").read_text("utf-8"))


@pytest.mark.parametrize("name", MOTIONS)
def test_each_frame_is_that_of_a_still_scene(name: str, folder: Path) -> None:
    """With the numbers of that frame, and the target and the distance of the film."""
    _, told = film(folder / "film", *MOTIONS[name])
    scene = load_scene(Path("scene.yaml"), overrides=MOTIONS[name])
    assert len(set(pictures(folder / "film"))) >= NUM_FRAMES - 1  # a flight begins where a turn ended
    target, distance = tuple(told["camera"]["target"]), told["camera"]["distance"]
    for frame in (0, 2, LAST):
        still = scene.at(frame)
        still = replace(still, camera=replace(still.camera, target=target, distance=distance))
        Path("still.json").write_text(json.dumps(scene_to_dict(still)), "utf-8")
        render("still.json", "--frames", str(frame), "--output", str(folder / "still.png"))
        assert (folder / "still.png").read_bytes() == (folder / "film" / f"{frame}.png").read_bytes(), frame


@pytest.mark.slow
def test_however_it_is_made(folder: Path, scheduler: str) -> None:
    """In parts, on a cluster, and again from its sidecar."""
    changes = [*MOTIONS["a transfer function"], *MOTIONS["a plane"], *MOTIONS["a camera"]]
    arguments, told = film(folder / "film", *changes)
    expected = pictures(folder / "film")
    render("scene.yaml", *arguments, "--output", str(folder / "cluster" / "{frame}.png"), "--scheduler", scheduler)
    assert pictures(folder / "cluster") == expected
    for part in ("0::2", "1::2"):
        render("scene.yaml", *arguments, "--frames", part, "--output", str(folder / "parts" / "{frame}.png"))
    parts, whole = sorted(map(str, (folder / "parts").glob("*.json"))), folder / "whole" / "{frame}.png"
    assert main.run(["assemble", *parts, "--output", str(whole), "--quiet"]) == 0
    assert pictures(folder / "whole") == expected
    render(str(folder / "film" / "frames.json"), "--output", str(folder / "again" / "{frame}.png"))
    assert pictures(folder / "again") == expected
    assert main.run(["verify", str(folder / "whole" / "frames.json"), "--quiet", "--precision", "3"]) == 0
    moved = told["frames"][LAST]["values"]
    assert moved["clip.0.plane.point"] == [10, 0, 0] and moved["camera.field_of_view"] == 60


@pytest.mark.parametrize("change", [*MOTIONS["a flight"], "camera.loop=ping-pong"])
def test_parts_of_a_longer_path(change: str, folder: Path) -> None:
    """The number of frames is that of all pieces, or of the way there and back."""
    for part in ("0:4", "4:"):
        render("scene.yaml", "--set", change, "--frames", part, "--output", str(folder / "{frame}.png"))
    parts = sorted(map(str, folder.glob("*.json")))
    assert main.run(["assemble", *parts, "--output", str(folder / "film.gif"), "--quiet"]) == 0


def test_what_is_visible_does_not_jump(folder: Path) -> None:
    """The target is the centre of all that is visible on any frame, unless the camera follows."""
    targets = []
    for follow in ("false", "true"):
        _, told = film(folder / follow, *MOTIONS["a plane"], f"camera.follow={follow}")
        targets.append(told["camera"]["target"])
    stays, follows = pictures(folder / "false"), pictures(folder / "true")
    assert targets[0] == targets[1]
    assert stays[LAST] != follows[LAST]


@pytest.mark.slow
def test_goals_hold_in_motion(folder: Path) -> None:
    _, told = film(folder / "film", *MOTIONS["a transfer function"], "error={psnr: 40, probes: 16}")
    assert told["schedule"]["met"] and told["accuracy"]["psnr"] > 38
