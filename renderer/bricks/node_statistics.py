"""Add up statistics of the nodes in bricks and around them: errors and visible bounds.

Of nodes that are streamed and not stored, only these statistics are kept: some hundred bytes for a brick of 16^3 nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from renderer.bricks.layout import BRICK_LEVELS, BRICK_SIZE, brick_grid_shape, grid_cells
from renderer.kernels import BrickSums, kernels
from renderer.pyramid import cell_voxel_counts
from renderer.volume import Array, Float32, Float64, Int32, Int64, Volume


@dataclass(frozen=True)
class NodeStatistics:
    """A summary of the nodes of one level, by brick. Threads may add nodes of different bricks at the same time.

    sums: the arrays to which nodes are added, for all bricks of the level.
    """

    volume: Volume
    level: int
    sums: BrickSums

    @classmethod
    def empty(cls, volume: Volume, level: int) -> NodeStatistics:
        """Return statistics to which no nodes were added yet."""
        shape, below = brick_grid_shape(volume, level), brick_grid_shape(volume, level - 1)
        bounds = np.zeros((*shape, 3, 3, 3, 2, 3), np.uint8)
        bounds[..., 0, :] = BRICK_SIZE
        return cls(volume, level, BrickSums(np.zeros((*shape, 3, 3, 3)), bounds, np.zeros(below), np.zeros(below)))

    def add(self, cells: Int32, sizes: Int64, errors: Float64, means: Array) -> None:
        """Add all nodes in some bricks.

        cells: [n, 3], the places (x, y, z) of nodes. sizes: [n], the numbers of voxels of the nodes. errors: [n], the
        errors of the nodes, in the measure's unit. means: [n, 4], the means of the nodes as a pyramid stores them.
        """
        kernels().add_nodes(cells=cells, sizes=sizes, errors=errors, is_visible=means[:, 3] > 0, sums=self.sums)

    def max_error(self) -> Float64:
        """Return the largest error of a node in each brick and its halo: float64 [z, y, x]."""
        largest = np.zeros(self.sums.max_error_by_neighbour.shape[:3])
        for at, neighbours in _neighbours(self.sums.max_error_by_neighbour):
            np.maximum(largest, neighbours[..., 2 - at[0], 2 - at[1], 2 - at[2]], out=largest)
        return largest

    def visible_bounds(self) -> Float32:
        """Return the visible bounds of the bricks of this level, as in BrickLevel: float32 [z, y, x, 2, 3]."""
        shape = self.sums.max_error_by_neighbour.shape[:3]
        low, end = np.full((*shape, 3), BRICK_SIZE + 1), np.full((*shape, 3), -BRICK_SIZE)
        for at, neighbours in _neighbours(self.sums.bounds_by_neighbour):
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
        shape = self.sums.max_error_below.shape
        sizes = cell_voxel_counts(grid_cells(shape), self.level - 1 + BRICK_LEVELS, self.volume).reshape(shape)
        return or_of_neighbours(self.sums.max_error_below * np.sqrt(self.sums.squared_errors_below / sizes))


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
