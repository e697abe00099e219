"""The fixtures and options of golden frames work in a separate run of pytest, as for a user."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from commands import CODE, python
from golden_projects import edit_scene

from renderer.film import encode_png

PLUGIN = "hsplat_cli.compare.pytest_plugin"
HEAVY = ("numpy", "moderngl", "tifffile", "pydicom", "nibabel", "imageio", "cmap", "click", "yaml", "renderer")

PICTURES = """\
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def early(assert_frames_match):
    return assert_frames_match  # may have any scope


def test_same(early):
    early("golden", Path("same"))


def test_another(assert_frames_match):
    assert_frames_match("golden", "other", report="report")


def test_another_within_its_limit(assert_frames_match):
    assert_frames_match("golden", "other", limit=25)


def test_nothing_there(assert_frames_match):
    assert_frames_match("golden", "nowhere")


def test_a_wrong_limit(assert_frames_match):
    assert_frames_match("golden", "same", limit="roughly")
"""

# The two lines of the documentation that compare all scenes of a project.
PAGE = Path(__file__).parents[2] / "docs/golden-frames.md"
SCENES = PAGE.read_text("utf-8").partition("```python\n")[2].partition("```")[0]

# A program that runs pytest several times. Its argument is a list in JSON: arguments, and the event of each run.
SEVERAL = f"""\
import json, os, sys
import pytest

for name in ("CI", "CI_PIPELINE_SOURCE", "PYTEST_XDIST_WORKER"):
    os.environ[name] = ""
sys.stderr = sys.stdout
for arguments, os.environ["GITHUB_EVENT_NAME"] in json.loads(sys.argv[1]):
    print("ends with", int(pytest.main(["-p", "{PLUGIN}", "-p", "no:cacheprovider", *arguments])), flush=True)
"""

# A conftest.py that leaves a file for each process that has accepted goldens before its tests.
WHO_ACCEPTED = """\
import os, sys
from pathlib import Path

import pytest


@pytest.hookimpl(trylast=True)
def pytest_sessionstart():
    if "hsplat_cli.compare.golden.acceptance" in sys.modules:
        Path("accepted-" + (os.environ.get("PYTEST_XDIST_WORKER") or "main")).touch()
"""


@pytest.fixture
def pictures(folder: Path) -> Path:
    """Return a folder with golden pictures, equal ones, others 9 steps off, and tests."""
    pixels = np.full((16, 16, 3), 100, np.uint8)
    for name, levels in (("golden", 0), ("same", 0), ("other", 9)):
        (folder / name).mkdir()
        for number in range(2):
            (folder / name / f"{number}.png").write_bytes(encode_png(pixels + np.uint8(levels)))
    (folder / "test_frames.py").write_text(PICTURES, encoding="utf-8")
    return folder


@pytest.fixture
def scenes(made_project: Path, folder: Path) -> Path:
    """Return a folder with a project, its golden.yaml, and a test of each of its scenes."""
    shutil.copytree(made_project, folder, dirs_exist_ok=True)
    Path("all").mkdir()
    Path("scenes/goldens").rename("all/scenes")
    Path("golden.yaml").write_text("scenes: [scenes/*.yaml]\ngoldens: all\n", "utf-8")
    Path("test_scenes.py").write_text(SCENES, "utf-8")
    return folder


def run(folder: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run Python with the hsplat under test, where pytest loads no plugin but ours."""
    return python(*arguments, folder=folder, PYTEST_DISABLE_PLUGIN_AUTOLOAD="1", **variables)


def run_pytest(folder: Path, *arguments: str, **variables: str) -> tuple[int, str]:
    """Run pytest with the plugin, also in a worker of xdist; return its exit code and what it prints."""
    plugins = ("-m", "pytest", "-p", PLUGIN, "-p", "no:cacheprovider", "-rA")
    for name in ("CI", "GITHUB_EVENT_NAME", "CI_PIPELINE_SOURCE", "PYTEST_XDIST_WORKER"):
        variables.setdefault(name, "")
    done = run(folder, *plugins, *arguments, **variables)
    return done.returncode, done.stdout + done.stderr


def run_several(
    folder: Path, calls: Sequence[Sequence[str]], events: Sequence[str] | None = None
) -> list[tuple[int, str]]:
    """Run pytest several times in one process; return the exit code of each run and what it prints.

    calls: the arguments of each run. events: the event of each run, by default none.
    """
    runs = [*zip(calls, events or [""] * len(calls), strict=True)]
    done = run(folder, "-c", SEVERAL, json.dumps(runs))
    *texts, last = re.split(r"^ends with (\d+)\n", done.stdout, flags=re.MULTILINE)
    assert last == "" and len(texts) == 2 * len(runs), done.stdout + done.stderr
    return [(int(code), printed) for printed, code in zip(texts[::2], texts[1::2], strict=True)]


