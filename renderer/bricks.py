"""Bricks: cubes of BRICK^3 cells of one level of the pyramid, what the integrated footprint cuts and draws.

A brick of level l is a node of level l + BRICK_LEVELS of the octree, filled with the nodes of level l in it; one of
level 0 is filled with voxels. Between the centres of its cells the field is linear, as it is between those of this
brick and those of its neighbours at the same level, whatever is drawn there: the apron.

    level 0     the scalar, classified after it is interpolated
    above       the means of (tau c, tau), which may be interpolated for they were classified before
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer import brick_kernels as kernels
from renderer.brick_kernels import APRON, BRICK, BRICK_LEVELS
from renderer.classify import FAINTEST, voxel_codes
from renderer.octree import cell_sizes, children, node_errors
from renderer.pyramid import STORED_MAXIMUM, Pyramid
from renderer.transfer import TransferFunction
from renderer.volume import Volume

__all__ = [
    "APRON",
    "BRICK",
    "BRICK_LEVELS",
    "ERRORS_ON_A_RAY",
    "BrickCut",
    "BrickLevel",
    "Bricks",
    "cut_bricks",
    "make_bricks",
    "num_bricks_at",
]

Array = npt.NDArray[Any]
Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]

# Errors of the cells that a ray meets in a brick add up, at random to as many times that of one.
ERRORS_ON_A_RAY = math.sqrt(BRICK)

# Bricks of one task: enough to hide the dispatch, few enough that what is known of their nodes takes little memory.
_BRICKS_PER_TASK = 64


@dataclass(frozen=True)
class BrickLevel:
    """All bricks of one level, those that show nothing, too.

    boxes: float32 [z, y, x, 2, 3], lowest and highest corner (x, y, z), in cells from the brick's own lowest corner
        (0 to BRICK), of what may be seen in the brick: where the field, its apron included, is not transparent. Corners
        lie at cells' centres (k + 1/2) or at the brick's faces or the volume's. The highest is not above the lowest
        where nothing is.
    errors: float64 [z, y, x], what the brick may put wrong into a pixel, in the measure's unit: ERRORS_ON_A_RAY times
        the largest error of the nodes of this level in it and in its apron. On level 0 the largest possible error of a
        voxel where interpolation shows what no voxel does, and no node is wrong by anything; otherwise 0. Above, that
        of all bricks of level 0 in it.
    roughness: float64 [z, y, x], root of the mean square over the brick's volume of the errors of the nodes one level
        *above*: what cells twice as large would put wrong. Where that is 0 the largest of the neighbours, which may be
        seen in the apron, or `errors`, if on level 0.
    slots: int32 [z, y, x], place of the brick in `means`, -1 where all of them are 0; empty on level 0.
    means: float16 or float32 [n, BRICK, BRICK, BRICK, 4], cells in the order (z, y, x), stored units; empty on level 0.
    """

    boxes: npt.NDArray[np.float32]
    errors: Float64
    roughness: Float64
    slots: Int32
    means: npt.NDArray[np.float16] | npt.NDArray[np.float32]


@dataclass(frozen=True)
class Bricks:
    """levels[l] holds the bricks of level l; the last one is a single brick.

    scalar_range: what texels of level 0 are relative to: scalars at the ends of the transfer function's table. The part
        of the control values' range that the volume reaches, or all that it has where it reaches none.
    volume_range: the volume's smallest and largest scalar.
    """

    levels: tuple[BrickLevel, ...]
    pyramid: Pyramid
    transfer: TransferFunction
    scalar_range: tuple[float, float]
    volume_range: tuple[float, float]

    @property
    def volume(self) -> Volume:
        """What the bricks are of."""
        return self.pyramid.volume


@dataclass(frozen=True)
class BrickCut:
    """The bricks drawn, coarse levels first, in Morton order within a level: a brick's place is its id.

    levels: uint8 [n], of their cells. cells: int32 [n, 3], x, y, z in units of the brick's own width, BRICK << level
        voxels.
    boxes: float64 [n, 2, 3], lowest and highest corner (x, y, z) of what may be seen, in index coordinates.
    roughness: float64 [n], as in BrickLevel.
    volume: the volume that was cut.
    """

    levels: npt.NDArray[np.uint8]
    cells: Int32
    boxes: Float64
    roughness: Float64
    volume: Volume

    def __len__(self) -> int:
        return len(self.levels)


def make_bricks(pyramid: Pyramid, transfer: TransferFunction, *, num_threads: int = 2) -> Bricks:
    """The bricks of all levels of a pyramid that is complete; the result does not depend on `num_threads`.

    Raises ValueError where the pyramid was built for some tolerances, or levels, only.
    """
    if pyramid.least_tolerance > 0 or pyramid.finest_level > 0:
        only_for = f"tolerances from {pyramid.least_tolerance} and levels from {pyramid.finest_level} on"
        raise ValueError(f"no bricks of a part of a pyramid: got one for {only_for}, expected one for all")
    values = pyramid.volume.values
    volume_range = float(values.min()), float(values.max())
    num_levels = max(1, pyramid.num_levels - BRICK_LEVELS + 1)
    trees = _trees(pyramid)
    nodes = [_gather(pyramid, number, trees, num_threads) for number in range(1, num_levels + 1)]
    levels = [_level_of_voxels(pyramid, transfer, nodes[0].roughness_below, num_threads)]
    unseen = levels[0].errors
    for gathered in nodes[: num_levels - 1]:
        unseen = _largest_of_children(unseen)
        np.maximum(ERRORS_ON_A_RAY * gathered.largest, unseen, out=gathered.largest)
    levels += [
        _level_of_nodes(pyramid, number, nodes[number - 1], nodes[number].roughness_below, num_threads)
        for number in range(1, num_levels)
    ]
    return Bricks(tuple(levels), pyramid, transfer, _scalar_range(transfer, *volume_range), volume_range)


def cut_bricks(bricks: Bricks, tolerance: float, *, finest_level: int = 0) -> BrickCut:
    """The coarsest bricks whose errors are below `tolerance` (in the measure's unit); none of a level below
    `finest_level`. Bricks in which their own level shows nothing are left out.

    Errors are those of the voxels' colours: what shows only between voxels, such as a peak of the transfer function
    that no voxel hits, asks for level 0 where it is alone in its brick, but counts for nothing beside what voxels show.

    Raises ValueError where either is below 0.
    """
    parts = list(_leaves(bricks, tolerance, finest_level))
    counts = [len(cells) for _, cells in parts]
    levels = np.repeat(np.array([level for level, _ in parts], np.uint8), counts)
    cells = np.concatenate([cells for _, cells in parts])
    boxes, roughness = np.empty((len(cells), 2, 3)), np.empty(len(cells))
    for (number, part), end in zip(parts, np.cumsum(counts).tolist(), strict=True):
        where, level = slice(end - len(part), end), bricks.levels[number]
        kernels.copy_bricks(part, level.boxes, level.roughness, 2.0**number, boxes[where], roughness[where])
    for array in (levels, cells, boxes, roughness):
        array.flags.writeable = False
    return BrickCut(levels, cells, boxes, roughness, bricks.volume)


def num_bricks_at(bricks: Bricks, tolerance: float, finest_level: int) -> int:
    """How many bricks such a cut has."""
    return sum(len(cells) for _, cells in _leaves(bricks, tolerance, finest_level))


def _leaves(bricks: Bricks, tolerance: float, finest_level: int) -> Iterator[tuple[int, Int32]]:
    """Each level, coarse first, and the cells int32 [n, 3] of the bricks that are drawn of it."""
    if not tolerance >= 0:
        raise ValueError(f"no bricks for this tolerance: got {tolerance}, expected at least 0")
    if finest_level < 0:
        raise ValueError(f"no bricks of this level: got {finest_level}, expected at least 0")
    cells = np.zeros((1, 3), np.int32)
    for number in range(len(bricks.levels) - 1, -1, -1):
        level = bricks.levels[number]
        below = bricks.levels[max(number - 1, 0)].errors.shape
        drawn, divided = np.empty_like(cells), np.empty((8 * len(cells), 3), np.int32)
        num_drawn, num_divided = kernels.divide_bricks(
            cells,
            level.errors,
            level.boxes,
            tolerance if number > finest_level else math.inf,
            below,
            drawn,
            divided,
        )
        yield number, drawn[:num_drawn]
        cells = divided[:num_divided]


def _scalar_range(transfer: TransferFunction, low: float, high: float) -> tuple[float, float]:
    """As in Bricks, of a volume from `low` to `high`; never a single number.

    Where the volume is outside of all control values its own range will do: the classification is constant there.
    """
    first, last = max(low, float(transfer.values[0])), min(high, float(transfer.values[-1]))
    if not first < last:
        first, last = low, high
    if first < last:
        return first, last
    width = max(1.0, abs(low))  # towards 0, so that neither end overflows
    return (low - width, low) if low > 0 else (low, low + width)


def _visibility_flips(transfer: TransferFunction, finest_spacing: float) -> Float64:
    """float64 [m], ascending: where visibility changes; of visible scalars an odd number is at or below.

    A slope that rises from nothing begins to show at the next number, so that what lies at its foot is not seen. Of a
    step the upper side has the value. Two changes at one scalar are none.
    """
    values, is_shown = transfer.values, transfer.extinctions * finest_spacing >= FAINTEST
    flips = [-math.inf] if is_shown[0] else []
    for k in np.flatnonzero(is_shown[1:] != is_shown[:-1]):
        start, end = float(values[k]), float(values[k + 1])
        low, high = transfer.extinctions[k : k + 2] * finest_spacing
        share = float((FAINTEST - low) / (high - low))
        crossing = start * (1 - share) + end * share
        flips.append(min(max(crossing, math.nextafter(start, math.inf)), end))
    different, counts = np.unique(np.array(flips, np.float64), return_counts=True)
    return np.asarray(different[counts % 2 == 1])


def _trees(pyramid: Pyramid) -> dict[int, Int32]:
    """By level, the cells int32 [n, 3] of all visible nodes that are bricks, and of the root: in Morton order."""
    cells = np.zeros((len(pyramid.levels[-1].errors), 3), np.int32)
    trees = {pyramid.num_levels: cells}
    for number in range(pyramid.num_levels, BRICK_LEVELS, -1):
        level = pyramid.levels[number - 1]
        _, cells = children(np.arange(len(cells)), cells, level.masks, level.first_children)
        trees[number - 1] = cells
    return trees


class _Gathered(NamedTuple):
    """What the nodes of one level add up to: largest, slots, means as in the BrickLevel that they fill; roughness of
    the bricks of the level below."""

    largest: Float64
    roughness_below: Float64
    slots: Int32
    means: Array


def _gather(pyramid: Pyramid, number: int, trees: dict[int, Int32], num_threads: int) -> _Gathered:
    """Of the nodes of level `number`, brick by brick."""
    top = min(number + BRICK_LEVELS, pyramid.num_levels)
    bricks = trees[top]
    shape, shape_below = _grid(pyramid.volume, number), _grid(pyramid.volume, number - 1)
    slots = np.full(shape, -1, np.int32)
    x, y, z = bricks.T >> (number + BRICK_LEVELS - top)
    slots[z, y, x] = np.arange(len(bricks))
    means = np.zeros((len(bricks), BRICK, BRICK, BRICK, 4), pyramid.levels[0].means.dtype)
    largest_near, largest_below = np.zeros((*shape, 3, 3, 3)), np.zeros(shape_below)
    squares_below = np.zeros(shape_below)

    def work(part: slice) -> None:
        cells, nodes = bricks[part], np.arange(part.start, part.stop)
        for above in range(top, number, -1):
            level = pyramid.levels[above - 1]
            nodes, cells = children(nodes, cells, level.masks, level.first_children)
        errors = node_errors(pyramid, nodes, cells, number)
        sizes = cell_sizes(cells, number, pyramid.volume)
        kernels.gather_largest_near(errors, cells, largest_near)
        kernels.gather_largest(errors, cells, BRICK_LEVELS - 1, largest_below)
        kernels.gather_squares(errors, sizes, cells, BRICK_LEVELS - 1, largest_below, squares_below)
        kernels.scatter(_items(pyramid.levels[number - 1].means[nodes]), cells, slots, _items(means))

    _in_threads(work, _parts(len(bricks)), num_threads)
    sizes_below = cell_sizes(_places(shape_below), number - 1 + BRICK_LEVELS, pyramid.volume).reshape(shape_below)
    roughness = largest_below * np.sqrt(squares_below / sizes_below)
    roughness = np.where(roughness > 0, roughness, _largest_around(roughness))
    return _Gathered(_largest_with_apron(largest_near), roughness, slots, means)


def _largest_with_apron(near: Float64) -> Float64:
    """float64 [z, y, x]: the largest of each brick and of what its neighbours have in its apron, `near` [z, y, x, 3, 3,
    3] as of `gather_largest_near`."""
    largest = np.zeros(near.shape[:3])
    for at, neighbours in _neighbours(near):
        np.maximum(largest, neighbours[..., 2 - at[0], 2 - at[1], 2 - at[2]], out=largest)
    return largest


def _largest_of_children(of_brick: Float64) -> Float64:
    """float64 [z, y, x]: the largest of the up to eight bricks of the level below."""
    for axis in range(3):
        of_brick = np.maximum.reduceat(of_brick, np.arange(0, of_brick.shape[axis], 2), axis)
    return of_brick


def _largest_around(of_brick: Float64) -> Float64:
    """float64 [z, y, x]: the largest of each brick and its neighbours."""
    return np.asarray(np.max([neighbours for _, neighbours in _neighbours(of_brick)], axis=0))


def _neighbours(of_brick: Float64) -> Iterator[tuple[tuple[int, ...], Float64]]:
    """Places 0 to 2 along z, y, x of neighbours at -1, 0 and 1, the brick itself among them, and what each brick of
    [z, y, x, ...] has there, 0 beyond the border."""
    shape = of_brick.shape[:3]
    padded = np.pad(of_brick, [(1, 1)] * 3 + [(0, 0)] * (of_brick.ndim - 3))
    for at in np.ndindex(3, 3, 3):
        yield at, padded[tuple(slice(k, k + n) for k, n in zip(at, shape, strict=True))]


def _level_of_voxels(pyramid: Pyramid, transfer: TransferFunction, roughness: Float64, num_threads: int) -> BrickLevel:
    volume = pyramid.volume
    flips = _visibility_flips(transfer, volume.finest_spacing)
    codes, scalars = voxel_codes(volume), pyramid.classifier.scalars
    numbers = None if scalars is None else np.searchsorted(flips, scalars, side="right").astype(np.uint32)
    places = _places(roughness.shape)
    boxes, is_mixed = np.zeros((*roughness.shape, 2, 3), np.float32), np.zeros(roughness.shape, np.uint8)

    def work(part: slice) -> None:
        kernels.voxel_boxes(codes, numbers, flips, places[part], boxes, is_mixed)

    _in_threads(work, _parts(len(places)), num_threads)
    # A little above what any channel of a voxel can be.
    unseen = np.where((is_mixed > 0) & (roughness == 0), pyramid.error_unit * STORED_MAXIMUM, 0.0)
    slots, means = np.empty((0, 0, 0), np.int32), np.empty((0, BRICK, BRICK, BRICK, 4), np.float32)
    return _frozen(BrickLevel(boxes, unseen, roughness + unseen, slots, means))


def _level_of_nodes(
    pyramid: Pyramid, number: int, nodes: _Gathered, roughness: Float64, num_threads: int
) -> BrickLevel:
    places = _places(roughness.shape)
    boxes = np.zeros((*roughness.shape, 2, 3), np.float32)
    extents = np.array(pyramid.volume.shape_xyz) / 2.0**number
    depths = nodes.means[..., 3]
    visible = depths.view(np.uint16) if depths.dtype == np.float16 else depths

    def work(part: slice) -> None:
        kernels.mean_boxes(visible, nodes.slots, extents, places[part], boxes)

    _in_threads(work, _parts(len(places)), num_threads)
    return _frozen(BrickLevel(boxes, nodes.largest, roughness, nodes.slots, nodes.means))


def _frozen(level: BrickLevel) -> BrickLevel:
    for array in (level.boxes, level.errors, level.roughness, level.slots, level.means):
        array.flags.writeable = False
    return level


def _grid(volume: Volume, number: int) -> tuple[int, int, int]:
    """How many bricks of a level there are along z, y, x."""
    z, y, x = (((num - 1) >> (number + BRICK_LEVELS)) + 1 for num in volume.values.shape)
    return z, y, x


def _places(shape: tuple[int, ...]) -> Int32:
    """int32 [n, 3]: all cells (x, y, z) of a grid [z, y, x], x fastest."""
    return np.ascontiguousarray(np.indices(shape, np.int32).reshape(3, -1)[::-1].T)


def _items(means: Array) -> Array:
    """[..., 4] as [...] items that are moved as one; a view."""
    return means.view(np.uint64 if means.dtype == np.float16 else np.complex128)[..., 0]


def _parts(num: int) -> list[slice]:
    return [slice(start, min(start + _BRICKS_PER_TASK, num)) for start in range(0, num, _BRICKS_PER_TASK)]


def _in_threads(work: Callable[[slice], None], parts: Iterable[slice], num_threads: int) -> None:
    rest = iter(parts)

    def work_on(_: int) -> None:
        for part in rest:  # shared: each thread takes the next one when it is ready
            work(part)

    with ThreadPoolExecutor(num_threads) as pool:
        try:
            list(pool.map(work_on, range(num_threads)))
        finally:  # interrupted, or failed in one thread: leave nothing to the others
            deque(rest, maxlen=0)
