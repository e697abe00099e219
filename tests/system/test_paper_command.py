"""`hsplat paper` from the command line: the page that it writes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from hsplat_cli import main
from hsplat_cli.commands.paper import FIGURE_SPECS, SCENES
from renderer.scene import load_scene


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with small scenes of figures 3 and 5."""
    for number, old, new in ((3, "size: [128, 128]", "size: [32, 32]"), (5, "size: [384, 384]", "size: [32, 32]")):
        name = FIGURE_SPECS[number].scene
        text = (SCENES / name).read_text("utf-8")
        assert old in text
        (tmp_path / name).write_text(text.replace(old, new), "utf-8")
    return tmp_path


def test_every_figure_has_its_scene() -> None:
    assert {path.name for path in SCENES.iterdir()} == {spec.scene for spec in FIGURE_SPECS.values()}
    for spec in FIGURE_SPECS.values():
        load_scene(SCENES / spec.scene)


def test_the_page_is_one_file_that_loads_nothing(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = folder / "new" / "paper"
    assert main.run(["paper", str(folder), "--output", str(output)]) == 0
    assert [path.name for path in output.iterdir()] == ["index.html"]
    page = (output / "index.html").read_text("utf-8")
    assert set(re.findall(r'<section id="figure-(\d)">', page)) == {"3", "5"}
    references = re.findall(r'\b(?:src|href)="([^"]{,20})', page)
    assert references
    assert {reference.partition(":")[0] for reference in references if not reference.startswith("#")} == {"data"}
    assert not re.search(r"@import|url\((?!#)|<script|<link|<iframe", page)
    assert page.count("<img") == 3 * 6 + 2 * 4
    said = capsys.readouterr()
    assert "figure 3: confirmed: " in said.out
    assert f"page: {output / 'index.html'}\n" in said.out
    assert "The volume is procedural engine_block." in page
    assert "paper: 2/2 figures" in said.err


def test_some_figures_only_and_quietly(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["paper", str(folder), "--output", str(folder), "--figure", "3", "--figure", "3", "--quiet"]
    assert main.run(arguments) == 0
    assert re.findall(r'<section id="figure-(\d)">', (folder / "index.html").read_text("utf-8")) == ["3"]
    assert capsys.readouterr() == ("", "")


def test_a_volume_of_ones_own(folder: Path) -> None:
    scan = folder / "my scan.npy"
    values = np.zeros((12, 16, 20), np.uint8)
    values[3:9, 4:12, 5:15] = np.linspace(90, 255, 10).astype(np.uint8)
    np.save(scan, values)
    arguments = ["paper", str(folder), "--output", str(folder), "--figure", "5", "--volume", str(scan), "--quiet"]
    assert main.run(arguments) == 0
    assert "The volume is my scan.npy." in (folder / "index.html").read_text("utf-8")


def test_bricks_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / FIGURE_SPECS[3].scene
    text = re.sub(r"\nsplat:\n(  .*\n)+", "\nsplat: {footprint: integrated}\n", path.read_text("utf-8"))
    path.write_text(text, "utf-8")
    assert main.run(["paper", str(folder), "--figure", "3"]) == 2
    assert f"{path}: the paper draws splats\n  got: splat.footprint: integrated\n" in capsys.readouterr().err
