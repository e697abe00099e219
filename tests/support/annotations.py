"""An annotation with every entry, and what it shows."""

from __future__ import annotations

import colorsys
import math

import numpy as np

from renderer.annotation import ColorBar
from renderer.scene import AnnotationSpec, ColorBarSpec, EntrySpec, TimeSpec, TitleSpec

SAMPLES = [index / 255 for index in range(256)]
BARS = (
    ColorBar("density", "HU", -1000, 2500, tuple((s, s * s, 0.3 + 0.4 * s) for s in SAMPLES), tuple(SAMPLES)),
    ColorBar(
        "speed", "m/s", 0.02, 350, tuple(colorsys.hsv_to_rgb(0.7 * (1 - s), 0.8, 0.9) for s in SAMPLES),
        tuple(0.5 + 0.5 * math.sin(9 * s) for s in SAMPLES), 1, True,
    ),
)  # fmt: skip
LEGEND = (("left kidney", (0.8, 0.3, 0.2)), ("liver", (0.6, 0.4, 0.1)), ("vertebra L5", (0.9, 0.9, 0.7)))
ALL = AnnotationSpec(
    title=TitleSpec(position="top", size=0.04, text="Abdomen, portal phase"),
    time=TimeSpec(position="top-right", size=0.03),
    legend=EntrySpec(position="left", size=0.03),
    color_bar=ColorBarSpec(position="right", size=0.03),
    scale_bar=EntrySpec(position="bottom-left", size=0.03),
    accuracy=EntrySpec(position="bottom", size=0.03),
    orientation=EntrySpec(position="bottom-right", size=0.12),
)


def axes_of(azimuth: float, elevation: float) -> tuple[tuple[float, float, float], ...]:
    """Return the axes of a view: right, up and backward, at angles in degrees."""
    a, e = math.radians(azimuth), math.radians(elevation)
    right, back = (-math.sin(a), math.cos(a), 0.0), (math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e))
    return right, tuple(np.cross(back, right).tolist()), back
