"""Draws a film on a cluster.

The client gives each frame to one worker, by its schedule, and not to Dask's: a worker that cannot draw does not take
frame after frame, and the number of frames under way is bounded. Workers may come and go.
"""

from __future__ import annotations

import queue
from collections.abc import Generator, Sequence
from concurrent.futures import CancelledError
from functools import partial
from typing import TYPE_CHECKING, Any

from hsplat_cli.executors.cluster.registry import WorkerRegistry
from hsplat_cli.executors.cluster.worker import SerializedStage, draw_on_worker
from hsplat_cli.executors.frame_result import FrameResult
from hsplat_cli.executors.schedule import MAX_LOSSES, FrameSchedule, Task
from hsplat_cli.terminal import Reporter
from renderer.errors import ContextLostError, HsplatError, RenderError
from renderer.film import Picture
from renderer.frame import serialized_stage
from renderer.study import FilmPlan
from renderer.versions import package_versions

if TYPE_CHECKING:
    from distributed import Client, Future

# Workers are looked for when no frame is finished for this long.
_POLL_INTERVAL_S = 0.5
# A picture that does not come within this time makes the client look whether its worker is still there.
_FETCH_TIMEOUT_S = 2.0
# The status of a frame's future after it was drawn: Dask has the picture, or had it.
_FINISHED_STATUSES = ("finished", "lost")


class ClusterExecutor:
    """A FrameExecutor that draws a plan, whose goal is resolved, at the tolerances of its schedule; to be closed.

    address: of the scheduler, for messages. `draw` raises RenderError where workers are missing or cannot draw.
    """

    def __init__(self, client: Client, address: str, plan: FilmPlan, reporter: Reporter) -> None:
        self.plan = plan
        self._client, self._registry = client, WorkerRegistry(client, address, reporter)
        self._stage_data: Future | None = None
        self._worker_versions: list[dict[str, Any]] = []  # each once
        self._num_redrawn = 0
        self._schedule = FrameSchedule[str]()
        self._finished: queue.SimpleQueue[tuple[str, Task, Future]] = queue.SimpleQueue()

    @property
    def drivers(self) -> tuple[str, ...]:
        """As in FrameExecutor."""
        return tuple(dict.fromkeys(versions["GL"] for versions in self._worker_versions))

    @property
    def notes(self) -> list[str]:
        """As in FrameExecutor: which versions drew, where they differ from those here, and what went wrong."""
        mixed = []
        for name, here in package_versions().items():
            found = sorted({versions[name] for versions in self._worker_versions} or {here})
            if found != [here]:
                mixed.append(f"{name} {' and '.join(found)}, which is {here} here")
        notes = [f"bytes may differ from frame to frame, drawn by different workers: {'; '.join(mixed)}"] * bool(mixed)
        again = f"{self._num_redrawn} frame{'s were' if self._num_redrawn > 1 else ' was'} drawn again by other workers"
        return [*notes, *self._registry.notes, *[again] * bool(self._num_redrawn)]

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """As in FrameExecutor.

        Raises RenderError, or what a frame failed with, once several workers have failed on it, or were lost at it.
        """
        return self._schedule.draw(numbers, self._assign_tasks, self._receive)

    def close(self) -> None:
        """Let the workers free the stage."""
        self._stage_data = None

    def _assign_tasks(self) -> None:
        """Find out which workers are there, and give them frames."""
        self._registry.update_workers()
        self._take_back_lost()
        workers = sorted(self._registry.usable_workers)
        if not workers:
            return
        if self._stage_data is None or self._stage_data.status != "finished":  # lost, with the workers that had it
            self._stage_data = self._scatter_stage(workers[0])
        while self._stage_data is not None and (assigned := self._schedule.assign(workers)):
            worker, task = assigned
            future = self._client.submit(draw_on_worker, self._stage_data, task.number, workers=[worker], pure=False)
            task.handle = future
            future.add_done_callback(partial(self._on_done, worker, task))

    def _on_done(self, worker: str, task: Task, future: Future) -> None:
        self._finished.put((worker, task, future))

    def _scatter_stage(self, worker: str) -> Future | None:
        """Send the stage to one worker, if it is still there; others get it from it, and from each other."""
        stage_data = SerializedStage(serialized_stage(self.plan.stage))
        try:
            return self._client.scatter(stage_data, workers=[worker], hash=False)
        except (KeyError, OSError, TimeoutError):
            return None

    def _receive(self) -> None:
        """Wait a moment for a frame that its worker has drawn, or failed on."""
        try:
            worker, task, future = self._finished.get(timeout=_POLL_INTERVAL_S)
        except queue.Empty:
            return
        if task.handle is not future:  # the task was taken back
            return
        error = future.exception() if future.status == "error" else None
        if error is not None and not _is_killed_worker(error):
            self._handle_failure(worker, task, error)
            return
        result = None if error is not None else self._fetch(worker, future)
        if result is None:
            self._registry.recheck(worker)
            self._take_back_lost()
            return
        png, record, versions = result
        self._schedule.finish(worker, task, FrameResult(task.number, Picture(png=png), record | {"gl": versions["GL"]}))
        task.handle = None
        if versions not in self._worker_versions:
            self._worker_versions.append(versions)

    def _fetch(self, worker: str, future: Future) -> Any:
        """Return what a worker has drawn; None where it died before that came."""
        seconds = _FETCH_TIMEOUT_S
        while True:
            try:
                return future.result(timeout=seconds)
            except (CancelledError, KeyError):
                return None
            except (TimeoutError, OSError):
                self._registry.update_workers()
                if worker not in self._registry.usable_workers:
                    return None
                seconds *= 2

    def _take_back_lost(self) -> None:
        """Give frames of workers that are gone to others, unless one of them may be why they are gone."""
        for worker in [each for each in self._schedule.tasks if each not in self._registry.usable_workers]:
            tasks = self._schedule.tasks[worker]
            # The others were drawn, or waited, as far as is known. If all were drawn, it is the last.
            at = next((task for task in tasks if task.handle.status not in _FINISHED_STATUSES), [None, *tasks][-1])
            self._num_redrawn += self._schedule.take_back(worker, at)
            if at is not None and len(at.losses) >= MAX_LOSSES:
                raise RenderError(
                    f"a worker was lost, {MAX_LOSSES} times at the same frame",
                    where=f"frame {at.number}",
                    got=f"no longer there: {', '.join(at.losses)}",
                    hint="their logs may say why; Dask ends workers that exceed their memory limit",
                )

    def _handle_failure(self, worker: str, task: Task, error: BaseException) -> None:
        """Find out whether it is the worker or the frame that fails."""
        if not isinstance(error, ContextLostError):  # a context may come back
            self._registry.exclude(worker, str(error))
        self._num_redrawn += self._schedule.take_back(worker, task)
        if len(task.losses) >= MAX_LOSSES or not self._registry.usable_workers:
            if isinstance(error, HsplatError):
                raise error
            got = f"{type(error).__name__}: {error}"
            raise RenderError(f"frame {task.number} cannot be drawn", where=worker, got=got) from error


def _is_killed_worker(error: BaseException) -> bool:
    """Whether Dask says that a task's worker died, once too often by its own settings."""
    from distributed import KilledWorker

    return isinstance(error, KilledWorker)
