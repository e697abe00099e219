"""The cut: the set of octree cells that is drawn at a tolerance, every voxel covered once or transparent.

Top-down, level by level (Laur and Hanrahan 1991, section 4): a node whose error is *below* the tolerance becomes a leaf,
the others descend, so that a tolerance of 0 reaches every visible voxel. Nodes without extinction are not in the pyramid
and cost nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.classify import Codes, Lighting, Segments, classify_voxel, voxel_codes
from renderer.jit import jit
from renderer.pyramid import Pyramid, cell_extents
from renderer.volume import Volume

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Cut:
    """The cells drawn, coarse levels first, in Morton order within a level: a cell's place is its id.

    levels: uint8 [n]; a cell of level l is 2^l voxels wide, less where the border cuts it.
    cells: int32 [n, 3], x, y, z in units of the cell's own width.
    depths: float32 [n, 4], means of (tau c, tau) times the finest spacing.
    volume: the volume that was cut.
    """

    levels: npt.NDArray[np.uint8]
    cells: npt.NDArray[np.int32]
    depths: npt.NDArray[np.float32]
    volume: Volume

    def __len__(self) -> int:
        return len(self.levels)


def cut_pyramid(pyramid: Pyramid, tolerance: float, *, finest_level: int = 0) -> Cut:
    """The coarsest cells whose error is below `tolerance` (in the measure's unit); none finer than `finest_level`."""
    cells = np.zeros((len(pyramid.levels[-1].errors), 3), np.int32)
    nodes = np.arange(len(cells), dtype=np.int64)
    parts: list[tuple[int, npt.NDArray[np.int32], npt.NDArray[np.float32]]] = []
    for number in range(pyramid.num_levels, 0, -1):
        level = pyramid.levels[number - 1]
        errors = level.errors[nodes].astype(np.float64) * (pyramid.error_unit * _error_scale(pyramid, cells, number))
        leaf = errors < tolerance if number > finest_level else np.ones(len(nodes), bool)
        means = level.means[nodes[leaf]].astype(np.float32) * np.float32(pyramid.mean_unit)
        parts.append((number, cells[leaf], _extinctions(pyramid, means)))
        nodes, cells = nodes[~leaf], cells[~leaf]
        if number > 1:
            nodes, cells = _children(nodes, cells, level.masks, level.first_children)
    voxels, channels = _voxels(pyramid, cells)
    parts.append((0, voxels, channels))
    levels = [np.full(len(part[1]), part[0], np.uint8) for part in parts]
    return Cut(
        np.concatenate(levels),
        np.concatenate([part[1] for part in parts]),
        np.concatenate([part[2] for part in parts]),
        pyramid.volume,
    )


def visible_cells(pyramid: Pyramid, level: int) -> npt.NDArray[np.int32]:
    """int32 [n, 3]: all visible cells of a level from 1 to the root's, x, y, z in units of their width."""
    cells = np.zeros((len(pyramid.levels[-1].errors), 3), np.int32)
    nodes = np.arange(len(cells), dtype=np.int64)
    for above in pyramid.levels[:level - 1 : -1]:
        nodes, cells = _children(nodes, cells, above.masks, above.first_children)
    return cells


def _error_scale(pyramid: Pyramid, cells: npt.NDArray[np.int32], level: int) -> npt.NDArray[np.float64] | float:
    """What a node's root of variance is multiplied by: for `optical` the cell's side, the cube root of its world volume, in
    units of the finest spacing (which the channels carry); 1 for `rms`."""
    if pyramid.measure == "rms":
        return 1.0
    volume = pyramid.volume
    num_voxels = np.prod(cell_extents(cells, level, volume.shape_xyz), axis=1)
    return np.cbrt(num_voxels * volume.voxel_volume) / float(volume.spacing.min())


def _extinctions(pyramid: Pyramid, means: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(tau c, tau) h0 from whatever the pyramid averages."""
    if pyramid.average == "opacity" and len(means):
        opacity = means[:, 3:]
        with np.errstate(divide="ignore"):  # rounded to 1, it is as deep as the deepest voxel
            depth = np.minimum(-np.log1p(-np.minimum(opacity, 1)), np.float32(pyramid.deepest))
        # Rounded to 0, its depth is that opacity.
        means = means * np.divide(depth, opacity, out=np.ones_like(depth), where=opacity > 0)
    return means


def _children(
    nodes: npt.NDArray[np.int64],
    cells: npt.NDArray[np.int32],
    masks: npt.NDArray[np.uint8],
    first_children: npt.NDArray[np.int64],
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """The visible children of some nodes: their indices in the level below and their cells."""
    num = int(np.bitwise_count(masks[nodes]).sum(dtype=np.int64))
    child_nodes, child_cells = np.empty(num, np.int64), np.empty((num, 3), np.int32)
    _fill_children(nodes, cells, masks, first_children, child_nodes, child_cells)
    return child_nodes, child_cells


@jit
def _fill_children(nodes, cells, masks, first_children, child_nodes, child_cells):  # type: ignore[no-untyped-def]
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


def _voxels(pyramid: Pyramid, parents: npt.NDArray[np.int32]) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float32]]:
    """The visible voxels in cells of level 1, and their channels."""
    cells, channels = np.empty((8 * len(parents), 3), np.int32), np.empty((8 * len(parents), 4), np.float32)
    num = _fill_voxels(voxel_codes(pyramid.volume), *pyramid.classifier, parents, cells, channels)
    return cells[:num], channels[:num]


@jit
def _fill_voxels(
    codes: Codes, table: npt.NDArray[np.float32] | None, segments: Segments | None, scalars: Float64 | None,
    lighting: Lighting | None, parents: npt.NDArray[np.int32], cells: npt.NDArray[np.int32],
    channels: npt.NDArray[np.float32],
) -> int:  # fmt: skip
    num = 0
    for i in range(len(parents)):
        for k in range(8):
            x, y, z = 2 * parents[i, 0] + (k & 1), 2 * parents[i, 1] + (k >> 1 & 1), 2 * parents[i, 2] + (k >> 2)
            if x < codes.shape[2] and y < codes.shape[1] and z < codes.shape[0]:
                r, g, b, a = classify_voxel(codes, table, segments, scalars, lighting, z, y, x)
                if a > 0:
                    channels[num, 0], channels[num, 1], channels[num, 2], channels[num, 3] = r, g, b, a
                    cells[num, 0], cells[num, 1], cells[num, 2] = x, y, z
                    num += 1
    return num