def outcomes(printed: str) -> dict[str, str]:
    """Return the outcome of each test, by its name."""
    words = [line.split(" - ")[0].split() for line in printed.splitlines()]
    return {line[1].partition("::")[2]: line[0] for line in words if line and line[0] in ("PASSED", "FAILED", "ERROR")}


def test_the_fixture_compares_as_the_command_does(pictures: Path) -> None:
    _, printed = run_pytest(pictures, "test_frames.py")
    assert outcomes(printed) == {
        "test_same": "PASSED",
        "test_another": "FAILED",
        "test_another_within_its_limit": "PASSED",
        "test_nothing_there": "FAILED",
        "test_a_wrong_limit": "FAILED",
    }, printed
    errors = [line.removeprefix("E").strip() for line in printed.splitlines() if line.startswith("E  ")]
    figures = "29.0 dB, 29.0 dB in 8 x 8 pixels at 0, 0, largest error 9 steps of 255; wanted: the same stored values"
    assert f"0.png  different  {figures}" in errors
    assert "2 of 2 frames fail: 2 different" in errors
    assert "report: report/index.html" in errors
    assert "AssertionError: nowhere: no such file or folder" in errors
    assert "AssertionError: --limit roughly: not a limit" in errors
    assert "pytest_plugin.py" not in printed, "pytest shows the test"
    assert (pictures / "report/index.html").stat().st_size > 0


@pytest.mark.slow
def test_each_scene_is_a_test_of_its_own(scenes: Path) -> None:
    code, printed = run_pytest(scenes)
    assert code == 0
    assert outcomes(printed) == {"test_golden[scenes/box]": "PASSED", "test_golden[scenes/engine]": "PASSED"}
    edit_scene()
    code, printed = run_pytest(scenes, "--golden-report", "out")
    assert code == 1
    assert outcomes(printed) == {"test_golden[scenes/box]": "PASSED", "test_golden[scenes/engine]": "FAILED"}
    assert "scenes/engine.yaml:6: transfer_function.points.2.color was " in printed
    page = Path("out/test_scenes.py/test_golden[scenes/engine]/index.html")
    assert f"report: {page}" in printed and page.is_file()


@pytest.mark.slow
def test_long_names_of_tests_have_reports_of_their_own(pictures: Path) -> None:
    (pictures / "test_names.py").write_text(
        "import pytest\n"
        "@pytest.mark.parametrize('name', ['\u4e2d' * 30 + end for end in 'ab'])\n"
        "def test(name, assert_frames_match):\n"
        "    assert_frames_match('golden', 'other')\n",
        "utf-8",
    )
    run_pytest(pictures, "test_names.py", "--golden-report", "out")
    assert len(list((pictures / "out").rglob("report.json"))) == 2


@pytest.mark.slow
def test_a_golden_yaml_is_needed_and_may_be_named(scenes: Path) -> None:
    Path("golden.yaml").rename("scenes/golden.yaml")
    Path("scenes/golden.yaml").write_text("goldens: ../all/scenes\n", "utf-8")
    code, printed = run_pytest(scenes)
    assert code != 0 and "golden.yaml: no such file" in printed
    Path("scenes/golden.yaml").unlink()
    Path("all/scenes").rename("scenes/goldens")
    Path("pytest.ini").write_text("[pytest]\ngolden_scenes = scenes\n", "utf-8")
    code, printed = run_pytest(scenes)
    assert (code, outcomes(printed)) == (0, {"test_golden[box]": "PASSED", "test_golden[engine]": "PASSED"}), printed


def test_a_project_that_has_mistakes_is_an_error(scenes: Path) -> None:
    Path("golden.yaml").write_text("scene: [scenes/engine.yaml]\n", "utf-8")
    code, printed = run_pytest(scenes)
    assert code == 2 and "golden.yaml:1:1: scene: unknown key" in printed.replace(f"{scenes}/", ""), printed


def test_goldens_without_a_scene_are_a_failure_beside_the_other_tests(scenes: Path) -> None:
    Path("golden.yaml").write_text("scenes: [scenes/engine.yaml]\ngoldens: all\n", "utf-8")
    code, printed = run_pytest(scenes)
    printed = printed.replace(f"{scenes}/", "")
    assert code == 1
    assert outcomes(printed) == {"test_golden[scenes/engine]": "PASSED", "test_golden[all/scenes/box]": "ERROR"}
    assert "no scene has these goldens" in printed and "`git rm -r all/scenes/box`" in printed


@pytest.mark.slow
def test_pictures_of_a_report_are_accepted(scenes: Path) -> None:
    """All reports below the folder, or a ZIP archive of it; then the tests pass."""
    edit_scene()
    edit_scene(name="box")
    assert run_pytest(scenes, "--golden-report", "out")[0] == 1
    shutil.make_archive("artifact", "zip", "out")
    (some, report, all_others) = run_several(
        scenes,
        [
            ("--golden-accept", "artifact.zip", "--golden-only", "scenes/engine:1-2"),
            ("--golden-report", "out"),
            ("--golden-accept", "out"),
        ],
    )
    code, printed = some
    assert code == 1 and "goldens: scenes/engine: 2 frames accepted" in printed
    assert "2 of 4 frames fail: 2 different, 2 the same" in printed
    assert report[0] == 1
    code, printed = all_others
    assert code == 0 and "goldens: scenes/box: 4 frames accepted" in printed, printed
    assert "goldens: scenes/engine: 2 frames accepted" in printed


