"""Tests of `hsplat cite`: what it tells of a film is what its sidecar says, and cites what CITATION.cff does."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from small_scene import edit_sidecar, sidecar, small_scene

from hsplat_cli import main

ROOT = Path(__file__).resolve().parents[2]
OUTPUTS = "  - {file: film.mp4, size: [32, 32]}\n  - {file: 'f/{frame}.png'}\n  - {file: tiny.gif, size: [16, 16]}\n"


@pytest.fixture(autouse=True)
def film(folder: Path) -> None:
    """Draw a film with a light that comes later."""
    light = "shading: {occlusion: {0: 0, 2: 0.5}}\n"
    text = re.sub(r"output:\n(.*\n)+", f"{light}output:\n{OUTPUTS}", small_scene(frames=3, error=""))
    Path("scene.yaml").write_text(text, encoding="utf-8")
    assert main.run(["render", "scene.yaml", "--quiet"]) == 0


def cited(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return the lines that are printed of the film."""
    capsys.readouterr()
    assert main.run(["cite", "film.mp4"]) == 0
    return capsys.readouterr().out.splitlines()


def test_a_film_is_described_by_its_sidecar_alone(capsys: pytest.CaptureFixture[str]) -> None:
    Path("film.mp4").unlink()
    methods, record = cited(capsys)[0], sidecar()
    accuracy, (low, high) = record["accuracy"], record["accuracy"]["interval"]
    for words in (
        "3 frames of 32 x 32 pixels were rendered with hsplat (version ",
        "The volume was procedural engine_block, 24 x 24 x 12 voxels of uint8, spacing 1 x 1 x 1 world units, "
        f"fingerprint {record['volume']['fingerprint'][:12]}. For each frame, an octree",
        " at tolerance 0.1 (optical error of a cell), and its cells were drawn as bricks, which integrate emission ",
        "There was Lambertian shading and ambient occlusion. Accuracy of film.mp4 ",
        f"file PSNR {accuracy['file']['psnr']:.1f} dB (",
        f"frames PSNR {accuracy['psnr']:.1f} dB ({low:.1f} to {high:.1f}) before encoding; ",
        f"Of {{frame}}.png: file PSNR {accuracy['psnr']:.1f} dB (",
    ):
        assert words in methods
    assert "tiny.gif" not in methods  # nobody has measured its smaller pictures


def test_a_still_is_a_picture_and_has_no_frames(capsys: pytest.CaptureFixture[str]) -> None:
    text = small_scene(frames=1, error="splats: 500, probes: 300")
    Path("still.yaml").write_text(text.replace("film.mp4", "still.png"), encoding="utf-8")
    assert main.run(["render", "still.yaml", "--quiet"]) == 0
    capsys.readouterr()
    assert main.run(["cite", "still.png"]) == 0
    methods = capsys.readouterr().out.splitlines()[0]
    assert methods.startswith("A picture of 32 x 32 pixels was rendered with hsplat (version ")
    assert ". An octree of averages was cut at tolerance " in methods and " exact rays through the picture" in methods
    assert "chosen for at most 500 cells)" in methods and "frame" not in methods


@pytest.mark.slow
def test_a_film_in_scattered_light_states_its_accuracy(capsys: pytest.CaptureFixture[str]) -> None:
    text = re.sub(r"shading: .*\n", "light: {key: {}}\n", Path("scene.yaml").read_text("utf-8"))
    Path("scene.yaml").write_text(text.replace("film.mp4", "light.mp4"), encoding="utf-8")
    assert main.run(["render", "scene.yaml", "--force"]) == 0
    printed = capsys.readouterr()
    assert "frames PSNR " in printed.out
    assert sidecar("light.mp4.json")["accuracy"]["interval"][0] > 20
    assert main.run(["cite", "light.mp4"]) == 0
    printed = capsys.readouterr()
    assert "Matter scattered the light of an environment and a key light equally" in printed.out
    assert "Accuracy of light.mp4 against the light of paths by Monte Carlo: " in printed.out
    assert not printed.err
    assert main.run(["verify", "light.mp4"]) == 0
    assert "file PSNR " in capsys.readouterr().out


def test_bibtex_cites_what_the_sources_cite(capsys: pytest.CaptureFixture[str]) -> None:
    paper, software = re.findall(r"(?ms)^@.*?^}", "\n".join(cited(capsys)))
    own: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    (cff,) = own["references"]
    names = " and ".join(f"{each['family-names']}, {each['given-names']}" for each in cff["authors"])
    facts = {key: cff[key] for key in ("title", "journal", "volume", "year", "doi")}
    facts |= {"author": names, "number": cff["issue"], "pages": f"{cff['start']}--{cff['end']}"}
    assert dict(re.findall(r"(\w+) = \{(.*)\}", paper)) == {key: str(value) for key, value in facts.items()}
    facts = {"author": f"{{{own['authors'][0]['name']}}}", "title": own["title"]}
    facts |= {"note": f"Version {sidecar()['versions']['hsplat']}"}
    assert dict(re.findall(r"(\w+) = \{(.*)\}", software)) == facts
    edit_sidecar("film.mp4.json", lambda data: data["versions"].update(hsplat="1}\n@misc{d}"))
    assert "  note = {Version unknown}" in cited(capsys)
    assert f'\nversion = "{own["version"]}"\n' in (ROOT / "pyproject.toml").read_text("utf-8")
