"""Divide pixel grids into tiles, and find the bricks over each; kernels draw into them."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.kernels import kernels
from renderer.volume import Bools, Float32, Float64

# Pixels along the sides of a tile, without and with subsampling. Tiles of 16 draw each brick more often, and the rays
# of tiles of 64 do not fit into the cache.
TILE_SIDE, SMALL_TILE_SIDE = 32, 16

# Pixels that are so near to a rectangle's edge count as inside: rounding may have moved the edge.
_EDGE_ROUNDING_PX = 2e-3


def make_grid(
    rectangles_px: Float64, stride: int, is_drawn: Bools, image: Float32, *, is_mixture: bool = False
) -> dict[str, Any]:
    """Return a grid of pixels into which bricks are drawn, in tiles: Grid in kernels.h.

    stride: the pixels of the grid are every `stride`-th pixel along both axes. Grid pixel 0 is the centre of pixel 0.
    side: of a tile, in pixels of the grid.
    rectangles: int64 [n, 4], left, top, right and bottom of each brick, half-open, in pixels of the grid and inside it.
    starts: int64 [tiles + 1], numbers: int64. The bricks over tile k are `numbers[starts[k] : starts[k + 1]]`, front to
        back.
    is_drawn: [rows, columns], the pixels of the grid that are drawn. image: float32 [rows, columns, 4], premultiplied
        RGBA.
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
    return {
        "side": side, "stride": stride, "rectangles": rectangles, "starts": starts[:-1], "numbers": numbers,
        "is_drawn": is_drawn, "image": image,
    }  # fmt: skip
