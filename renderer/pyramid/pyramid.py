"""Build the pyramid: for each octree node, the mean of its voxels and the error of replacing them by it.

Level l has cells of 2^l voxels a side. Level 0, the voxels, is not stored: classification gives it. A node's four
channels are means of those of `renderer.transfer.classify`: of `(tau c, tau) h0`, or of `(a c, a)`, which are then
stored as the depths that have these opacities. Its error is the root of the channels' summed variance (Laur and
Hanrahan 1991, section 3: the RMS error of a node), of one of

    optical           (tau c, tau) h0     times the cell's side in the cut: what the node can put into a pixel
    rms, classified   (a c, a)            opacity over the finest spacing
    rms, scalar       s                   in data units

Only visible nodes are stored. Every level is a list in Morton order, so that the children of a node lie together.
Blocks that show nothing are not even classified. Nodes of levels 1 and 2 below a node that is a leaf in every cut are
left out, too: a film at one tolerance has no use for them.

Where bricks are drawn, these two levels are not stored at all. They are streamed to a callback, which gathers what
bricks need to know of them, and recomputed from voxels where they are drawn.

Several threads build blocks of 8^3 voxels, which gives levels 1 to 3. Then each tier of groups of 64 nodes gives two
levels more (see `renderer.pyramid.kernels`). The first tier is built together with its blocks, so that little of a
large volume has to be kept until all blocks are built.
"""

from __future__ import annotations

import math
from collections.abc import Callable
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

# Takes visible nodes of a level in Morton order: the level, their cells [n, 3] (x, y, z), their errors [n] in the
# measure's unit, and their means [n, 4] as they would be stored. The arrays are reused after the call.
NodeCallback = Callable[[int, Int32, Float64, Array], None]

# Means are stored as multiples of the largest possible one, scaled to this: float16 then holds 8 decades below it at
# its full 11 bits (its normal numbers go down to 2^-14).
MAX_STORED_MEAN = 2.0**15

# Scalars are normalized by their range, or by this where it is smaller: the inverse of the unit is then finite, and
# squares of the smallest denormal numbers are normal.
MIN_SCALAR_RANGE = 2.0**-1008

# Levels in each tier above the blocks.
TIER_LEVELS = 2

# Levels of which bricks need no nodes in memory.
STREAMED_LEVELS = 2

# Errors are compared with the tolerance as they are stored. One that is this much below it is below in any precision.
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
    """Levels of nodes: levels[0] is level 1, and levels[-1] holds the root, or no node where nothing is visible.

    mean_unit, error_unit: factors from stored means and errors to the units above.
    classifier: of level 0, always as (tau c, tau) h0. mean_classifier: of what means are means of.
    max_depth: the largest optical depth of a voxel, where means are of opacities.
    measure, of: what errors are, as in ErrorSpec.
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
        """The root's level."""
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

    min_tolerance, finest_level: of the cuts that will be made.
    on_nodes: called with all visible nodes of the levels up to STREAMED_LEVELS, which are then not stored, from several
        threads at a time. The nodes in a cube of 2^CUBE_LEVELS voxels a side come together.

    Raises InputError where the volume's file was changed.
    """
    num_levels = max(1 if on_nodes is None else BLOCK_LEVELS, (max(volume.shape_xyz) - 1).bit_length())
    settings = _make_settings(volume, transfer, spec, error, shading, on_nodes)
    if on_nodes is None:
        limits = _leaf_variance_limits(settings, num_levels, min_tolerance, finest_level)
        settings = replace(settings, leaf_variance_limits=limits)
    else:
        finest_level = STREAMED_LEVELS + 1
    cubes, first_cubes, first_blocks = _tasks(volume.shape_xyz)
    buffers = BlockLevelBuffers.empty(first_blocks, volume.shape_xyz, settings.dtype, settings.num_streamed)
    tier, above = _build_all_blocks(settings, np.split(cubes, first_cubes), buffers, num_threads)
    classifier = settings.mean_classifier
    if classifier.is_opacity:
        classifier = make_classifier(volume, transfer, shading, opacity=False)
    stored = buffers.compacted(num_threads) + above
    while len(stored) < num_levels:
        tier, levels = _next_tier(settings, tier, len(stored))
        stored += levels
    return Pyramid(
        levels=tuple(_link_children(nodes) for nodes in stored[:num_levels]),
        mean_unit=settings.mean_unit,
        error_unit=settings.error_unit,
        classifier=classifier,
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
    """Return the factor from the root of the variance of nodes of `num_voxels` voxels to their error.

    For `optical` it is the cell's side, the cube root of its world volume, in units of the finest spacing (which the
    channels carry); 1 for `rms`.
    """
    if measure == "rms":
        return np.ones(())
    in_finest = volume.world_from_index[:3, :3] / volume.finest_spacing  # first: the determinant may underflow
    return np.cbrt(num_voxels * abs(float(np.linalg.det(in_finest))))


def cell_extents(cells: Array, level: int, shape_xyz: Shape) -> Int64:
    """int64 [n, 3]: voxels along x, y, z in cells (x, y, z in units of 2^level voxels) that the border may cut."""
    first = cells.astype(np.int64) << level
    return np.asarray(np.minimum(np.array(shape_xyz) - first, 1 << level))


@dataclass(frozen=True)
class _BuildSettings:
    """What all tasks share.

    mean_classifier: classifies for the means. error_classifier: classifies for the errors.
    scalar_normalization: (offset, scale) of the scalar that errors are of.
        Where both are None, the error is the variance that comes with the means.
    mean_unit, error_unit: as in Pyramid. error_factor: from the root of a variance to its stored unit.
    max_depth: as in Pyramid; means of opacities are stored as depths.
    on_nodes: as in `build_pyramid`.
    leaf_variance_limits: nodes of level 2, and of level 3, with a smaller variance are leaves in every cut.
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
    on_nodes: NodeCallback | None
    leaf_variance_limits: tuple[float, float] = (0.0, 0.0)

    @property
    def num_streamed(self) -> int:
        """Levels that are not stored."""
        return STREAMED_LEVELS if self.on_nodes else 0

    @property
    def error_layout(self) -> tuple[int, type[Any]] | None:
        """Channels and dtype of what errors are measured of, where that is not what is averaged."""
        if self.scalar_normalization:  # scalars may lie close together and far from zero: float64
            return 1, np.float64
        return (4, np.float32) if self.error_classifier else None


