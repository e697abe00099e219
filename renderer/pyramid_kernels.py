"""Compiled inner loops of the pyramid: bricks of 32^3 voxels to five levels of nodes, compact and in Morton order.

A node's mean and variance come from those of its children, weighted by the share `f_i` of its real voxels that each
child holds: `mean = sum f_i mean_i`, `var = sum f_i (var_i + |mean_i - mean|^2)`, summed over the channels. This is the
merge of Chan, Golub, LeVeque 1979 ("Updating formulae and a pairwise algorithm for computing sample variances"), divided
by the count: no difference of large squares is taken, so that a variance is never negative and holds for large offsets.

Inside a brick arrays are [z, y, channel, x], voxels with even and odd x apart: loops over x become vector code.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from renderer.classify import classify_rows, scalar_rows

BRICK_LEVELS = 5
BRICK = 1 << BRICK_LEVELS


def _morton_order(size: int) -> npt.NDArray[np.uint32]:
    """uint32 [size^3, 3]: (z, y, x) of the cells of a cube in Morton order, x in the lowest bit."""
    code = np.arange(size**3)
    xyz = [sum((code >> (3 * bit + axis) & 1) << bit for bit in range(size.bit_length() - 1)) for axis in range(3)]
    return np.stack(xyz[::-1], axis=1).astype(np.uint32)


# Of the 16^3 nodes of level 1; its first 8^3 entries are the order of level 2, and so on. Unsigned, so that numba need
# not ask whether an index counts from the end.
MORTON_ORDER = _morton_order(BRICK // 2)


# No slices of arrays are made inside these loops: each would count a reference, atomically, for a handful of elements.


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _reduce_whole(even, odd, var_in, z_out, num_z, mean, var):  # type: ignore[no-untyped-def]
    """Planes z_out + [0, num_z) of the nodes mean [., ny, 4, nx], var [., ny, nx], from whole children: even and odd in x
    [2 num_z, 2 ny, 4, nx], their variance var_in [2 num_z, 2 ny, 2 nx] (empty for voxels)."""
    eighth = mean.dtype.type(0.125)
    for dz in range(num_z):
        z, z0, z1 = z_out + dz, 2 * dz, 2 * dz + 1
        for y in range(mean.shape[1]):
            y0, y1 = 2 * y, 2 * y + 1
            for x in range(mean.shape[3]):
                var[z, y, x] = 0
            if var_in.size > 0:
                for x in range(mean.shape[3]):
                    var[z, y, x] = (
                        ((var_in[z0, y0, 2 * x] + var_in[z0, y0, 2 * x + 1])
                        + (var_in[z0, y1, 2 * x] + var_in[z0, y1, 2 * x + 1]))
                        + ((var_in[z1, y0, 2 * x] + var_in[z1, y0, 2 * x + 1])
                        + (var_in[z1, y1, 2 * x] + var_in[z1, y1, 2 * x + 1]))
                    )  # fmt: skip
            for channel in range(4):
                for x in range(mean.shape[3]):
                    a, b = even[z0, y0, channel, x], odd[z0, y0, channel, x]
                    c, d = even[z0, y1, channel, x], odd[z0, y1, channel, x]
                    e, f = even[z1, y0, channel, x], odd[z1, y0, channel, x]
                    g, h = even[z1, y1, channel, x], odd[z1, y1, channel, x]
                    m = (((a + b) + (c + d)) + ((e + f) + (g + h))) * eighth
                    a, b, c, d, e, f, g, h = a - m, b - m, c - m, d - m, e - m, f - m, g - m, h - m
                    mean[z, y, channel, x] = m
                    var[z, y, x] += ((a * a + b * b) + (c * c + d * d)) + ((e * e + f * f) + (g * g + h * h))
            for x in range(mean.shape[3]):
                var[z, y, x] *= eighth


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _voxels_in(z, y, x, size, extent):  # type: ignore[no-untyped-def]
    """Number of real voxels in the cell (z, y, x) of `size` voxels a side."""
    num_z = min(max(extent[0] - z * size, 0), size)
    num_y = min(max(extent[1] - y * size, 0), size)
    num_x = min(max(extent[2] - x * size, 0), size)
    return num_z * num_y * num_x


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _voxels_in(z, y, x, size, extent):  # type: ignore[no-untyped-def]
    """Number of real voxels in the cell (z, y, x) of `size` voxels a side."""
    num_z = min(max(extent[0] - z * size, 0), size)
    num_y = min(max(extent[1] - y * size, 0), size)
    num_x = min(max(extent[2] - x * size, 0), size)
    return num_z * num_y * num_x


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _reduce_cut(even, odd, var_in, z_out, num_z, mean, var, child, extent):  # type: ignore[no-untyped-def]
    """The same where the volume's border cuts the brick: `child` is the children's size in voxels, `extent` (z, y, x)
    how many voxels are real, both counted from the first child given. Nodes without a real voxel become 0."""
    for dz in range(num_z):
        z = z_out + dz
        for y in range(mean.shape[1]):
            for x in range(mean.shape[3]):
                var[z, y, x] = 0
                for channel in range(4):
                    mean[z, y, channel, x] = 0
                inside = _voxels_in(dz, y, x, 2 * child, extent)
                for k in range(8 if inside > 0 else 0):
                    cz, cy, cx = 2 * dz + (k >> 2), 2 * y + (k >> 1 & 1), 2 * x + (k & 1)
                    share = _voxels_in(cz, cy, cx, child, extent) / inside
                    side = odd if k & 1 else even
                    for channel in range(4 if share > 0 else 0):
                        mean[z, y, channel, x] += share * side[cz, cy, channel, x]
                for k in range(8 if inside > 0 else 0):
                    cz, cy, cx = 2 * dz + (k >> 2), 2 * y + (k >> 1 & 1), 2 * x + (k & 1)
                    share = _voxels_in(cz, cy, cx, child, extent) / inside
                    side = odd if k & 1 else even
                    if share > 0:
                        spread = var_in[cz, cy, cx] if var_in.size > 0 else mean.dtype.type(0)
                        for channel in range(4):
                            difference = side[cz, cy, channel, x] - mean[z, y, channel, x]
                            spread += difference * difference
                        var[z, y, x] += share * spread


@numba.njit(cache=True, nogil=True, error_model="numpy")
def reduce_brick(codes, rule, scalars, origin, extent, leaf, means, variances):  # type: ignore[no-untyped-def]
    """All levels of one brick into means[level - 1] [n, n, 4, n] and variances[level - 1] [n, n, n].

    `scalars` (offset, scale) with scale > 0: the channels are (s - offset) * scale and three zeros instead of the
    classified voxel. `leaf` [2, 2, 32, 4, 16] is scratch for two slices of voxels at a time.
    """
    whole = extent[0] == BRICK and extent[1] == BRICK and extent[2] == BRICK
    no_variance = variances[0][:0]
    for z in range(0, BRICK, 2):
        part = (min(2, max(extent[0] - z, 0)), extent[1], extent[2])
        start = (origin[0] + z, origin[1], origin[2])
        if scalars[1] > 0:
            scalar_rows(codes, rule, scalars, start, part, leaf)
        else:
            classify_rows(codes, rule, start, part, leaf)
        if whole:
            _reduce_whole(leaf[0], leaf[1], no_variance, z // 2, 1, means[0], variances[0])
        else:
            _reduce_cut(leaf[0], leaf[1], no_variance, z // 2, 1, means[0], variances[0], 1, part)
    for level in range(1, BRICK_LEVELS):
        num_z = BRICK >> (level + 1)
        even, odd = means[level - 1][..., ::2], means[level - 1][..., 1::2]
        if whole:
            _reduce_whole(even, odd, variances[level - 1], 0, num_z, means[level], variances[level])
        else:
            child = 1 << level
            _reduce_cut(even, odd, variances[level - 1], 0, num_z, means[level], variances[level], child, extent)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _append_visible(mean, variance, num, means_out, variances_out):  # type: ignore[no-untyped-def]
    """Append one level's visible nodes, in Morton order, to means_out [., 4] and variances_out [.] from entry `num` on."""
    size = mean.shape[0]
    for index in range(size * size * size):
        z, y, x = MORTON_ORDER[index, 0], MORTON_ORDER[index, 1], MORTON_ORDER[index, 2]
        if mean[z, y, 3, x] > 0:
            for channel in range(4):
                means_out[num, channel] = mean[z, y, channel, x]
            variances_out[num] = variance[z, y, x]
            num += 1
    return num


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _append_masks(mean, num, masks_out):  # type: ignore[no-untyped-def]
    """Append, for each visible node in Morton order, the bits of its visible children, whose level is `mean`."""
    size = mean.shape[0] // 2
    for index in range(size * size * size):
        mask = 0
        for k in range(8):
            z, y, x = MORTON_ORDER[index, 0] * 2, MORTON_ORDER[index, 1] * 2, MORTON_ORDER[index, 2] * 2
            if mean[z + (k >> 2), y + (k >> 1 & 1), 3, x + (k & 1)] > 0:
                mask |= 1 << k
        if mask:
            masks_out[num] = mask
            num += 1


