"""The memory in which a pyramid is built: buffers for its lowest levels, and the scratch of each running task."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

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

# Tasks build whole cubes of 64^3 voxels, so that no two of them have nodes in the same brick of levels 0 to 2.
CUBE_LEVELS = 6
# Most blocks of a task: enough to hide the dispatch, few enough that their nodes stay in cache.
BLOCKS_PER_TASK = 1024

# Framing reads a grid of visible cells that has at most this many along an axis.
MAX_OCCUPANCY_SIDE = 128

# Means and variances [g, n, c] of the 64 nodes of some groups, of their 8 parents, and of their root.
Groups = list[tuple[Array, Array]]


class NodeArrays(NamedTuple):
    """Stored means [n, 4], stored errors [n] and child masks uint8 [n] of the visible nodes of one level."""

    means: Array
    errors: Array
    masks: npt.NDArray[np.uint8]

    def part(self, first: int, end: int) -> NodeArrays:
        """Return the nodes from `first` to `end`; views."""
        return NodeArrays(*(array[first:end] for array in self))


@dataclass(frozen=True)
class BlockLevelBuffers:
    """Where the levels inside blocks go: addresses for all nodes, of which only those of visible nodes take memory.

    first_blocks: int64 [num_tasks + 1], the first block of each task, and the number of blocks.
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
        cls, first_blocks: Int64, shape_xyz: tuple[int, int, int], dtype: type[Any], num_streamed: int
    ) -> BlockLevelBuffers:
        """Return buffers for tasks with these blocks of a volume. The `num_streamed` lowest levels are not stored."""
        level = max(1, (max(shape_xyz) - 1).bit_length() - (MAX_OCCUPANCY_SIDE - 1).bit_length())
        occupied = np.zeros([((num - 1) >> level) + 1 for num in shape_xyz[::-1]], np.bool_)
        counts = np.zeros((len(first_blocks) - 1, BLOCK_LEVELS), np.int64)
        levels = (
            empty_node_arrays(int(first_blocks[-1]) * num if k >= num_streamed else 0, dtype, masked=k > 0)
            for k, num in enumerate(NODES_OF_GROUP)
        )
        return cls(first_blocks, counts, tuple(levels), occupied, level)

    def of_task(self, task: int, level: int) -> NodeArrays:
        """Return the part for the nodes of one task; level 0 is the lowest."""
        first, end = self.first_blocks[task : task + 2] * NODES_OF_GROUP[level]
        return self.levels[level].part(first, end)

    def compacted(self, num_threads: int) -> list[NodeArrays]:
        """Return the levels without the gaps between tasks, moved together in place and then cut off."""

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
    """Return arrays for `num` nodes, with masks or, on level 1, without."""
    return NodeArrays(np.empty((num, 4), dtype), np.empty(num, dtype), np.empty(num if masked else 0, np.uint8))


@dataclass(frozen=True)
class Scratch:
    """Memory of one running task, reused by the next: fresh pages cost more than the arithmetic done in them.

    nodes, errors: groups of what is averaged, and of what errors are measured of; None where that is the same.
    permanent_leaves: bool [g, 8] and [g, 1], the nodes whose children are left out.
    visible, deviations: float32 [., 4] and [.], nodes on their way to the buffers. voxels: float32 [512, 4], one block.
    streamed: by level, nodes that are passed to a callback and not stored.
    """

    nodes: Groups
    errors: Groups | None
    permanent_leaves: tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]
    visible: npt.NDArray[np.float32]
    deviations: npt.NDArray[np.float32]
    voxels: npt.NDArray[np.float32]
    streamed: tuple[NodeArrays, ...]

    @classmethod
    def empty(
        cls,
        num_groups: int,
        error_layout: tuple[int, type[Any]] | None,
        num_streamed: int = 0,
        dtype: type[Any] = np.float16,
    ) -> Scratch:
        """Return scratch for some groups.

        error_layout: channels and dtype of what errors are measured of, where that is not what is averaged.
        num_streamed, dtype: how many levels are streamed, and in which precision.
        """
        nodes = _empty_groups(num_groups, 4, np.float32)
        errors = _empty_groups(num_groups, *error_layout) if error_layout else None
        permanent_leaves = np.zeros((num_groups, 8), np.bool_), np.zeros((num_groups, 1), np.bool_)
        shapes = (num_groups * 64, 4), (num_groups * 64,), (BLOCK_SIZE**3, 4)
        visible, deviations, voxels = (np.empty(shape, np.float32) for shape in shapes)
        streamed = (
            empty_node_arrays(num_groups * num, dtype, masked=k > 0)
            for k, num in enumerate(NODES_OF_GROUP[:num_streamed])
        )
        return cls(nodes, errors, permanent_leaves, visible, deviations, voxels, tuple(streamed))

    def limited_to(self, num_groups: int) -> Scratch:
        """Return the part that this number of groups needs; views."""
        errors = [(m[:num_groups], v[:num_groups]) for m, v in self.errors] if self.errors else None
        nodes = [(m[:num_groups], v[:num_groups]) for m, v in self.nodes]
        parents, roots = self.permanent_leaves
        return replace(self, nodes=nodes, errors=errors, permanent_leaves=(parents[:num_groups], roots[:num_groups]))


def _empty_groups(num_groups: int, num_channels: int, dtype: Any) -> Groups:
    shapes = [(num_groups, num_nodes, num_channels) for num_nodes in NODES_OF_GROUP]
    return [(np.empty(shape, dtype), np.empty(shape, dtype)) for shape in shapes]
