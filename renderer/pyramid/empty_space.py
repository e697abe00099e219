"""Find the blocks of voxels that show nothing, compiled. Pyramids are built of the others.

Voxels with a table are looked up until one is visible. Wider voxels take the min-max test of `renderer.transfer`.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.compiled import jit
from renderer.pyramid.nodes import BLOCK_SIZE
from renderer.transfer import Classifier, RawVoxels, is_range_visible
from renderer.volume import Bools, Float64, UInt8, UInt64


def visible_blocks(raw: RawVoxels, classifier: Classifier, starts: UInt64, extents: UInt64) -> Bools:
    """Return which blocks at voxels `starts` [g, 3], `extents` [g, 3] large (x, y, z), may show something, bool [g].

    Exact with a table. Without one, a block may count although no voxel in it is visible.
    """
    if classifier.table is not None:
        return _test_by_table(raw, (classifier.table[:, 3] > 0).view(np.uint8), starts, extents)
    return _test_by_range(raw, classifier.breakpoints, starts, extents)


@jit
def _test_by_table(raw: RawVoxels, is_visible: UInt8, starts: UInt64, extents: UInt64) -> Bools:
    visible = np.empty(len(starts), np.bool_)
    for g in range(len(starts)):
        x0, y0, z0, num = starts[g, 0], starts[g, 1], starts[g, 2], extents[g, 0]
        found, z, y = np.uint8(0), np.uint64(0), np.uint64(0)
        while found == 0 and z < extents[g, 2]:
            if num == BLOCK_SIZE:  # a fixed number, which the compiler unrolls
                for x in range(np.uint64(BLOCK_SIZE)):
                    found |= is_visible[raw[z0 + z, y0 + y, x0 + x]]
            else:
                for x in range(num):
                    found |= is_visible[raw[z0 + z, y0 + y, x0 + x]]
            y += np.uint64(1)
            if y == extents[g, 1]:
                y, z = np.uint64(0), z + np.uint64(1)
        visible[g] = found > 0
    return visible


@jit
def _test_by_range(raw: RawVoxels, breakpoints: Float64, starts: UInt64, extents: UInt64) -> Bools:
    visible = np.empty(len(starts), np.bool_)
    for g in range(len(starts)):
        x0, y0, z0 = starts[g, 0], starts[g, 1], starts[g, 2]
        first = float(raw[z0, y0, x0])
        visible[g] = not math.isnan(first) and is_range_visible(breakpoints, first, first)
        if visible[g]:
            continue
        low, high = np.inf, -np.inf
        for z in range(z0, z0 + extents[g, 2]):
            for y in range(y0, y0 + extents[g, 1]):
                for x in range(x0, x0 + extents[g, 0]):
                    value = float(raw[z, y, x])
                    low, high = min(low, value), max(high, value)  # of a second number NaN, the first
        visible[g] = low <= high and is_range_visible(breakpoints, low, high)
    return visible
