"""This process draws alone until its workers are ready, if they are worth it and can be started."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

from hsplat_cli.executors import FrameResult, executor
from renderer.errors import RenderError
from renderer.film import Picture
from renderer.study import FilmPlan
from renderer.system import num_cores


def result_of(number: int, by: str, seconds: float) -> FrameResult:
    return FrameResult(number, Picture(np.zeros((1, 1, 3), np.uint8)), {"by": by, "seconds": {"draw": seconds}})


class Local:
    """Stands in for this process. seconds: of a frame."""

    renderer_name, notes = "here", ()

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds

    def evict_bricks(self) -> None:
        pass

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        for number in numbers:
            yield result_of(number, "alone", self.seconds)


class Pool:
    """Stands in for workers that are ready after this number of questions, or that cannot be started."""

    def __init__(self, num_asked: int = 0, fails: str = "") -> None:
        self.num_asked, self.fails, self.is_started, self.is_closed = num_asked, fails, False, False
        self.drivers, self.notes, self.stage = ("there",), (), "shared"

    def start(self, stage: str) -> Pool:
        assert (stage, self.is_started) == ("in memory", False)
        self.is_started = True
        if self.fails == "start":
            raise RenderError("no process can be started")
        return self

    @property
    def is_ready(self) -> bool:
        if self.fails == "ready":
            raise RenderError("no OpenGL")
        self.num_asked -= 1
        return self.num_asked < 0

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        for number in numbers:
            yield result_of(number, "pool", 0.0)

    def close(self) -> None:
        self.is_closed = True


def draw(seconds: float, pool: Pool, *, needs_pool: bool = False) -> tuple[str, Sequence[str]]:
    """Return a letter for each of ten frames, `a` for alone or `p` for the pool, and the notes."""
    local, plan, numbers = Local(seconds), FilmPlan("in memory"), range(100, 110)  # type: ignore[arg-type]
    with mock.patch.object(executor, "draw_locally", lambda _, frames, *__: local.draw(frames)):
        growing = executor._GrowingExecutor(plan, local, pool.start, needs_pool=needs_pool)  # type: ignore[arg-type]
        results = list(growing.draw(numbers))
    assert [result.number for result in results] == list(numbers)
    assert growing.drivers == (("here", "there") if pool.is_started and pool.fails != "start" else ("here",))
    letters = "".join(result.record["by"][0] for result in results)
    assert growing.plan.stage == ("shared" if "p" in letters else "in memory")
    return letters, growing.notes


@pytest.mark.parametrize(
    ("seconds", "num_asked", "needs_pool", "letters", "is_started"),
    [
        (0.1, 0, False, "aaaaaaaaaa", False),  # a short film
        (1.0, 3, False, "aaaaappppp", True),  # two frames show that it is long, of which the first does not count
        (0.001, 0, True, "pppppppppp", True),
        (1.0, 100, False, "aaaaaaaaaa", True),  # workers that are ready too late
    ],
)
def test_workers_draw_what_is_worth_it(
    seconds: float, num_asked: int, needs_pool: bool, letters: str, is_started: bool
) -> None:
    pool = Pool(num_asked)
    assert draw(seconds, pool, needs_pool=needs_pool) == (letters, [])
    assert pool.is_started == is_started


@pytest.mark.parametrize(("fails", "what"), [("start", "no process can be started"), ("ready", "no OpenGL")])
def test_without_workers_this_process_draws_unless_they_are_required(fails: str, what: str) -> None:
    pool = Pool(fails=fails)
    notes = [f"drawn by one process, because others could not be started: {what}"]
    assert draw(1.0, pool) == ("aaaaaaaaaa", notes)
    assert pool.is_closed == (fails == "ready")  # or there is none
    with pytest.raises(RenderError):
        draw(1.0, Pool(fails=fails), needs_pool=True)


@pytest.mark.parametrize(
    ("name", "free", "size", "most"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits), GL 4.5", math.inf, 16, num_cores()),
        ("NVIDIA H100/PCIe/SSE2, GL 4.6", math.inf, 16, min(num_cores(), 4)),
        ("llvmpipe", 0, 16, 1),
        # A software renderer has the bricks of each worker in memory: 3 MiB for a few of them, at most 768.
        ("llvmpipe", 2 * 1.3 * (400 + 3) * 2**20, 16, 1),
        ("llvmpipe", 2 * 1.9 * (400 + 3 * 256) * 2**20, 512, 1),
        ("llvmpipe", 2 * 2.1 * (400 + 3 * 256) * 2**20, 512, min(num_cores(), 2)),
    ],
)
def test_the_number_of_workers_fits_cores_and_memory(
    name: str, free: float, size: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executor, "free_bytes", lambda: free)
    grids = [(max(1, size >> 4 + level),) * 3 for level in range(max(1, size.bit_length() - 4))]
    levels = [SimpleNamespace(visible_bounds=np.empty((*grid, 2, 3), np.float32)) for grid in grids]
    stage = SimpleNamespace(bricks=SimpleNamespace(levels=levels), scene=SimpleNamespace(shading=None))
    assert executor._default_num_workers(name, stage) == most  # type: ignore[arg-type]
