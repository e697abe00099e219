"""`hsplat render film.mp4.json`: the same film once more, byte for byte, wherever its files are by then."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import edit_sidecar, sidecar, small_scene

from hsplat_cli import main
from renderer.system import sources_digest

pytestmark = pytest.mark.usefixtures("scene_folder")

SCENE = small_scene(frames=7, size="48, 32")


def render(*arguments: str) -> None:
    assert main.run(["render", *arguments, "--quiet"]) == 0


def pictures(folder: Path) -> dict[str, bytes]:
    """The films and frames in a folder."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix in (".mp4", ".gif", ".png")}


# What times allow, and so whether they are met, differs from run to run; the film made again must not.
@pytest.mark.parametrize(
    ("schedule", "output", "frames"),
    [
        ("{tolerance: {0: 0.5, 6: 0.02}, probes: 16}", "{frame:03}.png", ["--frames", "::3"]),
        ("{tolerance: {0: 0, 2: 0, 3: 0.3, 5: 0.3, 6: 0}, probes: 16}", "film.gif", []),
        ("{splats: {0: 1, 6: 100}, probes: 16}", "film.mp4", ["--frames", "::3"]),
        ("{seconds: {0: 0.002, 6: 0.05}, probes: 16}", "film.mp4", []),
    ],
)
def test_the_same_bytes(schedule: str, output: str, frames: list[str], folder: Path) -> None:
    """From the sidecar, and from that of the film made again."""
    first, second, third = (folder / name for name in ("first", "second", "third"))
    asked = ["--set", f"error={schedule}", *frames]
    render("scene.yaml", *asked, "--output", str(first / output), "--best-effort")
    (path,) = first.glob("*.json")
    made, told = pictures(first), sidecar(path)
    assert len(made) == (len(told["frames"]) if "png" in output else 1)
    for name in made:
        (first / name).unlink()
    render(str(path))
    assert pictures(first) == made
    render(str(path), "--output", str(second / output))
    assert pictures(second) == made
    render(str(second / path.name), "--output", str(third / output))
    assert pictures(third) == made
    again = sidecar(third / path.name)
    assert [frame["tolerance"] for frame in again["frames"]] == [frame["tolerance"] for frame in told["frames"]]
    assert again["schedule"] == told["schedule"] | {"made_from": path.name}


def test_it_still_tells_what_was_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    render("scene.yaml", "--set", "error.seconds=0.0001", "--best-effort")
    first = sidecar()["schedule"]
    assert first["requested"] == {"seconds": 0.0001}
    assert not first["met"]
    assert not first["reproducible"]
    note = "the original film did not meet what was requested: seconds 0.0001"
    for _ in range(2):
        capsys.readouterr()
        assert main.run(["render", "film.mp4.json"]) == 0  # nothing is missed: it is what it is
        assert f"note: {note}\n" in capsys.readouterr().out
        again = sidecar()
        assert again["schedule"] == first | {"made_from": "film.mp4.json"}
        assert again["notes"] == [note]


def test_a_spacing_in_place_of_the_file_s_belongs_to_the_film(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is part of what frames depend on, and of the record, also when the file has moved."""
    np.save("scan.npy", np.arange(512, dtype=np.uint8).reshape(8, 8, 8))
    volume = ["--set", "volume={file: scan.npy}", "--set", "camera.distance=null"]
    spacing = [*volume, "--set", "volume.spacing=[1, 1, 2]"]
    render("scene.yaml", *volume)
    plain = Path("film.mp4").read_bytes()
    render("scene.yaml", *spacing)  # another film, of frames that are drawn again
    film = Path("film.mp4").read_bytes()
    assert film != plain
    told = sidecar()
    assert told["scene"]["volume"]["spacing"] == [1, 1, 2]
    capsys.readouterr()
    assert main.run(["render", "scene.yaml", *spacing]) == 0
    assert "up to date" in capsys.readouterr().err
    Path("scan.npy").rename("moved.npy")
    Path("film.mp4").unlink()
    render("film.mp4.json", "--volume", "moved.npy")
    assert Path("film.mp4").read_bytes() == film
    assert sidecar()["scene"]["volume"]["file"] == "moved.npy"


def test_another_schedule_and_size(folder: Path) -> None:
    """Options change the recorded scene; the accuracy is searched again."""
    render("scene.yaml", "--set", "error.seconds=0.0001", "--best-effort")
    changes = ("--set", "error.tolerance=0.3", "--set", "output.size=[96, 64]")
    render("film.mp4.json", *changes, "--output", "other.gif")
    schedule = sidecar("other.gif.json")["schedule"]
    assert schedule["requested"] == {"tolerance": 0.3}
    assert schedule["met"] and schedule["reproducible"]
    assert "shortfall" not in schedule
    assert schedule["made_from"] == "film.mp4.json"
    assert len(sidecar("other.gif.json")["notes"]) == 1, "only that of the GIF's rate"
    render("scene.yaml", *changes, "--output", "expected.gif")
    made = pictures(folder)
    assert made["other.gif"] == made["expected.gif"]


def test_other_words_about_the_volume_make_another_film() -> None:
    """Also where its voxels come out as they were: only where they are is no part of what a film is."""
    np.save("scan.npy", np.linspace(0, 255, 60, dtype=np.float32).reshape(3, 4, 5))
    render("scene.yaml", "--volume", "scan.npy", "--set", "error.splats=3")
    assert main.run(["render", "film.mp4.json", "--set", "volume.nodata=7", "--quiet"]) == 2
    render("film.mp4.json", "--set", "volume.nodata=7", "--output", "other.mp4")
    schedule = sidecar("other.mp4.json")["schedule"]
    assert schedule["requested"] == {"tolerance": schedule["tolerance"][0]}


def test_other_versions_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    render("scene.yaml")
    made = sidecar()

    def make_other(data: dict[str, Any]) -> None:
        data["device"] = "Other GL\x1b[31m"
        data["versions"] |= {"numpy": "1.0", "abandoned": "3.2"}
        data["fingerprint"]["depends_on"]["sources"] = "0" * 32

    edit_sidecar("film.mp4.json", make_other)
    assert main.run(["render", "film.mp4.json", "--force"]) == 0
    note = (
        "the bytes may differ from the original film, which had other versions: "
        f"numpy {np.__version__}, which was 1.0; device {made['device']}, which was 'Other GL\\x1b[31m'; "
        f"sources {sources_digest()}, which was {'0' * 32}"
    )
    assert f"note: {note}\n" in capsys.readouterr().out
    again = sidecar()
    assert again["notes"] == [note]
    assert (again["device"], again["versions"]) == (made["device"], made["versions"])


def test_a_coarse_pass_made_again() -> None:
    """It is the film that its tolerances ask for; that it did not meet more is told once."""
    render("scene.yaml", "--set", "error.tolerance=0.3")

    def make_coarse(data: dict[str, Any]) -> None:
        del data["fingerprint"]
        data["schedule"] |= {"requested": {"tolerance": 0}, "met": False, "reproducible": False, "shortfall": "no time"}

    edit_sidecar("film.mp4.json", make_coarse)
    for notes in (["the original film did not meet what was requested: tolerance 0"], []):
        render("film.mp4.json", "--force")
        made = sidecar()
        assert made["notes"] == notes
        assert made["schedule"] == {
            "requested": {"tolerance": 0.3},
            "tolerance": [0.3, 0.3],
            "cells": made["schedule"]["cells"],
            "met": True,
            "reproducible": True,
            "made_from": "film.mp4.json",
        }
