"""Makes SIGTERM unwind like Ctrl-C, and lets both wait while files get their final names.

Python handles signals in the main thread, and sets handlers only there. In other threads both functions do nothing: no
signal interrupts those.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


@contextmanager
def sigterm_as_interrupt() -> Iterator[None]:
    """Raise KeyboardInterrupt on SIGTERM, which batch systems send: nothing unfinished is left then."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    if not _is_main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def deferrable_interrupts() -> Iterator[Callable[[], None]]:
    """Yield a function that defers SIGINT and SIGTERM to the end of the block, where they raise KeyboardInterrupt.

    Files that belong together get their final names after its call, together.
    """
    before: dict[signal.Signals, Any] = {}
    pending: list[int] = []

    def defer() -> None:
        for number in (signal.SIGINT, signal.SIGTERM) if _is_main_thread() else ():
            before[number] = signal.signal(number, lambda number, frame: pending.append(number))

    try:
        yield defer
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if pending:
        raise KeyboardInterrupt


def _is_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
