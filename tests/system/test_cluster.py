"""Films drawn on a Dask cluster: the same bytes as here, whoever draws, and whoever dies meanwhile."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from distributed import Client, LocalCluster

from hsplat_cli import main
from hsplat_cli.cluster.drawer import Cluster
from hsplat_cli.drawn import LocalDrawer
from renderer.drawing import Stage
from renderer.errors import RenderError
from renderer.pipeline import prepare
from renderer.raster_gl import GLRasterizer
from renderer.scene_schema import parse_scene

NUM_FRAMES = 24
SCENE = {
    "volume": {"procedural": {"name": "engine_block", "shape": [32, 32, 16]}},
    "transfer_function": {
        "points": [
            {"value": 50, "color": "#6680e6", "opacity": 0.0},
            {"value": 255, "color": "#ffffff", "opacity": 0.7},
        ]
    },
    "camera": {"path": {"type": "turntable", "frames": NUM_FRAMES, "elevation": 20}},
    "error": {"tolerance": {0: 0.5, NUM_FRAMES - 1: 0.02}},
    "output": {"file": "{frame}.png", "size": [32, 32], "background": "transparent"},
}


@pytest.fixture(scope="module")
def stage() -> Stage:
    return prepare(parse_scene(SCENE, base=Path()), clock=time.perf_counter, num_threads=2)


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    """Of two workers, of two threads each, that are replaced when they die."""
    with (
        LocalCluster(n_workers=2, threads_per_worker=2, memory_limit=0, dashboard_address=":0") as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def expected(stage: Stage, rasterizer: GLRasterizer) -> list[bytes]:
    """The files of all frames."""
    return [drawn.picture.png for drawn in LocalDrawer(stage, rasterizer).draw(range(NUM_FRAMES))]


def draw(
    client: Client, stage: Stage, on_frame: Callable[[int], None] = lambda number: None
) -> tuple[list[bytes], list[str]]:
    """The files of all frames, and notes."""
    with Cluster(client, "tcp://here:1", patience_s=30.0).drawer(stage) as drawer:
        files = []
        for number, drawn in enumerate(drawer.draw(range(NUM_FRAMES))):
            assert drawn.number == drawn.record["frame"] == number
            files.append(drawn.picture.png)
            on_frame(number)
        assert len(drawer.made_by) == 1
        return files, drawer.notes


def worker_pids(client: Client) -> list[int]:
    return list(client.run(os.getpid).values())


def test_the_same_bytes_and_nothing_left(client: Client, stage: Stage, expected: list[bytes]) -> None:
    def studio_threads() -> list[str]:
        """Those of hsplat's in a worker: sent as it stands, for workers do not find this file."""
        import threading  # noqa: PLC0415

        return [thread.name for thread in threading.enumerate() if thread.name.startswith("hsplat")]

    files, notes = draw(client, stage)
    assert files == expected
    assert notes == []
    for _ in range(100):  # dask forgets in the background
        left = [name for names in client.run(studio_threads).values() for name in names]
        if not left:
            break
        time.sleep(0.1)
    assert left == []
    assert set(client.run(lambda: os.environ["LP_NUM_THREADS"]).values()) == {"2"}


@pytest.mark.parametrize("num", [1, 2])
def test_frames_of_workers_that_die_are_drawn_again(
    num: int, client: Client, stage: Stage, expected: list[bytes]
) -> None:
    """Of all of them, too: then the stage is sent again."""

    def kill(number: int) -> None:
        if number == 5:
            for pid in worker_pids(client)[:num]:
                os.kill(pid, signal.SIGKILL)

    files, (note,) = draw(client, stage, kill)
    assert files == expected
    assert note.endswith(" drawn again by other workers")


def test_nobody_is_there(stage: Stage) -> None:
    with (
        LocalCluster(n_workers=0, dashboard_address=":0") as cluster,
        Client(cluster, set_as_default=False) as client,
        Cluster(client, "tcp://here:1", patience_s=0.5).drawer(stage) as drawer,
        pytest.raises(RenderError) as caught,
    ):
        next(drawer.draw([0]))
    assert str(caught.value) == (
        "--scheduler tcp://here:1: the cluster has no workers\n"
        "  got: none for 0.5 s\n"
        "  hint: `dask worker ADDRESS` starts one"
    )


def test_render_on_a_local_cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scene.yaml").write_text(
        """\
volume:
  procedural: {name: engine_block, shape: [16, 16, 8]}
transfer_function:
  points:
    - {value: 50, color: "#6680e6", opacity: 0.0}
    - {value: 255, color: white, opacity: 0.7}
camera:
  path: {type: turntable, frames: 5}
error: {splats: {0: 50, 4: 500}}
output: {file: film.mp4, size: [32, 32]}
""",
        encoding="utf-8",
    )
    assert main.run(["render", "scene.yaml", "--quiet"]) == 0
    options = ["--scheduler", "local", "--workers", "1", "--output", "cluster.mp4", "--quiet"]
    assert main.run(["render", "scene.yaml", *options]) == 0
    assert Path("cluster.mp4").read_bytes() == Path("film.mp4").read_bytes()
