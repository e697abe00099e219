"""Who draws the frames: this process alone, with others on this machine, or the workers of a cluster."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from hsplat_cli.executors.cluster.cluster_executor import Cluster, open_cluster
from hsplat_cli.executors.frame_result import FrameExecutor, FrameResult, LocalExecutor
from hsplat_cli.executors.options import ExecutorSpec
from hsplat_cli.executors.rasterizers import open_recovering_rasterizer
from hsplat_cli.executors.workers.pool import Pool, open_pool
from hsplat_cli.terminal import Reporter
from renderer.cores import num_cores
from renderer.draw import RecoveringRasterizer, is_software, most_bytes
from renderer.errors import RenderError
from renderer.frame import Stage
from renderer.scene import AccuracyGoal, Scene
from renderer.study import FilmPlan

# A device is shared by the processes; what they do beside drawing is not.
_MAX_WORKERS_PER_DEVICE = 4
# What a worker takes beside the stage that they share, and bricks, for the bound by the memory that is free.
_WORKER_BYTES = 400 * 2**20
# Workers take about a second of several cores until they are ready, which must be worth it.
_MIN_REMAINING_S = 4.0
_SINGLE_PROCESS_NOTE = "drawn by one process, for others could not be started: {}"


@contextlib.contextmanager
def open_executor(spec: ExecutorSpec, scene: Scene, reporter: Reporter) -> Iterator[Executor]:
    """Those who can draw this scene.

    Raises what is wrong with the GL here, where the scene needs it, or with the address of a cluster.
    """
    with contextlib.ExitStack() as stack:
        cluster = rasterizer = None
        if spec.scheduler is not None:
            cluster = stack.enter_context(open_cluster(spec.scheduler, reporter, num_workers=spec.workers))
        if cluster is None or isinstance(scene.error.goal, AccuracyGoal):  # which is looked for here
            rasterizer = stack.enter_context(open_recovering_rasterizer(needs_opengl=scene.needs_opengl))
        yield Executor(spec, rasterizer, cluster)


class Executor:
    """Made by `open_executor`. rasterizer: of this process, where it draws anything."""

    def __init__(self, spec: ExecutorSpec, rasterizer: RecoveringRasterizer | None, cluster: Cluster | None) -> None:
        self._spec, self.rasterizer, self._cluster = spec, rasterizer, cluster

    @property
    def renderer_name(self) -> str:
        """Device and driver, as GL names them; those of a cluster are known when it has drawn."""
        if self._cluster is not None:
            return "that of a cluster's workers"
        assert self.rasterizer is not None
        return self.rasterizer.renderer_name

    @contextlib.contextmanager
    def for_plan(self, plan: FilmPlan, num_frames: int) -> Iterator[FilmExecutor]:
        """What draws so many frames of a plan, which the caller lets go of: its volume may move to shared memory.

        Frames on a budget of time are drawn one by one, as they were timed.
        """
        if self._cluster is not None:
            with self._cluster.for_stage(plan.stage) as drawer:
                yield _RemoteExecutor(plan, drawer)
            return
        assert self.rasterizer is not None
        most = self._spec.workers or _default_num_workers(self.renderer_name, plan.stage)
        num_workers = max(1, min(most, num_frames))
        threads_per_worker = max(1, num_cores() // num_workers)
        alone, is_timing_dependent = _SingleProcessExecutor(plan, self.rasterizer), plan.is_timing_dependent
        del plan
        if num_workers < 2 or is_timing_dependent:
            yield alone
            return
        with contextlib.ExitStack() as stack:

            def call(stage: Stage) -> Pool:
                return stack.enter_context(open_pool(stage, num_workers, threads_per_worker=threads_per_worker))

            yield _GrowingExecutor(alone, call, must=self._spec.workers is not None)


class FilmExecutor(FrameExecutor, Protocol):
    """plan: by which it draws; another one, with the same pictures, where the volume has moved."""

    @property
    def plan(self) -> FilmPlan: ...


class _RemoteExecutor:
    """Others draw, on a cluster."""

    def __init__(self, plan: FilmPlan, drawer: FrameExecutor) -> None:
        self.plan, self._executor = plan, drawer

    @property
    def drivers(self) -> Sequence[str]:
        """As in FrameExecutor."""
        return self._executor.drivers

    @property
    def notes(self) -> Sequence[str]:
        """As in FrameExecutor."""
        return self._executor.notes

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """As in FrameExecutor."""
        return self._executor.draw(numbers)


class _SingleProcessExecutor:
    """This process draws."""

    def __init__(self, plan: FilmPlan, rasterizer: RecoveringRasterizer) -> None:
        self.drivers, self._rasterizer = [rasterizer.renderer_name], rasterizer
        self._set_plan(plan)

    def _set_plan(self, plan: FilmPlan) -> None:
        self.plan, self._executor = plan, LocalExecutor(plan.stage, self._rasterizer, plan.controller)

    @property
    def notes(self) -> Sequence[str]:
        """As in FrameExecutor."""
        return self._rasterizer.notes

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """As in FrameExecutor."""
        return self._executor.draw(numbers)

    def switch_stage(self, stage: Stage) -> None:
        """Go on with the same stage at another place; this process draws it no more, and keeps nothing to draw with."""
        self._set_plan(replace(self.plan, stage=stage))
        self._rasterizer.forget()


class _GrowingExecutor:
    """This process draws, until its workers are ready; they are called when there is enough to be done.

    call: starts them, and moves the stage to memory that they share. must: the user wants workers: they are called at
    once, and without them there is no film.
    """

    def __init__(self, alone: _SingleProcessExecutor, call: Callable[[Stage], Pool], *, must: bool) -> None:
        self._alone, self._call, self._must = alone, call, must
        self._pool: Pool | None = None
        self._notes = list[str]()

    @property
    def plan(self) -> FilmPlan:
        """As in FilmExecutor."""
        return self._alone.plan

    @property
    def notes(self) -> list[str]:
        """As in FrameExecutor."""
        return [*self._notes, *self._alone.notes, *(self._pool.notes if self._pool else ())]

    @property
    def drivers(self) -> tuple[str, ...]:
        """As in FrameExecutor."""
        return tuple(dict.fromkeys([*self._alone.drivers, *(self._pool.drivers if self._pool else ())]))

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """As in FrameExecutor."""
        num_drawn, seconds = 0, math.inf if self._must else 0.0
        with contextlib.closing(self._alone.draw(numbers)) as frames:
            while not self._has_workers((len(numbers) - num_drawn) * seconds):
                drawn = next(frames, None)
                if drawn is None:
                    return
                num_drawn += 1
                if num_drawn > 1:  # the first one compiles shaders
                    seconds = sum(drawn.record["seconds"].values())
                yield drawn
        del frames  # and the stage with it
        assert self._pool is not None
        self._alone.switch_stage(self._pool.stage)
        yield from self._pool.draw(numbers[num_drawn:])

    def _has_workers(self, seconds_left: float) -> bool:
        """Whether workers can draw; calls them once that is worth it."""
        if self._notes or not (self._pool or seconds_left > _MIN_REMAINING_S):
            return False
        try:
            if self._pool is None:
                self._pool = self._call(self._alone.plan.stage)
            return self._pool.is_ready
        except RenderError as error:
            if self._must:
                raise
            if self._pool is not None:
                self._pool.close()
            self._notes.append(_SINGLE_PROCESS_NOTE.format(error.what))
            return False


def _default_num_workers(gl: str, stage: Stage) -> int:
    """One for each core where they draw; as many as there is memory for."""
    most = num_cores() if is_software(gl) else min(num_cores(), _MAX_WORKERS_PER_DEVICE)
    each = _WORKER_BYTES + (most_bytes(stage.bricks, lit=stage.scene.shading is not None) if stage.bricks else 0)
    return max(1, int(min(most, _free_bytes() / 2 / each)))


def _free_bytes() -> float:
    """Memory that can be had without swapping; infinite where the system does not tell."""
    try:
        text = Path("/proc/meminfo").read_text(encoding="ascii")
        return int(text.partition("MemAvailable:")[2].split()[0]) * 1024
    except (OSError, ValueError, IndexError):
        return math.inf
