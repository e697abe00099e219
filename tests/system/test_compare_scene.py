"""`hsplat compare SCENE FOLDER` compares the goldens of a scene with its frames rendered now."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import edit_sidecar, small_scene
from transcripts import Case, cases

from hsplat_cli import main

SCENE = small_scene(shape="16, 16, 8", frames=4)
FOLDER = Path("goldens")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with SCENE and its goldens."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "scene.yaml").write_text(SCENE, encoding="utf-8")
    assert main.run(["golden", str(folder / "scene.yaml"), str(folder / "goldens"), "--quiet"]) == 0
    return folder


@pytest.fixture(autouse=True)
def _folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder with a copy of scene and goldens the current one."""
    (tmp_path / "goldens").mkdir()
    for path in ("scene.yaml", *(f"goldens/{path.name}" for path in (made / "goldens").iterdir())):
        (tmp_path / path).write_bytes((made / path).read_bytes())
    monkeypatch.chdir(tmp_path)


def compare(*options: str, scene: str = "scene.yaml") -> tuple[int, dict[str, Any]]:
    """Return the exit code and the JSON report, if there is one."""
    code = main.run(["compare", scene, "goldens", "--json", "report.json", *options])
    report = Path("report.json")
    data: dict[str, Any] = json.loads(report.read_bytes()) if report.exists() else {}
    report.unlink(missing_ok=True)
    return code, data


def statuses(data: dict[str, Any]) -> dict[int, str]:
    return {frame["number"]: frame["status"] for frame in data["frames"]}


def change(**values: Any) -> None:
    """Change keys of golden.json."""
    edit_sidecar(FOLDER / "golden.json", lambda data: data.update(values))


def test_an_unchanged_scene_passes(capsys: pytest.CaptureFixture[str]) -> None:
    code, data = compare("--level", "exact")
    assert (code, statuses(data), data["notes"]) == (0, dict.fromkeys(range(4), "same"), [])
    assert (data["golden"], data["actual"]) == ("goldens", "scene.yaml, drawn now")
    assert [name for name, sides in data["facts"].items() if sides["golden"] != sides["actual"]] == []
    assert capsys.readouterr().out == "4 frames pass at exact: 4 the same\n"
    assert sorted(path.name for path in Path().iterdir()) == ["goldens", "scene.yaml"], "no temporary file is left"


def test_another_volume_is_noted_first() -> None:
    np.save("scan.npy", np.arange(2048, dtype=np.uint8).reshape(8, 16, 16))
    code, data = compare("--volume", "scan.npy", "--set", "error.tolerance=0.2")
    assert code == 1
    volume, scene = data["notes"]
    fingerprint = json.loads((FOLDER / "golden.json").read_bytes())["volume"]["fingerprint"]
    goldens = f"procedural engine_block, 16 x 16 x 8 uint8, fingerprint {fingerprint[:8]}"
    assert volume.startswith("another volume: scan.npy, 16 x 16 x 8 uint8, fingerprint ")
    assert volume.endswith(f"; the goldens show {goldens}")
    assert "scene.error.tolerance was 0.1" in scene
    assert data["facts"]["volume"]["golden"] == goldens


def test_another_driver_is_named_only_where_frames_fail(capsys: pytest.CaptureFixture[str]) -> None:
    change(device="another driver")
    code, data = compare("--frames", "0")
    assert (code, data["notes"], data["facts"]["device"]["golden"]) == (0, [], "another driver")
    assert "another driver" not in capsys.readouterr().out
    assert compare("--frames", "0", "--set", "error.tolerance=0.2")[0] == 1
    out = capsys.readouterr().out
    assert "of the goldens: another driver" in out
    assert "--level cross-driver" in out


@cases("compare_scene.txt")
def test_messages(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    case.check(capsys)


def test_problems_are_found_before_rendering(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsplat_cli.compare.scene_pairs.rendered_frames", None)
    for option in ("--frames=nonsense", "--set=nonsense=1", "--volume=nowhere.npy", "--json=scene.yaml"):
        assert main.run(["compare", "scene.yaml", "goldens", option]) == 2
