"""What a user reads about scenes that ask for an accuracy or have a budget: that it is not met, and what it is."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from hsplat_cli import main
from hsplat_cli.studies.measure.notes import scene_notes
from renderer.scene import load_scene

SMALL = ["--set", "camera.path.frames=6", "--set", "output.size=[32, 32]", "--set", "volume.procedural.shape=[8, 8, 8]"]
# What full resolution reaches is in the last digits the driver's affair.
NUMBER = r"\d+(\.\d+)?(e-\d+)?"


def schedule(text: str) -> list[str]:
    """Options that put another schedule in the place of the scene's tolerance."""
    return ["--set", "error.tolerance=null", "--set", f"error.{text}"]


@pytest.mark.parametrize(
    ("text", "level", "got", "expected", "limit"),
    [
        (
            "psnr=200",
            0,
            f"psnr {NUMBER} dB on frame [0-5], with \\d+ bricks?",
            "psnr 200.00 dB",
            "docs/footprints.md says what limits it",
        ),
        (
            "rmse=1e-8",
            30,
            f"rmse {NUMBER} on frame [0-5], with 1 brick",
            "rmse 1e-08",
            "error.finest_level: 30 lets no cell be smaller",
        ),
    ],
)
@pytest.mark.usefixtures("scene_folder")
def test_an_accuracy_beyond_full_resolution(
    text: str, level: int, got: str, expected: str, limit: str, capsys: pytest.CaptureFixture[str]
) -> None:
    finest = ["--set", f"error.finest_level={level}"]
    assert main.run(["render", "scene.yaml", *SMALL, "--quiet", *schedule(text), *finest]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    wanted = (
        f"error.{text.partition('=')[0]}: the requested accuracy is beyond full resolution\n"
        f"  got: {got} at tolerance 0\n"
        f"  expected: {re.escape(expected)}\n"
        f"  hint: the film is drawn at tolerance 0, and with --best-effort it is good enough; {limit}\n"
    )
    assert re.fullmatch(wanted, err), err
    assert Path("engine.mp4").stat().st_size > 0


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("tolerance={0: 0.5, 60: 0.02}", "optical, tolerance 0.5 to 0.02"),
        ("splats=100000", "optical, at most 100000 bricks"),
        ("splats={0: 1000, 60: 1234567}", "optical, at most 1000 to 1234567 bricks"),
        ("splats=1", "optical, at most 1 brick"),
        ("seconds=0.1", "optical, 0.1 s a frame"),
        ("seconds={0: 0.1, 60: 2}", "optical, 0.1 to 2 s a frame"),
        ("psnr=38", "optical, psnr 38 dB"),
        ("rmse=0.01", "optical, rmse 0.01"),
    ],
)
@pytest.mark.usefixtures("scene_folder")
def test_check_says_what_is_asked_for(text: str, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["check", "scene.yaml", *schedule(text)]) == 0
    assert f"  error    {line}\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "notes"),
    [
        ("tolerance=0.1", []),
        (
            "tolerance={0: 0.5, 60: 0.02}",
            ["the scene changes its tolerance over the film; here each tolerance is measured by itself"],
        ),
        ("psnr=38", ["the scene asks for error.psnr, not for a tolerance; here each tolerance is measured by itself"]),
        (
            "splats=1000",
            ["the scene asks for error.splats, not for a tolerance; here each tolerance is measured by itself"],
        ),
        (
            "seconds=0.1",
            ["the scene asks for error.seconds, not for a tolerance; here each tolerance is measured by itself"],
        ),
    ],
)
@pytest.mark.usefixtures("scene_folder")
def test_a_study_says_what_it_does_not_measure(text: str, notes: list[str]) -> None:
    scene = load_scene(Path("scene.yaml"), overrides=schedule(text)[1::2])
    assert scene_notes(scene, has_transparent_border=False) == notes
