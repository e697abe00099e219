"""Who draws the frames: this process alone, with others on this machine, or the workers of a cluster."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from hsplat_cli.cluster.drawer import Cluster, open_cluster
from hsplat_cli.cores import num_cores
from hsplat_cli.crew_options import CrewSpec
from hsplat_cli.drawn import Drawer, Drawn, LocalDrawer
from hsplat_cli.render.goals import Plan
from hsplat_cli.workers.pool import Pool, open_pool
from renderer.errors import RenderError
from renderer.raster_lasting import LastingRasterizer
from renderer.scene import AccuracyGoal, Scene

# Mesa's renderers that draw with the processor's cores, as they name themselves.
_SOFTWARE = ("llvmpipe", "softpipe", "swrast")
# A device is shared by the processes; what they do beside drawing is not.
_MOST_ON_DEVICE = 4
# What a worker takes beside the stage that they share, for the bound by the memory that is free.
_WORKER_BYTES = 400 * 2**20
# Workers take about a second of several cores until they are ready, which must be worth it.
_WORTH_S = 4.0
_ALONE = "drawn by one process, for others could not be started: {}"


@contextlib.contextmanager
def open_crew(spec: CrewSpec, scene: Scene) -> Iterator[Crew]:
    """Those who can draw this scene. Raises what is wrong with the GL here, or with the address of a cluster."""
    with contextlib.ExitStack() as stack:
        cluster = rasterizer = None
        if spec.scheduler is not None:
            cluster = stack.enter_context(open_cluster(spec.scheduler, num_workers=spec.workers))
        if cluster is None or isinstance(scene.error.goal, AccuracyGoal):  # which is looked for here
            rasterizer = stack.enter_context(LastingRasterizer())
        yield Crew(spec, rasterizer, cluster)


class Crew:
    """Made by `open_crew`. rasterizer: of this process, where it draws anything."""

    def __init__(self, spec: CrewSpec, rasterizer: LastingRasterizer | None, cluster: Cluster | None) -> None:
        self._spec, self.rasterizer, self._cluster = spec, rasterizer, cluster

    @property
    def gl(self) -> str:
        """Device and driver, as GL names them; those of a cluster are known when it has drawn."""
        if self._cluster is not None:
            return "that of a cluster's workers"
        assert self.rasterizer is not None
        return self.rasterizer.renderer_name

    @contextlib.contextmanager
    def drawer(self, plan: Plan, num_frames: int) -> Iterator[tuple[Plan, Drawer]]:
        """What draws so many frames, and the plan to go on with: the volume may have moved to shared memory.

        Frames on a budget of time are drawn one by one, as they were timed.
        """
        if self._cluster is not None:
            with self._cluster.drawer(plan.stage) as drawer:
                yield plan, drawer
            return
        assert self.rasterizer is not None
        num_workers = min(self._spec.workers or _default_workers(self.gl), num_frames)
        if num_workers < 2 or plan.by_clock:
            yield plan, _Alone(plan, self.rasterizer)
            return
        with contextlib.ExitStack() as stack:
            try:
                opened = open_pool(plan.stage, 0, threads_each=max(1, num_cores() // num_workers))
                pool = stack.enter_context(opened)
            except RenderError as error:
                if self._spec.workers is not None:
                    raise
                yield plan, _Alone(plan, self.rasterizer, [_ALONE.format(error.what)])
                return
            plan = replace(plan, stage=pool.stage)
            alone = _Alone(plan, self.rasterizer)
            yield plan, _GrowingDrawer(alone, pool, num_workers, must=self._spec.workers is not None)


class _Alone(LocalDrawer):
    """This process draws. notes: besides what there is to be said of OpenGL."""

    def __init__(self, plan: Plan, rasterizer: LastingRasterizer, notes: Sequence[str] = ()) -> None:
        super().__init__(plan.stage, rasterizer, plan.guide)
        self.made_by = [rasterizer.renderer_name]
        self._gl, self._notes = rasterizer, notes

    @property
    def notes(self) -> list[str]:
        """As in Drawer."""
        return [*self._notes, *self._gl.notes]


class _GrowingDrawer:
    """This process draws, until its workers are ready; they are called when there is enough to be done.

    must: the user wants workers: they are called at once, and without them there is no film.
    """

    def __init__(self, alone: Drawer, pool: Pool, num_workers: int, *, must: bool) -> None:
        self._alone, self._pool, self._num_workers, self._must = alone, pool, num_workers, must
        self._is_called, self._notes = False, list[str]()

    @property
    def notes(self) -> list[str]:
        """As in Drawer."""
        return [*self._notes, *self._alone.notes, *self._pool.notes]

    @property
    def made_by(self) -> tuple[str, ...]:
        """As in Drawer."""
        return tuple(dict.fromkeys([*self._alone.made_by, *self._pool.made_by]))

    def draw(self, numbers: Sequence[int]) -> Generator[Drawn, None, None]:
        """As in Drawer."""
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
        yield from self._pool.draw(numbers[num_drawn:])

    def _has_workers(self, seconds_left: float) -> bool:
        """Whether workers can draw; calls them once that is worth it."""
        if self._notes or not (self._is_called or seconds_left > _WORTH_S):
            return False
        try:
            if not self._is_called:
                self._is_called = True
                self._pool.start(self._num_workers)
            return self._pool.is_ready
        except RenderError as error:
            if self._must:
                raise
            self._pool.close()
            self._notes.append(_ALONE.format(error.what))
            return False


def _default_workers(gl: str) -> int:
    """One for each core where they draw; as many as there is memory for."""
    most = num_cores() if any(name in gl for name in _SOFTWARE) else min(num_cores(), _MOST_ON_DEVICE)
    return max(1, int(min(most, _free_bytes() / 2 / _WORKER_BYTES)))


def _free_bytes() -> float:
    """Memory that can be had without swapping; infinite where the system does not tell."""
    try:
        text = Path("/proc/meminfo").read_text(encoding="ascii")
        return int(text.partition("MemAvailable:")[2].split()[0]) * 1024
    except (OSError, ValueError, IndexError):
        return math.inf
