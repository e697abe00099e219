"""A pool of threads shares the items or ranges of a task."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from renderer.kernels import ThreadPool
from renderer.system import start_threads

# A thread has at least so many pixels.
MIN_PIXELS_PER_THREAD = 32_768


@pytest.fixture(params=[1, 3])
def threads(request: pytest.FixtureRequest) -> Iterator[ThreadPool]:
    threads = ThreadPool(request.param)
    yield threads
    threads.release()


def test_an_error_in_a_thread_is_raised(threads: ThreadPool) -> None:
    def work(item: int) -> None:
        if item == 2:
            raise KeyError(item)

    with pytest.raises(KeyError):
        threads.map(work, range(4))


@pytest.mark.parametrize(("num", "least", "num_parts"), [(0, 5, 1), (9, 5, 1), (10, 5, 2), (15, 5, 3), (100, 1, 3)])
def test_rows_are_many_enough_and_cover_all(threads: ThreadPool, num: int, least: int, num_parts: int) -> None:
    parts: list[tuple[int, int]] = []
    pixels = np.empty((num, -(-MIN_PIXELS_PER_THREAD // least)))
    threads.for_rows(lambda first, end: parts.append((first, end)), pixels)
    parts.sort()
    assert len(parts) == (num_parts if threads.num == 3 else 1)
    assert [first for first, _ in parts] == [0, *(end for _, end in parts[:-1])]
    assert parts[-1][1] == num
    assert len(parts) == 1 or min(end - first for first, end in parts) >= least


def test_threads_end_where_another_cannot_be_started(monkeypatch: pytest.MonkeyPatch) -> None:
    """They wait for each other, and the process would wait for them."""
    begin, started = threading.Thread.start, list[threading.Thread]()

    def start(thread: threading.Thread) -> None:
        if len(started) == 2:
            raise RuntimeError("can't start new thread")
        started.append(thread)
        begin(thread)

    monkeypatch.setattr(threading.Thread, "start", start)
    with pytest.raises(RuntimeError):
        start_threads(3)
    for thread in started:
        thread.join(timeout=10.0)
    assert not any(thread.is_alive() for thread in started)
