"""Sort and merge piecewise linear curves, and approximate linear opacities by opacities linear in extinction."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from operator import itemgetter

# Red, green and blue, from 0 to 1.
Color = tuple[float, float, float]
# The numbers that a curve has at a value, such as red, green, blue and opacity.
Numbers = tuple[float, ...]
# A point of a curve: a value, and the numbers at this value.
CurvePoint = tuple[float, Numbers]
# A piecewise linear curve: points, sorted by value. It is constant outside the first and the last point, and has a step
# where two points have the same value.
Curve = Sequence[CurvePoint]

# The largest difference between an opacity on a straight line between two points of another program's curve and the
# opacity that hsplat draws there.
MAX_OPACITY_ERROR = 1e-3
# The optical depth of opacity 1, in place of infinity. No picture shows the difference.
OPAQUE_DEPTH = 40.0

_VALUE = itemgetter(0)


def by_value(points: Iterable[CurvePoint]) -> list[CurvePoint]:
    """Return points sorted by value; points at one value keep their order, which is the direction of a step."""
    return sorted(points, key=_VALUE)


def merge_curves(first: Curve, second: Curve) -> list[CurvePoint]:
    """Return one curve with the numbers of both curves, and a point at each point of either curve."""
    merged = list[CurvePoint]()
    for at in sorted({value for value, _ in (*first, *second)}):
        below, above = (one + other for one, other in zip(_sides(first, at), _sides(second, at), strict=True))
        merged += [(at, below), (at, above)] if above != below else [(at, below)]
    return merged


def _sides(curve: Curve, at: float) -> tuple[Numbers, Numbers]:
    """Return the limits of a curve at a value, from below and from above."""
    begin, end = bisect_left(curve, at, key=_VALUE), bisect_right(curve, at, key=_VALUE)
    if begin < end or begin in (0, len(curve)):
        return curve[min(begin, len(curve) - 1)][1], curve[max(end - 1, 0)][1]
    (low, before), (high, after) = curve[begin - 1], curve[begin]
    # Halves are subtracted, because the difference of two values may be too large for a float. The divisor is bounded,
    # because the halves of the smallest floats are 0.
    share = (at / 2 - low / 2) / max(high / 2 - low / 2, math.ulp(0.0))
    between = mix(before, after, share)
    return between, between


def mix(first: Numbers, second: Numbers, share: float) -> Numbers:
    """Return the numbers at the share `share` of the way from the numbers `first` to the numbers `second`."""
    return tuple(a + share * (b - a) for a, b in zip(first, second, strict=True))


def linear_in_extinction(curve: Curve) -> Iterator[CurvePoint]:
    """Yield the points of a curve with opacities, with further points, so that extinctions may be interpolated.

    hsplat interpolates extinctions between points. With the further points, it gets nearly the same opacities as
    programs that interpolate opacities. curve: the last number of each point is an opacity.
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
    """Return the largest difference between interpolating two opacities and interpolating their extinctions.

    Let `r` be the ratio of the smaller transparency (1 - opacity) to the larger one. At the share `t` of the way from
    the larger one, the two interpolations give `1 + t (r - 1)` and `r^t`, times the larger one. Their difference is
    largest where their slopes agree: where `r^t` is the logarithmic mean of 1 and `r`.
    """
    low, high = sorted((1 - first, 1 - second))
    if high - low <= MAX_OPACITY_ERROR:
        return 0.0
    ratio = max(low / high, math.exp(-OPAQUE_DEPTH))
    mean = (ratio - 1) / math.log(ratio)
    return high * (1 + math.log(mean) / math.log(ratio) * (ratio - 1) - mean)


def without_hidden(curve: Curve) -> list[CurvePoint]:
    """Return a curve without points that have no effect: points between two other points at the same value."""
    last = len(curve) - 1
    return [
        point for k, point in enumerate(curve) if not (0 < k < last and curve[k - 1][0] == point[0] == curve[k + 1][0])
    ]
