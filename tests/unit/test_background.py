"""Tasks in the background run in order, one at a time, and are finished even when drawing fails."""

from __future__ import annotations

import threading

import pytest

from renderer.job.background import BackgroundThread

LONGEST_S = 30.0  # until a thread that waits is taken for stuck


def test_results_come_in_order_of_their_tasks() -> None:
    with BackgroundThread[int]() as thread:
        results = [result for k in range(7) for result in thread.run(lambda k=k: k)]
        assert [*results, *thread.wait()] == list(range(7))
        assert thread.wait() == []


def test_a_task_runs_while_the_next_one_is_made() -> None:
    is_made, threads = threading.Event(), set()

    def first() -> bool:
        threads.add(threading.current_thread())
        return is_made.wait(LONGEST_S)

    with BackgroundThread[bool]() as thread:
        assert thread.run(first) == []
        threads.add(threading.current_thread())
        is_made.set()
        assert thread.run(lambda: True) == [True]
    assert len(threads) == 2


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_task_that_runs_is_finished_however_the_block_ends(error: type[BaseException]) -> None:
    """The frame that was drawn is kept when drawing the one after it is interrupted."""
    done: list[int] = []
    is_left = threading.Event()

    def first() -> None:
        is_left.wait(LONGEST_S)
        done.append(1)

    def work() -> None:
        with BackgroundThread[None]() as thread:
            thread.run(first)
            is_left.set()
            raise error

    with pytest.raises(error):
        work()
    assert done == [1]


def test_what_a_task_raises_comes_with_the_next_one() -> None:
    """Which is not started any more."""
    done: list[int] = []

    def fails() -> None:
        raise InterruptedError

    with BackgroundThread[None]() as thread:
        thread.run(lambda: done.append(1))
        thread.run(fails)
        with pytest.raises(InterruptedError):
            thread.run(lambda: done.append(2))
    assert done == [1]
