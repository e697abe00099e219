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
levels more (see `renderer.pyramid.nodes`). The first tier is built together with its blocks, so that little of a
large volume has to be kept until all blocks are built.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from renderer.kernels import Classifier, LightGrid, ThreadPool, VisibleNodes, kernels
from renderer.pyramid.nodes import (
    BLOCK_SIZE,
    NODES_OF_GROUP,
    nodes_of_level,
    opacities_to_depths,
    room_for_nodes,
    store_scaled,
)
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import (
    NO_LIGHT_GRID,
    VISIBILITY_THRESHOLD,
    TransferFunction,
    make_classifier,
    raw_voxels,
)
from renderer.volume import Array, Bools, Float32, Float64, Int32, Int64, UInt8, Volume

Shape = tuple[int, int, int]

# Takes visible nodes of a level in Morton order: the level, their cells [n, 3] (x, y, z), their numbers of voxels [n],
# their errors [n] in the measure's unit, and their means [n, 4] as they would be stored. What it keeps, it copies.
NodeCallback = Callable[[int, Int32, Int64, Float64, Array], None]

# Levels inside a block.
BLOCK_LEVELS = 3

# Tasks build whole cubes of 64^3 voxels, so that no two of them have nodes in the same brick of levels 0 to 2.
CUBE_LEVELS = 6
# Most blocks of a task: enough to hide the dispatch, few enough that their nodes take little memory.
BLOCKS_PER_TASK = 2048

# Framing reads a grid of visible cells that has at most this many along an axis.
MAX_OCCUPANCY_SIDE = 128

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

# int32 [8, 3]: the children (x, y, z) of a cell, in Morton order.
OCTANTS = np.arange(8, dtype=np.int32)[:, None] >> np.arange(3, dtype=np.int32) & 1


class FinestCut(NamedTuple):
    """A bound of the cuts that will be made: the smallest tolerance and the finest level."""

    tolerance: float = 0.0
    level: int = 0


EVERY_CUT = FinestCut()


class Level(NamedTuple):
    """A level: its visible nodes, in Morton order of their cells.

    means: float16 or float32 [n, 4], stored units.
    errors: float16 or float32 [n], stored units.
    masks: uint8 [n], bit `x + 2 y + 4 z` set where that child is visible; empty on level 1.
    first_children: int64 [n], index in the level below of the first visible child; empty on level 1, and while the
        pyramid is built.
    """

    means: Array
    errors: Array
    masks: UInt8
    first_children: Int64

    @classmethod
    def empty(cls, num: int, dtype: type[Any], *, masked: bool) -> Level:
        """Return arrays for `num` nodes, with masks or, on level 1, without. Memory is taken when they are written."""
        masks = np.empty(num if masked else 0, np.uint8)
        return cls(np.empty((num, 4), dtype), np.empty(num, dtype), masks, np.empty(0, np.int64))

    def part(self, first: int, end: int) -> Level:
        """Return the nodes from `first` to `end`; views."""
        return Level._make(array[first:end] for array in self)


@dataclass(frozen=True)
class Pyramid:
    """A pyramid: levels[0] is level 1, and levels[-1] holds the root, or no node where nothing is visible.

    mean_unit, error_unit: factors from stored means and errors to the units above.
    classifier: of level 0, always as (tau c, tau) h0. mean_classifier: of what means are means of.
    max_depth: the largest optical depth of a voxel, where means are of opacities.
    measure, of: what errors are, as in ErrorSpec.
    occupied: bool [z, y, x], the cells of level `occupied_level` in which anything is visible.
    finest_cut: finer cuts need nodes that were left out.
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
        """Return the root's level."""
        return len(self.levels)

    @property
    def num_bytes(self) -> int:
        """Return the memory of all levels, in bytes."""
        return sum(array.nbytes for level in self.levels for array in level)


