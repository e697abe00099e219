"""Tolerances of every size, constant and by frame."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from extremes import Extreme, Measure, Random, Section, worst_of
from film_stages import scheduled

from renderer.scene import ErrorSpec, tolerance_at

Keys = tuple[tuple[int, float], ...]

MAX_FRAME = 999_999


def whole_range(rng: Random) -> Keys:
    """Return two to five keys anywhere in the range of frames and of tolerances, its ends among them."""
    frames = np.unique(rng.integers(0, MAX_FRAME, 5))
    return tuple((int(frame), draw_tolerance(rng)) for frame in frames)


def draw_tolerance(rng: Random) -> float:
    return float(rng.choice([1e-300, 1e300, 10 ** rng.uniform(-300, 300)]))


def usual(rng: Random) -> Keys:
    """Return keys over five decades, as schedules have them."""
    return tuple((frame, 10 ** rng.uniform(-4, 1)) for frame in (0, 50, 120))


def almost_equal(rng: Random) -> Keys:
    """Return two keys that differ by some units in the last place, a million frames apart."""
    first = 10 ** rng.uniform(-300, 299)
    return (0, first), (MAX_FRAME, first * (1 + rng.integers(-20, 20) * 2.0**-52))


def relative_error(schedules: Callable[[Random], Keys]) -> Measure:
    """Measure a tolerance between keys against the interpolation in 50 digits."""

    def error(rng: Random, _: int) -> float:
        keys, worst = schedules(rng), 0.0
        with mpmath.workdps(50):
            for (start, before), (end, after) in pairwise(keys):
                frame = int(rng.integers(start, end + 1))
                share = mpmath.mpf(frame - start) / (end - start)
                expected = mpmath.mpf(before) ** (1 - share) * mpmath.mpf(after) ** share
                worst = max(worst, float(abs(tolerance_at(ErrorSpec(scheduled(*keys)), frame) / expected - 1)))
        return worst

    return worst_of(error)


def turning_back(num_cases: int) -> float:
    """Return how many neighbouring frames go the other way than their keys do."""
    rng, wrong = np.random.default_rng(8), 0
    for case in range(num_cases):
        keys = (whole_range, usual, almost_equal)[case % 3](rng)
        error = ErrorSpec(scheduled(*keys))
        for (start, before), (end, after) in pairwise(keys):
            first = int(rng.integers(start, max(start + 1, end - 200)))
            there = [tolerance_at(error, frame) for frame in range(first, min(end, first + 200) + 1)]
            steps = np.sign(np.diff(there)) * np.sign(after - before)
            wrong += int(np.count_nonzero(steps < 0))
            wrong += int(not min(before, after) <= min(there) <= max(there) <= max(before, after))
    return float(wrong)


LOGARITHM = "exp of the shared rise of the logarithm, half of it at a time"

SECTION = Section(
    "Schedules",
    (
        Extreme("keys from 1e-300 to 1e300", LOGARITHM, "relative error", 1e-12, relative_error(whole_range)),
        Extreme("keys over five decades", LOGARITHM, "relative error", 1e-14, relative_error(usual)),
        Extreme(
            "keys apart by some ulp", "log1p of the difference", "relative error", 1e-15, relative_error(almost_equal)
        ),
        Extreme("a million frames, any keys", "monotone step by step", "frames that turn back", 0, turning_back),
    ),
)


@pytest.mark.parametrize("extreme", SECTION.extremes, ids=str)
def test_extreme(extreme: Extreme) -> None:
    extreme.check()
