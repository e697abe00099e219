"""Pyramid: per octree node the mean of its voxels and the error of replacing them by it.

Level l has cells of 2^l voxels a side; level 0 are the voxels themselves and is not stored, a table look-up gives it.
A node's four channels are means of those of `renderer.transfer.classify`: of `(tau c, tau) h0`, or of `(a c, a)`, which
are then stored as the depths that have these opacities. Its error is the root of the channels' summed variance (Laur
and Hanrahan 1991, section 3: the RMS error of a node), of one of

    optical           (tau c, tau) h0     times the cell's side in the cut: what the node can put into a pixel
    rms, classified   (a c, a)            opacity over the finest spacing
    rms, scalar       s                   in data units

Only visible nodes are stored: every level is one list in Morton order, so that the children of a node lie together.
Blocks that show nothing are not even classified. On the levels 1 and 2 nodes are left out, too, that lie below one
that is a leaf in every cut that will be asked for: a film at one tolerance has no use for them.

Where bricks are drawn these two levels are not stored at all: whoever gathers what bricks must know of them is told
their nodes as they are made, and makes them again from voxels where they are drawn.

Blocks of 8^3 voxels are built many at a time by several threads, which gives levels 1 to 3; then each tier of groups
of 64 nodes gives two levels more (see `renderer.pyramid.kernels`), the first still with the blocks: what is kept of a
large volume until all are done is then small.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.pyramid import kernels
from renderer.pyramid.blocks import as_packed_channels, classify_blocks, merge, opacities_to_depths, store_scaled
from renderer.pyramid.empty_space import visible_blocks
from renderer.pyramid.kernels import BLOCK_SIZE
from renderer.pyramid.memory import (
    BLOCK_LEVELS,
    BLOCKS_PER_TASK,
    CUBE_LEVELS,
    NODES_OF_GROUP,
    BlockLevelBuffers,
    NodeArrays,
    Scratch,
    empty_node_arrays,
)
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.threads import ThreadPool
from renderer.transfer import VISIBILITY_THRESHOLD, Classifier, TransferFunction, make_classifier, raw_voxels
from renderer.volume import Volume

Array = npt.NDArray[Any]
Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]
Shape = tuple[int, int, int]

# Told visible nodes of a level in Morton order: the level, their cells [n, 3] (x, y, z), their errors [n] in the
# measure's unit, and their means [n, 4] as they would be stored. Nothing of this stays as it is after the call.
NodeCallback = Callable[[int, Int32, Float64, Array], None]

# Means are stored as multiples of the largest possible one, brought to this: then float16 holds 8 decades below it at
# its full 11 bits (its normal numbers go down to 2^-14).
MAX_STORED_MEAN = 2.0**15

# Scalars are normalised by their range, or by this where it is smaller: the inverse of its unit is still a number, and
# squares of the smallest denormal numbers are then normal ones.
MIN_SCALAR_RANGE = 2.0**-1008

# Levels in each tier above the blocks.
TIER_LEVELS = 2

# Levels of which bricks need no nodes in memory.
STREAMED_LEVELS = 2

# Errors are compared with the tolerance as they are stored; one that is this much below it is so in any precision.
ROUNDING_MARGIN = 1 - 2.0**-9
MAX_STORED_ROUNDING = 2.0**-24

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
    level 0, always as (tau c, tau) h0. measure, of: what errors are, as in ErrorSpec.

    mean_classifier: what means are means of; where that is opacities, `max_depth` is the depth of the max_depth voxel.

    occupied: bool [z, y, x], the cells of level `occupied_level` in which anything is visible.
    min_tolerance, finest_level: cuts at smaller tolerances, or of finer levels, need nodes that were left out.
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
    occupied: npt.NDArray[np.bool_]
    occupied_level: int
    min_tolerance: float
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
    min_tolerance: float = 0.0,
    finest_level: int = 0,
    on_nodes: NodeCallback | None = None,
) -> Pyramid:
    """Build all levels in one pass over the voxels; the result does not depend on `num_threads`.

    No cut will be asked for at a tolerance below `min_tolerance`, nor one with cells of a level below `finest_level`.
    on_nodes: called with all visible nodes of the levels up to STREAMED_LEVELS, which are not stored, by several
    threads at a time;
        the nodes in a cube of 2^CUBE_LEVELS voxels a side come together. There are levels above these then.

    Raises InputError where the volume's file was changed.
    """
    num_levels = max(1 if on_nodes is None else BLOCK_LEVELS, (max(volume.shape_xyz) - 1).bit_length())
    settings = _make_build_settings(volume, transfer, spec, error, shading)
    if on_nodes is None:
        limits = _leaf_variance_limits(settings, volume, error.measure, num_levels, min_tolerance, finest_level)
        settings = replace(settings, leaf_variance_limits=limits)
    else:
        settings, finest_level = replace(settings, on_nodes=on_nodes), STREAMED_LEVELS + 1
    cubes, first_cubes, first_blocks = _tasks(volume.shape_xyz)
    buffers = BlockLevelBuffers.empty(
        first_blocks, volume.shape_xyz, settings.dtype, lowest=0 if on_nodes is None else STREAMED_LEVELS
    )
    tier, above = _build_all_blocks(settings, np.split(cubes, first_cubes), buffers, num_threads)
    depths = (
        settings.mean_classifier
        if spec.average == "extinction"
        else make_classifier(volume, transfer, shading, opacity=False)
    )
    stored = buffers.compacted(num_threads) + above
    while len(stored) < num_levels:
        tier, levels = _next_tier(settings, tier, len(stored))
        stored += levels
    return Pyramid(
        levels=_link_children(stored[:num_levels]),
        mean_unit=settings.mean_unit,
        error_unit=settings.error_unit,
        classifier=depths,
        mean_classifier=settings.mean_classifier,
        max_depth=settings.max_depth,
        volume=volume,
        measure=error.measure,
        of=error.of,
        occupied=buffers.occupied,
        occupied_level=buffers.occupied_level,
        min_tolerance=min_tolerance,
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
class _BuildSettings:
    """What all tasks are told.

    rule: classifies for the means; the variance that comes with them is the error where both of the others are None.
    error_classifier: classifies for the errors. normal: (offset, scale) of the scalar that errors are of.
    mean_unit, error_unit: as in Pyramid. error_factor: brings the root of a variance to its stored unit.
    max_depth: of a voxel, where opacities are averaged; the means are stored as depths all the same.
    limits: nodes of level 2, and of level 3, with a variance below are leaves in every cut.
    tell: as of `build_pyramid`.
    """

    volume: Volume
    measure: str
    raw: Array
    mean_classifier: Classifier
    error_classifier: Classifier | None
    scalar_normalization: tuple[float, float] | None
    mean_unit: float
    error_unit: float
    error_factor: float
    dtype: type[np.float16] | type[np.float32]
    max_depth: float | None
    leaf_variance_limits: tuple[float, float] = (0.0, 0.0)
    on_nodes: NodeCallback | None = None

    @property
    def shape_xyz(self) -> Shape:
        return self.volume.shape_xyz

    @property
    def error_layout(self) -> tuple[int, type[Any]] | None:
        """Channels and dtype of what errors are measured of, where that is not what is averaged."""
        if self.scalar_normalization:  # scalars may lie close together and far from zero: float64
            return 1, np.float64
        return (4, np.float32) if self.error_classifier else None


def _make_build_settings(
    volume: Volume, transfer: TransferFunction, spec: PyramidSpec, error: ErrorSpec, shading: ShadingSpec | None
) -> _BuildSettings:
    opacity, of_opacity = spec.average == "opacity", error.measure == "rms"
    depth = volume.finest_spacing * transfer.max_extinction
    brightest = max(1.0, shading.ambient + shading.diffuse) if shading else 1.0

    def unit(of_opacity: bool) -> float:
        return _stored_unit(brightest * max(-math.expm1(-depth) if of_opacity else depth, VISIBILITY_THRESHOLD))

    rule = make_classifier(volume, transfer, shading, opacity=opacity)
    error_classifier, normal = None, None
    error_unit, error_factor = unit(of_opacity), 1 / unit(of_opacity)
    if error.of == "scalar":
        low, high = volume.value_range()
        offset = _exact_offset(low, high)
        error_unit, error_factor = _stored_unit(max(abs(low - offset), abs(high - offset))), 1.0
        normal = (offset, 1 / error_unit)
    elif opacity != of_opacity:
        error_classifier = make_classifier(volume, transfer, shading, opacity=of_opacity)
    return _BuildSettings(
        volume,
        error.measure,
        raw_voxels(volume),
        rule,
        error_classifier,
        normal,
        unit(False),
        error_unit,
        error_factor,
        np.float16 if spec.precision == "half" else np.float32,
        depth if opacity else None,
    )


def _leaf_variance_limits(
    settings: _BuildSettings, volume: Volume, measure: str, num_levels: int, min_tolerance: float, finest_level: int
) -> tuple[float, float]:
    """Total variances of nodes of levels 2 and 3 below which their stored errors are below any tolerance asked for.

    They hold for whole cells, and all the more for those that the border cuts.
    """
    limits = []
    for level in (2, 3):
        unit = float(error_scale(volume, measure, 8.0**level)) * settings.error_unit
        root = (min_tolerance * ROUNDING_MARGIN - MAX_STORED_ROUNDING * unit) / (unit * settings.error_factor)
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
    """A power of two, so that scaling by it rounds nothing, of which `largest` is at most MAX_STORED_MEAN."""
    return math.ldexp(1 / MAX_STORED_MEAN, math.frexp(max(largest, MIN_SCALAR_RANGE))[1])


def _tasks(shape_xyz: Shape) -> tuple[Int64, Int64, Int64]:
    """The cubes of a volume, int64 [n, 3] (x, y, z in cubes), in Morton order; and which begin a task, but for the
    first, int64 [num_tasks - 1]; and the number of blocks before each task, and in all, int64 [num_tasks + 1]."""
    top = max(CUBE_LEVELS, (max(shape_xyz) - 1).bit_length())
    cubes = _subdivide(np.zeros((1, 3), np.int64), top, CUBE_LEVELS, shape_xyz)
    nums = (-(-cell_extents(cubes, CUBE_LEVELS, shape_xyz) // BLOCK_SIZE)).prod(axis=1)
    first_cubes, first_blocks, end = [], [0], 0
    for cube, num in enumerate(nums.tolist()):
        if end + num > first_blocks[-1] + BLOCKS_PER_TASK:
            first_cubes.append(cube)
            first_blocks.append(end)
        end += num
    return cubes, np.array(first_cubes, np.int64), np.array([*first_blocks, end], np.int64)


def _subdivide(cells: Int64, level: int, finer_level: int, shape_xyz: Shape) -> Int64:
    """int64 [n, 3]: the cells of a finer level in some cells, each in units of its own width, in Morton order."""
    for number in range(level - 1, finer_level - 1, -1):
        cells = (2 * cells[:, None] + OCTANTS).reshape(-1, 3)
        inside = cells << number < shape_xyz
        cells = cells[inside[:, 0] & inside[:, 1] & inside[:, 2]]
    return cells


class _Tier(NamedTuple):
    """Nodes of one level: cells int64 [n, 3] (x, y, z), means [n, 4], and of what errors are measured of means and
    variances [n, c]."""

    cells: Int64
    means: Array
    error_means: Array
    variances: Array


def _build_all_blocks(
    settings: _BuildSettings, cubes: list[Int64], buffers: BlockLevelBuffers, num_threads: int
) -> tuple[_Tier, list[NodeArrays]]:
    """Build the levels inside blocks, task by task, into `buffers`; return the tier above and the levels in it."""
    num_blocks = int(np.diff(buffers.first_blocks).max())
    streamed = (STREAMED_LEVELS if settings.on_nodes else 0), settings.dtype
    scratches = [Scratch.empty(num_blocks, settings.error_layout, streamed) for _ in range(num_threads)]

    def work(task: int) -> tuple[_Tier, list[NodeArrays]]:
        scratch = scratches.pop()  # each thread has one at a time
        settings.volume.require_unchanged()
        roots = _build_blocks(settings, cubes[task], buffers, task, scratch)
        scratches.append(scratch)
        return _next_tier(settings, roots, BLOCK_LEVELS)

    with ThreadPool(num_threads) as pool:
        tiers, levels = zip(*pool.map(work, range(len(cubes))), strict=True)
    settings.volume.require_unchanged()
    tier = _Tier(*(np.concatenate(parts) for parts in zip(*tiers, strict=True)))
    return tier, [_concatenated(parts) for parts in zip(*levels, strict=True)]


def _concatenated(parts: Sequence[NodeArrays]) -> NodeArrays:
    means, errors, masks = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return means, errors, masks


def _build_blocks(
    settings: _BuildSettings, cubes: Int64, buffers: BlockLevelBuffers, task: int, scratch: Scratch
) -> _Tier:
    """The levels inside the blocks of one task, and their roots."""
    cells = _subdivide(cubes, CUBE_LEVELS, BLOCK_LEVELS, settings.shape_xyz)
    starts = (cells * BLOCK_SIZE).astype(np.uint64)
    extents = cell_extents(cells, BLOCK_LEVELS, settings.shape_xyz).astype(np.uint64)
    if not settings.scalar_normalization:  # the scalars of what is not visible count for the errors of scalars
        visible = visible_blocks(settings.raw, settings.mean_classifier, starts, extents)
        cells, starts, extents = cells[visible], starts[visible], extents[visible]
    scratch = scratch.first(len(cells))
    nodes, errors = scratch.nodes, scratch.errors or scratch.nodes
    classify_blocks(settings.raw, settings.mean_classifier, starts, extents, scratch.voxels, nodes)
    if settings.scalar_normalization:
        kernels.build_scalar_level(
            settings.raw, settings.mean_classifier.scalars, *settings.scalar_normalization, starts, extents, *errors[0]
        )
        merge(errors, extents, 2)
    elif settings.error_classifier:
        classify_blocks(settings.raw, settings.error_classifier, starts, extents, scratch.voxels, errors)
    if any(settings.leaf_variance_limits):
        kernels.mark_permanent_leaves(errors[1][1], errors[2][1], settings.leaf_variance_limits, *scratch.final)
    part = min(buffers.occupied_level, BLOCK_LEVELS) - 1
    kernels.mark_occupied(nodes[part][0], cells, buffers.occupied_level - 1 - part, buffers.occupied)
    for level in range(BLOCK_LEVELS):
        is_streamed = level < len(scratch.passing)
        target = scratch.passing[level] if is_streamed else buffers.of_task(task, level)
        num = buffers.counts[task, level] = _store_visible(settings, scratch, level, target)
        if is_streamed:
            _stream_nodes(settings, level + 1, nodes[level][0], cells, target[0][:num], target[1][:num])
    return _Tier(cells, *(roots[:, 0].copy() for roots in (nodes[2][0], *errors[2])))


def _stream_nodes(
    settings: _BuildSettings, level: int, nodes: npt.NDArray[np.float32], groups: Int64, means: Array, errors: Array
) -> None:
    """Tell the visible nodes [g, n, 4] of groups at `groups` [g, 3], with their stored means and errors."""
    assert settings.on_nodes is not None
    cells, sizes = np.empty((len(means), 3), np.int32), np.empty(len(means), np.int64)
    kernels.list_visible_cells(nodes, groups, 1 << level, settings.raw.shape, cells, sizes)
    scales = error_scale(settings.volume, settings.measure, np.arange(8**level + 1)) * settings.error_unit
    settings.on_nodes(level, cells, errors * (scales[sizes] if scales.ndim else scales), means)


def _next_tier(settings: _BuildSettings, tier: _Tier, level: int) -> tuple[_Tier, list[NodeArrays]]:
    """The two levels above `level`, on which the nodes of `tier` lie in Morton order, and the upper one's as a tier."""
    cells = tier.cells >> TIER_LEVELS
    steps = np.diff(cells, axis=0)
    is_first = np.ones(len(cells), np.bool_)
    is_first[1:] = (steps[:, 0] | steps[:, 1] | steps[:, 2]) != 0
    place = 64 * (np.cumsum(is_first) - 1) + 8 * _octants(tier.cells) + _octants(tier.cells >> 1)
    cells = cells[is_first]
    extents = cell_extents(cells, level + TIER_LEVELS, settings.shape_xyz).astype(np.uint64)

    scratch = Scratch.empty(len(cells), settings.error_layout)
    errors = scratch.errors or scratch.nodes
    scratch.nodes[0][1][:] = 0  # used only where it is the error's, and set then
    for nodes, values in ((scratch.nodes[0][0], tier.means), *zip(errors[0], tier[2:], strict=True)):
        nodes[:] = 0
        nodes.reshape(-1, values.shape[1])[place] = values
    merge(scratch.nodes, extents, 1 << level)
    if scratch.errors:
        merge(scratch.errors, extents, 1 << level)
    stored = []
    for part in (1, 2):
        target = empty_node_arrays(len(cells) * NODES_OF_GROUP[part], settings.dtype, masked=True)
        num = _store_visible(settings, scratch, part, target)
        stored.append((target[0][:num], target[1][:num], target[2][:num]))
    return _Tier(cells, *(roots[:, 0] for roots in (scratch.nodes[2][0], *errors[2]))), stored


