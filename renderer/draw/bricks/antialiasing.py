"""Find the pixels whose colour a single ray does not give, draw several rays in each, and take their mean.

    one ray a pixel; where cells are smaller than a pixel, one more ray somewhere in every third pixel
    -> pixels that differ from a neighbour: 4 rays; neighbours that differ then: 4 rays, and so on
    -> pixels whose 4 rays differ, or whose additional ray differs from the first one: 16 rays
    -> neighbours of pixels on a thin line: 16 rays, and so on

The colours of the picture alone decide which pixels get more rays: it is the same bytes for any number of threads.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from renderer.bricks import RAYS_ACROSS, ScreenSampling
from renderer.kernels import ThreadPool, kernels
from renderer.volume import Bools, Float32, Int64, UInt8


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


def antialias(image: Float32, sampling: ScreenSampling, draw_rays: DrawRays, threads: ThreadPool) -> None:
    """Replace each pixel that needs several rays by the mean of these. image: float32 [h, w, 4], changed in place."""
    few, many = RAYS_ACROSS
    marks = np.zeros(image.shape[:2], np.uint8)
    mark = kernels().mark_contrasts.partial(image=image, threshold=sampling.contrast_threshold, marks=marks)
    threads.for_rows(lambda first, end: mark(first_row=first, end_row=end), image)
    if sampling.is_scouted:
        _scout(image, sampling.contrast_threshold, marks, draw_rays)
    while (pixels := np.flatnonzero(marks == _MARKED_FOR_FEW)).size:
        differ = _draw_means(image, pixels, few, sampling.spread_threshold, draw_rays)
        marks.reshape(-1)[pixels] = np.where(differ, _MARKED_FOR_MANY, _HAS_FEW)
        kernels().spread_contrasts(image=image, threshold=sampling.contrast_threshold, pixels=pixels, marks=marks)
    while (pixels := np.flatnonzero(marks == _MARKED_FOR_MANY)).size:
        _draw_means(image, pixels, many, sampling.spread_threshold, draw_rays)
        marks.reshape(-1)[pixels] = _HAS_MANY
        kernels().follow_lines(image=image, threshold=sampling.contrast_threshold, pixels=pixels, marks=marks)


def _scout(image: Float32, threshold: float, marks: UInt8, draw_rays: DrawRays) -> None:
    """Draw one more ray somewhere in every third pixel without a mark, and mark the pixels whose two rays differ."""
    height, width = image.shape[:2]
    rows_at_once = max(1, _PIXELS_AT_ONCE // width)
    for first in range(0, height, rows_at_once):
        rows = np.arange(first, min(first + rows_at_once, height))[:, None]
        pixels = (rows * width + np.arange(width))[(rows + np.arange(width)) % 3 == 0]
        pixels = pixels[marks.reshape(-1)[pixels] == 0]
        if pixels.size:
            scouts = draw_rays(pixels, 1, is_scattered=True)
            differ = np.abs(scouts - image.reshape(-1, 4)[pixels]).max(axis=1) > threshold
            marks.reshape(-1)[pixels[differ]] = _MARKED_FOR_MANY


def _draw_means(image: Float32, pixels: Int64, across: int, threshold: float, draw_rays: DrawRays) -> Bools:
    """Set pixels to the means of their rays; return whether the rays of each differ by more than a threshold."""
    differ = np.zeros(len(pixels), np.bool_)
    for first in range(0, len(pixels), _PIXELS_AT_ONCE):
        part = slice(first, first + _PIXELS_AT_ONCE)
        kernels().average_rays(
            rays=draw_rays(pixels[part], across), num_rays=across**2, pixels=pixels[part], threshold=threshold,
            image=image.reshape(-1, 4), differ=differ[part],
        )  # fmt: skip
    return differ
