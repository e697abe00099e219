"""Hold the pyramid: for each octree node, the mean of its voxels and the error of replacing them by it.

Level l has cells of 2^l voxels a side. Level 0, the voxels, is not stored: it is classified when it is needed. A node's
four channels are means of the channels of `renderer.transfer.classify`: of `(tau c, tau) h0`, with h0 the finest voxel
spacing, or of `(a c, a)`, which are then stored as the depths that have these opacities. A node's error is the root of
a variance, summed over channels (Laur and Hanrahan 1991, section 3: the RMS error of a node). The scene's error measure
chooses the channels:

    optical           (tau c, tau) h0     the cut multiplies the error by the cell's side: the share of a pixel that can
                                          change
    rms, classified   (a c, a)            opacity over the finest spacing
    rms, scalar       s                   in data units

Only visible nodes are stored. Every level is a list in Morton order, so that the children of a node lie together.
Blocks in which nothing is visible are not even classified. Nodes of levels 1 and 2 below a node that is a leaf in every
cut are left out, too: a film at one tolerance has no use for them.

If bricks are drawn, these two levels are not stored at all. They are streamed to a callback, which gathers statistics
of bricks, and recomputed from voxels when they are drawn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from renderer.kernels import Classifier
from renderer.volume import Array, Bools, Int64, UInt8, Volume

# The type of the size of a volume: the number of voxels along x, y, z.
Shape = tuple[int, int, int]

# The places (x, y, z) of the eight children of a cell, 0 or 1 along each axis, in Morton order: int32 [8, 3].
OCTANTS = np.arange(8, dtype=np.int32)[:, None] >> np.arange(3, dtype=np.int32) & 1


class FinestCut(NamedTuple):
    """A bound of the cuts that will be made of a pyramid: the smallest tolerance, and the finest level of cells."""

    tolerance: float = 0.0
    level: int = 0


# The bound for a pyramid from which every cut can be made.
EVERY_CUT = FinestCut()


class Level(NamedTuple):
    """A level of a pyramid: its visible nodes, in Morton order of their cells.

    means: float16 or float32 [n, 4], the means of the nodes' channels, in units of `Pyramid.mean_unit`.
    errors: float16 or float32 [n], the errors of the nodes, in units of `Pyramid.error_unit`.
    masks: uint8 [n], whose bit `x + 2 y + 4 z` says whether the child (x, y, z) is visible; empty for level 1.
    first_children: int64 [n], the index in the level below of the first visible child; empty for level 1, and while the
        pyramid is built.
    """

    means: Array
    errors: Array
    masks: UInt8
    first_children: Int64

    @classmethod
    def empty(cls, num: int, dtype: type[Any], *, masked: bool) -> Level:
        """Return a level with room for `num` nodes, which takes memory only once it is written.

        masked: whether nodes have masks; the nodes of level 1 have none.
        """
        masks = np.empty(num if masked else 0, np.uint8)
        return cls(np.empty((num, 4), dtype), np.empty(num, dtype), masks, np.empty(0, np.int64))

    def part(self, first: int, end: int) -> Level:
        """Return a level that holds views of the nodes from index `first` up to `end`."""
        return Level._make(array[first:end] for array in self)


@dataclass(frozen=True)
class Pyramid:
    """A pyramid of averages: for each octree node the mean of its voxels, and the error of replacing them by the mean.

    levels: the levels from 1 on. The last one holds the root, or no node if nothing is visible.

    mean_unit, error_unit: factors from stored means and errors to their true units.
    classifier: the classifier of level 0, which always gives (tau c, tau) times the finest spacing. mean_classifier:
        the classifier of the channels that are averaged.
    max_depth: the largest optical depth of a voxel, if opacities are averaged; else None.
    volume: the volume whose voxels are averaged.
    measure, of: the error measure, as in ErrorSpec.
    occupied: bool [z, y, x], the cells of level `occupied_level` in which anything is visible.
    occupied_level: the level of the cells of `occupied`.
    finest_cut: the bound of the cuts that can be made. Nodes of finer cuts were left out.
    """

    levels: tuple[Level, ...]
    mean_unit: float
    error_unit: float
    classifier: Classifier
    mean_classifier: Classifier
    max_depth: float | None
    volume: Volume
    measure: str
    of: str
    occupied: Bools
    occupied_level: int
    finest_cut: FinestCut

    @property
    def num_levels(self) -> int:
        """Return the number of levels, which is also the level of the root."""
        return len(self.levels)

    @property
    def num_bytes(self) -> int:
        """Return the memory of all levels, in bytes."""
        return sum(array.nbytes for level in self.levels for array in level)


def error_scale(volume: Volume, measure: str, num_voxels: Any) -> Any:
    """Return the ratio between the error of nodes of `num_voxels` voxels and the root of their variance.

    For the measure `optical` the ratio is the side of a node's cell, the cube root of its world volume, in units of the
    finest spacing: channels are optical depths of that length. For the measure `rms` the ratio is 1.
    """
    if measure == "rms":
        return np.ones(())
    in_finest = volume.world_from_index[:3, :3] / volume.finest_spacing  # divided first, as determinants may underflow
    return np.cbrt(num_voxels * abs(float(np.linalg.det(in_finest))))


def cell_extents(cells: Array, level: int, shape_xyz: Shape) -> Int64:
    """Return the numbers of voxels of cells along x, y, z, which the volume's border may cut: int64 [n, 3].

    cells: [n, 3], the places (x, y, z) of cells, in units of the width of their level.
    """
    first = cells.astype(np.int64) << level
    return np.asarray(np.minimum(np.array(shape_xyz) - first, 1 << level))


def subdivide(cells: Array, level: int, finer_level: int, shape_xyz: Shape) -> Array:
    """Return the cells of a finer level that lie in given cells and in the volume, in Morton order: [m, 3].

    cells: [n, 3], the places (x, y, z) of the given cells. The place of a cell is in units of the width of its level.
    """
    for number in range(level - 1, finer_level - 1, -1):
        cells = (2 * cells[:, None] + OCTANTS).reshape(-1, 3)
        inside = cells << number < shape_xyz
        cells = cells[inside[:, 0] & inside[:, 1] & inside[:, 2]]
    return cells
