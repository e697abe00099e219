"""Pictures between the nodes of a lattice of pixels, compiled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.jit import jit
from renderer.threads import ThreadPool

Bools = npt.NDArray[np.bool_]
Float32 = npt.NDArray[np.float32]

# Pixels that are worth a thread.
_MIN_PIXELS_PER_THREAD = 1 << 16


def num_nodes(size: tuple[int, int], stride: int) -> tuple[int, int]:
    """Columns and rows of a lattice that covers a picture of (width, height): every `stride`-th pixel along both axes,
    from the first one to the last or beyond."""
    return -(-(size[0] - 1) // stride) + 1, -(-(size[1] - 1) // stride) + 1


def interpolated(nodes: Float32, stride: int, size: tuple[int, int], threads: ThreadPool) -> Float32:
    """float32 [height, width, 4]: the picture of `size` (width, height), bilinear between nodes [h, w, 4] at every
    `stride`-th pixel, of which there are `num_nodes`."""
    width, height = size
    image = np.empty((height, width, 4), np.float32)

    def work(first: int, end: int) -> None:
        _interpolate(nodes, stride, first, end, image)

    threads.for_ranges(work, height, _min_rows_per_thread(width))
    return image


def _min_rows_per_thread(num_columns: int) -> int:
    return -(-_MIN_PIXELS_PER_THREAD // num_columns)


@jit
def _interpolate(nodes: Float32, stride: int, first_row: int, end_row: int, image: Float32) -> None:
    """Row by row: first between two rows of nodes, then along the row."""
    width = image.shape[1]
    num_rows, num_columns, _ = nodes.shape
    between = np.empty((num_columns, 4), np.float32)
    for row in range(first_row, end_row):
        above = row // stride
        below, share = min(above + 1, num_rows - 1), np.float32((row - above * stride) / stride)
        for column in range(num_columns):
            for k in range(4):
                value = nodes[above, column, k]
                between[column, k] = value + share * (nodes[below, column, k] - value)
        for left in range(num_columns):
            right, first = min(left + 1, num_columns - 1), left * stride
            for column in range(first, min(first + stride, width)):
                part = np.float32((column - first) / stride)
                for k in range(4):
                    image[row, column, k] = between[left, k] + part * (between[right, k] - between[left, k])


def refined(
    nodes: Float32, factor: int, spread: float, shape: tuple[int, int], threads: ThreadPool
) -> tuple[Float32, Bools]:
    """A finer lattice of `shape` (columns, rows), each `factor`-th of whose nodes are those given, [h, w, 4]: float32
    [rows, columns, 4], and bool [rows, columns], which of it are to be drawn.

    Those have 0: they lie between four nodes that differ, by more than `spread`, as Thrift says. Others are bilinear.
    """
    image = np.empty((shape[1], shape[0], 4), np.float32)
    is_drawn = np.empty(image.shape[:2], np.bool_)
    differ = _needs_refinement(nodes, np.float32(spread))

    def work(first: int, end: int) -> None:
        _refine(nodes, factor, differ, first, end, image, is_drawn)

    threads.for_ranges(work, shape[1], _min_rows_per_thread(shape[0]))
    return image, is_drawn


@jit
def _needs_refinement(nodes: Float32, spread: np.float32) -> Bools:
    """[h, w]: which four nodes, the lowest of which has this place, differ, and bend, by more than `spread`."""
    num_rows, num_columns, _ = nodes.shape
    bends, differ = np.zeros((num_rows, num_columns), np.float32), np.empty((num_rows, num_columns), np.bool_)
    for row in range(num_rows):
        above, below = max(row - 1, 0), min(row + 1, num_rows - 1)
        for column in range(num_columns):
            left, right = max(column - 1, 0), min(column + 1, num_columns - 1)
            for k in range(4):
                twice = np.float32(2) * nodes[row, column, k]
                across = abs(nodes[row, left, k] - twice + nodes[row, right, k])
                down = abs(nodes[above, column, k] - twice + nodes[below, column, k])
                bends[row, column] = max(bends[row, column], across, down)
    for row in range(num_rows):
        below = min(row + 1, num_rows - 1)
        for column in range(num_columns):
            right = min(column + 1, num_columns - 1)
            most = np.float32(0.0)
            for k in range(4):
                one, two = nodes[row, column, k], nodes[row, right, k]
                three, four = nodes[below, column, k], nodes[below, right, k]
                most = max(most, max(one, two, three, four) - min(one, two, three, four))
            bend = max(bends[row, column], bends[row, right], bends[below, column], bends[below, right])
            differ[row, column] = most > spread and bend > spread
    return differ


@jit
def _refine(
    nodes: Float32, factor: int, differ: Bools, first_row: int, end_row: int, image: Float32, is_drawn: Bools
) -> None:
    num_columns = image.shape[1]
    for row in range(first_row, end_row):
        above = row // factor
        below, down = min(above + 1, nodes.shape[0] - 1), np.float32((row % factor) / factor)
        for column in range(num_columns):
            left, rest = column // factor, column % factor
            is_drawn[row, column] = differ[above, left] and (rest > 0 or row % factor > 0)
            if is_drawn[row, column]:
                image[row, column] = 0
                continue
            right, share = min(left + 1, nodes.shape[1] - 1), np.float32(rest / factor)
            for k in range(4):
                upper = nodes[above, left, k] + share * (nodes[above, right, k] - nodes[above, left, k])
                lower = nodes[below, left, k] + share * (nodes[below, right, k] - nodes[below, left, k])
                image[row, column, k] = upper + down * (lower - upper)
