"""A frame is given to other workers until several have failed on it, or were lost at it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import closing, contextmanager
from typing import Any
from unittest import mock

import pytest
from distributed import KilledWorker
from film_stages import PLAIN, stage_of

from hsplat_cli.executors import ClusterDrawing
from hsplat_cli.terminal import Reporter
from renderer.errors import RenderError
from renderer.frame import ScheduleController
from renderer.job import FilmPlan
from renderer.record import FrameRecord
from renderer.system import MemoryShare

# What a worker does at a frame besides drawing it.
DIE, FAIL, DIE_WITH_PICTURE, KILLED = "die", "fail", "die with the picture", "is killed, says Dask"

# More workers than this are a test that does not end.
MANY = 200

LOST = (
    "a worker was lost, 3 times at the same frame\n"
    "  got: no longer there: worker 1, worker 2, worker 3\n"
    "  hint: their logs may say why; workers that need too much memory are ended"
)


class Future:
    """Stands in for a frame that a worker has, or for the stage."""

    def __init__(self, status: str, error: BaseException | None = None) -> None:
        self.status, self.error = status, error

    number = 0

    def add_done_callback(self, callback: Callable[[Future], None]) -> None:
        if self.status != "pending":
            callback(self)

    def exception(self) -> BaseException | None:
        return self.error

    def result(self, timeout: float) -> Any:
        if self.error is not None:
            raise self.error
        return {0: b""}, FrameRecord(self.number, 0.0, 1, 1, {}), {"device": "a device"}


class Cluster:
    """A scheduler and a registry of one worker, which is replaced when it is lost or excluded.

    does: returns what a worker, counted from 1, does at a frame.
    """

    notes: Sequence[str] = ()

    def __init__(self, does: Callable[[int, int], str | None]) -> None:
        self._does, self._num_workers = does, 0
        self._replace("")

    def _replace(self, worker: str, why: str = "") -> None:
        self._num_workers += 1
        assert self._num_workers < MANY
        self.usable_workers = {f"worker {self._num_workers}"}

    exclude = recheck = _replace

    @contextmanager
    def idle_worker(self) -> Iterator[str]:
        yield min(self.usable_workers)

    def scatter(self, *_: Any, **__: Any) -> Future:
        return Future("finished")

    def num_beside(self, worker: str) -> int:
        assert worker in self.usable_workers
        return 3

    def submit(self, _: Any, __: Any, number: int, memory: Any, *, workers: list[str], pure: bool) -> Future:
        assert {*workers} == self.usable_workers and not pure
        assert memory == MemoryShare(MEMORY, 4)  # of three workers, and this process
        match self._does(self._num_workers, number):
            case "die":
                self.usable_workers = set()
                return Future("pending")
            case "is killed, says Dask":
                return Future("error", KilledWorker("key", None, 0))
            case "fail":
                return Future("error", ValueError("not this one"))
            case "die with the picture":  # which is not noticed yet
                return Future("finished", CancelledError())
        found = Future("finished")
        found.number = number
        return found

    def update_workers(self) -> int:
        return 1

    def close(self) -> None:
        pass


MEMORY = 12345
PLAN = FilmPlan(stage_of(PLAIN), ScheduleController(stage_of(PLAIN)))


def draw(does: Callable[[int, int], str | None], numbers: Sequence[int]) -> list[int]:
    cluster = Cluster(does)
    replaced = {"_POLL_INTERVAL_S": 0.0, "_MAX_THREADS": 1, "WorkerRegistry": lambda *_: cluster}
    with mock.patch.multiple("hsplat_cli.executors.cluster.cluster_drawing", **replaced):
        executor = ClusterDrawing(cluster, "", PLAN, Reporter(), MEMORY)  # type: ignore[arg-type]
        with closing(executor):
            return [result.record.frame for result in executor.draw(numbers)]


@pytest.mark.parametrize(
    ("how", "text"),
    [
        (DIE, f"frame 12: {LOST}"),
        (KILLED, f"frame 12: {LOST}"),
        (DIE_WITH_PICTURE, f"frame 12: {LOST}"),
        (FAIL, "worker 3: frame 12 cannot be drawn\n  got: ValueError: not this one"),
    ],
)
def test_a_frame_that_each_worker_fails_on_is_an_error(how: str, text: str) -> None:
    """The error names this frame, and not those that wait."""
    with pytest.raises(RenderError) as caught:
        draw(lambda _, each: how if each == 12 else None, range(10, 18))
    assert str(caught.value) == text


def test_a_frame_is_drawn_once_a_worker_can() -> None:
    met: list[int] = []

    def does(_: int, number: int) -> str | None:
        met.append(number)
        return [DIE, FAIL, None][min(number, 2)] if met.count(number) < 3 else None

    assert draw(does, range(4)) == [0, 1, 2, 3]
    assert [met.count(number) for number in range(4)] == [3, 3, 1, 1]