def build_pyramid(
    volume: Volume,
    transfer: TransferFunction,
    *,
    spec: PyramidSpec,
    error: ErrorSpec,
    shading: ShadingSpec | None = None,
    light_grid: LightGrid = NO_LIGHT_GRID,
    num_threads: int = 2,
    finest_cut: FinestCut = EVERY_CUT,
    on_nodes: NodeCallback | None = None,
) -> Pyramid:
    """Build all levels in one pass over the voxels; the result does not depend on `num_threads`.

    light_grid: of the shading.
    on_nodes: called with all visible nodes of the levels up to STREAMED_LEVELS, which are then not stored, from several
        threads at a time. The nodes in a cube of 2^CUBE_LEVELS voxels a side come together.

    Raises InputError where the volume's file was changed.
    """
    num_levels = max(1 if on_nodes is None else BLOCK_LEVELS, (max(volume.shape_xyz) - 1).bit_length())
    finest_cut = finest_cut if on_nodes is None else FinestCut(level=STREAMED_LEVELS + 1)
    plan = replace(_plan_build(volume, transfer, spec, error, (shading, light_grid), finest_cut), on_nodes=on_nodes)
    if on_nodes is None:
        plan = replace(plan, leaf_variance_limits=_leaf_variance_limits(plan, num_levels))
    tier, stored = _build_all_blocks(plan, num_threads)
    while len(stored) < num_levels:
        tier, levels = _next_tier(plan, tier, len(stored))
        stored += levels
    linked = tuple(_link_children(nodes) for nodes in stored[:num_levels])
    return replace(plan.pyramid, levels=linked)


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
    """Return the numbers of voxels along x, y, z, int64 [n, 3], in cells [n, 3] of a level that the border may cut."""
    first = cells.astype(np.int64) << level
    return np.asarray(np.minimum(np.array(shape_xyz) - first, 1 << level))


@dataclass(frozen=True)
class _Plan:
    """A plan of a build: the data that all its tasks share.

    pyramid: what is built, without its levels.
    error_classifier: classifies for the errors; None where the error is the variance that comes with the means.
    normalization: float64 [2], an offset and a scale of the scalar that errors are of; None where they are of channels.
    error_factor: from the root of a variance to its stored unit.
    leaf_variance_limits: nodes of level 2, and of level 3, with a smaller variance are leaves in every cut.
    on_nodes: as in `build_pyramid`.
    """

    pyramid: Pyramid
    error_classifier: Classifier | None
    normalization: Float64 | None
    error_factor: float
    dtype: type[np.float16] | type[np.float32]
    leaf_variance_limits: tuple[float, float] = (0.0, 0.0)
    on_nodes: NodeCallback | None = None

    @property
    def num_error_channels(self) -> int:
        """Return the channels of what errors are measured of."""
        return 4 if self.normalization is None else 1


def _plan_build(
    volume: Volume,
    transfer: TransferFunction,
    spec: PyramidSpec,
    error: ErrorSpec,
    light: tuple[ShadingSpec | None, LightGrid],
    finest_cut: FinestCut,
) -> _Plan:
    averages_opacity, measures_opacity = spec.average == "opacity", error.measure == "rms"
    shading, light_grid = light
    depth = volume.finest_spacing * transfer.max_extinction
    brightest = max(1.0, shading.ambient + shading.diffuse) if shading else 1.0

    def unit(of_opacity: bool) -> float:
        return _stored_unit(brightest * max(-math.expm1(-depth) if of_opacity else depth, VISIBILITY_THRESHOLD))

    def classifier(of_opacity: bool) -> Classifier:
        return make_classifier(volume, transfer, shading, opacity=of_opacity, grid=light_grid)

    mean_classifier = classifier(averages_opacity)
    error_classifier, normalization = None, None
    error_unit, error_factor = unit(measures_opacity), 1 / unit(measures_opacity)
    if error.of == "scalar":
        low, high = volume.value_range()
        offset = _exact_offset(low, high)
        error_unit, error_factor = _stored_unit(max(abs(low - offset), abs(high - offset))), 1.0
        normalization = np.array([offset, 1 / error_unit])
    elif averages_opacity != measures_opacity:
        error_classifier = classifier(measures_opacity)
    level = max(1, (max(volume.shape_xyz) - 1).bit_length() - (MAX_OCCUPANCY_SIDE - 1).bit_length())
    pyramid = Pyramid(
        levels=(),
        mean_unit=unit(False),
        error_unit=error_unit,
        classifier=classifier(False) if averages_opacity else mean_classifier,
        mean_classifier=mean_classifier,
        max_depth=depth if averages_opacity else None,
        volume=volume,
        measure=error.measure,
        of=error.of,
        occupied=np.zeros([((num - 1) >> level) + 1 for num in volume.values.shape], np.bool_),
        occupied_level=level,
        finest_cut=finest_cut,
    )
    dtype = np.float16 if spec.precision == "half" else np.float32
    return _Plan(pyramid, error_classifier, normalization, error_factor, dtype)


def _leaf_variance_limits(plan: _Plan, num_levels: int) -> tuple[float, float]:
    """Return the total variances of nodes of levels 2 and 3 below which their errors are below any tolerance in use.

    They hold for whole cells, and all the more for cells that the border cuts.
    """
    limits, finest_cut = [], plan.pyramid.finest_cut
    for level in (2, 3):
        unit = float(error_scale(plan.pyramid.volume, plan.pyramid.measure, 8.0**level)) * plan.pyramid.error_unit
        root = (finest_cut.tolerance * ROUNDING_MARGIN - MAX_STORED_ROUNDING * unit) / (unit * plan.error_factor)
        if level > num_levels or (root <= 0 and level > finest_cut.level):
            limits.append(0.0)
        else:
            limits.append(math.inf if level <= finest_cut.level else root * root)
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


