"""Pyramid: per octree node the mean of its voxels and the error of replacing them by it.

Level l has cells of 2^l voxels a side; level 0 are the voxels themselves and is not stored, a table look-up gives it.
A node's four channels are those of `renderer.classify`: means of `(tau c, tau) h0` or of `(a c, a)`. Its error is the
root of the channels' summed variance (Laur and Hanrahan 1991, section 3: the RMS error of a node), of one of

    optical           (tau c, tau) h0     times the cell's side in the cut: what the node can put into a pixel
    rms, classified   (a c, a)            opacity over the finest spacing
    rms, scalar       s                   in data units

Only visible nodes are stored: every level is one list in Morton order, so that the children of a node lie together.

Blocks of 8^3 voxels are built many at a time by several threads, which gives levels 1 to 3; then each tier of groups
of 64 nodes gives two levels more (see `renderer.pyramid_kernels`).
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer import pyramid_kernels as kernels
from renderer.classify import Classifier, make_classifier, voxel_codes
from renderer.pyramid_kernels import BLOCK
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import TransferFunction
from renderer.volume import Volume

Array = npt.NDArray[Any]
Int64 = npt.NDArray[np.int64]
Shape = tuple[int, int, int]

# Means are stored as multiples of the largest possible one, brought to this: then float16 holds 8 decades below it at
# its full 11 bits (its normal numbers go down to 2^-14).
STORED_MAXIMUM = 2.0**15

# Scalars are normalised by half their range, or by this where it is smaller: its inverse is still a number.
SMALLEST_RANGE = 2.0**-500

# Levels inside a block, and in each tier above.
BLOCK_LEVELS = 3
TIER_LEVELS = 2

# Blocks built by one task: many enough to hide the dispatch, few enough that their nodes stay in cache.
BLOCKS_PER_TASK = 1024

# int64 [8, 3]: the children (x, y, z) of a cell, in Morton order.
OCTANTS = np.arange(8)[:, None] >> np.arange(3) & 1


@dataclass(frozen=True)
class Level:
    """The visible nodes of one level, in Morton order of their cells.

    means: float16 or float32 [n, 4], stored units.
    errors: float16 or float32 [n], stored units.
    masks: uint8 [n], bit `x + 2 y + 4 z` set where that child is visible; empty on level 1.
    first_children: int64 [n], index in the level below of the first visible child; empty on level 1.
    """

    means: Array
    errors: Array
    masks: npt.NDArray[np.uint8]
    first_children: Int64


@dataclass(frozen=True)
class Pyramid:
    """levels[0] is level 1 and levels[-1] the root (no node, where nothing is visible). Multiply stored means by `mean_unit`
    and errors by `error_unit` to have them in the units above. `classifier` gives level 0, always as (tau c, tau) h0, and no
    voxel is deeper than `deepest`."""

    levels: tuple[Level, ...]
    mean_unit: float
    error_unit: float
    classifier: Classifier
    deepest: float
    volume: Volume
    average: str
    measure: str

    @property
    def num_levels(self) -> int:
        """Number of the root's level."""
        return len(self.levels)

    @property
    def num_bytes(self) -> int:
        """Memory of all levels."""
        return sum(
            a.nbytes for level in self.levels for a in (level.means, level.errors, level.masks, level.first_children)
        )


