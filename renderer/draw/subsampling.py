"""Interpolate images between the pixels of a subsampled grid, compiled."""

from __future__ import annotations

import numpy as np

from renderer.compiled import jit
from renderer.kernels import ThreadPool
from renderer.volume import Bools, Float32

_MIN_PIXELS_PER_THREAD = 1 << 16


def grid_size(size: tuple[int, int], stride: int) -> tuple[int, int]:
    """Return columns and rows of a grid that covers an image of (width, height).

    It has every `stride`-th pixel along both axes, from the first one to the last or beyond.
    """
    return -(-(size[0] - 1) // stride) + 1, -(-(size[1] - 1) // stride) + 1


def upsample(grid: Float32, stride: int, size: tuple[int, int], threads: ThreadPool) -> Float32:
    """Interpolate an image of `size` (width, height) bilinearly: float32 [height, width, 4].

    grid: [h, w, 4], every `stride`-th pixel, as many as `grid_size` says.
    """
    width, height = size
    image = np.empty((height, width, 4), np.float32)

    def work(first: int, end: int) -> None:
        _upsample_rows(grid, stride, (first, end), image)

    threads.for_ranges(work, height, -(-_MIN_PIXELS_PER_THREAD // width))
    return image


@jit
def _upsample_rows(grid: Float32, stride: int, rows: tuple[int, int], image: Float32) -> None:
    """Interpolate some rows: first between two rows of the grid, then along the row."""
    width = image.shape[1]
    num_rows, num_columns, _ = grid.shape
    between = np.empty((num_columns, 4), np.float32)
    for row in range(rows[0], rows[1]):
        above = row // stride
        below, share = min(above + 1, num_rows - 1), np.float32((row - above * stride) / stride)
        for column in range(num_columns):
            for k in range(4):
                value = grid[above, column, k]
                between[column, k] = value + share * (grid[below, column, k] - value)
        for left in range(num_columns):
            right, first = min(left + 1, num_columns - 1), left * stride
            for column in range(first, min(first + stride, width)):
                part = np.float32((column - first) / stride)
                for k in range(4):
                    image[row, column, k] = between[left, k] + part * (between[right, k] - between[left, k])


def refine_grid(
    grid: Float32, factor: int, difference_threshold: float, shape: tuple[int, int], threads: ThreadPool
) -> tuple[Float32, Bools]:
    """Return a finer grid of `shape` (columns, rows), float32 [rows, columns, 4], and which pixels of it to draw.

    grid: [h, w, 4], every `factor`-th pixel of it. Pixels to draw are 0: they lie between four pixels that differ by
    more than `difference_threshold`, as ScreenSampling says. Others are bilinear.
    """
    image = np.empty((shape[1], shape[0], 4), np.float32)
    is_drawn = np.empty(image.shape[:2], np.bool_)
    differ = _needs_refinement(grid, np.float32(difference_threshold))

    def work(first: int, end: int) -> None:
        _refine_rows(grid, factor, differ, (first, end), image, is_drawn)

    threads.for_ranges(work, shape[1], -(-_MIN_PIXELS_PER_THREAD // shape[0]))
    return image, is_drawn


@jit
def _needs_refinement(grid: Float32, difference_threshold: np.float32) -> Bools:
    """Return which blocks of four pixels, at their lowest one, differ and bend by more than a threshold: [h, w]."""
    num_rows, num_columns, _ = grid.shape
    bends, differ = np.zeros((num_rows, num_columns), np.float32), np.empty((num_rows, num_columns), np.bool_)
    for row in range(num_rows):
        above, below = max(row - 1, 0), min(row + 1, num_rows - 1)
        for column in range(num_columns):
            left, right = max(column - 1, 0), min(column + 1, num_columns - 1)
            for k in range(4):
                twice = np.float32(2) * grid[row, column, k]
                across = abs(grid[row, left, k] - twice + grid[row, right, k])
                down = abs(grid[above, column, k] - twice + grid[below, column, k])
                bends[row, column] = max(bends[row, column], across, down)
    for row in range(num_rows):
        below = min(row + 1, num_rows - 1)
        for column in range(num_columns):
            right = min(column + 1, num_columns - 1)
            most = np.float32(0.0)
            for k in range(4):
                one, two = grid[row, column, k], grid[row, right, k]
                three, four = grid[below, column, k], grid[below, right, k]
                most = max(most, max(one, two, three, four) - min(one, two, three, four))
            bend = max(bends[row, column], bends[row, right], bends[below, column], bends[below, right])
            differ[row, column] = most > difference_threshold and bend > difference_threshold
    return differ


@jit
def _refine_rows(
    grid: Float32, factor: int, differ: Bools, rows: tuple[int, int], image: Float32, is_drawn: Bools
) -> None:
    num_columns = image.shape[1]
    for row in range(rows[0], rows[1]):
        above = row // factor
        below, down = min(above + 1, grid.shape[0] - 1), np.float32((row % factor) / factor)
        for column in range(num_columns):
            left, rest = column // factor, column % factor
            is_drawn[row, column] = differ[above, left] and (rest > 0 or row % factor > 0)
            if is_drawn[row, column]:
                image[row, column] = 0
                continue
            right, share = min(left + 1, grid.shape[1] - 1), np.float32(rest / factor)
            for k in range(4):
                upper = grid[above, left, k] + share * (grid[above, right, k] - grid[above, left, k])
                lower = grid[below, left, k] + share * (grid[below, right, k] - grid[below, left, k])
                image[row, column, k] = upper + down * (lower - upper)
