"""Pyramid: per octree node the mean of its voxels and the error of replacing them by it.

Level l has cells of 2^l voxels a side; level 0 are the voxels themselves and is not stored, a table look-up gives it.
A node's four channels are means of those of `renderer.classify`: of `(tau c, tau) h0`, or of `(a c, a)`, which are then
stored as the depths that have these opacities. Its error is the root of the channels' summed variance (Laur and
Hanrahan 1991, section 3: the RMS error of a node), of one of

    optical           (tau c, tau) h0     times the cell's side in the cut: what the node can put into a pixel
    rms, classified   (a c, a)            opacity over the finest spacing
    rms, scalar       s                   in data units

Only visible nodes are stored: every level is one list in Morton order, so that the children of a node lie together.
Blocks that show nothing are not even classified. On the levels 1 and 2 nodes are left out, too, that lie below one
that is a leaf in every cut that will be asked for: a film at one tolerance has no use for them.

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
from renderer.emptiness import visible_blocks
from renderer.pyramid_kernels import BLOCK
from renderer.pyramid_memory import (
    BLOCK_LEVELS,
    BLOCKS_PER_TASK,
    NODES_OF_GROUP,
    Groups,
    Room,
    Scratch,
    Stored,
    empty_stored,
)
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

# Levels in each tier above the blocks.
TIER_LEVELS = 2

# Errors are compared with the tolerance as they are stored; one that is this much below it is so in any precision.
SURELY_BELOW = 1 - 2.0**-9
LARGEST_ROUNDING = 2.0**-24

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
    level 0, always as (tau c, tau) h0.

    occupied: bool [z, y, x], the cells of level `occupied_level` in which anything is visible.
    least_tolerance, finest_level: cuts at smaller tolerances, or of finer levels, need nodes that were left out.
    """

    levels: tuple[Level, ...]
    mean_unit: float
    error_unit: float
    classifier: Classifier
    volume: Volume
    measure: str
    occupied: npt.NDArray[np.bool_]
    occupied_level: int
    least_tolerance: float
    finest_level: int

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
    least_tolerance: float = 0.0,
    finest_level: int = 0,
) -> Pyramid:
    """Build all levels in one pass over the voxels; the result does not depend on `num_threads`.

    No cut will be asked for at a tolerance below `least_tolerance`, nor one with cells of a level below `finest_level`.
    """
    num_levels = max(1, (max(volume.shape_xyz) - 1).bit_length())
    plan = _make_plan(volume, transfer, spec, error, shading)
    plan = replace(plan, limits=_final_limits(plan, volume, error.measure, num_levels, least_tolerance, finest_level))
    blocks = _blocks_in_morton_order(volume.shape_xyz)
    room = Room.empty(len(blocks), volume.shape_xyz, plan.dtype)
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
        volume=volume,
        measure=error.measure,
        occupied=room.occupied,
        occupied_level=room.occupied_level,
        least_tolerance=least_tolerance,
        finest_level=finest_level,
    )


