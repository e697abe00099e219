"""Make the lines of `overlay: octree`: the edges of the cells or bricks of a cut.

A cell has twelve edges, at its true extent, which the volume's border may cut. Cells of one level share most of their
edges: each is drawn once, because shared lines would be heavier than others. Coarse levels come first, so that fine
cells are drawn over coarse ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.bricks import BRICK_LEVELS, BrickCut
from renderer.compiled import jit
from renderer.pyramid import Cut
from renderer.volume import Float32, Float64, Int64


@dataclass(frozen=True)
class CellEdges:
    """A list of the edges of the drawn cells: coarse levels first, within a level sorted by axis and position.

    vertices: float32 [n, 7], as the device reads them: start [3] and end [3] in model units and world axes,
        and the level of the cell.
    voxel_side: the shortest side of a voxel, or of a brick of voxels, model units.
    origin: float64 [3], world position of the model's origin.
    model_unit: world length of a model unit.
    """

    vertices: Float32
    voxel_side: float
    origin: Float64
    model_unit: float

    def __len__(self) -> int:
        return len(self.vertices)


def make_edges(cut: Cut | BrickCut) -> CellEdges:
    """Return the edges of a cut: of its cells, or of its bricks, in the colours of their cells' levels.

    Model units are those of `renderer.splats.splats`.
    """
    volume, levels_above = cut.volume, BRICK_LEVELS if isinstance(cut, BrickCut) else 0
    edges, shape = volume.world_from_index[:3, :3], np.array(volume.shape_xyz)
    length = volume.half_diagonal
    parts = [np.empty((0, 7), np.float32)]
    for level in np.unique(cut.levels)[::-1].tolist():
        cells = cut.cells[cut.levels == level].astype(np.int64)
        num_corners = cells.max(axis=0) + 2
        for axis in range(3):
            starts = _edge_starts(cells, num_corners, axis)
            parts.append(_edges_from(starts, num_corners, axis, level + levels_above, shape, edges / length))
            parts[-1][:, 6] = level
    vertices = np.concatenate(parts)
    vertices.flags.writeable = False
    side = float(np.linalg.norm(edges, axis=0).min()) / length * 2**levels_above
    return CellEdges(vertices, side, volume.centre, length)


def _edge_starts(cells: Int64, num_corners: Int64, axis: int) -> Int64:
    """Return the corners where edges along an axis start, once each and ascending: int64 [n].

    The corners of all cells are numbered, x fastest. cells: int64 [m, 3], in units of their width.
    """
    strides = np.array([1, num_corners[0], num_corners[0] * num_corners[1]])
    side, other_side = np.delete(strides, axis)
    return np.unique((cells @ strides)[:, None] + [0, side, other_side, side + other_side])


@jit
def _edges_from(
    starts: Int64, num_corners: Int64, axis: int, level: int, shape: Int64, model_from_index: Float64
) -> Float32:
    """Return both ends of each edge, clamped to the volume: float32 [n, 7], the last column undefined."""
    vertices, corner = np.empty((len(starts), 7), np.float32), np.empty(3)
    for i in range(len(starts)):
        corner_number = starts[i]
        for end in range(2):
            rest = corner_number
            for k in range(3):
                index = rest % num_corners[k] + (end if k == axis else 0)
                corner[k] = min(index << level, shape[k]) - 0.5 * shape[k]
                rest //= num_corners[k]
            for row in range(3):
                vertices[i, 3 * end + row] = (
                    model_from_index[row, 0] * corner[0]
                    + model_from_index[row, 1] * corner[1]
                    + model_from_index[row, 2] * corner[2]
                )
    return vertices
