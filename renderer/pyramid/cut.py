"""The cut: the set of octree cells that is drawn at a tolerance, every voxel covered once or transparent.

Top-down, level by level (Laur and Hanrahan 1991, section 4): a node whose error is *below* the tolerance becomes a
leaf, the others descend, so that a tolerance of 0 reaches every visible voxel. Nodes without extinction are not in the
pyramid and cost nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.jit import jit
from renderer.pyramid.pyramid import Pyramid, cell_extents, error_scale
from renderer.transfer import Lighting, RawVoxels, TransferSegments, classify_voxel, raw_voxels
from renderer.volume import Volume

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Cut:
    """The cells drawn, coarse levels first, in Morton order within a level: a cell's place is its id.

    levels: uint8 [n]; a cell of level l is 2^l voxels wide, less where the border cuts it.
    cells: int32 [n, 3], x, y, z in units of the cell's own width.
    depths: float32 [n, 4], means of (tau c, tau) times the finest spacing.
    volume: the volume that was cut.
    """

    levels: npt.NDArray[np.uint8]
    cells: Int32
    depths: Float32
    volume: Volume

    def __len__(self) -> int:
        return len(self.levels)

    def without_cells(self) -> Cut:
        """A cut of the same volume that holds nothing, and no memory."""
        return Cut(np.empty(0, np.uint8), np.empty((0, 3), np.int32), np.empty((0, 4), np.float32), self.volume)


class _Leaves(NamedTuple):
    """The leaves of one level: cells [n, 3] and depths [n, 4], as in Cut."""

    level: int
    cells: Int32
    depths: Float32


def cut_pyramid(pyramid: Pyramid, tolerance: float, *, finest_level: int = 0) -> Cut:
    """The coarsest cells whose error is below `tolerance` (in the measure's unit); none finer than `finest_level`.

    Raises ValueError where either is below what the pyramid was built for.
    """
    if not tolerance >= pyramid.min_tolerance:
        raise ValueError(f"no pyramid for this tolerance: got {tolerance}, expected at least {pyramid.min_tolerance}")
    if finest_level < pyramid.finest_level:
        raise ValueError(f"no pyramid for this level: got {finest_level}, expected at least {pyramid.finest_level}")
    cells = np.zeros((len(pyramid.levels[-1].errors), 3), np.int32)
    nodes = np.arange(len(cells))
    parts = []
    for number in range(pyramid.num_levels, 0, -1):
        level = pyramid.levels[number - 1]
        is_leaf = (
            node_errors(pyramid, nodes, cells, number) < tolerance
            if number > finest_level
            else np.ones(len(nodes), np.bool_)
        )
        means = level.means[nodes[is_leaf]].astype(np.float32) * np.float32(pyramid.mean_unit)
        parts.append(_Leaves(number, cells[is_leaf], means))
        nodes, cells = nodes[~is_leaf], cells[~is_leaf]
        if number > 1:
            nodes, cells = visible_children(nodes, cells, level.masks, level.first_children)
    return _joined(pyramid, parts, cells)


def root_error(pyramid: Pyramid) -> float:
    """The error of the whole volume as one cell, in the measure's unit: any tolerance above draws a single splat."""
    nodes = np.arange(len(pyramid.levels[-1].errors))
    return float(node_errors(pyramid, nodes, np.zeros((len(nodes), 3), np.int32), pyramid.num_levels).max(initial=0.0))


def node_errors(pyramid: Pyramid, nodes: Int64, cells: Int32, level: int) -> Float64:
    """float64 [n]: the errors of some nodes of a level, and of their cells, in the measure's unit."""
    sizes = cell_voxel_counts(cells, level, pyramid.volume)
    scale = np.asarray(error_scale(pyramid.volume, pyramid.measure, sizes) * pyramid.error_unit)
    return np.asarray(pyramid.levels[level - 1].errors[nodes] * scale)


def cell_voxel_counts(cells: Int32, level: int, volume: Volume) -> Int64:
    """int64 [n]: how many voxels some cells of a level have."""
    x, y, z = cell_extents(cells, level, volume.shape_xyz).T  # a product along the rows would take ten times as long
    return np.asarray(x * y * z)


def visible_children(
    nodes: Int64, cells: Int32, masks: npt.NDArray[np.uint8], first_children: Int64
) -> tuple[Int64, Int32]:
    """The visible children of some nodes: their indices in the level below and their cells."""
    num = int(np.bitwise_count(masks[nodes]).sum(dtype=np.int64))
    child_nodes, child_cells = np.empty(num, np.int64), np.empty((num, 3), np.int32)
    _fill_children(nodes, cells, masks, first_children, child_nodes, child_cells)
    return child_nodes, child_cells


@jit
def _fill_children(
    nodes: Int64,
    cells: Int32,
    masks: npt.NDArray[np.uint8],
    first_children: Int64,
    child_nodes: Int64,
    child_cells: Int32,
) -> None:
    num = 0
    for i in range(len(nodes)):
        mask, child = masks[nodes[i]], first_children[nodes[i]]
        for k in range(8):
            if mask >> k & 1:
                child_nodes[num] = child
                child_cells[num, 0] = 2 * cells[i, 0] + (k & 1)
                child_cells[num, 1] = 2 * cells[i, 1] + (k >> 1 & 1)
                child_cells[num, 2] = 2 * cells[i, 2] + (k >> 2)
                child += 1
                num += 1


def _joined(pyramid: Pyramid, parts: list[_Leaves], parents: Int32) -> Cut:
    """The leaves of all levels, and the visible voxels in those cells of level 1 that are none."""
    num_coarse = sum(len(part.cells) for part in parts)
    room = num_coarse + 8 * len(parents)  # addresses, which cost no memory until they are written
    cells, depths = np.empty((room, 3), np.int32), np.empty((room, 4), np.float32)
    np.concatenate([part.cells for part in parts], out=cells[:num_coarse])
    np.concatenate([part.depths for part in parts], out=depths[:num_coarse])
    raw = raw_voxels(pyramid.volume)
    pyramid.volume.require_unchanged()
    num = num_coarse + _fill_voxels(raw, *pyramid.classifier, parents, cells[num_coarse:], depths[num_coarse:])
    pyramid.volume.require_unchanged()
    cells.resize((num, 3), refcheck=False)
    depths.resize((num, 4), refcheck=False)
    levels = np.zeros(num, np.uint8)
    levels[:num_coarse] = np.repeat([part.level for part in parts], [len(part.cells) for part in parts])
    for array in (levels, cells, depths):
        array.flags.writeable = False
    return Cut(levels, cells, depths, pyramid.volume)


def num_visible_voxels(pyramid: Pyramid, cells: Int32) -> npt.NDArray[np.uint8]:
    """uint8 [n]: how many voxels are visible in cells of level 1."""
    counts = np.empty(len(cells), np.uint8)
    pyramid.volume.require_unchanged()
    _count_voxels(raw_voxels(pyramid.volume), *pyramid.classifier, cells, counts)
    pyramid.volume.require_unchanged()
    return counts


@jit
def _count_voxels(
    raw: RawVoxels,
    table: Float32 | None,
    segments: TransferSegments | None,
    scalars: Float64 | None,
    lighting: Lighting | None,
    parents: Int32,
    counts: npt.NDArray[np.uint8],
) -> None:
    """As many as `_fill_voxels` appends for each of the parents."""
    for i in range(len(parents)):
        num = 0
        for k in range(8):
            x, y, z = 2 * parents[i, 0] + (k & 1), 2 * parents[i, 1] + (k >> 1 & 1), 2 * parents[i, 2] + (k >> 2)
            if x < raw.shape[2] and y < raw.shape[1] and z < raw.shape[0]:
                num += classify_voxel(raw, table, segments, scalars, lighting, z, y, x)[3] > 0
        counts[i] = num


@jit
def _fill_voxels(
    raw: RawVoxels,
    table: Float32 | None,
    segments: TransferSegments | None,
    scalars: Float64 | None,
    lighting: Lighting | None,
    parents: Int32,
    cells: Int32,
    depths: Float32,
) -> int:
    """Append the visible voxels in cells of level 1 (x, y, z) and their depths; how many they are."""
    num = 0
    for i in range(len(parents)):
        for k in range(8):
            x, y, z = 2 * parents[i, 0] + (k & 1), 2 * parents[i, 1] + (k >> 1 & 1), 2 * parents[i, 2] + (k >> 2)
            if x < raw.shape[2] and y < raw.shape[1] and z < raw.shape[0]:
                red, green, blue, depth = classify_voxel(raw, table, segments, scalars, lighting, z, y, x)
                if depth > 0:
                    depths[num, 0], depths[num, 1], depths[num, 2], depths[num, 3] = red, green, blue, depth
                    cells[num, 0], cells[num, 1], cells[num, 2] = x, y, z
                    num += 1
    return num
