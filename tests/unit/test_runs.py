"""Tests of ranges of consecutive numbers."""

from __future__ import annotations

from hypothesis import given, strategies as st

from renderer.film import consecutive_ranges


@given(st.sets(st.integers(0, 40)))
def test_ranges_hold_the_numbers_and_do_not_touch(numbers: set[int]) -> None:
    found = consecutive_ranges(sorted(numbers))
    assert [number for start, stop in found for number in range(start, stop)] == sorted(numbers)
    ends = [end for run in found for end in run]
    assert ends == sorted(set(ends))
