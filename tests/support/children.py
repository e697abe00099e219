"""Programs for tests of child processes: `children NAME`, which prints a word when it is at work."""

from __future__ import annotations

import ctypes
import itertools
import subprocess
import sys
import time

from film_stages import PLAIN, stage_of

from hsplat_cli.executors.workers.pool import open_pool
from renderer.system import ChildProcesses

LONG_S = 600


def draw_for_ever() -> None:
    """Draw with a pool."""
    with open_pool(stage_of(PLAIN), 2, threads_per_worker=1) as pool:
        for count in itertools.count():
            list(pool.draw(range(8)))
            if count == 0:
                say("drawing")


def start_workers() -> None:
    """Start a pool whose workers may not be ready."""
    with open_pool(stage_of(PLAIN), 2, threads_per_worker=1):
        say("starting")
        time.sleep(LONG_S)


def have_a_child() -> None:
    """Start a child that draws with a pool."""
    with (
        ChildProcesses() as child_processes,
        child_processes.start("children", ["draw_for_ever"], stdout=subprocess.PIPE) as child,
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


def end() -> None:
    """Do nothing."""


def show_modules() -> None:
    """Print the import path, the arguments and the standard input."""
    say(repr((sys.path, sys.argv[1:], sys.stdin.read())))


def say(text: str) -> None:
    print(text, flush=True)


if __name__ == "__main__":
    {
        function.__name__: function
        for function in (draw_for_ever, start_workers, have_a_child, hold_the_lock, wait, end, show_modules)
    }[sys.argv[1]]()
