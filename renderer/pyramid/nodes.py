"""Make room for the nodes that the kernels of `nodes.cpp` build, and store their means.

Nodes come in *groups* of three levels: 64 nodes, their 8 parents, and one root. Levels 1, 2 and 3 of a block of 8^3
voxels are a group. The roots of up to 64 groups are the lowest level of another group, with the levels 3, 4 and 5, and
so on.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels import VisibleNodes, kernels
from renderer.volume import Array, Float32

# The number of nodes on each level of a group, from the lowest level up.
NODES_OF_GROUP = (64, 8, 1)

# The number of voxels along each side of a block.
BLOCK_SIZE = 8


def room_for_nodes(num_groups: int, num_channels: int) -> VisibleNodes:
    """Return arrays with room for the nodes of some groups; the numbers in the arrays are not set yet.

    num_channels: the number of channels that errors are measured on: 4, or 1 for scalars.
    """
    num = num_groups * sum(NODES_OF_GROUP)
    return VisibleNodes(
        means=np.empty((num, 4), np.float32),
        deviations=np.empty(num, np.float32),
        masks=np.empty(num, np.uint8),
        counts=np.empty(len(NODES_OF_GROUP), np.int64),
        root_means=np.empty((num_groups, 4), np.float32),
        root_error_means=np.empty((num_groups, num_channels)),
        root_variances=np.empty((num_groups, num_channels)),
    )


def nodes_of_level(nodes: VisibleNodes, part: int) -> slice:
    """Return the range of indices of the visible nodes on one level of the groups of 73 nodes.

    part: the level, 0 for the lowest.
    """
    first = len(nodes.root_means) * sum(NODES_OF_GROUP[:part])
    return slice(first, first + int(nodes.counts[part]))


def packed_channels(values: Array) -> Array:
    """Return a view of an array [..., 4] in which the four channels of a node are one item, which numpy moves at once.

    values: float16 or float32 [..., 4].
    """
    return values.view(np.uint64 if values.dtype == np.float16 else np.complex128)[..., 0]


def opacities_to_depths(means: Float32, max_depth: float) -> None:
    """Convert means of (a c, a), with the opacity a, to (depth c, depth), with the optical depth, in place.

    means: [n, 4]. max_depth: the largest optical depth of a voxel, to which depths are clamped.

    In half precision, depths keep their digits, while opacities near 1 would lose them.
    """
    opacities = means[:, 3].astype(np.float64)
    with np.errstate(divide="ignore"):  # an opacity that rounds to 1 has the largest depth
        depths = np.minimum(-np.log1p(-np.minimum(opacities, 1)), max_depth)
    means *= (depths / opacities)[:, None]


def store_scaled(values: Float32, factor: float, out: Array) -> None:
    """Write `values`, multiplied by `factor`, to `out`, in the precision of `out`. factor: a power of two."""
    if out.dtype == np.float16:
        kernels().store_float16(values=values.reshape(-1), factor=factor, out=out.view(np.uint16).reshape(-1))
    else:
        np.multiply(values, np.float32(factor), out=out)
