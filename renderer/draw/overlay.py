"""Make the lines of overlays: the edges of the cells or bricks of a cut, or the outline of the volume with ticks.

The twelve edges of a cell enclose its voxels; at the volume's border they end with the volume. Cells of one level share
most of their edges: each edge is drawn once, because an edge drawn twice would look heavier than others. Coarse levels
come first, so that fine cells are drawn over coarse cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from renderer.bricks import BrickCut
from renderer.kernels import kernels
from renderer.pyramid import Cut
from renderer.volume import Float32, Float64, Int64, Volume

# The length of a tick of the volume's outline, as a share of the longest side of the volume's box.
_TICK_LENGTH = 0.02
# The length of every fifth tick of the volume's outline, as a share of the longest side of the volume's box.
_LONG_TICK_LENGTH = 0.04
# One tick in this many is a long one.
_LONG_TICK_EVERY = 5
# The outline of a volume has the colour of edges of cells of this level.
_OUTLINE_LEVEL = 1


@dataclass(frozen=True)
class Lines:
    """A list of lines to draw over a picture, each along an edge of a cell; large cells come first.

    vertices: float32 [n, 7], start [3] and end [3] in model units and world axes, and the level of the cell.
    voxel_side: the shortest side of a cell of level 0, in model units, by which edges are made fainter; infinite for
        lines that are no edges of cells.
    origin: float64 [3], the world position of the model's origin.
    model_unit: the world length of a model unit.
    """

    vertices: Float32
    voxel_side: float
    origin: Float64
    model_unit: float

    def __len__(self) -> int:
        return len(self.vertices)


def make_edges(cut: Cut | BrickCut, levels_above: int) -> Lines:
    """Return the edges of the cells of a cut, or of its bricks, whose edges have the level of their cells.

    levels_above: the number of levels by which a brick is larger than its cells; 0 to draw cells. Within a level the
    edges are sorted by axis and position.

    Model units are as in `renderer.splats.splats`.
    """
    volume = cut.volume
    edges = volume.world_from_index[:3, :3]
    length = volume.half_diagonal
    parts = [np.empty((0, 7), np.float32)]
    for level in np.unique(cut.levels)[::-1].tolist():
        cells = cut.cells[cut.levels == level].astype(np.int64)
        num_corners = cells.max(axis=0) + 2
        for axis in range(3):
            starts = _edge_starts(cells, num_corners, axis)
            parts.append(np.full((len(starts), 7), level, np.float32))
            kernels().place_edges(
                starts=starts,
                num_corners=num_corners,
                axis=axis,
                level=level + levels_above,
                shape=volume.shape_xyz,
                model_from_index=edges / length,
                vertices=parts[-1],
            )
    vertices = np.concatenate(parts)
    vertices.flags.writeable = False
    side = float(np.linalg.norm(edges, axis=0).min()) / length * 2**levels_above
    return Lines(vertices, side, volume.centre, length)


def make_outline(volume: Volume) -> Lines:
    """Return the edges of the volume's box, and ticks along the three edges that meet in the corner of the first voxel.

    Ticks are at round world distances. Each consists of two strokes, one on each face that meets in the edge.
    """
    box = volume.world_from_index[:3, :3] * volume.shape_xyz  # its columns are the edges of the box
    sides = np.linalg.norm(box, axis=0)
    corner, step = -box.sum(axis=1) / 2, tick_step(float(sides.max()))
    starts, spans = [], []
    for axis in range(3):
        others = [other for other in range(3) if other != axis]
        for ends in product((0, 1), repeat=2):
            starts.append(corner + box[:, others] @ ends)
            spans.append(box[:, axis])
        for number in range(1, _num_ticks(sides[axis], step) + 1):
            length = sides.max() * (_TICK_LENGTH if number % _LONG_TICK_EVERY else _LONG_TICK_LENGTH)
            for other in others:
                starts.append(corner + box[:, axis] * (number * step / sides[axis]))
                spans.append(box[:, other] * min(length / sides[other], 1.0))
    points = np.column_stack([starts, np.add(starts, spans)]) / volume.half_diagonal
    vertices = np.insert(points, 6, _OUTLINE_LEVEL, axis=1).astype(np.float32)
    vertices.flags.writeable = False
    return Lines(vertices, np.inf, volume.centre, volume.half_diagonal)


def tick_step(side: float) -> float:
    """Return the distance between ticks: the longest 1, 2 or 5 times a power of ten with at least four ticks on a side.

    There are at most nine ticks, because such distances differ by a factor of at most 2.5.
    """
    power = math.floor(math.log10(side / 4))
    return max(step for n in (0.5, 1, 2, 5) if _num_ticks(side, step := n * 10.0**power) >= 4)


def _num_ticks(side: float, step: float) -> int:
    """Return the number of ticks along a side, `step` apart; the two ends of the side have none."""
    return math.ceil(side / step - 1e-9) - 1


def _edge_starts(cells: Int64, num_corners: Int64, axis: int) -> Int64:
    """Return the corners where the edges of cells along an axis start, each once, ascending: int64 [n].

    A corner is given by its number in a grid of `num_corners` corners, x fastest. cells: int64 [m, 3], the positions of
    cells of one level, in widths of a cell.
    """
    strides = np.array([1, num_corners[0], num_corners[0] * num_corners[1]])
    side, other_side = np.delete(strides, axis)
    return np.unique((cells @ strides)[:, None] + [0, side, other_side, side + other_side])
