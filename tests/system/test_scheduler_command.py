"""`hsplat render --scheduler` draws the same film as one process, and leaves it to be resumed when it ends early."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from commands import HSPLAT, environment, files
from small_scene import sidecar, small_scene

from hsplat_cli import main

pytestmark = pytest.mark.usefixtures("scene_folder")

NUM_FRAMES = 60
SCENE = small_scene(shape="32, 32, 16", frames=NUM_FRAMES, error="splats: {0: 50, 4: 500}, probes: 2")


@pytest.fixture(scope="module")
def film_of_one_process(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("alone")
    (folder / "scene.yaml").write_text(SCENE, encoding="utf-8")
    film = folder / "film.mp4"
    assert main.run(["render", str(folder / "scene.yaml"), "--output", str(film), "--quiet"]) == 0
    return film.read_bytes()


@contextmanager
def rendering(scheduler: str) -> Iterator[subprocess.Popen[str]]:
    """Start a job on a cluster, in a process group, and wait until it has drawn a frame."""
    command = [*HSPLAT, "render", "scene.yaml", "--scheduler", scheduler, "--quiet"]
    with subprocess.Popen(command, env=environment(), stderr=subprocess.PIPE, text=True, process_group=0) as job:
        while not list(Path("film.mp4.unfinished").glob("[0-9]*.json")):
            assert job.poll() is None
            time.sleep(0.02)
        yield job


@pytest.mark.slow
def test_the_same_film(scheduler: str, film_of_one_process: bytes) -> None:
    assert main.run(["render", "scene.yaml", "--scheduler", scheduler, "--quiet"]) == 0
    assert Path("film.mp4").read_bytes() == film_of_one_process
    assert sidecar()["notes"] == []
    assert files(".") == ["film.mp4", "film.mp4.json", "scene.yaml"]


@pytest.mark.slow
def test_a_killed_job_resumes(scheduler: str, film_of_one_process: bytes) -> None:
    """The next one draws in its own process, or on the same cluster, whose workers have forgotten the killed one."""
    for options in ([], ["--scheduler", scheduler]):
        with rendering(scheduler) as job:
            os.killpg(job.pid, signal.SIGKILL)
        assert main.run(["render", "scene.yaml", "--quiet", *options]) == 0
        assert Path("film.mp4").read_bytes() == film_of_one_process
        Path("film.mp4").unlink()


@pytest.mark.slow
@pytest.mark.usefixtures("heeds_interrupts")
def test_an_interrupt(scheduler: str, film_of_one_process: bytes) -> None:
    with rendering(scheduler) as job:
        os.killpg(job.pid, signal.SIGINT)
        _, said = job.communicate()
    assert (job.returncode, "Traceback" in said) == (130, False), said
    assert said.splitlines()[-1] == "hsplat: interrupted"
    assert main.run(["render", "scene.yaml", "--quiet"]) == 0
    assert Path("film.mp4").read_bytes() == film_of_one_process
