"""Frames are drawn ahead by several threads, and come in order."""

from __future__ import annotations

import random
import threading
import time
from concurrent.futures import ThreadPoolExecutor

from hsplat_cli.executors import draw_ahead
from renderer.film import Picture
from renderer.job import DrawnFrame
from renderer.record import FrameRecord


def test_results_are_in_order_and_few_frames_are_drawn_ahead() -> None:
    """Workers finish in random order; the first frame is slow. A film that is left draws no more frames."""
    numbers, num_workers, seconds = [*range(100, 140), 7, 7], 3, random.Random(5).random
    started, first_ends = list[int](), threading.Event()

    def draw(number: int) -> DrawnFrame:
        started.append(number)
        if len(started) == 1:
            assert first_ends.wait(60)
        time.sleep(0.002 * seconds())
        return DrawnFrame(FrameRecord(number, 0.0, 1, 1, {}), {0: Picture(content=b"")})

    def check() -> int:
        assert len(started) <= num_yielded + 4 * num_workers
        if len(started) == 4 * num_workers:
            first_ends.set()
        return num_workers

    with ThreadPoolExecutor(num_workers) as threads:
        num_yielded = 0
        for _ in range(2):
            drawing = draw_ahead(numbers, draw, threads, check, window=4)
            for result, number in zip(drawing, numbers[:-num_workers], strict=False):
                num_yielded += 1
                assert result.record.frame == number
            drawing.close()
            num_yielded, first = 0, len(started)
            assert first < len(numbers) + num_workers
            started.clear()
