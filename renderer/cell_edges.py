"""The cells of a cut as lines: what `overlay: octree` draws, before any view is chosen.

The twelve edges of every cell at its true extent, where the volume's border cuts it, too. Cells of one level share most
of their edges; each is there once, or lines that many cells share would be heavier than others. Coarse levels come
first, so that fine cells are drawn over coarse ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.octree import Cut

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

# Colours by level, the finest first and the last for all levels beyond: from orange to blue in even steps of lightness
# (CIE L* 62 to 41) and hue, as saturated as sRGB allows. None is brighter or darker, so that the contrast to black and
# to white is at least 3 (WCAG 2.2, 1.4.11, for graphics), but for 2.97 of level 0 to white.
LEVEL_COLORS = (
    "#ed730c", "#f95b30", "#fe414c", "#fb2767", "#f01483",
    "#dc1e9f", "#be33b8", "#9446cd", "#5354dc", "#055ebf",
)  # fmt: skip


@dataclass(frozen=True)
class CellEdges:
    """Edges, coarse levels first, and within a level in the order of their axis and place.

    vertices: float32 [n, 7], laid out as the device reads them: start [3] and end [3] in model units and world axes,
        and the level of the cell.
    voxel_side: the shortest side of a voxel, model units.
    origin: float64 [3], world position of the model's origin.
    length: world units in a model unit.
    """

    vertices: npt.NDArray[np.float32]
    voxel_side: float
    origin: Float64
    length: float

    def __len__(self) -> int:
        return len(self.vertices)


def make_cell_edges(cut: Cut) -> CellEdges:
    """All edges of the cells of a cut; model units are those of `renderer.splats`."""
    volume = cut.volume
    edges, shape = volume.world_from_index[:3, :3], np.array(volume.shape_xyz)
    length = 0.5 * float(np.linalg.norm(edges * shape))
    parts = [np.empty((0, 7), np.float32)]
    for level in np.unique(cut.levels)[::-1]:
        lattice = _lattice_edges(cut.cells[cut.levels == level].astype(np.int64))
        part = np.empty((len(lattice), 7), np.float32)
        for end in (0, 1):
            corners = np.minimum(lattice[:, end] << int(level), shape)
            part[:, 3 * end : 3 * end + 3] = (corners - shape / 2) @ (edges.T / length)
        part[:, 6] = level
        parts.append(part)
    vertices = np.concatenate(parts)
    vertices.flags.writeable = False
    return CellEdges(vertices, float(np.linalg.norm(edges, axis=0).min()) / length, volume.centre, length)


def level_colors() -> Float64:
    """float64 [num_levels, 3]: LEVEL_COLORS as numbers from 0 to 1."""
    return np.array([list(bytes.fromhex(color[1:])) for color in LEVEL_COLORS]) / 255


def _lattice_edges(cells: Int64) -> Int64:
    """int64 [n, 2, 3]: start and end of every edge of some cells of one level, each once, in units of their width."""
    num_corners = cells.max(axis=0) + 2
    found = []
    for axis in range(3):
        across = [other for other in range(3) if other != axis]
        starts = np.repeat(cells, 4, axis=0).reshape(-1, 4, 3)
        starts[:, :, across] += [[0, 0], [1, 0], [0, 1], [1, 1]]
        codes = np.unique(np.ravel_multi_index(tuple(starts.reshape(-1, 3).T), tuple(num_corners)))
        start = np.column_stack(np.unravel_index(codes, tuple(num_corners)))
        found.append(np.stack([start, start + np.eye(3, dtype=np.int64)[axis]], axis=1))
    return np.concatenate(found)
