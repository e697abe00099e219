"""Frames are packed, written and encoded behind the drawing: in a thread, while the next one is drawn."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Result = TypeVar("Result")


def run_sequentially(tasks: Iterable[Callable[[], Result]]) -> Generator[Result, None, None]:
    """What tasks return, each done before the next is made ready: where it counts how long either takes."""
    for task in tasks:
        yield task()


def run_overlapped(tasks: Iterable[Callable[[], Result]]) -> Generator[Result, None, None]:
    """What tasks return, in their order, of which one is done while the next is made ready; never two at a time.

    A task that has begun is finished before anybody hears that the one after it could not be made: what was drawn is
    kept, whatever ends the drawing. What a task raises comes when the one after it is ready. To be closed where not all
    results are taken.
    """
    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="hsplat-behind") as thread:
        thread.submit(bool).result()  # an interrupt while a thread begins would leave its task to itself
        at_work: Future[Result] | None = None
        for task in tasks:
            results = [] if at_work is None else [at_work.result()]
            at_work = thread.submit(task)
            yield from results
        if at_work is not None:
            yield at_work.result()
