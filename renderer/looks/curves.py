"""Piecewise linear curves: merged, with opacities that are linear in extinction, and with steps between labels."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

Color = tuple[float, float, float]
# Numbers by value, values not descending: linear in between, constant outside, a step between two at one value.
Curve = Sequence[tuple[float, tuple[float, ...]]]

# How far opacities may be from a straight line between two points.
MAX_OPACITY_ERROR = 1e-3
# The optical depth of opacity 1, which would be infinite: no picture shows the difference.
OPAQUE_DEPTH = 40.0


def merge_curves(first: Curve, second: Curve) -> list[tuple[float, tuple[float, ...]]]:
    """Return one curve with the numbers of both, and a point wherever one of them has one."""
    values = [[value for value, _ in curve] for curve in (first, second)]
    merged: list[tuple[float, tuple[float, ...]]] = []
    for at in sorted({*values[0], *values[1]}):
        below, above = zip(
            *(_sides(curve, own, at) for curve, own in zip((first, second), values, strict=True)), strict=True
        )
        merged.append((at, sum(below, ())))
        if above != below:
            merged.append((at, sum(above, ())))
    return merged


def _sides(curve: Curve, values: Sequence[float], at: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return what a curve comes to from below and from above a value."""
    begin, end = bisect_left(values, at), bisect_right(values, at)
    if begin < end or begin in (0, len(values)):
        return curve[min(begin, len(values) - 1)][1], curve[max(end - 1, 0)][1]
    (low, before), (high, after) = curve[begin - 1], curve[begin]
    share = (at / 2 - low / 2) / (high / 2 - low / 2)
    between = tuple(a + share * (b - a) for a, b in zip(before, after, strict=True))
    return between, between


def linear_in_extinction(curve: Curve) -> Iterator[tuple[float, tuple[float, ...]]]:
    """Yield the points of a curve whose last number is an opacity, and more where they are needed.

    Programs that interpolate opacities, and hsplat, which interpolates extinctions, see the same curve of them.
    """
    yield curve[0]
    for (low, before), (high, after) in pairwise(curve):
        yield from _filled(low, before, high, after)


def _filled(
    low: float, before: tuple[float, ...], high: float, after: tuple[float, ...]
) -> Iterator[tuple[float, tuple[float, ...]]]:
    middle = low / 2 + high / 2
    if low < middle < high and _interpolation_error(before[-1], after[-1]) > MAX_OPACITY_ERROR:
        between = tuple((a + b) / 2 for a, b in zip(before, after, strict=True))
        yield from _filled(low, before, middle, between)
        yield from _filled(middle, between, high, after)
    else:
        yield high, after


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


def without_hidden(curve: Curve) -> list[tuple[float, tuple[float, ...]]]:
    """Return a curve without the points between two others at the same value, which have no effect."""
    last = len(curve) - 1
    return [
        point for k, point in enumerate(curve) if not (0 < k < last and curve[k - 1][0] == point[0] == curve[k + 1][0])
    ]


def label_curve(labels: Mapping[float, tuple[float, ...]]) -> list[tuple[float, tuple[float, ...]]]:
    """Return a curve with steps half-way between labels. labels: the numbers of each, one label or more."""
    values = sorted(labels)
    ends = [values[0], *(low / 2 + high / 2 for low, high in pairwise(values)), values[-1]]
    between = zip(values, pairwise(ends), strict=True)
    return without_hidden([(at, labels[value]) for value, pair in between for at in pair])


def even_curve(colors: Sequence[Color]) -> list[tuple[float, tuple[float, ...]]]:
    """Return a curve through colours at even distances, from 0 to 1."""
    return [(k / max(len(colors) - 1, 1), color) for k, color in enumerate(colors)]
