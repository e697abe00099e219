"""Draws several frames at once and yields them in order; of a cluster.

Each frame has a thread that waits for the worker that draws it. Only a few frames are drawn ahead of the one that is
waited for. A frame whose worker is lost is drawn by another one, until MAX_LOSSES workers were lost at it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from itertools import islice

from renderer.job import DrawnFrame

MAX_LOSSES = 3
# Frames that are drawn, or finished and wait for one before them, for each worker.
_WINDOW_PER_WORKER = 4


def draw_ahead(
    numbers: Sequence[int],
    draw: Callable[[int], DrawnFrame],
    threads: ThreadPoolExecutor,
    check: Callable[[], int],
    interval_s: float,
) -> Generator[DrawnFrame, None, None]:
    """Yield these frames in this order; may be closed before its end.

    draw: draws a frame, in one of the threads. check: returns the number of workers; called before each frame, and
    after every interval without one; what it raises ends the film.
    """
    waiting, drawing = iter(numbers), deque[Future[DrawnFrame]]()
    try:
        while True:
            num = _WINDOW_PER_WORKER * max(1, check()) - len(drawing)
            drawing.extend(threads.submit(draw, number) for number in islice(waiting, max(0, num)))
            if not drawing:
                return
            wait([drawing[0]], interval_s)
            if drawing[0].done():
                yield drawing.popleft().result()
    finally:
        for future in drawing:
            future.cancel()
