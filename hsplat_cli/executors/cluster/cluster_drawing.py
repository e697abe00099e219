"""Draws a film on a cluster.

The client gives each frame to a worker. Dask's scheduler would prefer workers that hold a task's data, and give the
next task at once to a worker that has just failed: one worker would draw everything, or fail at everything. The number
of frames under way is bounded, too. Workers may come and go. A thread for each frame waits for its worker. If the
worker is lost, another one draws the frame, until MAX_LOSSES workers were lost at the same frame.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent import futures
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, TypeVar

from hsplat_cli.executors.cluster.registry import WorkerRegistry
from hsplat_cli.executors.cluster.worker import DrawnPictures, SerializedStage, draw_on_worker
from hsplat_cli.terminal import Reporter
from renderer.errors import ContextLostError, HsplatError, RenderError
from renderer.film import Picture
from renderer.frame import serialize_stage
from renderer.job import DrawnFrame, FilmPlan
from renderer.system import MemoryShare, package_versions

if TYPE_CHECKING:
    from distributed import Client, Future

T = TypeVar("T")
R = TypeVar("R")

# Longest time without a finished frame before the client looks for workers, in seconds.
_POLL_INTERVAL_S = 0.5
# Seconds to fetch a picture before the client looks whether its worker is still there; doubled at each look.
_FETCH_TIMEOUT_S = 2.0
# Largest number of threads that wait for workers: more than the number of workers of a cluster.
_MAX_THREADS = 1000
# Number of workers lost at the same frame at which the film fails.
MAX_LOSSES = 3
# Largest number of frames, for each worker, that are under way, or are finished and wait for an earlier frame.
_WINDOW_PER_WORKER = 4
# Number of consecutive frames that one worker draws if values of the scene move: such frames often share layers.
_RUN_IN_MOTION = 8


class ClusterDrawing:
    """Draws the frames of a film with the workers of a cluster, until it is closed.

    where: the option that chose the cluster, for messages. memory: bytes for the bricks of all processes of a machine;
    None for half of its free memory.

    `draw` raises RenderError where workers are missing or cannot draw.
    """

    def __init__(
        self, client: Client, where: str, plan: FilmPlan, reporter: Reporter, memory: int | None = None
    ) -> None:
        self.plan, self._memory = plan, memory
        self._client, self._registry = client, WorkerRegistry(client, where, reporter)
        self._threads = ThreadPoolExecutor(_MAX_THREADS, "hsplat-cluster")
        self._lock = threading.Lock()
        self._stage_data: Future | None = None
        # The different versions of programs on workers that have drawn.
        self._worker_versions: list[dict[str, str]] = []
        self._redrawn: list[int] = []

    @property
    def notes(self) -> list[str]:
        """Return notes for the user: on workers with other versions than this process, and on frames drawn again."""
        mixed = []
        for name, here in package_versions().items():
            found = sorted({versions[name] for versions in self._worker_versions} or {here})
            if found != [here]:
                mixed.append(f"{name} {' and '.join(found)}, which is {here} here")
        notes = [f"bytes may differ from frame to frame, drawn by different workers: {'; '.join(mixed)}"] * bool(mixed)
        num = len(self._redrawn)
        redrawn = f"{num} frame{'s were' if num > 1 else ' was'} drawn again by other workers"
        return [*notes, *self._registry.notes, *[redrawn] * bool(num)]

    def draw(self, numbers: Sequence[int]) -> Generator[DrawnFrame, None, None]:
        """Yield the frames with these numbers, in this order.

        Raises RenderError, or the error of a frame, once several workers have failed on a frame or were lost at it.
        """
        length, window = (1, _WINDOW_PER_WORKER) if self.plan.stage.maker is None else (_RUN_IN_MOTION, 1)
        runs = [numbers[first : first + length] for first in range(0, len(numbers), length)]
        check = self._registry.update_workers
        with closing(draw_ahead(runs, self._draw_run, self._threads, check, window=window)) as drawing:
            for run in drawing:
                yield from run

    def close(self) -> None:
        """Let the workers free the stage, and end the threads."""
        self._registry.close()
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._stage_data = None

    def _draw_run(self, numbers: Sequence[int]) -> list[DrawnFrame]:
        return [self._draw(number) for number in numbers]

    def _draw(self, number: int) -> DrawnFrame:
        """Draw a frame with one worker after another, until one has drawn it, or several were lost or have failed."""
        losses: list[str] = []
        while True:
            worker, future, error = self._run(number)
            result = self._fetch(worker, future) if future and error is None else None
            if result is not None:
                contents, record, versions = result
                if versions not in self._worker_versions:
                    self._worker_versions.append(versions)
                pictures = {kind: Picture(content=content) for kind, content in contents.items()}
                return DrawnFrame(replace(record, device=versions["device"]), pictures)
            losses.append(worker)
            self._redrawn.append(number)
            if error is None and len(losses) >= MAX_LOSSES:
                raise RenderError(
                    f"a worker was lost, {MAX_LOSSES} times at the same frame",
                    where=f"frame {number}",
                    got=f"no longer there: {', '.join(losses)}",
                    hint="their logs may say why; workers that need too much memory are ended",
                )
            if error is not None and (len(losses) >= MAX_LOSSES or not self._registry.usable_workers):
                if isinstance(error, HsplatError):
                    raise error
                got = f"{type(error).__name__}: {error}"
                raise RenderError(f"frame {number} cannot be drawn", where=worker, got=got) from error

    def _run(self, number: int) -> tuple[str, Future | None, BaseException | None]:
        """Let an idle worker draw a frame; return worker, future and error, without a future if the worker is lost."""
        from distributed import KilledWorker  # raised where a worker died more often than Dask's settings allow

        while True:
            with self._registry.idle_worker() as worker:
                try:
                    stage_data = self._send_stage(worker)
                except (KeyError, OSError, TimeoutError):  # the worker is gone
                    self._registry.recheck(worker)
                    continue
                # One share more than workers: this process may need memory, too.
                share = MemoryShare(self._memory, self._registry.num_beside(worker) + 1)
                future = self._client.submit(draw_on_worker, stage_data, number, share, workers=[worker], pure=False)
                is_done = threading.Event()
                future.add_done_callback(lambda _, is_done=is_done: is_done.set())
                while not is_done.wait(_POLL_INTERVAL_S) and worker in self._registry.usable_workers:
                    pass
                error = future.exception() if future.status == "error" else None
                if not is_done.is_set() or isinstance(error, KilledWorker):
                    self._registry.recheck(worker)
                    return worker, None, None
                # The worker is excluded while it is still busy, so that no other frame goes to it. A worker that lost
                # its OpenGL context may draw again.
                if error is not None and not isinstance(error, ContextLostError):
                    self._registry.exclude(worker, str(error))
                return worker, future, error

    def _send_stage(self, worker: str) -> Future:
        """Send the stage to a worker, unless some worker has it: workers pass it on to each other."""
        with self._lock:
            if self._stage_data is None or self._stage_data.status != "finished":  # every worker with the stage is lost
                stage_data = SerializedStage(serialize_stage(self.plan.stage))
                self._stage_data = self._client.scatter(stage_data, workers=[worker], hash=False)
            return self._stage_data

    def _fetch(self, worker: str, future: Future) -> DrawnPictures | None:
        """Fetch the pictures of a frame from its worker; None where the worker died before the pictures came."""
        seconds = _FETCH_TIMEOUT_S
        while True:
            try:
                found: DrawnPictures = future.result(timeout=seconds)
                return found
            except (CancelledError, KeyError):
                self._registry.recheck(worker)
                return None
            except (TimeoutError, OSError):
                if worker not in self._registry.usable_workers:
                    return None
                seconds *= 2


def draw_ahead(
    runs: Sequence[T], draw: Callable[[T], R], threads: ThreadPoolExecutor, check: Callable[[], int], *, window: int
) -> Generator[R, None, None]:
    """Draw runs of frames ahead in threads, and yield the results in order; the generator may be closed early.

    runs: runs of consecutive frames. draw: a function that draws a run. check: a function that returns the number of
    workers; it is called before each run and after every interval without a finished run, and its errors end the film.
    window: the number of runs that are under way for each worker.
    """
    waiting, drawing = iter(runs), deque[futures.Future[R]]()
    try:
        while True:
            num = window * max(1, check()) - len(drawing)
            drawing.extend(threads.submit(draw, run) for run in islice(waiting, max(0, num)))
            if not drawing:
                return
            futures.wait([drawing[0]], _POLL_INTERVAL_S)
            if drawing[0].done():
                yield drawing.popleft().result()
    finally:
        for future in drawing:
            future.cancel()
