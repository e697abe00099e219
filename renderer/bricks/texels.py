"""Make the texels of bricks: what is interpolated in a brick, for each of its cells and for the halo around them.

Texel (t, u, v) of a brick is the cell `BRICK_SIZE * brick - HALO + (t, u, v)` of its level. Beyond the volume's border
there are no cells, and the field is continued in one of two ways.

Scalars take the nearest voxel, as the truth does, also beside voxels without data (kernel `absent.h`). Means of a level
above are not values at a point. That of the last cell, which the border may cut to the share w of its width, belongs to
the middle of what is left of it. The field is the line through that point and the centre of the cell before,

    slope = (last - before) 2 / (1 + w)        at the last centre: last + slope (1 - w) / 2        beyond: + slope

along each axis in turn, which reproduces linear fields and, exactly, constant ones. It is only followed from the middle
of the last cell to the volume's face, half of its width, so an error of a mean appears at most
(1 + 2 w) / (1 + w) + w / (1 + w) <= 2 times as large per axis. With the nearest cell instead, the mean of a ramp would
be off by half a cell's rise. Where the line falls below 0 the field is 0, and it is never brighter than the brightest
colour of the transfer function.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.bricks.brick_means import means_of_bricks
from renderer.bricks.bricks import Bricks
from renderer.bricks.layout import PADDED_BRICK_SIZE, voxels_of
from renderer.kernels import kernels
from renderer.transfer import range_width
from renderer.volume import Float32, Float64, Int32, Volume

# The largest power of two, as its exponent, that small scalars are multiplied by.
_LARGEST_EXPONENT = 1000

_NO_LIGHT = np.zeros(3)

# How much a mean of tau c may exceed a mean of tau: each is rounded, to 11 bits at least.
_ROUNDING = 1 + 2.0**-9


def scalar_texels(bricks: Bricks, cells: Int32, *, lit: bool, toward_light: Float64 = _NO_LIGHT) -> Float32:
    """Return the scalars of bricks of level 0 at `cells` [n, 3] (x, y, z), normalized to `bricks.scalar_range` and
    clamped to +-MAX_NORMALIZED_SCALAR, float32 [n, 18, 18, 18]. Of a volume with voxels without data, the lowest bit
    is set in theirs.

    lit: [n, 4 * 18^3], of each brick all scalars, which are read more often, and then all gradients (x, y, z) in world
    axes: central differences at voxel centres, one-sided at the border and 0 along an axis of one voxel; of labels,
    those of smoothed opacities. They are divided by a number that is the same in the whole volume, such that
    differences of scalars are at most 1, and so is the largest entry of the transform to the world.

    toward_light: float64 [3], a unit vector, to which the normals of labels turn a little; 0 for none.

    Raises InputError where the volume's file was changed.
    """
    volume, first = bricks.volume, bricks.scalar_range[0]
    texels = np.empty((len(cells), (4 if lit else 1) * PADDED_BRICK_SIZE**3), np.float32)
    matrix = _world_from_gradient(volume)
    width, factor = range_width(*bricks.scalar_range)
    volume.require_unchanged()
    kernels().fill_scalar_texels(
        voxels=voxels_of(volume, bricks.pyramid.classifier), cells=cells, first=first, width=width, factor=factor,
        world_from_gradient=matrix / np.abs(matrix).max(), scale=_unit_scale(*bricks.volume_range),
        opacities=_opacities(bricks), toward_light=toward_light, texels=texels,
    )  # fmt: skip
    volume.require_unchanged()
    return texels if lit else texels.reshape(-1, *(PADDED_BRICK_SIZE,) * 3)


def _opacities(bricks: Bricks) -> Float64:
    """Return the opacity of a voxel of each label, by its number, float64 [n]; of other volumes [0]."""
    num = int(bricks.volume_range[1]) + 1 if bricks.volume.is_labels else 0
    return np.asarray(-np.expm1(-bricks.transfer.classify(np.arange(num))[1] * bricks.volume.finest_spacing))


def texel_gradients(bricks: Bricks, magnitudes: Float64) -> Float64:
    """Return the lengths in texels of gradients of these magnitudes, in scalar units per world unit, float64 [n].

    What is far longer than any gradient in the volume may be the largest float32.
    """
    with np.errstate(over="ignore"):
        scaled = magnitudes * _unit_scale(*bricks.volume_range) / np.abs(_world_from_gradient(bricks.volume)).max()
    return np.asarray(np.minimum(scaled, np.finfo(np.float32).max))


def _world_from_gradient(volume: Volume) -> Float64:
    """Return the matrix that takes gradients per voxel to gradients per world unit, float64 [3, 3]."""
    return np.asarray(np.linalg.inv(volume.world_from_index[:3, :3]).T)


def mean_texels(bricks: Bricks, level: int, cells: Int32) -> Float32:
    """Return (tau c, tau) times the finest spacing, of bricks of a level above 0 at `cells` [n, 3] (x, y, z), float32
    [n, 18, 18, 18, 4]; 0 where nothing is visible.

    Raises InputError where voxels are needed and the volume's file was changed.
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
    """Return a power of two that scales the width of a range to at most 1; to about 1, unless it is tiny."""
    return math.ldexp(1.0, min(-1 - math.frexp(high / 2 - low / 2)[1], _LARGEST_EXPONENT))
