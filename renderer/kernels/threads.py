"""A pool of threads for kernels, which run side by side because they release the interpreter's lock."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from typing import Any, TypeVar

import numpy.typing as npt

from renderer.system import result_of, start_threads

# The least number of pixels for a thread: drawing fewer pixels takes less time than starting the thread.
MIN_PIXELS_PER_THREAD = 1 << 15

Item = TypeVar("Item")
Result = TypeVar("Result")
Array = npt.NDArray[Any]


class ThreadPool:
    """A pool of threads that work on items side by side. With one thread, the calling thread works alone.

    A `with` block or `release` ends the threads.

    If the work on an item raises an exception, the methods raise it, and items that no thread has started are dropped.
    """

    def __init__(self, num: int = 1) -> None:
        self.num = num
        self._pool = start_threads(num, "hsplat") if num > 1 else None

    def __enter__(self) -> ThreadPool:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def release(self) -> None:
        """End the threads. Items that no thread has started, which an interrupt may leave behind, are dropped."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def map(self, work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """Return `work(item)` for all items, in their order."""
        return list(self.each(work, items))

    def each(self, work: Callable[[Item], Result], items: Iterable[Item]) -> Generator[Result, None, None]:
        """Yield `work(item)` for all items, in their order; when closed, drop the items that no thread has started."""
        if self._pool is None:
            yield from map(work, items)
            return
        running = [self._pool.submit(work, item) for item in items]
        try:
            while running:
                yield result_of(running.pop(0))
        finally:
            for each in running:
                each.cancel()

    def for_rows(self, work: Callable[[int, int], object], pixels: Array) -> None:
        """Divide the rows of an image into parts, at most one for each thread, and call `work` for each part.

        work: a function of the first row of a part, and of the row after its last one. pixels: [h, w, ...], the image.
        """
        num = len(pixels)
        num_parts = max(1, min(self.num, num // -(-MIN_PIXELS_PER_THREAD // pixels.shape[1])))
        ends = [num * part // num_parts for part in range(num_parts + 1)]
        self.map(lambda part: work(ends[part], ends[part + 1]), range(num_parts))
