"""Build the pyramid, level by level, from the voxels.

Several threads build blocks of 8^3 voxels, which gives levels 1 to 3. Then each tier of groups of 64 nodes gives two
more levels (see `renderer.pyramid.nodes`). The first tier is built together with its blocks, so that little of a large
volume has to be kept until all blocks are built.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from renderer.kernels import BrickSums, Classifier, LightGrid, StreamedLevel, ThreadPool, VisibleNodes, kernels
from renderer.pyramid.nodes import (
    BLOCK_SIZE,
    NODES_OF_GROUP,
    nodes_of_level,
    opacities_to_depths,
    room_for_nodes,
    store_scaled,
)
from renderer.pyramid.pyramid import (
    EVERY_CUT,
    FinestCut,
    Level,
    Pyramid,
    Shape,
    cell_extents,
    error_scale,
    subdivide,
)
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import (
    NO_LIGHT_GRID,
    VISIBILITY_THRESHOLD,
    TransferFunction,
    make_classifier,
    raw_voxels,
)
from renderer.volume import Array, Bools, Float32, Float64, Int64, Volume

# The number of levels of the pyramid inside a block of 8^3 voxels: levels 1 to 3.
BLOCK_LEVELS = 3

# The octree level of the cubes, of 64^3 voxels, that are built as a whole by one task, so that no two tasks have nodes
# in the same brick of levels 0 to 2.
CUBE_LEVELS = 6
# The largest number of blocks that one task builds: enough to hide the time to start the task, and few enough that the
# blocks' nodes take little memory.
BLOCKS_PER_TASK = 2048

# The largest number of cells along an axis of the grid of visible cells (`Pyramid.occupied`), by which the camera
# frames a volume.
MAX_OCCUPANCY_SIDE = 128

# Means are stored in a unit in which the largest possible mean is at most this number. float16 then holds numbers down
# to 8 decades below the largest mean at its full 11 bits (normal numbers of float16 go down to 2^-14).
MAX_STORED_MEAN = 2.0**15

# Scalars in a smaller range than this are stored in the unit of this range: the inverse of the unit is then finite, and
# squares of the smallest denormal numbers are normal.
MIN_SCALAR_RANGE = 2.0**-1008

# The number of levels that each tier of groups of 64 nodes adds to the pyramid above the blocks.
TIER_LEVELS = 2

# The number of levels, from level 1 on, that the pyramid of a volume drawn as bricks does not store. Their nodes are
# added to statistics of bricks as they are built.
STREAMED_LEVELS = 2

# The bound of the cuts of a pyramid that does not store the streamed levels.
_FINEST_STREAMED = FinestCut(level=STREAMED_LEVELS + 1)
# The arrays of a level that are kept for later processes; the indices of first children follow from the masks.
_KEPT_OF_LEVEL = ("means", "errors", "masks")

# The factor on a tolerance that allows for the rounding of stored errors: an error below the product is also below the
# tolerance once it is rounded.
ROUNDING_MARGIN = 1 - 2.0**-9
# A bound of the rounding errors of node errors that are stored as denormal float16 numbers, in stored units.
MAX_STORED_ROUNDING = 2.0**-24


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
    streamed: Sequence[BrickSums] = (),
    ranges: Float64 | None = None,
) -> Pyramid:
    """Build all levels of the pyramid in one pass over the voxels. The result does not depend on `num_threads`.

    light_grid: the light that reaches each place, for the shading.
    finest_cut: the bound of the cuts that will be made.
    streamed: statistics to which the visible nodes of the levels up to STREAMED_LEVELS are added, one for each level;
        these nodes are then not stored.
    ranges: float64 [z, y, x, 2], bounds of the scalars in bricks of level 0 and their halo, if they are known: voxels
        that show nothing by them are not read.

    Raises InputError if the volume's file was changed.
    """
    num_levels = max(BLOCK_LEVELS if streamed else 1, (max(volume.shape_xyz) - 1).bit_length())
    finest_cut = _FINEST_STREAMED if streamed else finest_cut
    plan = replace(_plan_build(volume, transfer, spec, error, (shading, light_grid), finest_cut), ranges=ranges)
    if streamed:
        plan = replace(plan, streamed=_streamed_levels(plan, streamed))
    else:
        plan = replace(plan, leaf_variance_limits=_leaf_variance_limits(plan, num_levels))
    tier, stored = _build_all_blocks(plan, num_threads)
    while len(stored) < num_levels:
        tier, levels = _next_tier(plan, tier, len(stored))
        stored += levels
    linked = tuple(_link_children(nodes) for nodes in stored[:num_levels])
    return replace(plan.pyramid, levels=linked)


def pyramid_arrays(pyramid: Pyramid) -> dict[str, Array]:
    """Return arrays from which `restore_pyramid` makes a pyramid of streamed levels again."""
    arrays: dict[str, Array] = {"occupied": pyramid.occupied}
    for number, level in enumerate(pyramid.levels, 1):
        arrays |= {f"{name}_{number}": getattr(level, name) for name in _KEPT_OF_LEVEL}
    return arrays


def restore_pyramid(
    arrays: Mapping[str, Array],
    volume: Volume,
    transfer: TransferFunction,
    *,
    spec: PyramidSpec,
    error: ErrorSpec,
    shading: ShadingSpec | None = None,
    light_grid: LightGrid = NO_LIGHT_GRID,
) -> Pyramid:
    """Return the pyramid that `build_pyramid` made of the same volume and options, with streamed levels.

    arrays: as `pyramid_arrays` returned them. No voxels are read.
    """
    plan = _plan_build(volume, transfer, spec, error, (shading, light_grid), _FINEST_STREAMED)
    levels = []
    for number in itertools.count(1):
        if f"means_{number}" not in arrays:
            break
        of_level = {name: arrays[f"{name}_{number}"] for name in _KEPT_OF_LEVEL}
        levels.append(_link_children(Level(**of_level, first_children=np.empty(0, np.int64))))
    return replace(plan.pyramid, levels=tuple(levels), occupied=arrays["occupied"])


@dataclass(frozen=True)
class _Plan:
    """A plan of a build: the data that all its tasks share.

    pyramid: the pyramid, without its levels.
    error_classifier: the classifier of the channels that errors are measured on; None if these channels are averaged,
        too, or if errors are measured on scalars.
    normalization: float64 [2], the offset and the scale of the scalars that errors are measured on; None for channels.
    error_factor: the factor from the root of a variance to an error in stored units.
    dtype: the dtype in which means and errors are stored.
    leaf_variance_limits: the variances below which nodes of level 2, and of level 3, are leaves in every cut.
    streamed: the levels whose nodes are added to statistics and not stored, from level 1 on.
    ranges: as in `build_pyramid`.
    """

    pyramid: Pyramid
    error_classifier: Classifier | None
    normalization: Float64 | None
    error_factor: float
    dtype: type[np.float16] | type[np.float32]
    leaf_variance_limits: tuple[float, float] = (0.0, 0.0)
    streamed: tuple[StreamedLevel, ...] = ()
    ranges: Float64 | None = None

    @property
    def num_error_channels(self) -> int:
        """Return the number of channels that errors are measured on."""
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


def _streamed_levels(plan: _Plan, streamed: Sequence[BrickSums]) -> tuple[StreamedLevel, ...]:
    """Return the levels whose nodes are added to statistics, with the numbers by which kernels round as if they stored.

    The largest mean depth that rounds to 0 is half of the smallest number above 0 that can be stored.
    """
    pyramid = plan.pyramid
    most_invisible = pyramid.mean_unit * float(np.finfo(plan.dtype).smallest_subnormal) / 2
    if pyramid.max_depth is not None:
        most_invisible = -math.expm1(-most_invisible)

    def scales(level: int) -> Float64:
        nums = np.arange(8**level + 1)
        return np.full(len(nums), error_scale(pyramid.volume, pyramid.measure, nums) * pyramid.error_unit)

    is_half = plan.dtype == np.float16
    return tuple(
        StreamedLevel(sums, plan.error_factor, is_half, scales(level), most_invisible)
        for level, sums in enumerate(streamed, 1)
    )


def _leaf_variance_limits(plan: _Plan, num_levels: int) -> tuple[float, float]:
    """Return the total variances of nodes of levels 2 and 3 below which their errors are below any tolerance in use.

    The limits are computed for whole cells. Cells that the border cuts are smaller, and have smaller errors.
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

    The offset is a multiple of the last place of the largest scalar, so that a scalar less the offset is a multiple of
    the scalar's own last place, and no larger than the scalar.
    """
    if low <= 0.0 <= high:
        return 0.0
    near, far = sorted((low, high), key=abs)
    return near - math.fmod(near, math.ulp(far))


def _stored_unit(largest: float) -> float:
    """Return the unit in which `largest` is at most MAX_STORED_MEAN: a power of two, so that scaling rounds nothing."""
    return math.ldexp(1 / MAX_STORED_MEAN, math.frexp(max(largest, MIN_SCALAR_RANGE))[1])


def _tasks(shape_xyz: Shape) -> tuple[list[Int64], list[int]]:
    """Return the cubes of each task, in Morton order, and the number of blocks before each task and in all tasks.

    The cubes of a task are int64 [n, 3], places (x, y, z) in units of a cube's side.
    """
    top = max(CUBE_LEVELS, (max(shape_xyz) - 1).bit_length())
    cubes = subdivide(np.zeros((1, 3), np.int64), top, CUBE_LEVELS, shape_xyz)
    nums = (-(-cell_extents(cubes, CUBE_LEVELS, shape_xyz) // BLOCK_SIZE)).prod(axis=1)
    starts = range(0, len(cubes), max(1, BLOCKS_PER_TASK // int(nums.max())))
    return np.split(cubes, starts[1:]), [0, *np.add.reduceat(nums, starts).cumsum().tolist()]


class _Tier(NamedTuple):
    """A list of all nodes of one level, from which the next tier is made.

    cells: int64 [n, 3], the places (x, y, z) of the nodes, in units of their width.
    means: float32 [n, 4], the means of the nodes' channels.
    error_means, variances: float64 [n, c], the means and variances in the channels that errors are measured on.
    """

    cells: Int64
    means: Float32
    error_means: Float64
    variances: Float64


class _BuildBlocks(Protocol):
    """A function that builds the nodes of some blocks: the kernel `build_blocks`, with all other arguments given."""

    def __call__(self, *, starts: Int64, extents: Int64, visible: Bools) -> None: ...


class _Scratch(NamedTuple):
    """A task's memory for its nodes, and the kernel that fills the memory.

    The next task uses the memory again: new memory from the system would take more time than the arithmetic.
    """

    nodes: VisibleNodes
    build: _BuildBlocks


def _make_scratch(plan: _Plan, num_blocks: int) -> _Scratch:
    nodes = room_for_nodes(num_blocks, plan.num_error_channels)
    build = kernels().build_blocks.partial(
        raw=raw_voxels(plan.pyramid.volume), classifier=plan.pyramid.mean_classifier,
        error_classifier=plan.error_classifier, ranges=plan.ranges, normalization=plan.normalization,
        leaf_variance_limits=np.array(plan.leaf_variance_limits), occupied=plan.pyramid.occupied,
        occupied_level=plan.pyramid.occupied_level, streamed=plan.streamed, nodes=nodes,
    )  # fmt: skip
    return _Scratch(nodes, build)


def _build_all_blocks(plan: _Plan, num_threads: int) -> tuple[_Tier, list[Level]]:
    """Build the levels inside blocks, task by task, and the two levels above them.

    Return the uppermost level as a tier, and all levels as they are stored. Levels inside blocks are first written to
    arrays for all nodes, visible or not, and compacted when the number of visible nodes is known.
    """
    volume = plan.pyramid.volume
    cubes, first_blocks = _tasks(volume.shape_xyz)
    inside = [
        Level.empty(0 if k < len(plan.streamed) else first_blocks[-1] * num, plan.dtype, masked=k > 0)
        for k, num in enumerate(NODES_OF_GROUP)
    ]
    most = int(np.diff(first_blocks).max())
    scratches = [_make_scratch(plan, most) for _ in range(num_threads)]

    def work(task: int) -> tuple[list[Level], _Tier, list[Level]]:
        volume.require_unchanged()
        first, end = first_blocks[task : task + 2]
        targets = [level.part(first * num, end * num) for level, num in zip(inside, NODES_OF_GROUP, strict=True)]
        scratch = scratches.pop()  # no other thread uses this memory until it is given back
        stored, roots = _build_blocks(plan, cubes[task], targets, scratch)
        scratches.append(scratch)
        return stored, *_next_tier(plan, roots, BLOCK_LEVELS)

    def compact(array: Array, parts: list[Array]) -> None:
        """Move the parts of an array to its beginning, and cut off the remainder."""
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
    """Build the levels inside the blocks of one task.

    Returns, for each level, the part of `targets` to which its visible nodes are stored; and the roots of the blocks,
    from which the next tier is made. targets: for each level, the part of its arrays for the blocks of the task.
    """
    shape_xyz = plan.pyramid.volume.shape_xyz
    cells = subdivide(cubes, CUBE_LEVELS, BLOCK_LEVELS, shape_xyz)
    extents, visible = cell_extents(cells, BLOCK_LEVELS, shape_xyz), np.empty(len(cells), np.bool_)
    scratch.build(starts=cells * BLOCK_SIZE, extents=extents, visible=visible)
    stored = [_store_visible(plan, scratch.nodes, part, targets[part]) for part in range(BLOCK_LEVELS)]
    roots = (array[: np.count_nonzero(visible)].copy() for array in scratch.nodes[-3:])
    return stored, _Tier(cells[visible], *roots)


def _next_tier(plan: _Plan, tier: _Tier, level: int) -> tuple[_Tier, list[Level]]:
    """Build the two levels above `level`; return the upper one as a tier, and both levels as they are stored.

    tier: the nodes of `level`, in Morton order.
    """
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
    """Return the number of each cell among the children of its parent, 0 to 7: int64 [n]."""
    return cells[:, 0] & 1 | (cells[:, 1] & 1) << 1 | (cells[:, 2] & 1) << 2


def _store_visible(plan: _Plan, nodes: VisibleNodes, part: int, target: Level) -> Level:
    """Write the visible nodes of one level of groups to the beginning of `target`, and return this part of `target`.

    part: the level in the groups of 73 nodes, 0 for the lowest.
    """
    found = nodes_of_level(nodes, part)
    means, target = nodes.means[found], target.part(0, found.stop - found.start)
    target.masks[:] = nodes.masks[found][: len(target.masks)]
    if plan.pyramid.max_depth is not None:
        opacities_to_depths(means, plan.pyramid.max_depth)
    store_scaled(means, 1 / plan.pyramid.mean_unit, target.means)
    store_scaled(nodes.deviations[found], plan.error_factor, target.errors)
    return target


def _link_children(level: Level) -> Level:
    """Return a level with the index of each node's first child. Children are in the order of their parents."""
    num_children = np.bitwise_count(level.masks).astype(np.int64)
    level = level._replace(first_children=np.cumsum(num_children) - num_children)
    for array in level:
        array.flags.writeable = False
    return level
