"""Hold and store the nodes that the kernels of `nodes.cpp` build.

Nodes come in *groups* of three levels: 64 nodes, their 8 parents, and one root. Levels 1, 2 and 3 of a block of 8^3
voxels are a group. The roots of up to 64 groups are the lowest level of another group, with the levels 3, 4 and 5, and
so on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.kernels import kernels
from renderer.volume import Array, Float32, Float64, Int32, Int64, UInt8

# The number of nodes of each level of a group.
NODES_OF_GROUP = (64, 8, 1)

# The number of voxels along each side of a block.
BLOCK_SIZE = 8


class VisibleNodes(NamedTuple):
    """Arrays for the visible nodes of several groups, with the parts for their three levels one after the other.

    means: float32 [n, 4]. deviations: float32 [n], the roots of variances, which are summed over channels. masks: as in
        Level; unused for level 1. cells: int32 [n, 3], the places (x, y, z) of nodes, and sizes: int64 [n], their
        numbers of voxels; both are empty if they are not asked for.
    counts: int64 [3], the number of visible nodes of each level. They are at the beginning of the level's part, in
        Morton order.
    root_means: float32 [g, 4], the means of the groups' roots, visible or not.
    root_error_means, root_variances: float64 [g, c], the means and variances of the roots in the channels that errors
        are measured on.
    """

    means: Float32
    deviations: Float32
    masks: UInt8
    cells: Int32
    sizes: Int64
    counts: Int64
    root_means: Float32
    root_error_means: Float64
    root_variances: Float64

    @classmethod
    def empty(cls, num_groups: int, num_channels: int, *, listed: bool = False) -> VisibleNodes:
        """Return arrays for some groups.

        num_channels: the number of channels that errors are measured on: 4, or 1 for scalars. listed: whether the
            arrays include `cells` and `sizes`.
        """
        num = num_groups * sum(NODES_OF_GROUP)
        errors = (np.empty((num_groups, num_channels)) for _ in range(2))
        of_nodes = np.empty((num, 4), np.float32), np.empty(num, np.float32), np.empty(num, np.uint8)
        places = np.empty((num * listed, 3), np.int32), np.empty(num * listed, np.int64)
        counts = np.empty(len(NODES_OF_GROUP), np.int64)
        return cls(*of_nodes, *places, counts, np.empty((num_groups, 4), np.float32), *errors)

    def of_level(self, part: int) -> slice:
        """Return the slice of the visible nodes of a level. part: 0, 1 or 2, the level within groups."""
        first = len(self.root_means) * sum(NODES_OF_GROUP[:part])
        return slice(first, first + int(self.counts[part]))


def packed_channels(values: Array) -> Array:
    """Return a view of four channels [..., 4] as one item [...], which numpy moves at once."""
    return values.view(np.uint64 if values.dtype == np.float16 else np.complex128)[..., 0]


def opacities_to_depths(means: Float32, max_depth: float) -> None:
    """Convert means of (a c, a) [n, 4] to optical depths times (c, 1), in place.

    In half precision, depths keep their digits, while opacities near 1 would lose them.
    """
    opacities = means[:, 3].astype(np.float64)
    with np.errstate(divide="ignore"):  # an opacity that rounds to 1 has the largest depth
        depths = np.minimum(-np.log1p(-np.minimum(opacities, 1)), max_depth)
    means *= (depths / opacities)[:, None]


def store_scaled(values: Float32, factor: float, out: Array) -> None:
    """Write `values` times `factor` (a power of two) in the precision of `out`."""
    if out.dtype == np.float16:
        kernels().store_float16(values=values.reshape(-1), factor=factor, out=out.view(np.uint16).reshape(-1))
    else:
        np.multiply(values, np.float32(factor), out=out)