def build_pyramid(
    volume: Volume,
    transfer: TransferFunction,
    *,
    spec: PyramidSpec,
    error: ErrorSpec,
    shading: ShadingSpec | None = None,
    num_threads: int = 2,
) -> Pyramid:
    """Build all levels in one pass over the voxels; the result does not depend on `num_threads`."""
    plan = _make_plan(volume, transfer, spec, error, shading)
    num_levels = max(1, (max(volume.shape_xyz) - 1).bit_length())
    blocks = _blocks_in_morton_order(volume.shape_xyz)
    room = _Room.empty(blocks, volume.shape_xyz, plan.dtype)
    with ThreadPoolExecutor(num_threads) as pool:
        roots = list(pool.map(lambda task: _build_blocks(plan, blocks, room, task), range(room.num_tasks)))
    tier = _Tier(*(np.concatenate(parts) for parts in zip(*roots, strict=True)))
    stored = room.compacted()
    while len(stored) < num_levels:
        tier, levels = _next_tier(plan, tier, len(stored))
        stored += levels
    return Pyramid(
        levels=_linked(stored[:num_levels]),
        mean_unit=plan.mean_unit,
        error_unit=plan.error_unit,
        classifier=make_classifier(volume, transfer, shading, opacity=False)
        if spec.average == "opacity"
        else plan.rule,
        deepest=float(volume.spacing.min()) * transfer.max_extinction,
        volume=volume,
        average=spec.average,
        measure=error.measure,
    )


def cell_extents(cells: Array, level: int, shape_xyz: Shape) -> Int64:
    """int64 [n, 3]: voxels along x, y, z in cells (x, y, z in units of 2^level voxels) that the border may cut."""
    first = cells.astype(np.int64) << level
    return np.minimum(np.array(shape_xyz) - first, 1 << level)


@dataclass(frozen=True)
class _Plan:
    """What all tasks are told.

    rule: classifies for the means; the variance that comes with them is the error where both of the others are None.
    error_rule: classifies for the errors. normal: (offset, scale) of the scalar that errors are of.
    mean_unit, error_unit: as in Pyramid. error_factor: brings the root of a variance to its stored unit.
    """

    codes: Array
    rule: Classifier
    error_rule: Classifier | None
    normal: tuple[float, float] | None
    mean_unit: float
    error_unit: float
    error_factor: float
    dtype: type[np.float16] | type[np.float32]

    @property
    def shape_xyz(self) -> Shape:
        z, y, x = self.codes.shape
        return x, y, z


def _make_plan(
    volume: Volume, transfer: TransferFunction, spec: PyramidSpec, error: ErrorSpec, shading: ShadingSpec | None
) -> _Plan:
    opacity, of_opacity = spec.average == "opacity", error.measure == "rms"
    depth = float(volume.spacing.min()) * transfer.max_extinction
    brightest = max(1.0, shading.ambient + shading.diffuse) if shading else 1.0

    def unit(of_opacity: bool) -> float:
        return _stored_unit(brightest * (-math.expm1(-depth) if of_opacity else depth))

    error_rule, normal = None, None
    error_unit, error_factor = unit(of_opacity), 1 / unit(of_opacity)
    if error.of == "scalar":
        low, high = float(volume.values.min()), float(volume.values.max())
        error_unit, error_factor = _stored_unit(high / 2 - low / 2), 1.0
        normal = (low / 2 + high / 2, 1 / error_unit)
    elif opacity != of_opacity:
        error_rule = make_classifier(volume, transfer, shading, opacity=of_opacity)
    return _Plan(
        voxel_codes(volume),
        make_classifier(volume, transfer, shading, opacity=opacity),
        error_rule,
        normal,
        unit(opacity),
        error_unit,
        error_factor,
        np.float16 if spec.precision == "half" else np.float32,
    )


def _stored_unit(largest: float) -> float:
    """A power of two, so that scaling by it rounds nothing, of which `largest` is at most STORED_MAXIMUM."""
    return math.ldexp(1 / STORED_MAXIMUM, math.frexp(max(largest, SMALLEST_RANGE))[1])


def _blocks_in_morton_order(shape_xyz: Shape) -> Int64:
    """int64 [n, 3]: the blocks (x, y, z in blocks) of a volume."""
    cells = np.zeros((1, 3), np.int64)
    for level in range(max(BLOCK_LEVELS, (max(shape_xyz) - 1).bit_length()) - 1, BLOCK_LEVELS - 1, -1):
        cells = (2 * cells[:, None] + OCTANTS).reshape(-1, 3)
        cells = cells[np.all(cells << level < shape_xyz, axis=1)]
    return cells


# Means and variances [g, n, c] of one level, in groups as the kernels know them.
_Nodes = tuple[Array, Array]

