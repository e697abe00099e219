"""What bricks must know of the nodes in them and around them, added up while the nodes go by.

Of nodes that are not stored this is all that stays: some hundred bytes for a brick of 16^3 nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.bricks import kernels
from renderer.bricks.kernels import BRICK_LEVELS, BRICK_SIZE
from renderer.pyramid import STREAMED_LEVELS, cell_voxel_counts
from renderer.volume import Volume

Array = npt.NDArray[Any]
Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]


@dataclass(frozen=True)
class NodeStatistics:
    """Of the nodes of one level, brick by brick. Threads may add at a time what no brick has in common.

    max_error_by_neighbour: float64 [z, y, x, 3, 3, 3], the largest error of the nodes of each brick of this level that
    are in the
        apron of its neighbours at -1, 0 and 1 along z, y, x; in the middle of all.
    bounds_by_neighbour: uint8 [z, y, x, 3, 3, 3, 2, 3], the same of where visible nodes are: the lowest and the highest
    of
        their places (x, y, z), 0 to BRICK_SIZE - 1. The lowest is above the highest where there are none.
    max_error_below, squared_errors_below: float64 [z, y, x], of the nodes in each brick of the level below, half as
    wide: the
        largest error, and the sum of the squares of all over it, times the nodes' numbers of voxels.
    """

    volume: Volume
    level: int
    max_error_by_neighbour: Float64
    bounds_by_neighbour: npt.NDArray[np.uint8]
    max_error_below: Float64
    squared_errors_below: Float64

    @classmethod
    def empty(cls, volume: Volume, level: int) -> NodeStatistics:
        """Before the first nodes."""
        shape, below = brick_grid_shape(volume, level), brick_grid_shape(volume, level - 1)
        bounds = np.zeros((*shape, 3, 3, 3, 2, 3), np.uint8)
        bounds[..., 0, :] = BRICK_SIZE
        return cls(volume, level, np.zeros((*shape, 3, 3, 3)), bounds, np.zeros(below), np.zeros(below))

    def add(self, cells: Int32, errors: Float64, means: Array) -> None:
        """Nodes at `cells` [n, 3] (x, y, z), all that are in some bricks of the level below, with their errors [n] and
        stored means [n, 4]."""
        sizes = cell_voxel_counts(cells, self.level, self.volume)
        depths = means[:, 3].view(np.uint16) if means.dtype == np.float16 else means[:, 3]  # 0 has no bits
        kernels.accumulate_by_neighbour(errors, depths, cells, self.max_error_by_neighbour, self.bounds_by_neighbour)
        kernels.accumulate_max(errors, cells, BRICK_LEVELS - 1, self.max_error_below)
        kernels.accumulate_squares(
            errors, sizes, cells, BRICK_LEVELS - 1, self.max_error_below, self.squared_errors_below
        )

    def largest(self) -> Float64:
        """float64 [z, y, x]: the largest error in each brick and its apron."""
        largest = np.zeros(self.max_error_by_neighbour.shape[:3])
        for at, neighbours in _neighbours(self.max_error_by_neighbour):
            np.maximum(largest, neighbours[..., 2 - at[0], 2 - at[1], 2 - at[2]], out=largest)
        return largest

    def boxes(self) -> npt.NDArray[np.float32]:
        """float32 [z, y, x, 2, 3], as in BrickLevel."""
        boxes = np.zeros((*self.bounds_by_neighbour.shape[:3], 2, 3), np.float32)
        kernels.find_node_bounds(self.bounds_by_neighbour, np.array(self.volume.shape_xyz) / 2.0**self.level, boxes)
        return boxes

    def step_errors_below(self) -> Float64:
        """float64 [z, y, x]: of the bricks of the level below, as in BrickLevel."""
        shape = self.max_error_below.shape
        sizes = cell_voxel_counts(grid_cells(shape), self.level - 1 + BRICK_LEVELS, self.volume).reshape(shape)
        roughness = self.max_error_below * np.sqrt(self.squared_errors_below / sizes)
        return np.asarray(np.where(roughness > 0, roughness, _max_of_neighbours(roughness)))


@dataclass(frozen=True)
class StreamedNodeStatistics:
    """Of the levels that are not stored."""

    levels: tuple[NodeStatistics, ...]

    @classmethod
    def empty(cls, volume: Volume) -> StreamedNodeStatistics:
        """Before the first nodes."""
        return cls(tuple(NodeStatistics.empty(volume, level) for level in range(1, STREAMED_LEVELS + 1)))

    def add(self, level: int, cells: Int32, errors: Float64, means: Array) -> None:
        """As `renderer.pyramid.pyramid.NodeCallback`."""
        self.levels[level - 1].add(cells, errors, means)


def brick_grid_shape(volume: Volume, level: int) -> tuple[int, int, int]:
    """How many bricks of a level there are along z, y, x."""
    z, y, x = (((num - 1) >> (level + BRICK_LEVELS)) + 1 for num in volume.values.shape)
    return z, y, x


def grid_cells(shape: tuple[int, ...]) -> Int32:
    """int32 [n, 3]: all cells (x, y, z) of a grid [z, y, x], x fastest."""
    return np.ascontiguousarray(np.indices(shape, np.int32).reshape(3, -1)[::-1].T)


def _max_of_neighbours(of_brick: Float64) -> Float64:
    """float64 [z, y, x]: the largest of each brick and its neighbours."""
    largest = np.zeros(of_brick.shape)
    for _, neighbours in _neighbours(of_brick):
        np.maximum(largest, neighbours, out=largest)
    return largest


def _neighbours(of_brick: Float64) -> Iterator[tuple[tuple[int, ...], Float64]]:
    """Places 0 to 2 along z, y, x of neighbours at -1, 0 and 1, the brick itself among them, and what each brick of
    [z, y, x, ...] has there, 0 beyond the border."""
    shape = of_brick.shape[:3]
    padded = np.pad(of_brick, [(1, 1)] * 3 + [(0, 0)] * (of_brick.ndim - 3))
    for at in np.ndindex(3, 3, 3):
        yield at, padded[tuple(slice(k, k + n) for k, n in zip(at, shape, strict=True))]