def _tasks(shape_xyz: Shape) -> tuple[list[Int64], list[int]]:
    """Return the cubes of each task, int64 [n, 3] (x, y, z in cubes), in Morton order; and the number of blocks before
    each task, and in all."""
    top = max(CUBE_LEVELS, (max(shape_xyz) - 1).bit_length())
    cubes = subdivide(np.zeros((1, 3), np.int64), top, CUBE_LEVELS, shape_xyz)
    nums = (-(-cell_extents(cubes, CUBE_LEVELS, shape_xyz) // BLOCK_SIZE)).prod(axis=1)
    starts = range(0, len(cubes), max(1, BLOCKS_PER_TASK // int(nums.max())))
    return np.split(cubes, starts[1:]), [0, *np.add.reduceat(nums, starts).cumsum().tolist()]


def subdivide(cells: Array, level: int, finer_level: int, shape_xyz: Shape) -> Array:
    """Return the cells [m, 3] of a finer level in cells [n, 3] of a level, each in its own widths, in Morton order."""
    for number in range(level - 1, finer_level - 1, -1):
        cells = (2 * cells[:, None] + OCTANTS).reshape(-1, 3)
        inside = cells << number < shape_xyz
        cells = cells[inside[:, 0] & inside[:, 1] & inside[:, 2]]
    return cells


class _Tier(NamedTuple):
    """A list of nodes of one level: cells int64 [n, 3] (x, y, z) and means [n, 4].

    error_means, variances: [n, c], of what errors are measured of.
    """

    cells: Int64
    means: Float32
    error_means: Float64
    variances: Float64


class _BuildBlocks(Protocol):
    """A function that builds the nodes of some blocks: the kernel `build_blocks`, with its other arguments."""

    def __call__(self, *, starts: Int64, extents: Int64, visible: Bools) -> None: ...


class _Scratch(NamedTuple):
    """A task's memory for its nodes, which the next one uses again, and the kernel that fills it.

    Fresh pages cost more than the arithmetic done in them.
    """

    nodes: VisibleNodes
    build: _BuildBlocks


def _make_scratch(plan: _Plan, num_blocks: int) -> _Scratch:
    nodes = room_for_nodes(num_blocks, plan.num_error_channels, listed=plan.on_nodes is not None)
    build = kernels().build_blocks.partial(
        raw=raw_voxels(plan.pyramid.volume), classifier=plan.pyramid.mean_classifier,
        error_classifier=plan.error_classifier, normalization=plan.normalization,
        leaf_variance_limits=np.array(plan.leaf_variance_limits), occupied=plan.pyramid.occupied,
        occupied_level=plan.pyramid.occupied_level, nodes=nodes,
    )  # fmt: skip
    return _Scratch(nodes, build)


def _build_all_blocks(plan: _Plan, num_threads: int) -> tuple[_Tier, list[Level]]:
    """Build the levels inside blocks, task by task, and the two above; return the upper one as a tier, and all levels
    as they are stored.

    The lower levels are written to addresses for all nodes, and moved together when their number is known.
    """
    volume = plan.pyramid.volume
    cubes, first_blocks = _tasks(volume.shape_xyz)
    inside = [
        Level.empty(0 if _is_streamed(plan, k) else first_blocks[-1] * num, plan.dtype, masked=k > 0)
        for k, num in enumerate(NODES_OF_GROUP)
    ]
    most = int(np.diff(first_blocks).max())
    scratches = [_make_scratch(plan, most) for _ in range(num_threads)]

    def work(task: int) -> tuple[list[Level], _Tier, list[Level]]:
        volume.require_unchanged()
        first, end = first_blocks[task : task + 2]
        targets = [level.part(first * num, end * num) for level, num in zip(inside, NODES_OF_GROUP, strict=True)]
        scratch = scratches.pop()  # a thread has one at a time
        stored, roots = _build_blocks(plan, cubes[task], targets, scratch)
        scratches.append(scratch)
        return stored, *_next_tier(plan, roots, BLOCK_LEVELS)

    def compact(array: Array, parts: list[Array]) -> None:
        """Move the parts of an array to its beginning, and cut off the rest."""
        end = 0
        for part in parts:
            array[end : end + len(part)] = part
            end += len(part)
        array.resize((end, *array.shape[1:]), refcheck=False)

    with ThreadPool(num_threads) as pool:
        stored, tiers, above = zip(*pool.map(work, range(len(cubes))), strict=True)
        volume.require_unchanged()
        pool.map(
            lambda at: compact(inside[at[0]][at[1]], [levels[at[0]][at[1]] for levels in stored]),
            np.ndindex(BLOCK_LEVELS, len(Level._fields)),
        )
    tier = _Tier(*map(np.concatenate, zip(*tiers, strict=True)))
    joined = [Level(*map(np.concatenate, zip(*parts, strict=True))) for parts in zip(*above, strict=True)]
    return tier, inside + joined


def _build_blocks(plan: _Plan, cubes: Int64, targets: list[Level], scratch: _Scratch) -> tuple[list[Level], _Tier]:
    """Build the levels inside the blocks of one task; return what is stored of them, in `targets`, and their roots."""
    pyramid, (nodes, build), stored = plan.pyramid, scratch, []
    cells = subdivide(cubes, CUBE_LEVELS, BLOCK_LEVELS, pyramid.volume.shape_xyz)
    extents, visible = cell_extents(cells, BLOCK_LEVELS, pyramid.volume.shape_xyz), np.empty(len(cells), np.bool_)
    build(starts=cells * BLOCK_SIZE, extents=extents, visible=visible)
    for part in range(BLOCK_LEVELS):
        if plan.on_nodes is None or not _is_streamed(plan, part):
            stored.append(_store_visible(plan, nodes, part, targets[part]))
            continue
        found = nodes_of_level(nodes, part)
        target = Level.empty(found.stop - found.start, plan.dtype, masked=part > 0)
        target, sizes = _store_visible(plan, nodes, part, target), nodes.sizes[found]
        scales = error_scale(pyramid.volume, pyramid.measure, np.arange(8 ** (part + 1) + 1)) * pyramid.error_unit
        scaled_errors = target.errors * (scales[sizes] if scales.ndim else scales)
        plan.on_nodes(part + 1, nodes.cells[found], sizes, scaled_errors, target.means)
        stored.append(targets[part])
    roots = (array[: np.count_nonzero(visible)].copy() for array in nodes[-3:])
    return stored, _Tier(cells[visible], *roots)


def _is_streamed(plan: _Plan, part: int) -> bool:
    """Return whether the nodes of a part of the groups in blocks, of level `part + 1`, are not stored."""
    return plan.on_nodes is not None and part < STREAMED_LEVELS


def _next_tier(plan: _Plan, tier: _Tier, level: int) -> tuple[_Tier, list[Level]]:
    """Build the two levels above `level`, on which the nodes of `tier` lie in Morton order; return the upper one as a
    tier, and both as they are stored."""
    cells = tier.cells >> TIER_LEVELS
    steps = np.diff(cells, axis=0)
    is_first = np.ones(len(cells), np.bool_)
    is_first[1:] = (steps[:, 0] | steps[:, 1] | steps[:, 2]) != 0
    places = 64 * (np.cumsum(is_first) - 1) + 8 * _octants(tier.cells) + _octants(tier.cells >> 1)
    cells = cells[is_first]
    extents = cell_extents(cells, level + TIER_LEVELS, plan.pyramid.volume.shape_xyz)

    nodes = room_for_nodes(len(cells), plan.num_error_channels)
    kernels().merge_tier(
        means=tier.means, error_means=tier.error_means, variances=tier.variances, places=places, extents=extents,
        side=1 << level, nodes=nodes,
    )  # fmt: skip
    stored = []
    for part in (1, 2):
        target = Level.empty(int(nodes.counts[part]), plan.dtype, masked=True)
        stored.append(_store_visible(plan, nodes, part, target))
    return _Tier(cells, *nodes[-3:]), stored


def _octants(cells: Int64) -> Int64:
    """Return which child of its parent each cell is, int64 [n]."""
    return cells[:, 0] & 1 | (cells[:, 1] & 1) << 1 | (cells[:, 2] & 1) << 2


def _store_visible(plan: _Plan, nodes: VisibleNodes, part: int, target: Level) -> Level:
    """Write the visible nodes of one level of groups to the beginning of `target`; return that part of it."""
    found = nodes_of_level(nodes, part)
    means, target = nodes.means[found], target.part(0, found.stop - found.start)
    target.masks[:] = nodes.masks[found][: len(target.masks)]
    if plan.pyramid.max_depth is not None:
        opacities_to_depths(means, plan.pyramid.max_depth)
    store_scaled(means, 1 / plan.pyramid.mean_unit, target.means)
    store_scaled(nodes.deviations[found], plan.error_factor, target.errors)
    return target


def _link_children(level: Level) -> Level:
    """Return the level with the index of each node's first child: children are in the order of their parents."""
    num_children = np.bitwise_count(level.masks).astype(np.int64)
    level = level._replace(first_children=np.cumsum(num_children) - num_children)
    for array in level:
        array.flags.writeable = False
    return level