def _make_settings(
    volume: Volume,
    transfer: TransferFunction,
    spec: PyramidSpec,
    error: ErrorSpec,
    shading: ShadingSpec | None,
    on_nodes: NodeCallback | None,
) -> _BuildSettings:
    opacity, of_opacity = spec.average == "opacity", error.measure == "rms"
    depth = volume.finest_spacing * transfer.max_extinction
    brightest = max(1.0, shading.ambient + shading.diffuse) if shading else 1.0

    def unit(of_opacity: bool) -> float:
        return _stored_unit(brightest * max(-math.expm1(-depth) if of_opacity else depth, VISIBILITY_THRESHOLD))

    error_classifier, normalization = None, None
    error_unit, error_factor = unit(of_opacity), 1 / unit(of_opacity)
    if error.of == "scalar":
        low, high = volume.value_range()
        offset = _exact_offset(low, high)
        error_unit, error_factor = _stored_unit(max(abs(low - offset), abs(high - offset))), 1.0
        normalization = (offset, 1 / error_unit)
    elif opacity != of_opacity:
        error_classifier = make_classifier(volume, transfer, shading, opacity=of_opacity)
    return _BuildSettings(
        volume,
        error.measure,
        raw_voxels(volume),
        make_classifier(volume, transfer, shading, opacity=opacity),
        error_classifier,
        normalization,
        unit(False),
        error_unit,
        error_factor,
        np.float16 if spec.precision == "half" else np.float32,
        depth if opacity else None,
        on_nodes,
    )


def _leaf_variance_limits(
    settings: _BuildSettings, num_levels: int, min_tolerance: float, finest_level: int
) -> tuple[float, float]:
    """Return the total variances of nodes of levels 2 and 3 below which their errors are below any tolerance in use.

    They hold for whole cells, and all the more for cells that the border cuts.
    """
    limits = []
    for level in (2, 3):
        unit = float(error_scale(settings.volume, settings.measure, 8.0**level)) * settings.error_unit
        root = (min_tolerance * ROUNDING_MARGIN - MAX_STORED_ROUNDING * unit) / (unit * settings.error_factor)
        if level > num_levels or (root <= 0 and level > finest_level):
            limits.append(0.0)
        else:
            limits.append(math.inf if level <= finest_level else root * root)
    return limits[0], limits[1]


def _exact_offset(low: float, high: float) -> float:
    """Return an offset that brings a volume's scalars close to 0 without rounding any of them.

    It is a multiple of the last place of the largest scalar, so that every difference is a multiple of the scalar's own
    last place, and no larger than the scalar.
    """
    if low <= 0.0 <= high:
        return 0.0
    near, far = sorted((low, high), key=abs)
    return near - math.fmod(near, math.ulp(far))


