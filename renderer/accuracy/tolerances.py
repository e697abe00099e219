"""Choose the tolerances that are worth trying: at each, clearly more is drawn than at the next coarser one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

from renderer.accuracy.truths import spread_evenly
from renderer.scene import MIN_TOLERANCE

# A cut with less work, in cells or samples, is too blurred to be of use.
_MIN_CELLS = 64
# A cut with less than this share of the work of the finest cut is too blurred to be of use.
_MIN_CELL_SHARE = 1e-3
# From one tolerance of a sweep to the next finer one, the work grows by more than this factor.
_MIN_GROWTH = 1.1
# From one tolerance of a search to the next finer one, the work grows by more than this factor.
_MIN_DISTINCT_GROWTH = 1.03
# A cut with more than this share of the work of the finest cut is as good as the finest.
_NEARLY_ALL = 0.9
# The number of powers of ten that round tolerances span. The errors of a pyramid, in float16, span fewer.
_MAX_DECADES = 12

# A function that returns the work of drawing at a tolerance, in cells or samples, as `Primitive.work` of
# `renderer.frame.primitives`.
Work = Callable[[float], float]


def tolerance_ladder(largest_error: float, work: Work, step: float) -> Sequence[float]:
    """Return falling tolerances of two digits, which differ by a factor of `step` or a little more; the last is 0."""
    candidates = [*distinct_tolerances(largest_error, work)] or [1.0]  # there are none if nothing is visible
    found = candidates[:1]
    for tolerance in two_digit_numbers(candidates[0], candidates[-1])[1:]:
        if found[-1] >= step * tolerance:
            found.append(tolerance)
    return [*found, 0.0]


def round_tolerances(largest_error: float) -> Iterator[float]:
    """Yield falling tolerances of 1, 2 and 5 times powers of ten; at the first, the whole volume is just one cell.

    They end after 12 powers of ten. A volume without error is one cell at any tolerance: only 1 is yielded.
    largest_error: the error of the whole volume as a single cell.
    """
    top = largest_error
    if top == 0:
        yield 1.0
        return
    exponent = math.floor(math.log10(top)) + 1
    tolerances = [float(f"{digit}e{exponent - i}") for i in range(_MAX_DECADES) for digit in (5, 2, 1)]
    num_above = sum(tolerance > top for tolerance in tolerances)
    yield from tolerances[num_above - 1 :]


def distinct_tolerances(largest_error: float, work: Work, growth: float = _MIN_DISTINCT_GROWTH) -> Iterator[float]:
    """Yield the round tolerances at which clearly more is drawn than at the one before, until nearly all is drawn."""
    before, everything = 0.0, work(MIN_TOLERANCE)  # smaller than any error that a pyramid can hold
    for tolerance in round_tolerances(largest_error):
        amount = work(tolerance)
        if amount > growth * before:
            yield tolerance
            before = amount
        if growth * before >= everything:
            return


def spread_tolerances(largest_error: float, work: Work, most: int) -> tuple[float, ...]:
    """Return at most `most` falling tolerances that show how a film improves; the last is 0."""
    if largest_error == 0:
        return 1.0, 0.0
    everything = work(0.0)
    fewest, nearly_all = max(_MIN_CELLS, _MIN_CELL_SHARE * everything), _NEARLY_ALL * everything
    distinct = distinct_tolerances(largest_error, work, _MIN_GROWTH)
    found = [tolerance for tolerance in distinct if fewest <= work(tolerance) <= nearly_all]
    return (*spread_evenly(found, most - 1, is_loop=False), 0.0)


def two_digit_numbers(coarsest: float, finest: float) -> list[float]:
    """Return the numbers of two significant digits from `coarsest` down to `finest`, both > 0: at most 11 % apart.

    Such a tolerance can be written into a scene without rounding it.
    """
    low, high = math.floor(math.log10(finest)), math.floor(math.log10(coarsest))
    numbers = (
        float(f"{digits}e{exponent - 1}") for exponent in range(high, low - 1, -1) for digits in range(99, 9, -1)
    )
    return [number for number in numbers if finest <= number <= coarsest]