@numba.njit(cache=True, nogil=True, error_model="numpy")
def build_bricks(  # type: ignore[no-untyped-def]
    codes, rule, error_rule, scalars, shared, origins, scratch, error_scratch, counts, means_out, variances_out, masks_out,
    roots_out,
):  # fmt: skip
    """Build the bricks at `origins` int64 [n, 3] (z, y, x of the first voxel) one after another.

    scratch, error_scratch: (leaf, means, variances) as reduce_brick takes them; the second one is for errors of
        another quantity than the mean's, and unused where `shared`.
    counts: int64 [BRICK_LEVELS], how many visible nodes of each level there are; set here.
    means_out, variances_out, masks_out: per level the visible nodes' means [., 4], variances [.], masks of visible children
        [.] (not for level 1, whose children are voxels).
    roots_out: float64 [n, 9], per brick the mean, the mean of the error's channels, and its variance.
    """
    leaf, means, variances = scratch
    error_leaf, error_means, error_variances = error_scratch
    counts[:] = 0
    for brick in range(len(origins)):
        origin = (origins[brick, 0], origins[brick, 1], origins[brick, 2])
        extent = (
            min(codes.shape[0] - origin[0], BRICK), min(codes.shape[1] - origin[1], BRICK),
            min(codes.shape[2] - origin[2], BRICK),
        )  # fmt: skip
        reduce_brick(codes, rule, (0.0, 0.0), origin, extent, leaf, means, variances)
        if not shared:
            reduce_brick(codes, error_rule, scalars, origin, extent, error_leaf, error_means, error_variances)
        for level in range(BRICK_LEVELS):
            if level > 0:
                _append_masks(means[level - 1], counts[level], masks_out[level])
            if shared:
                num = _append_visible(means[level], variances[level], counts[level], means_out[level], variances_out[level])
            else:
                num = _append_visible(
                    means[level], error_variances[level], counts[level], means_out[level], variances_out[level]
                )
            counts[level] = num
        for channel in range(4):
            roots_out[brick, channel] = means[-1][0, 0, channel, 0]
            roots_out[brick, 4 + channel] = means[-1][0, 0, channel, 0]
            if not shared:
                roots_out[brick, 4 + channel] = error_means[-1][0, 0, channel, 0]
        roots_out[brick, 8] = variances[-1][0, 0, 0]
        if not shared:
            roots_out[brick, 8] = error_variances[-1][0, 0, 0]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def halves(values, bits, out):  # type: ignore[no-untyped-def]
    """Round non-negative float32 (given as values and as their bits, 1-D) to the bit patterns of float16, to nearest even.

    Normal numbers lose 13 bits of mantissa after adding just under half a unit; below 2^-14 float16 counts in 2^-24.
    """
    for i in range(values.size):
        u = bits[i]
        normal = (u + np.uint32(0x0FFF) + (u >> np.uint32(13) & np.uint32(1)) - np.uint32(0x38000000)) >> np.uint32(13)
        tiny = np.uint32(np.rint(values[i] * np.float32(16777216.0)))
        out[i] = normal if u >= np.uint32(0x38800000) else tiny
