"""The fixture `assert_frames_match` works in a separate run of pytest, as for a user."""

from __future__ import annotations

import json
import os
import subprocess
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from commands import CODE, python
from small_scene import small_scene

from hsplat_cli import main
from renderer.film import encode_png

PLUGIN = "hsplat_cli.compare.pytest_plugin"
HEAVY = ("numpy", "moderngl", "tifffile", "pydicom", "nibabel", "imageio", "cmap", "click", "yaml", "renderer")

TESTS = """\
from pathlib import Path

import pytest

from renderer.errors import InputError


@pytest.fixture(scope="module")
def early(assert_frames_match):
    return assert_frames_match  # may have any scope


def test_same(early):
    early("goldens", Path("same"))


def test_another(assert_frames_match):
    assert_frames_match("goldens", "other", html="report.html")


def test_another_within_limits(assert_frames_match):
    assert_frames_match("goldens", "other", level="exact", limits={"largest": 20})


def test_without_a_limit(assert_frames_match):
    assert_frames_match("goldens", "other", limits=dict.fromkeys(["largest", "p99", "flip", "bias"]) | {"densest": 200})


def test_nothing_there(assert_frames_match):
    with pytest.raises(InputError, match="no such file or folder"):
        assert_frames_match("goldens", "nowhere")


def test_a_wrong_limit(assert_frames_match):
    assert_frames_match("goldens", "same", level="cross", limits={"densest": "many", "largest": "none"})


def test_a_scene(assert_frames_match):
    assert_frames_match("scene.yaml", "of_scene", level="exact")
"""


SCENE = small_scene(shape="8, 8, 8", frames=2, size="16, 16")


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python with the hsplat under test, where pytest loads no plugin but ours."""
    return python(*arguments, folder=folder, PYTEST_DISABLE_PLUGIN_AUTOLOAD="1")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with goldens, equal frames, others 9 steps off, a scene and its goldens, and tests."""
    pixels = np.full((16, 16, 3), 100, np.uint8)
    for name, levels in (("goldens", 0), ("same", 0), ("other", 9)):
        (tmp_path / name).mkdir()
        for number in range(2):
            (tmp_path / name / f"{number}.png").write_bytes(encode_png(pixels + np.uint8(levels)))
    (tmp_path / "scene.yaml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "test_frames.py").write_text(TESTS, encoding="utf-8")
    assert main.run(["golden", str(tmp_path / "scene.yaml"), str(tmp_path / "of_scene"), "--quiet"]) == 0
    return tmp_path


def test_the_fixture_compares_as_the_command_does(folder: Path) -> None:
    done = run(folder, "-m", "pytest", "-p", PLUGIN, "-p", "no:cacheprovider", "-q", "-rA", "test_frames.py")
    failed = {line.split()[1] for line in done.stdout.splitlines() if line.startswith("FAILED ")}
    assert failed == {f"test_frames.py::{name}" for name in ("test_another", "test_a_wrong_limit")}, done.stdout
    assert "5 passed" in done.stdout and "2 failed" in done.stdout
    assert "AssertionError: goldens and other do not match" in done.stdout
    assert "0.png  different  largest error of a channel 9 steps, at most 1" in done.stdout
    assert "2 of 2 frames fail: 2 different" in done.stdout
    wrong = [line.removeprefix("E").strip() for line in done.stdout.splitlines() if line.startswith("E  ")][-6:]
    assert wrong == [
        "renderer.errors.SceneError: level cross: unknown value",
        "got: 'cross'",
        "expected: exact, same-machine or cross-driver",
        "limits densest=many: densest: not a number",
        "got: 'many'",
        "expected: a number from 0 to 255 steps, or none",
    ]
    assert "rules.py" not in done.stdout and "api.py" not in done.stdout, "pytest shows the test"
    assert (folder / "report.html").stat().st_size > 0


def test_it_costs_nothing_before_it_is_used(folder: Path) -> None:
    """A run of pytest that does not use the fixture loads nothing but the plugin's module."""
    (folder / "test_frames.py").write_text("def test():\n    assert True\n", encoding="utf-8")
    program = (
        "import json, sys, pytest\n"
        "code = pytest.main(sys.argv[1:])\n"
        f"print(json.dumps([code, [name for name in {HEAVY} if name in sys.modules], "
        "sorted(name for name in sys.modules if name.startswith('hsplat'))]))"
    )
    arguments = ("-p", "no:cacheprovider", "-q", "--strict-markers", "--strict-config", "-W", "error")
    loaded = []
    for plugin in ((), ("-p", PLUGIN)):
        done = run(folder, "-c", program, *arguments, *plugin, "test_frames.py")
        loaded.append(json.loads(done.stdout.splitlines()[-1]))
    assert loaded[0] == [0, [], []]
    assert loaded[1] == [0, [], ["hsplat_cli", "hsplat_cli.compare", PLUGIN]]


def test_an_installed_plugin_may_be_named_again(folder: Path) -> None:
    """A conftest.py or `-p` names the plugin although hsplat is installed."""
    info = folder / "hsplat-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hsplat\nVersion: 1\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(f"[pytest11]\n{PLUGIN} = {PLUGIN}\n", encoding="utf-8")
    (folder / "conftest.py").write_text(f"pytest_plugins = [{PLUGIN!r}]\n", encoding="utf-8")
    arguments = ("-m", "pytest", "-p", "no:cacheprovider", "-q", "-p", PLUGIN, "test_frames.py::test_same")
    done = python(*arguments, folder=folder, PYTHONPATH=f"{CODE}:{folder}")
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_plugin_is_installed_under_the_name_of_its_module() -> None:
    if os.environ.get("HSPLAT_TEST_INSTALLED") == "1":
        assert PLUGIN in {found.name for found in metadata.entry_points(group="pytest11") if found.value == PLUGIN}
    else:
        assert f'[project.entry-points.pytest11]\n"{PLUGIN}" = "{PLUGIN}"\n' in (CODE / "pyproject.toml").read_text(
            "utf-8"
        )
