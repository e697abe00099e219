"""The error schedule."""

from __future__ import annotations

from itertools import pairwise

import pytest

from renderer.scene import ErrorSpec
from renderer.schedule import tolerance_at


def test_one_entry_is_constant() -> None:
    assert [tolerance_at(ErrorSpec(((30, 0.1),)), frame) for frame in (0, 30, 500)] == [0.1, 0.1, 0.1]
    assert tolerance_at(ErrorSpec(((0, 0.0),)), 7) == 0.0


def test_scheduled_frames_are_exact_and_the_ends_are_held() -> None:
    entries = ((10, 0.3), (20, 0.7), (60, 1e-300), (61, 1e300))
    error = ErrorSpec(entries)
    assert [tolerance_at(error, frame) for frame, _ in entries] == [tolerance for _, tolerance in entries]
    assert tolerance_at(error, 0) == 0.3
    assert tolerance_at(error, 1000) == 1e300


def test_between_frames_equal_steps_are_equal_ratios() -> None:
    error = ErrorSpec(((0, 0.5), (60, 0.02)))
    tolerances = [tolerance_at(error, frame) for frame in range(61)]
    ratios = [b / a for a, b in pairwise(tolerances)]
    assert ratios == pytest.approx([(0.02 / 0.5) ** (1 / 60)] * 60, rel=1e-13)
    assert tolerances[30] == pytest.approx(0.1, rel=1e-15)
