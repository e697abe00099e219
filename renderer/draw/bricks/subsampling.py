"""Interpolate images between the pixels of a subsampled grid, of which only every `stride`-th pixel is drawn."""

from __future__ import annotations

import numpy as np

from renderer.kernels import ThreadPool, kernels
from renderer.volume import Float32, Int32


def grid_size(size: tuple[int, int], stride: int) -> tuple[int, int]:
    """Return the columns and rows of the subsampled grid of an image of (width, height).

    The grid has every `stride`-th pixel along both axes, from the first pixel to the last or beyond it.
    """
    return -(-(size[0] - 1) // stride) + 1, -(-(size[1] - 1) // stride) + 1


def upsample(grid: Float32, stride: int, size: tuple[int, int], threads: ThreadPool) -> Float32:
    """Return an image of `size` (width, height), interpolated bilinearly from a grid: float32 [height, width, 4].

    grid: [h, w, 4], every `stride`-th pixel of the image, as many as `grid_size` says.
    """
    image = np.empty((size[1], size[0], 4), np.float32)
    interpolate = kernels().upsample_rows.partial(grid=grid, factor=stride, image=image)
    threads.for_rows(lambda first, end: interpolate(first_row=first, end_row=end), image)
    return image


def refine_grid(
    grid: Float32,
    factor: int,
    difference_threshold: float,
    shape: tuple[int, int],
    threads: ThreadPool,
    *,
    is_linear: bool = False,
) -> tuple[Float32, Int32]:
    """Return a finer grid of `shape` (columns, rows), float32 [rows, columns, 4], and which of its pixels to draw.

    grid: [h, w, 4], every `factor`-th pixel of the finer grid along both axes. is_linear: whether colours are linear
    light, and are compared as they are shown.
    Pixels between four that differ by more than `difference_threshold`, as ScreenSampling says, are to be drawn: they
    are 0 in the finer grid. Its other pixels are interpolated bilinearly. The choice is int32 [rows, columns]: the
    row-major number of a pixel that is to be drawn, -1 for other pixels.
    """
    image, places = np.empty((shape[1], shape[0], 4), np.float32), np.empty((shape[1], shape[0]), np.int32)
    refine = kernels().refine_rows.partial(
        grid=grid, factor=factor, image=image, threshold=difference_threshold, is_linear=is_linear, places=places
    )
    threads.for_rows(lambda first, end: refine(first_row=first, end_row=end), image)
    return image, places
