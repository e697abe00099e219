"""Draws the frames of a film with several worker processes.

Frames are handed out one by one to whoever has least to do, and come back in order. A worker that dies, or whose GL
context is lost, is replaced, and what it had is drawn again. So is one that hangs: a frame that takes long takes
processor time, and a process that is stopped, dead-locked, or waits for what never comes, does not. That is seen where
the system has a /proc, which macOS has not.
"""

from __future__ import annotations

import heapq
import selectors
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field

import numpy as np

from hsplat_cli.executors.frame_result import FrameResult
from hsplat_cli.executors.workers.child_processes import ChildProcesses
from hsplat_cli.executors.workers.messages import Message, error_from_plain
from hsplat_cli.executors.workers.process import HangPolicy, WorkerProcess, worker_environment
from hsplat_cli.executors.workers.shared_stage import SharedStage
from renderer.errors import HsplatError, RenderError
from renderer.film import Picture
from renderer.frame import Stage

PROGRAM = ("hsplat_cli.executors.workers.worker",)

# A worker has the next frame at hand when one is done.
_TASKS_EACH = 2
# Finished frames that wait for a slow one, and those being drawn, are so many for each worker.
_WINDOW_PER_WORKER = 4
# A frame that kills whoever draws it is given up after so many; so are workers that die before they are ready.
_MAX_DEATHS = 3

_HANG_POLICY = HangPolicy()


@contextmanager
def open_pool(
    stage: Stage,
    num_workers: int,
    *,
    threads_per_worker: int,
    with_pixels: bool = True,
    program: Sequence[str] = PROGRAM,
    patience: HangPolicy = _HANG_POLICY,
) -> Iterator[Pool]:
    """Start worker processes, which need about a second until they are ready; after the block there are none.

    With 0 of them, `Pool.start` has to start some before anything is drawn.

    The stage moves to shared memory: `Pool.stage` is the one to go on with. threads_per_worker: of Mesa's software
    renderer, in each worker; where LP_NUM_THREADS is set, that holds. with_pixels: pictures come with their pixels
    beside the file that they would have to be decoded from. program: the module that workers run, and arguments.
    patience: with those that hang.

    Raises RenderError where the memory or the processes cannot be had. `Pool.is_ready` and `Pool.draw` raise what a
    worker failed with, and RenderError where a frame could not be drawn in spite of several tries.
    """
    with ExitStack() as stack:
        shared = stack.enter_context(closing(SharedStage(stage)))
        del stage
        child_processes = stack.enter_context(ChildProcesses())
        pool = Pool(shared, child_processes, tuple(program), threads_per_worker, with_pixels, patience)
        stack.callback(pool.close)
        pool.start(num_workers)
        yield pool


@dataclass(order=True)
class _Task:
    """A frame to be drawn. place: among those of its run."""

    place: int
    number: int = field(compare=False)
    run: _DrawCall = field(compare=False)
    num_deaths: int = field(compare=False, default=0)


class _DrawCall:
    """The frames of one call of `draw`.

    waiting: a heap of those that nobody is at. done: by place, until they are taken.
    """

    def __init__(self, numbers: Sequence[int]) -> None:
        self.waiting = [_Task(place, number, self) for place, number in enumerate(numbers)]
        self.done: dict[int, FrameResult] = {}


