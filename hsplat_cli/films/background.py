"""Run tasks in a background thread: frames are encoded and written while the next one is drawn."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Result = TypeVar("Result")


def run_overlapped(tasks: Iterable[Callable[[], Result]]) -> Generator[Result, None, None]:
    """Yield what tasks return, in order; one runs in a thread while the next is made, never two at a time.

    A task that has started is finished before an error in making the next one is raised, so a frame that was drawn is
    kept. What a task raises comes when the next one is made. Close the generator if not all results are taken.
    """
    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="hsplat-background") as thread:
        thread.submit(bool).result()  # an interrupt while the thread starts would lose its task
        running: Future[Result] | None = None
        for task in tasks:
            results = [] if running is None else [running.result()]
            running = thread.submit(task)
            yield from results
        if running is not None:
            yield running.result()
