"""Draws a film on a cluster: two frames at a time for each worker, those of workers that die once more by others.

Each frame is given to one worker, and the client decides which: so no worker that cannot draw swallows frame after
frame, and what is under way, or waits for its turn here, is bounded. Workers may come and go.
"""

from __future__ import annotations

import contextlib
import heapq
import queue
from collections import Counter, defaultdict
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hsplat_cli.executors.cluster.connection import connect
from hsplat_cli.executors.cluster.registry import WorkerRegistry
from hsplat_cli.executors.cluster.worker import SerializedStage, draw
from hsplat_cli.executors.frame_result import FrameResult
from hsplat_cli.terminal import Reporter
from renderer.errors import ContextLostError, HsplatError, RenderError
from renderer.film import Picture
from renderer.frame import Stage, serialized_stage
from renderer.versions import package_versions

if TYPE_CHECKING:
    from distributed import Client, Future

PATIENCE_S = 60.0
# Frames that a worker has: one that it draws, and one so that it need not wait for the next.
_AT_ONCE = 2
# So many frames for each worker may be under way or wait for one before them.
_WINDOW_PER_WORKER = 4
# A frame that so many workers have failed on, or so many were lost at, is not given to another.
_MOST_TRIES = 3
# When nothing is done for so long, workers are looked for.
_WAIT_S = 0.5
# If a picture that is drawn has not come after so long, a look is taken whether its worker is still there.
_FETCH_TIMEOUT_S = 2.0
# Of a frame's future, once it was drawn: Dask has the picture, or had it.
_FINISHED_STATUSES = ("finished", "lost")


@contextlib.contextmanager
def open_cluster(
    address: str, reporter: Reporter, *, num_workers: int | None = None, patience_s: float = PATIENCE_S
) -> Iterator[Cluster]:
    """The cluster of the Dask scheduler at an address, or at `local` one of processes on this machine.

    num_workers: of `local`, as many as cores by default. patience_s: the longest time without any worker.

    Raises InputError where nobody answers; RenderError, in the block, where workers are missing or cannot draw.
    """
    with connect(address, num_workers) as client:
        yield Cluster(client, address, patience_s, reporter)


class Cluster:
    """A connection with a scheduler; made by `open_cluster`."""

    def __init__(self, client: Client, address: str, patience_s: float, reporter: Reporter) -> None:
        self._client, self._address, self._patience_s, self._reporter = client, address, patience_s, reporter

    @contextlib.contextmanager
    def for_stage(self, stage: Stage) -> Iterator[ClusterExecutor]:
        """What draws this stage, whose goal is resolved, at the tolerances of its schedule."""
        registry = WorkerRegistry(self._client, self._address, self._patience_s, self._reporter)
        drawer = ClusterExecutor(registry, self._client, stage)
        try:
            yield drawer
        finally:
            drawer.release()


@dataclass(frozen=True)
class _Task:
    """A frame that a worker has; index: its place among the frames that were asked for."""

    index: int
    worker: str
    future: Future


class ClusterExecutor:
    """A Drawer; made by `Cluster.for_stage`."""

    def __init__(self, registry: WorkerRegistry, client: Client, stage: Stage) -> None:
        self._registry, self._client, self._stage = registry, client, stage
        self._stage_data: Future | None = None
        self._worker_versions: list[dict[str, Any]] = []  # each once
        self._num_redrawn = 0

    @property
    def drivers(self) -> tuple[str, ...]:
        """Devices and drivers of the frames so far, as GL names them: one, unless machines differ."""
        return tuple(dict.fromkeys(maker["GL"] for maker in self._worker_versions))

    @property
    def notes(self) -> list[str]:
        """What the user should know: which versions drew, where they differ from those here, and what went wrong."""
        here = package_versions()
        seen = {name: sorted({maker[name] for maker in self._worker_versions}) for name in here}
        mixed = [
            f"{name} {' and '.join(found)}, which is {here[name]} here"
            for name, found in seen.items()
            if found not in ([], [here[name]])
        ]
        notes = [f"bytes may differ from frame to frame, drawn by different workers: {'; '.join(mixed)}"] * bool(mixed)
        again = f"{self._num_redrawn} frame{'s were' if self._num_redrawn > 1 else ' was'} drawn again by other workers"
        return [*notes, *self._registry.notes, *[again] * bool(self._num_redrawn)]

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """As in Drawer.

        Raises RenderError, or what a frame failed with, once several workers have failed on it, or were lost at it.
        """
        film = _FrameQueue(numbers)
        for index in range(len(numbers)):
            while index not in film.drawn:
                self._registry.look()
                self._requeue_lost(film)
                self._assign_tasks(film, index)
                self._receive(film)
            yield film.drawn.pop(index)

    def release(self) -> None:
        """Let the workers forget the stage."""
        self._stage_data = None

    def _assign_tasks(self, film: _FrameQueue, first: int) -> None:
        """Give to each worker frames from the first that is missing on."""
        if not self._registry.fit:
            return
        if self._stage_data is None or self._stage_data.status != "finished":  # lost, with the workers that had it
            self._stage_data = self._scatter_stage()
        while (
            self._stage_data is not None
            and film.left
            and film.left[0] < first + _WINDOW_PER_WORKER * len(self._registry.fit)
        ):
            worker = min(sorted(self._registry.fit), key=film.busy)
            if film.busy(worker) >= (1 if film.left[0] in film.suspects else _AT_ONCE):
                return
            index = heapq.heappop(film.left)
            number = film.numbers[index]
            future = self._client.submit(draw, self._stage_data, number, workers=[worker], pure=False)
            film.add(_Task(index, worker, future))

    def _scatter_stage(self) -> Future | None:
        """The stage to one worker, if it is still there; the others get it from it, and from each other."""
        stage_data = SerializedStage(serialized_stage(self._stage))
        try:
            return self._client.scatter(stage_data, workers=[min(self._registry.fit)], hash=False)
        except (KeyError, OSError, TimeoutError):
            return None

    def _receive(self, film: _FrameQueue) -> None:
        """Wait a moment for a frame that a worker is done with, one way or another."""
        task = film.next_finished(_WAIT_S)
        if task is None:
            return
        error = task.future.exception() if task.future.status == "error" else None
        if error is not None and not _is_killed_worker(error):
            self._handle_failure(film, task, error)
            return
        result = None if error is not None else self._fetch(task)
        if result is None:
            self._registry.recheck(task.worker)
            self._requeue_lost(film)
            return
        film.remove(task)
        png, record, maker = result
        film.drawn[task.index] = FrameResult(film.numbers[task.index], Picture(png=png), {**record, "gl": maker["GL"]})
        if maker not in self._worker_versions:
            self._worker_versions.append(maker)

    def _fetch(self, task: _Task) -> Any:
        """What a worker has drawn; None where it died before that came."""
        seconds = _FETCH_TIMEOUT_S
        while True:
            try:
                return task.future.result(timeout=seconds)
            except (CancelledError, KeyError):
                return None
            except (TimeoutError, OSError):
                self._registry.look()
                if task.worker not in self._registry.fit:
                    return None
                seconds *= 2

    def _requeue_lost(self, film: _FrameQueue) -> None:
        """Frames of workers that are gone go to others, unless one of them may be why they are gone."""
        self._num_redrawn += film.requeue_lost(self._registry.fit)
        for index, workers in film.losses.items():
            if len(workers) >= _MOST_TRIES:
                raise RenderError(
                    f"a worker was lost, {_MOST_TRIES} times at the same frame",
                    where=f"frame {film.numbers[index]}",
                    got=f"no longer there: {', '.join(workers)}",
                    hint="their logs may say why; those that take more memory than they may are ended",
                )

    def _handle_failure(self, film: _FrameQueue, task: _Task, error: BaseException) -> None:
        """A worker could not draw a frame: is it the worker, or the frame?"""
        film.num_failures[task.index] += 1
        lost_context = isinstance(error, ContextLostError)  # which may come back
        if not lost_context:
            self._registry.exclude(task.worker, str(error))
        self._num_redrawn += film.requeue([task] if lost_context else film.tasks_of(task.worker))
        if film.num_failures[task.index] >= _MOST_TRIES or not self._registry.fit:
            if isinstance(error, HsplatError):
                raise error
            got = f"{type(error).__name__}: {error}"
            raise RenderError(
                f"frame {film.numbers[task.index]} cannot be drawn", where=task.worker, got=got
            ) from error


