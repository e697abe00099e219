"""How often a frame is given to another worker: until several have failed on it, or were lost at it, and no more."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from typing import Any

import pytest
from distributed import KilledWorker
from film_stages import PLAIN, stage_of

from hsplat_cli.executors.cluster import cluster_executor
from hsplat_cli.executors.cluster.cluster_executor import ClusterExecutor
from renderer.errors import RenderError
from renderer.study import FilmPlan

# What a worker does at a frame besides drawing it.
DIE, FAIL, DIE_WITH_PICTURE, KILLED = "die", "fail", "die with the picture", "is killed, says Dask"

# Of a test that does not end.
MANY = 200

LOST = (
    "a worker was lost, 3 times at the same frame\n"
    "  got: no longer there: worker 1, worker 2, worker 3\n"
    "  hint: their logs may say why; Dask ends workers that exceed their memory limit"
)


class Future:
    """A frame that a worker has, or the stage."""

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
    """The scheduler and the registry of one worker, in whose place another one comes when it is lost or dismissed.

    does: what happens when a worker, counted from 1, is at a frame. num_threads: a worker is at so many frames; it
    dies at any of them before it has drawn the first.
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
        """The worker is done with its first frame, if it has any."""
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


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_executor, "_POLL_INTERVAL_S", 0.0)


def drawn(cluster: Cluster, numbers: Sequence[int]) -> list[int]:
    found = ClusterExecutor(cluster, cluster, FilmPlan(stage_of(PLAIN))).draw(numbers)  # type: ignore[arg-type]
    return [frame.number for frame in found]


@pytest.mark.parametrize("how", [DIE, KILLED])
def test_a_frame_that_kills_each_worker(how: str) -> None:
    """That one is told, and not those that waited behind it."""
    cluster = Cluster(lambda worker, number: how if number == 12 else None)
    with pytest.raises(RenderError) as caught:
        drawn(cluster, range(10, 18))
    assert str(caught.value) == f"frame 12: {LOST}"


def test_a_frame_that_kills_workers_that_are_at_the_one_before_it() -> None:
    """Which of the two it was is not known; then they are drawn one by one."""
    cluster = Cluster(lambda worker, number: DIE if number == 11 else None, num_threads=2)
    with pytest.raises(RenderError) as caught:
        drawn(cluster, range(10, 18))
    last = LOST.replace("worker 1, worker 2, worker 3", "worker 2, worker 3, worker 4")
    assert str(caught.value) == f"frame 11: {last}"


def test_a_picture_that_never_comes() -> None:
    cluster = Cluster(lambda worker, number: DIE_WITH_PICTURE)
    with pytest.raises(RenderError) as caught:
        drawn(cluster, [7])
    assert str(caught.value) == f"frame 7: {LOST}"


@pytest.mark.parametrize("how", [DIE, KILLED])
def test_workers_that_die_at_different_frames(how: str) -> None:
    """Each frame has cost two of them when it is drawn by the third, and has waited for its turn at two more."""
    met: list[int] = []

    def does(worker: int, number: int) -> str | None:
        met.append(number)
        return how if met.count(number) < 3 else None

    assert drawn(Cluster(does), range(4)) == [0, 1, 2, 3]


@pytest.mark.parametrize("how", [DIE, KILLED])
def test_a_frame_that_waited_at_workers_that_died_may_fail_as_often_as_another(how: str) -> None:
    """Frame 1 waits behind frame 0 at two of them, frame 2 at two more, and then a worker cannot draw it."""
    met: list[int] = []

    def does(worker: int, number: int) -> str | None:
        met.append(number)
        if number < 2:
            return how if met.count(number) < 3 else None
        return FAIL if number == 2 and met.count(2) < 3 else None

    assert drawn(Cluster(does), range(4)) == [0, 1, 2, 3]


def test_a_frame_that_waited_at_workers_that_failed_may_fail_as_often_as_another() -> None:
    met: list[int] = []

    def does(worker: int, number: int) -> str | None:
        met.append(number)
        return FAIL if met.count(number) < 3 else None

    assert drawn(Cluster(does), range(4)) == [0, 1, 2, 3]


def test_a_frame_that_each_worker_fails_on() -> None:
    cluster = Cluster(lambda worker, number: FAIL if number == 12 else None)
    with pytest.raises(RenderError) as caught:
        drawn(cluster, range(10, 18))
    assert str(caught.value) == "worker 3: frame 12 cannot be drawn\n  got: ValueError: not this one"
