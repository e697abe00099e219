"""Numbers of things, and things that may be many, as they stand in messages."""

from __future__ import annotations

from collections.abc import Sequence


def counted(num: int, one: str) -> str:
    """`1 frame`, `2 frames`."""
    return f"{num} {one if num == 1 else f'{one}s'}"


def pluralize_range(nums: Sequence[int], one: str) -> str:
    """`190 bricks`, or `1 to 3 bricks`, from the smallest to the largest."""
    low, high = min(nums), max(nums)
    return counted(high, one) if low == high else f"{low} to {counted(high, one)}"


def first_few(items: Sequence[object], most: int, between: str = ", ") -> str:
    """`a, b and 2 more`."""
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return between.join(map(str, items[:most])) + more
