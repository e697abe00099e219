"""index.html shows all films of a folder, whatever their names are and whatever became of them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest
from commands import files
from html_page import Page

from hsplat_cli import main
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable import Gallery

HOSTILE = '\'); x{} <script>alert(1) & "y".npy'


def references(text: str) -> set[str]:
    """Return the files that a page refers to, of which it loads nothing from elsewhere."""
    page = Page(text)
    assert page.tags["script"] == 1
    assert page.values("src") == []
    assert "http" not in text
    return {unquote(each) for each in page.values("href") + re.findall(r"url\(([^)]*)\)", text)}


@pytest.mark.slow
def test_a_batch_with_a_failure_and_a_hostile_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another run, which makes nothing, leaves all files as they are."""
    monkeypatch.chdir(tmp_path)
    np.save(HOSTILE, np.random.default_rng(0).random((8, 8, 8)))
    Path("broken.npy").touch()
    command = ["turntable", HOSTILE, "broken.npy", "--output=a b", "--frames=2", "--size=32", "--quiet"]
    assert main.run(command) == 2
    before = {name: Path("a b", name).read_bytes() for name in files("a b")}
    text = before["index.html"].decode()
    (name,) = [Path(each).stem for each in before if each.endswith(".yaml")]
    assert references(text) == {"turntable.json", f"{name}.mp4", f"posters/{name}.jpg"} <= {*before}
    page = Page(text)
    assert any(each.startswith(f"{name}: filled scan, values ") for each in page.values("aria-label"))
    assert "hsplat turntable --frames=2 --size=32,32 --format=mp4 '--output=a b' -- broken.npy failed" in page.prose
    assert main.run(command) == 2
    assert {name: Path("a b", name).read_bytes() for name in files("a b")} == before


def test_forged_records_and_a_page_of_somebody_else(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "damaged.mp4").write_bytes(b"no film")
    others = ["../out.mp4", "/etc/passwd", "javascript:alert(1)", "gone.mp4", "a\0.mp4", "\ud800.mp4", "damaged.mp4"]
    same = {"volume": "v", "status": "done"}
    films = [same | {"film": film, "scene": f"{number}.yaml"} for number, film in enumerate(others)]
    damage: list[dict[str, Any]] = [{"psnr": "high"}, {"seconds": 10**400}, {"kind": 7}, {"notes": [1, None]}]
    films += [same | each | {"film": "gone.mp4", "scene": "damaged-entry.yaml"} for each in damage]
    (tmp_path / "turntable.json").write_text(json.dumps({"films": films}))
    Gallery(tmp_path, Reporter()).finish()
    text = (tmp_path / "index.html").read_text()
    assert references(text) == {"turntable.json", "damaged.mp4"}
    assert text.count("there is no film") == len(others) - 1
    assert "damaged-entry" not in text, "an entry that is damaged is passed over"
    assert text.count("no picture: not an MP4 file") == 1
    assert capsys.readouterr().err == ""
    (tmp_path / "index.html").write_text("mine")
    Gallery(tmp_path, Reporter()).finish()
    assert (tmp_path / "index.html").read_text() == "mine"
    assert "another page has this name" in capsys.readouterr().err
