"""`--workers 2` draws the same film as one process, whatever happens to its processes, and leaves nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest
from commands import HSPLAT, environment, files
from processes import MARK, marked, new_mark, wait_until
from small_scene import small_scene

from hsplat_cli import main
from hsplat_cli.executors.cluster import local_cluster
from hsplat_cli.executors.cluster.connection import connect_locally
from renderer.errors import RenderError
from renderer.system import ChildProcesses

pytestmark = pytest.mark.usefixtures("scene_folder")

NUM_FRAMES = 150
SCENE = small_scene(shape="32, 32, 16", frames=NUM_FRAMES, error="splats: {0: 50, 4: 500}")
# The longest time until the last process has ended.
SOON_S = 10.0


@pytest.fixture(scope="module")
def film_of_one_process(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("alone")
    (folder / "scene.yaml").write_text(SCENE, encoding="utf-8")
    film = folder / "film.mp4"
    assert main.run(["render", str(folder / "scene.yaml"), "--output", str(film), "--quiet"]) == 0
    return film.read_bytes()


@contextmanager
def rendering(mark: str, num_frames: int = 1) -> Iterator[subprocess.Popen[str]]:
    """Start a job of two processes, in a process group, and wait until it has drawn so many frames, or the film."""
    command = [*HSPLAT, "render", "scene.yaml", "--workers", "2", "--quiet"]
    variables = environment(**{MARK: mark})
    with subprocess.Popen(command, env=variables, stderr=subprocess.PIPE, text=True, process_group=0) as job:
        while len(list(Path("film.mp4.unfinished").glob("[0-9]*.json"))) < num_frames and not Path("film.mp4").exists():
            assert job.poll() is None
            time.sleep(0.02)
        yield job


def test_frames_of_a_killed_process_are_drawn_again(film_of_one_process: bytes) -> None:
    mark = new_mark()
    with rendering(mark) as job:
        workers = [child for child in psutil.Process(job.pid).children() if "local_worker" in " ".join(child.cmdline())]
        assert len(workers) == 2
        workers[0].kill()
        _, said = job.communicate()
    assert (job.returncode, "Traceback" in said) == (0, False), said
    assert Path("film.mp4").read_bytes() == film_of_one_process
    assert wait_until(lambda: not marked(mark), SOON_S)


@pytest.mark.parametrize("num_frames", [1, NUM_FRAMES], ids=["drawing", "encoding"])
@pytest.mark.parametrize("kill", [os.kill, os.killpg], ids=["the parent alone", "the group"])
def test_a_killed_job_leaves_nothing_and_resumes(kill, num_frames: int, film_of_one_process: bytes) -> None:
    mark, shared = new_mark(), set(os.listdir("/dev/shm"))
    with rendering(mark, num_frames) as job:
        kill(job.pid, signal.SIGKILL)
    assert wait_until(lambda: not marked(mark), SOON_S)
    assert unmapped(set(os.listdir("/dev/shm")) - shared) == set()
    assert not Path("film.mp4").exists() or Path("film.mp4").read_bytes() == film_of_one_process
    assert main.run(["render", "scene.yaml", "--workers", "2", "--quiet"]) == 0
    assert Path("film.mp4").read_bytes() == film_of_one_process
    assert files(".") == ["film.mp4", "film.mp4.json", "scene.yaml"]


def unmapped(names: set[str]) -> set[str]:
    """Return the blocks of shared memory that no process has mapped; those of other programs are."""
    maps = ""
    for file in Path("/proc").glob("[0-9]*/maps"):
        with suppress(OSError):  # gone meanwhile, or not ours
            maps += file.read_text(errors="replace")
    return {name for name in names if f"/dev/shm/{name}\n" not in maps and Path("/dev/shm", name).exists()}


@pytest.mark.parametrize("module", ["no_such_module", "this"])  # ends early, with and without an error
def test_processes_that_do_not_start(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_cluster, "_WORKER_MODULE", module)
    with (
        pytest.raises(RenderError, match="--workers 2: no processes can be started\n  got: exit status"),
        connect_locally(2),
    ):
        pass


@pytest.mark.usefixtures("heeds_interrupts")
def test_an_interrupt_of_all_processes_of_a_terminal(film_of_one_process: bytes) -> None:
    mark = new_mark()
    with rendering(mark) as job:
        os.killpg(job.pid, signal.SIGINT)
        _, said = job.communicate()
    assert (job.returncode, "Traceback" in said) == (130, False), said
    assert said.splitlines()[-1] == "hsplat: interrupted"
    assert wait_until(lambda: not marked(mark), SOON_S)
    assert main.run(["render", "scene.yaml", "--quiet"]) == 0
    assert Path("film.mp4").read_bytes() == film_of_one_process


@pytest.mark.usefixtures("heeds_interrupts")
def test_an_interrupt_waits_for_the_end_of_the_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C may come a second time, while they end."""
    mark, close = new_mark(), ChildProcesses.__exit__
    monkeypatch.setenv(MARK, mark)

    def interrupted_close(children: ChildProcesses, *_: object) -> None:
        assert len(marked(mark)) >= 2
        os.kill(os.getpid(), signal.SIGINT)
        close(children)

    monkeypatch.setattr(ChildProcesses, "__exit__", interrupted_close)
    assert main.run(["render", "scene.yaml", "--workers", "2", "--quiet"]) == 130
    assert not marked(mark) - {os.getpid()}