# Stored means, stored errors and child masks of the visible nodes of one level.
_Stored = tuple[Array, Array, npt.NDArray[np.uint8]]


class _Tier(NamedTuple):
    """Nodes of one level: cells int64 [n, 3] (x, y, z), means [n, 4], and of what errors are measured of means and
    variances [n, c]."""

    cells: Int64
    means: Array
    error_means: Array
    variances: Array


@dataclass(frozen=True)
class _Room:
    """Where the levels inside blocks go: room for every node, visible or not, which costs addresses rather than memory.

    starts: int64 [num_tasks + 1, BLOCK_LEVELS], where the nodes of each task begin. counts: int64 [num_tasks, BLOCK_LEVELS],
    how many visible ones the task had. levels: the room.
    """

    starts: Int64
    counts: Int64
    levels: tuple[_Stored, ...]

    @classmethod
    def empty(cls, blocks: Int64, shape_xyz: Shape, dtype: type[Any]) -> _Room:
        extents = cell_extents(blocks, BLOCK_LEVELS, shape_xyz)
        sizes = np.stack([np.prod(-(-extents >> level), axis=1) for level in range(1, BLOCK_LEVELS + 1)], axis=1)
        per_task = np.add.reduceat(sizes, np.arange(0, len(blocks), BLOCKS_PER_TASK))
        starts = np.concatenate([np.zeros((1, BLOCK_LEVELS), np.int64), np.cumsum(per_task, axis=0)])
        levels = tuple(_empty_stored(num, dtype, masked=level > 0) for level, num in enumerate(starts[-1]))
        return cls(starts, np.zeros_like(per_task), levels)

    @property
    def num_tasks(self) -> int:
        return len(self.counts)

    def of_task(self, task: int, level: int) -> _Stored:
        first, last = self.starts[task : task + 2, level]
        means, errors, masks = self.levels[level]
        return means[first:last], errors[first:last], masks[first:last]

    def compacted(self) -> list[_Stored]:
        """The levels without the gaps between tasks: moved together where they lie, then cut off."""
        for level, arrays in enumerate(self.levels):
            for array in filter(len, arrays):
                end = 0
                for start, num in zip(self.starts[:-1, level], self.counts[:, level], strict=True):
                    if end < start:
                        array[end : end + num] = array[start : start + num]
                    end += num
                array.resize((end, *array.shape[1:]), refcheck=False)
        return list(self.levels)


def _empty_stored(num: int, dtype: type[Any], *, masked: bool) -> _Stored:
    return np.empty((num, 4), dtype), np.empty(num, dtype), np.empty(num if masked else 0, np.uint8)


def _build_blocks(plan: _Plan, blocks: Int64, room: _Room, task: int) -> _Tier:
    """The levels inside the blocks of one task, and their roots."""
    cells = blocks[task * BLOCKS_PER_TASK : (task + 1) * BLOCKS_PER_TASK]
    starts, extents = cells * BLOCK, cell_extents(cells, BLOCK_LEVELS, plan.shape_xyz)

    def classified(rule: Classifier) -> list[_Nodes]:
        nodes = _empty_nodes(len(cells), 64, 4, np.float32)
        kernels.level_of_channels(plan.codes, *rule, starts, extents, *nodes)
        return _with_parents(nodes, extents, 2)

    nodes = errors = classified(plan.rule)
    if plan.normal:  # scalars may lie close together and far from zero: float64
        scalars = _empty_nodes(len(cells), 64, 1, np.float64)
        kernels.level_of_scalars(plan.codes, plan.rule.scalars, *plan.normal, starts, extents, *scalars)
        errors = _with_parents(scalars, extents, 2)
    elif plan.error_rule:
        errors = classified(plan.error_rule)
    for level in range(BLOCK_LEVELS):
        children = nodes[level - 1][0] if level > 0 else None
        target = room.of_task(task, level)
        room.counts[task, level] = _store_visible(plan, nodes[level][0], errors[level][1], children, target)
    return _Tier(cells, nodes[2][0][:, 0], errors[2][0][:, 0], errors[2][1][:, 0])


