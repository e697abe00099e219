"""`hsplat measure` from the scene file to the report, and to the line for the scene file."""

from __future__ import annotations

import csv
import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from small_scene import small_scene

from hsplat_cli import main
from hsplat_cli.studies.measure import study
from hsplat_cli.studies.peers.vtk_peer import describe_vtk, vtk_settings
from renderer.errors import RenderError
from renderer.study import Measurement

SCENE = small_scene(shape="32, 32, 16", frames=8, size="48, 32", error="tolerance: 0.1")
QUICK = ("--repeats", "1", "--frames", "0:8:4")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with SCENE in scene.yaml."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.yaml").write_text(SCENE, encoding="utf-8")
    return tmp_path


def measure(*arguments: str) -> None:
    assert main.run(["measure", "scene.yaml", "--quiet", *arguments]) == 0


def rows(folder: str = "scene.measured") -> list[dict[str, str]]:
    with (Path(folder) / "measure.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_sweep_is_the_product_of_its_lists(folder: Path) -> None:
    measure(*QUICK, "--tolerances", "0.5,0.1,0", "--footprints", "gaussian,gouraud")
    found = {(row["series"], float(row["tolerance"]), int(row["frame"])) for row in rows()}
    series = {
        f"{footprint}, {measure}{correction}"
        for footprint in ("gaussian", "gouraud 8x3")
        for measure in ("optical", "rms")
        for correction in ("", ", uncorrected")
    }
    assert found == {(name, tolerance, frame) for name in series for tolerance in (0.5, 0.1, 0.0) for frame in (0, 4)}
    assert sorted(path.name for path in (folder / "scene.measured").iterdir()) == [
        "index.html",
        "measure.csv",
        "measure.json",
    ]


def test_bricks_beside_splats(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They are measured once, for they have no correction, at tolerances of their own."""
    measure(*QUICK, "--footprints", "integrated,gaussian", "--measures", "optical")
    found = {name: [row for row in rows() if row["series"] == name] for name in {row["series"] for row in rows()}}
    assert set(found) == {"integrated, optical", "gaussian, optical", "gaussian, optical, uncorrected"}
    bricks, splats = found["integrated, optical"], found["gaussian, optical"]
    assert all(row["num_splats"] == "" and 0 < int(row["num_cells"]) <= 4 for row in bricks)
    assert {row["opacity_correction"] for row in bricks} == {""}
    assert len({row["tolerance"] for row in bricks}) > 4
    assert min(float(row["psnr_db"]) for row in bricks if row["tolerance"] == "0.0") > 20 + max(
        float(row["psnr_db"]) for row in splats
    )
    assert "note: the integrated" not in capsys.readouterr().out


def test_bricks_alone(capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is said of splats; of the correction only where nothing but what is without was asked for."""
    options = (*QUICK, "--tolerances", "0.5,0.1", "--footprints", "integrated", "--measures", "optical")
    measure(*options)
    said = capsys.readouterr().out
    assert "T: no other setting of the same program is as fast and as exact.\n" in said and "note: the int" not in said
    measure(*options, "--corrections", "off")
    note = "note: the integrated footprint has no opacity correction to switch off; it is measured as it is\n"
    assert note in capsys.readouterr().out


def test_a_finer_tolerance_draws_more_and_is_nearer_to_the_truth() -> None:
    measure(*QUICK, "--footprints", "gaussian", "--measures", "optical", "--corrections", "on")
    first = [row for row in rows() if row["frame"] == "0"]
    tolerances = [float(row["tolerance"]) for row in first]
    assert tolerances == sorted(tolerances, reverse=True) and 0.1 in tolerances and tolerances[-1] == 0
    cells = [int(row["num_cells"]) for row in first]
    assert cells == sorted(set(cells))
    assert float(first[-1]["psnr_db"]) > float(first[0]["psnr_db"]) + 3


@pytest.mark.parametrize("goal", ["psnr=30", "seconds=0.1", "splats={0: 100, 7: 5000}"])
def test_a_scene_that_asks_for_no_tolerance_is_measured_at_those_that_suit_it(goal: str) -> None:
    series = ("--footprints", "gaussian", "--measures", "optical", "--corrections", "on")
    measure(*QUICK, *series, "--set", "error.tolerance=null", "--set", f"error.{goal}")
    assert len(rows()) >= 6
    data = json.loads((Path("scene.measured") / "measure.json").read_text("utf-8"))
    name = goal.partition("=")[0]
    assert data["notes"][0].startswith(f"the scene asks for error.{name}, not for a tolerance; ")


def test_single_voxels_are_drawn_once_for_all_measures_and_corrections(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Measurement] = []

    def remember(*arguments: Any, **options: Any) -> Measurement:
        drawn.append(measured := measure_setting(*arguments, **options))
        return measured

    measure_setting = study.measure_setting
    monkeypatch.setattr(study, "measure_setting", remember)
    measure(*QUICK, "--tolerances", "0", "--footprints", "gaussian")
    assert len(drawn) == 1
    assert len({row["series"] for row in rows()}) == 4
    assert len({row["psnr_db"] for row in rows() if row["frame"] == "0"}) == 1


def test_the_json_says_what_was_measured_on_what() -> None:
    measure(*QUICK, "--tolerances", "0.1", "--footprints", "gouraud:6x2", "--measures", "rms:scalar", "--output", "out")
    data = json.loads((Path("out") / "measure.json").read_text("utf-8"))
    assert data["scene"]["output"]["size"] == [48, 32]
    assert data["machine"]["cores"] >= 1 and data["machine"]["driver"] and data["machine"]["versions"]["numpy"]
    series = {measurement["series"] for measurement in data["measurements"]}
    assert series == {"gouraud 6x2, rms of scalar", "gouraud 6x2, rms of scalar, uncorrected"}


def test_a_peer_is_measured_beside(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The report says which it was, what drew it, and what puts it at a disadvantage."""
    monkeypatch.setattr(study, "vtk_settings", lambda: vtk_settings()[3:4])
    only = ("--tolerances", "0.5", "--footprints", "gaussian", "--measures", "optical", "--corrections", "on")
    measure(*QUICK, *only, "--peer", "vtk")
    data = json.loads((Path("scene.measured") / "measure.json").read_text("utf-8"))
    assert [measurement["series"] for measurement in data["measurements"]] == ["gaussian, optical", "vtk gpu"]
    own, peer = (measurement["pyramid_seconds"] for measurement in data["measurements"])
    assert own > 0 and peer is None
    assert data["machine"]["peer"] == {"name": "vtk", **describe_vtk()}
    assert (
        "note: VTK's frames have 8 bits, and hsplat's are compared before they are rounded to that; the rounding alone "
        "limits a picture to about 59 dB where the volume is visible\n"
    ) in capsys.readouterr().out


@pytest.mark.parametrize(
    ("end", "num_before", "code", "note"),
    [
        (KeyboardInterrupt(), 2, 130, "interrupted: 2 settings had been measured"),
        (KeyboardInterrupt(), 1, 130, "interrupted: 1 setting had been measured"),
        (
            RenderError("the device is gone"),
            2,
            1,
            "ended by an error (the device is gone): 2 settings had been measured",
        ),
    ],
)
def test_what_was_measured_before_the_end_is_kept(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    end: BaseException,
    num_before: int,
    code: int,
    note: str,
) -> None:
    num = 0

    def ending(*arguments: Any, **options: Any) -> Measurement:
        nonlocal num
        num += 1
        if num > num_before:
            raise end
        return measure_setting(*arguments, **options)

    measure_setting = study.measure_setting
    monkeypatch.setattr(study, "measure_setting", ending)
    arguments = ["measure", "scene.yaml", "--quiet", *QUICK, "--tolerances", "1,0.5,0.2,0.1"]
    assert main.run(arguments) == code
    assert len({row["tolerance"] for row in rows()}) == num_before
    assert note in capsys.readouterr().out


@pytest.mark.parametrize(("footprint", "drawn"), [("gaussian", "1 splat"), ("integrated", "1 brick")])
def test_what_an_even_volume_needs(footprint: str, drawn: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The trials and the result name what is drawn."""
    even = ["--set", "volume.procedural.name=constant", "--set", f"splat.footprint={footprint}"]
    assert main.run(["measure", "scene.yaml", "--want", "psnr=5", *even]) == 0
    told = capsys.readouterr()
    line, comment = told.out.splitlines()
    assert line == "error: {measure: optical, tolerance: 1}"
    assert f"; {drawn}; frame " in comment
    assert all(said.endswith(f", {drawn}") for said in told.err.splitlines() if said.startswith("tolerance "))
    measure("--want", "psnr=5", *even, "--frames", "3")
    assert re.fullmatch(f"# psnr [0-9.]+ dB on frame 3; {drawn}", capsys.readouterr().out.splitlines()[1])


@pytest.mark.parametrize("want", ["psnr=27", "rmse=0.05", "ssim=0.9", "flip=0.11"])
def test_the_line_for_the_scene_file_keeps_its_promise(want: str, capsys: pytest.CaptureFixture[str]) -> None:
    measure("--want", want, "--set", "splat.footprint=gaussian")
    line, comment = capsys.readouterr().out.splitlines()
    tolerance = yaml.safe_load(line)["error"]["tolerance"]
    assert tolerance > 0
    assert comment.startswith("# ")
    name, value = want.split("=")
    column = "psnr_db" if name == "psnr" else name
    every = (
        "--repeats",
        "1",
        "--frames",
        ":",
        "--footprints",
        "gaussian",
        "--measures",
        "optical",
        "--corrections",
        "on",
    )
    measure(*every, "--tolerances", f"{tolerance},{2.5 * tolerance}", "--output", "all")
    better = 1 if name in ("psnr", "ssim") else -1

    def margins(at: float) -> list[float]:
        found = [float(row[column]) for row in rows("all") if math.isclose(float(row["tolerance"]), at)]
        return [better * (number - float(value)) for number in found]

    slack = {"psnr": 1.0, "rmse": 0.1 * float(value), "ssim": 0.01, "flip": 0.1 * float(value)}[name]
    assert len(margins(tolerance)) == 8 and min(margins(tolerance)) > -slack
    assert min(margins(2.5 * tolerance)) < 0  # a much coarser one would not do
