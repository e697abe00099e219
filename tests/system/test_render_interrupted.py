"""An interrupted render keeps finished frames, leaves no incomplete file, and ends with the exit code of the signal."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import imageio.v3 as imageio
import pytest
from commands import CODE, HSPLAT, environment, python
from resuming import on_each_frame
from small_scene import small_scene

from hsplat_cli import main

SCENE = small_scene(frames=3000)

pytestmark = pytest.mark.usefixtures("heeds_interrupts")


@pytest.fixture(autouse=True)
def out(scene_folder: Path) -> None:
    """Make the folder for what is rendered."""
    (scene_folder / "out").mkdir()


def finished_frames(out: Path) -> list[int]:
    """Return the frames that have a record; nothing but these records and whole pictures may be left."""
    # The lock is left where it was just being made; the next job takes it.
    left = [path for path in out.rglob("*") if path.is_file() and path.name != "lock"]
    assert all(re.fullmatch(r"[0-9]+\.png|([0-9]{6}|fingerprint-[0-9a-f]{32})\.json", path.name) for path in left), left
    pictures = [path for path in left if path.suffix == ".png"]
    assert all(imageio.imread(path).shape == (32, 32, 3) for path in pictures)
    found = sorted(int(path.stem) for path in left if path.suffix == ".json" and path.stem.isdigit())
    assert {*found} <= {int(path.stem) for path in pictures}
    return found


@pytest.mark.parametrize(
    ("number", "name"), [(signal.SIGINT, "film.mp4"), (signal.SIGHUP, "film.gif"), (signal.SIGTERM, "{frame}.png")]
)
def test_in_the_middle(folder, monkeypatch, capsys, number: signal.Signals, name: str) -> None:
    on_each_frame(monkeypatch, lambda frame: os.kill(os.getpid(), number) if frame.number == 2 else None)
    code = main.run(["render", "scene.yaml", "--output", f"out/{name}", "--set", "camera.path.frames=6"])
    assert code == 128 + number
    *_, kept, last = capsys.readouterr().err.splitlines()
    assert last == "hsplat: interrupted"
    found = finished_frames(folder / "out")
    assert found in ([0, 1], [0, 1, 2])
    assert kept == f"{len(found)} of 6 frames are kept; the same command resumes there"


@pytest.mark.parametrize("name", ["film.mp4", "{frame}.png"])
def test_the_process_from_outside(folder: Path, name: str) -> None:
    """As a batch system does it, as soon as there is something to clean up."""
    command = [*HSPLAT, "render", "scene.yaml", "--output", f"out/{name}"]
    command += ["--set", "camera.path.frames=5000"]  # not finished before the signal, however busy the machine is
    with subprocess.Popen(command, env=environment(), stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not any((folder / "out").iterdir()):
            time.sleep(0.01)
        process.terminate()
        _, said = process.communicate()
    assert (process.returncode, said.splitlines()[-1:]) == (143, ["hsplat: interrupted"])
    assert "Traceback" not in said
    finished_frames(folder / "out")


def test_the_handler_is_put_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    assert main.run(["render", "scene.yaml", "--frames", "0", "--quiet"]) == 0
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_signal_that_is_ignored_stays_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """As SIGHUP after `nohup`."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        on_each_frame(monkeypatch, lambda frame: os.kill(os.getpid(), signal.SIGHUP))
        assert main.run(["render", "scene.yaml", "--frames", "0:2", "--quiet"]) == 0
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize(
    "late",
    [
        "os.kill(os.getpid(), signal.SIGINT); time.sleep(60)",
        # While Python ends, and has removed its own handlers.
        "end = type('', (), {'__del__': lambda _, kill=os.kill: kill(os.getpid(), signal.SIGINT)})()",
    ],
)
def test_a_signal_after_the_end_changes_no_exit_code(late: str) -> None:
    imports = "import os, signal, sys, time; from renderer.system import exit_on_signals"
    code = f"{imports}; exit_on_signals(7); {late}; sys.exit(7)"
    run = subprocess.run([sys.executable, "-c", code], env=environment(), capture_output=True, check=False)
    assert (run.returncode, run.stderr) == (7, b"")


def test_the_exit_code_where_an_import_was_interrupted(tmp_path: Path) -> None:
    interrupted = 'try:\n    exec("raise KeyboardInterrupt")\nexcept KeyboardInterrupt:\n    pass\n'
    end = "import sys\nfrom renderer.system import exit_on_signals\nexit_on_signals(7)\nsys.exit(7)"
    (tmp_path / "runs.py").write_text(interrupted + end)
    assert python("-m", "runs", PYTHONPATH=f"{CODE}{os.pathsep}{tmp_path}").returncode == 7