def error_scale(volume: Volume, measure: str, num_voxels: Any) -> Any:
    """What the root of the variance of nodes of so many voxels is multiplied by.

    For `optical` the cell's side, the cube root of its world volume, in units of the finest spacing (which the channels
    carry); 1 for `rms`.
    """
    if measure == "rms":
        return np.ones(())
    in_finest = volume.world_from_index[:3, :3] / volume.finest_spacing  # first: a volume may be too small for a number
    return np.cbrt(num_voxels * abs(float(np.linalg.det(in_finest))))


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
    deepest: of a voxel, where opacities are averaged; the means are stored as depths all the same.
    limits: nodes of level 2, and of level 3, with a variance below are leaves in every cut.
    """

    codes: Array
    rule: Classifier
    error_rule: Classifier | None
    normal: tuple[float, float] | None
    mean_unit: float
    error_unit: float
    error_factor: float
    dtype: type[np.float16] | type[np.float32]
    deepest: float | None
    limits: tuple[float, float] = (0.0, 0.0)

    @property
    def shape_xyz(self) -> Shape:
        z, y, x = self.codes.shape
        return x, y, z

    @property
    def error_layout(self) -> tuple[int, type[Any]] | None:
        """Channels and dtype of what errors are measured of, where that is not what is averaged."""
        if self.normal:  # scalars may lie close together and far from zero: float64
            return 1, np.float64
        return (4, np.float32) if self.error_rule else None


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
        unit(False),
        error_unit,
        error_factor,
        np.float16 if spec.precision == "half" else np.float32,
        depth if opacity else None,
    )


def _final_limits(
    plan: _Plan, volume: Volume, measure: str, num_levels: int, least_tolerance: float, finest_level: int
) -> tuple[float, float]:
    """Total variances of nodes of levels 2 and 3 below which their stored errors are below any tolerance asked for.

    They hold for whole cells, and all the more for those that the border cuts.
    """
    limits = []
    for level in (2, 3):
        unit = float(error_scale(volume, measure, 8.0**level)) * plan.error_unit
        root = (least_tolerance * SURELY_BELOW - LARGEST_ROUNDING * unit) / (unit * plan.error_factor)
        if level > num_levels or (root <= 0 and level > finest_level):
            limits.append(0.0)
        else:
            limits.append(math.inf if level <= finest_level else root * root)
    return limits[0], limits[1]


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


class _Tier(NamedTuple):
    """Nodes of one level: cells int64 [n, 3] (x, y, z), means [n, 4], and of what errors are measured of means and
    variances [n, c]."""

    cells: Int64
    means: Array
    error_means: Array
    variances: Array


def _build_all_blocks(plan: _Plan, blocks: Int64, room: Room, num_threads: int) -> _Tier:
    """The levels inside blocks, into `room`, and the roots of the blocks."""
    tasks = iter(range(len(room.counts)))
    roots: dict[int, _Tier] = {}

    def work(num_groups: int) -> None:
        scratch = Scratch.empty(num_groups, plan.error_layout)
        for task in tasks:  # shared: each thread takes the next one when it is ready
            roots[task] = _build_blocks(plan, blocks, room, task, scratch)

    with ThreadPoolExecutor(num_threads) as pool:
        try:
            list(pool.map(work, [min(len(blocks), BLOCKS_PER_TASK)] * num_threads))
        finally:  # interrupted, or failed in one thread: leave nothing to the others
            deque(tasks, maxlen=0)
    return _Tier(*(np.concatenate(parts) for parts in zip(*(roots[task] for task in sorted(roots)), strict=True)))


def _build_blocks(plan: _Plan, blocks: Int64, room: Room, task: int, scratch: Scratch) -> _Tier:
    """The levels inside the blocks of one task, and their roots."""
    cells = blocks[task * BLOCKS_PER_TASK : (task + 1) * BLOCKS_PER_TASK]
    starts = (cells * BLOCK).astype(np.uint64)
    extents = cell_extents(cells, BLOCK_LEVELS, plan.shape_xyz).astype(np.uint64)
    if not plan.normal:  # the scalars of what is not visible count for the errors of scalars
        visible = visible_blocks(plan.codes, plan.rule, starts, extents)
        cells, starts, extents = cells[visible], starts[visible], extents[visible]
    scratch = scratch.first(len(cells))
    nodes, errors = scratch.nodes, scratch.errors or scratch.nodes
    _classify(plan, plan.rule, starts, extents, scratch, nodes)
    if plan.normal:
        kernels.level_of_scalars(plan.codes, plan.rule.scalars, *plan.normal, starts, extents, *errors[0])
        _merge(errors, extents, 2)
    elif plan.error_rule:
        _classify(plan, plan.error_rule, starts, extents, scratch, errors)
    if any(plan.limits):
        kernels.mark_final(errors[1][1], errors[2][1], plan.limits, *scratch.final)
    part = min(room.occupied_level, BLOCK_LEVELS) - 1
    kernels.mark_occupied(nodes[part][0], cells, room.occupied_level - 1 - part, room.occupied)
    for level in range(BLOCK_LEVELS):
        target = room.of_task(task, level)
        room.counts[task, level] = _store_visible(plan, scratch, level, target)
    return _Tier(cells, *(roots[:, 0].copy() for roots in (nodes[2][0], *errors[2])))


def _classify(plan: _Plan, rule: Classifier, starts: Array, extents: Array, scratch: Scratch, groups: Groups) -> None:
    """All nodes of some blocks."""
    table_items = None if rule.table is None else _items(rule.table)
    kernels.level_of_channels(
        plan.codes, *rule, table_items, starts, extents, scratch.voxels, _items(scratch.voxels), *groups[0]
    )
    _merge(groups, extents, 2)


def _items(values: npt.NDArray[np.float32]) -> npt.NDArray[np.complex128]:
    """float32 [..., 4] as [...] items of 16 bytes; a view."""
    return values.view(np.complex128)[..., 0]


def _next_tier(plan: _Plan, tier: _Tier, level: int) -> tuple[_Tier, list[Stored]]:
    """The two levels above `level`, on which the nodes of `tier` lie in Morton order, and the upper one's as a tier."""
    cells = tier.cells >> TIER_LEVELS
    steps = np.diff(cells, axis=0)
    is_first = np.ones(len(cells), np.bool_)
    is_first[1:] = (steps[:, 0] | steps[:, 1] | steps[:, 2]) != 0
    place = 64 * (np.cumsum(is_first) - 1) + 8 * _octants(tier.cells) + _octants(tier.cells >> 1)
    cells = cells[is_first]
    extents = cell_extents(cells, level + TIER_LEVELS, plan.shape_xyz).astype(np.uint64)

    scratch = Scratch.empty(len(cells), plan.error_layout)
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
        target = empty_stored(len(cells) * NODES_OF_GROUP[part], plan.dtype, masked=True)
        num = _store_visible(plan, scratch, part, target)
        stored.append((target[0][:num], target[1][:num], target[2][:num]))
    return _Tier(cells, *(roots[:, 0] for roots in (scratch.nodes[2][0], *errors[2]))), stored


