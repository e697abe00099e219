"""When a worker is taken for hung: looks are counted, and only where it has something to do and does nothing."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from queue import SimpleQueue

import pytest

from hsplat_cli.executors import ChildProcesses
from hsplat_cli.executors.workers import process
from hsplat_cli.executors.workers.process import HangPolicy, WorkerProcess

PATIENCE = HangPolicy(max_idle_checks=3)


@pytest.fixture
def worker() -> Iterator[WorkerProcess]:
    """It is not ready, and will not be."""
    with open(os.devnull, "rb") as nothing, ChildProcesses() as child_processes:
        program, environment = ("children", "wait"), dict(os.environ)
        found = WorkerProcess(child_processes, program, nothing.fileno(), environment, PATIENCE, SimpleQueue())
        yield found
        found.kill()
        found.close()


@pytest.fixture
def times(monkeypatch: pytest.MonkeyPatch) -> list[int | None]:
    """What the processor time will be at the next looks; the last one stays."""
    found: list[int | None] = [5]
    monkeypatch.setattr(process, "_processor_time", lambda _: found.pop(0) if len(found) > 1 else found[0])
    return found


def hangs_after(worker: WorkerProcess, max_idle_checks: int, *, has_work: bool = True) -> bool:
    for _ in range(max_idle_checks):
        assert not worker.is_hung
        worker.check_progress(has_work=has_work)
    return worker.is_hung


def test_the_first_look_has_nothing_to_compare_with(worker: WorkerProcess, times: list[int | None]) -> None:
    assert hangs_after(worker, 4)


def test_processor_time_begins_it_anew(worker: WorkerProcess, times: list[int | None]) -> None:
    times[:] = [5, 5, 5, 6]
    assert not hangs_after(worker, 6)
    assert hangs_after(worker, 1)


def test_so_does_a_message(worker: WorkerProcess, times: list[int | None]) -> None:
    assert not hangs_after(worker, 3)
    worker.note_message()
    assert not hangs_after(worker, 2)
    assert hangs_after(worker, 1)


def test_who_has_nothing_to_do_is_idle(worker: WorkerProcess, times: list[int | None]) -> None:
    assert not hangs_after(worker, 10, has_work=False)
    assert not hangs_after(worker, 2)
    assert hangs_after(worker, 1)


def test_where_the_system_does_not_tell(worker: WorkerProcess, times: list[int | None]) -> None:
    times[:] = [None]
    assert not hangs_after(worker, 10)


def test_one_that_is_not_to_be_ended_is_left(worker: WorkerProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    """As one is that waits for a device in the kernel."""
    monkeypatch.setattr(process, "_EXIT_TIMEOUT_S", 0.01)
    monkeypatch.setattr(process, "_KILL_TIMEOUT_S", 0.01)
    with monkeypatch.context() as patch:
        patch.setattr(subprocess.Popen, "kill", lambda _: None)
        worker.close()
        assert worker.is_still_alive and worker.was_killed
        assert str(worker.exit_error()) == (
            "a process that draws has hung\n  got: it does not end, though it was killed"
        )


def test_what_linux_tells() -> None:
    """Of this process, to a tick of `os.times`, which rounds user and system time each; of none, nothing."""
    before, used, after = os.times(), process._processor_time(os.getpid()), os.times()
    per_second = os.sysconf("SC_CLK_TCK")
    assert used is not None
    least, most = ((each.user + each.system) * per_second for each in (before, after))
    assert least - 2 <= used <= most + 2
    assert process._processor_time(2**22 + 1) is None  # a number that none can have
