"""Which blocks of voxels show nothing at all, compiled: they are left out before a pyramid is built of the others.

Voxels with a table are looked up until one is visible. Without, the extinction is linear between the control points, so
that what lies between a block's smallest and largest scalar is no more visible than those two and the points between.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.jit import jit
from renderer.pyramid.kernels import BLOCK_SIZE
from renderer.transfer import VISIBILITY_THRESHOLD, Classifier, RawVoxels, TransferSegments, evaluate

UInt64 = npt.NDArray[np.uint64]


def visible_blocks(raw: RawVoxels, classifier: Classifier, starts: UInt64, extents: UInt64) -> npt.NDArray[np.bool_]:
    """bool [g]: whether the blocks at voxels `starts` [g, 3], `extents` [g, 3] large (x, y, z), may show something.

    Exact with a table; without one, a block may count although nothing in it is visible.
    """
    visible = np.zeros(len(starts), np.bool_)
    if classifier.table is not None:
        _test_by_table(raw, (classifier.table[:, 3] > 0).view(np.uint8), starts, extents, visible)
    else:
        _test_by_range(raw, classifier.segments, starts, extents, visible)
    return visible


@jit
def _test_by_table(
    raw: RawVoxels, shown: npt.NDArray[np.uint8], starts: UInt64, extents: UInt64, visible: npt.NDArray[np.bool_]
) -> None:
    for g in range(len(starts)):
        x0, y0, z0, num = starts[g, 0], starts[g, 1], starts[g, 2], extents[g, 0]
        found, z, y = np.uint8(0), np.uint64(0), np.uint64(0)
        while found == 0 and z < extents[g, 2]:
            if num == BLOCK_SIZE:  # a fixed number, which the compiler unrolls
                for x in range(np.uint64(BLOCK_SIZE)):
                    found |= shown[raw[z0 + z, y0 + y, x0 + x]]
            else:
                for x in range(num):
                    found |= shown[raw[z0 + z, y0 + y, x0 + x]]
            y += np.uint64(1)
            if y == extents[g, 1]:
                y, z = np.uint64(0), z + np.uint64(1)
        visible[g] = found > 0


@jit
def _test_by_range(
    raw: RawVoxels, segments: Any, starts: UInt64, extents: UInt64, visible: npt.NDArray[np.bool_]
) -> None:
    for g in range(len(starts)):
        x0, y0, z0 = starts[g, 0], starts[g, 1], starts[g, 2]
        low = high = raw[z0, y0, x0]
        if evaluate(float(low), segments)[3] > 0:
            visible[g] = True
            continue
        for z in range(z0, z0 + extents[g, 2]):
            for y in range(y0, y0 + extents[g, 1]):
                for x in range(x0, x0 + extents[g, 0]):
                    value = raw[z, y, x]
                    low, high = min(low, value), max(high, value)
        visible[g] = _shows(float(low), float(high), segments)


@jit
def _shows(low: float, high: float, segments: TransferSegments) -> bool:
    """Whether any scalar from `low` to `high` is visible."""
    if evaluate(low, segments)[3] > 0 or evaluate(high, segments)[3] > 0:
        return True
    rows, found = segments.rows, False
    for k in range(1, len(rows)):  # row k starts at control point k - 1
        found |= low <= rows[k, 0] <= high and rows[k, 6] >= VISIBILITY_THRESHOLD
    return found
