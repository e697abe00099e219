"""Tests of `hsplat measure`, from the scene file to the report and to the line for the scene file."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from small_scene import small_scene

from hsplat_cli import main
from hsplat_cli.measure import Measurement, measure_setting, open_at_any_tolerance
from renderer.errors import RenderError
from renderer.scene import Scene

SCENE = small_scene(shape="32, 32, 16", frames=8, size="24, 18", error="tolerance: 0.1")
FEW = ("--thorough", "--repeats", "1", "--frames", "0:8:4")


pytestmark = pytest.mark.usefixtures("scene_folder")


def measure(*arguments: str) -> None:
    assert main.run(["measure", "scene.yaml", "--quiet", *arguments]) == 0


def rows(folder: str = "scene.measured") -> list[dict[str, str]]:
    with (Path(folder) / "measure.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_the_sweep_is_the_product_of_its_lists(folder: Path) -> None:
    lists = ("--tolerances", "1,0.5", "--footprints", "gaussian,gouraud:6x2", "--measures", "rms:scalar")
    measure(*FEW, *lists, "--output", "out")
    found = {(row["series"], float(row["tolerance"]), int(row["frame"])) for row in rows("out")}
    series = {
        f"{footprint}, rms of scalar{correction}"
        for footprint in ("gaussian", "gouraud 6x2")
        for correction in ("", ", uncorrected")
    }
    assert found == {(name, tolerance, frame) for name in series for tolerance in (1.0, 0.5) for frame in (0, 4)}
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["index.html", "measure.csv", "measure.json"]
    data = json.loads((folder / "out" / "measure.json").read_text("utf-8"))
    assert data["scene"]["output"]["size"] == [24, 18]
    assert data["machine"]["cores"] >= 1 and data["machine"]["device"] and data["machine"]["versions"]["numpy"]


@pytest.mark.slow
def test_bricks_are_measured_beside_splats() -> None:
    """They are measured once, as they have no correction, at tolerances of their own, from coarse to exact."""
    measure(*FEW, "--measures", "optical")
    found = {name: [row for row in rows() if row["series"] == name] for name in {row["series"] for row in rows()}}
    assert set(found) == {"integrated, optical", "gaussian, optical", "gaussian, optical, uncorrected"}
    bricks, splats = found["integrated, optical"], found["gaussian, optical"]
    assert all(0 < int(row["num_primitives"]) <= int(row["num_cells"]) <= 4 for row in bricks)
    assert {row["opacity_correction"] for row in bricks} == {""}
    assert all(float(row["rays_per_pixel"]) > 0 for row in bricks) and {row["rays_per_pixel"] for row in splats} == {""}
    for series in (bricks, splats):
        first = [row for row in series if row["frame"] == "0"]
        tolerances = [float(row["tolerance"]) for row in first]
        assert len(tolerances) > 4 and 0.1 in tolerances
        assert tolerances == sorted(set(tolerances), reverse=True) and tolerances[-1] == 0
        assert float(first[-1]["psnr_db"]) > float(first[0]["psnr_db"]) + 3
    exact = [float(row["psnr_db"]) for row in bricks if row["tolerance"] == "0.0"]
    assert min(exact) > 20 + max(float(row["psnr_db"]) for row in splats)


def test_neighbours_among_the_frames_tell_flicker(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By default one frame is measured for it; what changes least has the least error."""
    few = ("--thorough", "--repeats", "1", "--footprints", "integrated", "--measures", "optical")
    measure(*few, "--tolerances", "1,0.1")
    assert "flicker 99 %" in capsys.readouterr().out
    names = ["flicker_rms", "flicker_p99", "flicker_largest", "flicker_block_p99", "flicker_block_largest"]
    found = {(row["tolerance"], row["frame"]): [row[name] for name in names] for row in rows()}
    assert {frame for _, frame in found} == {"0", "2", "3", "5"}
    assert all((numbers != [""] * 5) == (frame == "3") for (_, frame), numbers in found.items())
    coarse, fine = (list(map(float, found[tolerance, "3"])) for tolerance in ("1.0", "0.1"))
    assert all(one > other > 0 for one, other in zip(coarse, fine, strict=True))
    assert coarse[0] < coarse[1] <= coarse[2] and coarse[3] <= coarse[4] < coarse[2] < 255
    data = json.loads((folder / "scene.measured" / "measure.json").read_text("utf-8"))
    assert data["measurements"][0]["flicker"]["p99"] == coarse[1]
    assert "blocks 99 %" in (folder / "scene.measured" / "index.html").read_text("utf-8")


def test_single_voxels_are_drawn_once_for_all_measures_and_corrections(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Measurement] = []

    def remember(*arguments: Any, **options: Any) -> Measurement:
        drawn.append(measured := measure_setting(*arguments, **options))
        return measured

    monkeypatch.setattr("hsplat_cli.measure.study.measure_setting", remember)
    measure(*FEW, "--tolerances", "0", "--footprints", "gaussian")
    assert len(drawn) == 1
    assert len({row["series"] for row in rows()}) == 4
    assert len({row["psnr_db"] for row in rows() if row["frame"] == "0"}) == 1


