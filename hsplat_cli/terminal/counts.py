"""Writes counts and lists for messages."""

from __future__ import annotations

from collections.abc import Sequence


def counted(num: int, one: str) -> str:
    """Return `1 frame` or `2 frames`."""
    return f"{num} {one if num == 1 else f'{one}s'}"


def pluralize_range(nums: Sequence[int], one: str) -> str:
    """Return `190 bricks`, or `1 to 3 bricks`, from the smallest to the largest."""
    low, high = min(nums), max(nums)
    return counted(high, one) if low == high else f"{low} to {counted(high, one)}"


def first_few(items: Sequence[object], most: int, between: str = ", ") -> str:
    """Return `a, b and 2 more`, with at most `most` of the items."""
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return between.join(map(str, items[:most])) + more
