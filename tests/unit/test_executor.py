"""Who draws which frames: this process alone, until its workers are ready, if they are worth it and can be had."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

from hsplat_cli.executors import FrameResult, executor
from renderer import cores
from renderer.cores import num_cores
from renderer.errors import RenderError
from renderer.film import Picture
from renderer.study import FilmPlan

STAGE = SimpleNamespace(bricks=None)


def drawn(number: int, by: str, seconds: float) -> FrameResult:
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
            yield drawn(number, "alone", self.seconds)


class Pool:
    """Stands in for workers that are ready when they have been asked so many times, or cannot be started."""

    def __init__(self, num_asked: int = 0, fails: str = "") -> None:
        self.num_asked, self.fails, self.is_called, self.is_closed = num_asked, fails, False, False
        self.drivers, self.notes, self.stage = ("there",), (), "shared"

    def call(self, stage: str) -> Pool:
        assert (stage, self.is_called) == ("in memory", False)
        self.is_called = True
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
            yield drawn(number, "pool", 0.0)

    def close(self) -> None:
        self.is_closed = True


def who(seconds: float, pool: Pool, *, num: int = 10, must: bool = False) -> tuple[str, Sequence[str]]:
    """A letter for each frame, `a` or `p`, and the notes."""
    local, plan = Local(seconds), FilmPlan("in memory")  # type: ignore[arg-type]
    with mock.patch.object(executor, "LocalExecutor", return_value=local):
        growing = executor._GrowingExecutor(plan, local, pool.call, needs_pool=must)  # type: ignore[arg-type]
        frames = list(growing.draw(range(100, 100 + num)))
    assert [frame.number for frame in frames] == list(range(100, 100 + num))
    assert growing.drivers == (("here", "there") if pool.is_called and pool.fails != "start" else ("here",))
    who_drew = "".join(frame.record["by"][0] for frame in frames)
    assert growing.plan.stage == ("shared" if "p" in who_drew else "in memory")
    return who_drew, growing.notes


def test_a_short_film_needs_nobody() -> None:
    pool = Pool()
    assert who(0.1, pool) == ("aaaaaaaaaa", [])
    assert not pool.is_called


def test_a_long_film_is_handed_over_when_workers_are_ready() -> None:
    """Two frames tell how long it is, the first of which counts for nothing."""
    pool = Pool(num_asked=3)
    assert who(1.0, pool) == ("aaaaappppp", [])


def test_workers_that_are_asked_for_are_called_at_once() -> None:
    pool = Pool()
    assert who(0.001, pool, must=True) == ("pppppppppp", [])


def test_workers_that_come_too_late() -> None:
    assert who(1.0, Pool(num_asked=100)) == ("aaaaaaaaaa", [])


@pytest.mark.parametrize("fails", ["start", "ready"])
def test_without_workers_the_film_is_made_all_the_same(fails: str) -> None:
    pool = Pool(fails=fails)
    who_drew, notes = who(1.0, pool)
    assert who_drew == "aaaaaaaaaa"
    what = "no process can be started" if fails == "start" else "no OpenGL"
    assert notes == [f"drawn by one process, because others could not be started: {what}"]
    assert pool.is_closed == (fails == "ready")  # or there is none


@pytest.mark.parametrize("fails", ["start", "ready"])
def test_unless_they_are_asked_for(fails: str) -> None:
    with pytest.raises(RenderError):
        who(1.0, Pool(fails=fails), must=True)


@pytest.mark.parametrize(
    ("gl", "free", "most"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits), GL 4.5", float("inf"), num_cores()),
        ("NVIDIA H100/PCIe/SSE2, GL 4.6", float("inf"), min(num_cores(), 4)),
        ("llvmpipe", 1e9, 1),
        ("llvmpipe", 0, 1),
    ],
)
def test_how_many_workers(gl: str, free: float, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executor, "_free_bytes", lambda: free)
    assert executor._default_num_workers(gl, STAGE) == most  # type: ignore[arg-type]


@pytest.mark.parametrize(("size", "mib"), [(16, 400 + 3), (512, 400 + 3 * 256)])
def test_workers_are_counted_by_what_their_bricks_may_take(
    size: int, mib: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a software renderer atlases are memory of the machine: of a few bricks little, of many all they may take."""
    monkeypatch.setattr(executor, "num_cores", lambda: 100)
    grids = [(max(1, size >> 4 + level),) * 3 for level in range(max(1, size.bit_length() - 4))]
    bricks = SimpleNamespace(
        levels=[SimpleNamespace(visible_bounds=np.empty((*grid, 2, 3), np.float32)) for grid in grids]
    )
    stage = SimpleNamespace(bricks=bricks, scene=SimpleNamespace(shading=None))
    each = mib * 2**20
    for num in (1, 2, 7):
        monkeypatch.setattr(executor, "_free_bytes", lambda num=num: 2 * each * (num + 0.3))
        assert executor._default_num_workers("llvmpipe", stage) == num  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("own", "files", "quota"),
    [
        ("0::/", {}, float("inf")),
        ("0::/", {"cpu.max": "150000 100000"}, 1.5),
        ("0::/a/b", {"a/cpu.max": "max 100000", "a/b/cpu.max": "300000 100000"}, 3.0),
        ("0::/a/b", {"a/cpu.max": "200000 100000", "a/b/cpu.max": "300000 100000"}, 2.0),
        ("0::/a", {"b/cpu.max": "100000 100000", "a/cpu.max": "no numbers"}, float("inf")),
        ("0::/not/here", {"cpu.max": "50000 100000"}, 0.5),
        (None, {"cpu/cpu.cfs_quota_us": "250000", "cpu/cpu.cfs_period_us": "100000"}, 2.5),
        (
            "12:memory:/m\n4:cpu,cpuacct:/job\n0::/",
            {"cpu/job/cpu.cfs_quota_us": "400000", "cpu/job/cpu.cfs_period_us": "100000",
             "cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"},
            4.0,
        ),
        ("no such lines\n\n", {"cpu.max": "100000 0"}, float("inf")),
    ],
)  # fmt: skip
def test_quotas_of_control_groups(own: str | None, files: dict[str, str], quota: float, tmp_path: Path) -> None:
    """The least of a group's own and those it is in, as batch systems and services nest them."""
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    if own is not None:
        (tmp_path / "own").write_text(own)
    assert cores._quota(tmp_path, tmp_path / "own") == quota


def test_cores_within_a_quota(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores.os, "sched_getaffinity", lambda _: range(16))
    for quota, expected in ((float("inf"), 16), (2.5, 3), (0.2, 1), (100.0, 16)):
        monkeypatch.setattr(cores, "_quota", lambda quota=quota: quota)
        assert num_cores() == expected
