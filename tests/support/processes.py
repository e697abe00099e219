"""Lists the processes that a test has started, as Linux reports them."""

from __future__ import annotations

import os
import time
import uuid
from collections.abc import Callable
from pathlib import Path

MARK = "HSPLAT_TEST_MARK"


def new_mark() -> str:
    """Return a value for the environment variable MARK, which all children inherit."""
    return uuid.uuid4().hex


def marked(mark: str) -> set[int]:
    """Return the other processes that have this mark, without zombies."""
    wanted = f"{MARK}={mark}".encode()
    found = set()
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if wanted in (folder / "environ").read_bytes().split(b"\0"):
                found.add(int(folder.name))
        except OSError:  # it is gone, or not ours
            continue
    return found - {os.getpid()}


def wait_until(condition: Callable[[], bool], seconds: float) -> bool:
    """Return whether the condition becomes true in time."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True