def _next_tier(plan: _Plan, tier: _Tier, level: int) -> tuple[_Tier, list[_Stored]]:
    """The two levels above `level`, on which the nodes of `tier` lie in Morton order, and the upper one's as a tier."""
    cells = tier.cells >> TIER_LEVELS
    firsts = np.flatnonzero(np.concatenate([[True], np.any(np.diff(cells, axis=0) != 0, axis=1)]))
    group = np.repeat(np.arange(len(firsts)), np.diff(np.append(firsts, len(cells))))
    place = ((tier.cells & 1) * 8 + (tier.cells >> 1 & 1)) @ [1, 2, 4]
    cells = cells[firsts]
    extents = cell_extents(cells, level + TIER_LEVELS, plan.shape_xyz)

    def grouped(values: Array) -> Array:
        nodes = np.zeros((len(cells), 64, values.shape[1]), values.dtype)
        nodes[group, place] = values
        return nodes

    # Where errors are measured of the same channels, this does the same work again; it is little, so far up.
    nodes = _with_parents((grouped(tier.means), grouped(np.zeros_like(tier.means))), extents, 1 << level)
    errors = _with_parents((grouped(tier.error_means), grouped(tier.variances)), extents, 1 << level)
    stored = []
    for parents in (1, 2):
        target = _empty_stored(nodes[parents][0][..., 0].size, plan.dtype, masked=True)
        num = _store_visible(plan, nodes[parents][0], errors[parents][1], nodes[parents - 1][0], target)
        stored.append((target[0][:num], target[1][:num], target[2][:num]))
    return _Tier(cells, nodes[2][0][:, 0], errors[2][0][:, 0], errors[2][1][:, 0]), stored


def _empty_nodes(num_groups: int, num_nodes: int, num_channels: int, dtype: Any) -> _Nodes:
    shape = (num_groups, num_nodes, num_channels)
    return np.empty(shape, dtype), np.empty(shape, dtype)


def _with_parents(nodes: _Nodes, extents: Int64, side: int) -> list[_Nodes]:
    """Groups of 64 nodes, each `side` voxels a side, with their 8 parents and the parent of those."""
    num_groups, _, num_channels = nodes[0].shape
    parents, roots = (_empty_nodes(num_groups, num, num_channels, nodes[0].dtype) for num in (8, 1))
    kernels.merge_groups(*nodes, extents, side, *parents, *roots)
    return [nodes, parents, roots]


def _store_visible(plan: _Plan, means: Array, variances: Array, children: Array | None, target: _Stored) -> int:
    """Write the visible ones of some nodes, in Morton order, to the beginning of `target`; how many they are."""
    size = means.shape[0] * means.shape[1]
    visible, spreads = np.empty((size, 4), np.float32), np.empty(size, np.float32)
    num = kernels.append_visible(means, variances, children, visible, spreads, target[2])
    _store(visible[:num], 1 / plan.mean_unit, target[0][:num])
    _store(np.sqrt(spreads[:num]), plan.error_factor, target[1][:num])
    return num


def _store(values: npt.NDArray[np.float32], factor: float, out: Array) -> None:
    """`values` times `factor` (a power of two) in the precision of `out`."""
    if out.dtype == np.float16:
        kernels.store_halves(values.reshape(-1), factor, out.view(np.uint16).reshape(-1))
    else:
        np.multiply(values, np.float32(factor), out=out)


def _linked(stored: list[_Stored]) -> tuple[Level, ...]:
    """Levels with the place of each node's first child: children are in the order of their parents."""
    levels = []
    for means, errors, masks in stored:
        num_children = np.bitwise_count(masks).astype(np.int64)
        first_children = np.cumsum(num_children) - num_children
        for array in (means, errors, masks, first_children):
            array.flags.writeable = False
        levels.append(Level(means, errors, masks, first_children))
    return tuple(levels)
