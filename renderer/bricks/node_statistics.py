"""Add up what bricks need to know of the nodes in them and around them.

Nodes that are streamed and not stored leave only this: some hundred bytes for a brick of 16^3 nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.bricks import kernels
from renderer.bricks.kernels import BRICK_LEVELS, BRICK_SIZE
from renderer.pyramid import cell_voxel_counts
from renderer.volume import Volume

Array = npt.NDArray[Any]
Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]


@dataclass(frozen=True)
class NodeStatistics:
    """Statistics of the nodes of one level, by brick. Threads may add nodes of different bricks at the same time.

    max_error_by_neighbour: float64 [z, y, x, 3, 3, 3], the largest error of those nodes of each brick of this level
        that are in the halo of its neighbours at -1, 0 and 1 along z, y, x; in the middle, of all its nodes.
    bounds_by_neighbour: uint8 [z, y, x, 3, 3, 3, 2, 3], the lowest and the highest of the cells (x, y, z), 0 to
        BRICK_SIZE - 1, of the same nodes where visible. The lowest is above the highest if no node is visible.
    max_error_below, squared_errors_below: float64 [z, y, x], of the nodes in each brick of the level below, half as
        wide: the largest error, and the sum of the squares of all errors divided by it, weighted by numbers of voxels.
    """

    volume: Volume
    level: int
    max_error_by_neighbour: Float64
    bounds_by_neighbour: npt.NDArray[np.uint8]
    max_error_below: Float64
    squared_errors_below: Float64

    @classmethod
    def empty(cls, volume: Volume, level: int) -> NodeStatistics:
        """Return the statistics of no nodes."""
        shape, below = brick_grid_shape(volume, level), brick_grid_shape(volume, level - 1)
        bounds = np.zeros((*shape, 3, 3, 3, 2, 3), np.uint8)
        bounds[..., 0, :] = BRICK_SIZE
        return cls(volume, level, np.zeros((*shape, 3, 3, 3)), bounds, np.zeros(below), np.zeros(below))

    def add(self, cells: Int32, errors: Float64, means: Array) -> None:
        """Add all nodes in some bricks of the level below: cells [n, 3] (x, y, z), errors [n], stored means [n, 4]."""
        sizes = cell_voxel_counts(cells, self.level, self.volume)
        depths = means[:, 3].view(np.uint16) if means.dtype == np.float16 else means[:, 3]  # 0 has no bits
        kernels.accumulate_by_neighbour(errors, depths, cells, self.max_error_by_neighbour, self.bounds_by_neighbour)
        kernels.accumulate_max(errors, cells, BRICK_LEVELS - 1, self.max_error_below)
        kernels.accumulate_squares(
            errors, sizes, cells, BRICK_LEVELS - 1, self.max_error_below, self.squared_errors_below
        )

    def max_error(self) -> Float64:
        """float64 [z, y, x]: the largest error in each brick and its halo."""
        largest = np.zeros(self.max_error_by_neighbour.shape[:3])
        for at, neighbours in _neighbours(self.max_error_by_neighbour):
            np.maximum(largest, neighbours[..., 2 - at[0], 2 - at[1], 2 - at[2]], out=largest)
        return largest

    def visible_bounds(self) -> npt.NDArray[np.float32]:
        """float32 [z, y, x, 2, 3], as in BrickLevel."""
        bounds = np.zeros((*self.bounds_by_neighbour.shape[:3], 2, 3), np.float32)
        kernels.find_node_bounds(self.bounds_by_neighbour, np.array(self.volume.shape_xyz) / 2.0**self.level, bounds)
        return bounds

    def step_errors_below(self) -> Float64:
        """float64 [z, y, x]: the step error estimates of the level below, as in BrickLevel."""
        shape = self.max_error_below.shape
        sizes = cell_voxel_counts(grid_cells(shape), self.level - 1 + BRICK_LEVELS, self.volume).reshape(shape)
        step_errors = self.max_error_below * np.sqrt(self.squared_errors_below / sizes)
        of_neighbours = np.zeros(shape)
        for _, neighbours in _neighbours(step_errors):
            np.maximum(of_neighbours, neighbours, out=of_neighbours)
        return np.asarray(np.where(step_errors > 0, step_errors, of_neighbours))


def brick_grid_shape(volume: Volume, level: int) -> tuple[int, int, int]:
    """Return the number of bricks of a level along z, y, x."""
    z, y, x = (((num - 1) >> (level + BRICK_LEVELS)) + 1 for num in volume.values.shape)
    return z, y, x


def grid_cells(shape: tuple[int, ...]) -> Int32:
    """int32 [n, 3]: all cells (x, y, z) of a grid [z, y, x], x fastest."""
    return np.ascontiguousarray(np.indices(shape, np.int32).reshape(3, -1)[::-1].T)


def _neighbours(of_brick: Float64) -> Iterator[tuple[tuple[int, ...], Float64]]:
    """Yield, for each neighbour at -1, 0 and 1 along z, y, x, its index from 0 to 2, and the values that bricks
    [z, y, x, ...] have there, 0 beyond the border."""
    shape = of_brick.shape[:3]
    padded = np.pad(of_brick, [(1, 1)] * 3 + [(0, 0)] * (of_brick.ndim - 3))
    for at in np.ndindex(3, 3, 3):
        yield at, padded[tuple(slice(k, k + n) for k, n in zip(at, shape, strict=True))]
