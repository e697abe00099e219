"""Tolerances worth trying: round numbers between the coarsest cut of a pyramid and its finest."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from renderer.pyramid import Pyramid, root_error
from renderer.scene import MIN_TOLERANCE

# How much is drawn at a tolerance, as in `renderer.frame.primitives.Family`: cells, or samples of them.
Work = Callable[[float], float]

# A cut of fewer cells than this, or than this part of the finest, is a blur that nobody asks about.
_FEWEST_CELLS = 64
_MIN_CELL_SHARE = 1e-3
# A tolerance is worth a place of its own when so many times as much is drawn as at the one before.
_LEAST_GROWTH = 1.1
# Between cuts that differ by less a search need not choose.
_MIN_DISTINCT_GROWTH = 1.03
# From here on a cut is as good as the finest.
_NEARLY_ALL = 0.9
# float16 errors span fewer decades; what is below is not there.
_MAX_DECADES = 12


def round_tolerances(pyramid: Pyramid) -> Iterator[float]:
    """1, 2 and 5 times the powers of ten, downward from the first tolerance at which the whole is a single cell.

    Ends after 12 decades. A pyramid whose root has no error is one cell at any tolerance, such as 1.
    """
    top = root_error(pyramid)
    if top == 0:
        yield 1.0
        return
    exponent = math.floor(math.log10(top)) + 1
    rungs = (float(f"{digit}e{exponent - i}") for i in range(_MAX_DECADES) for digit in (5, 2, 1))
    last_above = 0.0
    for rung in rungs:
        if rung > top:
            last_above = rung
            continue
        if last_above:
            yield last_above
            last_above = 0.0
        yield rung


def distinct_tolerances(pyramid: Pyramid, work: Work) -> Iterator[float]:
    """The rungs of the ladder at which clearly more is drawn than at the one before, to where nearly all is."""
    before, everything = 0.0, work(MIN_TOLERANCE)  # below any error that a pyramid can hold
    for tolerance in round_tolerances(pyramid):
        amount = work(tolerance)
        if amount > _MIN_DISTINCT_GROWTH * before:
            yield tolerance
            before = amount
        if _MIN_DISTINCT_GROWTH * before >= everything:
            return


def spread_tolerances(pyramid: Pyramid, work: Work, most: int) -> tuple[float, ...]:
    """At most `most` tolerances, falling, that between them show how a film gets better; the last is 0."""
    if root_error(pyramid) == 0:
        return 1.0, 0.0
    everything = work(0.0)
    fewest = max(_FEWEST_CELLS, _MIN_CELL_SHARE * everything)
    found: list[float] = []
    before = 0.0
    for tolerance in round_tolerances(pyramid):
        amount = work(tolerance)
        if amount > _NEARLY_ALL * everything:
            break
        if amount >= fewest and amount >= _LEAST_GROWTH * before:
            found.append(tolerance)
            before = amount
    return (*_thinned(found, most - 1), 0.0)


def _thinned(items: list[float], most: int) -> list[float]:
    """At most `most` of them, evenly spread, the first and the last included."""
    if len(items) <= most:
        return items
    return [items[round(i * (len(items) - 1) / (most - 1))] for i in range(most)]


def two_digit_numbers(coarsest: float, finest: float) -> list[float]:
    """The numbers of two significant digits from `coarsest` down to `finest`, both > 0: at most 11 % apart.

    A tolerance found among them is the number itself, not one that is rounded when it is written into a scene.
    """
    low, high = math.floor(math.log10(finest)), math.floor(math.log10(coarsest))
    numbers = (
        float(f"{digits}e{exponent - 1}") for exponent in range(high, low - 1, -1) for digits in range(99, 9, -1)
    )
    return [number for number in numbers if finest <= number <= coarsest]
