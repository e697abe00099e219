"""Several processes draw what one draws, whatever happens to them, and nothing of them is left."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import weakref
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from faulty_worker import DRAW_FAULTS, FRAME, GL_FAULTS, LONG_S, START_FAULTS
from film_stages import PLAIN, stage_of, waves
from processes import MARK, holders_of_shared_memory, marked, new_mark, wait_until

from hsplat_cli.executors import ExecutorSpec, LocalExecutor
from hsplat_cli.executors.executor import Executor
from hsplat_cli.executors.workers import process
from hsplat_cli.executors.workers.pool import Pool, open_pool
from hsplat_cli.executors.workers.process import HangPolicy
from hsplat_cli.terminal import Reporter
from renderer.draw import GLRasterizer, RecoveringRasterizer
from renderer.errors import HsplatError, InputError, RenderError
from renderer.frame import Stage
from renderer.study import FilmPlan

NUMBERS = [0, 1, 2, 3, 4, 5, 6, 7, 2, 1]  # some twice, and backwards

# What a process that was killed may take to be gone.
SOON_S = 1.0

# With workers that hang.
LITTLE, MUCH = HangPolicy(check_interval_s=0.05, max_idle_checks=20), HangPolicy()


@pytest.fixture(scope="module")
def stage() -> Stage:
    return stage_of(PLAIN)


@pytest.fixture(scope="module")
def expected(stage: Stage, rasterizer: GLRasterizer) -> list[bytes]:
    return [drawn.picture.png for drawn in LocalExecutor(stage, rasterizer).draw(NUMBERS)]


@pytest.fixture(autouse=True)
def mark(monkeypatch: pytest.MonkeyPatch) -> str:
    """Of all children of the test."""
    name = new_mark()
    monkeypatch.setenv(MARK, name)
    return name


@pytest.fixture(autouse=True)
def _nothing_is_left(mark: str) -> Iterator[None]:
    """After every test of this file: no process, and no memory that this one does not map alone."""
    yield
    assert marked(mark) == set()
    assert all(holders == {str(os.getpid())} for holders in ours().values())


def ours() -> dict[int, set[str]]:
    return {inode: by for inode, by in holders_of_shared_memory().items() if str(os.getpid()) in by}


def faulty(name: str, folder: Path) -> Sequence[str]:
    assert name in [*DRAW_FAULTS, *START_FAULTS, *GL_FAULTS]
    return "faulty_worker", name, str(folder)


def draw_all(pool: Pool) -> list[bytes]:
    return [drawn.picture.png for drawn in pool.draw(NUMBERS)]


ONE, AGAIN = "1 of the processes that draw", ", and what it had was drawn again"


@pytest.mark.parametrize(
    ("fault", "notes"),
    [
        ("kill_once", [f"{ONE} died and was replaced{AGAIN}"]),
        ("hang_up_once", [f"{ONE} died and was replaced{AGAIN}"]),
        ("talk", []),
        ("gl_error_once", [f"{ONE} lost OpenGL's context and was replaced{AGAIN}"]),
        ("die_at_first_start", [f"{ONE} died and was replaced"]),
    ],
)
def test_what_can_be_done_again_is(
    stage: Stage, expected: list[bytes], tmp_path: Path, fault: str, notes: list[str]
) -> None:
    with open_pool(stage, 2, threads_per_worker=1, program=faulty(fault, tmp_path)) as pool:
        assert draw_all(pool) == expected
        assert pool.notes == notes


def test_workers_that_die_often(stage: Stage, expected: list[bytes], tmp_path: Path) -> None:
    with open_pool(stage, 1, threads_per_worker=1, program=faulty("kill_often", tmp_path)) as pool:
        gc.collect()  # what tests before have left
        before = len(os.listdir("/proc/self/fd"))
        assert draw_all(pool) == expected
        gc.collect()
        assert len(os.listdir("/proc/self/fd")) == before
        assert pool.notes == ["3 of the processes that draw died and were replaced, and what they had was drawn again"]


@pytest.mark.parametrize(
    ("fault", "num_workers", "again"),
    [
        ("stop_once", 2, AGAIN),
        ("dead_lock_once", 2, AGAIN),
        ("stop_half_way_once", 1, AGAIN),
        ("stop_at_first_start", 1, ""),
    ],
)
def test_who_hangs_is_replaced(
    stage: Stage, expected: list[bytes], tmp_path: Path, fault: str, num_workers: int, again: str
) -> None:
    program = faulty(fault, tmp_path)
    with open_pool(stage, num_workers, threads_per_worker=1, program=program, hang_policy=LITTLE) as pool:
        assert draw_all(pool) == expected
        assert pool.notes == [f"{ONE} hung (no processor time for 1 s) and was replaced{again}"]


def test_who_hangs_and_cannot_be_killed_is_left(
    stage: Stage, expected: list[bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mark: str
) -> None:
    """As one is that waits for a device in the kernel; here nobody kills it before the end of the block."""
    monkeypatch.setattr(process, "_KILL_TIMEOUT_S", 0.1)
    with open_pool(stage, 2, threads_per_worker=1, program=faulty("stop_once", tmp_path), hang_policy=LITTLE) as pool:
        with monkeypatch.context() as patch:
            patch.setattr(subprocess.Popen, "kill", lambda _: None)
            assert draw_all(pool) == expected
        assert pool.notes == [f"{ONE} hung (no processor time for 1 s), could not be ended and was replaced{AGAIN}"]
    assert wait_until(lambda: marked(mark) == set(), SOON_S)


def test_who_takes_long_is_waited_for(stage: Stage, expected: list[bytes], tmp_path: Path) -> None:
    assert LITTLE.check_interval_s * LITTLE.max_idle_checks < LONG_S
    with open_pool(
        stage, 2, threads_per_worker=1, program=faulty("take_long_once", tmp_path), hang_policy=LITTLE
    ) as pool:
        assert draw_all(pool) == expected
        assert pool.notes == []


def test_killed_from_outside(stage: Stage, expected: list[bytes], mark: str) -> None:
    """All workers at once, in the midst of a film, and once more while nobody draws."""
    with open_pool(stage, 2, threads_per_worker=1) as pool:
        files = []
        for drawn in pool.draw(NUMBERS):
            if len(files) == 2:
                kill(marked(mark))
            files.append(drawn.picture.png)
        assert files == expected
        kill(marked(mark))
        assert draw_all(pool) == expected


def kill(processes: set[int]) -> None:
    assert len(processes) == 2
    for number in processes:
        os.kill(number, signal.SIGKILL)


def error_of(stage: Stage, name: str, folder: Path, patience: HangPolicy = MUCH) -> HsplatError:
    with open_pool(stage, 2, threads_per_worker=1, program=faulty(name, folder), hang_policy=patience) as pool:
        with pytest.raises(HsplatError) as raised:
            draw_all(pool)
        return raised.value


@pytest.mark.parametrize(
    ("fault", "kind", "text"),
    [
        (
            "kill_always",
            RenderError,
            f"frame {FRAME}: a process that draws has died, 3 times at the same frame\n"
            "  got: signal SIGKILL\n"
            "  hint: where memory runs out the system sends this signal: fewer workers need less",
        ),
        (
            "exit_always",
            RenderError,
            f"frame {FRAME}: a process that draws has died, 3 times at the same frame\n"
            "  got: exit status 7\n"
            "    first words\n"
            "    the driver has given up",
        ),
        (
            "input_error",
            InputError,
            "scene.yaml: a bad frame\n  got: this\n  expected: that\n  hint: another",
        ),
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
            "die_at_start",
            RenderError,
            "a process that draws has died\n"
            "  got: signal SIGKILL\n"
            "  hint: where memory runs out the system sends this signal: fewer workers need less",
        ),
    ],
)
def test_what_cannot_is_an_error(stage: Stage, tmp_path: Path, fault: str, kind: type[HsplatError], text: str) -> None:
    error = error_of(stage, fault, tmp_path)
    assert (type(error), str(error)) == (kind, text)


def test_a_context_that_is_lost_again_and_again(stage: Stage, rasterizer: GLRasterizer, tmp_path: Path) -> None:
    error = error_of(stage, "gl_error_always", tmp_path)
    assert str(error) == (
        f"{rasterizer.renderer_name}, frame {FRAME}: OpenGL failed to draw, or its context was lost, "
        "3 times at the same frame\n  got: GL_INVALID_ENUM"
    )


def test_who_hangs_again_and_again(stage: Stage, tmp_path: Path) -> None:
    assert str(error_of(stage, "stop_always", tmp_path, LITTLE)) == (
        f"frame {FRAME}: a process that draws has hung, 3 times at the same frame\n"
        "  got: no processor time for 1 s\n    the driver waits"
    )


def test_a_program_that_does_not_start(stage: Stage, tmp_path: Path) -> None:
    """Its last words are told."""
    error = error_of(stage, "fail_to_start", tmp_path)
    assert error.what == "a process that draws has died"
    assert error.got is not None
    lines = error.got.splitlines()
    assert (lines[0], lines[-1]) == ("exit status 1", "    ImportError: there is no such library")


def test_no_python(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.executable", "/nowhere/python")
    with (
        pytest.raises(RenderError, match="a process that draws cannot be started"),
        open_pool(stage, 2, threads_per_worker=1),
    ):
        pass


def test_a_slow_frame_does_not_let_the_others_run_away(stage: Stage, tmp_path: Path) -> None:
    """Every worker draws at most four frames ahead of the one that is waited for."""
    with open_pool(stage, 2, threads_per_worker=1, program=faulty("slow_first", tmp_path)) as pool:
        frames = pool.draw([*range(8), *range(100, 150)])
        assert next(frames).number == 0
        # Those after the slow one may have been begun by now.
        assert len(list(tmp_path.glob("frame *"))) <= 8 + 2


def test_a_run_that_is_left_is_forgotten(stage: Stage, expected: list[bytes], mark: str) -> None:
    with open_pool(stage, 2, threads_per_worker=1) as pool:
        frames = pool.draw(list(range(8)) * 10)
        next(frames)
        frames.close()  # type: ignore[attr-defined]
        assert draw_all(pool) == expected


@pytest.mark.parametrize("error", [LookupError, KeyboardInterrupt])
def test_leaving_by_an_error_ends_all(stage: Stage, mark: str, error: type[BaseException]) -> None:
    def leave() -> None:
        with open_pool(stage, 2, threads_per_worker=1) as pool:
            for drawn in pool.draw(range(8)):
                if drawn.number == 2:
                    assert len(marked(mark)) == 2
                    raise error

    with pytest.raises(error):
        leave()
    assert marked(mark) == set()


def test_leaving_at_once(stage: Stage, mark: str) -> None:
    """Before anybody is ready."""
    with open_pool(stage, 2, threads_per_worker=1) as pool:
        assert len(marked(mark)) == 2 or wait_until(lambda: len(marked(mark)) == 2, SOON_S)
        assert pool.drivers == ()
    assert marked(mark) == set()


def test_the_stage_moves(stage: Stage) -> None:
    """To memory that all of them map."""
    with open_pool(stage, 2, threads_per_worker=1) as pool:
        assert wait_until(lambda: pool.is_ready, 60)
        list(pool.draw(range(8)))
        memory = ours()
        assert len(memory) >= 1 and max(len(by) for by in memory.values()) == 3
        assert (pool.stage.volume.values == stage.volume.values).all()
        assert len(pool.drivers) == 1


def test_one_process_lets_go_of_what_the_others_draw() -> None:
    """The volume is in memory once, and there are no bricks here, when workers have taken over."""
    stage = stage_of(PLAIN, waves("float32"))
    assert stage.bricks is not None
    once = [weakref.ref(thing) for thing in (stage, stage.bricks, stage.volume)]
    with RecoveringRasterizer() as rasterizer:
        plan, most = FilmPlan(stage), 5000  # frames take milliseconds, and workers a second or so
        with Executor(ExecutorSpec(workers=2), rasterizer, None, Reporter()).for_plan(plan, most) as executor:
            del plan, stage
            drawing = executor.draw(range(most))
            for drawn in drawing:
                number = drawn.number
                gc.collect()
                if not any(found() for found in once):
                    break
            assert [found() for found in once] == [None, None, None]
            assert next(drawing).number == number + 1 < most
            assert executor.plan.stage.bricks is not None
            drawing.close()
