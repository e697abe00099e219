"""Divide pixel grids into tiles, and find the bricks over each; kernels draw into them."""

from __future__ import annotations

import numpy as np

from renderer.kernels import Grid, kernels
from renderer.volume import Bools, Float32, Float64

# Pixels along the sides of a tile, without and with subsampling. Tiles of 16 draw each brick more often, and the rays
# of tiles of 64 do not fit into the cache.
TILE_SIDE, SMALL_TILE_SIDE = 32, 16

# Pixels that are so near to a rectangle's edge count as inside: rounding may have moved the edge.
_EDGE_ROUNDING_PX = 2e-3


def make_grid(
    rectangles_px: Float64, stride: int, is_drawn: Bools, image: Float32, *, is_mixture: bool = False
) -> Grid:
    """Return a grid of pixels into which bricks are drawn, in tiles.

    rectangles_px: float64 [n, 4], left, top, right and bottom of each brick. Others as in Grid.
    """
    shape = is_drawn.shape[1], is_drawn.shape[0]
    side = TILE_SIDE if stride == 1 and not is_mixture else SMALL_TILE_SIDE
    low = np.ceil((rectangles_px[:, :2] - 0.5 - _EDGE_ROUNDING_PX) / stride)
    high = np.floor((rectangles_px[:, 2:] - 0.5 + _EDGE_ROUNDING_PX) / stride) + 1
    rectangles = np.clip(np.hstack([low, high]), 0, shape * 2).astype(np.int64)
    rectangles[(rectangles[:, :2] >= rectangles[:, 2:]).any(axis=1)] = 0
    tile_windows = np.hstack([rectangles[:, :2] // side, -(-rectangles[:, 2:] // side)])
    num_columns, num_rows = -(-shape[0] // side), -(-shape[1] // side)
    starts = np.zeros(num_columns * num_rows + 2, np.int64)
    numbers = np.empty(np.prod(tile_windows[:, 2:] - tile_windows[:, :2], axis=1).sum(), np.int64)
    kernels().bin_bricks(
        tile_windows=tile_windows, num_columns=num_columns, num_rows=num_rows, starts=starts, numbers=numbers
    )
    return Grid(
        side=side,
        stride=stride,
        rectangles=rectangles,
        starts=starts[:-1],
        numbers=numbers,
        is_drawn=is_drawn,
        image=image,
    )
