"""Turn voxels into nodes, merge nodes, and convert them to what is stored, in compiled loops.

Two neighbours a and b, where b holds the share h of their voxels, are merged into

    mean = a + h (b - a)        variance = va + h (vb - va) + h (1 - h) (b - a)^2

along x, then y, then z. This is the merge of Chan, Golub, LeVeque 1979 ("Updating formulae and a pairwise algorithm for
computing sample variances") divided by the count. It takes no difference of large squares, so a variance is never
negative, holds for large offsets, and is exactly 0 for equal voxels. Inside the volume h is 1/2. Where the border cuts
a node, the shares of real voxels along the three axes differ; where b has no voxels, h is 0.

Nodes come in *groups*: 64 of them, their 8 parents, and the root of those. The levels 1, 2, 3 of a block of 8^3 voxels
are a group; the roots of up to 64 groups make the next one, with the levels 3, 4, 5, and so on. In each of the three
arrays of a group, and among the 512 voxels, the child k = x + 2 y + 4 z of node i is at k n + i, with n the number of
nodes: children are merged as eight contiguous rows, which becomes vector code. The 64 are then in Morton order with the
two octal digits exchanged (see GROUP_INDEX_OF_MORTON), the 8 in Morton order. The channels of a node lie together; each
has its own variance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.compiled import jit
from renderer.transfer import Classifier, RawVoxels, TransferTable, classify_scalar, classify_voxel, scalar_at
from renderer.volume import Array, Bools, Float32, Float64, Int32, Int64, UInt8, UInt64

# Four float32 that are moved together: numba has no other type of 16 bytes.
PackedChannels = npt.NDArray[np.complex128]

# Means and variances [g, n, c]; those of the 64 nodes of some groups, of their 8 parents, and of their root.
Nodes = tuple[Array, Array]
Groups = list[Nodes]
NODES_OF_GROUP = (64, 8, 1)

BLOCK_SIZE = 8

# The side of a voxel in voxels. For a literal, numba would compile another version.
VOXEL_SIDE = np.int64(1)

# Where the coordinates of a voxel in its block put it among 8 x 64 children: the lowest bit is that of the child, the
# highest that of the largest parent. Unsigned indices, here and below, spare numba the check for negative ones.
VOXEL_OFFSET_X = np.array([64 * (i & 1) + 8 * (i >> 1 & 1) + (i >> 2) for i in range(BLOCK_SIZE)], np.uint64)
VOXEL_OFFSET_Y, VOXEL_OFFSET_Z = 2 * VOXEL_OFFSET_X, 4 * VOXEL_OFFSET_X

# The index in a group of 64 of the node that is n-th in Morton order; its own inverse.
GROUP_INDEX_OF_MORTON = np.array([(n & 7) << 3 | n >> 3 for n in range(64)], np.uint64)

# Where one coordinate of a node puts it among the 64 of a group, and among the 8 or the one.
NODE_OFFSETS = np.array([0, 8, 1, 9, 0, 1])


@dataclass(frozen=True)
class Scratch:
    """A task's memory, which the next one uses again: fresh pages cost more than the arithmetic done in them.

    nodes, errors: groups of what is averaged, and of what errors are measured of, which may be the same.
    visible, deviations: float32 [., 4] and [.], nodes on their way to where they are stored.
    voxels: float32 [512, 4], one block.
    """

    nodes: Groups
    errors: Groups
    visible: Float32
    deviations: Float32
    voxels: Float32

    @classmethod
    def empty(cls, num_groups: int, error_layout: tuple[int, type[Any]] | None = None) -> Scratch:
        """Return scratch for some groups.

        error_layout: channels and dtype of what errors are measured of, where that is not what is averaged.
        """

        def groups(num_channels: int, dtype: type[Any]) -> Groups:
            shapes = [(num_groups, num_nodes, num_channels) for num_nodes in NODES_OF_GROUP]
            return [(np.empty(shape, dtype), np.empty(shape, dtype)) for shape in shapes]

        nodes = groups(4, np.float32)
        shapes = (num_groups * 64, 4), (num_groups * 64,), (BLOCK_SIZE**3, 4)
        flat = (np.empty(shape, np.float32) for shape in shapes)
        return cls(nodes, groups(*error_layout) if error_layout else nodes, *flat)

    def limited_to(self, num_groups: int) -> Scratch:
        """Return the part that this number of groups needs; views."""
        nodes, errors = ([(m[:num_groups], v[:num_groups]) for m, v in each] for each in (self.nodes, self.errors))
        return replace(self, nodes=nodes, errors=errors)


@jit
def _build_first_level(
    raw: RawVoxels,
    classifier: Classifier,
    packed: tuple[PackedChannels, PackedChannels] | None,
    curve: TransferTable | None,
    normalization: tuple[float, float] | None,
    starts: UInt64,
    extents: UInt64,
    voxels: Array,
    means: Array,
    variances: Array,
) -> None:
    """Write level 1 [g, 64, c] of the blocks at voxels `starts` [g, 3]; `extents` [g, 3] (x, y, z) of each are real.

    packed: the classifier's table and the voxels, packed; curve: of the classifier. Whole blocks are classified by
    them; both are None with lighting. normalization: (offset, scale) of scalars in place of channels. voxels: [512, c],
    scratch.
    """
    width = 256 if normalization is None else 64
    shares = np.empty((3, width), voxels.dtype)
    if packed is not None:
        packed_table, packed_voxels = packed
    block_voxels = np.empty((BLOCK_SIZE, BLOCK_SIZE, BLOCK_SIZE), raw.dtype)
    for g in range(len(starts)):
        if g == 0 or not _has_same_extents(extents, g):
            _set_shares(extents, g, VOXEL_SIDE, shares, means.shape[2])
            voxels[:] = 0  # those outside the volume stay 0
        whole = extents[g, 0] * extents[g, 1] * extents[g, 2] == BLOCK_SIZE**3
        if normalization is not None:
            _normalize_block(raw, classifier.scalars, normalization, starts, extents, g, voxels)
        elif whole and packed is not None:
            _look_up_block(raw, packed_table, starts, g, packed_voxels)
        elif whole and curve is not None:
            _evaluate_block(raw, curve, classifier.is_opacity, starts, g, block_voxels, voxels)
        else:
            _classify_block(raw, classifier, starts, extents, g, voxels)
        _merge_voxels(voxels.reshape(8, width), shares, means.reshape(-1, width), variances.reshape(-1, width), g)


@jit
def _merge_groups(nodes: Nodes, parents: Nodes, roots: Nodes, extents: UInt64, side: int) -> None:
    """Merge groups of nodes [g, 64, c], `side` voxels wide, into their parents [g, 8, c] and roots [g, 1, c].

    extents: [g, 3], the number of real voxels along x, y, z of each group.
    """
    (means, variances), (parent_means, parent_variances), (root_means, root_variances) = nodes, parents, roots
    num, _, num_channels = means.shape
    shares = np.empty((3, 8 * num_channels), means.dtype)
    root_shares = np.empty((3, num_channels), means.dtype)
    m, v = means.reshape(num, 8, 8 * num_channels), variances.reshape(num, 8, 8 * num_channels)
    p, q = parent_means.reshape(num, 8 * num_channels), parent_variances.reshape(num, 8 * num_channels)
    r, s = root_means.reshape(num, num_channels), root_variances.reshape(num, num_channels)
    for g in range(num):
        if g == 0 or not _has_same_extents(extents, g):
            _set_shares(extents, g, side, shares, num_channels)
            _set_shares(extents, g, 2 * side, root_shares, num_channels)
        _merge_nodes(m, v, shares, p, q, g)
        _merge_nodes(parent_means, parent_variances, root_shares, r, s, g)


@jit
def _has_same_extents(extents: UInt64, g: int) -> bool:
    """Return whether the border cuts a group like the one before it."""
    return bool(
        extents[g, 0] == extents[g - 1, 0] and extents[g, 1] == extents[g - 1, 1] and extents[g, 2] == extents[g - 1, 2]
    )


@jit
def _set_shares(extents: UInt64, g: int, child: int | np.int64, shares: Array, num_channels: int) -> None:
    """Write the shares [3, n c] for the n nodes of a group, whose children are `child` voxels wide."""
    num_nodes = shares.shape[1] // num_channels
    for axis in range(3):
        for node in range(num_nodes):
            first = node >> axis & 1
            if num_nodes == 64:  # two digits, of which the lower one is the larger parent's
                first = first << 1 | node >> (3 + axis) & 1
            rest = int(extents[g, axis]) - first * 2 * child
            low, high = min(max(rest, 0), child), min(max(rest - child, 0), child)
            for channel in range(num_channels):
                shares[axis, node * num_channels + channel] = high / max(low + high, 1)


@jit
def _classify_block(
    raw: RawVoxels, classifier: Classifier, starts: UInt64, extents: UInt64, g: int, out: Float32
) -> None:
    """Classify the real voxels of a block into `out` [512, 4]."""
    table, scalars, curve, is_opacity, lighting, _ = classifier
    x0, y0, z0 = starts[g, 0], starts[g, 1], starts[g, 2]
    for z in range(extents[g, 2]):
        for y in range(extents[g, 1]):
            row = VOXEL_OFFSET_Z[z] + VOXEL_OFFSET_Y[y]
            for x in range(extents[g, 0]):
                at = row + VOXEL_OFFSET_X[x]
                out[at, 0], out[at, 1], out[at, 2], out[at, 3] = classify_voxel(
                    raw, table, scalars, curve, is_opacity, lighting, z0 + z, y0 + y, x0 + x
                )


@jit
def _normalize_block(
    raw: RawVoxels,
    scalars: Float64 | None,
    normalization: tuple[float, float],
    starts: UInt64,
    extents: UInt64,
    g: int,
    out: Float64,
) -> None:
    """Write `(scalar - offset) * scale` of the real voxels of a block to `out` [512, 1]; 0 without data."""
    offset, scale = normalization
    for z in range(extents[g, 2]):
        for y in range(extents[g, 1]):
            for x in range(extents[g, 0]):
                s = scalar_at(raw, scalars, starts[g, 2] + z, starts[g, 1] + y, starts[g, 0] + x)
                at = VOXEL_OFFSET_Z[z] + VOXEL_OFFSET_Y[y] + VOXEL_OFFSET_X[x]
                out[at, 0] = 0.0 if math.isnan(s) else (s - offset) * scale


@jit
def _look_up_block(raw: RawVoxels, table: PackedChannels, starts: UInt64, g: int, out: PackedChannels) -> None:
    """Classify a whole block by a table, without light."""
    x0, y0, z0 = starts[g, 0], starts[g, 1], starts[g, 2]
    for z in range(np.uint64(BLOCK_SIZE)):
        for y in range(np.uint64(BLOCK_SIZE)):
            row = VOXEL_OFFSET_Z[z] + VOXEL_OFFSET_Y[y]
            for x in range(np.uint64(BLOCK_SIZE)):
                out[row + VOXEL_OFFSET_X[x]] = table[raw[z0 + z, y0 + y, x0 + x]]


@jit
def _evaluate_block(
    raw: RawVoxels,
    curve: TransferTable,
    is_opacity: bool,
    starts: UInt64,
    g: int,
    block_voxels: RawVoxels,
    out: Float32,
) -> None:
    """Classify a whole block by the transfer function, without light.

    The block [8, 8, 8] is copied first: with nothing else to do meanwhile, the waits for its 64 rows overlap.
    """
    x0, y0, z0 = starts[g, 0], starts[g, 1], starts[g, 2]
    for z in range(np.uint64(BLOCK_SIZE)):
        for y in range(np.uint64(BLOCK_SIZE)):
            for x in range(np.uint64(BLOCK_SIZE)):
                block_voxels[z, y, x] = raw[z0 + z, y0 + y, x0 + x]
    for z in range(np.uint64(BLOCK_SIZE)):
        for y in range(np.uint64(BLOCK_SIZE)):
            row = VOXEL_OFFSET_Z[z] + VOXEL_OFFSET_Y[y]
            for x in range(np.uint64(BLOCK_SIZE)):
                at, scalar = row + VOXEL_OFFSET_X[x], float(block_voxels[z, y, x])
                out[at, 0], out[at, 1], out[at, 2], out[at, 3] = classify_scalar(scalar, curve, is_opacity)


@jit
def _merge_voxels(voxels: Array, shares: Array, mean: Array, variance: Array, g: int) -> None:
    """Merge voxels [8, n], which have no variance, into mean[g] and variance[g] [n]."""
    for j in range(voxels.shape[1]):
        h = shares[0, j]
        k = h - h * h
        d0, d1 = voxels[1, j] - voxels[0, j], voxels[3, j] - voxels[2, j]
        d2, d3 = voxels[5, j] - voxels[4, j], voxels[7, j] - voxels[6, j]
        mean[g, j], variance[g, j] = _merge_planes(
            voxels[0, j] + h * d0, voxels[2, j] + h * d1, voxels[4, j] + h * d2, voxels[6, j] + h * d3,
            k * (d0 * d0), k * (d1 * d1), k * (d2 * d2), k * (d3 * d3), shares[1, j], shares[2, j],
        )  # fmt: skip


@jit
def _merge_nodes(m: Array, v: Array, shares: Array, mean: Array, variance: Array, g: int) -> None:
    """Merge nodes of the level below, m[g] and v[g] [8, n], into mean[g] and variance[g] [n]."""
    for j in range(shares.shape[1]):
        h = shares[0, j]
        m0, v0 = _merge_two(m[g, 0, j], m[g, 1, j], v[g, 0, j], v[g, 1, j], h)
        m1, v1 = _merge_two(m[g, 2, j], m[g, 3, j], v[g, 2, j], v[g, 3, j], h)
        m2, v2 = _merge_two(m[g, 4, j], m[g, 5, j], v[g, 4, j], v[g, 5, j], h)
        m3, v3 = _merge_two(m[g, 6, j], m[g, 7, j], v[g, 6, j], v[g, 7, j], h)
        mean[g, j], variance[g, j] = _merge_planes(m0, m1, m2, m3, v0, v1, v2, v3, shares[1, j], shares[2, j])


@jit
def _merge_planes(
    m0: Any, m1: Any, m2: Any, m3: Any, v0: Any, v1: Any, v2: Any, v3: Any, share_y: Any, share_z: Any
) -> tuple[Any, Any]:
    """Merge four nodes along y, then z."""
    low, low_variance = _merge_two(m0, m1, v0, v1, share_y)
    high, high_variance = _merge_two(m2, m3, v2, v3, share_y)
    return _merge_two(low, high, low_variance, high_variance, share_z)


@jit
def _merge_two(a: Any, b: Any, va: Any, vb: Any, h: Any) -> tuple[Any, Any]:
    d = b - a
    return a + h * d, va + h * (vb - va) + (h - h * h) * (d * d)


@jit
def hide_below_leaves(
    means: Float32, parent_means: Float32, parent_variances: Array, root_variances: Array, limits: tuple[float, float]
) -> None:
    """Negate the last channel of nodes [g, 64, 4] and of their parents [g, 8, 4] below a leaf of every cut.

    Such a leaf has a total variance [g, 8, c] or [g, 1, c] below the limit of its level. What is negated is not stored.
    """
    for g in range(len(means)):
        is_root_leaf = _total_variance(root_variances, g, 0) < limits[1]
        for parent in range(8):
            if is_root_leaf:
                parent_means[g, parent, 3] *= -1
            if is_root_leaf or _total_variance(parent_variances, g, parent) < limits[0]:
                for k in range(8):
                    means[g, 8 * k + parent, 3] *= -1


@jit
def _total_variance(variances: Array, g: int, node: int) -> Any:
    total = variances[g, node, 0]
    for channel in range(1, variances.shape[2]):
        total += variances[g, node, channel]
    return total


@jit
def list_visible_cells(
    means: Float32, groups: Int64, width: int, shape: tuple[int, int, int], num_listed: int, shift: int, occupied: Bools
) -> tuple[Int32, Int64]:
    """Return the cells [., 3] (x, y, z) of the visible nodes [g, n, 4] of groups at `groups` [g, 3], in Morton order,
    and their numbers of voxels [.]. Mark them in the grid `occupied` [z, y, x] of cells 2^shift times as wide. Nodes
    below a leaf of every cut, whose last channel is negative, count as visible.

    width: of a node, in voxels, where the border does not cut it. shape: of the volume, z, y, x. num_listed: the number
    of visible nodes; with 0, none is listed. Nothing is marked if `shift` is below 0.
    """
    cells, sizes = np.empty((num_listed, 3), np.int32), np.empty(num_listed, np.int64)
    num, num_nodes, at = 0, np.uint64(means.shape[1]), np.empty(3, np.int64)
    digits = 2 if num_nodes == 64 else 1 if num_nodes == 8 else 0
    for g in range(len(means)):
        for index in range(num_nodes):
            node = GROUP_INDEX_OF_MORTON[index] if num_nodes == 64 else index
            if means[g, node, 3] != 0:
                size = 1
                for axis in range(3):
                    cell = groups[g, axis] << digits
                    for digit in range(digits):
                        cell |= int(index >> np.uint64(3 * digit + axis) & np.uint64(1)) << digit
                    at[axis] = cell
                    size *= min(shape[2 - axis] - cell * width, width)
                if shift >= 0:
                    occupied[at[2] >> shift, at[1] >> shift, at[0] >> shift] = True
                if num_listed > 0:
                    cells[num, 0], cells[num, 1], cells[num, 2], sizes[num] = at[0], at[1], at[2], size
                    num += 1
    return cells, sizes


@jit
def append_visible(
    means: Float32, variances: Array, children: Float32, visible: Float32, deviations: Float32, masks: UInt8
) -> int:
    """Write the visible nodes of groups [g, n, 4] in Morton order to `visible` [., 4]; return how many they are.

    variances: [g, n, c]; the roots of their sums over the channels go to `deviations` [.]. The root is taken before
        rounding to float32, which might not hold the square.
    children: [g, 8 n, 4], whose visibility becomes masks [.]; [0, ., 4] where they are voxels.
    """
    packed, packed_visible = means.view(np.complex128), visible.view(np.complex128)
    num, num_nodes = np.uint64(0), np.uint64(means.shape[1])
    for g in range(len(means)):
        for index in range(num_nodes):
            node = GROUP_INDEX_OF_MORTON[index] if num_nodes == 64 else index
            if means[g, node, 3] > 0:
                packed_visible[num, 0] = packed[g, node, 0]
                deviations[num] = np.sqrt(_total_variance(variances, g, node))
                if len(children) > 0:
                    mask = 0
                    for k in range(8):
                        if children[g, np.uint64(k) * num_nodes + node, 3] > 0:
                            mask |= 1 << k
                    masks[num] = mask
                num += np.uint64(1)
    return int(num)


@jit
def _store_float16(values: Float32, factor: float, out: npt.NDArray[np.uint16]) -> None:
    """Write the float16 bits of `values * factor` (a power of two; products from 0 to 2^15), flat, rounded to nearest.

    Normal numbers are rounded to 11 bits by Veltkamp's splitting (Dekker 1971, "A floating-point technique for
    extending the available precision"); then only the bias of the exponent differs. Below 2^-14 the unit of float16 is
    2^-24, as is that of the mantissa of float32 in [1/2, 1).
    """
    f = np.float32(factor)
    for i in range(len(values)):
        value = np.float32(values[i] * f)
        scaled = np.float32(value * np.float32(2**13 + 1))
        rounded = np.float32(scaled - (scaled - value))
        normal = np.uint16((rounded.view(np.uint32) >> 13) - ((127 - 15) << 10))
        tiny = np.uint16(np.float32(value + np.float32(0.5)).view(np.uint32))
        out[i] = normal if value >= np.float32(2.0**-14) else tiny


def packed_channels(values: Array) -> Array:
    """Return four channels [..., 4] as one item [...], which is moved at once; a view."""
    return values.view(np.uint64 if values.dtype == np.float16 else np.complex128)[..., 0]


def classify_blocks(
    raw: Array,
    classifier: Classifier,
    starts: UInt64,
    extents: UInt64,
    voxels: Array,
    groups: Groups,
    normalization: tuple[float, float] | None = None,
) -> None:
    """Build all nodes of the blocks at voxels `starts` [g, 3]; `extents` [g, 3] (x, y, z) of each are real.

    voxels: float32 [512, 4], scratch. normalization: (offset, scale) of scalars that are averaged in place of channels.
    """
    packed, curve, table = None, None, classifier.table
    if normalization is not None:
        voxels = np.empty((BLOCK_SIZE**3, 1))
    elif classifier.lighting is None:
        packed = (packed_channels(table), packed_channels(voxels)) if table is not None else None
        curve = classifier.curve
    _build_first_level(raw, classifier, packed, curve, normalization, starts, extents, voxels, *groups[0])
    merge(groups, extents, 2)


def merge(groups: Groups, extents: UInt64, side: int) -> None:
    """Merge the 64 nodes of each group, `side` voxels wide, into their 8 parents and the root."""
    nodes, parents, roots = groups
    _merge_groups(nodes, parents, roots, extents, side)


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
        _store_float16(values.reshape(-1), factor, out.view(np.uint16).reshape(-1))
    else:
        np.multiply(values, np.float32(factor), out=out)
