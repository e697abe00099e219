"""Tests of `hsplat render` on scenes with an accuracy: it is found, holds for the whole film, and is recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import pytest
import yaml
from commands import python
from small_scene import sidecar, small_scene

from hsplat_cli import main
from renderer.accuracy import TRUTH_TOLERANCE, compute_metric, compute_truth
from renderer.draw import Rasterizer
from renderer.film import over_background
from renderer.frame import prepare_stage, render_frames
from renderer.job import search_tolerances
from renderer.scene import Scene, load_scene, parse_scene, parse_yaml, with_tolerance
from renderer.volume import Float64

pytestmark = pytest.mark.usefixtures("scene_folder")

NUM_FRAMES = 12
# Splats, whose accuracy hardly differs between frames: few pixels decide that of a small picture of bricks.
SCENE = small_scene(
    shape="32, 32, 16", frames=NUM_FRAMES, size="24, 16", error="psnr: 27, probes: 16", footprint="gaussian"
)
BEYOND = ("--set", "error.psnr=150")
RMSE = ("--set", "error.psnr=null", "--set", "error.rmse=0.045")
FEWER_FRAMES = ("--set", "camera.path.frames=8")
EXTRAS = ("skimage", "flip_evaluator", "scipy", "vtkmodules")


def render(*arguments: str, code: int = 0) -> None:
    assert main.run(["render", "scene.yaml", *arguments]) == code


@pytest.fixture(scope="module")
def truths() -> list[Float64]:
    """Return the exact pictures of all frames of SCENE."""
    stage = prepare_stage(parse_scene(parse_yaml(SCENE).data, base=Path()), clock=lambda: 0.0, num_threads=1)
    return [compute_truth(stage, frame, TRUTH_TOLERANCE).picture for frame in range(NUM_FRAMES)]


def accuracies(metric: str, scene: Scene, truths: Sequence[Float64], rasterizer: Rasterizer) -> list[float]:
    """Return the metric of the pictures of all frames."""
    stage = prepare_stage(scene, clock=lambda: 0.0, num_threads=1)
    drawn = render_frames(stage, range(len(truths)), rasterizer, clock=lambda: 0.0)
    pictures = [over_background(frame.radiance, scene.output.background) for frame in drawn]
    return [compute_metric(metric, picture, truth) for picture, truth in zip(pictures, truths, strict=True)]


@pytest.mark.parametrize(
    ("metric", "change", "wanted"), [("psnr", (), 27.0), pytest.param("rmse", RMSE, 0.045, marks=pytest.mark.slow)]
)
def test_the_whole_film_has_the_accuracy(
    metric: str, change: tuple[str, ...], wanted: float, rasterizer_for, truths: list[Float64]
) -> None:
    """All frames but one or two do, and none is much too good in the mean."""
    render("--quiet", *change)
    made = sidecar()
    scene = with_tolerance(load_scene(Path("scene.yaml")), made["frames"][0]["tolerance"])
    values = accuracies(metric, scene, truths, rasterizer_for(scene))
    decibels = np.array([value if metric == "psnr" else -20 * np.log10(value) for value in values])
    margins = decibels - (wanted if metric == "psnr" else -20 * np.log10(wanted))
    assert np.count_nonzero(margins < 0) <= 2
    assert margins.min() > -0.5
    assert margins.mean() < 3
    measured = made["schedule"]["measured"]
    tried = {frame: values[frame] for frame in measured["probes"]}
    assert measured["worst"] == pytest.approx(tried[measured["frame"]], rel=0.04 if metric == "psnr" else 0.2)


@pytest.mark.slow
def test_a_search_is_printed_and_recorded(capsys: pytest.CaptureFixture[str]) -> None:
    """The film equals one at the tolerance that was found, though the pyramid for the search holds more."""
    render("--output", "found/{frame}.png")
    printed, made = capsys.readouterr(), sidecar("found/frames.json")
    schedule, tolerance, measured = made["schedule"], made["scene"]["error"]["tolerance"], made["schedule"]["measured"]
    assert tolerance > 0
    assert {frame["tolerance"] for frame in made["frames"]} == {tolerance}
    assert list(schedule) == ["requested", "tolerance", "cells", "met", "reproducible", "measured"]
    assert (schedule["requested"], schedule["tolerance"]) == ({"psnr": 27}, [tolerance, tolerance])
    assert schedule["met"] and schedule["reproducible"]
    assert measured["metric"] == "psnr" and measured["worst"] >= 27
    assert {0, NUM_FRAMES - 1} < {*measured["probes"]}
    num = len(measured["probes"])
    assert printed.out.splitlines()[0].endswith(f", psnr {measured['worst']:.2f} dB or better on {num} probe frames")
    lines = printed.err.splitlines()
    assert any(line.startswith("tolerance ") and " dB on frame 0, " in line for line in lines)
    assert f"{NUM_FRAMES}/{NUM_FRAMES} frames, " in lines[-1]
    given = ("--set", "error.psnr=null", "--set", f"error.tolerance={tolerance}")
    render("--quiet", "--output", "given/{frame}.png", *given)
    for frame in range(NUM_FRAMES):
        assert Path(f"found/{frame}.png").read_bytes() == Path(f"given/{frame}.png").read_bytes()


@pytest.mark.slow
def test_tolerances_of_bricks_vary_along_the_film_and_are_made_again(scheduler: str) -> None:
    bricks = ("--set", "splat.footprint=integrated", "--set", "error.psnr=46", *FEWER_FRAMES)
    render("--quiet", *bricks)
    tolerances = [frame["tolerance"] for frame in sidecar()["frames"]]
    assert len({*tolerances}) > 1
    film = Path("film.mp4").read_bytes()
    render("--quiet", *bricks, "--force", "--scheduler", scheduler)
    assert Path("film.mp4").read_bytes() == film
    assert main.run(["render", "film.mp4.json", "--output", "again.mp4", "--quiet"]) == 0
    assert Path("again.mp4").read_bytes() == film


@pytest.mark.slow
def test_a_film_that_misses_the_accuracy_says_so(monkeypatch, capsys) -> None:
    """Its own rays notice what the trial pictures did not."""

    def too_coarse(*arguments: Any, **options: Any) -> Any:
        found = search_tolerances(*arguments, **options)
        return replace(found, by_frame=dict.fromkeys(found.by_frame, 1e9))

    monkeypatch.setattr("renderer.job.plan.search_tolerances", too_coarse)
    render("--quiet", *FEWER_FRAMES, code=1)
    shortfall = sidecar()["schedule"]["shortfall"]
    assert shortfall.startswith("error.psnr: the film is less exact than requested\n  got: ")
    assert f"{shortfall}\n" == capsys.readouterr().err
    render("--quiet", *FEWER_FRAMES, "--best-effort")


@pytest.mark.slow
def test_measure_finds_a_tolerance_for_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    """It prints a line that takes the place of what the scene asks for. Whole truths need no margin."""
    render("--quiet", *RMSE, *FEWER_FRAMES)
    assert main.run(["measure", "scene.yaml", "--quiet", "--thorough", "--want", "rmse=0.045", *FEWER_FRAMES]) == 0
    line = yaml.safe_load(capsys.readouterr().out.splitlines()[-1])["error"]
    assert line.keys() == {"measure", "tolerance"}
    assert 0.3 < sidecar()["scene"]["error"]["tolerance"] / line["tolerance"] < 1.3


@pytest.mark.slow
def test_a_film_beyond_full_resolution_is_whole(capsys: pytest.CaptureFixture[str]) -> None:
    """Whole, with every voxel; only the exit code, a note and the record of it depend on what was asked for."""
    render("--quiet", *BEYOND, code=1)
    assert np.asarray(imageio.imread("film.mp4", index=None)).shape == (NUM_FRAMES, 16, 24, 3)
    without, error = sidecar(), capsys.readouterr().err
    render("--quiet", *BEYOND, "--best-effort")
    assert capsys.readouterr() == ("", "")
    render(*BEYOND, "--best-effort", "--force")
    made = sidecar()
    assert made["scene"]["error"]["tolerance"] == 0
    assert not made["schedule"]["met"]
    assert made["schedule"]["measured"]["worst"] < 40
    assert made["schedule"] == without["schedule"]
    assert f"{made['schedule']['shortfall']}\n" == error
    *_, note = capsys.readouterr().out.splitlines()
    assert note.startswith("note: the requested accuracy is beyond full resolution: psnr ")
    assert note.endswith(" splats at tolerance 0, not psnr 150.00 dB")


def test_an_interrupted_search_leaves_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*arguments: Any, **options: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("renderer.job.plan.search_tolerances", interrupt)
    render("--quiet", code=130)
    assert [path.name for path in folder.iterdir()] == ["scene.yaml"]


def test_a_part_of_a_film_of_bricks_is_probed_on_its_own_frames() -> None:
    bricks = ("--set", "splat.footprint=integrated", "--set", "error.psnr=40")
    render("--quiet", "--frames", "3:7", "--output", "{frame}.png", *bricks)
    schedule = sidecar("frames.3-6.json")["schedule"]
    assert schedule["met"] and schedule["tolerance"][0] > 0 and schedule["measured"]["worst"] >= 40
    assert schedule["measured"]["probes"] == [3, 4, 5, 6]


def test_a_still_is_probed_on_itself(capsys: pytest.CaptureFixture[str]) -> None:
    render("--frames", "5", "--output", "{frame}.png")
    measured = sidecar("frames.5.json")["schedule"]["measured"]
    assert (measured["frame"], measured["probes"]) == (5, [5])
    assert capsys.readouterr().out.splitlines()[0].endswith(f", psnr {measured['worst']:.2f} dB")


def test_lines_and_transparency_do_not_count() -> None:
    """An overlay is no error, and a transparent film is compared over black."""
    film = ("--quiet", "--frames", "0:3")
    render(*film, "--output", "plain/{frame}.png")
    change = ("--set", "annotation.octree=true", "--set", "output.background=transparent")
    render(*film, "--output", "lines/{frame}.png", *change)
    plain, lines = sidecar("plain/frames.0-2.json"), sidecar("lines/frames.0-2.json")
    assert lines["schedule"]["tolerance"] == pytest.approx(plain["schedule"]["tolerance"], rel=0.15)
    assert lines["schedule"]["measured"]["worst"] == pytest.approx(plain["schedule"]["measured"]["worst"], abs=0.5)
    assert Path("lines/0.png").read_bytes() != Path("plain/0.png").read_bytes()


def test_an_infinite_psnr_is_left_out_of_the_sidecar() -> None:
    crop = ("--set", "volume.crop=[[0, 2], [0, 2], [0, 2]]")  # air
    render("--quiet", *crop)
    assert sidecar()["schedule"]["measured"].keys() == {"metric", "frame", "probes"}
    assert sidecar()["schedule"]["met"]


@pytest.mark.slow
def test_packages_of_measure_are_not_needed(folder: Path) -> None:
    block = f"import sys; sys.modules.update(dict.fromkeys({EXTRAS!r}))"
    run = "from hsplat_cli.main import run; sys.exit(run(['render', 'scene.yaml', '--frames', '0', *sys.argv[1:]]))"
    done = python("-c", f"{block}; {run}", "--quiet", *RMSE)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert sidecar()["schedule"]["met"]
