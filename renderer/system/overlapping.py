"""Work on one item in a thread while the next item is made."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from typing import TYPE_CHECKING, TypeVar

from renderer.system.interrupts import result_of, start_threads

if TYPE_CHECKING:
    from concurrent.futures import Future

Item = TypeVar("Item")
Result = TypeVar("Result")


def overlap(items: Iterable[Item], work: Callable[[Item], Result]) -> Generator[Result, None, None]:
    """Yield the result of `work` for each item, in order. `work` runs in its own thread while the next item is made.

    If making an item raises an error, the results of all items before it are yielded first. If `work` fails, it gets no
    further item. Closing the generator waits for the work that has begun.
    """
    with start_threads(1, "hsplat-background") as thread:
        begun: list[Future[Result]] = []
        try:
            for item in items:
                begun.append(thread.submit(_work_after, begun[-1:], work, item))
                if len(begun) > 1:
                    result = result_of(begun[0])
                    del begun[0]
                    yield result
        except GeneratorExit:
            raise
        except BaseException:
            for each in begun:
                if each.exception() is None:
                    yield each.result()
            raise
        for each in begun:
            yield result_of(each)


def _work_after(before: Sequence[Future[Result]], work: Callable[[Item], Result], item: Item) -> Result:
    """Return the result of `work` for an item. If the work on the item before has failed, raise that error instead."""
    for each in before:
        each.result()
    return work(item)
