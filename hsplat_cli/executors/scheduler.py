"""Opens the executor of a film: this process, or the workers of a Dask scheduler."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from hsplat_cli.executors.drawing_options import ExecutorSpec
from hsplat_cli.terminal import Reporter
from renderer.job import DrawnFrame, Executor, FilmPlan, open_local_executor
from renderer.scene import FilmScene, MetricTarget
from renderer.system import MemoryShare

if TYPE_CHECKING:
    from distributed import Client

    from hsplat_cli.executors.cluster.cluster_drawing import ClusterDrawing
    from renderer.draw import Rasterizer


@contextlib.contextmanager
def open_executor(
    spec: ExecutorSpec, reporter: Reporter, scene: FilmScene, num_processes: int = 1
) -> Iterator[Executor]:
    """Open an executor that can draw this scene.

    num_processes: the number of processes of this machine that draw at once, and share the memory for bricks.
    Raises RenderError where the scene needs OpenGL and this process has none, and InputError where no scheduler
    answers.
    """
    if spec.scheduler is None:
        with open_local_executor(scene, MemoryShare(spec.memory, num_processes)) as local:
            yield local
        return
    from hsplat_cli.executors.cluster.connection import connect

    with contextlib.ExitStack() as stack:
        client = stack.enter_context(connect(spec.scheduler))
        executor = SchedulerExecutor(client, spec, scene, stack, reporter)
        # The search for the tolerance draws in this process. If the scene needs OpenGL and there is none, fail now.
        if isinstance(scene.error.goal, MetricTarget):
            _ = executor.rasterizer
        yield executor


class SchedulerExecutor:
    """Draws frames with the workers of a Dask scheduler.

    device: a placeholder, because the record of each frame has its worker's device. brick_memory: None, because this
    process does not know the memory of the workers' bricks.
    """

    device = "the devices of a cluster's workers"
    brick_memory = None

    def __init__(
        self, client: Client, spec: ExecutorSpec, scene: FilmScene, stack: contextlib.ExitStack, reporter: Reporter
    ) -> None:
        self._client, self._spec, self._scene = client, spec, scene
        self._stack, self._reporter = stack, reporter
        self._drawings: list[ClusterDrawing] = []

    @property
    def notes(self) -> Sequence[str]:
        """Return notes for the user on all drawings so far."""
        return [note for drawing in self._drawings for note in drawing.notes]

    @cached_property
    def rasterizer(self) -> Rasterizer:
        """Return the rasterizer that draws trial frames in this process; it is opened at first use."""
        return self._stack.enter_context(open_local_executor(self._scene, MemoryShare(self._spec.memory))).rasterizer

    def draw(self, plan: FilmPlan, numbers: Sequence[int]) -> Generator[DrawnFrame, None, None]:
        """Yield the frames with these numbers, in this order; the generator may be closed before its end."""
        assert not plan.is_timing_dependent, "frames on a budget of time are drawn by one process"
        from hsplat_cli.executors.cluster.cluster_drawing import ClusterDrawing

        where = f"--scheduler {self._spec.scheduler}"
        found = ClusterDrawing(self._client, where, plan, self._reporter, self._spec.memory)
        with contextlib.closing(found) as drawing:
            self._drawings.append(drawing)
            yield from drawing.draw(numbers)
