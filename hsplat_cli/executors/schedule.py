"""Decides which worker draws which frame; for the process pool and the cluster alike.

A worker has two frames: the one that it draws, and the next. Results come back in order. Only a few frames are drawn
ahead of the one that is waited for. The frames of a lost worker go to others, until several workers were lost at one.
"""

from __future__ import annotations

import heapq
from collections import defaultdict, deque
from collections.abc import Callable, Generator, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from hsplat_cli.executors.frame_result import FrameResult

Worker = TypeVar("Worker", bound=Hashable)

MAX_LOSSES = 3
_FRAMES_PER_WORKER = 2
# Frames that are drawn, or finished and wait for one before them, for each worker.
_WINDOW_PER_WORKER = 4


@dataclass(eq=False)
class Task:
    """A frame to be drawn.

    index: its place in the order of results. results: those of the call of `draw`, by index. losses: the workers that
    were lost, or failed, while they drew it. is_suspect: a lost worker had it, which may be why the worker was lost; it
    is drawn alone. handle: what the executor keeps with the task while a worker has it.
    """

    index: int
    number: int
    results: dict[int, FrameResult]
    losses: list[Any] = field(default_factory=list)
    is_suspect: bool = False
    handle: Any = None


class FrameSchedule(Generic[Worker]):
    """The frames of a film: waiting, given to a worker, or finished before their turn.

    tasks: what each worker has, in the order in which it draws.
    """

    def __init__(self) -> None:
        self.tasks: defaultdict[Worker, deque[Task]] = defaultdict(deque)
        self._waiting: list[tuple[int, Task]] = []  # a heap, by index
        self._results: dict[int, FrameResult] = {}
        self._next = 0

    def draw(
        self, numbers: Sequence[int], assign: Callable[[], None], receive: Callable[[], None]
    ) -> Generator[FrameResult, None, None]:
        """Yield these frames in this order; may be closed before its end.

        assign: gives tasks to workers, by `assign`. receive: waits for a message and calls `finish` or `take_back`.
        """
        self._results = {}
        self._waiting = [(index, Task(index, number, self._results)) for index, number in enumerate(numbers)]
        for index in range(len(numbers)):
            self._next = index
            assign()
            while index not in self._results:
                receive()
                assign()
            yield self._results.pop(index)

    def assign(self, workers: Sequence[Worker]) -> tuple[Worker, Task] | None:
        """Give the next frame to the worker with the fewest; return None when each has enough."""
        if not (self._waiting and workers and self._waiting[0][0] < self._next + _WINDOW_PER_WORKER * len(workers)):
            return None
        task = self._waiting[0][1]
        worker = min(workers, key=self._load)
        # The last frames go to the workers that are free first.
        is_alone = task.is_suspect or len(self._waiting) < len(workers)
        if self._load(worker) >= (1 if is_alone else _FRAMES_PER_WORKER):
            return None
        heapq.heappop(self._waiting)
        self.tasks[worker].append(task)
        return worker, task

    def _load(self, worker: Worker) -> int:
        tasks = self.tasks[worker]
        return _FRAMES_PER_WORKER if any(task.is_suspect for task in tasks) else len(tasks)

    def finish(self, worker: Worker, task: Task, result: FrameResult) -> None:
        """Take the result of a worker's task."""
        self.tasks[worker].remove(task)
        task.results[task.index] = result

    def take_back(self, worker: Worker, at: Task | None = None) -> int:
        """Give the frames of a worker that is lost, or failed, to others; return their number.

        at: the frame that it drew; by default the first that it has.
        """
        tasks = self.tasks.pop(worker, deque())
        if tasks:
            (at or tasks[0]).losses.append(worker)
        for task in tasks:
            task.is_suspect, task.handle = True, None
            if task.results is self._results:  # else the call that wanted it is over
                heapq.heappush(self._waiting, (task.index, task))
        return len(tasks)
