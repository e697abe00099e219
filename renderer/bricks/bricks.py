"""Build the bricks: cubes of BRICK_SIZE^3 cells of one level of the pyramid, which the integrated footprint draws.

A brick of level l is a node of level l + BRICK_LEVELS of the octree, filled with the nodes of level l in it, or on
level 0 with voxels. The field is linear between the centres of its cells, and between them and the cells of its
neighbours at the same level, the halo, whatever is drawn there.

    level 0     the scalar, classified after interpolation; (tau c, tau) of voxels that are colours
    above       the means of (tau c, tau), classified before, which may be interpolated
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from renderer.bricks.brick_means import color_texels
from renderer.bricks.layout import BRICK_LEVELS, BRICK_SIZE, brick_grid_shape, grid_cells, voxels_of
from renderer.bricks.node_statistics import NodeStatistics, or_of_neighbours
from renderer.bricks.subvoxel import make_channel_curve, make_scalar_curve
from renderer.kernels import LightGrid, PiecewiseTransfer, ThreadPool, kernels
from renderer.pyramid import (
    STREAMED_LEVELS,
    Pyramid,
    build_pyramid,
    cell_voxel_counts,
    descendants,
    error_scale,
    node_errors,
    root_cells,
)
from renderer.transfer import (
    MAX_NORMALIZED_SCALAR,
    NO_LIGHT_GRID,
    TransferFunction,
    make_piecewise_transfer,
    make_transfer_table,
)
from renderer.volume import Bools, Float32, Float64, Volume, meet_mask, reduce_blocks

# A ray meets the cells of this many bricks. Their errors are random, so that their sum is one error times the root of
# their number. If one brick is assumed instead of four, pictures of 42 and 45 dB take 1.2 times as long (mean of 10
# volumes), because cells then err more than steps; pictures of other accuracies, from 30 to 52 dB, take as long.
BRICKS_PER_RAY = 4
RAY_ERROR_FACTOR = math.sqrt(BRICKS_PER_RAY * BRICK_SIZE)

# Bricks of one task: enough to hide the dispatch, few enough that their nodes take little memory.
_BRICKS_PER_TASK = 128
# The range of texels is at least this share of the range of the control values, or of the volume's if all control
# values are equal. Interpolated scalars need digits, and clamping to MAX_NORMALIZED_SCALAR moves what lies beyond.
_MIN_RANGE_SHARE = 1 / 64


@dataclass(frozen=True)
class BrickLevel:
    """A level of bricks: all of them, including those that show nothing.

    visible_bounds: float32 [z, y, x, 2, 3], lowest and highest corner (x, y, z) of what may be visible in the brick:
        where the field, halo included, is not transparent. In cells from the brick's lowest corner, 0 to BRICK_SIZE; at
        centres of cells (k + 1/2), or at faces of the brick or the volume. Equal corners where nothing is visible.
    errors: float64 [z, y, x], how wrong the brick may make a pixel, in the measure's unit. It is RAY_ERROR_FACTOR times
        the larger of two errors: that of the worst node in the brick or its halo, and that of the sub-voxel variation
        along a segment as long as such a node (kernel `subvoxel.cpp`). On level 0, which shows every voxel, it is 0.
    step_errors: float64 [z, y, x], how wrong cells twice as large would be: the root mean square, over the brick's
        volume, of the errors of nodes one level *above*. Where that is 0, it is the largest of the neighbouring bricks,
        because they may be visible in the halo. On level 0 the squares of the sub-voxel variation along a segment of
        that length are added. It is never less than the estimate from differences between voxels along that segment.
    """

    visible_bounds: Float32
    errors: Float64
    step_errors: Float64

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.visible_bounds, self.errors, self.step_errors):
            array.flags.writeable = False

    @property
    def is_visible(self) -> Bools:
        """Return whether anything may be visible in each brick, bool [z, y, x]."""
        return np.asarray(self.visible_bounds[..., 1, 0] > self.visible_bounds[..., 0, 0])


@dataclass(frozen=True)
class Bricks:
    """A volume divided into bricks. levels[l] holds those of level l; the last one is a single brick.

    scalar_range: texels of level 0 are normalized to it. The part of the volume's range in which the transfer function
        changes, or all of it where it does not.
    volume_range: the volume's smallest and largest scalar.
    pieces: the transfer function by normalized scalars. light_grid: how much of the light reaches each place.
    are_cut: bool [z, y, x], of level 0, whether some of a brick may be outside of the mask; None without one.
    """

    levels: tuple[BrickLevel, ...]
    pyramid: Pyramid
    transfer: TransferFunction
    scalar_range: tuple[float, float]
    volume_range: tuple[float, float]
    pieces: PiecewiseTransfer
    light_grid: LightGrid = NO_LIGHT_GRID
    are_cut: Bools | None = None

    @property
    def volume(self) -> Volume:
        """Return the volume that the bricks divide."""
        return self.pyramid.volume


def make_bricks(
    volume: Volume,
    transfer: TransferFunction,
    *,
    light_grid: LightGrid = NO_LIGHT_GRID,
    has_lit_labels: bool = False,
    num_threads: int = 2,
    **options: Any,
) -> Bricks:
    """Build the bricks of all levels, and their pyramid; the result does not depend on `num_threads`.

    light_grid, and options: spec, error and shading, as in `build_pyramid`. has_lit_labels: whether samples of labels
    are lit.
    The pyramid has no nodes of the levels up to STREAMED_LEVELS: their statistics are gathered as they are built, and
    their means are recomputed from voxels for drawing.

    Raises InputError where the volume's file was changed.
    """
    statistics = [NodeStatistics.empty(volume, level) for level in range(1, STREAMED_LEVELS + 1)]

    def add_nodes(level: int, *nodes: Any) -> None:
        statistics[level - 1].add(*nodes)

    options |= {"light_grid": light_grid, "num_threads": num_threads, "on_nodes": add_nodes}
    pyramid = build_pyramid(volume, transfer, **options)
    volume_range = volume.value_range()
    num_levels = max(1, pyramid.num_levels - BRICK_LEVELS + 1)
    for number in range(STREAMED_LEVELS + 1, num_levels + 1):
        statistics.append(_gather_stored_level(pyramid, number, num_threads))
    bounds, (variation, steps, differences) = _measure_voxels(
        pyramid, transfer, volume_range, has_lit_labels=has_lit_labels, num_threads=num_threads
    )
    are_cut = _clear_masked(bounds, volume) if volume.mask is not None else None
    if has_lit_labels:  # their light changes up to three voxels away from where they end
        steps = or_of_neighbours(steps)
    unit = _cell_error_scale(pyramid, 1)
    step_errors = np.maximum(np.hypot(statistics[0].step_errors_below(), unit * steps), unit * differences)
    levels = [BrickLevel(bounds, np.zeros_like(step_errors), step_errors)]
    for number, of_nodes in enumerate(statistics[: num_levels - 1], 1):
        variation, differences = reduce_blocks(np.maximum, variation, 2), _root_mean_square_of_children(differences)
        errors = RAY_ERROR_FACTOR * np.maximum(of_nodes.max_error(), _cell_error_scale(pyramid, number) * variation)
        of_parents = statistics[number].step_errors_below()
        step_errors = np.maximum(of_parents, _cell_error_scale(pyramid, number + 1) * differences)
        levels.append(BrickLevel(of_nodes.visible_bounds(), errors, step_errors))
    scalar_range = _scalar_range(transfer, *volume_range)
    pieces = make_piecewise_transfer(transfer.curve(volume.finest_spacing), *scalar_range)
    return Bricks(tuple(levels), pyramid, transfer, scalar_range, volume_range, pieces, light_grid, are_cut)


def _clear_masked(bounds: Float32, volume: Volume) -> Bools:
    """Clear the visible bounds of bricks of level 0 that do not meet the volume's mask; return Bricks.are_cut."""
    assert volume.mask is not None and volume.mask_grid is not None
    lows = BRICK_SIZE * grid_cells(bounds.shape[:3]).astype(np.float64) - 0.5
    are_met, are_inside = meet_mask(volume.mask.values, volume.mask_grid.from_index, lows, lows + BRICK_SIZE)
    bounds.reshape(-1, 2, 3)[~are_met] = 0.0
    return ~are_inside.reshape(bounds.shape[:3])


