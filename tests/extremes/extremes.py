"""Inputs at the edge of what is legal, each with the error that is allowed there.

Tests check them, and docs/benchmarks/numerics.md sums them up.

A module `tests/extremes/test_*.py` holds one `Section`; its rows are both the tests and, measured over more random
cases, the table that `python tests/extremes/page.py` writes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from renderer.draw import SplatRasterizer

Random = np.random.Generator
Measure = Callable[[int], float]

# Random cases of each extreme: few in the tests, more for the page.
CASES_IN_TESTS = 20
CASES_ON_PAGE = 400


@dataclass(frozen=True)
class Extreme:
    """One row: an extreme input and the worst error on it.

    name: the input, in a few words. method: what makes it safe. quantity: what `measure` returns, with its unit, such
    as "relative error". bound: the most it may be.
    measure: returns the worst of a number of random cases, from a seed of its own: the same on every run of a machine.
    """

    name: str
    method: str
    quantity: str
    bound: float
    measure: Measure

    def __str__(self) -> str:
        return self.name

    def check(self) -> None:
        """Raise AssertionError if the error is above the bound, or not a number."""
        worst = self.measure(CASES_IN_TESTS)
        assert not math.isnan(worst), f"{self.name}: the {self.quantity} is not a number"
        assert worst <= self.bound, f"{self.name}: {self.quantity} {worst:.3g}, not at most {self.bound:g}"


def worst_of(error: Callable[[Random, int], float]) -> Measure:
    """Return the measure of the largest of random cases. error: of a case, by its random numbers and its number."""
    return lambda num_cases: max(error(np.random.default_rng(case), case) for case in range(num_cases))


def worst_drawn(error: Callable[[SplatRasterizer, Random, int], float]) -> Measure:
    """Return the measure of the largest of random cases, as `worst_of`, that a rasteriser draws."""

    def measure(num_cases: int) -> float:
        with SplatRasterizer() as gl:
            return worst_of(partial(error, gl))(num_cases)

    return measure


@dataclass(frozen=True)
class Section:
    """One heading of the page. notes: a paragraph of Markdown below its table, or nothing."""

    title: str
    extremes: tuple[Extreme, ...]
    notes: str = ""