def _stored_unit(largest: float) -> float:
    """Return a power of two, so that scaling rounds nothing, of which `largest` is at most MAX_STORED_MEAN."""
    return math.ldexp(1 / MAX_STORED_MEAN, math.frexp(max(largest, MIN_SCALAR_RANGE))[1])


def _tasks(shape_xyz: Shape) -> tuple[Int64, Int64, Int64]:
    """Return the cubes of a volume, int64 [n, 3] (x, y, z in cubes), in Morton order; the first cubes of all tasks but
    the first, int64 [num_tasks - 1]; and the number of blocks before each task, and in all, int64 [num_tasks + 1]."""
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
    """int64 [n, 3]: the cells of a finer level in cells of a level, each in its own widths, in Morton order."""
    for number in range(level - 1, finer_level - 1, -1):
        cells = (2 * cells[:, None] + OCTANTS).reshape(-1, 3)
        inside = cells << number < shape_xyz
        cells = cells[inside[:, 0] & inside[:, 1] & inside[:, 2]]
    return cells


class _Tier(NamedTuple):
    """Nodes of one level: cells int64 [n, 3] (x, y, z) and means [n, 4]; means and variances [n, c] of what errors are
    measured of."""

    cells: Int64
    means: Array
    error_means: Array
    variances: Array


def _build_all_blocks(
    settings: _BuildSettings, cubes: list[Int64], buffers: BlockLevelBuffers, num_threads: int
) -> tuple[_Tier, list[NodeArrays]]:
    """Build the levels inside blocks, task by task, into `buffers`; return the tier above and the levels in it."""
    num_blocks = int(np.diff(buffers.first_blocks).max())
    scratches = [
        Scratch.empty(num_blocks, settings.error_layout, settings.num_streamed, settings.dtype)
        for _ in range(num_threads)
    ]

    def work(task: int) -> tuple[_Tier, list[NodeArrays]]:
        settings.volume.require_unchanged()
        scratch = scratches.pop()  # a thread has one at a time
        roots = _build_blocks(settings, cubes[task], buffers, task, scratch)
        scratches.append(scratch)
        return _next_tier(settings, roots, BLOCK_LEVELS)

    with ThreadPool(num_threads) as pool:
        tiers, levels = zip(*pool.map(work, range(len(cubes))), strict=True)
    settings.volume.require_unchanged()
    tier = _Tier(*map(np.concatenate, zip(*tiers, strict=True)))
    return tier, [NodeArrays(*map(np.concatenate, zip(*parts, strict=True))) for parts in zip(*levels, strict=True)]


def _build_blocks(
    settings: _BuildSettings, cubes: Int64, buffers: BlockLevelBuffers, task: int, scratch: Scratch
) -> _Tier:
    """Build the levels inside the blocks of one task; return their roots."""
    cells = _subdivide(cubes, CUBE_LEVELS, BLOCK_LEVELS, settings.volume.shape_xyz)
    starts = (cells * BLOCK_SIZE).astype(np.uint64)
    extents = cell_extents(cells, BLOCK_LEVELS, settings.volume.shape_xyz).astype(np.uint64)
    raw, normalization = settings.raw, settings.scalar_normalization
    if not normalization:  # scalars count for their errors where they are invisible, too
        visible = visible_blocks(raw, settings.mean_classifier, starts, extents)
        cells, starts, extents = cells[visible], starts[visible], extents[visible]
    scratch = scratch.limited_to(len(cells))
    nodes, errors = scratch.nodes, scratch.errors or scratch.nodes
    classify_blocks(raw, settings.mean_classifier, starts, extents, scratch.voxels, nodes)
    if normalization:
        scalars = settings.mean_classifier.scalars
        kernels.build_scalar_level(raw, scalars, *normalization, starts, extents, *errors[0])
        merge(errors, extents, 2)
    elif settings.error_classifier:
        classify_blocks(raw, settings.error_classifier, starts, extents, scratch.voxels, errors)
    if any(settings.leaf_variance_limits):
        limits = settings.leaf_variance_limits
        kernels.mark_permanent_leaves(errors[1][1], errors[2][1], limits, *scratch.permanent_leaves)
    part = min(buffers.occupied_level, BLOCK_LEVELS) - 1
    kernels.mark_occupied(nodes[part][0], cells, buffers.occupied_level - 1 - part, buffers.occupied)
    for level in range(BLOCK_LEVELS):
        is_streamed = level < settings.num_streamed
        target = scratch.streamed[level] if is_streamed else buffers.of_task(task, level)
        num = buffers.counts[task, level] = _store_visible(settings, scratch, level, target)
        if is_streamed:
            _stream_nodes(settings, level + 1, nodes[level][0], cells, target.part(0, num))
    return _Tier(cells, *(roots[:, 0].copy() for roots in (nodes[2][0], *errors[2])))


