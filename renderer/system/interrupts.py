"""Makes SIGTERM and SIGHUP unwind like Ctrl-C, and lets all three wait while files get their final names.

Python handles signals in the main thread, and sets handlers only there. In other threads these functions do nothing: no
signal interrupts those. A signal that is ignored, as SIGHUP is after `nohup`, stays ignored.
"""

from __future__ import annotations

import atexit
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# Ctrl-C, a batch system or `kill`, and a terminal that closes.
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def signals_as_interrupts() -> Iterator[None]:
    """Raise KeyboardInterrupt, with its number, on each of these signals: nothing unfinished is left then."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt(number)

    before = _handle(interrupt)
    try:
        yield
    finally:
        _restore(before)


@contextmanager
def deferrable_interrupts() -> Iterator[Callable[[], None]]:
    """Yield a function that defers the signals to the end of the block, where they raise KeyboardInterrupt.

    Files that belong together get their final names after its call, together.
    """
    before: dict[int, Any] = {}
    pending: list[int] = []

    def defer() -> None:
        before.update(_handle(lambda number, frame: pending.append(number)))

    try:
        yield defer
    finally:
        _restore(before)
    if pending:
        raise KeyboardInterrupt(pending[0])


def interrupted_status(error: BaseException) -> int:
    """Return the exit status of an interrupted program, as shells count: 130 after Ctrl-C, 143 after SIGTERM."""
    numbers = [number for number in error.args if isinstance(number, int)]
    return 128 + int((numbers or [signal.SIGINT])[0])


def exit_on_signals(status: int) -> None:
    """Let each further signal end this process at once, with this status: the work is over, and has been cleaned up."""
    # CPython ends by SIGINT, whatever the exit status, where a KeyboardInterrupt ever left code that was compiled from
    # text, as dataclasses are during an import. The next such code takes that back.
    eval("None")  # noqa: S307
    _handle(lambda number, frame: os._exit(status))
    # Python removes its handlers before its own end, which takes a while.
    atexit.register(_handle, signal.SIG_IGN)


def _handle(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> dict[int, Any]:
    """Set a handler for the signals that are not ignored, and return those before."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    heeded = [number for number in _SIGNALS if signal.getsignal(number) not in (signal.SIG_IGN, None)]
    return {number: signal.signal(number, handler) for number in heeded}


def _restore(handlers: dict[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)
