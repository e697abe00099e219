"""Divide grids of rays into tiles, and find the bricks over each tile; kernels draw these bricks into the rays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.kernels import Grid, kernels
from renderer.volume import Bools, Float32, Float64, Int32

# Rays along the sides of a tile of a picture with a ray for every pixel. With 16, bricks are set up for more tiles, and
# with 64 the rays of a tile do not fit into the cache.
TILE_SIDE = 32

# Rays along the sides of a tile of a subsampled grid or of a mixture of volumes.
SMALL_TILE_SIDE = 16

# Rays at most this far outside of a brick's rectangle, in pixels, count as inside: rounding may have moved its edges.
_EDGE_ROUNDING_PX = 2e-3


class RayGrid(NamedTuple):
    """A grid of pixels, with one ray or several in each, of a picture or of some rows of a picture.

    rays: float32 [n, 4], the colours, or other amounts, that rays have gathered. shape: rows and columns of pixels.
    places: int32 [rows, columns], the index in `rays` of each pixel's first ray, or -1 where none is drawn; None where
        each pixel has one ray.
    stride: the pixels of the grid are every `stride`-th pixel of the picture along both axes, from its first pixel.
    rays_across: the rays along each side of a pixel. is_scattered: as in the record Grid of kernels.
    first_row: the row of the picture in which the grid begins.
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
    """Return the record Grid of kernels: a grid of rays in tiles, with the bricks over each tile.

    rectangles_px: float64 [n, 4], left, top, right and bottom of each brick in the picture.
    """
    across = grid.rays_across
    side = TILE_SIDE if grid.stride == 1 and not is_mixture else SMALL_TILE_SIDE
    side -= side % across
    shape = grid.shape[1] * across, grid.shape[0] * across
    step = grid.stride / across  # from one ray to the next, in pixels
    first = np.array([0.5 / across, 0.5 / across + grid.first_row])  # x and y of the first ray, in pixels
    # Rays are displaced from a regular lattice by up to this distance along each axis, in pixels.
    shear = 0.5 if grid.is_scattered else (0.5 - 0.5 / across) / across
    rectangles, tile_windows = np.empty((2, len(rectangles_px), 4), np.int64)
    kernels().place_bricks(
        rectangles_px=rectangles_px, first_px=first, step_px=step, reach_px=shear + _EDGE_ROUNDING_PX, shape=shape,
        side=side, rectangles=rectangles, tile_windows=tile_windows,
    )  # fmt: skip
    have_rays = _have_rays(grid, side // across)
    starts = np.zeros(have_rays.size + 2, np.int64)
    columns, rows = (tile_windows[:, 2:] - tile_windows[:, :2]).T
    numbers = np.empty(np.dot(columns, rows), np.int64)
    kernels().bin_bricks(tile_windows=tile_windows, have_rays=have_rays, starts=starts, numbers=numbers)
    return Grid(
        side=side,
        stride=grid.stride,
        rays_across=across,
        is_scattered=grid.is_scattered,
        first_row=grid.first_row,
        shape=grid.shape,
        rectangles=rectangles,
        starts=starts[:-1],
        numbers=numbers[: starts[-1]],
        places=grid.places,
        rays=grid.rays,
    )


def _have_rays(grid: RayGrid, side: int) -> Bools:
    """Return whether any ray of each tile is drawn, bool [rows, columns]. side: the side of a tile, in pixels."""
    if grid.places is None:
        return np.ones([-(-num // side) for num in grid.shape], np.bool_)
    found = grid.places >= 0
    for axis, num in enumerate(grid.shape):
        found = np.logical_or.reduceat(found, range(0, num, side), axis)
    return np.ascontiguousarray(found)
