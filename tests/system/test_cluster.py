"""A Dask cluster draws the same bytes as this process, also when they die.

That the stage of every kind of scene survives its way to workers is shown in `test_transport.py`.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import faulty_cluster_worker as faulty
import pytest
from clusters import running_cluster
from distributed import Client
from film_stages import plan_of, stage_of_kind
from small_scene import small_tree

from hsplat_cli.executors import ClusterDrawing, connect
from hsplat_cli.terminal import Reporter
from renderer.accuracy import open_prober
from renderer.draw import Rasterizer
from renderer.errors import HsplatError, InputError
from renderer.frame import Stage, prepare_stage
from renderer.job import draw_frames
from renderer.scene import Scene, parse_scene
from renderer.system import num_cores

NUM_FRAMES = 24
NUMBERS = [*range(8), 2]
SCENE = small_tree(
    frames=NUM_FRAMES,
    error={"tolerance": {0: 0.5, NUM_FRAMES - 1: 0.02}},
    output={"file": "{frame}.png", "size": [32, 32], "background": "transparent"},
)


@pytest.fixture(scope="module")
def stage() -> Stage:
    return prepare_stage(parse_scene(SCENE, base=Path()), clock=time.perf_counter, num_threads=2)


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    """Return a client of a cluster of this module, whose workers are killed."""
    with running_cluster(2) as cluster, connect(cluster.scheduler_address) as client:
        yield client


@pytest.fixture(scope="module")
def expected(stage: Stage, rasterizer_for: Callable[[Scene], Rasterizer]) -> list[bytes]:
    """Return the files of all frames."""
    frames = draw_frames(stage, range(NUM_FRAMES), rasterizer_for(stage.scene), plan_of(stage).controller)
    return [result.pictures[0].content for result in frames]


def draw(
    client: Client, stage: Stage, on_frame: Callable[[int], None] = lambda number: None
) -> tuple[list[bytes], list[str]]:
    """Return the files of all frames, and notes."""
    with closing(ClusterDrawing(client, "--scheduler here", plan_of(stage), Reporter())) as executor:
        files = []
        for number, result in enumerate(executor.draw(range(NUM_FRAMES))):
            assert (result.record.frame, result.record.device is None) == (number, False)
            files.append(result.pictures[0].content)
            on_frame(number)
        return files, executor.notes


def worker_pids(client: Client) -> list[int]:
    return list(client.run(os.getpid, on_error="ignore").values())  # some may be dying


@pytest.mark.parametrize("kind", ["plain", "transparent", "float32, splats, shading", "octree"])
def test_the_same_bytes(rasterizer_for: Callable[[Scene], Rasterizer], client: Client, kind: str) -> None:
    plan = plan_of(stage_of_kind(kind))
    rasterizer = rasterizer_for(plan.stage.scene)
    expected = [*draw_frames(plan.stage, NUMBERS, rasterizer, plan.controller, open_prober(plan.stage, 2))]
    assert all(frame.record.accuracy is not None for frame in expected)
    with closing(ClusterDrawing(client, "--scheduler here", plan, Reporter())) as drawing:
        found = list(drawing.draw(NUMBERS))
    assert [result.record.frame for result in found] == NUMBERS
    for one, other in zip(found, expected, strict=True):
        assert one.pictures[0].content == other.pictures[0].content
        device = rasterizer.device
        assert replace(one.record, seconds={}) == replace(other.record, seconds={}, device=device)


def test_nothing_is_left(client: Client, stage: Stage, expected: list[bytes]) -> None:
    def hsplat_threads() -> list[str]:
        """Return the threads of hsplat in a worker. It is sent by value, because workers do not find this file."""
        import threading

        return [thread.name for thread in threading.enumerate() if thread.name.startswith("hsplat")]

    files, notes = draw(client, stage)
    assert files == expected
    assert notes == []
    for _ in range(100):  # dask forgets in the background
        left = [name for names in client.run(hsplat_threads).values() for name in names]
        if not left:
            break
        time.sleep(0.1)
    assert left == []
    num_threads = str(max(1, num_cores() // 2))
    assert set(client.run(lambda: os.environ["LP_NUM_THREADS"]).values()) == {num_threads}


@pytest.mark.slow
def test_frames_of_workers_that_die_are_drawn_again(client: Client, stage: Stage, expected: list[bytes]) -> None:
    """First one dies, later all: then the stage is sent again."""

    def kill(number: int) -> None:
        num_killed = {5: 1, 12: 2}.get(number)
        for pid in worker_pids(client)[:num_killed] if num_killed else []:
            os.kill(pid, signal.SIGKILL)

    files, (note,) = draw(client, stage, kill)
    assert files == expected
    assert note.endswith(" drawn again by other workers")


def error_of(client: Client, stage: Stage) -> HsplatError:
    """Return the error of a film that begins with the frame at which the fault happens."""
    with closing(ClusterDrawing(client, "--scheduler here", plan_of(stage), Reporter())) as executor:
        with pytest.raises(HsplatError) as caught:
            list(executor.draw(range(faulty.FRAME, NUM_FRAMES)))
        return caught.value


def test_the_error_of_a_worker_is_that_of_the_film(client: Client, stage: Stage, monkeypatch) -> None:
    monkeypatch.setattr("hsplat_cli.executors.cluster.cluster_drawing.draw_on_worker", faulty.input_error)
    error = error_of(client, stage)
    text = "scene.yaml: a bad frame\n  got: this\n  expected: that\n  hint: another"
    assert (type(error), str(error)) == (InputError, text)


def test_a_cluster_without_workers_is_an_error(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsplat_cli.executors.cluster.registry._MAX_WAIT_S", 0.5)
    with running_cluster(0) as cluster, connect(cluster.scheduler_address) as client:
        error = error_of(client, stage)
    assert str(error) == (
        "--scheduler here: the cluster has no workers\n  got: none for 0.5 s\n  hint: `dask worker ADDRESS` starts one"
    )
