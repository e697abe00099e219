"""Tasks in the background run in order, one at a time, and are finished even when drawing fails."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import closing

import pytest

from hsplat_cli.films.background import run_overlapped

LONGEST_S = 30.0  # until a thread that waits is taken for stuck


def test_results_come_in_order_of_their_tasks() -> None:
    """As many as there are tasks, of none none."""
    assert list(run_overlapped(lambda k=k: k for k in range(7))) == list(range(7))
    assert list(run_overlapped(iter(()))) == []


def test_the_next_is_made_ready_while_one_is_done() -> None:
    """A task that waits for the next one to be made ready ends, in another thread than the one that makes tasks."""
    is_ready, threads = threading.Event(), set()

    def first() -> bool:
        threads.add(threading.current_thread())
        return is_ready.wait(LONGEST_S)

    def tasks() -> Iterator[Callable[[], bool]]:
        yield first
        threads.add(threading.current_thread())
        is_ready.set()
        yield lambda: True

    assert list(run_overlapped(tasks())) == [True, True]
    assert len(threads) == 2


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_what_has_begun_is_finished_where_the_next_cannot_be_made(error: type[BaseException]) -> None:
    """The frame that was drawn is kept when drawing the one after it is interrupted."""
    done: list[int] = []
    is_left = threading.Event()

    def first() -> None:
        is_left.wait(LONGEST_S)
        done.append(1)

    def tasks() -> Iterator[Callable[[], None]]:
        yield first
        is_left.set()
        raise error

    with pytest.raises(error):
        list(run_overlapped(tasks()))
    assert done == [1]


def test_what_a_task_raises_comes_and_ends_the_rest() -> None:
    """When the next is ready, which is not begun any more."""
    done: list[int] = []

    def fails() -> None:
        raise InterruptedError

    with pytest.raises(InterruptedError):
        list(run_overlapped([lambda: done.append(1), fails, lambda: done.append(2)]))
    assert done == [1]


def test_closing_waits_for_what_has_begun() -> None:
    """Nobody who closes what a task writes to does so under its hands; what has not begun is left."""
    done: list[int] = []
    is_left = threading.Event()

    def second() -> None:
        is_left.wait(LONGEST_S)
        done.append(2)

    with closing(run_overlapped([lambda: done.append(1), second, lambda: done.append(3)])) as results:
        next(results)
        is_left.set()
    assert done == [1, 2]
