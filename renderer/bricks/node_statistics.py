"""Add up statistics of the nodes in bricks and around them: errors and visible bounds.

Of nodes that are streamed and not stored, only these statistics are kept: some hundred bytes for a brick of 16^3 nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from renderer.bricks.layout import BRICK_LEVELS, BRICK_SIZE, brick_grid_shape, grid_cells
from renderer.kernels import kernels
from renderer.pyramid import cell_voxel_counts
from renderer.volume import Array, Float32, Float64, Int32, Int64, UInt8, Volume


@dataclass(frozen=True)
class NodeStatistics:
    """A summary of the nodes of one level, by brick. Threads may add nodes of different bricks at the same time.

    max_error_by_neighbour: float64 [z, y, x, 3, 3, 3], for each brick and each neighbour at -1, 0 and 1 along z, y, x,
        the largest error of the brick's nodes in the neighbour's halo. The middle entry is for all nodes of the brick.
    bounds_by_neighbour: uint8 [z, y, x, 3, 3, 3, 2, 3], the bounds of the visible ones among these nodes: the lowest
        place (x, y, z) in the brick, and one above the highest place; BRICK_SIZE and 0 if no node is visible.
    max_error_below: float64 [z, y, x], the largest error of the nodes in each brick of the level below, half as wide.
    squared_errors_below: float64 [z, y, x], for each brick of the level below, the sum of squared errors of its nodes,
        weighted by their numbers of voxels, and divided by the square of the largest error.
    """

    volume: Volume
    level: int
    max_error_by_neighbour: Float64
    bounds_by_neighbour: UInt8
    max_error_below: Float64
    squared_errors_below: Float64

    @classmethod
    def empty(cls, volume: Volume, level: int) -> NodeStatistics:
        """Return statistics to which no nodes were added yet."""
        shape, below = brick_grid_shape(volume, level), brick_grid_shape(volume, level - 1)
        bounds = np.zeros((*shape, 3, 3, 3, 2, 3), np.uint8)
        bounds[..., 0, :] = BRICK_SIZE
        return cls(volume, level, np.zeros((*shape, 3, 3, 3)), bounds, np.zeros(below), np.zeros(below))

    def add(self, cells: Int32, sizes: Int64, errors: Float64, means: Array) -> None:
        """Add all nodes in some bricks of the level below.

        cells: [n, 3], the places (x, y, z) of nodes. sizes: [n], the numbers of voxels of the nodes. errors: [n], the
        errors of the nodes, in the measure's unit. means: [n, 4], the means of the nodes as a pyramid stores them.
        """
        # The bits of float16 numbers are compared with 0, which is faster: all bits of the number 0 are 0.
        depths = means[:, 3].view(np.uint16) if means.dtype == np.float16 else means[:, 3]
        kernels().add_nodes(
            cells=cells, sizes=sizes, errors=errors, is_visible=depths > 0,
            max_error_by_neighbour=self.max_error_by_neighbour, bounds_by_neighbour=self.bounds_by_neighbour,
            max_error_below=self.max_error_below, squared_errors_below=self.squared_errors_below,
        )  # fmt: skip

    def max_error(self) -> Float64:
        """Return the largest error of a node in each brick and its halo: float64 [z, y, x]."""
        largest = np.zeros(self.max_error_by_neighbour.shape[:3])
        for at, neighbours in _neighbours(self.max_error_by_neighbour):
            np.maximum(largest, neighbours[..., 2 - at[0], 2 - at[1], 2 - at[2]], out=largest)
        return largest

    def visible_bounds(self) -> Float32:
        """Return the visible bounds of the bricks of this level, as in BrickLevel: float32 [z, y, x, 2, 3]."""
        shape = self.max_error_by_neighbour.shape[:3]
        low, end = np.full((*shape, 3), BRICK_SIZE + 1), np.full((*shape, 3), -BRICK_SIZE)
        for at, neighbours in _neighbours(self.bounds_by_neighbour):
            of_neighbours = neighbours[..., 2 - at[0], 2 - at[1], 2 - at[2], :, :].astype(np.int64)
            is_visible = of_neighbours[..., 0, :] < of_neighbours[..., 1, :]  # beyond the border, both bounds are 0
            of_neighbours += BRICK_SIZE * (np.array(at[::-1]) - 1)
            np.minimum(low, of_neighbours[..., 0, :], out=low, where=is_visible)
            np.maximum(end, of_neighbours[..., 1, :], out=end, where=is_visible)
        extents = np.array(self.volume.shape_xyz) / 2.0**self.level - BRICK_SIZE * grid_cells(shape).reshape(*shape, 3)
        # By interpolation, cell k is visible from the centre of cell k - 1 to the centre of cell k + 1.
        bounds = np.stack([np.maximum(low - 0.5, 0.0), np.minimum(end + 0.5, np.minimum(extents, BRICK_SIZE))], axis=3)
        return np.where((low < end)[..., None, :], bounds, 0.0).astype(np.float32)

    def step_errors_below(self) -> Float64:
        """Return the step errors of the bricks of the level below, as in BrickLevel: float64 [z, y, x].

        Sub-voxel variation is left out.
        """
        shape = self.max_error_below.shape
        sizes = cell_voxel_counts(grid_cells(shape), self.level - 1 + BRICK_LEVELS, self.volume).reshape(shape)
        return or_of_neighbours(self.max_error_below * np.sqrt(self.squared_errors_below / sizes))


def or_of_neighbours(errors: Float64) -> Float64:
    """Return errors of bricks, float64 [z, y, x], in which each 0 is replaced by the largest error of a neighbour."""
    of_neighbours = np.zeros(errors.shape)
    for _, neighbours in _neighbours(errors):
        np.maximum(of_neighbours, neighbours, out=of_neighbours)
    return np.asarray(np.where(errors > 0, errors, of_neighbours))


def _neighbours(of_brick: Array) -> Iterator[tuple[tuple[int, ...], Array]]:
    """Yield, for each place at -1, 0 and 1 along z, y, x beside a brick, the place and the values of the bricks there.

    A place is given as three indices from 0 to 2. Values are 0 beyond the border. of_brick: [z, y, x, ...], a value of
    each brick.
    """
    shape = of_brick.shape[:3]
    padded = np.pad(of_brick, [(1, 1)] * 3 + [(0, 0)] * (of_brick.ndim - 3))
    for at in np.ndindex(3, 3, 3):
        yield at, padded[tuple(slice(k, k + n) for k, n in zip(at, shape, strict=True))]
