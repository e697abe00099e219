"""Counts in messages have the right plural."""

from __future__ import annotations

from renderer.scene import counted, pluralize_range


def test_counted() -> None:
    assert [counted(num, "brick") for num in (0, 1, 1000)] == ["0 bricks", "1 brick", "1000 bricks"]


def test_pluralize_range() -> None:
    found = [pluralize_range(nums, "splat") for nums in ([1, 1], [7], [0, 1, 0], [3, 9, 1])]
    assert found == ["1 splat", "7 splats", "0 to 1 splat", "1 to 9 splats"]
