"""Make the texels of bricks: the values that are interpolated, for each cell of a brick and of its halo.

Texel (t, u, v) of a brick is the cell `BRICK_SIZE * brick - HALO + (t, u, v)` of its level. Beyond the volume's border
there are no cells, and the field is continued in one of two ways.

At level 0, scalars are continued by the nearest voxel, as in the truth, also beside voxels without data (kernel
`absent.h`). Means of higher levels are not values at a point. The border may cut the last cell to the share w of its
width; the cell's mean then belongs to the middle of this share. The field is continued by the line through that point
and the centre of the cell before,

    slope = (last - before) 2 / (1 + w)        at the last centre: last + slope (1 - w) / 2        beyond: + slope

along each axis in turn. This reproduces linear fields, and constant fields exactly. The line is only used from the
middle of the last cell to the volume's face, half of the cell's width, so that an error of a mean becomes at most
(1 + 2 w) / (1 + w) + w / (1 + w) <= 2 times as large per axis. If means were continued by the nearest cell, a ramp
would be wrong by half of its rise over a cell. The field is clamped to 0 and to the brightest colour of the transfer
function.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.bricks.brick_means import means_of_bricks
from renderer.bricks.bricks import Bricks
from renderer.bricks.layout import voxels_of
from renderer.kernels import TexelRules, VoxelTexels, kernels
from renderer.transfer import MAX_NORMALIZED_SCALAR, range_width
from renderer.volume import Float32, Float64, Int32, Int64, Volume

# The exponent of the largest power of two by which the differences of small scalars are multiplied.
_LARGEST_EXPONENT = 1000

# Kernels compute the scalars of voxels as integers of 32 bits: the magnitude of the lowest one must be below this.
_MAX_LOWEST = 2.0**30

# The direction to the light if the normals of labels do not turn towards a light.
NO_LIGHT = np.zeros(3)

# The largest ratio of a mean of tau c to a mean of tau, for a colour of 1: both are rounded, to at least 11 bits.
_ROUNDING = 1 + 2.0**-9


def texel_rules(
    bricks: Bricks, *, lit: bool, toward_light: Float64 = NO_LIGHT, kept: VoxelTexels | None = None
) -> TexelRules:
    """Return the rules by which kernels make the texels of bricks of level 0: scalars, with gradients if lit.

    Scalars are normalized to `bricks.scalar_range` and clamped to +-MAX_NORMALIZED_SCALAR. In a volume with absent
    voxels, the lowest bit of a texel says whether its voxel is absent.

    Lit texels have for each brick all scalars, and then all gradients (x, y, z) in world axes. Gradients are central
    differences at voxel centres, one-sided at the border, and 0 along an axis of one voxel; labels have the gradients
    of smoothed opacities. All gradients of a volume are divided by one number, with which differences of scalars, and
    the entries of the transform to the world, are at most 1.

    toward_light: float64 [3], a unit vector to which the normals of labels turn a little; 0 for none.
    kept: the form of texels that are voxels, as `voxel_texels` returns it; None for texels of float32.
    """
    volume, (width, factor) = bricks.volume, range_width(*bricks.scalar_range)
    matrix = _world_from_gradient(volume)
    return TexelRules(
        voxels=voxels_of(volume, bricks.pyramid.classifier),
        first=bricks.scalar_range[0],
        width=width,
        factor=factor,
        world_from_gradient=matrix / np.abs(matrix).max(),
        scale=_unit_scale(*bricks.volume_range),
        toward_light=toward_light,
        opacities=_opacities(bricks),
        is_lit=lit,
        voxel_texels=kept,
    )


def voxel_texels(bricks: Bricks) -> VoxelTexels | None:
    """Return the form of texels of level 0 that are voxels as the file has them; None if texels must be float32.

    Voxels must be integers of at most 16 bits, all of them present, and neither labels nor colours. Their scalars must
    be integers, too. Samples must have the same scalars, to the last bit, as with texels of float32: each integer that
    the volume may have is compared here.
    """
    volume, scalars = bricks.volume, bricks.pyramid.classifier.scalars
    dtype, (first, last) = volume.values.dtype, bricks.scalar_range
    if scalars is None or dtype.kind not in "iu" or volume.num_absent or volume.is_labels or volume.colors is not None:
        return None
    texels = np.arange(len(scalars))
    sign_bit = len(scalars) // 2 if dtype.kind == "i" else 0
    in_order, (width, factor) = scalars[texels ^ sign_bit], range_width(first, last)
    lowest = int(in_order[0]) if abs(in_order[0]) < _MAX_LOWEST else 0
    if factor != 1 or not np.array_equal(in_order, lowest + texels):
        return None
    normalized = np.clip((in_order - first) / width, -MAX_NORMALIZED_SCALAR, MAX_NORMALIZED_SCALAR).astype(np.float32)
    are_equal = ((in_order - first) * (1 / width)).astype(np.float32) == normalized
    low, high = bricks.volume_range
    may_be = (low <= in_order) & (in_order <= high)
    return VoxelTexels(dtype.itemsize, sign_bit, lowest, 1 / width) if are_equal[may_be].all() else None


def fill_scalar_texels(bricks: Bricks, rules: TexelRules, cells: Int32, slots: Int64, texels: Float32) -> None:
    """Write the scalars of bricks of level 0, by `texel_rules`, to rows of an array.

    cells: [n, 3], the places (x, y, z) of bricks. slots: [n], the row of each brick. texels: float32 [slots, floats],
    as the kernel describes them. Raises InputError if the volume's file was changed.
    """
    bricks.volume.require_unchanged()
    kernels().fill_scalar_texels(rules=rules, cells=cells, slots=slots, texels=texels)
    bricks.volume.require_unchanged()


def _opacities(bricks: Bricks) -> Float64:
    """Return the opacity of a voxel of each label, by the label's number: float64 [n], empty for volumes of scalars."""
    num = int(bricks.volume_range[1]) + 1 if bricks.volume.is_labels else 0
    return np.asarray(-np.expm1(-bricks.transfer.classify(np.arange(num))[1] * bricks.volume.finest_spacing))


