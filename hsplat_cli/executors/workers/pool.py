"""Draws the frames of a film with several worker processes.

A worker that dies, or whose OpenGL context is lost, is replaced, and its frames are drawn again. So is one that hangs:
a long frame takes processor time, and a process that is stopped or dead-locked takes none. A hang is detected where the
system has a /proc, which macOS has not.
"""

from __future__ import annotations

import itertools
import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import partial
from queue import SimpleQueue
from typing import Any

from hsplat_cli.executors.frame_result import FrameResult
from hsplat_cli.executors.schedule import MAX_LOSSES, draw_ahead
from hsplat_cli.executors.workers import process
from hsplat_cli.executors.workers.process import WorkerLostError, WorkerProcess
from hsplat_cli.executors.workers.shared_stage import map_stage, share_stage
from renderer.errors import HsplatError
from renderer.frame import Stage
from renderer.system import ChildProcesses

# The module that workers run, and its arguments.
PROGRAM: Sequence[str] = ("hsplat_cli.executors.workers.worker",)


@contextmanager
def open_pool(stage: Stage, num_workers: int, *, threads_per_worker: int) -> Iterator[Pool]:
    """Start worker processes, which take about a second until they are ready, and end them after the block.

    The stage moves to shared memory: callers go on with `Pool.stage` and drop theirs.

    threads_per_worker: of Mesa's software renderer; the variable LP_NUM_THREADS takes precedence.

    Raises RenderError where the memory cannot be had. `Pool.is_ready` and `Pool.draw` raise what a worker failed with,
    and RenderError where a frame could not be drawn in spite of several attempts.
    """
    environment = {"LP_NUM_THREADS": str(threads_per_worker)} | os.environ
    with ExitStack() as stack:
        child_processes = stack.enter_context(ChildProcesses())
        descriptor = share_stage(stage)
        stack.callback(os.close, descriptor)
        del stage
        start_worker = partial(WorkerProcess, child_processes, PROGRAM, descriptor, environment)
        pool = Pool(map_stage(descriptor), start_worker, num_workers)
        stack.callback(pool.close)
        yield pool


class Pool:
    """Worker processes; made by `open_pool`. For one thread; one call of `draw` at a time.

    stage: what is drawn, in shared memory.
    """

    def __init__(self, stage: Stage, start_worker: Callable[[], WorkerProcess], num_workers: int) -> None:
        self.stage, self._start_worker, self._num_workers = stage, start_worker, num_workers
        self._lock, self._is_closed = threading.Lock(), False
        self._workers: list[WorkerProcess] = []
        self._idle: SimpleQueue[WorkerProcess | None] = SimpleQueue()  # None is to be started
        self._renderer_names: dict[str, None] = {}  # a set that keeps its order
        self._losses: list[tuple[str, bool]] = []  # how workers were lost, and whether with a frame
        self._next_check = time.monotonic() + process.CHECK_INTERVAL_S
        self._threads = ThreadPoolExecutor(num_workers, "hsplat-workers")
        for _ in range(num_workers):
            self._idle.put(None)
        self._starts = [self._threads.submit(self._with_worker, None) for _ in range(num_workers)]

    @property
    def notes(self) -> list[str]:
        """Return what the user should know."""
        return [
            f"{num} of the processes that draw {how} and {'was' if num == 1 else 'were'} replaced"
            + f", and what {'it' if num == 1 else 'they'} had was drawn again" * had_frames
            for (how, had_frames), num in Counter(self._losses).items()
        ]

    @property
    def drivers(self) -> Sequence[str]:
        """Return the devices and drivers of the frames so far, as OpenGL names them: one, unless machines differ."""
        return tuple(self._renderer_names)

    @property
    def is_ready(self) -> bool:
        """Return whether a worker can draw; raises what workers failed to start with."""
        return [start.result() for start in self._starts if start.done()] != []

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """Yield these frames, in this order; may be closed before its end."""
        return draw_ahead(numbers, self._with_worker, self._threads, self._check_workers, process.CHECK_INTERVAL_S)

    def close(self) -> None:
        """End all workers, whatever they do."""
        with self._lock:
            self._is_closed = True
        for worker in self._workers:
            worker.kill()
        self._threads.shutdown(cancel_futures=True)
        for worker in self._workers:
            worker.close()

    def _with_worker(self, number: int | None) -> Any:
        """Let an idle worker draw a frame, or start one for None; where workers are lost, let others do it."""
        worker = self._idle.get()
        try:
            for num_lost in itertools.count(1):
                worker = worker or self._start()
                try:
                    self._renderer_names[worker.wait_until_ready()] = None
                    return None if number is None else worker.draw(number)
                except WorkerLostError as lost:
                    had_frame = worker.renderer_name is not None
                    self._remove(worker, lost.how, had_frame)
                    worker, error = None, lost.error
                    if not (had_frame or lost.may_be_chance):
                        raise error from lost
                    if num_lost == MAX_LOSSES:
                        break
        except HsplatError:  # its last message
            worker = None
            raise
        finally:
            self._idle.put(worker)
        if had_frame:
            error.what += f", {MAX_LOSSES} times at the same frame"
            error.where = ", ".join(filter(None, (error.where, f"frame {number}")))
        raise error

    def _start(self) -> WorkerProcess:
        with self._lock:
            if self._is_closed:
                raise CancelledError
            self._workers.append(self._start_worker())
            return self._workers[-1]

    def _remove(self, worker: WorkerProcess, how: str, had_frame: bool) -> None:
        with self._lock:
            if self._is_closed:
                raise CancelledError
            self._workers.remove(worker)
            self._losses.append((how, had_frame))

    def _check_workers(self) -> int:
        """Kill workers that hang, if the next check is due; their threads replace them. Return their number."""
        if time.monotonic() >= self._next_check:
            self._next_check = time.monotonic() + process.CHECK_INTERVAL_S
            for worker in list(self._workers):
                worker.check_progress()
        return self._num_workers
