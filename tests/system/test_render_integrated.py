"""Films of bricks, by every schedule; and the words for bricks in what is printed."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from small_scene import small_scene

from hsplat_cli import main

NUM_FRAMES = 4

SCENE = small_scene(shape="48, 40, 24", frames=NUM_FRAMES, size="48, 32", error="tolerance: 0.1", footprint=None)
NO_TOLERANCE = ("--set", "error.tolerance=null")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with SCENE in scene.yaml."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.yaml").write_text(SCENE, encoding="utf-8")
    return tmp_path


def render(*options: str, scene: str = "scene.yaml") -> dict[str, Any]:
    assert main.run(["render", scene, "--quiet", *options]) == 0
    data: dict[str, Any] = json.loads(Path("film.mp4.json").read_text(encoding="utf-8"))
    return data


def column(made: dict[str, Any], key: str) -> list[Any]:
    return [frame[key] for frame in made["frames"]]


def test_the_sidecar_of_another_footprint(folder: Path) -> None:
    """What it says of splats without being asked does not stand in the way; what was asked for does."""
    render()
    Path("film.mp4").rename("bricks.mp4")
    render("--set", "splat.footprint=gouraud")
    assert (
        main.run(["render", "film.mp4.json", "--quiet", "--set", "splat.footprint=integrated", "--output", "a.mp4"])
        == 0
    )
    assert Path("a.mp4").read_bytes() == Path("bricks.mp4").read_bytes()
    render("--set", "splat={order: boxes}")
    assert main.run(["check", "film.mp4.json", "--set", "splat.footprint=integrated"]) == 2


def test_bricks_are_called_bricks(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("bricks", "splats"):
        assert main.run(["render", "scene.yaml", "--frames", "0:2"]) == 0
        told = capsys.readouterr()
        other = {"bricks": "splats", "splats": "bricks"}[name]
        assert f"{name} a frame" in told.out + told.err and other not in told.out + told.err
        Path("scene.yaml").write_text(SCENE + "splat: {footprint: gaussian}\n", encoding="utf-8")


def test_one_brick_is_no_bricks(capsys: pytest.CaptureFixture[str]) -> None:
    """Nor one frame frames."""
    one = ["scene.yaml", "--set", "volume.procedural.shape=[8, 8, 8]", "--frames", "0", "--output", "one.png"]
    for how in ([], ["--progressive", "--force"]):
        assert main.run(["render", *one, *how]) == 0
        told = capsys.readouterr()
        assert "1 brick a frame" in told.out and told.err.endswith(", 1 brick\n")
        assert "1 bricks" not in told.out + told.err and "one.png: 1 frame in " in told.out
    budget = [*NO_TOLERANCE, "--set", "error.splats=1", "--set", "output.frames_per_second=1"]
    assert main.run(["check", "scene.yaml", *budget]) == 0
    told = capsys.readouterr()
    assert "optical, at most 1 brick\n" in told.out and "4 s at 1 frame per second\n" in told.out


def test_a_budget_of_bricks(folder: Path) -> None:
    """The last frame may have all that there are."""
    made = render(*NO_TOLERANCE, "--set", "error.splats={0: 1, 3: 100}")
    cells, tolerances = column(made, "cells"), column(made, "tolerance")
    assert cells[0] == 1 and cells[-1] == 18 and tolerances[-1] == 0
    assert all(a <= b for a, b in pairwise(cells)) and all(a >= b for a, b in pairwise(tolerances))


def test_a_budget_of_time(folder: Path) -> None:
    """So much that the finest detail fits."""
    made = render(*NO_TOLERANCE, "--set", "error.seconds=20")
    assert column(made, "tolerance") == [0] * NUM_FRAMES
    assert all(0 < seconds < 20 for seconds in column(made, "predicted_seconds"))
    assert made["schedule"]["met"] and not made["schedule"]["reproducible"]


def test_an_accuracy(folder: Path) -> None:
    """Splats do not come near to it at any tolerance."""
    made = render(*NO_TOLERANCE, "--set", "error.psnr=50")
    assert made["schedule"]["met"] and made["schedule"]["measured"]["worst"] >= 50
    assert len({*column(made, "tolerance")}) == 1 and column(made, "tolerance")[0] > 0
    with_splats = ["render", "scene.yaml", "--quiet", *NO_TOLERANCE, "--set", "error.psnr=50"]
    assert main.run([*with_splats, "--set", "splat.footprint=gaussian"]) == 1


def test_a_film_that_refines(folder: Path) -> None:
    render("--set", "error.tolerance=0")
    plain = Path("film.mp4").read_bytes()
    made = render("--set", "error.tolerance=0", "--progressive", "--force")
    assert Path("film.mp4").read_bytes() == plain
    tolerances = [each["tolerance"] for each in made["passes"]]
    assert tolerances[-1] == [0, 0] and all(a[0] > b[0] for a, b in pairwise(tolerances))


@pytest.mark.parametrize(
    "settings", ["pyramid={average: opacity, precision: single}", "error={measure: rms, of: scalar, tolerance: 2}"]
)
def test_means_and_errors_of_any_kind(folder: Path, settings: str) -> None:
    made = render("--set", settings, "--set", "shading={ambient: 0.4}", "--set", "overlay=octree")
    assert column(made, "cells")[0] > 1
