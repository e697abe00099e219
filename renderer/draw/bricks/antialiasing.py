"""Find the pixels whose colour a single ray does not give, draw several rays in each, and take their mean.

    one ray a pixel; where cells are smaller than a pixel, one more ray somewhere in every third pixel
    -> pixels that differ from a neighbour: 4 rays; neighbours that differ then: 4 rays, and so on
    -> pixels whose 4 rays differ, or whose additional ray differs from the first one: 16 rays
    -> neighbours of pixels on a thin line: 16 rays, and so on

The colours of the picture alone decide which pixels get more rays: it is the same bytes for any number of threads.
"""

from __future__ import annotations

from functools import partial
from typing import Protocol, TypedDict

import numpy as np

from renderer.bricks import RAYS_ACROSS, ScreenSampling
from renderer.kernels import ThreadPool, kernels
from renderer.volume import Bools, Float32, Int64, UInt8


class _Compared(TypedDict):
    """A picture whose pixels are compared, and the arguments of kernels that compare them."""

    image: Float32
    threshold: float
    is_linear: bool


class DrawRays(Protocol):
    """A function that draws rays in pixels."""

    def __call__(self, pixels: Int64, across: int, *, is_scattered: bool = False) -> Float32:
        """Return the colours of rays, float32 [n * across^2, 4], pixel by pixel.

        pixels: int64 [n], ascending numbers, row by row. across, is_scattered: as in `ray_positions`.
        """


# The most pixels whose rays are in memory at once: 16 rays of each take 16 MiB.
_PIXELS_AT_ONCE = 1 << 16
# The mark of a pixel that has its 4 rays.
_HAS_FEW = 1
# The mark of a pixel that is to get 4 rays.
_MARKED_FOR_FEW = 2
# The mark of a pixel that has its 16 rays.
_HAS_MANY = 3
# The mark of a pixel that is to get 16 rays.
_MARKED_FOR_MANY = 4


def antialias(
    image: Float32, sampling: ScreenSampling, draw_rays: DrawRays, threads: ThreadPool, *, is_linear: bool = False
) -> None:
    """Replace each pixel that needs several rays by the mean of these.

    image: float32 [h, w, 4], changed in place. is_linear: whether colours are linear light, and are compared as they
    are shown.
    """
    few, many = RAYS_ACROSS
    marks = np.zeros(image.shape[:2], np.uint8)
    compared: _Compared = {"image": image, "threshold": sampling.contrast_threshold, "is_linear": is_linear}
    mark = kernels().mark_contrasts.partial(**compared, marks=marks)
    threads.for_rows(lambda first, end: mark(first_row=first, end_row=end), image)
    if sampling.is_scouted:
        _scout(compared, marks, draw_rays)
    draw_means = partial(_draw_means, image, sampling.spread_threshold, draw_rays, is_linear=is_linear)
    while (pixels := np.flatnonzero(marks == _MARKED_FOR_FEW)).size:
        differ = draw_means(pixels, few)
        marks.reshape(-1)[pixels] = np.where(differ, _MARKED_FOR_MANY, _HAS_FEW)
        kernels().spread_contrasts(**compared, pixels=pixels, marks=marks)
    while (pixels := np.flatnonzero(marks == _MARKED_FOR_MANY)).size:
        draw_means(pixels, many)
        marks.reshape(-1)[pixels] = _HAS_MANY
        kernels().follow_lines(**compared, pixels=pixels, marks=marks)


def _scout(compared: _Compared, marks: UInt8, draw_rays: DrawRays) -> None:
    """Draw one more ray somewhere in every third pixel without a mark, and mark the pixels whose two rays differ."""
    image, threshold, is_linear = compared["image"], compared["threshold"], compared["is_linear"]
    height, width = image.shape[:2]
    rows_at_once = max(1, _PIXELS_AT_ONCE // width)
    for first in range(0, height, rows_at_once):
        rows = np.arange(first, min(first + rows_at_once, height))[:, None]
        pixels = (rows * width + np.arange(width))[(rows + np.arange(width)) % 3 == 0]
        pixels = pixels[marks.reshape(-1)[pixels] == 0]
        if pixels.size:
            scouts = draw_rays(pixels, 1, is_scattered=True)
            before = image.reshape(-1, 4)[pixels]
            if is_linear:
                scouts, before = _shown(scouts), _shown(before)
            differ = np.abs(scouts - before).max(axis=1) > threshold
            marks.reshape(-1)[pixels[differ]] = _MARKED_FOR_MANY


def _shown(colors: Float32) -> Float32:
    """Return linear colours, [n, 4], as they are compared: the function `shown` of shown.h."""
    encoded = np.asarray(np.sqrt(np.maximum(colors, np.float32(0))))
    encoded[:, 3] = colors[:, 3]
    return encoded


def _draw_means(
    image: Float32, threshold: float, draw_rays: DrawRays, pixels: Int64, across: int, *, is_linear: bool
) -> Bools:
    """Set pixels to the means of their rays; return whether the rays of each differ by more than a threshold."""
    differ = np.zeros(len(pixels), np.bool_)
    for first in range(0, len(pixels), _PIXELS_AT_ONCE):
        part = slice(first, first + _PIXELS_AT_ONCE)
        kernels().average_rays(
            rays=draw_rays(pixels[part], across), num_rays=across**2, pixels=pixels[part], threshold=threshold,
            is_linear=is_linear, image=image.reshape(-1, 4), differ=differ[part],
        )  # fmt: skip
    return differ