def texel_gradients(bricks: Bricks, magnitudes: Float64) -> Float64:
    """Return the lengths, as stored in texels, of gradients of given magnitudes: float64 [n].

    Lengths are at most the largest float32. magnitudes: [n], in scalar units per world unit.
    """
    with np.errstate(over="ignore"):
        scaled = magnitudes * _unit_scale(*bricks.volume_range) / np.abs(_world_from_gradient(bricks.volume)).max()
    return np.asarray(np.minimum(scaled, np.finfo(np.float32).max))


def texel_change(bricks: Bricks) -> float:
    """Return the change over the finest spacing, in texels, along a gradient whose length in texels is 1.

    Of labels it is the change of smoothed opacities.
    """
    volume, (width, factor) = bricks.volume, range_width(*bricks.scalar_range)
    change = float(np.abs(_world_from_gradient(volume)).max()) * volume.finest_spacing
    if not volume.is_labels:
        change *= factor / width / _unit_scale(*bricks.volume_range)
    return min(change, float(np.finfo(np.float32).max))


def _world_from_gradient(volume: Volume) -> Float64:
    """Return the matrix that takes gradients per voxel to gradients per world unit, float64 [3, 3]."""
    return np.asarray(np.linalg.inv(volume.world_from_index[:3, :3]).T)


def mean_texels(bricks: Bricks, level: int, cells: Int32) -> Float32:
    """Return (tau c, tau) times the finest spacing, for bricks of a level above 0: float32 [n, 18, 18, 18, 4].

    Texels are 0 where nothing is visible. cells: [n, 3], the places (x, y, z) of bricks. Raises InputError if voxels
    are needed and the volume's file was changed.
    """
    texels = means_of_bricks(bricks.pyramid, level, cells).astype(np.float32)
    texels *= np.float32(bricks.pyramid.mean_unit)
    extents = np.array(bricks.volume.shape_xyz) / 2.0**level
    lighting = bricks.pyramid.classifier.lighting
    lit = lighting.light[3] + lighting.light[4] if lighting else 1
    brightest = max(1.0, float(bricks.transfer.colors.max()) * lit)
    kernels().extrapolate_border(cells=cells, extents=extents, brightest=brightest * _ROUNDING, texels=texels)
    return texels


def _unit_scale(low: float, high: float) -> float:
    """Return a power of two that scales the width of a range to at most 1, and to at least 1/2 unless it is tiny."""
    return math.ldexp(1.0, min(-1 - math.frexp(high / 2 - low / 2)[1], _LARGEST_EXPONENT))
