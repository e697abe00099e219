"""Find the cut: the octree cells that are drawn at a tolerance. They cover every visible voxel exactly once.

The tree is walked top-down, level by level (Laur and Hanrahan 1991, section 4). A node whose error is *below* the
tolerance becomes a leaf. All other nodes are split, so that a tolerance of 0 reaches every visible voxel. Nodes without
extinction are not in the pyramid and cost nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.kernels import kernels
from renderer.pyramid.pyramid import Level, Pyramid, cell_extents, error_scale
from renderer.transfer import raw_voxels
from renderer.volume import Float32, Float64, Int32, Int64, UInt8, Volume


@dataclass(frozen=True)
class Cut:
    """A cut: the cells that are drawn, coarse levels first, in Morton order within a level.

    The index of a cell is its id.

    levels: uint8 [n], the level of each cell. A cell of level l is 2^l voxels wide, or less at the volume's border.
    cells: int32 [n, 3], the place (x, y, z) of each cell, in units of the cell's width.
    depths: float32 [n, 4], the mean of (tau c, tau) in each cell, times the finest spacing.
    volume: the volume that was cut.
    """

    levels: UInt8
    cells: Int32
    depths: Float32
    volume: Volume

    def __len__(self) -> int:
        return len(self.levels)


def cut_pyramid(pyramid: Pyramid, tolerance: float, *, finest_level: int = 0) -> Cut:
    """Return the coarsest cells whose error is below `tolerance` (in the measure's unit), none below `finest_level`.

    Raises ValueError if the pyramid was not built for this tolerance or level.
    """
    finest = pyramid.finest_cut
    if not tolerance >= finest.tolerance:
        raise ValueError(f"no pyramid for this tolerance: got {tolerance}, expected at least {finest.tolerance}")
    if finest_level < finest.level:
        raise ValueError(f"no pyramid for this level: got {finest_level}, expected at least {finest.level}")
    nodes, cells = root_cells(pyramid)
    leaves = []
    for number in range(pyramid.num_levels, 0, -1):
        level = pyramid.levels[number - 1]
        is_leaf = np.ones(len(nodes), np.bool_)
        if number > finest_level:
            is_leaf = node_errors(pyramid, nodes, cells, number) < tolerance
        depths = level.means[nodes[is_leaf]].astype(np.float32) * np.float32(pyramid.mean_unit)
        leaves.append((number, cells[is_leaf], depths))
        nodes, cells = nodes[~is_leaf], cells[~is_leaf]
        if number > 1:
            nodes, cells = visible_children(nodes, cells, level)
    return _join_leaves(pyramid, leaves, cells)


def root_error(pyramid: Pyramid) -> float:
    """Return the error of drawing the whole volume as one cell. A cut at any larger tolerance is a single cell."""
    return float(node_errors(pyramid, *root_cells(pyramid), pyramid.num_levels).max(initial=0.0))


def root_cells(pyramid: Pyramid) -> tuple[Int64, Int32]:
    """Return the index and the place of the octree's root, [1] and [1, 3]; empty arrays if nothing is visible."""
    num = len(pyramid.levels[-1].errors)
    return np.arange(num), np.zeros((num, 3), np.int32)


def node_errors(pyramid: Pyramid, nodes: Int64, cells: Int32, level: int) -> Float64:
    """Return the errors of nodes of a level, in the measure's unit: float64 [n].

    nodes: [n], their indices in the level. cells: [n, 3], their places.
    """
    sizes = cell_voxel_counts(cells, level, pyramid.volume)
    scale = np.asarray(error_scale(pyramid.volume, pyramid.measure, sizes) * pyramid.error_unit)
    return np.asarray(pyramid.levels[level - 1].errors[nodes] * scale)


def cell_voxel_counts(cells: Int32, level: int, volume: Volume) -> Int64:
    """Return the number of voxels in each cell of a level: int64 [n]."""
    # Three columns are multiplied, because `prod` along the rows takes ten times as long.
    x, y, z = cell_extents(cells, level, volume.shape_xyz).T
    return np.asarray(x * y * z)


def descendants(pyramid: Pyramid, nodes: Int64, cells: Int32, level: int, finer_level: int) -> tuple[Int64, Int32]:
    """Return the visible nodes of a finer level that lie in given nodes of a level.

    nodes, cells, and the results: as in `visible_children`.
    """
    for number in range(level, finer_level, -1):
        nodes, cells = visible_children(nodes, cells, pyramid.levels[number - 1])
    return nodes, cells


def visible_children(nodes: Int64, cells: Int32, level: Level) -> tuple[Int64, Int32]:
    """Return the visible children of nodes of a level: the children's indices in the level below [m], and cells [m, 3].

    nodes: [n], indices in the level. cells: [n, 3], the cells of these nodes.
    """
    num = int(np.bitwise_count(level.masks[nodes]).sum(dtype=np.int64))
    child_nodes, child_cells = np.empty(num, np.int64), np.empty((num, 3), np.int32)
    kernels().list_children(
        nodes=nodes, cells=cells, masks=level.masks, first_children=level.first_children, child_nodes=child_nodes,
        child_cells=child_cells,
    )  # fmt: skip
    return child_nodes, child_cells


def _join_leaves(pyramid: Pyramid, leaves: list[tuple[int, Int32, Float32]], parents: Int32) -> Cut:
    """Return the cut that joins the leaves of all levels with the visible voxels in cells of level 1.

    leaves: for each level its number, and the cells and the depths of its leaves. parents: the cells of level 1 that
        are split into voxels.
    """
    levels, cells_of_level, depths_of_level = zip(*leaves, strict=True)
    nums = [len(cells) for cells in cells_of_level]
    num_coarse = sum(nums)
    capacity = num_coarse + 8 * len(parents)  # the system gives memory only for pages that are written
    cells, depths = np.empty((capacity, 3), np.int32), np.empty((capacity, 4), np.float32)
    np.concatenate(cells_of_level, out=cells[:num_coarse])
    np.concatenate(depths_of_level, out=depths[:num_coarse])
    num = num_coarse + int(_find_voxels(pyramid, parents, cells[num_coarse:], depths[num_coarse:]).sum(dtype=np.int64))
    cells.resize((num, 3), refcheck=False)
    depths.resize((num, 4), refcheck=False)
    all_levels = np.zeros(num, np.uint8)
    all_levels[:num_coarse] = np.repeat(levels, nums)
    for array in (all_levels, cells, depths):
        array.flags.writeable = False
    return Cut(all_levels, cells, depths, pyramid.volume)


def num_visible_voxels(pyramid: Pyramid, cells: Int32) -> UInt8:
    """Return the number of visible voxels in each cell of level 1: uint8 [n]."""
    return _find_voxels(pyramid, cells, np.empty((0, 3), np.int32), np.empty((0, 4), np.float32))


def _find_voxels(pyramid: Pyramid, parents: Int32, cells: Int32, depths: Float32) -> UInt8:
    """Return the number of visible voxels in each of `parents`, cells of level 1.

    The voxels are written to `cells` and `depths`, unless these are empty.
    """
    counts = np.empty(len(parents), np.uint8)
    pyramid.volume.require_unchanged()
    kernels().find_voxels(
        raw=raw_voxels(pyramid.volume), classifier=pyramid.classifier, parents=parents, counts=counts, cells=cells,
        depths=depths,
    )  # fmt: skip
    pyramid.volume.require_unchanged()
    return counts
