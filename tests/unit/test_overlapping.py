"""Work on an item runs while the next item is made; whatever ends the items, those that were made are worked on."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from renderer.system import overlap

LONGEST_S = 30.0  # until a thread that waits is taken for stuck
NUM = 4


def test_work_runs_while_the_next_item_is_made() -> None:
    made, begun = [[threading.Event() for _ in range(NUM)] for _ in range(2)]

    def items() -> Iterator[int]:
        for number in range(NUM):
            if number:
                assert begun[number - 1].wait(LONGEST_S), "the work on the item before has begun"
            made[number].set()
            yield number

    def work(number: int) -> int:
        begun[number].set()
        assert number + 1 == NUM or made[number + 1].wait(LONGEST_S), "the next item is made meanwhile"
        return 10 * number

    assert [*overlap(items(), work)] == [0, 10, 20, 30]


@pytest.mark.parametrize("error", [ValueError(), KeyboardInterrupt()])
def test_items_that_were_made_come_before_the_error_of_the_next(error: BaseException) -> None:
    def items() -> Iterator[int]:
        yield from range(NUM)
        raise error

    results = overlap(items(), str)
    assert [next(results) for _ in range(NUM)] == ["0", "1", "2", "3"]
    with pytest.raises(type(error)):
        next(results)


def test_work_that_fails_gets_no_further_item() -> None:
    worked = []

    def work(number: int) -> None:
        worked.append(number)
        if number == 1:
            raise ValueError("of the second item")

    with pytest.raises(ValueError, match="of the second item"):
        [*overlap(range(NUM), work)]
    assert worked == [0, 1]


def test_closing_waits_for_the_work_that_has_begun() -> None:
    worked, closes = list[int](), threading.Event()

    def work(number: int) -> int:
        if number == 1:
            assert closes.wait(LONGEST_S)
        worked.append(number)
        return number

    results = overlap(range(NUM), work)
    assert next(results) == 0
    threading.Timer(0.05, closes.set).start()
    results.close()
    assert worked == [0, 1]
