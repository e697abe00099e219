"""The memory in which a pyramid is built: room for its lowest levels, and what every running task works with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.pyramid.kernels import BLOCK_SIZE
from renderer.threads import ThreadPool

Array = npt.NDArray[Any]
Int64 = npt.NDArray[np.int64]

# Levels inside a block.
BLOCK_LEVELS = 3

# Nodes on the three levels of a group.
NODES_OF_GROUP = (64, 8, 1)

# Tasks build whole cubes of 64^3 voxels, so that no two of them have nodes in the same brick of the levels 0 to 2.
CUBE_LEVELS = 6
# Blocks built by one task at most: many enough to hide the dispatch, few enough that their nodes stay in cache.
BLOCKS_PER_TASK = 1024

# Whether anything is visible in a cell is kept for cells of at most this many along an axis, which framing looks at.
MAX_OCCUPANCY_SIDE = 128

# Means and variances [g, n, c] of the 64 nodes of some groups, of their 8 parents, and of their root.
Groups = list[tuple[Array, Array]]

# NodeArrays means, stored errors and child masks of the visible nodes of one level.
NodeArrays = tuple[Array, Array, npt.NDArray[np.uint8]]


@dataclass(frozen=True)
class BlockLevelBuffers:
    """Where the levels inside blocks go: room for every node, visible or not, which costs addresses rather than memory.

    first_blocks: of each task, and their number; int64 [num_tasks + 1].
    counts: int64 [num_tasks, BLOCK_LEVELS], how many nodes the tasks stored.
    occupied, occupied_level: as in Pyramid.
    """

    first_blocks: Int64
    counts: Int64
    levels: tuple[NodeArrays, ...]
    occupied: npt.NDArray[np.bool_]
    occupied_level: int

    @classmethod
    def empty(
        cls, first_blocks: Int64, shape_xyz: tuple[int, int, int], dtype: type[Any], lowest: int
    ) -> BlockLevelBuffers:
        """For tasks with these blocks of a volume; nothing is stored yet. lowest: so many levels are not kept."""
        level = max(1, (max(shape_xyz) - 1).bit_length() - (MAX_OCCUPANCY_SIDE - 1).bit_length())
        occupied = np.zeros([((num - 1) >> level) + 1 for num in shape_xyz[::-1]], np.bool_)
        counts = np.zeros((len(first_blocks) - 1, BLOCK_LEVELS), np.int64)
        num_blocks = int(first_blocks[-1])
        levels = (
            empty_node_arrays(num_blocks * num if k >= lowest else 0, dtype, masked=k > 0)
            for k, num in enumerate(NODES_OF_GROUP)
        )
        return cls(first_blocks, counts, tuple(levels), occupied, level)

    def of_task(self, task: int, level: int) -> NodeArrays:
        """The part for the nodes of one task, `level` being 0 for the lowest."""
        first, end = self.first_blocks[task : task + 2] * NODES_OF_GROUP[level]
        means, errors, masks = (array[first:end] for array in self.levels[level])
        return means, errors, masks

    def compacted(self, num_threads: int) -> list[NodeArrays]:
        """The levels without the gaps between tasks: moved together where they lie, then cut off."""

        def compact(level_and_array: tuple[int, Array]) -> None:
            level, array = level_and_array
            end = 0
            for task, num in enumerate(self.counts[:, level]):
                start = self.first_blocks[task] * NODES_OF_GROUP[level]
                if end < start:
                    array[end : end + num] = array[start : start + num]
                end += num
            array.resize((end, *array.shape[1:]), refcheck=False)

        with ThreadPool(num_threads) as pool:
            pool.map(compact, [(k, array) for k, level in enumerate(self.levels) for array in level if len(array)])
        return list(self.levels)


def empty_node_arrays(num: int, dtype: type[Any], *, masked: bool) -> NodeArrays:
    """BlockLevelBuffers for so many nodes, with masks or, on level 1, without."""
    return np.empty((num, 4), dtype), np.empty(num, dtype), np.empty(num if masked else 0, np.uint8)


@dataclass(frozen=True)
class Scratch:
    """Memory of one running task, used again by the next: fresh pages cost more than the arithmetic done in them.

    nodes, errors: groups of what is averaged and of what errors are measured of; None where that is the same.
    final: bool [g, 8] and [g, 1], the nodes of which the children are left out.
    visible, spreads: float32 [., 4] and [.], nodes on their way to the room. voxels: float32 [512, 4], one block.
    passing: by level, nodes that are told and then forgotten; none of levels that are kept.
    """

    nodes: Groups
    errors: Groups | None
    final: tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]
    visible: npt.NDArray[np.float32]
    spreads: npt.NDArray[np.float32]
    voxels: npt.NDArray[np.float32]
    passing: tuple[NodeArrays, ...]

    @classmethod
    def empty(
        cls,
        num_groups: int,
        error_layout: tuple[int, type[Any]] | None,
        passing: tuple[int, type[Any]] = (0, np.float16),
    ) -> Scratch:
        """For so many groups. error_layout: channels and dtype of what errors are measured of, where that differs.

        passing: how many levels are not kept, and the dtype in which they would be.
        """
        nodes = _empty_groups(num_groups, 4, np.float32)
        errors = _empty_groups(num_groups, *error_layout) if error_layout else None
        final = np.zeros((num_groups, 8), np.bool_), np.zeros((num_groups, 1), np.bool_)
        shapes = (num_groups * 64, 4), (num_groups * 64,), (BLOCK_SIZE**3, 4)
        visible, spreads, voxels = (np.empty(shape, np.float32) for shape in shapes)
        forgotten = (
            empty_node_arrays(num_groups * num, passing[1], masked=k > 0)
            for k, num in enumerate(NODES_OF_GROUP[: passing[0]])
        )
        return cls(nodes, errors, final, visible, spreads, voxels, tuple(forgotten))

    def first(self, num_groups: int) -> Scratch:
        """As much of it as so many groups need."""
        errors = [(m[:num_groups], v[:num_groups]) for m, v in self.errors] if self.errors else None
        nodes = [(m[:num_groups], v[:num_groups]) for m, v in self.nodes]
        final = self.final[0][:num_groups], self.final[1][:num_groups]
        return replace(self, nodes=nodes, errors=errors, final=final)


def _empty_groups(num_groups: int, num_channels: int, dtype: Any) -> Groups:
    shapes = [(num_groups, num_nodes, num_channels) for num_nodes in NODES_OF_GROUP]
    return [(np.empty(shape, dtype), np.empty(shape, dtype)) for shape in shapes]
