"""Interpolate colours in ParaView's colour spaces, by adding points until the curve is nearly linear in RGB."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from operator import itemgetter

from renderer.looks.curves import Curve, CurvePoint, Numbers, mix

# The smallest step between points that are added to a curve of colours, as a share of the way between two given points.
_SMALLEST_SHARE = 1 / 64
# The largest step between points that are added to a curve of colours, as a share of the way between two given points.
_LARGEST_SHARE = 1 / 4
# No point is added to a curve of colours where its colours differ by at most this from a straight line in RGB: half a
# step of 8 bits.
_SAME_COLOR = 0.5 / 255
# The matrix from linear sRGB to CIE XYZ (IEC 61966-2-1).
_XYZ_FROM_RGB = ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))
# The matrix from CIE XYZ to linear sRGB (IEC 61966-2-1).
_RGB_FROM_XYZ = ((3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415), (0.0557, -0.2040, 1.0570))
# The white point of sRGB, D65, in CIE XYZ (IEC 61966-2-1).
_WHITE = (0.9505, 1.0, 1.089)
# CIE L*a*b* depends linearly on X, Y and Z below this share of white, and by a cube root above it.
_DARK = 0.008856
# The slope of the linear part of CIE L*a*b*.
_SLOPE = 7.787
# A colour is grey if its saturation in Msh, which is L*a*b* in polar coordinates, is at most this (Moreland, "Diverging
# Color Maps for Scientific Visualization", 2009).
_GRAY_SATURATION = 0.05
# Diverging colormaps have white between two colours whose hues differ by more than this, in radians (Moreland 2009).
_SIMILAR_HUES = math.pi / 3
# The least magnitude, in Msh, of the white between the two hues of a diverging colormap (Moreland 2009).
_WHITE_MAGNITUDE = 88.0


def in_color_space(curve: Curve, space: str) -> Iterator[CurvePoint]:
    """Yield the points of a curve of colours, with further points where its colours are not linear in RGB.

    space: the name of the colour space in which colours between two points are interpolated.
    """
    between = _BETWEEN.get(space)
    yield curve[0]
    for (low, first), (high, second) in pairwise(curve):
        if space == "step":
            yield low, second
        elif between is not None and low < high:
            for share, color in _needed(partial(between, first, second), (0.0, first), (1.0, second)):
                yield low + share * (high - low), color
        yield high, second


def _needed(color_at: Callable[[float], Numbers], first: CurvePoint, second: CurvePoint) -> Iterator[CurvePoint]:
    """Yield the points that a curve needs between two points, so that straight lines in RGB give the same colours.

    Points are pairs: the share of the way between two given points, and a colour. color_at: returns the colour at a
    share of the way.
    """
    size = second[0] - first[0]
    if size <= _SMALLEST_SHARE:
        return
    middle = first[0] + size / 2, color_at(first[0] + size / 2)
    if size > _LARGEST_SHARE or math.dist(middle[1], mix(first[1], second[1], 0.5)) > _SAME_COLOR:
        yield from _needed(color_at, first, middle)
        yield middle
        yield from _needed(color_at, middle, second)


def _between_lab(first: Numbers, second: Numbers, share: float) -> Numbers:
    return rgb_from_lab(mix(lab_from_rgb(first), lab_from_rgb(second), share))


def _between_hsv(first: Numbers, second: Numbers, share: float) -> Numbers:
    return colorsys.hsv_to_rgb(*mix(colorsys.rgb_to_hsv(*first), colorsys.rgb_to_hsv(*second), share))


def _between_msh(first: Numbers, second: Numbers, share: float) -> Numbers:
    one, other = (_msh_from_lab(lab_from_rgb(color)) for color in (first, second))
    apart = abs(one[2] - other[2])
    if min(one[1], other[1]) > _GRAY_SATURATION and min(apart, 2 * math.pi - apart) > _SIMILAR_HUES:
        white = (max(one[0], other[0], _WHITE_MAGNITUDE), 0.0, 0.0)
        one, other, share = (one, white, 2 * share) if share < 0.5 else (white, other, 2 * share - 1)
    gray, full = sorted((one, other), key=itemgetter(1))
    if gray[1] <= _GRAY_SATURATION < full[1]:
        hue = _hue_towards_gray(full, gray[0])
        one, other = ((m, s, h if s > _GRAY_SATURATION else hue) for m, s, h in (one, other))
    magnitude, saturation, hue = mix(one, other, share)
    radius = magnitude * math.sin(saturation)
    return rgb_from_lab((magnitude * math.cos(saturation), radius * math.cos(hue), radius * math.sin(hue)))


def _hue_towards_gray(full: Numbers, gray_magnitude: float) -> float:
    """Return the hue that grey is given, so that a saturated colour fades to grey in steps that look even.

    full: the magnitude, saturation and hue of the colour. gray_magnitude: the magnitude of the grey (Moreland 2009).
    """
    magnitude, saturation, hue = full
    if magnitude >= gray_magnitude:
        return hue
    spin = saturation * math.sqrt(gray_magnitude**2 - magnitude**2) / (magnitude * math.sin(saturation))
    return hue + spin if hue > -0.3 * math.pi else hue - spin


def _msh_from_lab(lab: Numbers) -> Numbers:
    magnitude = math.hypot(*lab)
    return magnitude, math.acos(min(lab[0] / magnitude, 1.0)) if magnitude > 0 else 0.0, math.atan2(lab[2], lab[1])


def lab_from_rgb(color: Numbers) -> Numbers:
    """Return the CIELAB coordinates of a colour: lightness, a and b. color: sRGB, from 0 to 1."""
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in color]
    x, y, z = (sum(a * b for a, b in zip(row, linear, strict=True)) / white
               for row, white in zip(_XYZ_FROM_RGB, _WHITE, strict=True))  # fmt: skip
    u, v, w = (part ** (1 / 3) if part > _DARK else _SLOPE * part + 16 / 116 for part in (x, y, z))
    return 116 * v - 16, 500 * (u - v), 200 * (v - w)


def rgb_from_lab(lab: Numbers) -> Numbers:
    """Return the sRGB colour, from 0 to 1, that has the given CIELAB coordinates. lab: lightness, a and b."""
    v = (lab[0] + 16) / 116
    roots = (v + lab[1] / 500, v, v - lab[2] / 200)
    xyz = [(root**3 if root**3 > _DARK else (root - 16 / 116) / _SLOPE) * white
           for root, white in zip(roots, _WHITE, strict=True)]  # fmt: skip
    linear = (sum(a * b for a, b in zip(row, xyz, strict=True)) for row in _RGB_FROM_XYZ)
    r, g, b = (12.92 * part if part <= 0.0031308 else 1.055 * part ** (1 / 2.4) - 0.055 for part in linear)
    brightest = max(r, g, b, 1.0)  # a colour beyond 1 keeps its hue, as in VTK
    return max(r / brightest, 0.0), max(g / brightest, 0.0), max(b / brightest, 0.0)


# The functions that interpolate between two colours, by the name of the colour space.
_BETWEEN: dict[str, Callable[[Numbers, Numbers, float], Numbers]] = {
    "lab": _between_lab,
    "cielab": _between_lab,
    "hsv": _between_hsv,
    "diverging": _between_msh,
}
# The names of the colour spaces that are read. In `step`, colours do not change between two points.
COLOR_SPACES = {"rgb", "step", *_BETWEEN}
