"""Choose colours that differ as they are seen, by distances in CIELAB (ISO/CIE 11664-4), and colours for labels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np

from renderer.looks import lab_from_rgb
from renderer.scene import Color, colormap_points
from renderer.volume import Float64

# The colormap of fields.
FIELD_COLORMAP = "viridis"
# The place in the colormap, from 0 to 1, of the colour for the lowest level of a field.
FIELD_DARKEST = 0.4

# Steps of each of red, green and blue among the colours that are tried.
_STEPS = 12
# The least lightness of a colour. Darker ones are lost on black.
_MIN_LIGHTNESS = 45.0
# The largest lightness. Lighter colours look alike.
_MAX_LIGHTNESS = 92.0
# The largest chroma. Among more saturated colours one outshines all others.
_MAX_CHROMA = 80.0
# The colours of the first labels.
_FIRST_OF_LABELS: tuple[Color, ...] = (
    (0.90, 0.47, 0.29),
    (0.29, 0.56, 0.85),
    (0.91, 0.77, 0.28),
    (0.37, 0.71, 0.42),
    (0.69, 0.42, 0.78),
    (0.31, 0.77, 0.77),
    (0.85, 0.34, 0.48),
    (0.60, 0.66, 0.29),
    (0.54, 0.48, 0.85),
    (0.79, 0.60, 0.42),
)
# The most labels with colours that are as different as possible.
_MAX_DISTINCT_COLORS = 255
# The colormap whose colours more labels have in turn.
_MANY_LABELS_COLORMAP = "glasbey"


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


@cache
def label_colors(num: int) -> tuple[Color, ...]:
    """Return colours for this many labels, which differ as much as possible."""
    if num <= _MAX_DISTINCT_COLORS:
        return tuple(map(in_8_bits, distinct_colors(_FIRST_OF_LABELS, num)))
    colors = colormap_points(_MANY_LABELS_COLORMAP, _MAX_DISTINCT_COLORS + 1)
    return tuple(in_8_bits(colors[number % len(colors)]) for number in range(num))


def colors_by_label(labels: Iterable[int]) -> dict[int, Color]:
    """Return a colour for each label: as different as possible, and white for 0, which mostly is no label."""
    others = [label for label in labels if label]
    return {0: (1.0, 1.0, 1.0)} | dict(zip(others, label_colors(len(others)), strict=True))
