"""This process draws, unless several are requested and there are frames for them."""

from __future__ import annotations

from contextlib import ExitStack, nullcontext
from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest

from hsplat_cli.executors import ExecutorSpec, executor
from hsplat_cli.executors.cluster import cluster_drawing, connection
from hsplat_cli.terminal import Reporter
from renderer.system import MemoryShare, num_cores


def test_processes_share_the_memory() -> None:
    """Several draw, and this process draws trial frames."""
    assert ExecutorSpec(memory=12).share == MemoryShare(12, 1)
    assert ExecutorSpec(3, memory=12).share == MemoryShare(12, 4)
    assert MemoryShare(12, 4).num_bytes() == 3


@pytest.mark.parametrize(
    ("spec", "num_processes", "address"),
    [
        (ExecutorSpec(), 1, None),
        (ExecutorSpec(workers=1), 1, None),
        (ExecutorSpec(workers=3), 3, None),
        (ExecutorSpec(scheduler="local"), num_cores(), None),
        (ExecutorSpec(workers=3, scheduler="local"), 3, None),
        (ExecutorSpec(scheduler="tcp://node7:8786"), 1, "tcp://node7:8786"),
    ],
)
def test_processes_of_this_machine(spec: ExecutorSpec, num_processes: int, address: str | None) -> None:
    assert (spec.num_local_processes, spec.address) == (num_processes, address)


@pytest.mark.parametrize(
    ("workers", "num_frames", "is_timed", "num_started"),
    [(3, 9, False, 3), (3, 2, False, 2), (3, 1, False, None), (3, 0, False, None), (3, 9, True, None)],
)
def test_no_more_processes_than_frames(workers: int, num_frames: int, is_timed: bool, num_started: int | None) -> None:
    """Frames on a budget of time, too, are drawn by this process."""
    started: list[int] = []

    def start(num: int) -> nullcontext[str]:
        started.append(num)
        return nullcontext("client")

    plan: Any = SimpleNamespace(is_timing_dependent=is_timed)
    local: Any = SimpleNamespace(
        draw=lambda _plan, numbers: (f"here {number}" for number in numbers), notes=(), device="", rasterizer=None
    )
    drawing = SimpleNamespace(
        draw=lambda numbers: (f"there {number}" for number in numbers), notes=["a note"], close=int
    )
    with (
        ExitStack() as stack,
        mock.patch.object(connection, "connect_locally", start),
        mock.patch.object(cluster_drawing, "ClusterDrawing", return_value=drawing),
    ):
        several = executor.ProcessesExecutor(local, ExecutorSpec(workers), stack, Reporter())
        place = "here" if num_started is None else "there"
        assert list(several.draw(plan, range(num_frames))) == [f"{place} {number}" for number in range(num_frames)]
        assert several.notes == ([] if num_started is None else ["a note"])
    assert started == ([] if num_started is None else [num_started])
