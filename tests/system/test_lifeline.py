"""No process that this program starts outlives it, however it ends."""

from __future__ import annotations

import ast
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from descriptors import open_unnamed
from processes import MARK, marked, new_mark, wait_until

from renderer.system import ChildProcesses

# The longest time that the program promises.
LONGEST_S = 5.0


@pytest.fixture(autouse=True)
def mark(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Mark all children of the test, and kill those that are left."""
    name = new_mark()
    monkeypatch.setenv(MARK, name)
    yield name
    for process in marked(name):
        os.kill(process, signal.SIGKILL)


def start(child_processes: ChildProcesses, *arguments: str) -> subprocess.Popen[bytes]:
    return child_processes.start("children", arguments, stdout=subprocess.PIPE)


def says(child: subprocess.Popen[bytes]) -> str:
    assert child.stdout is not None
    return child.stdout.readline().decode().strip()


def test_children_end_with_a_killed_parent(mark: str) -> None:
    with ChildProcesses() as child_processes, start(child_processes, "have_a_child") as parent:
        assert says(parent) == "waiting"
        assert len(marked(mark)) == 2
        parent.kill()
        assert wait_until(lambda: not marked(mark), LONGEST_S)


def test_the_parent_ends_children_that_hold_the_lock_of_python(mark: str) -> None:
    with ChildProcesses() as child_processes:
        children = [start(child_processes, "hold_the_lock") for _ in range(2)]
        assert all(map(says, children))
    for child in children:
        assert child.wait(LONGEST_S) == -signal.SIGKILL
        assert child.stdout is not None
        child.stdout.close()
    assert wait_until(lambda: not marked(mark), LONGEST_S)


def test_a_child_that_starts_after_the_end_of_its_parent_ends(mark: str) -> None:
    with ChildProcesses() as child_processes:
        stopped = start(child_processes, "wait")
        stopped.send_signal(signal.SIGSTOP)
    stopped.send_signal(signal.SIGCONT)
    assert stopped.wait(LONGEST_S) in (1, -signal.SIGKILL)
    assert stopped.stdout is not None
    stopped.stdout.close()


def test_a_thread_ends_the_child_on_a_system_without_the_signal(mark: str) -> None:
    code = "\n".join(
        [
            "import fcntl, sys, time",
            "del fcntl.F_SETSIG",
            "from renderer.system import exit_with_parent",
            "exit_with_parent(int(sys.argv[1]))",
            "print('waiting', flush=True)",
            "time.sleep(600)",
        ]
    )
    here, there = os.pipe()
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", code, str(here)]
    with subprocess.Popen(command, pass_fds=[here], stdout=subprocess.PIPE, env=environment) as child:
        assert says(child) == "waiting"
        os.close(there)
        assert child.wait(LONGEST_S) == 1
    os.close(here)


def test_a_child_has_our_modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It does not import from the current folder; it has our arguments and an empty standard input."""
    for name in ("renderer", "json", "children", "threading"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the wrong one')")
    monkeypatch.chdir(tmp_path)
    arguments = ["show_modules", "--flag", "a b", os.fsdecode(b"\xff")]
    with ChildProcesses() as child_processes, start(child_processes, *arguments) as child:
        path, argv, read = ast.literal_eval(says(child))
    assert (child.returncode, path, argv, read) == (0, sys.path, arguments, "")


def test_a_child_inherits_only_three_streams_and_the_pipe(mark: str) -> None:
    with open(os.devnull) as other, ChildProcesses() as child_processes, start(child_processes, "wait") as child:
        os.set_inheritable(other.fileno(), True)
        assert says(child) == "waiting"
        assert len(list(Path(f"/proc/{child.pid}/fd").iterdir())) == 4
        child.kill()


def test_ended_children_leave_no_descriptor(mark: str) -> None:
    before = open_unnamed()
    with ChildProcesses() as child_processes:
        children = [start(child_processes, "wait") for _ in range(3)]
        assert {says(child) for child in children} == {"waiting"}
    for child in children:
        with child:
            assert child.wait(LONGEST_S) in (-signal.SIGKILL, 1)
    assert open_unnamed() <= before


def test_what_cannot_be_started_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.executable", "/nowhere/python")
    before = open_unnamed()
    with pytest.raises(FileNotFoundError), ChildProcesses() as child_processes:
        start(child_processes, "wait")
    assert open_unnamed() <= before
