"""Choose colours that people can tell apart, by distances in CIELAB (ISO/CIE 11664-4), and colours for labels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np

from renderer.looks import lab_from_rgb
from renderer.scene import Color, colormap_points
from renderer.volume import Float64

# The colormap whose colours are suggested for fields: from blue over white to brown, which are told apart without red
# and green.
FIELD_COLORMAP = "vik"
# The positions in the colormap, from 0 to 1, of the colours for the lowest and the highest level of a field. Colours
# nearer to the ends are too dark on black.
FIELD_ENDS = (0.15, 0.85)

# Colours for labels are chosen from a grid of colours, with this many values of each of red, green and blue.
_STEPS = 12
# The least lightness of a colour that is chosen for a label, in CIELAB. Darker colours are lost on black.
_MIN_LIGHTNESS = 45.0
# The largest lightness of a colour that is chosen for a label, in CIELAB. Lighter colours look alike.
_MAX_LIGHTNESS = 92.0
# The largest chroma of a colour that is chosen for a label, in CIELAB. A more saturated colour outshines all others.
_MAX_CHROMA = 80.0
# The colours of the first labels; further colours are as different from them as possible.
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
# Up to this many labels get colours as different as possible; if there are more labels, all get colours of a colormap.
_MAX_DISTINCT_COLORS = 255
# The colormap whose colours are used in turn if there are too many labels for colours as different as possible.
_MANY_LABELS_COLORMAP = "glasbey"


def distinct_colors(first: Sequence[Color], count: int) -> list[Color]:
    """Return `count` colours: the colours of `first`, then colours as different as possible from all earlier ones."""
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
    """Return the nearest colour that can be written as `#rrggbb`."""
    red, green, blue = (round(255 * part) / 255 for part in color)
    return red, green, blue


def to_lab(colors: Float64) -> Float64:
    """Return the CIELAB coordinates lightness, a and b of colours, float64 [n, 3]. colors: sRGB, [n, 3], in [0, 1]."""
    return np.array([lab_from_rgb((red, green, blue)) for red, green, blue in colors.tolist()])


@cache
def label_colors(num: int) -> tuple[Color, ...]:
    """Return `num` colours for labels, as different from one another as possible."""
    if num <= _MAX_DISTINCT_COLORS:
        return tuple(map(in_8_bits, distinct_colors(_FIRST_OF_LABELS, num)))
    colors = colormap_points(_MANY_LABELS_COLORMAP, _MAX_DISTINCT_COLORS + 1)
    return tuple(in_8_bits(colors[number % len(colors)]) for number in range(num))


def colors_by_label(labels: Iterable[int]) -> dict[int, Color]:
    """Return a colour for each label: as different as possible, and white for 0, which usually is no label."""
    others = [label for label in labels if label]
    return {0: (1.0, 1.0, 1.0)} | dict(zip(others, label_colors(len(others)), strict=True))
