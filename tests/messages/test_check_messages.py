"""`hsplat check` prints what `hsplat render` would, and leaves nothing behind."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from transcripts import Case, cases

from hsplat_cli import main


@pytest.fixture(autouse=True)
def folder(scene_folder: Path) -> Path:
    """Fill the folder of the scene with files and folders that are in the way."""
    for name in ("folder.mp4", "007.png", "slices", "film.gif.json", "notes/more"):
        Path(name).mkdir(parents=True)
    Path("notes/readme").write_text("no volume here")
    Path("damaged.nrrd").write_text("NRRD0004\n")
    for name in ("empty.vtk", "taken.mp4.unfinished"):
        Path(name).touch()
    links = {"link": "nowhere", "circle": "circle", "null.mp4": "/dev/null", "lost.mha": "gone.mha"}
    for name, target in (links | {"loop.mha": "loop.mha", "kernel.mha": "/proc/version"}).items():
        Path(name).symlink_to(target)
    os.mkfifo("pipe.mp4")
    np.save("spaced.npy", np.zeros((2, 2, 2), np.uint8))
    return scene_folder


@cases("check.txt")
def test_check_and_render_refuse_alike(case: Case, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(folder.rglob("*"))
    case.check(capsys)
    assert sorted(folder.rglob("*")) == before
    rendered = tuple(line.replace("hsplat check scene.yaml", "hsplat render scene.yaml --quiet") for line in case.lines)
    assert rendered != case.lines
    replace(case, lines=rendered).check(capsys)


@cases("check_right.txt")
def test_check_describes_a_right_scene(case: Case, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(folder.rglob("*"))
    case.check(capsys)
    assert sorted(folder.rglob("*")) == before


def test_a_path_that_is_too_long(capsys: pytest.CaptureFixture[str]) -> None:
    file = f"{5000 * 'a/'}film.mp4"
    for command in (["check"], ["render", "--quiet"]):
        assert main.run([*command, "scene.yaml", "--output", file]) == 1
        where = f"{file[:500]}...{file[-500:]}"
        assert capsys.readouterr() == ("", f"{where}: the output cannot be written\n  got: File name too long\n")


@pytest.mark.parametrize(
    ("refused", "arguments", "code", "text"),
    [
        (
            os.W_OK,
            ["--output", "new/film.mp4"],
            1,
            "new/film.mp4: no permission to write here\n  hint: choose another folder for the output\n",
        ),
        (os.R_OK, ["--set", "volume={file: scan.nrrd}"], 2, "scan.nrrd: no permission to read this\n"),
    ],
)
def test_missing_permissions(refused: int, arguments: list[str], code: int, text: str, monkeypatch, capsys) -> None:
    """Tests may run as the superuser, who has all permissions, so the answer of the system is replaced."""
    monkeypatch.setattr(os, "access", lambda path, mode: not mode & refused or Path(path).name == "scene.yaml")
    assert main.run(["check", "scene.yaml", *arguments]) == code
    assert "".join(capsys.readouterr()).replace(f"{Path.cwd()}/", "") == text
