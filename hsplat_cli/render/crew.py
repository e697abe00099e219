"""Who draws the frames: this process alone, or others beside it."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path

from hsplat_cli.cluster.drawer import open_cluster
from hsplat_cli.cores import num_cores
from hsplat_cli.drawn import Drawn, LocalDrawer
from hsplat_cli.render.goals import Plan
from hsplat_cli.workers.pool import Pool, open_pool
from renderer.drawing import Rasterizer

# Mesa's renderers that draw with the processor's cores, as they name themselves.
_SOFTWARE = ("llvmpipe", "softpipe", "swrast")
# A device is shared by the processes; what they do beside drawing is not.
_MOST_ON_DEVICE = 4
# What a worker takes beside the stage that they share, for the bound by the memory that is free.
_WORKER_BYTES = 400 * 2**20
# Workers take about a second of several cores until they are ready, which must be worth it.
_WORTH_S = 4.0


@dataclass(frozen=True)
class Crew:
    """workers: processes that draw; None for as many as is fastest. scheduler: address of a cluster's, or `local`."""

    workers: int | None = None
    scheduler: str | None = None


def draw_frames(
    plan: Plan, numbers: Sequence[int], rasterizer: Rasterizer, made_by: str, crew: Crew
) -> Generator[Drawn, None, None]:
    """These frames, in this order: by this process, until its workers are ready, if there are to be any.

    made_by: the name of the rasterizer's renderer. Frames on a budget of time are drawn one by one, as they were timed.
    """
    if crew.scheduler is not None:
        with open_cluster(crew.scheduler, num_workers=crew.workers) as cluster, cluster.drawer(plan.stage) as drawer:
            yield from drawer.draw(numbers)
        return
    local = LocalDrawer(plan.stage, rasterizer, plan.guide)
    num_workers = min(crew.workers or _default_workers(made_by), len(numbers))
    if num_workers < 2 or plan.by_clock:
        yield from local.draw(numbers)
        return
    with contextlib.ExitStack() as stack:
        pool: Pool | None = None
        num_drawn, seconds = 0, math.inf if crew.workers else 0.0
        with contextlib.closing(local.draw(numbers)) as frames:
            while pool is None or not pool.is_ready:
                if pool is None and (len(numbers) - num_drawn) * seconds > _WORTH_S:
                    pool = stack.enter_context(open_pool(plan.stage, num_workers, threads_each=1))
                drawn = next(frames, None)
                if drawn is None:
                    return
                num_drawn += 1
                seconds = sum(drawn.record["seconds"].values()) if num_drawn > 1 else seconds
                yield drawn
        yield from pool.draw(numbers[num_drawn:])


def _default_workers(made_by: str) -> int:
    """One for each core where they draw; as many as there is memory for."""
    most = num_cores() if any(name in made_by for name in _SOFTWARE) else min(num_cores(), _MOST_ON_DEVICE)
    return max(1, min(most, int(_free_bytes() / 2 / _WORKER_BYTES)))


def _free_bytes() -> float:
    """Memory that can be had without swapping; infinite where the system does not tell."""
    try:
        text = Path("/proc/meminfo").read_text(encoding="ascii")
        return int(text.partition("MemAvailable:")[2].split()[0]) * 1024
    except (OSError, ValueError, IndexError):
        return math.inf
