"""A frame is given to other workers until several have failed on it, or were lost at it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from typing import Any
from unittest import mock

import pytest
from distributed import KilledWorker
from film_stages import PLAIN, stage_of

from hsplat_cli.executors.cluster import cluster_executor
from hsplat_cli.executors.cluster.cluster_executor import ClusterExecutor
from hsplat_cli.terminal import Reporter
from renderer.errors import RenderError
from renderer.study import FilmPlan

# What a worker does at a frame besides drawing it.
DIE, FAIL, DIE_WITH_PICTURE, KILLED = "die", "fail", "die with the picture", "is killed, says Dask"

# More calls than this are a test that does not end.
MANY = 200

LOST = (
    "a worker was lost, 3 times at the same frame\n"
    "  got: no longer there: worker 1, worker 2, worker 3\n"
    "  hint: their logs may say why; Dask ends workers that exceed their memory limit"
)
LOST_LATER = LOST.replace("worker 1, worker 2, worker 3", "worker 2, worker 3, worker 4")


class Future:
    """Stands in for a frame that a worker has, or for the stage."""

    def __init__(self, key: str, number: int = 0) -> None:
        self.key, self.number, self.status = key, number, "pending"
        self.error: BaseException | None = None
        self._callbacks: list[Callable[[Future], None]] = []

    def add_done_callback(self, callback: Callable[[Future], None]) -> None:
        self._callbacks.append(callback)

    def end(self, status: str, error: BaseException | None = None) -> None:
        self.status, self.error = status, error
        for callback in self._callbacks:
            callback(self)

    def exception(self) -> BaseException | None:
        return self.error

    def result(self, timeout: float) -> Any:
        if self.error is not None:
            raise self.error
        return b"", {}, {"GL": "a device"}


class Cluster:
    """A scheduler and a registry of one worker, which is replaced when it is lost or excluded.

    does: returns what a worker, counted from 1, does at a frame. num_threads: the number of frames that a worker draws
    at once; it dies at any of them before it has drawn the first.
    """

    notes: Sequence[str] = ()

    def __init__(self, does: Callable[[int, int], str | None], num_threads: int = 1) -> None:
        self._does, self._num_threads, self._keys = does, num_threads, itertools.count()
        self._num_workers = self._num_submitted = self._num_looks = 0
        self._start()

    def _start(self) -> None:
        self._num_workers += 1
        self._tasks: list[Future] = []
        self.usable_workers = {f"worker {self._num_workers}"}

    def scatter(self, *_: Any, **__: Any) -> Future:
        stage = Future("stage")
        stage.status = "finished"
        return stage

    def submit(self, _: Any, __: Any, number: int, *, workers: list[str], pure: bool) -> Future:
        assert {*workers} == self.usable_workers and not pure
        self._num_submitted += 1
        assert self._num_submitted < MANY
        future = Future(f"frame {next(self._keys)}", number)
        self._tasks.append(future)
        return future

    def update_workers(self) -> None:
        """Let the worker finish its first frame, if it has any."""
        self._num_looks += 1
        assert self._num_looks < MANY
        if not self._tasks:
            return
        tasks, future = self._tasks, self._tasks[0]
        each = [self._does(self._num_workers, task.number) for task in tasks[: self._num_threads]]
        what = DIE if DIE in each else each[0]
        if what == DIE:
            self._start()
        elif what == KILLED:
            self._start()
            for each in tasks:
                each.end("error", KilledWorker(each.key, None, 0))
        elif what == FAIL:
            future.end("error", ValueError("not this one"))
        elif what == DIE_WITH_PICTURE:  # which is not noticed yet
            future.end("finished", CancelledError())
        else:
            del tasks[0]
            future.end("finished")

    def exclude(self, worker: str, why: str) -> None:
        assert {worker} == self.usable_workers
        self._start()

    def recheck(self, worker: str) -> None:
        if worker in self.usable_workers:
            self._start()


def draw(does: Callable[[int, int], str | None], numbers: Sequence[int], num_threads: int = 1) -> list[int]:
    cluster = Cluster(does, num_threads)
    with mock.patch.multiple(cluster_executor, _POLL_INTERVAL_S=0.0, WorkerRegistry=lambda *_: cluster):
        executor = ClusterExecutor(cluster, "", FilmPlan(stage_of(PLAIN)), Reporter())  # type: ignore[arg-type]
        return [result.number for result in executor.draw(numbers)]


@pytest.mark.parametrize(
    ("number", "how", "num_threads", "text"),
    [
        (12, DIE, 1, f"frame 12: {LOST}"),
        (12, KILLED, 1, f"frame 12: {LOST}"),
        # The first worker was lost at this frame or at its neighbour: then both are drawn alone.
        (11, DIE, 2, f"frame 11: {LOST_LATER}"),
        (10, DIE_WITH_PICTURE, 1, f"frame 10: {LOST_LATER}"),
        (12, FAIL, 1, "worker 3: frame 12 cannot be drawn\n  got: ValueError: not this one"),
    ],
)
def test_a_frame_that_each_worker_fails_on_is_an_error(number: int, how: str, num_threads: int, text: str) -> None:
    """The error names this frame, and not those that waited behind it."""
    with pytest.raises(RenderError) as caught:
        draw(lambda _, each: how if each == number else None, range(10, 18), num_threads)
    assert str(caught.value) == text


def test_only_failures_at_the_frame_itself_count() -> None:
    """Frame 1 waits behind frame 0 at two workers that die, frame 2 at two more, and then two cannot draw it."""
    met: list[int] = []

    def does(_: int, number: int) -> str | None:
        met.append(number)
        is_early = met.count(number) < 3
        return (DIE if number < 2 else FAIL if number == 2 else None) if is_early else None

    assert draw(does, range(4)) == [0, 1, 2, 3]
