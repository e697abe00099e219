"""The memory in which a pyramid is built: arrays of stored nodes, and the scratch of each running task."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.pyramid.nodes import BLOCK_SIZE, Groups

Array = npt.NDArray[Any]
Bools = npt.NDArray[np.bool_]
Float32 = npt.NDArray[np.float32]

# Nodes on the three levels of a group.
NODES_OF_GROUP = (64, 8, 1)


class NodeArrays(NamedTuple):
    """Stored means [n, 4], stored errors [n] and child masks uint8 [n] of the visible nodes of one level."""

    means: Array
    errors: Array
    masks: npt.NDArray[np.uint8]

    @classmethod
    def empty(cls, num: int, dtype: type[Any], *, masked: bool) -> NodeArrays:
        """Return arrays for `num` nodes, with masks or, on level 1, without. Memory is taken when they are written."""
        return cls(np.empty((num, 4), dtype), np.empty(num, dtype), np.empty(num if masked else 0, np.uint8))

    def part(self, first: int, end: int) -> NodeArrays:
        """Return the nodes from `first` to `end`; views."""
        return NodeArrays(*(array[first:end] for array in self))


@dataclass(frozen=True)
class Scratch:
    """Memory of one running task, reused by the next: fresh pages cost more than the arithmetic done in them.

    nodes, errors: groups of what is averaged, and of what errors are measured of, which may be the same.
    permanent_leaves: bool [g, 8] and [g, 1], the nodes whose children are left out.
    visible, deviations: float32 [., 4] and [.], nodes on their way to where they are stored.
    voxels: float32 [512, 4], one block.
    """

    nodes: Groups
    errors: Groups
    permanent_leaves: tuple[Bools, Bools]
    visible: Float32
    deviations: Float32
    voxels: Float32

    @classmethod
    def empty(cls, num_groups: int, error_layout: tuple[int, type[Any]] | None = None) -> Scratch:
        """Return scratch for some groups.

        error_layout: channels and dtype of what errors are measured of, where that is not what is averaged.
        """
        nodes = _empty_groups(num_groups, 4, np.float32)
        errors = _empty_groups(num_groups, *error_layout) if error_layout else nodes
        permanent_leaves = np.zeros((num_groups, 8), np.bool_), np.zeros((num_groups, 1), np.bool_)
        shapes = (num_groups * 64, 4), (num_groups * 64,), (BLOCK_SIZE**3, 4)
        return cls(nodes, errors, permanent_leaves, *(np.empty(shape, np.float32) for shape in shapes))

    def limited_to(self, num_groups: int) -> Scratch:
        """Return the part that this number of groups needs; views."""
        nodes, errors = ([(m[:num_groups], v[:num_groups]) for m, v in each] for each in (self.nodes, self.errors))
        parents, roots = self.permanent_leaves
        return replace(self, nodes=nodes, errors=errors, permanent_leaves=(parents[:num_groups], roots[:num_groups]))


def _empty_groups(num_groups: int, num_channels: int, dtype: Any) -> Groups:
    shapes = [(num_groups, num_nodes, num_channels) for num_nodes in NODES_OF_GROUP]
    return [(np.empty(shape, dtype), np.empty(shape, dtype)) for shape in shapes]
