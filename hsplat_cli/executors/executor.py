"""Opens what draws the frames of a film: this process, or processes that Dask runs, here or on a cluster."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from hsplat_cli.executors.options import ExecutorSpec
from hsplat_cli.terminal import Reporter
from renderer.job import DrawnFrame, Executor, FilmPlan, LocalExecutor, open_local_executor
from renderer.scene import MetricTarget, Scene

if TYPE_CHECKING:
    from distributed import Client

    from hsplat_cli.executors.cluster.cluster_drawing import ClusterDrawing
    from renderer.draw import Rasterizer


@contextlib.contextmanager
def open_executor(spec: ExecutorSpec, reporter: Reporter, scene: Scene) -> Iterator[Executor]:
    """Open what can draw this scene. Processes on this machine start later, when it is known that they are needed.

    Raises RenderError where the scene needs OpenGL and this process has none, and InputError where no scheduler
    answers.
    """
    with contextlib.ExitStack() as stack:
        if spec.address is not None:
            from hsplat_cli.executors.cluster.connection import connect

            client = stack.enter_context(connect(spec.address))
            executor = SchedulerExecutor(client, spec, scene, stack, reporter)
            if isinstance(scene.error.goal, MetricTarget):  # the search runs here: it fails early where it cannot
                _ = executor.rasterizer
            yield executor
            return
        local = stack.enter_context(open_local_executor(scene, spec.share))
        yield local if spec.num_local_processes == 1 else ProcessesExecutor(local, spec, stack, reporter)


class _DaskExecutor:
    """An executor that draws with processes of Dask. brick_memory: not known here."""

    brick_memory = None

    def __init__(self, spec: ExecutorSpec, stack: contextlib.ExitStack, reporter: Reporter) -> None:
        self._spec, self._stack, self._reporter = spec, stack, reporter
        self._drawings: list[ClusterDrawing] = []

    @property
    def notes(self) -> Sequence[str]:
        """Return what the user should know about the drawing so far."""
        return [note for drawing in self._drawings for note in drawing.notes]

    def _draw_on(
        self, client: Client, where: str, plan: FilmPlan, numbers: Sequence[int]
    ) -> Generator[DrawnFrame, None, None]:
        from hsplat_cli.executors.cluster.cluster_drawing import ClusterDrawing

        found = ClusterDrawing(client, where, plan, self._reporter, self._spec.memory)
        with contextlib.closing(found) as drawing:
            self._drawings.append(drawing)
            yield from drawing.draw(numbers)


class SchedulerExecutor(_DaskExecutor):
    """An executor that draws with the workers of a scheduler; what they are is known when they have drawn."""

    device = "that of a cluster's workers"

    def __init__(
        self, client: Client, spec: ExecutorSpec, scene: Scene, stack: contextlib.ExitStack, reporter: Reporter
    ) -> None:
        super().__init__(spec, stack, reporter)
        self._client, self._where, self._scene = client, f"--scheduler {spec.address}", scene

    @cached_property
    def rasterizer(self) -> Rasterizer:
        """Open what draws trial frames in this process."""
        return self._stack.enter_context(open_local_executor(self._scene, self._spec.share)).rasterizer

    def draw(self, plan: FilmPlan, numbers: Sequence[int]) -> Generator[DrawnFrame, None, None]:
        """Yield these frames, in this order; may be closed before its end."""
        assert not plan.is_timing_dependent, "the time of this machine says nothing about others"
        return self._draw_on(self._client, self._where, plan, numbers)


class ProcessesExecutor(_DaskExecutor):
    """An executor that draws with several processes of this machine, which start with the first frame."""

    def __init__(
        self, local: LocalExecutor, spec: ExecutorSpec, stack: contextlib.ExitStack, reporter: Reporter
    ) -> None:
        super().__init__(spec, stack, reporter)
        self._local, self._num = local, spec.num_local_processes
        self.device, self.rasterizer = local.device, local.rasterizer

    @property
    def notes(self) -> Sequence[str]:
        """Return what the user should know about the drawing so far."""
        return [*self._local.notes, *super().notes]

    def draw(self, plan: FilmPlan, numbers: Sequence[int]) -> Generator[DrawnFrame, None, None]:
        """Yield these frames, in this order; may be closed before its end.

        A single frame is drawn by this process. So are frames on a budget of time, one by one, as they were timed.
        """
        num = min(self._num, len(numbers))
        if num <= 1 or plan.is_timing_dependent:
            return self._local.draw(plan, numbers)
        from hsplat_cli.executors.cluster.connection import connect_locally

        client = self._stack.enter_context(connect_locally(num))
        return self._draw_on(client, f"--workers {num}", plan, numbers)