def _scalar_range(transfer: TransferFunction, low: float, high: float) -> tuple[float, float]:
    """Return Bricks.scalar_range of a volume from `low` to `high`; never a single number.

    It spans where the transfer function changes, and no more: the narrower it is, the more digits texels have there.
    """
    points = np.column_stack([transfer.colors * transfer.extinctions[:, None], transfer.extinctions])
    changing = np.flatnonzero(np.any(points[1:] != points[:-1], axis=1))
    first, last = low, high
    if len(changing):
        start, end = float(transfer.values[changing[0]]), float(transfer.values[changing[-1] + 1])
        # Halves, which are always finite.
        half, of_all = end / 2 - start / 2, float(transfer.values[-1] / 2 - transfer.values[0] / 2)
        of_volume = high / 2 - low / 2
        least = _MIN_RANGE_SHARE * of_volume
        if of_all:
            least = max(_MIN_RANGE_SHARE * of_all, min(of_volume / MAX_NORMALIZED_SCALAR, of_all))
        missing = max(least - half, 0.0)
        first, last = max(low, start - missing), min(high, end + missing)
    if not first < last:  # the volume lies where the transfer function is constant
        first, last = low, high
    if first < last:
        return first, last
    width = max(1.0, abs(low))  # towards 0, so that neither end overflows
    return (low - width, low) if low > 0 else (low, low + width)