def _is_killed_worker(error: BaseException) -> bool:
    """Whether this is what Dask makes of a task whose worker died, once too often by its own settings."""
    from distributed import KilledWorker

    return isinstance(error, KilledWorker)


class _FrameQueue:
    """Where the frames of a film are: left to be given to a worker, at one, or drawn and waiting for their turn.

    left: indices of frames in a heap. drawn: frames by index. num_failures: how often a frame could not be drawn, by
    index. losses: the workers that were lost while they were at a frame, by its index. suspects: indices of frames that
    workers had when they were lost; of several threads any may have been why. They are drawn alone.
    """

    def __init__(self, numbers: Sequence[int]) -> None:
        self.numbers, self.left = numbers, list(range(len(numbers)))
        self.drawn: dict[int, FrameResult] = {}
        self.num_failures: Counter[int] = Counter()
        self.losses: defaultdict[int, list[str]] = defaultdict(list)
        self.suspects: set[int] = set()
        self._tasks: dict[str, _Task] = {}  # by the key of the future, in the order in which they were given
        self._done: queue.SimpleQueue[str] = queue.SimpleQueue()

    def add(self, task: _Task) -> None:
        """A worker has this frame."""
        self._tasks[task.future.key] = task
        task.future.add_done_callback(lambda future: self._done.put(future.key))

    def next_finished(self, timeout_s: float) -> _Task | None:
        """A frame that its worker is done with, one way or another, or None when there was none for so long."""
        try:
            return self._tasks.get(self._done.get(timeout=timeout_s))
        except queue.Empty:
            return None

    def tasks_of(self, worker: str) -> list[_Task]:
        """The frames that a worker has, in the order in which it draws them."""
        return [task for task in self._tasks.values() if task.worker == worker]

    def busy(self, worker: str) -> int:
        """How many frames a worker has, or as many as it may have where nothing is to wait behind one of them."""
        tasks = self.tasks_of(worker)
        return _AT_ONCE if any(task.index in self.suspects for task in tasks) else len(tasks)

    def remove(self, task: _Task) -> None:
        """Its worker does not have this frame any more."""
        del self._tasks[task.future.key]

    def requeue(self, tasks: Sequence[_Task]) -> int:
        """Frames are to be drawn by other workers; how many."""
        for task in tasks:
            self.remove(task)
            heapq.heappush(self.left, task.index)
        return len(tasks)

    def requeue_lost(self, workers: set[str]) -> int:
        """Frames of other workers than these, which are lost, are to be drawn by these; how many."""
        num_before = len(self.left)
        for worker in {task.worker: None for task in self._tasks.values() if task.worker not in workers}:
            tasks = self.tasks_of(worker)
            # The others were drawn, or waited, as far as is known. If all were drawn, it is the last.
            at = next((task for task in tasks if task.future.status not in _FINISHED_STATUSES), tasks[-1])
            self.losses[at.index].append(worker)
            self.suspects.update(task.index for task in tasks)
            self.requeue(tasks)
        return len(self.left) - num_before
