"""Colours that differ as they are seen: by distances in CIELAB (ISO/CIE 11664-4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from renderer.looks import lab_from_rgb
from renderer.scene import Color
from renderer.volume import Float64

# Of fields, whose lowest level has the colour at this part of the colormap.
FIELD_COLORMAP, FIELD_DARKEST = "viridis", 0.4

_STEPS = 12
# Darker colours are lost on black, lighter ones look alike, and of more saturated ones one outshines all others.
_MIN_LIGHTNESS, _MAX_LIGHTNESS, _MAX_CHROMA = 45.0, 92.0, 80.0


def distinct_colors(first: Sequence[Color], count: int) -> list[Color]:
    """Return `first` and further colours, each as different as possible from all before it; `count` in all."""
    levels = np.linspace(0.0, 1.0, _STEPS)
    colors = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), axis=-1).reshape(-1, 3)
    lightness, a, b = to_lab(colors).T
    is_good = (lightness >= _MIN_LIGHTNESS) & (lightness <= _MAX_LIGHTNESS) & (np.hypot(a, b) <= _MAX_CHROMA)
    colors = colors[is_good]
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


def in_8_bits(color: Sequence[float]) -> Color:
    """Return the nearest colour that `#rrggbb` can say."""
    red, green, blue = (round(255 * part) / 255 for part in color)
    return red, green, blue


def to_lab(colors: Float64) -> Float64:
    """Return the lightness, a and b of sRGB colours, float64 [n, 3] in [0, 1]."""
    return np.array([lab_from_rgb((red, green, blue)) for red, green, blue in colors.tolist()])
