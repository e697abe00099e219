"""Bricks: cubes of BRICK_SIZE^3 cells of one level of the pyramid, what the integrated footprint cuts and draws.

A brick of level l is a node of level l + BRICK_LEVELS of the octree, filled with the nodes of level l in it; one of
level 0 is filled with voxels. Between the centres of its cells the field is linear, as it is between those of this
brick and those of its neighbours at the same level, whatever is drawn there: the apron.

    level 0     the scalar, classified after it is interpolated
    above       the means of (tau c, tau), which may be interpolated for they were classified before
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.bricks import kernels
from renderer.bricks.kernels import BRICK_LEVELS, BRICK_SIZE, HALO
from renderer.bricks.node_statistics import NodeStatistics, StreamedNodeStatistics, brick_grid_shape, grid_cells
from renderer.bricks.subvoxel import make_polyline, make_scalar_polyline, measure_subvoxel_variation
from renderer.pyramid import Pyramid, build_pyramid, error_scale, node_errors, visible_children
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.threads import ThreadPool
from renderer.transfer import (
    MAX_NORMALIZED_SCALAR,
    VISIBILITY_THRESHOLD,
    PiecewiseTransfer,
    TransferFunction,
    make_piecewise_transfer,
    raw_voxels,
)
from renderer.volume import Volume

__all__ = [
    "BRICK_LEVELS",
    "BRICK_SIZE",
    "HALO",
    "RAY_ERROR_FACTOR",
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

# Errors of the cells that a ray meets, in so many bricks, add up: at random, to the root of their number times that of
# one. With one brick it takes 1.2 times as long to come to 42 or 45 dB, the mean of 10 volumes, and 1.0 times to others
# from 30 to 52: cells err more than steps do then.
BRICKS_PER_RAY = 4
RAY_ERROR_FACTOR = math.sqrt(BRICKS_PER_RAY * BRICK_SIZE)

# Bricks of one task: enough to hide the dispatch, few enough that what is known of their nodes takes little memory.
_BRICKS_PER_TASK = 64
# What the range of texels is at least, of the control values', or of the volume's if there is one only: shares of it
# that are interpolated have to have digits, and are held to MAX_NORMALIZED_SCALAR, which moves what lies between two
# beyond it.
_MIN_RANGE_SHARE = 1 / 64


@dataclass(frozen=True)
class BrickLevel:
    """All bricks of one level, those that show nothing, too.

    visible_bounds: float32 [z, y, x, 2, 3], lowest and highest corner (x, y, z), in cells from the brick's own lowest
    corner
        (0 to BRICK_SIZE), of what may be seen in the brick: where the field, its apron included, is not transparent.
        Corners lie at cells' centres (k + 1/2) or at the brick's faces or the volume's. The highest is not above the
        lowest where nothing is.
    errors: float64 [z, y, x], what the brick may put wrong into a pixel, in the measure's unit: RAY_ERROR_FACTOR times
        the largest error of the nodes of this level in it and in its apron, or of what shows between the voxels in it
        only, or of a difference between them (`renderer.bricks.subvoxel`), along a way as long as such a node. 0 on
        level 0, which shows all of it.
    step_errors: float64 [z, y, x], root of the mean square over the brick's volume of the errors of the nodes one level
        *above*: what cells twice as large would put wrong. Where that is 0 the largest of the neighbours, which may be
        seen in the apron. On level 0 the squares of what shows between voxels only, along a way as long, are added. At
        least that of the differences between voxels, along such a way.
    slots: int32 [z, y, x], place of the brick in `means`, -1 where all of them are 0; empty up to STREAMED_LEVELS.
    means: float16 or float32 [n, BRICK_SIZE, BRICK_SIZE, BRICK_SIZE, 4], cells in the order (z, y, x), stored units;
    empty up to
        STREAMED_LEVELS, where they are made when they are drawn (`renderer.bricks.means`).
    """

    visible_bounds: npt.NDArray[np.float32]
    errors: Float64
    step_errors: Float64
    slots: Int32
    means: npt.NDArray[np.float16] | npt.NDArray[np.float32]


@dataclass(frozen=True)
class Bricks:
    """levels[l] holds the bricks of level l; the last one is a single brick.

    scalar_range: what texels of level 0 are relative to. The part of the volume's range in which the transfer function
        changes, or all of it where it does not.
    volume_range: the volume's smallest and largest scalar.
    pieces: the transfer function by the scalars of texels.
    """

    levels: tuple[BrickLevel, ...]
    pyramid: Pyramid
    transfer: TransferFunction
    scalar_range: tuple[float, float]
    volume_range: tuple[float, float]
    pieces: PiecewiseTransfer

    @property
    def volume(self) -> Volume:
        """What the bricks are of."""
        return self.pyramid.volume


@dataclass(frozen=True)
class BrickCut:
    """The bricks drawn, coarse levels first, in Morton order within a level: a brick's place is its id.

    levels: uint8 [n], of their cells. cells: int32 [n, 3], x, y, z in units of the brick's own width, BRICK_SIZE <<
    level
        voxels.
    visible_bounds: float64 [n, 2, 3], lowest and highest corner (x, y, z) of what may be seen, in index coordinates.
    step_errors: float64 [n], as in BrickLevel.
    volume: the volume that was cut.
    """

    levels: npt.NDArray[np.uint8]
    cells: Int32
    visible_bounds: Float64
    step_errors: Float64
    volume: Volume

    def __len__(self) -> int:
        return len(self.levels)


def make_bricks(
    volume: Volume,
    transfer: TransferFunction,
    *,
    spec: PyramidSpec,
    error: ErrorSpec,
    shading: ShadingSpec | None = None,
    num_threads: int = 2,
) -> Bricks:
    """The bricks of all levels, and the pyramid that they are made of; the result does not depend on `num_threads`.

    The pyramid has no nodes of the levels up to STREAMED_LEVELS: what bricks must know of them is added up as they are
    built, and their means are made again from voxels when they are drawn.

    Raises InputError where the volume's file was changed.
    """
    sums = StreamedNodeStatistics.empty(volume)
    pyramid = build_pyramid(
        volume, transfer, spec=spec, error=error, shading=shading, num_threads=num_threads, on_nodes=sums.add
    )
    volume_range = volume.value_range()
    num_levels = max(1, pyramid.num_levels - BRICK_LEVELS + 1)
    nodes = [_summarize(level) for level in sums.levels[:num_levels]]
    trees = _brick_cells_by_level(pyramid)
    nodes += [
        _summarize_stored_level(pyramid, number, trees, num_threads) for number in range(len(nodes) + 1, num_levels + 1)
    ]
    between, roughness, steepness = _subvoxel_variation(pyramid, transfer, volume_range, num_threads)
    roughness = np.hypot(nodes[0].step_errors_below, _cell_error_scale(pyramid, 1) * roughness)
    np.maximum(roughness, _cell_error_scale(pyramid, 1) * steepness, out=roughness)
    levels = [_make_voxel_level(pyramid, transfer, roughness, num_threads)]
    for number, gathered in enumerate(nodes[: num_levels - 1], 1):
        between = _max_of_children(between)
        largest = np.maximum(gathered.largest, _cell_error_scale(pyramid, number) * between)
        np.multiply(RAY_ERROR_FACTOR, largest, out=gathered.largest)
        steepness = _root_mean_square_of_children(steepness)
        above = nodes[number].step_errors_below
        np.maximum(above, _cell_error_scale(pyramid, number + 1) * steepness, out=above)
    levels += [
        _frozen(BrickLevel(below.visible_bounds, below.largest, above.step_errors_below, below.slots, below.means))
        for below, above in pairwise(nodes)
    ]
    scalar_range = _scalar_range(transfer, *volume_range)
    pieces = make_piecewise_transfer(transfer, volume.finest_spacing, *scalar_range)
    return Bricks(tuple(levels), pyramid, transfer, scalar_range, volume_range, pieces)


def cut_bricks(bricks: Bricks, tolerance: float, *, finest_level: int = 0) -> BrickCut:
    """The coarsest bricks whose errors are below `tolerance` (in the measure's unit); none of a level below
    `finest_level`. Bricks in which their own level shows nothing are left out.

    Raises ValueError where either is below 0.
    """
    parts = list(_leaves(bricks, tolerance, finest_level))
    counts = [len(cells) for _, cells in parts]
    levels = np.repeat(np.array([level for level, _ in parts], np.uint8), counts)
    cells = np.concatenate([cells for _, cells in parts])
    boxes, roughness = np.empty((len(cells), 2, 3)), np.empty(len(cells))
    for (number, part), end in zip(parts, np.cumsum(counts).tolist(), strict=True):
        where, level = slice(end - len(part), end), bricks.levels[number]
        kernels.copy_bounds_and_errors(
            part, level.visible_bounds, level.step_errors, 2.0**number, boxes[where], roughness[where]
        )
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
        num_drawn, num_divided = kernels.split_bricks(
            cells,
            level.errors,
            level.visible_bounds,
            tolerance if number > finest_level else math.inf,
            below,
            drawn,
            divided,
        )
        yield number, drawn[:num_drawn]
        cells = divided[:num_divided]


def _scalar_range(transfer: TransferFunction, low: float, high: float) -> tuple[float, float]:
    """As in Bricks, of a volume from `low` to `high`; never a single number.

    Where the transfer function changes, and no more: the narrower, the more digits texels have there.
    """
    points = np.column_stack([transfer.colors * transfer.extinctions[:, None], transfer.extinctions])
    changing = np.flatnonzero(np.any(points[1:] != points[:-1], axis=1))
    first, last = low, high
    if len(changing):
        start, end = float(transfer.values[changing[0]]), float(transfer.values[changing[-1] + 1])
        half, of_all = end / 2 - start / 2, float(transfer.values[-1] / 2 - transfer.values[0] / 2)  # finite, always
        of_volume = high / 2 - low / 2
        least = (
            max(_MIN_RANGE_SHARE * of_all, min(of_volume / MAX_NORMALIZED_SCALAR, of_all))
            if of_all
            else _MIN_RANGE_SHARE * of_volume
        )
        missing = max(least - half, 0.0)
        first, last = max(low, start - missing), min(high, end + missing)
    if not first < last:  # the volume is outside, where all is constant
        first, last = low, high
    if first < last:
        return first, last
    width = max(1.0, abs(low))  # towards 0, so that neither end overflows
    return (low - width, low) if low > 0 else (low, low + width)


def _visibility_breakpoints(transfer: TransferFunction, finest_spacing: float) -> Float64:
    """float64 [m], ascending: where visibility changes; of visible scalars an odd number is at or below.

    A slope that rises from nothing begins to show at the next number, so that what lies at its foot is not seen. Of a
    step the upper side has the value. Two changes at one scalar are none.
    """
    values, is_shown = transfer.values, transfer.extinctions * finest_spacing >= VISIBILITY_THRESHOLD
    flips = [-math.inf] if is_shown[0] else []
    for k in np.flatnonzero(is_shown[1:] != is_shown[:-1]):
        start, end = float(values[k]), float(values[k + 1])
        low, high = transfer.extinctions[k : k + 2] * finest_spacing
        share = float((VISIBILITY_THRESHOLD - low) / (high - low))
        crossing = start * (1 - share) + end * share
        flips.append(min(max(crossing, math.nextafter(start, math.inf)), end))
    different, counts = np.unique(np.array(flips, np.float64), return_counts=True)
    return np.asarray(different[counts % 2 == 1])


def _brick_cells_by_level(pyramid: Pyramid) -> dict[int, Int32]:
    """By level, the cells int32 [n, 3] of all visible nodes that are bricks, and of the root: in Morton order."""
    cells = np.zeros((len(pyramid.levels[-1].errors), 3), np.int32)
    trees = {pyramid.num_levels: cells}
    for number in range(pyramid.num_levels, BRICK_LEVELS, -1):
        level = pyramid.levels[number - 1]
        _, cells = visible_children(np.arange(len(cells)), cells, level.masks, level.first_children)
        trees[number - 1] = cells
    return trees


class _LevelSummary(NamedTuple):
    """What the nodes of one level add up to: boxes, largest, slots, means as in the BrickLevel that they fill;
    roughness of the bricks of the level below."""

    visible_bounds: npt.NDArray[np.float32]
    largest: Float64
    step_errors_below: Float64
    slots: Int32
    means: Array


def _summarize(sums: NodeStatistics, slots: Int32 | None = None, means: Array | None = None) -> _LevelSummary:
    if slots is None or means is None:
        slots, means = np.empty((0, 0, 0), np.int32), np.empty((0, BRICK_SIZE, BRICK_SIZE, BRICK_SIZE, 4), np.float32)
    return _LevelSummary(sums.boxes(), sums.largest(), sums.step_errors_below(), slots, means)


def _summarize_stored_level(pyramid: Pyramid, number: int, trees: dict[int, Int32], num_threads: int) -> _LevelSummary:
    """Of the nodes of level `number`, which are stored, brick by brick."""
    top = min(number + BRICK_LEVELS, pyramid.num_levels)
    bricks, sums = trees[top], NodeStatistics.empty(pyramid.volume, number)
    slots = np.full(brick_grid_shape(pyramid.volume, number), -1, np.int32)
    x, y, z = bricks.T >> (number + BRICK_LEVELS - top)
    slots[z, y, x] = np.arange(len(bricks))
    means = np.zeros((len(bricks), BRICK_SIZE, BRICK_SIZE, BRICK_SIZE, 4), pyramid.levels[0].means.dtype)

    def work(part: slice) -> None:
        cells, nodes = bricks[part], np.arange(part.start, part.stop)
        for above in range(top, number, -1):
            level = pyramid.levels[above - 1]
            nodes, cells = visible_children(nodes, cells, level.masks, level.first_children)
        means_of_nodes = pyramid.levels[number - 1].means[nodes]
        sums.add(cells, node_errors(pyramid, nodes, cells, number), means_of_nodes)
        kernels.scatter(_items(means_of_nodes), cells, slots, _items(means))

    with ThreadPool(num_threads) as pool:
        pool.map(work, _parts(len(bricks)))
    return _summarize(sums, slots, means)


def _max_of_children(of_brick: Float64) -> Float64:
    """float64 [z, y, x]: the largest of the up to eight bricks of the level below."""
    for axis in range(3):
        of_brick = np.maximum.reduceat(of_brick, np.arange(0, of_brick.shape[axis], 2), axis)
    return of_brick


def _root_mean_square_of_children(of_brick: Float64) -> Float64:
    """float64 [z, y, x]: of the up to eight bricks of the level below, those at the border taken for whole ones."""
    largest = float(of_brick.max()) or 1.0  # squares of errors of scalars may be no numbers
    squares, nums = (of_brick / largest) ** 2, np.ones_like(of_brick)
    for axis in range(3):
        starts = np.arange(0, squares.shape[axis], 2)
        squares, nums = (np.add.reduceat(each, starts, axis) for each in (squares, nums))
    return np.asarray(largest * np.sqrt(squares / nums))


def _make_voxel_level(pyramid: Pyramid, transfer: TransferFunction, roughness: Float64, num_threads: int) -> BrickLevel:
    volume = pyramid.volume
    flips = _visibility_breakpoints(transfer, volume.finest_spacing)
    raw, scalars = raw_voxels(volume), pyramid.classifier.scalars
    numbers = None if scalars is None else np.searchsorted(flips, scalars, side="right").astype(np.uint32)
    places = grid_cells(roughness.shape)
    boxes = np.zeros((*roughness.shape, 2, 3), np.float32)

    def work(part: slice) -> None:
        volume.require_unchanged()
        kernels.find_voxel_bounds(raw, numbers, flips, places[part], boxes)

    with ThreadPool(num_threads) as pool:
        pool.map(work, _parts(len(places)))
    volume.require_unchanged()
    slots, means = np.empty((0, 0, 0), np.int32), np.empty((0, BRICK_SIZE, BRICK_SIZE, BRICK_SIZE, 4), np.float32)
    return _frozen(BrickLevel(boxes, np.zeros_like(roughness), roughness, slots, means))


def _subvoxel_variation(
    pyramid: Pyramid, transfer: TransferFunction, volume_range: tuple[float, float], num_threads: int
) -> tuple[Float64, Float64, Float64]:
    """Return what `measure_subvoxel_variation` finds in the bricks of level 0: three of float64 [z, y, x]."""
    shape = brick_grid_shape(pyramid.volume, 0)
    largest, roughness, steepness = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    lighting, scalars = pyramid.classifier.lighting, pyramid.classifier.scalars
    if pyramid.of == "scalar":
        line = make_scalar_polyline(volume_range)
    else:
        line = make_polyline(
            transfer,
            pyramid.volume.finest_spacing,
            opacity=pyramid.measure == "rms",
            brightest=lighting.ambient + lighting.diffuse if lighting else 1.0,
            volume_range=volume_range,
        )
    raw, places = raw_voxels(pyramid.volume), grid_cells(shape)

    def work(part: slice) -> None:
        pyramid.volume.require_unchanged()
        measure_subvoxel_variation(raw, scalars, *line, places[part], largest, roughness, steepness)

    with ThreadPool(num_threads) as pool:
        pool.map(work, _parts(len(places)))
    pyramid.volume.require_unchanged()
    if pyramid.of == "scalar":
        half = volume_range[1] / 2 - volume_range[0] / 2  # the range itself may be too large for a number
        largest, roughness, steepness = (2 * (each * half) for each in (largest, roughness, steepness))
    return largest, roughness, steepness


def _cell_error_scale(pyramid: Pyramid, number: int) -> float:
    """What errors of whole nodes of a level are times the root of their variance."""
    return float(error_scale(pyramid.volume, pyramid.measure, 8.0**number))


def _frozen(level: BrickLevel) -> BrickLevel:
    for array in (level.visible_bounds, level.errors, level.step_errors, level.slots, level.means):
        array.flags.writeable = False
    return level


def _items(means: Array) -> Array:
    """[..., 4] as [...] items that are moved as one; a view."""
    return means.view(np.uint64 if means.dtype == np.float16 else np.complex128)[..., 0]


def _parts(num: int) -> list[slice]:
    return [slice(start, min(start + _BRICKS_PER_TASK, num)) for start in range(0, num, _BRICKS_PER_TASK)]
