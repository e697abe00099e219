"""Programs for tests of child processes. The argument names the program, which prints a word when it is at work."""

from __future__ import annotations

import ctypes
import subprocess
import sys
import time

from renderer.system import ChildProcesses

LONG_S = 600


def have_a_child() -> None:
    """Start a child that waits."""
    with (
        ChildProcesses() as child_processes,
        child_processes.start("children", ["wait"], stdout=subprocess.PIPE) as child,
    ):
        assert child.stdout is not None
        say(child.stdout.readline().decode().strip())
        child.wait()


def hold_the_lock() -> None:
    """Sleep in a library's function that keeps Python's lock, so that no other thread runs."""
    say("holding")
    ctypes.PyDLL(None).sleep(LONG_S)


def wait() -> None:
    say("waiting")
    time.sleep(LONG_S)


def show_modules() -> None:
    """Print the import path, the arguments and the standard input."""
    say(repr((sys.path, sys.argv[1:], sys.stdin.read())))


def say(text: str) -> None:
    print(text, flush=True)


if __name__ == "__main__":
    {function.__name__: function for function in (have_a_child, hold_the_lock, wait, show_modules)}[sys.argv[1]]()
