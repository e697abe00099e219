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
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer import pyramid_kernels as kernels
from renderer.classify import FAINTEST, Classifier, make_classifier, voxel_codes
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

# Scalars are normalised by their range, or by this where it is smaller: the inverse of its unit is still a number, and
# squares of the smallest denormal numbers are then normal ones.
SMALLEST_RANGE = 2.0**-1008

# Levels inside a block, and in each tier above.
BLOCK_LEVELS = 3
TIER_LEVELS = 2

# Nodes on the three levels of a group.
NODES_OF_GROUP = (64, 8, 1)

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
    """levels[0] is level 1 and levels[-1] the root (no node, where nothing is visible).

    Multiply stored means by `mean_unit` and errors by `error_unit` to have them in the units above. `classifier` gives
    level 0, always as (tau c, tau) h0, and no voxel is deeper than `deepest`.
    """

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
    room = _Room.empty(len(blocks), plan.dtype)
    tier = _build_all_blocks(plan, blocks, room, num_threads)
    depths = plan.rule if spec.average == "extinction" else make_classifier(volume, transfer, shading, opacity=False)
    stored = room.compacted(num_threads)
    while len(stored) < num_levels:
        tier, levels = _next_tier(plan, tier, len(stored))
        stored += levels
    return Pyramid(
        levels=_linked(stored[:num_levels]),
        mean_unit=plan.mean_unit,
        error_unit=plan.error_unit,
        classifier=depths,
        deepest=volume.finest_spacing * transfer.max_extinction,
        volume=volume,
        average=spec.average,
        measure=error.measure,
    )


def cell_extents(cells: Array, level: int, shape_xyz: Shape) -> Int64:
    """int64 [n, 3]: voxels along x, y, z in cells (x, y, z in units of 2^level voxels) that the border may cut."""
    first = cells.astype(np.int64) << level
    return np.asarray(np.minimum(np.array(shape_xyz) - first, 1 << level))


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
    depth = volume.finest_spacing * transfer.max_extinction
    brightest = max(1.0, shading.ambient + shading.diffuse) if shading else 1.0

    def unit(of_opacity: bool) -> float:
        return _stored_unit(brightest * max(-math.expm1(-depth) if of_opacity else depth, FAINTEST))

    rule = make_classifier(volume, transfer, shading, opacity=opacity)
    error_rule, normal = None, None
    error_unit, error_factor = unit(of_opacity), 1 / unit(of_opacity)
    if error.of == "scalar":
        low, high = float(volume.values.min()), float(volume.values.max())
        offset = _exact_offset(low, high)
        error_unit, error_factor = _stored_unit(max(abs(low - offset), abs(high - offset))), 1.0
        normal = (offset, 1 / error_unit)
    elif opacity != of_opacity:
        error_rule = make_classifier(volume, transfer, shading, opacity=of_opacity)
    return _Plan(
        voxel_codes(volume),
        rule,
        error_rule,
        normal,
        unit(opacity),
        error_unit,
        error_factor,
        np.float16 if spec.precision == "half" else np.float32,
    )


def _exact_offset(low: float, high: float) -> float:
    """What takes a volume's scalars to the neighbourhood of 0 without rounding any of them, however different they are.

    It is a multiple of the last place of the largest, so that every difference is a multiple of the scalar's own last
    place, and no larger than the scalar.
    """
    if low <= 0.0 <= high:
        return 0.0
    near, far = sorted((low, high), key=abs)
    return near - math.fmod(near, math.ulp(far))


def _stored_unit(largest: float) -> float:
    """A power of two, so that scaling by it rounds nothing, of which `largest` is at most STORED_MAXIMUM."""
    return math.ldexp(1 / STORED_MAXIMUM, math.frexp(max(largest, SMALLEST_RANGE))[1])


def _blocks_in_morton_order(shape_xyz: Shape) -> Int64:
    """int64 [n, 3]: the blocks (x, y, z in blocks) of a volume."""
    cells = np.zeros((1, 3), np.int64)
    for level in range(max(BLOCK_LEVELS, (max(shape_xyz) - 1).bit_length()) - 1, BLOCK_LEVELS - 1, -1):
        cells = (2 * cells[:, None] + OCTANTS).reshape(-1, 3)
        inside = cells << level < shape_xyz
        cells = cells[inside[:, 0] & inside[:, 1] & inside[:, 2]]
    return cells


