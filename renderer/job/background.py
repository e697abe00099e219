"""Run tasks beside the work of the job: frames are encoded and written while the next one is drawn."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Generic, TypeVar

Result = TypeVar("Result")


class BackgroundThread(contextlib.AbstractContextManager["BackgroundThread[Any]"], Generic[Result]):
    """A thread that runs one task at a time.

    A task that was started is finished before the block ends, however it ends: a frame that was drawn is kept.
    """

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(max_workers=1, thread_name_prefix="hsplat-background")
        self._threads.submit(bool).result()  # an interrupt while the thread starts would lose its task
        self._running: Future[Result] | None = None

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown()

    def run(self, task: Callable[[], Result]) -> list[Result]:
        """Start a task, once the one before is finished; return that one's result, or raise what it raised."""
        results = self.wait()
        self._running = self._threads.submit(task)
        return results

    def wait(self) -> list[Result]:
        """Return the result of the task that runs, if any."""
        running, self._running = self._running, None
        return [] if running is None else [running.result()]
