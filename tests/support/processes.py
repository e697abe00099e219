"""List the processes that a test has started, as Linux reports them."""

from __future__ import annotations

import os
import time
import uuid
from collections.abc import Callable
from pathlib import Path

MARK = "HSPLAT_TEST_MARK"


def new_mark() -> str:
    """Return a new value for the environment variable MARK, which all child processes inherit."""
    return uuid.uuid4().hex


def marked(mark: str) -> set[int]:
    """Return the ids of all running processes, except this one, whose environment variable MARK has this value."""
    wanted = f"{MARK}={mark}".encode()
    found = set()
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if wanted in (folder / "environ").read_bytes().split(b"\0"):
                found.add(int(folder.name))
        except OSError:  # the process has ended, or belongs to another user
            continue
    return found - {os.getpid()}


def wait_until(condition: Callable[[], bool], seconds: float) -> bool:
    """Wait until a condition is true, and return whether it became true in time."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True