def _stream_nodes(
    settings: _BuildSettings, level: int, nodes: npt.NDArray[np.float32], groups: Int64, stored: NodeArrays
) -> None:
    """Pass the visible nodes [g, n, 4] of groups at `groups` [g, 3], as they are stored, to the callback."""
    assert settings.on_nodes is not None
    cells, sizes = np.empty((len(stored.means), 3), np.int32), np.empty(len(stored.means), np.int64)
    kernels.list_visible_cells(nodes, groups, 1 << level, settings.raw.shape, cells, sizes)
    scales = error_scale(settings.volume, settings.measure, np.arange(8**level + 1)) * settings.error_unit
    settings.on_nodes(level, cells, stored.errors * (scales[sizes] if scales.ndim else scales), stored.means)


def _next_tier(settings: _BuildSettings, tier: _Tier, level: int) -> tuple[_Tier, list[NodeArrays]]:
    """Build the two levels above `level`, on which the nodes of `tier` lie in Morton order; return the upper one as a
    tier, and both as they are stored."""
    cells = tier.cells >> TIER_LEVELS
    steps = np.diff(cells, axis=0)
    is_first = np.ones(len(cells), np.bool_)
    is_first[1:] = (steps[:, 0] | steps[:, 1] | steps[:, 2]) != 0
    index = 64 * (np.cumsum(is_first) - 1) + 8 * _octants(tier.cells) + _octants(tier.cells >> 1)
    cells = cells[is_first]
    extents = cell_extents(cells, level + TIER_LEVELS, settings.volume.shape_xyz).astype(np.uint64)

    scratch = Scratch.empty(len(cells), settings.error_layout)
    errors = scratch.errors or scratch.nodes
    scratch.nodes[0][1][:] = 0  # variances, which are set below where they are the errors'
    for nodes, values in ((scratch.nodes[0][0], tier.means), *zip(errors[0], tier[2:], strict=True)):
        nodes[:] = 0
        nodes.reshape(-1, values.shape[1])[index] = values
    merge(scratch.nodes, extents, 1 << level)
    if scratch.errors:
        merge(scratch.errors, extents, 1 << level)
    stored = []
    for part in (1, 2):
        target = empty_node_arrays(len(cells) * NODES_OF_GROUP[part], settings.dtype, masked=True)
        stored.append(target.part(0, _store_visible(settings, scratch, part, target)))
    return _Tier(cells, *(roots[:, 0] for roots in (scratch.nodes[2][0], *errors[2]))), stored


def _octants(cells: Int64) -> Int64:
    """int64 [n]: which child of its parent a cell is."""
    return cells[:, 0] & 1 | (cells[:, 1] & 1) << 1 | (cells[:, 2] & 1) << 2


def _store_visible(settings: _BuildSettings, scratch: Scratch, part: int, target: NodeArrays) -> int:
    """Write the visible nodes of one part of the groups to the beginning of `target`; return how many they are."""
    means, _ = scratch.nodes[part]
    _, variances = (scratch.errors or scratch.nodes)[part]
    children = scratch.nodes[part - 1][0] if part > 0 else means[:0]
    parents, roots = scratch.permanent_leaves
    is_permanent_leaf, is_below_permanent_leaf = ((roots[:0], parents), (parents, roots), (roots, roots[:0]))[part]
    num = kernels.append_visible(
        means,
        as_packed_channels(means),
        variances,
        children,
        is_permanent_leaf,
        is_below_permanent_leaf,
        as_packed_channels(scratch.visible),
        scratch.deviations,
        target.masks,
    )
    if settings.max_depth is not None:
        opacities_to_depths(scratch.visible[:num], settings.max_depth)
    store_scaled(scratch.visible[:num], 1 / settings.mean_unit, target.means[:num])
    store_scaled(scratch.deviations[:num], settings.error_factor, target.errors[:num])
    return num


def _link_children(nodes: NodeArrays) -> Level:
    """Return a level with the index of each node's first child: children are in the order of their parents."""
    num_children = np.bitwise_count(nodes.masks).astype(np.int64)
    level = Level(*nodes, np.cumsum(num_children) - num_children)
    for array in (level.means, level.errors, level.masks, level.first_children):
        array.flags.writeable = False
    return level
