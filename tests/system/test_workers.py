"""Several processes draw the same frames as one, whatever happens to them, and leave nothing behind."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import weakref
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from unittest import mock

import pytest
from faulty_worker import DRAW_FAULTS, FRAME, GL_FAULTS, LONG_S, START_FAULTS
from film_stages import PLAIN, stage_of, waves
from processes import MARK, holders_of_shared_memory, marked, new_mark, wait_until

from hsplat_cli.executors import ExecutorSpec, draw_locally
from hsplat_cli.executors.executor import Executor
from hsplat_cli.executors.workers import pool as pool_module, process
from hsplat_cli.executors.workers.pool import Pool, open_pool
from hsplat_cli.terminal import Reporter
from renderer.draw import GLRasterizer, RecoveringRasterizer
from renderer.errors import ContextLostError, HsplatError, InputError, RenderError
from renderer.frame import Stage
from renderer.study import FilmPlan

NUMBERS = [0, 1, 2, 3, 4, 5, 6, 7, 2, 1]  # some twice, and backwards

# How long a killed process may take to end.
SOON_S = 1.0

# What a hang takes in these tests.
HANG_S = 1.0


@pytest.fixture(scope="module")
def stage() -> Stage:
    return stage_of(PLAIN)


@pytest.fixture(scope="module")
def expected(stage: Stage, rasterizer: GLRasterizer) -> list[bytes]:
    return [result.picture.png for result in draw_locally(stage, NUMBERS, rasterizer)]


@pytest.fixture(autouse=True)
def mark(monkeypatch: pytest.MonkeyPatch) -> str:
    """Mark all children of the test."""
    name = new_mark()
    monkeypatch.setenv(MARK, name)
    return name


@pytest.fixture(autouse=True)
def _nothing_is_left(mark: str) -> Iterator[None]:
    """Require after every test that no process is left, and no memory that another process maps."""
    yield
    assert marked(mark) == set()
    assert all(holders == {str(os.getpid())} for holders in own_memory().values())


def own_memory() -> dict[int, set[str]]:
    return {inode: by for inode, by in holders_of_shared_memory().items() if str(os.getpid()) in by}


@contextmanager
def faulty_pool(stage: Stage, num_workers: int, name: str, folder: Path) -> Iterator[Pool]:
    assert name in [*DRAW_FAULTS, *START_FAULTS, *GL_FAULTS]
    checks = {"CHECK_INTERVAL_S": HANG_S / 20, "MAX_IDLE_CHECKS": 20} if "stop" in name or "long" in name else {}
    with (
        mock.patch.multiple(process, **checks) if checks else nullcontext(),
        mock.patch.object(pool_module, "PROGRAM", ("faulty_worker", name, str(folder))),
        open_pool(stage, num_workers, threads_per_worker=1) as pool,
    ):
        yield pool


def draw_all(pool: Pool) -> list[bytes]:
    return [result.picture.png for result in pool.draw(NUMBERS)]


ONE, AGAIN = "1 of the processes that draw", ", and what it had was drawn again"


@pytest.mark.parametrize(
    ("fault", "notes"),
    [
        ("talk_and_kill_once", [f"{ONE} died and was replaced{AGAIN}"]),
        ("hang_up_once", [f"{ONE} died and was replaced{AGAIN}"]),
        ("gl_error_once", [f"{ONE} lost OpenGL's context and was replaced{AGAIN}"]),
        ("die_at_first_start", [f"{ONE} died and was replaced"]),
        ("stop_half_way_once", [f"{ONE} hung (no processor time for 1 s) and was replaced{AGAIN}"]),
        ("stop_at_first_start", [f"{ONE} hung (no processor time for 1 s) and was replaced"]),
        ("take_long_once", []),
    ],
)
def test_frames_of_a_lost_worker_are_drawn_again(
    stage: Stage, expected: list[bytes], tmp_path: Path, fault: str, notes: list[str]
) -> None:
    assert HANG_S < LONG_S
    num_workers = 1 if fault in ("stop_half_way_once", "stop_at_first_start") else 2
    with faulty_pool(stage, num_workers, fault, tmp_path) as pool:
        assert draw_all(pool) == expected
        assert pool.notes == notes


def test_workers_that_die_often_leave_no_descriptor(stage: Stage, expected: list[bytes], tmp_path: Path) -> None:
    with faulty_pool(stage, 1, "kill_often", tmp_path) as pool:
        assert wait_until(lambda: pool.is_ready, 60)
        gc.collect()  # what tests before have left
        before = len(os.listdir("/proc/self/fd"))
        assert draw_all(pool) == expected
        gc.collect()
        assert len(os.listdir("/proc/self/fd")) == before
        assert pool.notes == ["3 of the processes that draw died and were replaced, and what they had was drawn again"]


def test_a_hung_worker_that_cannot_be_killed_is_left(
    stage: Stage, expected: list[bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mark: str
) -> None:
    """A process that waits for a device in the kernel is like that; here the kill has no effect."""
    monkeypatch.setattr(process, "_EXIT_TIMEOUT_S", 0.1)
    monkeypatch.setattr(process, "_KILL_TIMEOUT_S", 0.1)
    with faulty_pool(stage, 2, "stop_once", tmp_path) as pool:
        with monkeypatch.context() as patch:
            patch.setattr(subprocess.Popen, "kill", lambda _: None)
            assert draw_all(pool) == expected
        assert pool.notes == [f"{ONE} hung (no processor time for 1 s), could not be ended and was replaced{AGAIN}"]
    assert wait_until(lambda: marked(mark) == set(), SOON_S)


def test_a_pool_whose_workers_are_all_killed_draws_the_same(stage: Stage, expected: list[bytes], mark: str) -> None:
    """They are killed in the middle of a film, which is then left, and again while nothing is drawn."""
    with open_pool(stage, 2, threads_per_worker=1) as pool:
        frames = pool.draw(NUMBERS * 8)
        for number in range(len(NUMBERS)):
            assert next(frames).picture.png == expected[number]
            if number == 2:
                kill(marked(mark))
        frames.close()
        kill(marked(mark))
        assert draw_all(pool) == expected


def kill(processes: set[int]) -> None:
    assert len(processes) == 2
    for number in processes:
        os.kill(number, signal.SIGKILL)


MEMORY_HINT = "  hint: where memory runs out the system sends this signal: fewer workers need less"


@pytest.mark.parametrize(
    ("fault", "kind", "text"),
    [
        (
            "kill_always",
            RenderError,
            f"frame {FRAME}: a process that draws has died, 3 times at the same frame\n"
            f"  got: signal SIGKILL\n    first words\n    the driver has given up\n{MEMORY_HINT}",
        ),
        ("die_at_start", RenderError, f"a process that draws has died\n  got: signal SIGKILL\n{MEMORY_HINT}"),
        ("input_error", InputError, "scene.yaml: a bad frame\n  got: this\n  expected: that\n  hint: another"),
        (
            "out_of_memory",
            RenderError,
            f"frame {FRAME}: there is not enough memory to draw it\n  hint: fewer workers need less",
        ),
        (
            "no_gl",
            RenderError,
            "no OpenGL 3.3 context could be made\n  got: nothing\n  expected: a driver\n  hint: install one",
        ),
        (
            "gl_error_always",
            ContextLostError,
            f"{{renderer}}, frame {FRAME}: OpenGL failed to draw, or its context was lost, 3 times at the same frame\n"
            "  got: GL_INVALID_ENUM",
        ),
    ],
)
def test_what_fails_again_and_again_is_an_error(
    stage: Stage, rasterizer: GLRasterizer, tmp_path: Path, fault: str, kind: type[HsplatError], text: str
) -> None:
    error = error_of(stage, fault, tmp_path)
    assert (type(error), str(error)) == (kind, text.replace("{renderer}", rasterizer.renderer_name))


def error_of(stage: Stage, name: str, folder: Path) -> HsplatError:
    with faulty_pool(stage, 1, name, folder) as pool:
        with pytest.raises(HsplatError) as raised:
            draw_all(pool)
        return raised.value


def test_a_program_that_does_not_start_is_an_error_with_its_last_lines(stage: Stage, tmp_path: Path) -> None:
    error = error_of(stage, "fail_to_start", tmp_path)
    assert error.what == "a process that draws has died"
    assert error.got is not None
    lines = error.got.splitlines()
    assert (lines[0], lines[-1]) == ("exit status 1", "ImportError: there is no such library")


def test_a_missing_python_is_an_error(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.executable", "/nowhere/python")
    with (
        open_pool(stage, 2, threads_per_worker=1) as pool,
        pytest.raises(RenderError, match="a process that draws cannot be started"),
    ):
        draw_all(pool)


def test_a_pool_can_be_left_before_a_worker_is_ready(stage: Stage, mark: str) -> None:
    with open_pool(stage, 2, threads_per_worker=1) as pool:
        assert wait_until(lambda: len(marked(mark)) == 2, SOON_S)
        assert pool.drivers == ()
    assert marked(mark) == set()


def test_the_stage_moves_to_memory_that_all_workers_map(stage: Stage) -> None:
    with open_pool(stage, 2, threads_per_worker=1) as pool:
        assert wait_until(lambda: pool.is_ready, 60)
        list(pool.draw(range(8)))
        # One worker may have drawn all frames before the other had started.
        assert wait_until(lambda: max(len(by) for by in own_memory().values()) == 3, 60)
        assert (pool.stage.volume.values == stage.volume.values).all()
        assert len(pool.drivers) == 1


def test_this_process_frees_what_workers_have_taken_over() -> None:
    """The volume is in memory once, and there are no bricks here, when workers draw."""
    stage = stage_of(PLAIN, waves("float32"))
    assert stage.bricks is not None
    once = [weakref.ref(thing) for thing in (stage, stage.bricks, stage.volume)]
    with RecoveringRasterizer() as rasterizer:
        plan, most = FilmPlan(stage), 5000  # frames take milliseconds, and workers about a second to start
        with Executor(ExecutorSpec(workers=2), rasterizer, None, Reporter()).for_plan(plan, most) as executor:
            del plan, stage
            drawing = executor.draw(range(most))
            for result in drawing:
                number = result.number
                gc.collect()
                if not any(found() for found in once):
                    break
            assert [found() for found in once] == [None, None, None]
            assert next(drawing).number == number + 1 < most
            assert executor.plan.stage.bricks is not None
            drawing.close()
