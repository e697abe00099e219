"""Make SIGTERM and SIGHUP raise KeyboardInterrupt like Ctrl-C, and defer these signals while files get their names.

Soon after a signal, long kernels stop, too, in all threads, because they read `stop_flag`.

Python handles signals in the main thread, and sets handlers only there. In other threads, these functions do nothing,
because no signal interrupts these threads. A signal that is ignored, as SIGHUP is after `nohup`, stays ignored.
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

if TYPE_CHECKING:  # the module loads queues and logging, which most commands do not need
    from concurrent.futures import Future, ThreadPoolExecutor

Result = TypeVar("Result")

# The signals that interrupt work: SIGINT comes from Ctrl-C, SIGTERM from a batch system or `kill`, and SIGHUP from a
# terminal that closes.
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# The seconds from a signal until it stops long kernels. In this time, a frame that is drawn is measured by exact rays
# and stored. Exact rays took 0.04 to 0.2 s for frames of 512 x 512 pixels of two scans, on two cores.
_GRACE_S = 0.3
# The seconds for which a thread that waits for a result sleeps before it looks for signals.
_LONGEST_SLEEP_S = 0.1
# The number of the signal that stops long kernels; 0 without a signal. Kernels read it from this place in memory.
stop_flag = ctypes.c_int32(0)


@contextmanager
def signals_as_interrupts(numbers: Sequence[signal.Signals] = _SIGNALS) -> Iterator[None]:
    """Let each of some signals raise KeyboardInterrupt, with the number of the signal, during the `with` block.

    Once a signal is older than _GRACE_S, long kernels stop, until the end of the block.
    """
    timers: list[threading.Timer] = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        timers.append(threading.Timer(_GRACE_S, partial(setattr, stop_flag, "value", number)))
        with suppress(RuntimeError):  # the system may refuse a thread
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
    """Let Ctrl-C stop long kernels during the `with` block, in programs that use the Python API.

    If the program has its own handler for Ctrl-C, nothing is changed.
    """
    is_default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with signals_as_interrupts((signal.SIGINT,)) if is_default else nullcontext():
        yield


@contextmanager
def deferrable_interrupts() -> Iterator[Callable[[], None]]:
    """Yield a function; from its call on, signals wait until the end of the `with` block.

    There, the handler that was set before handles the first of them, and then KeyboardInterrupt is raised. So files
    that belong together get their final names together.
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
    """Return an executor whose threads have all started. Raises RuntimeError if a thread cannot be started.

    Signals wait meanwhile: an interrupt while a thread starts would lose the thread, and the process would wait for
    this thread when it ends. num: the number of threads. name: the beginning of their names.
    """
    from concurrent.futures import ThreadPoolExecutor

    with deferrable_interrupts() as defer:
        defer()
        threads = ThreadPoolExecutor(num, name)
        all_started = threading.Barrier(num)
        try:
            waiting = [threads.submit(all_started.wait) for _ in range(num)]
        except RuntimeError:
            all_started.abort()  # otherwise, threads that have started would wait for ever
            raise
        for started in waiting:
            started.result()
    return threads


def result_of(running: Future[Result]) -> Result:
    """Wait for the result of a future, and return it, or raise its error. The main thread handles signals meanwhile.

    A signal that comes just before a thread falls asleep does not wake the thread. So it only sleeps for a short while.
    """
    from concurrent.futures import wait

    while not running.done():
        wait([running], timeout=_LONGEST_SLEEP_S)
    return running.result()


def interrupted_status(error: BaseException) -> int:
    """Return the exit status of an interrupted program, as shells count: 130 after Ctrl-C, 143 after SIGTERM.

    error: the KeyboardInterrupt, with the number of the signal if it is known.
    """
    numbers = [number for number in error.args if isinstance(number, int)]
    return 128 + int((numbers or [signal.SIGINT])[0])


def exit_on_signals(status: int) -> None:
    """Let each further signal end this process at once with a status. Call this when all work is cleaned up."""
    # CPython ends by SIGINT, whatever the exit status, if a KeyboardInterrupt has left code that was compiled from
    # text, as the code of dataclasses is during an import. CPython forgets that once other code from text has run.
    eval("None")  # noqa: S307
    _handle(lambda number, frame: os._exit(status))
    # Python removes the handlers of signals a while before the process ends. From then on, signals are ignored.
    atexit.register(_handle, signal.SIG_IGN)


def _handle(
    handler: Callable[[int, FrameType | None], None] | signal.Handlers, numbers: Sequence[signal.Signals] = _SIGNALS
) -> dict[int, Any]:
    """Set a handler for each of some signals, except for ignored signals. Returns the previous handlers, by signal."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    heeded = [number for number in numbers if signal.getsignal(number) not in (signal.SIG_IGN, None)]
    return {number: signal.signal(number, handler) for number in heeded}


def _restore(handlers: dict[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)
