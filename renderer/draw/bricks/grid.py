"""Divide grids of rays into tiles, and find the bricks over each; kernels draw into them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.kernels import Grid, kernels
from renderer.volume import Float32, Float64, Int32

# Pixels along the sides of a tile, without and with subsampling. Tiles of 16 draw each brick more often, and the rays
# of tiles of 64 do not fit into the cache.
TILE_SIDE, SMALL_TILE_SIDE = 32, 16

# Pixels that are so near to a rectangle's edge count as inside: rounding may have moved the edge.
_EDGE_ROUNDING_PX = 2e-3


class RayGrid(NamedTuple):
    """A grid of pixels, with one ray or several in each, of a picture or of some rows of it.

    rays: float32 [n, 4], what rays have gathered. shape: rows and columns of pixels.
    places: int32 [rows, columns], of the first ray of each pixel in `rays`, or -1 where none is drawn; None where each
        pixel has one ray.
    stride: the pixels of the grid are every `stride`-th pixel of the picture along both axes, from its first.
    rays_across: of a pixel, along rows and columns. is_scattered: as in Grid. first_row: of the pixels of the grid.
    """

    rays: Float32
    shape: tuple[int, int]
    places: Int32 | None = None
    stride: int = 1
    rays_across: int = 1
    is_scattered: bool = False
    first_row: int = 0

    @property
    def num_rays(self) -> int:
        """Return the number of rays to draw."""
        if self.places is None:
            return len(self.rays)
        return int(np.count_nonzero(self.places >= 0)) * self.rays_across**2


def make_grid(rectangles_px: Float64, grid: RayGrid, *, is_mixture: bool = False) -> Grid:
    """Return a grid of rays into which bricks are drawn, in tiles.

    rectangles_px: float64 [n, 4], left, top, right and bottom of each brick.
    """
    across = grid.rays_across
    side = TILE_SIDE if grid.stride == 1 and not is_mixture else SMALL_TILE_SIDE
    side -= side % across
    shape = grid.shape[1] * across, grid.shape[0] * across
    # From one ray to the next, and of the first one, in pixels.
    step, first = grid.stride / across, np.array([0.5 / across, 0.5 / across + grid.first_row])
    # Rays are off their rows and columns by up to this, in pixels.
    shear = 0.5 if grid.is_scattered else (0.5 - 0.5 / across) / across
    low = np.ceil((rectangles_px[:, :2] - first - shear - _EDGE_ROUNDING_PX) / step)
    high = np.floor((rectangles_px[:, 2:] - first + shear + _EDGE_ROUNDING_PX) / step) + 1
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
        stride=grid.stride,
        rays_across=across,
        is_scattered=grid.is_scattered,
        first_row=grid.first_row,
        shape=grid.shape,
        rectangles=rectangles,
        starts=starts[:-1],
        numbers=numbers,
        places=grid.places,
        rays=grid.rays,
    )
