"""Interpolate images between the pixels of a subsampled grid."""

from __future__ import annotations

import numpy as np

from renderer.kernels import ThreadPool, kernels
from renderer.volume import Bools, Float32


def grid_size(size: tuple[int, int], stride: int) -> tuple[int, int]:
    """Return columns and rows of a grid that covers an image of (width, height).

    It has every `stride`-th pixel along both axes, from the first one to the last or beyond.
    """
    return -(-(size[0] - 1) // stride) + 1, -(-(size[1] - 1) // stride) + 1


def upsample(grid: Float32, stride: int, size: tuple[int, int], threads: ThreadPool) -> Float32:
    """Interpolate an image of `size` (width, height) bilinearly: float32 [height, width, 4].

    grid: [h, w, 4], every `stride`-th pixel, as many as `grid_size` says.
    """
    image = np.empty((size[1], size[0], 4), np.float32)
    interpolate = kernels().upsample_rows.partial(grid=grid, factor=stride, image=image)
    threads.for_rows(lambda first, end: interpolate(first_row=first, end_row=end), image)
    return image


def refine_grid(
    grid: Float32, factor: int, difference_threshold: float, shape: tuple[int, int], threads: ThreadPool
) -> tuple[Float32, Bools]:
    """Return a finer grid of `shape` (columns, rows), float32 [rows, columns, 4], and which pixels of it to draw.

    grid: [h, w, 4], every `factor`-th pixel of it. Pixels to draw are 0: they lie between four pixels that differ by
    more than `difference_threshold`, as ScreenSampling says. Others are bilinear.
    """
    image, is_drawn = np.empty((shape[1], shape[0], 4), np.float32), np.empty((shape[1], shape[0]), np.bool_)
    refine = kernels().refine_rows.partial(
        grid=grid, factor=factor, image=image, threshold=difference_threshold, is_drawn=is_drawn
    )
    threads.for_rows(lambda first, end: refine(first_row=first, end_row=end), image)
    return image, is_drawn