def _octants(cells: Int64) -> Int64:
    """int64 [n]: which child of its parent a cell is."""
    return cells[:, 0] & 1 | (cells[:, 1] & 1) << 1 | (cells[:, 2] & 1) << 2


def _merge(groups: Groups, extents: Array, side: int) -> None:
    """The 8 parents of the 64 nodes of each group, which are `side` voxels a side, and theirs."""
    nodes, parents, roots = groups
    kernels.merge_groups(*nodes, extents, side, *parents, *roots)


def _store_visible(plan: _Plan, scratch: Scratch, part: int, target: Stored) -> int:
    """Write the visible nodes of one part of the groups to the beginning of `target`; how many they are."""
    means, _ = scratch.nodes[part]
    _, variances = (scratch.errors or scratch.nodes)[part]
    children = scratch.nodes[part - 1][0] if part > 0 else means[:0]
    parents, roots = scratch.final
    is_final, is_below_final = ((roots[:0], parents), (parents, roots), (roots, roots[:0]))[part]
    num = kernels.append_visible(
        means,
        _items(means),
        variances,
        children,
        is_final,
        is_below_final,
        _items(scratch.visible),
        scratch.spreads,
        target[2],
    )
    if plan.deepest is not None:
        _opacities_to_depths(scratch.visible[:num], plan.deepest)
    _store(scratch.visible[:num], 1 / plan.mean_unit, target[0][:num])
    _store(scratch.spreads[:num], plan.error_factor, target[1][:num])
    return num


def _opacities_to_depths(means: npt.NDArray[np.float32], deepest: float) -> None:
    """Means of (a c, a) [n, 4] become those depths times (c, 1), in place.

    As depths they keep their digits in half precision: of opacities near 1 it would leave none.
    """
    opacities = means[:, 3].astype(np.float64)
    with np.errstate(divide="ignore"):  # rounded to 1, it is as deep as the deepest voxel
        depths = np.minimum(-np.log1p(-np.minimum(opacities, 1)), deepest)
    means *= (depths / opacities)[:, None]


def _store(values: npt.NDArray[np.float32], factor: float, out: Array) -> None:
    """`values` times `factor` (a power of two) in the precision of `out`."""
    if out.dtype == np.float16:
        kernels.store_halves(values.reshape(-1), factor, out.view(np.uint16).reshape(-1))
    else:
        np.multiply(values, np.float32(factor), out=out)


def _linked(stored: list[Stored]) -> tuple[Level, ...]:
    """Levels with the place of each node's first child: children are in the order of their parents."""
    levels = []
    for means, errors, masks in stored:
        num_children = np.bitwise_count(masks).astype(np.int64)
        first_children = np.cumsum(num_children) - num_children
        for array in (means, errors, masks, first_children):
            array.flags.writeable = False
        levels.append(Level(means, errors, masks, first_children))
    return tuple(levels)
