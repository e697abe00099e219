"""Messages of `hsplat golden`, and of `hsplat compare` about goldens that it cannot use."""

from __future__ import annotations

import pty
import shutil
import sys
from pathlib import Path

import pytest
from message_scenes import shorter_scene
from transcripts import Case, cases

from hsplat_cli import main


@pytest.fixture(autouse=True)
def folder(scene_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Add goldens without pictures, and frames without a record, to the folder of a small scene."""
    Path("scene.yaml").write_text(shorter_scene(2), "utf-8")
    for name in ("goldens", "frames", "cut"):
        Path(name).mkdir()
    shutil.copy(Path(__file__).with_name("golden.json"), "goldens")
    for name in ("frame-0000.png", "frame-0001.png", "notes.txt"):
        Path("frames", name).touch()
    monkeypatch.setenv("CI", "true")


@cases("golden.txt")
def test_messages(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    case.check(capsys)


@pytest.mark.parametrize(("answer", "code", "end"), [("y", 0, "golden.json\n"), ("n", 1, "nothing was written\n")])
def test_the_question_is_asked_at_a_terminal(answer: str, code: int, end: str, monkeypatch, capsys) -> None:
    monkeypatch.delenv("CI")
    assert main.run(["golden", "scene.yaml", "new", "--quiet"]) == 0
    keyboard, terminal = pty.openpty()
    with open(keyboard, "w", encoding="utf-8") as keys, open(terminal, encoding="utf-8") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        keys.write(f"{answer}\n")
        keys.flush()
        found = main.run(["golden", "scene.yaml", "new", "--update", "--set", "transfer_function.points.2.color=red"])
    assert found == code
    out = capsys.readouterr().out
    assert "\nOverwrite the goldens? [y/N]: " in out
    assert out.endswith(end)
