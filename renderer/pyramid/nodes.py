"""Turn voxels into nodes, merge nodes, and convert them to what is stored, by the kernels of `nodes.cpp` and
`visible_nodes.cpp`.

Nodes come in *groups*: 64 of them, their 8 parents, and the root of those. The levels 1, 2, 3 of a block of 8^3 voxels
are a group; the roots of up to 64 groups make the next one, with the levels 3, 4, 5, and so on. In each of the three
arrays of a group, and among the 512 voxels, the child k = x + 2 y + 4 z of node i is at k n + i, with n the number of
nodes: children are merged as eight contiguous rows. The 64 are then in Morton order with the two octal digits
exchanged, the 8 in Morton order. The channels of a node lie together; each has its own variance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from renderer.kernels import kernels
from renderer.transfer import Classifier, RawVoxels
from renderer.volume import Array, Bools, Float32, Int32, Int64, UInt8

NODES_OF_GROUP = (64, 8, 1)

BLOCK_SIZE = 8

# Where one coordinate of a node puts it among the 64 of a group, and among the 8 or the one.
NODE_OFFSETS = np.array([0, 8, 1, 9, 0, 1])


class Nodes(NamedTuple):
    """Nodes [g, n, c] of some groups: float32 with four channels, or float64 with one scalar."""

    means: Array
    variances: Array


class Groups(NamedTuple):
    """Groups: their 64 nodes, the 8 parents of those, and their root."""

    nodes: Nodes
    parents: Nodes
    roots: Nodes


@dataclass(frozen=True)
class Scratch:
    """A task's memory, which the next one uses again: fresh pages cost more than the arithmetic done in them.

    nodes, errors: groups of what is averaged, and of what errors are measured of, which may be the same.
    visible, deviations: float32 [., 4] and [.], nodes on their way to where they are stored.
    """

    nodes: Groups
    errors: Groups
    visible: Float32
    deviations: Float32

    @classmethod
    def empty(cls, num_groups: int, error_layout: tuple[int, type[Any]] | None = None) -> Scratch:
        """Return scratch for some groups.

        error_layout: channels and dtype of what errors are measured of, where that is not what is averaged.
        """

        def groups(num_channels: int, dtype: type[Any]) -> Groups:
            shapes = [(num_groups, num_nodes, num_channels) for num_nodes in NODES_OF_GROUP]
            return Groups(*(Nodes(np.empty(shape, dtype), np.empty(shape, dtype)) for shape in shapes))

        nodes, num = groups(4, np.float32), num_groups * 64
        errors = groups(*error_layout) if error_layout else nodes
        return cls(nodes, errors, np.empty((num, 4), np.float32), np.empty(num, np.float32))

    def limited_to(self, num_groups: int) -> Scratch:
        """Return the part that this number of groups needs; views."""

        def limited(groups: Groups) -> Groups:
            return Groups(*(Nodes(means[:num_groups], variances[:num_groups]) for means, variances in groups))

        return replace(self, nodes=limited(self.nodes), errors=limited(self.errors))


def packed_channels(values: Array) -> Array:
    """Return four channels [..., 4] as one item [...], which is moved at once; a view."""
    return values.view(np.uint64 if values.dtype == np.float16 else np.complex128)[..., 0]


def classify_blocks(
    raw: RawVoxels,
    classifier: Classifier,
    starts: Int64,
    extents: Int64,
    groups: Groups,
    normalization: tuple[float, float] | None = None,
) -> None:
    """Build all nodes of the blocks at voxels `starts` [g, 3]; `extents` [g, 3] (x, y, z) of each are real.

    normalization: (offset, scale) of scalars that are averaged in place of channels.
    """
    if normalization is None:
        kernels().classify_blocks(raw=raw, classifier=classifier, starts=starts, extents=extents, groups=groups)
    else:
        offset, scale = normalization
        kernels().normalize_blocks(
            raw=raw, scalars=classifier.scalars, offset=offset, scale=scale, starts=starts, extents=extents,
            groups=groups,
        )  # fmt: skip


def merge(groups: Groups, extents: Int64, side: int) -> None:
    """Merge the 64 nodes of each group, `side` voxels wide, into their 8 parents and the root.

    extents: [g, 3], the number of real voxels along x, y, z of each group.
    """
    is_scalar = groups.roots.means.dtype == np.float64
    merge_all = kernels().merge_scalars if is_scalar else kernels().merge_channels
    merge_all(groups=groups, extents=extents, side=side)


def hide_below_leaves(nodes: Groups, errors: Groups, limits: tuple[float, float]) -> None:
    """Negate the last channel of nodes and of their parents below a leaf of every cut, which are not to be stored.

    Such a leaf has a total variance below the limit of its level, a parent's or a root's.
    """
    kernels().hide_below_leaves(
        means=nodes.nodes.means, parent_means=nodes.parents.means, parent_variances=errors.parents.variances,
        root_variances=errors.roots.variances, limits=limits,
    )  # fmt: skip


def list_visible_cells(
    means: Float32, groups: Int64, width: int, shape: tuple[int, ...], num_listed: int, shift: int, occupied: Bools
) -> tuple[Int32, Int64]:
    """Return the cells [., 3] (x, y, z) of the visible nodes [g, n, 4] of groups at `groups` [g, 3], in Morton order,
    and their numbers of voxels [.]. Mark them in the grid `occupied` [z, y, x] of cells 2^shift times as wide. Nodes
    below a leaf of every cut, whose last channel is negative, count as visible.

    width: of a node, in voxels, where the border does not cut it. shape: of the volume, z, y, x. num_listed: the number
    of visible nodes; with 0, none is listed. Nothing is marked if `shift` is below 0.
    """
    cells, sizes = np.empty((num_listed, 3), np.int32), np.empty(num_listed, np.int64)
    kernels().list_visible_cells(
        means=means, groups=groups, width=width, shape=shape, shift=shift, occupied=occupied, cells=cells, sizes=sizes
    )
    return cells, sizes


def append_visible(
    means: Float32, variances: Array, children: Float32, visible: Float32, deviations: Float32, masks: UInt8
) -> int:
    """Write the visible nodes of groups [g, n, 4] in Morton order to `visible` [., 4]; return how many they are.

    variances: [g, n, c]; the roots of their sums over the channels go to `deviations` [.].
    children: [g, 8 n, 4], whose visibility becomes masks [.]; [0, ., 4] where they are voxels.
    """
    num_visible = np.empty(1, np.int64)
    kernels().append_visible(
        means=means, variances=variances, children=children, visible=visible, deviations=deviations, masks=masks,
        num_visible=num_visible,
    )  # fmt: skip
    return int(num_visible[0])


def opacities_to_depths(means: Float32, max_depth: float) -> None:
    """Convert means of (a c, a) [n, 4] to optical depths times (c, 1), in place.

    Depths keep their digits in half precision. Of opacities near 1 it would leave none.
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
