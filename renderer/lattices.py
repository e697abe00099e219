"""Pictures between the nodes of a lattice of pixels, compiled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.jit import jit


def interpolated(nodes: npt.NDArray[np.float32], stride: int, size: tuple[int, int]) -> npt.NDArray[np.float32]:
    """float32 [height, width, 4]: the picture of `size`, bilinear between nodes [h, w, 4] at every `stride`-th pixel.

    There are as many nodes as cover the picture.
    """
    width, height = size
    image = np.empty((height, width, 4), np.float32)
    _interpolate(nodes, stride, image)
    return image


@jit
def _interpolate(nodes: npt.NDArray[np.float32], stride: int, image: npt.NDArray[np.float32]) -> None:
    """Row by row: first between two rows of nodes, then along the row."""
    height, width, _ = image.shape
    num_rows, num_columns, _ = nodes.shape
    between = np.empty((num_columns, 4), np.float32)
    for row in range(height):
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
