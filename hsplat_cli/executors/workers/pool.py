"""Draws the frames of a film with several worker processes.

A worker that dies, or whose OpenGL context is lost, is replaced, and its frames are drawn again. So is one that hangs:
a long frame takes processor time, and a process that is stopped or dead-locked takes none. A hang is detected where the
system has a /proc, which macOS has not.
"""

from __future__ import annotations

import selectors
import time
from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager

import numpy as np

from hsplat_cli.executors.frame_result import FrameResult
from hsplat_cli.executors.schedule import MAX_LOSSES, FrameSchedule, Task
from hsplat_cli.executors.workers.child_processes import ChildProcesses
from hsplat_cli.executors.workers.messages import Message, error_from_plain
from hsplat_cli.executors.workers.process import HangPolicy, WorkerProcess, worker_environment
from hsplat_cli.executors.workers.shared_stage import SharedStage
from renderer.errors import HsplatError, RenderError
from renderer.film import Picture
from renderer.frame import Stage

PROGRAM = ("hsplat_cli.executors.workers.worker",)

_HANG_POLICY = HangPolicy()


@contextmanager
def open_pool(
    stage: Stage,
    num_workers: int,
    *,
    threads_per_worker: int,
    program: Sequence[str] = PROGRAM,
    hang_policy: HangPolicy = _HANG_POLICY,
) -> Iterator[Pool]:
    """Start worker processes, which take about a second until they are ready, and end them after the block.

    The stage moves to shared memory: callers go on with `Pool.stage` and drop theirs.

    threads_per_worker: of Mesa's software renderer; the variable LP_NUM_THREADS takes precedence. program: the module
    that workers run, and its arguments.

    Raises RenderError where the memory or the processes cannot be had. `Pool.is_ready` and `Pool.draw` raise what a
    worker failed with, and RenderError where a frame could not be drawn in spite of several attempts.
    """
    with ExitStack() as stack:
        shared = stack.enter_context(closing(SharedStage(stage)))
        del stage
        child_processes = stack.enter_context(ChildProcesses())
        pool = Pool(shared, child_processes, tuple(program), threads_per_worker, hang_policy)
        stack.callback(pool.close)
        pool.start(num_workers)
        yield pool


class Pool:
    """Worker processes; made by `open_pool`. For one thread; one call of `draw` at a time.

    stage: what is drawn, in shared memory.
    """

    def __init__(
        self,
        shared: SharedStage,
        child_processes: ChildProcesses,
        program: Sequence[str],
        threads_per_worker: int,
        hang_policy: HangPolicy,
    ) -> None:
        self.stage = shared.stage
        self._descriptor, self._child_processes, self._program = shared.descriptor, child_processes, program
        self._environment = worker_environment(threads_per_worker)
        self._workers: list[WorkerProcess] = []
        self._schedule = FrameSchedule[WorkerProcess]()
        self._selector = selectors.DefaultSelector()
        self._renderer_names: dict[str, None] = {}  # a set that keeps its order
        self._num_failed_starts = 0
        self._losses: Counter[tuple[str, bool]] = Counter()  # by how workers were lost, and whether with frames
        self._hang_policy, self._next_check = hang_policy, time.monotonic() + hang_policy.check_interval_s

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
        self._poll_messages(0)
        return any(worker.is_ready for worker in self._workers)

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """Yield these frames, in this order, at the tolerances of the schedule of the stage's scene.

        May be closed before its end.
        """
        return self._schedule.draw(numbers, self._assign_tasks, lambda: self._poll_messages(None))

    def start(self, num_workers: int) -> None:
        """Start this number of workers more."""
        for _ in range(num_workers):
            worker = WorkerProcess(
                self._child_processes, self._program, self._descriptor, self._environment, self._hang_policy
            )
            self._workers.append(worker)
            self._selector.register(worker, selectors.EVENT_READ)

    def close(self) -> None:
        """End all workers, whatever they do."""
        for worker in self._workers:
            worker.kill()
        for worker in self._workers:
            worker.close()
        self._workers.clear()
        self._selector.close()

    def _assign_tasks(self) -> None:
        while assigned := self._schedule.assign([worker for worker in self._workers if worker.is_ready]):
            worker, task = assigned
            worker.send(Message({"draw": task.number}))

    def _poll_messages(self, seconds: float | None) -> None:
        """Wait this long for messages of workers, and handle them; with None, until the next check for hung workers."""
        until_check = max(0.0, self._next_check - time.monotonic())
        for key, _ in self._selector.select(until_check if seconds is None else seconds):
            worker: WorkerProcess = key.fileobj  # type: ignore[assignment]
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
        for worker in list(self._workers):
            worker.check_progress(has_work=bool(self._schedule.tasks[worker]) or not worker.is_ready)
            if worker.is_hung:
                worker.kill()
                self._replace_worker(worker, None)
        self._next_check = time.monotonic() + self._hang_policy.check_interval_s

    def _handle_message(self, worker: WorkerProcess, message: Message) -> None:
        ((kind, content),) = message.content.items()
        if kind == "ready":
            worker.renderer_name = content
            self._renderer_names[content] = None
            self._num_failed_starts = 0
        elif kind == "drawn":
            task = self._schedule.tasks[worker][0]
            self._schedule.finish(worker, task, FrameResult(task.number, self._picture(*message.buffers), content))
        elif kind == "lost":
            worker.kill()
            self._replace_worker(worker, error_from_plain(content))
        else:
            raise error_from_plain(content)

    def _picture(self, png: bytes, pixels: bytes) -> Picture:
        output = self.stage.scene.output
        width, height = output.size
        shape = height, width, 4 if output.background is None else 3
        return Picture(np.frombuffer(pixels, np.uint8).reshape(shape), png)

    def _replace_worker(self, worker: WorkerProcess, error: HsplatError | None) -> None:
        """Replace a worker that has died, or fails with an error, and give its frames to others."""
        self._selector.unregister(worker)
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
            raise _repeated_loss_error(task, error)
        self.start(1)

    def _loss_text(self, worker: WorkerProcess, error: HsplatError | None) -> str:
        if error is not None:
            how = "lost OpenGL's context"
        else:
            how = f"hung ({self._hang_policy.hang_text})" if worker.is_hung else "died"
        return how + ", could not be ended" * worker.is_still_alive


def _repeated_loss_error(task: Task, error: HsplatError) -> RenderError:
    return RenderError(
        f"{error.what}, {MAX_LOSSES} times at the same frame",
        where=", ".join(filter(None, (error.where, f"frame {task.number}"))),
        got=error.got,
        expected=error.expected,
        hint=error.hint,
    )