def _gather_stored_level(pyramid: Pyramid, number: int, num_threads: int) -> NodeStatistics:
    """Return the statistics of the stored nodes of level `number`."""
    top = min(number + BRICK_LEVELS, pyramid.num_levels)
    _, bricks = descendants(pyramid, *root_cells(pyramid), pyramid.num_levels, top)
    statistics = NodeStatistics.empty(pyramid.volume, number)

    def work(part: slice) -> None:
        nodes, cells = descendants(pyramid, np.arange(part.start, part.stop), bricks[part], top, number)
        means, sizes = pyramid.levels[number - 1].means[nodes], cell_voxel_counts(cells, number, pyramid.volume)
        statistics.add(cells, sizes, node_errors(pyramid, nodes, cells, number), means)

    with ThreadPool(num_threads) as pool:
        pool.map(work, _parts(len(bricks)))
    return statistics


def _root_mean_square_of_children(of_brick: Float64) -> Float64:
    """Return the root mean square over the up to eight bricks of the level below, float64 [z, y, x].

    Bricks at the border count as whole ones.
    """
    largest = float(of_brick.max()) or 1.0  # squares of errors of scalars may overflow
    squares, nums = (reduce_blocks(np.add, each, 2) for each in ((of_brick / largest) ** 2, np.ones_like(of_brick)))
    return np.asarray(largest * np.sqrt(squares / nums))


def _measure_voxels(
    pyramid: Pyramid,
    transfer: TransferFunction,
    volume_range: tuple[float, float],
    *,
    has_lit_labels: bool,
    num_threads: int,
) -> tuple[Float32, Float64]:
    """Return what the kernel `measure_voxel_bricks` finds in the bricks of level 0: their visible bounds, float32
    [z, y, x, 2, 3], and float64 [3, z, y, x]."""
    volume, lighting = pyramid.volume, pyramid.classifier.lighting
    shape = brick_grid_shape(volume, 0)
    bounds, measures = np.zeros((*shape, 2, 3), np.float32), np.zeros((3, *shape))
    if pyramid.of == "scalar":
        curve = make_scalar_curve(volume_range)
    elif volume.colors is not None:  # the transfer function shows nothing between voxels
        curve = make_transfer_table(np.zeros(1), np.zeros((1, 4)))
    else:
        brightest = lighting.light[3] + lighting.light[4] if lighting else 1.0
        curve = make_channel_curve(transfer, volume.finest_spacing, pyramid.measure == "rms", brightest, volume_range)
    voxels, breakpoints = voxels_of(volume, pyramid.classifier), pyramid.classifier.breakpoints
    measure = kernels().measure_voxel_bricks.partial(
        voxels=voxels, breakpoints=breakpoints, curve=curve, shown=volume.are_shown, are_lit=has_lit_labels,
        bounds=bounds, measures=measures,
    )  # fmt: skip
    cells = grid_cells(shape)

    def work(part: slice) -> None:
        volume.require_unchanged()
        measure(cells=cells[part], texels=None)
        if volume.colors is not None:
            x, y, z = cells[part].T
            shown = cells[part][bounds[z, y, x, 1, 0] > 0]
            texels = color_texels(pyramid, shown)
            if pyramid.measure == "rms":
                depths = texels[..., 3:]
                texels *= np.divide(-np.expm1(-depths), depths, out=np.ones_like(depths), where=depths > 0)
            measure(cells=shown, texels=texels)

    with ThreadPool(num_threads) as pool:
        pool.map(work, _parts(len(cells)))
    volume.require_unchanged()
    if pyramid.of == "scalar":
        measures *= volume_range[1] / 2 - volume_range[0] / 2  # the range itself may overflow
        measures *= 2
    return bounds, measures


def _cell_error_scale(pyramid: Pyramid, number: int) -> float:
    """Return the factor from the root of the variance of a whole node of a level to its error."""
    return float(error_scale(pyramid.volume, pyramid.measure, 8.0**number))


def _parts(num: int) -> list[slice]:
    return [slice(start, min(start + _BRICKS_PER_TASK, num)) for start in range(0, num, _BRICKS_PER_TASK)]
