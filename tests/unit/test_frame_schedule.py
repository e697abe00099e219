"""Workers get few frames ahead of the one that is waited for, and results come back in order."""

from __future__ import annotations

import random

from hsplat_cli.executors import FrameResult
from hsplat_cli.executors.schedule import FrameSchedule
from renderer.film import Picture


def result_of(number: int) -> FrameResult:
    return FrameResult(number, Picture(png=b""), {})


def test_results_are_in_order_and_few_frames_are_drawn_ahead() -> None:
    """Workers finish in random order; the first frame is slow."""
    schedule, workers, choose = FrameSchedule[str](), ["a", "b", "c"], random.Random(5).choice
    numbers, started = [*range(100, 140), 7, 7], list[int]()
    num_yielded = 0

    def assign() -> None:
        while assigned := schedule.assign(workers):
            started.append(assigned[1].number)

    def receive() -> None:
        assert max(map(len, schedule.tasks.values())) <= 2
        assert len(started) <= num_yielded + 4 * len(workers)
        busy = [worker for worker in workers if schedule.tasks[worker]]
        worker = choose([each for each in busy if schedule.tasks[each][0].number != numbers[0]] or busy)
        task = schedule.tasks[worker][0]
        schedule.finish(worker, task, result_of(task.number))

    for result in schedule.draw(numbers, assign, receive):
        assert result.number == numbers[num_yielded]
        num_yielded += 1
    assert (num_yielded, started) == (len(numbers), numbers)
