"""Tests of the tolerances that are tried, and of the search for the coarsest that is good enough on all frames."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from renderer.pyramid import Pyramid, build_pyramid, cut_pyramid, root_error
from renderer.scene import ControlPoint, ErrorSpec, PyramidSpec, TransferSpec
from renderer.study.tolerance_search import (
    coarsest_tolerance,
    distinct_tolerances,
    find_coarsest_passing,
    round_tolerances,
    spread_tolerances,
    two_digit_numbers,
)
from renderer.transfer import make_transfer_function
from renderer.volume import make_volume


@pytest.fixture(scope="module")
def pyramid() -> Pyramid:
    values = np.random.default_rng(3).integers(0, 256, (24, 32, 40), dtype=np.uint8)
    values[:, :, :20] //= 8  # half of it nearly even, so that errors differ
    return _pyramid(values)


def _pyramid(values: np.ndarray) -> Pyramid:
    points = ControlPoint(0.0, (1.0, 1.0, 1.0), 0.01), ControlPoint(255.0, (1.0, 0.0, 0.0), 0.5)
    transfer = make_transfer_function(TransferSpec(points), 1.0)
    return build_pyramid(make_volume(values, np.eye(4), "test"), transfer, spec=PyramidSpec(), error=ErrorSpec())


def test_round_tolerances_begin_with_a_single_cell_and_fall(pyramid: Pyramid) -> None:
    tolerances = list(round_tolerances(pyramid))
    assert len(cut_pyramid(pyramid, tolerances[0])) == 1
    assert len(cut_pyramid(pyramid, tolerances[1])) > 1
    assert tolerances[1] <= root_error(pyramid) < tolerances[0]
    assert all(1.99 < a / b < 2.51 for a, b in pairwise(tolerances))
    assert {f"{tolerance:.0e}"[0] for tolerance in tolerances} == {"1", "2", "5"}


def test_an_even_volume_is_one_cell_or_all_voxels() -> None:
    pyramid = _pyramid(np.full((8, 8, 8), 100, np.uint8))
    assert list(round_tolerances(pyramid)) == list(distinct_tolerances(pyramid, _counter(pyramid))) == [1.0]
    assert spread_tolerances(pyramid, _counter(pyramid), 10) == (1.0, 0.0)


def test_distinct_tolerances_end_where_the_cut_is_nearly_the_finest(pyramid: Pyramid) -> None:
    counts = [len(cut_pyramid(pyramid, tolerance)) for tolerance in distinct_tolerances(pyramid, _counter(pyramid))]
    assert all(b > 1.03 * a for a, b in pairwise(counts))
    assert counts[0] == 1 and counts[-1] > 0.97 * len(cut_pyramid(pyramid, 1e-300))


def test_spread_tolerances_fall_and_their_cuts_grow(pyramid: Pyramid) -> None:
    for most in (3, 10):
        tolerances = spread_tolerances(pyramid, _counter(pyramid), most)
        assert 2 <= len(tolerances) <= most
        assert tolerances[-1] == 0 and list(tolerances) == sorted(tolerances, reverse=True)
        counts = [len(cut_pyramid(pyramid, tolerance)) for tolerance in tolerances]
        assert all(b > a for a, b in pairwise(counts))


def _counter(pyramid: Pyramid):  # type: ignore[no-untyped-def]
    return lambda tolerance: len(cut_pyramid(pyramid, tolerance))


def test_two_digit_numbers_are_exact_in_text() -> None:
    numbers = two_digit_numbers(2.0, 0.05)
    assert numbers[0] == 2.0 and numbers[-1] == 0.05
    assert all(number == float(f"{number:.1e}") for number in numbers)
    assert all(1 < a / b < 1.11 for a, b in pairwise(numbers))


CANDIDATES = [float(f"{digit}e{exponent}") for exponent in range(1, -7, -1) for digit in (5, 2, 1)]


@given(st.floats(2e-6, 40))
def test_the_coarsest_passing_tolerance_of_two_digits_is_found(limit: float) -> None:
    tried: list[float] = []

    def is_good(tolerance: float) -> bool:
        tried.append(tolerance)
        return tolerance <= limit

    found = find_coarsest_passing(is_good, CANDIDATES)
    assert found is not None and found <= limit
    assert found == max(number for number in two_digit_numbers(50.0, 1e-6) if number <= limit)
    assert len(tried) == len(set(tried)) <= len(CANDIDATES) + 6


def test_a_coarse_tolerance_that_passes_is_found_before_finer_ones_that_fail() -> None:
    assert find_coarsest_passing(lambda tolerance: tolerance == 1.0 or tolerance < 0.01, CANDIDATES) == 1.0
    assert find_coarsest_passing(lambda _: True, CANDIDATES) == CANDIDATES[0]
    assert find_coarsest_passing(lambda _: True, []) == 0.0


class Film:
    """Each frame passes up to its own limit."""

    def __init__(self, limits: Sequence[float]) -> None:
        self._limits = limits
        self.drawn: list[tuple[float, int]] = []

    def is_good_on(self, tolerance: float, frame: int) -> bool:
        self.drawn.append((tolerance, frame))
        return tolerance <= self._limits[frame]


def search(film: Film, probes: Sequence[int], checks: Sequence[int]) -> float | None:
    return coarsest_tolerance(film.is_good_on, CANDIDATES, probes, checks)


@given(st.lists(st.floats(2e-4, 40), min_size=6, max_size=6))
def test_probes_and_checks_limit_the_tolerance(limits: list[float]) -> None:
    found = search(Film(limits), [0, 1, 2], [3, 4, 5])
    assert found == max(number for number in two_digit_numbers(50.0, 1e-6) if number <= min(limits))


def test_a_frame_that_failed_is_tried_first() -> None:
    film = Film([9.0, 0.03, 9.0])
    assert search(film, [0, 1, 2], []) == 0.03
    first_of_each = [frame for i, (tolerance, frame) in enumerate(film.drawn) if tolerance != film.drawn[i - 1][0]]
    assert set(first_of_each[4:]) == {1}  # 50, 20 and 10 fail on frame 0, 5 on frame 1


@pytest.mark.parametrize(
    ("limits", "found"), [([0.0, 5.0], 0.0), ([-1.0, 5.0], None), ([5.0, 0.0], 0.0), ([5.0, -1.0], None)]
)
def test_frames_may_need_full_resolution_or_more(limits: list[float], found: float | None) -> None:
    assert search(Film(limits), [0], [1]) == found
