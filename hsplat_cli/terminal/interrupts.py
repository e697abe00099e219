"""SIGTERM unwinds like Ctrl-C, and both can wait for a moment."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


@contextmanager
def sigterm_as_interrupt() -> Iterator[None]:
    """SIGTERM, as batch systems send it, unwinds like Ctrl-C, so that nothing unfinished is left."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def deferrable_interrupts() -> Iterator[Callable[[], None]]:
    """A function after whose call SIGINT and SIGTERM wait for the end of the block, where they are KeyboardInterrupt.

    So files that belong together get their final names together.
    """
    before: dict[signal.Signals, Any] = {}
    came: list[int] = []

    def defer() -> None:
        for number in (signal.SIGINT, signal.SIGTERM):
            before[number] = signal.signal(number, lambda number, frame: came.append(number))

    try:
        yield defer
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if came:
        raise KeyboardInterrupt
