"""Colours between two points in the spaces that ParaView interpolates in, as points between which RGB is linear."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from renderer.looks.curves import Color

Vector = tuple[float, float, float]

# The most pieces between two points, at which all colours are known.
_NUM_PIECES = 64
# Colours this near are the same: half a step of 8 bits.
_SAME_COLOR = 0.5 / 255

# sRGB with the white of D65 (IEC 61966-2-1), and the constants of CIE L*a*b*.
_XYZ_FROM_RGB = ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))
_RGB_FROM_XYZ = ((3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415), (0.0557, -0.2040, 1.0570))
_WHITE = (0.9505, 1.0, 1.089)
_DARK, _SLOPE = 0.008856, 7.787

# Msh, polar Lab, by Moreland, "Diverging Color Maps for Scientific Visualization", 2009.
_GRAY_SATURATION, _SIMILAR_HUES, _WHITE_MAGNITUDE = 0.05, math.pi / 3, 88.0


def in_color_space(curve: Sequence[tuple[float, Color]], space: str) -> list[tuple[float, Color]]:
    """Return a curve of colours with points between, where they are not linear in RGB."""
    if space == "step":
        return [(at, second) for (low, _), (high, second) in pairwise(curve) for at in (low, high)]
    between = _BETWEEN.get(space)
    if between is None:
        return [*curve]
    found = [curve[0]]
    for (low, first), (high, second) in pairwise(curve):
        colors = [first, *(between(first, second, k / _NUM_PIECES) for k in range(1, _NUM_PIECES)), second]
        shares = [0.0, *_needed(colors, 0, _NUM_PIECES)] if low < high else [0.0, 1.0]
        found += [(low + share * (high - low), colors[round(share * _NUM_PIECES)]) for share in shares[1:-1]]
        found.append((high, second))
    return found


def _needed(colors: Sequence[Color], begin: int, end: int) -> Iterator[float]:
    """Yield the shares after `begin` up to `end` at which points are needed for the colours to be near these."""
    middle = (begin + end) // 2
    straight = _mix(colors[begin], colors[end], 0.5)
    if end - begin > 1 and (end - begin > _NUM_PIECES // 4 or math.dist(colors[middle], straight) > _SAME_COLOR):
        yield from _needed(colors, begin, middle)
        yield from _needed(colors, middle, end)
    else:
        yield end / _NUM_PIECES


def _mix(first: Vector, second: Vector, share: float) -> Vector:
    a, b, c = (low + share * (high - low) for low, high in zip(first, second, strict=True))
    return a, b, c


def _between_lab(first: Color, second: Color, share: float) -> Color:
    return _rgb_from_lab(_mix(lab_from_rgb(first), lab_from_rgb(second), share))


def _between_hsv(first: Color, second: Color, share: float) -> Color:
    return colorsys.hsv_to_rgb(*_mix(colorsys.rgb_to_hsv(*first), colorsys.rgb_to_hsv(*second), share))


def _between_msh(first: Color, second: Color, share: float) -> Color:
    one, other = (_msh_from_lab(lab_from_rgb(color)) for color in (first, second))
    apart = abs(one[2] - other[2])
    is_one, is_other = one[1] > _GRAY_SATURATION, other[1] > _GRAY_SATURATION
    if is_one and is_other and min(apart, 2 * math.pi - apart) > _SIMILAR_HUES:
        white = (max(one[0], other[0], _WHITE_MAGNITUDE), 0.0, 0.0)
        one, other, share = (one, white, 2 * share) if share < 0.5 else (white, other, 2 * share - 1)
        is_one, is_other = one[1] > 0, other[1] > 0
    if is_one != is_other:
        gray, full = (other, one) if is_one else (one, other)
        gray = (gray[0], gray[1], _hue_towards_gray(full, gray[0]))
        one, other = (full, gray) if is_one else (gray, full)
    magnitude, saturation, hue = _mix(one, other, share)
    radius = magnitude * math.sin(saturation)
    return _rgb_from_lab((magnitude * math.cos(saturation), radius * math.cos(hue), radius * math.sin(hue)))


def _hue_towards_gray(full: Vector, gray_magnitude: float) -> float:
    """Return the hue at which a saturated colour fades to gray, for steps that look even."""
    magnitude, saturation, hue = full
    if magnitude >= gray_magnitude:
        return hue
    spin = saturation * math.sqrt(gray_magnitude**2 - magnitude**2) / (magnitude * math.sin(saturation))
    return hue + spin if hue > -0.3 * math.pi else hue - spin


def _msh_from_lab(lab: Vector) -> Vector:
    magnitude = math.hypot(*lab)
    return magnitude, math.acos(min(lab[0] / magnitude, 1.0)) if magnitude > 0 else 0.0, math.atan2(lab[2], lab[1])


def lab_from_rgb(color: Color) -> Vector:
    """Return the lightness, a and b of CIELAB of an sRGB colour in [0, 1]."""
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in color]
    x, y, z = (sum(a * b for a, b in zip(row, linear, strict=True)) / white
               for row, white in zip(_XYZ_FROM_RGB, _WHITE, strict=True))  # fmt: skip
    u, v, w = (part ** (1 / 3) if part > _DARK else _SLOPE * part + 16 / 116 for part in (x, y, z))
    return 116 * v - 16, 500 * (u - v), 200 * (v - w)


def _rgb_from_lab(lab: Vector) -> Color:
    v = (lab[0] + 16) / 116
    roots = (v + lab[1] / 500, v, v - lab[2] / 200)
    xyz = [(root**3 if root**3 > _DARK else (root - 16 / 116) / _SLOPE) * white
           for root, white in zip(roots, _WHITE, strict=True)]  # fmt: skip
    linear = (sum(a * b for a, b in zip(row, xyz, strict=True)) for row in _RGB_FROM_XYZ)
    r, g, b = (12.92 * part if part <= 0.0031308 else 1.055 * part ** (1 / 2.4) - 0.055 for part in linear)
    brightest = max(r, g, b, 1.0)  # beyond 1 a colour keeps its hue, as in VTK
    return max(r / brightest, 0.0), max(g / brightest, 0.0), max(b / brightest, 0.0)


_BETWEEN: dict[str, Callable[[Color, Color, float], Color]] = {
    "lab": _between_lab,
    "cielab": _between_lab,
    "hsv": _between_hsv,
    "diverging": _between_msh,
}
