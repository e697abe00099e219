"""A worker hangs after several checks in a row at which it had work and had done nothing."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from queue import SimpleQueue

import pytest

from hsplat_cli.executors import ChildProcesses
from hsplat_cli.executors.workers import process
from hsplat_cli.executors.workers.process import WorkerProcess


@pytest.fixture
def worker(monkeypatch: pytest.MonkeyPatch) -> Iterator[WorkerProcess]:
    """Start a process that never gets ready, and hangs after three checks."""
    monkeypatch.setattr(process, "MAX_IDLE_CHECKS", 3)
    with open(os.devnull, "rb") as nothing, ChildProcesses() as child_processes:
        program, environment = ("children", "wait"), dict(os.environ)
        found = WorkerProcess(child_processes, program, nothing.fileno(), environment, SimpleQueue())
        yield found
        found.kill()
        found.close()


@pytest.mark.parametrize(
    ("events", "is_hung"),
    [
        ("5 5 5 5", True),  # the first check has no earlier time to compare with
        ("5 5 5 6 6 6", False),
        ("5 5 5 message 5 5", False),
        ("5 5 5 message 5 5 5", True),
        ("idle idle idle idle idle 5 5", False),
        ("idle 5 5 5", True),
        ("unknown unknown unknown unknown unknown", False),
    ],
)
def test_a_worker_hangs_after_three_checks_without_progress(
    worker: WorkerProcess, monkeypatch: pytest.MonkeyPatch, events: str, is_hung: bool
) -> None:
    """Events are messages, and checks with the processor time that they find."""
    for event in events.split():
        assert not worker.is_hung
        if event == "message":
            worker.note_message()
        else:
            ticks = {"idle": 5, "unknown": None}[event] if event in ("idle", "unknown") else int(event)
            monkeypatch.setattr(process, "_processor_time", lambda _, ticks=ticks: ticks)
            worker.check_progress(has_work=event != "idle")
    assert worker.is_hung == is_hung
    if is_hung:
        worker.kill()
        worker.close()
        assert str(worker.exit_error()).startswith("a process that draws has hung\n  got: no processor time for 15 s")


def test_a_worker_that_cannot_be_killed_is_left(worker: WorkerProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that waits for a device in the kernel is like that."""
    monkeypatch.setattr(process, "_EXIT_TIMEOUT_S", 0.01)
    monkeypatch.setattr(process, "_KILL_TIMEOUT_S", 0.01)
    with monkeypatch.context() as patch:
        patch.setattr(subprocess.Popen, "kill", lambda _: None)
        worker.close()
        assert worker.is_still_alive and worker.was_killed
        text = str(worker.exit_error())
        assert text.startswith("a process that draws has hung\n  got: it does not end, though it was killed")


def test_the_processor_time_is_that_of_linux() -> None:
    """It differs by at most a tick from each of the times of `os.times`, which are rounded."""
    before, used, after = os.times(), process._processor_time(os.getpid()), os.times()
    per_second = os.sysconf("SC_CLK_TCK")
    assert used is not None
    least, most = ((each.user + each.system) * per_second for each in (before, after))
    assert least - 2 <= used <= most + 2
    assert process._processor_time(2**22 + 1) is None  # no process can have this number
