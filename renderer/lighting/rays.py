"""Average extinctions over cells, send rays through them, and interpolate what is known for cells, in compiled loops.

Grids have the outermost cells once more beyond each border, so that the nearest ones hold there. Places are in cells:
the centre of cell i is at i + 1 along each axis, and the volume begins at 1/2.
"""

from __future__ import annotations

import numpy as np

from renderer.compiled import jit
from renderer.transfer import RawVoxels, TransferTable, classify_scalar, interpolate_cells, scalar_at
from renderer.volume import Array, Float32

# Less than exp(-10) of the light, 5e-5, counts as none.
_OPAQUE_DEPTH = np.float32(10)


@jit
def average_voxels(
    raw: RawVoxels, by_pattern: Array | None, curve: TransferTable | None, level: int, slab: int, out: Float32
) -> None:
    """Write the mean optical depths [y, x] of cells of 2^level voxels, in a slab that is one cell thick.

    A cell that the border cuts has the mean of what is inside. by_pattern, curve: to classify by, as of a Classifier;
    the other one is None.
    """
    num_z, num_y, num_x = raw.shape
    side, sums = 1 << level, np.empty(out.shape[1])
    z0, z1 = slab << level, min((slab + 1) << level, num_z)
    for row in range(out.shape[0]):
        y0, y1 = row << level, min((row + 1) << level, num_y)
        sums[:] = 0.0
        for z in range(z0, z1):
            for y in range(y0, y1):
                for cell in range(len(sums)):
                    for x in range(cell * side, min(cell * side + side, num_x)):
                        if curve is None:
                            sums[cell] += scalar_at(raw, by_pattern, z, y, x)
                        else:
                            sums[cell] += classify_scalar(float(raw[z, y, x]), curve, False)[3]
        for cell in range(len(sums)):
            width = min(cell * side + side, num_x) - cell * side
            out[row, cell] = sums[cell] / (width * (y1 - y0) * (z1 - z0))


@jit
def transmit(depths: Float32, end: Float32, offsets: Float32, lengths: Float32, slab: int, out: Float32) -> None:
    """Write the mean transmission of rays from the centres of a slab's cells [y, x]; 1 where nothing is visible near.

    depths: [z + 2, y + 2, x + 2], mean optical depths of a finest spacing. end: [3] (x, y, z), the volume's border.
    offsets: [rays, samples, 3] (x, y, z), from a centre to where its rays are sampled, outwards. lengths: [samples],
    those that samples stand for, in finest spacings. A ray ends at the border.
    """
    begin, one = np.float32(0.5), np.float32(1)
    for row in range(out.shape[0]):
        for cell in range(out.shape[1]):
            if not _is_visible_near(depths, cell, row, slab):
                out[row, cell] = 1
                continue
            x, y, z, total = np.float32(cell) + one, np.float32(row) + one, np.float32(slab) + one, np.float32(0)
            for ray in range(offsets.shape[0]):
                depth = np.float32(0)
                for k in range(len(lengths)):
                    u, v, w = x + offsets[ray, k, 0], y + offsets[ray, k, 1], z + offsets[ray, k, 2]
                    is_inside = begin <= u <= end[0] and begin <= v <= end[1] and begin <= w <= end[2]
                    if not is_inside or depth > _OPAQUE_DEPTH:
                        break
                    depth += lengths[k] * interpolate_cells(depths, u, v, w)
                total += np.exp(-depth)
            out[row, cell] = total / np.float32(offsets.shape[0])


@jit
def _is_visible_near(depths: Float32, x: int, y: int, z: int) -> bool:
    """Return whether a cell or one of its 26 neighbours shows anything: the others are never interpolated where
    something is visible."""
    for k in range(z, z + 3):
        for j in range(y, y + 3):
            for i in range(x, x + 3):
                if depths[k, j, i] > 0:
                    return True
    return False
