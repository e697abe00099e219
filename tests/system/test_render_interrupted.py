"""A render that is stopped from outside leaves what was finished, nothing half-written, and exit code 130."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import pytest

from hsplat_cli import main
from hsplat_cli.executors import frame_result

CODE = Path(main.__file__).parents[1]

SCENE = """\
volume:
  procedural: {name: constant, shape: [12, 12, 12]}
transfer_function:
  points: [{value: 0, color: white, opacity: 0.1}]
camera:
  path: {type: turntable, frames: 3000}
output:
  file: film.mp4
  size: [32, 32]
"""


@pytest.fixture(autouse=True)
def _listen_to_interrupts() -> Iterator[None]:
    """A shell's background job, as CI may be, is started deaf to SIGINT."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with SCENE in scene.yaml and the folder `out` for what is rendered."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.yaml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "out").mkdir()
    return tmp_path


class Interrupted:
    """Stands in for the frame loop and has a signal sent to this process at the third frame."""

    def __init__(self, number: signal.Signals) -> None:
        self._number, self._render_frames = number, frame_result.render_frames

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        for frame in self._render_frames(*arguments, **options):
            if frame.number == 2:
                os.kill(os.getpid(), self._number)
            yield frame


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", ["film.mp4", "film.gif", "{frame}.png"])
def test_in_the_middle(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], number: signal.Signals, name: str
) -> None:
    monkeypatch.setattr(frame_result, "render_frames", Interrupted(number))
    code = main.run(["render", "scene.yaml", "--output", f"out/{name}", "--set", "camera.path.frames=6"])
    assert code == 130
    *_, kept, last = capsys.readouterr().err.splitlines()
    assert last == "hsplat: interrupted"
    num_kept = int(kept[0])
    assert kept == f"{num_kept} of 6 frames are kept; the same command resumes there"
    assert num_kept in (2, 3)
    left = {str(path.relative_to(folder / "out")) for path in (folder / "out").rglob("*") if path.is_file()}
    left = {file for file in left if "/cause-" not in file}
    records = {f"00000{i}.json" for i in range(num_kept)}
    if name == "{frame}.png":
        assert left - {"2.png"} == {"0.png", "1.png"} | {f"frames.unfinished/{record}" for record in records}
    else:
        pictures = {f"00000{i}.png" for i in range(num_kept)}
        left -= {f"{name}.unfinished/000002.png"}
        assert left == {f"{name}.unfinished/{file}" for file in records | pictures - {"000002.png"}}
    for path in (folder / "out").rglob("*.png"):
        assert imageio.imread(path).shape == (32, 32, 3)


@pytest.mark.parametrize("name", ["film.mp4", "{frame}.png"])
def test_the_process_from_outside(folder: Path, name: str) -> None:
    """As a batch system does it, as soon as there is something to clean up."""
    command = [sys.executable, "-m", "hsplat_cli", "render", "scene.yaml", "--output", f"out/{name}"]
    environment = os.environ | {"PYTHONPATH": str(CODE)}
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not any((folder / "out").iterdir()):
            time.sleep(0.01)
        process.terminate()
        _, said = process.communicate()
    assert (process.returncode, said.splitlines()[-1:]) == (130, ["hsplat: interrupted"])
    assert "Traceback" not in said
    # The lock is left where it was just being made; the next job takes it.
    left = [path for path in (folder / "out").rglob("*") if path.is_file() and path.name != "lock"]
    assert all(re.fullmatch(r"[0-9]+\.png|([0-9]{6}|cause-[0-9a-f]{32})\.json", path.name) for path in left), left


def test_the_handler_is_put_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    assert main.run(["render", "scene.yaml", "--frames", "0", "--quiet"]) == 0
    assert signal.getsignal(signal.SIGTERM) is before
