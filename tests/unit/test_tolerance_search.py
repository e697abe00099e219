"""Which tolerances are tried, and the coarsest one that is good enough."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from renderer.pyramid import Pyramid, build_pyramid, cut_pyramid, root_error
from renderer.scene import ControlPoint, ErrorSpec, PyramidSpec, TransferSpec
from renderer.study.tolerance_search import (
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


def test_the_ladder_starts_with_a_single_cell_and_goes_down(pyramid: Pyramid) -> None:
    rungs = list(round_tolerances(pyramid))
    assert len(cut_pyramid(pyramid, rungs[0])) == 1
    assert len(cut_pyramid(pyramid, rungs[1])) > 1
    assert rungs[1] <= root_error(pyramid) < rungs[0]
    assert all(1.99 < a / b < 2.51 for a, b in pairwise(rungs))
    assert {f"{rung:.0e}"[0] for rung in rungs} == {"1", "2", "5"}


def test_an_even_volume_is_one_cell_or_all_voxels() -> None:
    pyramid = _pyramid(np.full((8, 8, 8), 100, np.uint8))
    assert list(round_tolerances(pyramid)) == list(distinct_tolerances(pyramid, _counter(pyramid))) == [1.0]
    assert spread_tolerances(pyramid, _counter(pyramid), 10) == (1.0, 0.0)


def test_rungs_end_where_the_cut_is_nearly_the_finest(pyramid: Pyramid) -> None:
    counts = [len(cut_pyramid(pyramid, rung)) for rung in distinct_tolerances(pyramid, _counter(pyramid))]
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


def test_two_digit_numbers_are_what_they_are_when_written() -> None:
    numbers = two_digit_numbers(2.0, 0.05)
    assert numbers[0] == 2.0 and numbers[-1] == 0.05
    assert all(number == float(f"{number:.1e}") for number in numbers)
    assert all(1 < a / b < 1.11 for a, b in pairwise(numbers))


RUNGS = [float(f"{digit}e{exponent}") for exponent in range(1, -7, -1) for digit in (5, 2, 1)]


@given(st.floats(2e-6, 40))
def test_the_coarsest_of_two_digits_is_found(limit: float) -> None:
    tried: list[float] = []

    def is_good(tolerance: float) -> bool:
        tried.append(tolerance)
        return tolerance <= limit

    found = find_coarsest_passing(is_good, RUNGS)
    assert found is not None and found <= limit
    assert found == max(number for number in two_digit_numbers(50.0, 1e-6) if number <= limit)
    assert len(tried) == len(set(tried)) <= len(RUNGS) + 6


def test_a_lucky_coarse_tolerance_does_not_hide_behind_a_bad_finer_one() -> None:
    """Not monotonic: the search comes from the coarse side and meets the lucky one first."""
    assert find_coarsest_passing(lambda tolerance: tolerance == 1.0 or tolerance < 0.01, RUNGS) == 1.0


def test_zero_and_nothing() -> None:
    assert find_coarsest_passing(lambda tolerance: tolerance == 0.0, RUNGS) == 0.0
    assert find_coarsest_passing(lambda _: False, RUNGS) is None
    assert find_coarsest_passing(lambda _: True, RUNGS) == RUNGS[0]
    assert find_coarsest_passing(lambda _: True, []) == 0.0
