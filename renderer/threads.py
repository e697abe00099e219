"""Threads that share the work on one picture: compiled loops let go of the interpreter's lock."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

Item = TypeVar("Item")
Array = npt.NDArray[Any]


class Threads:
    """So many, of which one does it all by itself. Whoever made them calls `release`."""

    def __init__(self, num: int = 1) -> None:
        self.num = num
        self._pool = ThreadPoolExecutor(num, thread_name_prefix="hsplat-bricks") if num > 1 else None

    def release(self) -> None:
        """End them."""
        if self._pool is not None:
            self._pool.shutdown()

    def each(self, work: Callable[[Item], object], items: Iterable[Item]) -> None:
        """Work on all items; raises what one of them raises."""
        for _ in map(work, items) if self._pool is None else self._pool.map(work, items):
            pass

    def for_ranges(self, work: Callable[[int, int], object], num: int, least: int) -> None:
        """Call `work` with the ends of parts of range(num), of at least so many each, as far as there are so many."""
        num_parts = max(1, min(self.num, num // least))
        ends = [num * part // num_parts for part in range(num_parts + 1)]
        self.each(lambda part: work(ends[part], ends[part + 1]), range(num_parts))

    def map_concatenated(self, make: Callable[[Array], Array], items: Array, least: int) -> Array:
        """`make(items)`, which is made of items [n, ...] one by one, in parts of at least so many."""
        num_parts = max(1, min(self.num, len(items) // least))
        if self._pool is None or num_parts == 1:
            return make(items)
        return np.concatenate(list(self._pool.map(make, np.array_split(items, num_parts))))
