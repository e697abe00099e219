"""Draws the frames of a film with several worker processes.

A worker that dies, or whose OpenGL context is lost, is replaced, and its frames are drawn again. So is one that hangs:
a long frame takes processor time, and a process that is stopped or dead-locked takes none. A hang is detected where the
system has a /proc, which macOS has not.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from queue import Empty, SimpleQueue

from hsplat_cli.executors.frame_result import FrameResult
from hsplat_cli.executors.schedule import MAX_LOSSES, FrameSchedule
from hsplat_cli.executors.workers import process
from hsplat_cli.executors.workers.child_processes import ChildProcesses
from hsplat_cli.executors.workers.process import Message, Messages, WorkerProcess
from hsplat_cli.executors.workers.shared_stage import map_stage, share_stage
from renderer.errors import ContextLostError, HsplatError
from renderer.frame import Stage

# The module that workers run, and its arguments.
PROGRAM: Sequence[str] = ("hsplat_cli.executors.workers.worker",)


@contextmanager
def open_pool(stage: Stage, num_workers: int, *, threads_per_worker: int) -> Iterator[Pool]:
    """Start worker processes, which take about a second until they are ready, and end them after the block.

    The stage moves to shared memory: callers go on with `Pool.stage` and drop theirs.

    threads_per_worker: of Mesa's software renderer; the variable LP_NUM_THREADS takes precedence.

    Raises RenderError where the memory or the processes cannot be had. `Pool.is_ready` and `Pool.draw` raise what a
    worker failed with, and RenderError where a frame could not be drawn in spite of several attempts.
    """
    environment = {"LP_NUM_THREADS": str(threads_per_worker)} | os.environ
    with ExitStack() as stack:
        descriptor = share_stage(stage)
        stack.callback(os.close, descriptor)
        del stage
        child_processes = stack.enter_context(ChildProcesses())
        pool = Pool(map_stage(descriptor), partial(WorkerProcess, child_processes, PROGRAM, descriptor, environment))
        stack.callback(pool.close)
        pool.start(num_workers)
        yield pool


class Pool:
    """Worker processes; made by `open_pool`. For one thread; one call of `draw` at a time.

    stage: what is drawn, in shared memory.
    """

    def __init__(self, stage: Stage, start_worker: Callable[[Messages], WorkerProcess]) -> None:
        self.stage, self._start_worker = stage, start_worker
        self._workers: list[WorkerProcess] = []
        self._messages: Messages = SimpleQueue()
        self._schedule = FrameSchedule[WorkerProcess]()
        self._renderer_names: dict[str, None] = {}  # a set that keeps its order
        self._num_failed_starts = 0
        self._losses: Counter[tuple[str, bool]] = Counter()  # by how workers were lost, and whether with frames
        self._next_check = time.monotonic() + process.CHECK_INTERVAL_S

    @property
    def notes(self) -> list[str]:
        """As in FrameExecutor."""
        return [
            f"{num} of the processes that draw {how} and {'was' if num == 1 else 'were'} replaced"
            + f", and what {'it' if num == 1 else 'they'} had was drawn again" * had_frames
            for (how, had_frames), num in self._losses.items()
        ]

    @property
    def drivers(self) -> tuple[str, ...]:
        """As in FrameExecutor."""
        return tuple(self._renderer_names)

    @property
    def is_ready(self) -> bool:
        """Whether any worker can draw; it does not wait."""
        self._handle_next_message(may_wait=False)
        return any(worker.is_ready for worker in self._workers)

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """Yield these frames, in this order, at the tolerances of the schedule of the stage's scene.

        May be closed before its end.
        """
        return self._schedule.draw(numbers, self._assign_tasks, lambda: self._handle_next_message(may_wait=True))

    def start(self, num_workers: int) -> None:
        """Start this number of workers more."""
        for _ in range(num_workers):
            self._workers.append(self._start_worker(self._messages))

    def close(self) -> None:
        """End all workers, whatever they do."""
        for worker in self._workers:
            worker.kill()
        for worker in self._workers:
            worker.close()
        self._workers.clear()

    def _assign_tasks(self) -> None:
        while assigned := self._schedule.assign([worker for worker in self._workers if worker.is_ready]):
            worker, task = assigned
            worker.send(task.number)

    def _handle_next_message(self, *, may_wait: bool) -> None:
        """Handle a message of a worker, if there is one before the next check for hung workers is due."""
        until_check = max(0.0, self._next_check - time.monotonic())
        with suppress(Empty):
            self._handle_message(*self._messages.get(timeout=until_check if may_wait else 0.0))
        if time.monotonic() >= self._next_check:
            self._end_hung_workers()

    def _end_hung_workers(self) -> None:
        for worker in list(self._workers):
            worker.check_progress(has_work=bool(self._schedule.tasks[worker]) or not worker.is_ready)
            if worker.is_hung:
                worker.kill()
                self._replace_worker(worker, None)
        self._next_check = time.monotonic() + process.CHECK_INTERVAL_S

    def _handle_message(self, worker: WorkerProcess, message: Message) -> None:
        if worker not in self._workers:  # it was replaced
            return
        worker.note_message()
        if isinstance(message, str):
            worker.renderer_name = message
            self._renderer_names[message] = None
            self._num_failed_starts = 0
        elif isinstance(message, FrameResult):
            self._schedule.finish(worker, self._schedule.tasks[worker][0], message)
        elif message is None:
            self._replace_worker(worker, None)
        elif isinstance(message, ContextLostError):
            worker.kill()
            self._replace_worker(worker, message)
        else:
            raise message

    def _replace_worker(self, worker: WorkerProcess, error: HsplatError | None) -> None:
        """Replace a worker that has died, or fails with an error, and give its frames to others."""
        self._workers.remove(worker)
        worker.close()
        may_be_chance = error is not None or worker.was_killed
        task = next(iter(self._schedule.tasks[worker]), None)
        self._schedule.take_back(worker)
        self._losses[self._loss_text(worker, error), task is not None] += 1
        error = error or worker.exit_error()
        if not worker.is_ready:
            self._num_failed_starts += 1
            if not may_be_chance or self._num_failed_starts == MAX_LOSSES:
                raise error
        if task is not None and len(task.losses) == MAX_LOSSES:
            error.what += f", {MAX_LOSSES} times at the same frame"
            error.where = ", ".join(filter(None, (error.where, f"frame {task.number}")))
            raise error
        self.start(1)

    def _loss_text(self, worker: WorkerProcess, error: HsplatError | None) -> str:
        if error is not None:
            how = "lost OpenGL's context"
        else:
            how = f"hung ({process.hang_text()})" if worker.is_hung else "died"
        return how + ", could not be ended" * worker.is_still_alive
