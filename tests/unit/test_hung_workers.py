"""A worker hangs after several checks in a row at which it had work and had done nothing."""

from __future__ import annotations

import os

import pytest

from hsplat_cli.executors.workers import process
from hsplat_cli.executors.workers.process import WorkerProcess
from renderer.system import ChildProcesses


@pytest.mark.parametrize(
    ("events", "is_hung"),
    [
        ("5 5 5 5", True),  # the first check has no earlier time to compare with
        ("5 5 5 6 6 6", False),
        ("idle idle idle idle idle 5 5", False),
        ("idle 5 5 5", True),
        ("unknown unknown unknown unknown unknown", False),
    ],
)
def test_a_worker_hangs_after_three_checks_without_progress(
    monkeypatch: pytest.MonkeyPatch, events: str, is_hung: bool
) -> None:
    """Events are checks with the processor time that they find."""
    monkeypatch.setattr(process, "MAX_IDLE_CHECKS", 3)
    with open(os.devnull, "rb") as nothing, ChildProcesses() as child_processes:
        worker = WorkerProcess(child_processes, ("children", "wait"), nothing.fileno(), os.environ)
        for event in events.split():
            assert worker._killed_at is None
            worker._is_awaited = event != "idle"
            ticks = {"idle": 5, "unknown": None}[event] if event in ("idle", "unknown") else int(event)
            monkeypatch.setattr(process, "_processor_time", lambda _, ticks=ticks: ticks)
            worker.check_progress()
        assert (worker._killed_at is not None) == is_hung
        worker.kill()
        worker.close()


def test_a_worker_that_ends_is_not_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "_EXIT_TIMEOUT_S", 60.0)
    with open(os.devnull, "rb") as nothing, ChildProcesses() as child_processes:
        worker = WorkerProcess(child_processes, ("children", "end"), nothing.fileno(), os.environ)
        worker.close()
        assert worker._process.returncode == 0


def test_the_processor_time_is_that_of_linux() -> None:
    """It differs by at most a tick from each of the times of `os.times`, which are rounded."""
    before, used, after = os.times(), process._processor_time(os.getpid()), os.times()
    per_second = os.sysconf("SC_CLK_TCK")
    assert used is not None
    least, most = ((each.user + each.system) * per_second for each in (before, after))
    assert least - 2 <= used <= most + 2
    assert process._processor_time(2**22 + 1) is None  # no process can have this number
