"""Draws a film on a cluster.

The client gives each frame to one worker, and does not leave it to Dask's scheduler: a worker that cannot draw does not
take frame after frame, and the number of frames under way is bounded. Workers may come and go. Each frame has a thread
that waits for the worker that draws it. A frame whose worker is lost is drawn by another one, until MAX_LOSSES workers
were lost at it.
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
from typing import TYPE_CHECKING, Any, TypeVar

from hsplat_cli.executors.cluster.registry import WorkerRegistry
from hsplat_cli.executors.cluster.worker import SerializedStage, draw_on_worker
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

# Workers are looked for when no frame is finished for this long.
_POLL_INTERVAL_S = 0.5
# A picture that does not come within this time makes the client look whether its worker is still there.
_FETCH_TIMEOUT_S = 2.0
# Threads wait for workers: more than a cluster has workers.
_MAX_THREADS = 1000
MAX_LOSSES = 3
# Frames that are drawn, or finished and wait for one before them, for each worker.
_WINDOW_PER_WORKER = 4
# Neighbours that one worker draws, one after the other, where something moves: they often have the same layers.
_RUN_IN_MOTION = 8


class ClusterDrawing:
    """A drawing of a plan by the workers of a cluster, at the tolerances of its schedule; to be closed.

    where: the option that chose the cluster, for messages. memory: as of ExecutorSpec. `draw` raises RenderError where
    workers are missing or cannot draw.
    """

    def __init__(
        self, client: Client, where: str, plan: FilmPlan, reporter: Reporter, memory: int | None = None
    ) -> None:
        self.plan, self._memory = plan, memory
        self._client, self._registry = client, WorkerRegistry(client, where, reporter)
        self._threads = ThreadPoolExecutor(_MAX_THREADS, "hsplat-cluster")
        self._lock = threading.Lock()
        self._stage_data: Future | None = None
        self._worker_versions: list[dict[str, Any]] = []  # each once
        self._redrawn: list[int] = []

    @property
    def notes(self) -> list[str]:
        """Return what the user should know: versions that drew and differ from those here, and what went wrong."""
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
        """Yield these frames, in this order.

        Raises RenderError, or what a frame failed with, once several workers have failed on it, or were lost at it.
        """
        length, window = (1, _WINDOW_PER_WORKER) if self.plan.stage.maker is None else (_RUN_IN_MOTION, 1)
        runs = [numbers[first : first + length] for first in range(0, len(numbers), length)]
        check = self._registry.update_workers
        with closing(draw_ahead(runs, self._draw_run, self._threads, check, window=window)) as drawing:
            for run in drawing:
                yield from run

    def close(self) -> None:
        """Let the workers free the stage, and the threads end."""
        self._registry.close()
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._stage_data = None

    def _draw_run(self, numbers: Sequence[int]) -> list[DrawnFrame]:
        return [self._draw(number) for number in numbers]

    def _draw(self, number: int) -> DrawnFrame:
        """Draw a frame, in a thread, with one worker after another, until several were lost at it or failed on it."""
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
        """Wait for an idle worker, and for its end of the task. Return no future with a worker that is lost."""
        from distributed import KilledWorker  # one died, once too often by Dask's own settings

        while True:
            with self._registry.idle_worker() as worker:
                try:
                    stage_data = self._send_stage(worker)
                except (KeyError, OSError, TimeoutError):  # the worker is gone
                    self._registry.recheck(worker)
                    continue
                share = MemoryShare(self._memory, self._registry.num_beside(worker) + 1)  # and this process, if there
                future = self._client.submit(draw_on_worker, stage_data, number, share, workers=[worker], pure=False)
                is_done = threading.Event()
                future.add_done_callback(lambda _, is_done=is_done: is_done.set())
                while not is_done.wait(_POLL_INTERVAL_S) and worker in self._registry.usable_workers:
                    pass
                error = future.exception() if future.status == "error" else None
                if not is_done.is_set() or isinstance(error, KilledWorker):
                    self._registry.recheck(worker)
                    return worker, None, None
                # While it is still busy: no other frame may go to it. A lost context may come back.
                if error is not None and not isinstance(error, ContextLostError):
                    self._registry.exclude(worker, str(error))
                return worker, future, error

    def _send_stage(self, worker: str) -> Future:
        """Send the stage to a worker, unless one has it; others get it from each other."""
        with self._lock:
            if self._stage_data is None or self._stage_data.status != "finished":  # lost, with the workers that had it
                stage_data = SerializedStage(serialize_stage(self.plan.stage))
                self._stage_data = self._client.scatter(stage_data, workers=[worker], hash=False)
            return self._stage_data

    def _fetch(self, worker: str, future: Future) -> Any:
        """Return what a worker has drawn; None where it died before that came."""
        seconds = _FETCH_TIMEOUT_S
        while True:
            try:
                return future.result(timeout=seconds)
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
    """Draw a few runs of frames ahead of the one that is waited for, and yield them in order; may be closed early.

    draw: draws a run, in one of the threads. check: returns the number of workers; called before each run, and
    after every interval without one; what it raises ends the film. window: of runs for each worker.
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