def _octants(cells: Int64) -> Int64:
    """int64 [n]: which child of its parent a cell is."""
    return cells[:, 0] & 1 | (cells[:, 1] & 1) << 1 | (cells[:, 2] & 1) << 2


def _store_visible(settings: _BuildSettings, scratch: Scratch, part: int, target: NodeArrays) -> int:
    """Write the visible nodes of one part of the groups to the beginning of `target`; how many they are."""
    means, _ = scratch.nodes[part]
    _, variances = (scratch.errors or scratch.nodes)[part]
    children = scratch.nodes[part - 1][0] if part > 0 else means[:0]
    parents, roots = scratch.final
    is_permanent_leaf, is_below_permanent_leaf = ((roots[:0], parents), (parents, roots), (roots, roots[:0]))[part]
    num = kernels.append_visible(
        means,
        as_packed_channels(means),
        variances,
        children,
        is_permanent_leaf,
        is_below_permanent_leaf,
        as_packed_channels(scratch.visible),
        scratch.spreads,
        target[2],
    )
    if settings.max_depth is not None:
        opacities_to_depths(scratch.visible[:num], settings.max_depth)
    store_scaled(scratch.visible[:num], 1 / settings.mean_unit, target[0][:num])
    store_scaled(scratch.spreads[:num], settings.error_factor, target[1][:num])
    return num


def _link_children(stored: list[NodeArrays]) -> tuple[Level, ...]:
    """Levels with the place of each node's first child: children are in the order of their parents."""
    levels = []
    for means, errors, masks in stored:
        num_children = np.bitwise_count(masks).astype(np.int64)
        first_children = np.cumsum(num_children) - num_children
        for array in (means, errors, masks, first_children):
            array.flags.writeable = False
        levels.append(Level(means, errors, masks, first_children))
    return tuple(levels)
