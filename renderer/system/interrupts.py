"""Makes SIGTERM and SIGHUP unwind like Ctrl-C, and lets all three wait while files get their final names.

Soon after, they stop long kernels, too, in whatever threads these run: kernels look at `stop_flag`.

Python handles signals in the main thread, and sets handlers only there. In other threads these functions do nothing: no
signal interrupts those. A signal that is ignored, as SIGHUP is after `nohup`, stays ignored.
"""

from __future__ import annotations

import atexit
import ctypes
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:  # it loads queues and logging, which most commands do not need
    from concurrent.futures import Future, ThreadPoolExecutor

Result = TypeVar("Result")

# Ctrl-C, a batch system or `kill`, and a terminal that closes.
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Seconds from a signal until it stops long kernels. A frame that was drawn before is stored meanwhile, with its exact
# rays, which took 0.04 to 0.2 s for frames of two scans of 512 x 512 pixels on two cores.
_GRACE_S = 0.3
# Seconds for which a thread that waits for another one sleeps before it looks for signals.
_LONGEST_SLEEP_S = 0.1
# The number of the signal for which long kernels stop; 0 while there is none. Kernels read it where it lies.
stop_flag = ctypes.c_int32(0)


@contextmanager
def signals_as_interrupts(numbers: Sequence[signal.Signals] = _SIGNALS) -> Iterator[None]:
    """Raise KeyboardInterrupt, with its number, on each of these signals: nothing unfinished is left then.

    Long kernels then stop, up to the end of the block, from _GRACE_S later on.
    """
    timers: list[threading.Timer] = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        timers.append(threading.Timer(_GRACE_S, partial(setattr, stop_flag, "value", number)))
        with suppress(RuntimeError):  # no thread can be started
            timers[-1].start()
        raise KeyboardInterrupt(number)

    before = _handle(interrupt, numbers)
    try:
        yield
    finally:
        _restore(before)
        for timer in timers:
            timer.cancel()
            if timer.is_alive():
                timer.join()
        stop_flag.value = 0


@contextmanager
def ctrl_c_stops_kernels() -> Iterator[None]:
    """Let Ctrl-C stop long kernels, too, where it raises KeyboardInterrupt: in programs that use this package."""
    is_default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with signals_as_interrupts((signal.SIGINT,)) if is_default else nullcontext():
        yield


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
        if callable(handler := before[pending[0]]):
            handler(pending[0], None)
        raise KeyboardInterrupt(pending[0])


def start_threads(num: int, name: str = "") -> ThreadPoolExecutor:
    """Return an executor whose threads have all started; raises RuntimeError where one cannot be started.

    An interrupt while a thread starts would lose the thread: nobody would end it, and the process would wait for it.
    """
    from concurrent.futures import ThreadPoolExecutor

    with deferrable_interrupts() as defer:
        defer()
        threads = ThreadPoolExecutor(num, name)
        all_started = threading.Barrier(num)
        try:
            waiting = [threads.submit(all_started.wait) for _ in range(num)]
        except RuntimeError:
            all_started.abort()  # else those that have started would wait for ever
            raise
        for started in waiting:
            started.result()
    return threads


def result_of(running: Future[Result]) -> Result:
    """Return the result of a future, or raise what it raises; signals come to the main thread meanwhile.

    A signal that comes just before a thread falls asleep does not wake it, so that it sleeps for a short while only.
    """
    from concurrent.futures import wait

    while not running.done():
        wait([running], timeout=_LONGEST_SLEEP_S)
    return running.result()


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


def _handle(
    handler: Callable[[int, FrameType | None], None] | signal.Handlers, numbers: Sequence[signal.Signals] = _SIGNALS
) -> dict[int, Any]:
    """Set a handler for the signals that are not ignored, and return those before."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    heeded = [number for number in numbers if signal.getsignal(number) not in (signal.SIG_IGN, None)]
    return {number: signal.signal(number, handler) for number in heeded}


def _restore(handlers: dict[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)