@pytest.mark.parametrize(
    ("end", "num_before", "code", "note"),
    [
        (KeyboardInterrupt(), 1, 130, "interrupted: 1 setting had been measured"),
        (
            RenderError("the device is gone"),
            2,
            1,
            "ended by an error (the device is gone): 2 settings had been measured",
        ),
    ],
)
def test_measurements_before_the_end_are_kept(monkeypatch, capsys, end, num_before, code, note) -> None:
    num = 0

    def ending(*arguments: Any, **options: Any) -> Measurement:
        nonlocal num
        num += 1
        if num > num_before:
            raise end
        return measure_setting(*arguments, **options)

    monkeypatch.setattr("hsplat_cli.measure.study.measure_setting", ending)
    arguments = ["measure", "scene.yaml", "--quiet", *FEW, "--tolerances", "1,0.5,0.2,0.1"]
    assert main.run(arguments) == code
    assert len({row["tolerance"] for row in rows()}) == num_before
    assert note in capsys.readouterr().out


@pytest.mark.slow
def test_a_quick_study_agrees_with_a_whole_one(capsys: pytest.CaptureFixture[str]) -> None:
    """Its intervals, of nearly every setting, hold what all pixels say; the files have both ends."""
    lit = ("--set", "shading={ambient: 0.4, diffuse: 0.6}", "--frames", "0:8:4", "--tolerances", "2,1,0.5,0.2,0.05,0")
    measure(*lit, "--output", "quick")
    printed = capsys.readouterr().out
    assert "note: errors are estimates from 1024 exact rays of each frame" in printed and "95 %" in printed
    measure("--thorough", "--repeats", "1", "--footprints", "integrated", "--measures", "optical", *lit)
    found, whole = rows("quick"), rows()
    keys = ("series", "tolerance", "frame", "num_cells")
    assert [[row[key] for key in keys] for row in found] == [[row[key] for key in keys] for row in whole]
    for name in ("psnr_db", "rmse"):
        held = [
            float(row[f"{name}_low"]) <= float(exact[name]) <= float(row[f"{name}_high"])
            for row, exact in zip(found, whole, strict=True)
        ]
        assert sum(held) >= len(held) - 1
        # The error of a fine picture may be none, as far as its probes tell: both are then infinite, or 0.
        assert all(float(row[f"{name}_low"]) <= float(row[name]) <= float(row[f"{name}_high"]) for row in found)
    assert all(float(row["psnr_db_high"]) - float(row["psnr_db_low"]) < 3 for row in found[:4])  # the coarse ones
    assert not {"ssim", "flip", "volume_psnr_db"} & set(found[0])
    overall = json.loads((Path("quick") / "measure.json").read_text("utf-8"))["measurements"][0]["overall"]
    assert overall["everywhere"]["psnr_low"] < overall["everywhere"]["psnr"] < overall["everywhere"]["psnr_high"]
    assert overall["samples"]["num"] == 2 * 1024


def test_a_quick_study_chooses_frames_and_tolerances_as_a_whole_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """It needs no package of the metrics, and prepares the volume once."""
    prepared: list[Scene] = []

    def refuse() -> None:
        raise AssertionError("needs packages")

    def remember(scene: Scene, **options: Any) -> Any:
        prepared.append(scene)
        return open_at_any_tolerance(scene, **options)

    monkeypatch.setattr("hsplat_cli.measure.study.require_measuring_packages", refuse)
    monkeypatch.setattr("hsplat_cli.measure.study.open_at_any_tolerance", remember)
    measure("--set", "splat.footprint=gaussian")
    assert len(prepared) == 1
    found = rows()
    assert {row["series"] for row in found} == {"gaussian, optical"}
    assert {row["frame"] for row in found} == {"0", "2", "5"}
    assert {row["frame_draw_repetitions"] for row in found} == {"1"}
    tolerances = [float(row["tolerance"]) for row in found if row["frame"] == "0"]
    assert 0.1 in tolerances and 0 in tolerances and len(tolerances) > 4


@pytest.mark.slow
def test_the_line_for_the_scene_file_reaches_the_accuracy(capsys: pytest.CaptureFixture[str]) -> None:
    few = ("--set", "camera.path.frames=4")
    measure("--want", "flip=0.14", "--set", "splat.footprint=gaussian", *few)
    comment, line = capsys.readouterr().out.splitlines()
    tolerance = yaml.safe_load(line)["error"]["tolerance"]
    assert tolerance > 0
    assert comment.startswith("# ")
    every = ("--repeats", "1", "--frames", ":", "--footprints", "gaussian", "--measures", "optical")
    near = ("--corrections", "on", "--tolerances", f"{tolerance},{2.5 * tolerance}")
    measure("--thorough", *every, *near, "--output", "all", *few)

    def errors(at: float) -> list[float]:
        return [float(row["flip"]) for row in rows("all") if math.isclose(float(row["tolerance"]), at)]

    assert len(errors(tolerance)) == 4 and max(errors(tolerance)) < 0.154
    assert max(errors(2.5 * tolerance)) > 0.14  # a much coarser one would not do
