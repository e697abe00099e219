"""Draw every entry of an annotation over a made-up picture, in several sizes: `python annotation_page.py FOLDER`."""

from __future__ import annotations

import colorsys
import math
import sys
from pathlib import Path

import numpy as np

from renderer.annotation import (
    AnnotationFacts,
    Annotator,
    ColorBar,
    FrameFacts,
    annotation_problems,
    draw_annotation,
)
from renderer.film import encode_png, quantize
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


def picture(width: int, height: int, background: float) -> np.ndarray:
    """Return a ball over nothing: float32 [h, w, 4], premultiplied."""
    y, x = np.mgrid[:height, :width]
    r = np.hypot(x - width / 2, y - height / 2) / (0.45 * height)
    alpha = np.clip(1.4 * (1 - r), 0, 1)
    shade = 0.5 + 0.5 * np.cos(7 * r)
    return np.stack([alpha * shade * 0.9, alpha * shade * 0.7, alpha * (1 - shade) * 0.8, alpha], 2).astype(np.float32)


def main(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    frame = FrameFacts(12, 0.4, None, {}, "47.3 dB", 0.35, axes_of(35, 25))
    for width, height in ((256, 256), (512, 512), (1280, 720), (1920, 1080), (720, 1280)):
        for name, level in (("dark", 0.0), ("light", 1.0)):
            facts = AnnotationFacts((width, height), ((level,) * 3,) * 2, "mm", True, "LPS", BARS, LEGEND)
            for problem in annotation_problems(ALL, facts, [frame]):
                print(width, height, problem)
            image = picture(width, height, level)
            draw_annotation(image, Annotator(ALL, facts).patches(frame))
            pixels = quantize(image, (level,) * 3)
            (folder / f"{name}-{width}x{height}.png").write_bytes(encode_png(pixels))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