# Means and variances [g, n, c] of the 64 nodes of some groups, of their 8 parents, and of their root.
_Groups = list[tuple[Array, Array]]

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

    counts: int64 [num_tasks, BLOCK_LEVELS], how many visible nodes the tasks found.
    """

    counts: Int64
    levels: tuple[_Stored, ...]

    @classmethod
    def empty(cls, num_blocks: int, dtype: type[Any]) -> _Room:
        counts = np.zeros((-(-num_blocks // BLOCKS_PER_TASK), BLOCK_LEVELS), np.int64)
        levels = (_empty_stored(num_blocks * num, dtype, masked=num < 64) for num in NODES_OF_GROUP)
        return cls(counts, tuple(levels))

    def of_task(self, task: int, level: int) -> _Stored:
        num = BLOCKS_PER_TASK * NODES_OF_GROUP[level]
        means, errors, masks = (array[task * num : (task + 1) * num] for array in self.levels[level])
        return means, errors, masks

    def compacted(self, num_threads: int) -> list[_Stored]:
        """The levels without the gaps between tasks: moved together where they lie, then cut off."""

        def compact(level: int, array: Array) -> None:
            end = 0
            for task, num in enumerate(self.counts[:, level]):
                start = task * BLOCKS_PER_TASK * NODES_OF_GROUP[level]
                if end < start:
                    array[end : end + num] = array[start : start + num]
                end += num
            array.resize((end, *array.shape[1:]), refcheck=False)

        levels, arrays = zip(
            *((k, array) for k, level in enumerate(self.levels) for array in level if len(array)), strict=True
        )
        with ThreadPoolExecutor(num_threads) as pool:
            list(pool.map(compact, levels, arrays))
        return list(self.levels)


def _empty_stored(num: int, dtype: type[Any], *, masked: bool) -> _Stored:
    return np.empty((num, 4), dtype), np.empty(num, dtype), np.empty(num if masked else 0, np.uint8)


@dataclass(frozen=True)
class _Scratch:
    """Memory of one running task, used again by the next: fresh pages cost more than the arithmetic done in them.

    nodes, errors: groups of what is averaged and of what errors are measured of; None where that is the same.
    visible, spreads: float32 [., 4] and [.], nodes on their way to the room. voxels: float32 [512, 4], one block.
    """

    nodes: _Groups
    errors: _Groups | None
    visible: npt.NDArray[np.float32]
    spreads: npt.NDArray[np.float32]
    voxels: npt.NDArray[np.float32]

    @classmethod
    def empty(cls, plan: _Plan, num_groups: int) -> _Scratch:
        errors = None
        if plan.normal:  # scalars may lie close together and far from zero: float64
            errors = _empty_groups(num_groups, 1, np.float64)
        elif plan.error_rule:
            errors = _empty_groups(num_groups, 4, np.float32)
        nodes = _empty_groups(num_groups, 4, np.float32)
        buffers = (np.empty(shape, np.float32) for shape in ((num_groups * 64, 4), num_groups * 64, (BLOCK**3, 4)))
        return cls(nodes, errors, *buffers)

    def first(self, num_groups: int) -> _Scratch:
        """As much of it as the last task needs."""
        errors = [(m[:num_groups], v[:num_groups]) for m, v in self.errors] if self.errors else None
        return replace(self, nodes=[(m[:num_groups], v[:num_groups]) for m, v in self.nodes], errors=errors)


def _build_all_blocks(plan: _Plan, blocks: Int64, room: _Room, num_threads: int) -> _Tier:
    """The levels inside blocks, into `room`, and the roots of the blocks."""
    tasks = iter(range(len(room.counts)))
    roots: dict[int, _Tier] = {}

    def work(num_groups: int) -> None:
        scratch = _Scratch.empty(plan, num_groups)
        for task in tasks:  # shared: each thread takes the next one when it is ready
            roots[task] = _build_blocks(plan, blocks, room, task, scratch)

    with ThreadPoolExecutor(num_threads) as pool:
        try:
            list(pool.map(work, [min(len(blocks), BLOCKS_PER_TASK)] * num_threads))
        finally:  # interrupted, or failed in one thread: leave nothing to the others
            deque(tasks, maxlen=0)
    return _Tier(*(np.concatenate(parts) for parts in zip(*(roots[task] for task in sorted(roots)), strict=True)))


def _build_blocks(plan: _Plan, blocks: Int64, room: _Room, task: int, scratch: _Scratch) -> _Tier:
    """The levels inside the blocks of one task, and their roots."""
    cells = blocks[task * BLOCKS_PER_TASK : (task + 1) * BLOCKS_PER_TASK]
    starts = (cells * BLOCK).astype(np.uint64)
    extents = cell_extents(cells, BLOCK_LEVELS, plan.shape_xyz).astype(np.uint64)
    scratch = scratch.first(len(cells))
    nodes, errors = scratch.nodes, scratch.errors or scratch.nodes
    _classify(plan, plan.rule, starts, extents, scratch, nodes)
    if plan.normal:
        kernels.level_of_scalars(plan.codes, plan.rule.scalars, *plan.normal, starts, extents, *errors[0])
        _merge(errors, extents, 2)
    elif plan.error_rule:
        _classify(plan, plan.error_rule, starts, extents, scratch, errors)
    for level in range(BLOCK_LEVELS):
        target = room.of_task(task, level)
        room.counts[task, level] = _store_visible(plan, scratch, level, target)
    return _Tier(cells, *(roots[:, 0].copy() for roots in (nodes[2][0], *errors[2])))


def _classify(plan: _Plan, rule: Classifier, starts: Array, extents: Array, scratch: _Scratch, groups: _Groups) -> None:
    """All nodes of some blocks."""
    table_items = None if rule.table is None else _items(rule.table)
    kernels.level_of_channels(
        plan.codes, *rule, table_items, starts, extents, scratch.voxels, _items(scratch.voxels), *groups[0]
    )
    _merge(groups, extents, 2)


def _items(values: npt.NDArray[np.float32]) -> npt.NDArray[np.complex128]:
    """float32 [..., 4] as [...] items of 16 bytes; a view."""
    return values.view(np.complex128)[..., 0]


def _next_tier(plan: _Plan, tier: _Tier, level: int) -> tuple[_Tier, list[_Stored]]:
    """The two levels above `level`, on which the nodes of `tier` lie in Morton order, and the upper one's as a tier."""
    cells = tier.cells >> TIER_LEVELS
    steps = np.diff(cells, axis=0)
    is_first = np.concatenate([[True], (steps[:, 0] | steps[:, 1] | steps[:, 2]) != 0])
    place = 64 * (np.cumsum(is_first) - 1) + 8 * _octants(tier.cells) + _octants(tier.cells >> 1)
    cells = cells[is_first]
    extents = cell_extents(cells, level + TIER_LEVELS, plan.shape_xyz).astype(np.uint64)

    scratch = _Scratch.empty(plan, len(cells))
    errors = scratch.errors or scratch.nodes
    scratch.nodes[0][1][:] = 0  # used only where it is the error's, and set then
    for nodes, values in ((scratch.nodes[0][0], tier.means), *zip(errors[0], tier[2:], strict=True)):
        nodes[:] = 0
        nodes.reshape(-1, values.shape[1])[place] = values
    _merge(scratch.nodes, extents, 1 << level)
    if scratch.errors:
        _merge(scratch.errors, extents, 1 << level)
    stored = []
    for part in (1, 2):
        target = _empty_stored(len(cells) * NODES_OF_GROUP[part], plan.dtype, masked=True)
        num = _store_visible(plan, scratch, part, target)
        stored.append((target[0][:num], target[1][:num], target[2][:num]))
    return _Tier(cells, *(roots[:, 0] for roots in (scratch.nodes[2][0], *errors[2]))), stored


