"""Gather or recompute the means of the nodes in a brick and its halo when the brick is drawn.

A pyramid for bricks does not store levels 1 and 2. For these, the code that builds pyramids classifies and averages the
voxels of a brick and its halo, 18^3 cells, block by block. The means equal the means of a stored level, bit for bit.
A pyramid with all levels would take 1.6 bytes for each visible voxel: more than most volumes.
"""

from __future__ import annotations

import numpy as np

from renderer.bricks.layout import BRICK_SIZE, HALO, PADDED_BRICK_SIZE
from renderer.kernels import Classifier, kernels
from renderer.pyramid import (
    STREAMED_LEVELS,
    Pyramid,
    opacities_to_depths,
    packed_channels,
    root_cells,
    store_scaled,
    visible_children,
)
from renderer.transfer import raw_voxels
from renderer.volume import Array, Float32, Int32, Int64, Volume

# The smallest number of bricks whose means are worth a thread of their own.
MIN_BRICKS_PER_THREAD = 8


def means_of_bricks(pyramid: Pyramid, level: int, cells: Int32) -> Array:
    """Return the means of bricks of a level above 0 and their halos, stored or recomputed.

    cells, and the array that is returned: as in `recompute_means`.
    """
    return (recompute_means if level <= STREAMED_LEVELS else stored_means)(pyramid, level, cells)


def stored_means(pyramid: Pyramid, level: int, cells: Int32) -> Array:
    """Return the means of bricks of a level that the pyramid stores, and their halos.

    cells, and the array that is returned: as in `recompute_means`.
    """
    of_level = pyramid.levels[level - 1].means
    means = np.zeros((len(cells), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, 4), of_level.dtype)
    for first, out in zip(BRICK_SIZE * cells - HALO, means, strict=True):
        nodes, found = root_cells(pyramid)
        for shift in range(pyramid.num_levels - level - 1, -1, -1):  # from the root down to the level
            nodes, found = visible_children(nodes, found, pyramid.levels[level + shift])
            low = (found << shift) - first
            is_near = (low > -(1 << shift)) & (low < PADDED_BRICK_SIZE)
            kept = np.flatnonzero(is_near[:, 0] & is_near[:, 1] & is_near[:, 2])
            nodes, found = nodes[kept], found[kept]
        x, y, z = (found - first).T
        packed_channels(out)[z, y, x] = packed_channels(of_level)[nodes]
    return means


def color_texels(pyramid: Pyramid, cells: Int32) -> Float32:
    """Return (tau c, tau) times the finest spacing, for the voxels of bricks and their halos.

    Returns float32 [n, 18, 18, 18, 4]. Beyond the volume's border, the nearest voxel is repeated. cells: [n, 3], the
    places (x, y, z) of bricks. Raises InputError if the volume's file was changed.
    """
    volume, corners = pyramid.volume, BRICK_SIZE * cells.astype(np.int64) - HALO
    texels = _average_cells(volume, pyramid.classifier._replace(shown=None), 0, corners)
    are_cut = ((corners < 0) | (corners + PADDED_BRICK_SIZE > volume.shape_xyz)).any(axis=1)
    for number in np.flatnonzero(are_cut):
        ends = zip(corners[number, ::-1], volume.values.shape, strict=True)
        nearest = [np.clip(np.arange(PADDED_BRICK_SIZE), -at, num - 1 - at) for at, num in ends]
        texels[number] = texels[number][np.ix_(*nearest)]
    return texels


def recompute_means(pyramid: Pyramid, level: int, cells: Int32) -> Array:
    """Return the means of bricks of level 1 or 2 and their halos, as a pyramid would store them.

    Returns float16 or float32 [n, 18, 18, 18, 4], with zeros where nothing is visible. cells: [n, 3], the places
    (x, y, z) of bricks. Raises InputError if the volume's file was changed.
    """
    corners = BRICK_SIZE * cells.astype(np.int64) - HALO
    means = _average_cells(pyramid.volume, pyramid.mean_classifier, level, corners)
    if pyramid.max_depth is not None:
        visible = means[..., 3] > 0
        depths = means[visible]
        opacities_to_depths(depths, pyramid.max_depth)
        means[visible] = depths
    stored: Array = np.empty(means.shape, pyramid.levels[0].means.dtype)
    store_scaled(means, 1 / pyramid.mean_unit, stored)
    return stored


def _average_cells(volume: Volume, classifier: Classifier, level: int, corners: Int64) -> Float32:
    """Return the means of blocks of 18^3 cells of level 1 or 2, or of classified voxels for level 0.

    Returns float32 [n, 18, 18, 18, 4], with zeros beyond the border. corners: [n, 3], the places (x, y, z) of the
    lowest cells of the blocks.
    """
    means = np.zeros((len(corners), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, 4), np.float32)
    volume.require_unchanged()
    kernels().average_cells(raw=raw_voxels(volume), classifier=classifier, level=level, corners=corners, means=means)
    volume.require_unchanged()
    return means
