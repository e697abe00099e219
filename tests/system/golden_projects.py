"""A project of two scenes with goldens, which many tests begin with: it is drawn once for a module."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from small_scene import small_scene

from hsplat_cli import main

SCENE = small_scene(shape="16, 16, 8", frames=4, error="tolerance: 0.1, probes: 16")
# A change after which no frame is the same.
CHANGE = ("#ffffff", "#ff0000")
NAMES = [f"frame-000{number}.png" for number in range(4)]
ENGINE = Path("scenes/goldens/engine")


def make_project(folder: Path) -> None:
    """Write the scenes engine and box into a folder, and draw their goldens."""
    (folder / "scenes").mkdir()
    for name in ("engine", "box"):
        (folder / "scenes" / f"{name}.yaml").write_text(SCENE.replace("film.mp4", f"{name}.mp4"), "utf-8")
    assert main.run(["golden", str(folder / "scenes"), "--quiet"]) == 0


@pytest.fixture(scope="session")
def made_project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a project, which no test changes."""
    folder = tmp_path_factory.mktemp("made")
    make_project(folder)
    return folder


@pytest.fixture
def project(made_project: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return the current folder, with a copy of a project; no temporary file stays in TMPDIR."""
    shutil.copytree(made_project, folder, dirs_exist_ok=True)
    for name in (
        "CI",
        "GITHUB_EVENT_NAME",
        "CI_PIPELINE_SOURCE",
        "GITHUB_ACTIONS",
        "GITHUB_STEP_SUMMARY",
        "GITHUB_WORKSPACE",
        "CI_PROJECT_DIR",
    ):
        monkeypatch.delenv(name, raising=False)
    return folder


def edit_scene(old: str = CHANGE[0], new: str = CHANGE[1], name: str = "engine") -> None:
    path = Path("scenes", f"{name}.yaml")
    text = path.read_text("utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), "utf-8")


def golden(*arguments: str) -> int:
    return main.run(["golden", *arguments, "--quiet"])


def compare(*arguments: str) -> int:
    return main.run(["compare", *(arguments or ("scenes",)), "--quiet"])


def report(*arguments: str) -> tuple[int, dict[str, Any]]:
    """Return the exit code of a comparison, and the films of its report, by name."""
    places = [] if arguments and not arguments[0].startswith("--") else ["scenes"]
    code = compare(*places, *arguments, "--report", "report")
    path = Path("report/report.json")
    films = json.loads(path.read_bytes())["films"] if path.exists() else []
    return code, {film["name"]: film for film in films}


def statuses(film: dict[str, Any]) -> list[str]:
    return [frame["status"] for frame in film["frames"]]


def golden_json(folder: Path = ENGINE) -> dict[str, Any]:
    data: dict[str, Any] = json.loads((folder / "golden.json").read_bytes())
    return data


def files(folder: Path = Path()) -> dict[str, bytes]:
    """Return the content of all files below a folder."""
    return {os.path.join(at, name): Path(at, name).read_bytes() for at, _, names in os.walk(folder) for name in names}