def _octants(cells: Int64) -> Int64:
    """int64 [n]: which child of its parent a cell is."""
    return cells[:, 0] & 1 | (cells[:, 1] & 1) << 1 | (cells[:, 2] & 1) << 2


def _empty_groups(num_groups: int, num_channels: int, dtype: Any) -> _Groups:
    shapes = [(num_groups, num_nodes, num_channels) for num_nodes in NODES_OF_GROUP]
    return [(np.empty(shape, dtype), np.empty(shape, dtype)) for shape in shapes]


def _merge(groups: _Groups, extents: Array, side: int) -> None:
    """The 8 parents of the 64 nodes of each group, which are `side` voxels a side, and theirs."""
    nodes, parents, roots = groups
    kernels.merge_groups(*nodes, extents, side, *parents, *roots)


def _store_visible(plan: _Plan, scratch: _Scratch, part: int, target: _Stored) -> int:
    """Write the visible nodes of one part of the groups to the beginning of `target`; how many they are."""
    means, _ = scratch.nodes[part]
    _, variances = (scratch.errors or scratch.nodes)[part]
    children = scratch.nodes[part - 1][0] if part > 0 else means[:0]
    num = kernels.append_visible(
        means, _items(means), variances, children, _items(scratch.visible), scratch.spreads, target[2]
    )
    _store(scratch.visible[:num], 1 / plan.mean_unit, target[0][:num])
    _store(scratch.spreads[:num], plan.error_factor, target[1][:num])
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