@pytest.mark.slow
def test_a_path_outside_of_the_folder_needs_an_equals_sign(scenes: Path) -> None:
    """pytest takes it for a path of tests otherwise, and looks for pytest.ini there."""
    edit_scene()
    inside = scenes / "inside"
    inside.mkdir()
    for name in ("scenes", "all", "golden.yaml", "test_scenes.py"):
        (scenes / name).rename(inside / name)
    (inside / "pytest.ini").write_text("[pytest]\n", "utf-8")
    report, accept = "--golden-report", "--golden-accept"
    calls = ([f"{report}=../my report"], [report, "../my report"], [accept, "../my report"], [f"{accept}=../my report"])
    ends = run_several(inside, [("-rA", *call) for call in calls])
    assert [code for code, _ in ends] == [1, 4, 4, 0], ends
    for option, (_, printed) in zip((report, accept), ends[1:3], strict=True):
        assert f"{option} ../my report: pytest would look for pytest.ini there" in printed
        assert f"hint: write {option}='../my report'" in printed
    for _, printed in (ends[0], ends[3]):
        assert "configfile: pytest.ini" in printed
        assert outcomes(printed).keys() == {"test_golden[scenes/box]", "test_golden[scenes/engine]"}


@pytest.mark.slow
def test_why_nothing_is_accepted(scenes: Path) -> None:
    edit_scene()
    assert run_pytest(scenes, "--golden-report", "out")[0] == 1
    before = {path: path.read_bytes() for path in Path("all").rglob("*") if path.is_file()}
    accept = ("--golden-accept", "out")
    wrong = (
        (("--golden-only", "engine"), "", "--golden-only is of no use without --golden-accept"),
        (("--golden-accept", "nowhere"), "", "nowhere: no such report"),
        ((*accept, "--golden-only", "scenes/engin"), "", "no such film fails in this report"),
        ((*accept, "--golden-only", "scenes/engine:9"), "", "these frames do not fail in this report"),
        (accept, "pull_request", "goldens do not change in a job that a change of the code starts"),
    )
    ends = run_several(scenes, [arguments for arguments, *_ in wrong], [event for _, event, _ in wrong])
    for (_, _, error), (code, printed) in zip(wrong, ends, strict=True):
        assert code == 4 and error in printed and "Traceback" not in printed, printed
    assert before == {path: path.read_bytes() for path in Path("all").rglob("*") if path.is_file()}
    assert run_pytest(scenes, *accept, GITHUB_EVENT_NAME="workflow_dispatch")[0] == 0


@pytest.mark.slow
def test_several_processes_accept_once(scenes: Path) -> None:
    edit_scene()
    edit_scene(name="box")
    assert run_pytest(scenes, "-p", "xdist", "-n", "2", "--golden-report", "out")[0] == 1
    Path("conftest.py").write_text(WHO_ACCEPTED, "utf-8")
    code, printed = run_pytest(scenes, "-p", "xdist", "-n", "2", "--golden-accept", "out")
    assert code == 0 and printed.count("4 frames accepted") == 2, printed
    assert [path.name for path in Path().glob("accepted-*")] == ["accepted-main"]


def test_it_costs_nothing_before_it_is_used(folder: Path) -> None:
    """A run of pytest that does not use the fixtures loads nothing but the plugin's module."""
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


@pytest.mark.slow
def test_an_installed_plugin_may_be_named_again(pictures: Path) -> None:
    """A conftest.py or `-p` names the plugin although hsplat is installed."""
    info = pictures / "hsplat-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hsplat\nVersion: 1\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(f"[pytest11]\n{PLUGIN} = {PLUGIN}\n", encoding="utf-8")
    (pictures / "conftest.py").write_text(f"pytest_plugins = [{PLUGIN!r}]\n", encoding="utf-8")
    arguments = ("-m", "pytest", "-p", "no:cacheprovider", "-q", "-p", PLUGIN, "test_frames.py::test_same")
    done = python(*arguments, folder=pictures, PYTHONPATH=f"{CODE}:{pictures}")
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_plugin_is_installed_under_the_name_of_its_module() -> None:
    if os.environ.get("HSPLAT_TEST_INSTALLED") == "1":
        assert PLUGIN in {found.name for found in metadata.entry_points(group="pytest11") if found.value == PLUGIN}
    else:
        assert f'[project.entry-points.pytest11]\n"{PLUGIN}" = "{PLUGIN}"\n' in (CODE / "pyproject.toml").read_text(
            "utf-8"
        )
