"""Films with cuts are drawn, resumed, recorded and verified, and studied without what cannot be cut."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_scene import sidecar, small_scene

from hsplat_cli import main

CUTS = """\
cuts:
  - {plane: {point: [0, 0, 0], normal: [0, 0, 1]}, fixed: camera}
  - box: [[-1, -1, 4], [9, 9, 99]]
"""


@pytest.fixture(autouse=True)
def _scene(folder: Path) -> None:
    Path("scene.yaml").write_text(small_scene() + CUTS, encoding="utf-8")


def test_a_film_with_cuts(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["render", "scene.yaml"]) == 0
    record = sidecar()
    assert record["scene"]["cuts"][1]["box"] == [[-1, -1, 4], [9, 9, 99]]
    assert main.run(["verify", "film.mp4"]) == 0
    capsys.readouterr()
    assert main.run(["render", "film.mp4.json"]) == 0
    assert "film.mp4 is up to date" in "".join(capsys.readouterr())
    whole = Path("film.mp4").read_bytes()
    assert main.run(["render", "scene.yaml", "--set", "cuts.0.invert=true"]) == 0
    assert Path("film.mp4").read_bytes() != whole


def test_a_study_does_not_compare_what_cannot_be_cut(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["measure", "scene.yaml", "--frames", "0", "--output", "study"]
    assert main.run([*command, "--footprints", "integrated,gaussian"]) == 2
    assert "--footprints: splats cannot show what cuts asks for" in capsys.readouterr().err
    assert main.run([*command, "--tolerances", "0.5"]) == 0
    assert main.run(["measure", "scene.yaml", "--frames", "0", "--want", "psnr=20"]) == 0
