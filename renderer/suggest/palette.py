"""Colours that differ as they are seen: by distances in CIELAB (ISO/CIE 11664-4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from renderer.scene import Color
from renderer.volume import Float64

# From linear sRGB to X, Y, Z relative to the white point D65 (IEC 61966-2-1).
_XYZ = np.array([[0.4339, 0.3762, 0.1899], [0.2126, 0.7152, 0.0722], [0.0178, 0.1095, 0.8727]])
_STEPS = 12
# Darker colours are lost on black, and lighter ones look alike.
_MIN_LIGHTNESS, _MAX_LIGHTNESS = 45.0, 92.0


def distinct_colors(first: Sequence[Color], count: int) -> list[Color]:
    """Return `first` and further colours, each as different as possible from all before it; `count` in all."""
    levels = np.linspace(0.0, 1.0, _STEPS)
    colors = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), axis=-1).reshape(-1, 3)
    lightness = to_lab(colors)[:, 0]
    colors = colors[(lightness >= _MIN_LIGHTNESS) & (lightness <= _MAX_LIGHTNESS)]
    candidates, chosen = to_lab(colors), list(first[:count])
    distances = np.full(len(colors), np.inf)
    for lab in to_lab(np.array(chosen)):
        distances = np.minimum(distances, np.linalg.norm(candidates - lab, axis=1))
    while len(chosen) < count:
        farthest = int(distances.argmax())
        red, green, blue = colors[farthest].tolist()
        chosen.append((red, green, blue))
        distances = np.minimum(distances, np.linalg.norm(candidates - candidates[farthest], axis=1))
    return chosen


def to_lab(colors: Float64) -> Float64:
    """Return the lightness, a and b of sRGB colours, float64 [n, 3] in [0, 1]."""
    linear = np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)
    part = linear @ _XYZ.T
    x, y, z = np.where(part > (6 / 29) ** 3, np.cbrt(part), part / (3 * (6 / 29) ** 2) + 4 / 29).T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)
