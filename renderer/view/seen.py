"""Find the visible cells that decide how a volume is framed, without cells that add next to nothing to a picture.

A voxel of noise beside a leg, or faint voxels around a crystal, would make the object smaller in its frame, and move it
out of the middle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from renderer.pyramid import Pyramid, cell_voxel_counts, descendants, root_cells
from renderer.volume import Bools, Float64, grow, label_parts

# All cells that framing leaves out add, together, less than this share of a picture.
MOST_LEFT_OUT = 1e-3
# Framing leaves cells out only if the box around the remaining cells is shorter along an axis by at least this share.
# So the thin end of an object stays in the picture.
_LEAST_GAIN = 0.05
# A cell is faint if its opacity is less than this share of the opacity at _OPAQUE_PERCENTILE.
_FAINT = 0.02
# The percentile of the opacities of visible cells that stands for the most opaque cells.
_OPAQUE_PERCENTILE = 99.0
# The finest level at which a pyramid always has all nodes.
_FINEST_LEVEL = 3
# The opacities of cells are looked up at a level with at most this many cells; if a level has more, the next coarser
# level is taken. 448^3 voxels have 175,616 cells of level 3, whose indices take 10 MB.
_MOST_CELLS = 2**16


class SeenCells(NamedTuple):
    """The visible cells that decide how a volume is framed.

    cells: which cells these are, bool [z, y, x].
    left_out: the share of a picture that the visible cells which do not decide the framing add to it.
    """

    cells: Bools
    left_out: float


def seen_cells(pyramid: Pyramid, occupied: Bools) -> SeenCells:
    """Return which of the visible cells of level `Pyramid.occupied_level` decide how a volume is framed.

    The share of a picture that cells add is measured on the mean of three pictures of opacities, along the three axes.
    Each connected part of the volume is kept or left out as a whole, and so are all faint cells together.

    occupied: the cells of `Pyramid.occupied` that are not clipped away.
    """
    everything = SeenCells(occupied, 0.0)
    if pyramid.num_levels <= max(_FINEST_LEVEL, pyramid.occupied_level) or not occupied.any():
        return everything
    depths = _depths(pyramid, occupied)
    picture = float(np.mean([-np.expm1(-depths.sum(axis=axis)).sum() for axis in range(3)]))
    opacities = -np.expm1(-depths)
    if not _may_gain(occupied, opacities, MOST_LEFT_OUT * picture):
        return everything
    is_faint = occupied & (opacities < _FAINT * np.percentile(opacities[occupied], _OPAQUE_PERCENTILE))
    parts = label_parts(grow(occupied & ~is_faint, 1))  # grown: cells of thin objects may only touch at corners
    parts[is_faint] = parts.size  # all faint cells are one part
    amounts = np.bincount(parts[occupied], opacities[occupied], parts.size + 1)
    order = np.flatnonzero(amounts)[np.argsort(amounts[amounts > 0], kind="stable")]
    total = np.cumsum(amounts[order])
    dropped = order[total < MOST_LEFT_OUT * picture]
    kept = occupied & ~np.isin(parts, dropped)
    if not dropped.size or not _gains(occupied, kept):
        return everything
    return SeenCells(kept, float(total[dropped.size - 1]) / picture)


def _depths(pyramid: Pyramid, occupied: Bools) -> Float64:
    """Return the optical depth of each visible cell, float64 [z, y, x].

    Depths are looked up at a coarser level with few enough nodes. The depth of a node is divided equally among the
    visible cells in it. occupied: the visible cells, bool [z, y, x].
    """
    level = _level_of_opacities(pyramid)
    nodes, cells = descendants(pyramid, *root_cells(pyramid), pyramid.num_levels, level)
    factor = 2 ** (level - pyramid.occupied_level)
    padded = np.pad(occupied, [(0, -num % factor) for num in occupied.shape])
    shape = [num // factor for num in padded.shape]
    blocks = padded.reshape(shape[0], factor, shape[1], factor, shape[2], factor)
    totals, num_cells = np.zeros(shape), np.maximum(blocks.sum(axis=(1, 3, 5)), 1)
    x, y, z = cells.T
    means = pyramid.levels[level - 1].means[nodes, 3].astype(np.float64) * pyramid.mean_unit
    totals[z, y, x] = means * cell_voxel_counts(cells, level, pyramid.volume)
    depths = totals / num_cells / 4.0**pyramid.occupied_level
    for axis, num in enumerate(occupied.shape):
        depths = depths.repeat(factor, axis).take(range(num), axis)
    return np.asarray(np.where(occupied, depths, 0.0), np.float64)


def _level_of_opacities(pyramid: Pyramid) -> int:
    """Return the finest level at which the pyramid has all nodes and at most _MOST_CELLS cells."""
    level, sizes = max(_FINEST_LEVEL, pyramid.occupied_level), pyramid.volume.shape_xyz
    while level < pyramid.num_levels and math.prod(((n - 1) >> level) + 1 for n in sizes) > _MOST_CELLS:
        level += 1
    return level


def _may_gain(occupied: Bools, opacities: Float64, most: float) -> bool:
    """Return whether the box around cells may shrink by _LEAST_GAIN if cells are left out that add less than `most`.

    occupied: the visible cells. opacities: the opacity of each cell, [z, y, x]. most: a sum of opacities.
    """
    for axis in range(3):
        others = tuple(each for each in range(3) if each != axis)
        sums, is_there = opacities.sum(axis=others), np.flatnonzero(occupied.any(axis=others))
        for ascending in (sums, sums[::-1]):
            first = int(np.flatnonzero(ascending)[0]) if ascending.any() else 0
            last = int(np.searchsorted(np.cumsum(ascending), most))
            if last - first >= _LEAST_GAIN * (is_there[-1] + 1 - is_there[0]):
                return True
    return False


def _gains(before: Bools, after: Bools) -> bool:
    """Return whether the box around the cells `after` is shorter along an axis than the box around the cells `before`.

    It must be shorter by at least the share _LEAST_GAIN.
    """
    for axis in range(3):
        others = tuple(each for each in range(3) if each != axis)
        was, now = (np.flatnonzero(cells.any(axis=others)) for cells in (before, after))
        if np.ptp(was) - np.ptp(now) >= _LEAST_GAIN * (np.ptp(was) + 1):
            return True
    return False
