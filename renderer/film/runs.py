"""Group consecutive numbers, such as frames, into ranges."""

from __future__ import annotations

from collections.abc import Iterable


def consecutive_ranges(numbers: Iterable[int]) -> list[tuple[int, int]]:
    """Return ascending numbers as ranges without gaps: pairs of the first number, and the number after the last one."""
    found: list[tuple[int, int]] = []
    for number in numbers:
        if found and found[-1][1] == number:
            found[-1] = found[-1][0], number + 1
        else:
            found.append((number, number + 1))
    return found
