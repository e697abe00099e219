"""Draw several rays in the pixels of a picture that one ray cannot tell, and take their mean.

    one ray a pixel -> pixels that differ from a neighbour: 4 rays -> neighbours that differ then: 4 rays, and so on
    -> pixels whose 4 rays differ: 16 rays -> where these are on a thin line, their neighbours: 16 rays, and so on

The picture decides, and not the threads or the memory: it is the same bytes for any number of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from renderer.bricks import RAYS_ACROSS, ScreenSampling
from renderer.kernels import ThreadPool, kernels
from renderer.volume import Bools, Float32, Int64

# Draws several rays in pixels: from the numbers of pixels, row by row, and the rays across each to colours, float32
# [pixels * across^2, 4], pixel by pixel.
DrawRays = Callable[[Int64, int], Float32]

# Pixels whose rays are in memory at once: 16 rays of each take 16 MiB.
_PIXELS_AT_ONCE = 1 << 16
# Marks of pixels: those that have 4 rays, or are to get them, and those that have 16 rays, or are to get them.
_HAS_FEW = 1
_MARKED_FOR_FEW = 2
_HAS_MANY = 3
_MARKED_FOR_MANY = 4


def antialias(image: Float32, sampling: ScreenSampling, draw_rays: DrawRays, threads: ThreadPool) -> None:
    """Replace the pixels of a picture, float32 [h, w, 4], that need several rays by the mean of their rays."""
    few, many = RAYS_ACROSS
    marks = np.zeros(image.shape[:2], np.uint8)
    mark = kernels().mark_contrasts.partial(image=image, threshold=sampling.contrast_threshold, marks=marks)
    threads.for_rows(lambda first, end: mark(first_row=first, end_row=end), image)
    while (pixels := np.flatnonzero(marks == _MARKED_FOR_FEW)).size:
        differ = _draw_means(image, pixels, few, sampling.spread_threshold, draw_rays)
        marks.reshape(-1)[pixels] = np.where(differ, _MARKED_FOR_MANY, _HAS_FEW)
        kernels().spread_contrasts(image=image, threshold=sampling.contrast_threshold, pixels=pixels, marks=marks)
    while (pixels := np.flatnonzero(marks == _MARKED_FOR_MANY)).size:
        _draw_means(image, pixels, many, sampling.spread_threshold, draw_rays)
        marks.reshape(-1)[pixels] = _HAS_MANY
        kernels().follow_lines(image=image, threshold=sampling.contrast_threshold, pixels=pixels, marks=marks)


def _draw_means(image: Float32, pixels: Int64, across: int, threshold: float, draw_rays: DrawRays) -> Bools:
    """Put means of rays into pixels, and return which of these have rays that differ by more than a threshold."""
    differ = np.zeros(len(pixels), np.bool_)
    for first in range(0, len(pixels), _PIXELS_AT_ONCE):
        part = slice(first, first + _PIXELS_AT_ONCE)
        kernels().average_rays(
            rays=draw_rays(pixels[part], across), num_rays=across**2, pixels=pixels[part], threshold=threshold,
            image=image.reshape(-1, 4), differ=differ[part],
        )  # fmt: skip
    return differ
