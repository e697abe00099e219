"""The search over frames: the coarsest tolerance that is good enough on all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import pytest
from hypothesis import given, strategies as st

from renderer.study.tolerance_search import coarsest_tolerance, two_digit_numbers

RUNGS = [float(f"{digit}e{exponent}") for exponent in range(1, -5, -1) for digit in (5, 2, 1)]


class Film:
    """Stands in for Trials: a frame is good enough up to its own limit."""

    def __init__(self, limits: Sequence[float]) -> None:
        self._limits = limits
        self.drawn: list[tuple[float, int]] = []

    def first_bad(self, tolerance: float, frames: Sequence[int]) -> int | None:
        for frame in frames:
            self.drawn.append((tolerance, frame))
            if tolerance > self._limits[frame]:
                return frame
        return None


def search(film: Film, probes: Sequence[int], checks: Sequence[int]) -> float | None:
    return coarsest_tolerance(cast(Any, film), RUNGS, probes, checks)


@given(st.lists(st.floats(2e-4, 40), min_size=6, max_size=6))
def test_no_frame_is_forgotten(limits: list[float]) -> None:
    """Found on the probes, confirmed by the checks: as coarse as the worst of all allows."""
    found = search(Film(limits), [0, 1, 2], [3, 4, 5])
    assert found == max(number for number in two_digit_numbers(50.0, 1e-4) if number <= min(limits))


def test_what_failed_is_tried_first() -> None:
    film = Film([9.0, 0.03, 9.0])
    assert search(film, [0, 1, 2], []) == 0.03
    first_of_each = [frame for i, (tolerance, frame) in enumerate(film.drawn) if tolerance != film.drawn[i - 1][0]]
    assert set(first_of_each[4:]) == {1}  # 50, 20 and 10 fail on frame 0, 5 on frame 1


@pytest.mark.parametrize(
    ("limits", "found"), [([0.0, 5.0], 0.0), ([-1.0, 5.0], None), ([5.0, 0.0], 0.0), ([5.0, -1.0], None)]
)
def test_only_full_resolution_or_not_even_that(limits: list[float], found: float | None) -> None:
    assert search(Film(limits), [0], [1]) == found