class Pool:
    """Made by `open_pool`. It is for one thread, and its frames are drawn in one `draw` at a time.

    stage: what is drawn, in shared memory.
    """

    def __init__(
        self,
        shared: SharedStage,
        child_processes: ChildProcesses,
        program: Sequence[str],
        threads_per_worker: int,
        with_pixels: bool,
        patience: HangPolicy,
    ) -> None:
        self.stage = shared.stage
        self._descriptor, self._child_processes, self._program = shared.descriptor, child_processes, program
        self._environment = worker_environment(threads_per_worker)
        self._with_pixels = with_pixels
        self._workers: list[WorkerProcess[_Task]] = []
        self._selector = selectors.DefaultSelector()
        self._renderer_names: dict[str, None] = {}  # a set that keeps its order
        self._num_failed_starts = 0
        self._losses: Counter[tuple[str, bool]] = Counter()  # by how workers were lost, and whether with frames
        self._hang_policy, self._next_check = patience, time.monotonic() + patience.check_interval_s

    @property
    def notes(self) -> list[str]:
        """What the user should know."""
        return [
            f"{num} of the processes that draw {how} and {'was' if num == 1 else 'were'} replaced"
            + f", and what {'it' if num == 1 else 'they'} had was drawn again" * had_frames
            for (how, had_frames), num in self._losses.items()
        ]

    @property
    def drivers(self) -> tuple[str, ...]:
        """The GL renderers of the workers that are or were ready: one, unless devices differ."""
        return tuple(self._renderer_names)

    @property
    def is_ready(self) -> bool:
        """Whether any worker can draw; it does not wait."""
        self._poll_messages(0)
        return any(worker.is_ready for worker in self._workers)

    def draw(self, numbers: Sequence[int]) -> Iterator[FrameResult]:
        """These frames, in this order, at the tolerances of the schedule of the stage's scene.

        It may be left before its end. Only few frames are drawn ahead of what was taken.
        """
        run = _DrawCall(numbers)
        for place in range(len(numbers)):
            self._assign_tasks(run, place)
            while place not in run.done:
                self._poll_messages(None)
                self._assign_tasks(run, place)
            yield run.done.pop(place)

    def start(self, num_workers: int) -> None:
        """Start so many workers more."""
        for _ in range(num_workers):
            worker = WorkerProcess[_Task](
                self._child_processes, self._program, self._descriptor, self._environment, self._hang_policy
            )
            self._workers.append(worker)
            self._selector.register(worker, selectors.EVENT_READ)

    def close(self) -> None:
        """End all workers, whatever they are at."""
        for worker in self._workers:
            worker.kill()
        for worker in self._workers:
            worker.close()
        self._workers.clear()
        self._selector.close()

    def _assign_tasks(self, run: _DrawCall, place: int) -> None:
        """Give tasks to the workers while the frame of a place is waited for."""
        end = place + _WINDOW_PER_WORKER * len(self._workers)
        while run.waiting and run.waiting[0].place < end:
            ready = [worker for worker in self._workers if worker.is_ready]
            worker = min(ready, key=lambda worker: len(worker.tasks), default=None)
            # The last ones go to whoever is free first.
            most = _TASKS_EACH if len(run.waiting) >= len(self._workers) else 1
            if worker is None or len(worker.tasks) >= most:
                return
            task = heapq.heappop(run.waiting)
            worker.tasks.append(task)
            worker.send(Message({"draw": task.number, "pixels": self._with_pixels}))

    def _poll_messages(self, seconds: float | None) -> None:
        """Take what workers have to say, of which there is something or will be within this time; None is a while."""
        until_look = max(0.0, self._next_check - time.monotonic())
        for key, _ in self._selector.select(until_look if seconds is None else seconds):
            worker: WorkerProcess[_Task] = key.fileobj  # type: ignore[assignment]
            try:
                message = worker.receive()
            except EOFError:
                self._replace_worker(worker, None)
            else:
                if message is not None:
                    self._handle_message(worker, message)
        if time.monotonic() >= self._next_check:
            self._end_hung_workers()

    def _end_hung_workers(self) -> None:
        """End workers that hang."""
        for worker in list(self._workers):
            worker.look()
            if worker.hangs:
                worker.kill()
                self._replace_worker(worker, None)
        self._next_check = time.monotonic() + self._hang_policy.check_interval_s

    def _handle_message(self, worker: WorkerProcess[_Task], message: Message) -> None:
        ((kind, content),) = message.content.items()
        if kind == "ready":
            worker.renderer_name = content
            self._renderer_names[content] = None
            self._num_failed_starts = 0
        elif kind == "drawn":
            task = worker.tasks.popleft()
            task.run.done[task.place] = FrameResult(task.number, self._picture(*message.runs), content)
        elif kind == "lost":
            worker.kill()
            self._replace_worker(worker, error_from_plain(content))
        else:
            raise error_from_plain(content)

    def _picture(self, png: bytes, pixels: bytes | None = None) -> Picture:
        if pixels is None:
            return Picture(png=png)
        output = self.stage.scene.output
        width, height = output.size
        shape = height, width, 4 if output.background is None else 3
        return Picture(np.frombuffer(pixels, np.uint8).reshape(shape), png)

    def _replace_worker(self, worker: WorkerProcess[_Task], error: HsplatError | None) -> None:
        """Replace a worker that has died, or has to go with an error; what it had goes back to those that wait."""
        self._selector.unregister(worker)
        self._workers.remove(worker)
        worker.close()
        may_be_chance = error is not None or worker.was_killed
        self._losses[self._how_lost(worker, error), bool(worker.tasks)] += 1
        error = error or worker.exit_error()
        if not worker.is_ready:
            self._num_failed_starts += 1
            if not may_be_chance or self._num_failed_starts == _MAX_DEATHS:
                raise error
        for task in worker.tasks:
            heapq.heappush(task.run.waiting, task)
        if worker.tasks:
            task = worker.tasks[0]
            task.num_deaths += 1
            if task.num_deaths == _MAX_DEATHS:
                raise self._too_many_deaths_error(task, error)
        self.start(1)

    def _how_lost(self, worker: WorkerProcess[_Task], error: HsplatError | None) -> str:
        if error is not None:
            how = "lost OpenGL's context"
        else:
            how = f"hung ({self._hang_policy.verdict})" if worker.hangs else "died"
        return how + ", could not be ended" * worker.is_left

    def _too_many_deaths_error(self, task: _Task, error: HsplatError) -> RenderError:
        return RenderError(
            f"{error.what}, {_MAX_DEATHS} times at the same frame",
            where=", ".join(filter(None, (error.where, f"frame {task.number}"))),
            got=error.got,
            expected=error.expected,
            hint=error.hint,
        )
