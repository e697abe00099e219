"""Piecewise linear curves: sorted, merged, and with opacities that are linear in extinction."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from operator import itemgetter

Color = tuple[float, float, float]
Numbers = tuple[float, ...]
CurvePoint = tuple[float, Numbers]
# Numbers by value, values not descending: linear in between, constant outside, a step between two at one value.
Curve = Sequence[CurvePoint]

# How far opacities may be from a straight line between two points.
MAX_OPACITY_ERROR = 1e-3
# The optical depth of opacity 1, which would be infinite: no picture shows the difference.
OPAQUE_DEPTH = 40.0

_VALUE = itemgetter(0)


def by_value(points: Iterable[CurvePoint]) -> list[CurvePoint]:
    """Return points by value. Those at one value keep their order, which says what a step goes from and to."""
    return sorted(points, key=_VALUE)


def merge_curves(first: Curve, second: Curve) -> list[CurvePoint]:
    """Return one curve with the numbers of both, and a point wherever one of them has one."""
    merged = list[CurvePoint]()
    for at in sorted({value for value, _ in (*first, *second)}):
        below, above = (one + other for one, other in zip(_sides(first, at), _sides(second, at), strict=True))
        merged += [(at, below), (at, above)] if above != below else [(at, below)]
    return merged


def _sides(curve: Curve, at: float) -> tuple[Numbers, Numbers]:
    """Return what a curve comes to from below and from above a value."""
    begin, end = bisect_left(curve, at, key=_VALUE), bisect_right(curve, at, key=_VALUE)
    if begin < end or begin in (0, len(curve)):
        return curve[min(begin, len(curve) - 1)][1], curve[max(end - 1, 0)][1]
    (low, before), (high, after) = curve[begin - 1], curve[begin]
    # Halves, for the whole may be too large for a float; of the smallest floats half is nothing.
    share = (at / 2 - low / 2) / max(high / 2 - low / 2, math.ulp(0.0))
    between = mix(before, after, share)
    return between, between


def mix(first: Numbers, second: Numbers, share: float) -> Numbers:
    """Return the numbers at a share of the way from some to others."""
    return tuple(a + share * (b - a) for a, b in zip(first, second, strict=True))


def linear_in_extinction(curve: Curve) -> Iterator[CurvePoint]:
    """Yield the points of a curve whose last number is an opacity, and more where they are needed.

    Programs that interpolate opacities, and hsplat, which interpolates extinctions, see the same curve of them.
    """
    yield curve[0]
    for first, second in pairwise(curve):
        yield from _filled(first, second)


def _filled(first: CurvePoint, second: CurvePoint) -> Iterator[CurvePoint]:
    (low, before), (high, after) = first, second
    middle = low / 2 + high / 2
    if low < middle < high and _interpolation_error(before[-1], after[-1]) > MAX_OPACITY_ERROR:
        between = middle, tuple((a + b) / 2 for a, b in zip(before, after, strict=True))
        yield from _filled(first, between)
        yield from _filled(between, second)
    else:
        yield second


def _interpolation_error(first: float, second: float) -> float:
    """Return the largest difference between two opacities' straight line and what is linear in extinction.

    With `r` the ratio of both transparencies the difference at a share `t` is that of `1 + t (r - 1)` and `r^t`, which
    is largest where the slopes agree: where `r^t` is the logarithmic mean of 1 and `r`.
    """
    low, high = sorted((1 - first, 1 - second))
    if high - low <= MAX_OPACITY_ERROR:
        return 0.0
    ratio = max(low / high, math.exp(-OPAQUE_DEPTH))
    mean = (ratio - 1) / math.log(ratio)
    return high * (1 + math.log(mean) / math.log(ratio) * (ratio - 1) - mean)


def without_hidden(curve: Curve) -> list[CurvePoint]:
    """Return a curve without the points between two others at the same value, which have no effect."""
    last = len(curve) - 1
    return [
        point for k, point in enumerate(curve) if not (0 < k < last and curve[k - 1][0] == point[0] == curve[k + 1][0])
    ]
