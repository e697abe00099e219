"""The coarsest tolerance that is good enough: by trying from coarse to fine, then by bisection.

An accuracy need not rise with every step to a finer tolerance, so the search does not start from both ends: it comes
down from the coarse side in steps of about two to the first tolerance that is good enough, and bisects only between
that one and the one before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from renderer.study.tolerances import two_digit_numbers


def find_coarsest_passing(is_good: Callable[[float], bool], rungs: Iterable[float]) -> float | None:
    """The coarsest tolerance of two significant digits found to be good, 0 where only that is, None where nothing is.

    rungs: tolerances > 0, falling; the last of them draws what 0 does, or nearly. Each one is tried at most once.
    """
    before = None
    for rung in rungs:
        if is_good(rung):
            return rung if before is None else _bisect(is_good, before, rung)
        before = rung
    return 0.0 if is_good(0.0) else None


def _bisect(is_good: Callable[[float], bool], bad: float, good: float) -> float:
    """Between a tolerance that is too coarse and a finer one that is good."""
    between = two_digit_numbers(bad, good)
    first_bad, last_good = 0, len(between) - 1  # places in the falling list: `bad` itself and `good` itself
    while last_good - first_bad > 1:
        middle = (first_bad + last_good) // 2
        if is_good(between[middle]):
            last_good = middle
        else:
            first_bad = middle
    return between[last_good]
