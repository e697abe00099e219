"""Opens what draws the frames of a film: this process alone, with workers on this machine, or a cluster."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

from hsplat_cli.executors.cluster.cluster_executor import ClusterExecutor
from hsplat_cli.executors.cluster.connection import connect
from hsplat_cli.executors.frame_result import FrameResult, draw_locally
from hsplat_cli.executors.options import ExecutorSpec
from hsplat_cli.executors.workers.pool import Pool, open_pool
from hsplat_cli.terminal import Reporter
from renderer.draw import RecoveringRasterizer, is_software, max_brick_bytes, open_rasterizer
from renderer.errors import RenderError
from renderer.frame import Stage
from renderer.scene import MetricTarget, Scene
from renderer.study import FilmPlan
from renderer.system import free_bytes, num_cores

if TYPE_CHECKING:
    from distributed import Client

# Processes share a device, but not the work beside drawing.
_MAX_WORKERS_PER_DEVICE = 4
# The memory of a worker besides bricks and the shared stage; free memory bounds the number of workers.
_WORKER_BYTES = 400 * 2**20
# Workers take about a second of several cores until they are ready, which must be worth it.
_MIN_REMAINING_S = 4.0
_SINGLE_PROCESS_NOTE = "drawn by one process, because others could not be started: {}"


@contextlib.contextmanager
def open_executor(spec: ExecutorSpec, scene: Scene, reporter: Reporter) -> Iterator[Executor]:
    """Open what can draw this scene.

    Raises RenderError where the scene needs OpenGL and this process has none, and InputError where no scheduler
    answers.
    """
    with contextlib.ExitStack() as stack:
        client = rasterizer = None
        if spec.scheduler is not None:
            client = stack.enter_context(connect(spec.scheduler, spec.workers))
        if client is None or isinstance(scene.error.goal, MetricTarget):  # the search runs here
            make = partial(open_rasterizer, needs_opengl=scene.needs_opengl)
            rasterizer = stack.enter_context(RecoveringRasterizer(make))
        yield Executor(spec, rasterizer, client, reporter)


@dataclass(frozen=True)
class Executor:
    """Draws films; made by `open_executor`. rasterizer: of this process, where it draws anything."""

    _spec: ExecutorSpec
    rasterizer: RecoveringRasterizer | None
    _client: Client | None
    _reporter: Reporter

    @property
    def renderer_name(self) -> str:
        """Return device and driver, as OpenGL names them; those of a cluster are known when it has drawn."""
        if self._client is not None:
            return "that of a cluster's workers"
        assert self.rasterizer is not None
        return self.rasterizer.renderer_name

    @contextlib.contextmanager
    def for_plan(self, plan: FilmPlan, num_frames: int) -> Iterator[FrameExecutor]:
        """Open what draws this number of frames of a plan.

        The caller drops the plan and goes on with that of the executor: its volume may move to shared memory. Frames on
        a budget of time are drawn one by one, as they were timed.
        """
        if self._client is not None:
            assert self._spec.scheduler is not None
            cluster = ClusterExecutor(self._client, self._spec.scheduler, plan, self._reporter)
            with contextlib.closing(cluster):
                yield cluster
            return
        assert self.rasterizer is not None
        most = self._spec.workers or _default_num_workers(self.renderer_name, plan.stage)
        num_workers = 1 if plan.is_timing_dependent else max(1, min(most, num_frames))
        with contextlib.ExitStack() as stack:

            def start_pool(stage: Stage) -> Pool:
                threads_per_worker = max(1, num_cores() // num_workers)
                return stack.enter_context(open_pool(stage, num_workers, threads_per_worker=threads_per_worker))

            start = start_pool if num_workers > 1 else None
            executor = _GrowingExecutor(plan, self.rasterizer, start, needs_pool=self._spec.workers is not None)
            del plan
            yield executor


class _GrowingExecutor:
    """Draws in this process, until its workers are ready; they are started when enough is left to draw.

    plan: how frames get their tolerances. Its stage moves to shared memory with the workers.
    start_pool: starts them, and moves the stage to memory that they share; None for no workers. needs_pool: the user
    wants workers: they are started at once, and a failure to start is an error.
    """

    def __init__(
        self,
        plan: FilmPlan,
        rasterizer: RecoveringRasterizer,
        start_pool: Callable[[Stage], Pool] | None,
        *,
        needs_pool: bool,
    ) -> None:
        self.plan, self._rasterizer, self._start_pool, self._needs_pool = plan, rasterizer, start_pool, needs_pool
        self._pool: Pool | None = None
        self._failure_notes = list[str]()

    @property
    def drivers(self) -> tuple[str, ...]:
        """Return the devices and drivers of the frames so far, as OpenGL names them: one, unless machines differ."""
        return tuple(dict.fromkeys([self._rasterizer.renderer_name, *(self._pool.drivers if self._pool else ())]))

    @property
    def notes(self) -> list[str]:
        """Return what the user should know."""
        return [*self._failure_notes, *self._rasterizer.notes, *(self._pool.notes if self._pool else ())]

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """Yield these frames, in this order; may be closed before its end."""
        num_drawn, seconds = 0, math.inf if self._needs_pool else 0.0
        local = draw_locally(self.plan.stage, numbers, self._rasterizer, self.plan.controller)
        with contextlib.closing(local) as frames:
            del local
            while not self._has_workers((len(numbers) - num_drawn) * seconds):
                result = next(frames, None)
                if result is None:
                    return
                num_drawn += 1
                if num_drawn > 1:  # the first one compiles shaders
                    seconds = sum(result.record["seconds"].values())
                yield result
        del frames  # and the stage with it
        assert self._pool is not None
        self.plan = replace(self.plan, stage=self._pool.stage)
        self._rasterizer.evict_bricks()
        yield from self._pool.draw(numbers[num_drawn:])

    def _has_workers(self, seconds_left: float) -> bool:
        """Return whether workers can draw; start them once that is worth it."""
        if self._start_pool is None or not (self._pool or seconds_left > _MIN_REMAINING_S):
            return False
        try:
            if self._pool is None:
                self._pool = self._start_pool(self.plan.stage)
            return self._pool.is_ready
        except RenderError as error:
            if self._needs_pool:
                raise
            if self._pool is not None:
                self._pool.close()
            self._start_pool = None
            self._failure_notes.append(_SINGLE_PROCESS_NOTE.format(error.what))
            return False


# Both have `plan`, `drivers`, `notes` and `draw`.
FrameExecutor: TypeAlias = ClusterExecutor | _GrowingExecutor


def _default_num_workers(renderer_name: str, stage: Stage) -> int:
    """Return one for each core where cores draw, and at most as many as there is memory for."""
    most = num_cores() if is_software(renderer_name) else min(num_cores(), _MAX_WORKERS_PER_DEVICE)
    each = _WORKER_BYTES + (max_brick_bytes(stage.bricks, lit=stage.scene.shading is not None) if stage.bricks else 0)
    return max(1, int(min(most, free_bytes() / 2 / each)))
