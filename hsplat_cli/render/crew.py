"""Who draws the frames: this process alone, with others beside it, or a cluster."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

from hsplat_cli.cluster.drawer import open_cluster
from hsplat_cli.drawn import Drawn, LocalDrawer
from hsplat_cli.render.goals import Plan
from renderer.drawing import Rasterizer


@dataclass(frozen=True)
class Crew:
    """workers: processes that draw; None for as many as is fastest. scheduler: address of a cluster's, or `local`."""

    workers: int | None = None
    scheduler: str | None = None


def draw_frames(plan: Plan, numbers: Sequence[int], rasterizer: Rasterizer, crew: Crew) -> Generator[Drawn, None, None]:
    """These frames, in this order."""
    if crew.scheduler is None:
        yield from LocalDrawer(plan.stage, rasterizer, plan.guide).draw(numbers)
        return
    with open_cluster(crew.scheduler, num_workers=crew.workers) as cluster, cluster.drawer(plan.stage) as drawer:
        yield from drawer.draw(numbers)
