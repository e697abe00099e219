"""Compiled inner loops of the pyramid.

Two neighbours a and b, of which b holds the share h of the voxels, are merged into

    mean = a + h (b - a)        variance = va + h (vb - va) + h (1 - h) (b - a)^2

along x, then y, then z. This is the merge of Chan, Golub, LeVeque 1979 ("Updating formulae and a pairwise algorithm for
computing sample variances") divided by the count: no difference of large squares is taken, so that a variance is never
negative, holds for large offsets, and is exactly 0 for equal voxels. Inside the volume h is 1/2; where its border cuts a
node the shares of real voxels along the three axes differ, and where b has none h is 0.

Nodes come in *groups*: 64 of them, their 8 parents, and the parent of those. The levels 1, 2, 3 of a block of 8^3 voxels
are a group, and so are the levels 3, 4, 5 of a brick of 64 blocks. In each of the three arrays of a group, and in that
of its 512 children, the child k = x + 2 y + 4 z of node i is at k n + i, with n the number of nodes: all children are
merged as eight contiguous rows, which becomes vector code. The 64 are then in Morton order with the two octal digits
exchanged (see `swapped`), the 8 in Morton order. Channels of a node lie together, and variances are kept by channel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.classify import Codes, Lighting, Segments, classify_voxel, scalar_at
from renderer.jit import jit

Array = npt.NDArray[Any]
Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

BLOCK = 8

# Where the coordinate of a voxel in its block, along x, puts it among 8 x 64 children; along y twice that, along z four
# times: its lowest bit is that of the child, its highest that of the largest parent.
SPREAD = np.array([64 * (i & 1) + 8 * (i >> 1 & 1) + (i >> 2) for i in range(BLOCK)], np.uint64)


@jit
def _merge_voxels(voxels: Array, shares: Array, mean: Array, variance: Array) -> None:
    """Nodes of level 1 from voxels, which have no variance."""
    v = voxels.reshape(8, len(mean))
    for j in range(len(mean)):
        h = shares[0, j]
        g = h - h * h
        d0, d1, d2, d3 = v[1, j] - v[0, j], v[3, j] - v[2, j], v[5, j] - v[4, j], v[7, j] - v[6, j]
        m0, m1, m2, m3 = v[0, j] + h * d0, v[2, j] + h * d1, v[4, j] + h * d2, v[6, j] + h * d3
        mean[j], variance[j] = _merge_planes(
            m0, m1, m2, m3, g * (d0 * d0), g * (d1 * d1), g * (d2 * d2), g * (d3 * d3), shares[1, j], shares[2, j]
        )


@jit
def _merge_nodes(means: Array, variances: Array, shares: Array, mean: Array, variance: Array) -> None:
    """Nodes from the level below."""
    m, v = means.reshape(8, len(mean)), variances.reshape(8, len(mean))
    for j in range(len(mean)):
        h = shares[0, j]
        m0, v0 = _merge_two(m[0, j], m[1, j], v[0, j], v[1, j], h)
        m1, v1 = _merge_two(m[2, j], m[3, j], v[2, j], v[3, j], h)
        m2, v2 = _merge_two(m[4, j], m[5, j], v[4, j], v[5, j], h)
        m3, v3 = _merge_two(m[6, j], m[7, j], v[6, j], v[7, j], h)
        mean[j], variance[j] = _merge_planes(m0, m1, m2, m3, v0, v1, v2, v3, shares[1, j], shares[2, j])


@jit
def _merge_planes(
    m0: Any, m1: Any, m2: Any, m3: Any, v0: Any, v1: Any, v2: Any, v3: Any, share_y: Any, share_z: Any
) -> tuple[Any, Any]:
    """Along y and z."""
    low, low_variance = _merge_two(m0, m1, v0, v1, share_y)
    high, high_variance = _merge_two(m2, m3, v2, v3, share_y)
    return _merge_two(low, high, low_variance, high_variance, share_z)


@jit
def _merge_two(a: Any, b: Any, va: Any, vb: Any, h: Any) -> tuple[Any, Any]:
    d = b - a
    return a + h * d, va + h * (vb - va) + (h - h * h) * (d * d)


@jit
def _set_shares(extent: Int64, child: int, shares: Array, num_channels: int) -> None:
    """Shares [3, n c] for n nodes whose children are `child` voxels a side, in a group of which `extent` (x, y, z) is real."""
    num_nodes = shares.shape[1] // num_channels
    for axis in range(3):
        for node in range(num_nodes):
            first = node >> axis & 1
            if num_nodes == 64:  # two digits, of which the lower one is the larger parent's
                first = first << 1 | node >> (3 + axis) & 1
            rest = extent[axis] - first * 2 * child
            low, high = min(max(rest, 0), child), min(max(rest - child, 0), child)
            for channel in range(num_channels):
                shares[axis, node * num_channels + channel] = high / max(low + high, 1)


@jit
def _same(a: Int64, b: Int64) -> bool:
    return bool(a[0] == b[0] and a[1] == b[1] and a[2] == b[2])


@jit
def merge_groups(
    means: Array, variances: Array, extents: Int64, side: int,
    parent_means: Array, parent_variances: Array, root_means: Array, root_variances: Array,
) -> None:  # fmt: skip
    """Merge groups of nodes [g, 64, c], `side` voxels a side, into their parents [g, 8, c] and roots [g, 1, c].

    extents: [g, 3], how many voxels along x, y, z of each group are real.
    """
    num_channels = means.shape[2]
    shares = np.empty((3, 8 * num_channels), means.dtype)
    root_shares = np.empty((3, num_channels), means.dtype)
    for g in range(len(means)):
        if g == 0 or not _same(extents[g], extents[g - 1]):
            _set_shares(extents[g], side, shares, num_channels)
            _set_shares(extents[g], 2 * side, root_shares, num_channels)
        parents, spreads = parent_means[g].reshape(-1), parent_variances[g].reshape(-1)
        _merge_nodes(means[g], variances[g], shares, parents, spreads)
        _merge_nodes(parents, spreads, root_shares, root_means[g].reshape(-1), root_variances[g].reshape(-1))


@jit
def level_of_channels(
    codes: Codes, table: Float32 | None, segments: Segments | None, scalars: Float64 | None, lighting: Lighting | None,
    starts: Int64, extents: Int64, means: Float32, variances: Float32,
) -> None:  # fmt: skip
    """Level 1 of the blocks at voxels `starts` [g, 3], `extents` [g, 3] (x, y, z) of which are real: [g, 64, 4]."""
    voxels, shares = np.empty(BLOCK**3 * 4, np.float32), np.empty((3, 64 * 4), np.float32)
    for g in range(len(starts)):
        if g == 0 or not _same(extents[g], extents[g - 1]):
            _set_shares(extents[g], 1, shares, 4)
            voxels[:] = 0  # those outside of the volume stay so
        _fill_channels(codes, table, segments, scalars, lighting, starts[g], extents[g], voxels.reshape(-1, 4))
        _merge_voxels(voxels, shares, means[g].reshape(-1), variances[g].reshape(-1))


@jit
def level_of_scalars(
    codes: Codes, scalars: Float64 | None, offset: float, scale: float,
    starts: Int64, extents: Int64, means: Float64, variances: Float64,
) -> None:  # fmt: skip
    """The same of (scalar - offset) * scale: [g, 64, 1]."""
    voxels, shares = np.empty(BLOCK**3), np.empty((3, 64))
    for g in range(len(starts)):
        if g == 0 or not _same(extents[g], extents[g - 1]):
            _set_shares(extents[g], 1, shares, 1)
            voxels[:] = 0
        for z in range(extents[g, 2]):
            for y in range(extents[g, 1]):
                for x in range(extents[g, 0]):
                    s = scalar_at(codes, scalars, starts[g, 2] + z, starts[g, 1] + y, starts[g, 0] + x)
                    voxels[4 * SPREAD[z] + 2 * SPREAD[y] + SPREAD[x]] = (s - offset) * scale
        _merge_voxels(voxels, shares, means[g].reshape(-1), variances[g].reshape(-1))


@jit
def _fill_channels(
    codes: Codes, table: Float32 | None, segments: Segments | None, scalars: Float64 | None, lighting: Lighting | None,
    start: Int64, extent: Int64, out: Float32,
) -> None:  # fmt: skip
    """Classify the real voxels of a block into `out` [512, 4]."""
    for z in range(extent[2]):
        for y in range(extent[1]):
            row = 4 * SPREAD[z] + 2 * SPREAD[y]
            for x in range(extent[0]):
                at = row + SPREAD[x]
                r, g, b, a = classify_voxel(
                    codes, table, segments, scalars, lighting, start[2] + z, start[1] + y, start[0] + x
                )
                out[at, 0], out[at, 1], out[at, 2], out[at, 3] = r, g, b, a


@jit
def append_visible(
    means: Float32, variances: Array, children: Float32 | None,
    means_out: Float32, variances_out: Float32, masks_out: npt.NDArray[np.uint8],
) -> int:  # fmt: skip
    """Copy the visible ones of groups [g, n, 4] in Morton order to [., 4], and return how many they are.

    variances: [g, n, c], summed over the channels into [.]. children: [g, 8 n, 4], whose visibility becomes masks [.].
    """
    num_nodes = means.shape[1]
    num = 0
    for g in range(len(means)):
        for index in range(num_nodes):
            node = swapped(index) if num_nodes == 64 else index
            if means[g, node, 3] > 0:
                for channel in range(4):
                    means_out[num, channel] = means[g, node, channel]
                total = variances[g, node, 0]
                for channel in range(1, variances.shape[2]):
                    total += variances[g, node, channel]
                variances_out[num] = total
                if children is not None:
                    mask = 0
                    for k in range(8):
                        if children[g, k * num_nodes + node, 3] > 0:
                            mask |= 1 << k
                    masks_out[num] = mask
                num += 1
    return num


@jit
def swapped(index: int) -> int:
    """Of 64: Morton order to the place in a group, or back."""
    return (index & 7) << 3 | index >> 3


@jit
def store_halves(values: Float32, factor: float, out: npt.NDArray[np.uint16]) -> None:
    """Bits of float16 of `values * factor`, non-negative and flat, rounded to nearest even.

    Normal numbers lose 13 bits of mantissa after adding just under half a unit; below 2^-14 float16 counts in 2^-24.
    """
    for i in range(len(values)):
        scaled = values[i] * np.float32(factor)
        u = np.float32(scaled).view(np.uint32)
        normal = (u + np.uint32(0x0FFF) + (u >> np.uint32(13) & np.uint32(1)) - np.uint32(0x38000000)) >> np.uint32(13)
        tiny = np.uint32(np.rint(scaled * np.float32(16777216.0)))
        out[i] = normal if u >= np.uint32(0x38800000) else tiny
