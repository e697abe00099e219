"""Build the bricks: cubes of BRICK_SIZE^3 cells of one level of the pyramid, which the integrated footprint draws.

A brick of level l is a node of level l + BRICK_LEVELS of the octree. Its cells are the nodes of level l in it, or
voxels for level 0. The field is linear between the centres of its cells, and between these and the neighbouring cells
of the same level, the halo. Bricks of level 0 interpolate the scalar and classify it afterwards; for voxels that are
colours they interpolate (tau c, tau). Bricks of higher levels interpolate means of (tau c, tau), which were classified
before.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from renderer.bricks.brick_means import color_texels
from renderer.bricks.layout import BRICK_LEVELS, BRICK_SIZE, brick_grid_shape, grid_cells, voxels_of
from renderer.bricks.node_statistics import NodeStatistics, or_of_neighbours
from renderer.bricks.subvoxel import make_channel_curve, make_scalar_curve
from renderer.cache import NOT_KEPT, KeptArrays
from renderer.kernels import LightGrid, PiecewiseTransfer, ThreadPool, kernels
from renderer.pyramid import (
    STREAMED_LEVELS,
    Pyramid,
    build_pyramid,
    cell_voxel_counts,
    descendants,
    error_scale,
    node_errors,
    pyramid_arrays,
    restore_pyramid,
    root_cells,
)
from renderer.transfer import (
    MAX_NORMALIZED_SCALAR,
    NO_LIGHT_GRID,
    TransferFunction,
    make_piecewise_transfer,
    make_transfer_table,
)
from renderer.volume import Array, Bools, Float32, Float64, Volume, meet_mask, reduce_blocks

# The number of bricks that a ray is assumed to cross, from which the error of a ray is estimated. With 1 in place of 4,
# pictures of 42 and 45 dB take 1.2 times as long (mean of 10 volumes), because cells then err more than steps; pictures
# of other accuracies, from 30 to 52 dB, take as long.
BRICKS_PER_RAY = 4
# The ratio between the error of a ray and the error of one cell. Errors of cells are random, so that their sum grows
# with the root of their number.
RAY_ERROR_FACTOR = math.sqrt(BRICKS_PER_RAY * BRICK_SIZE)

# The number of bricks that one task measures: enough to hide the time to start the task, and few enough that the nodes
# in these bricks take little memory.
_BRICKS_PER_TASK = 128
# The smallest range of scalars to which texels are normalized, as a share of the range of the control values, or of the
# volume's range if all control values are equal. In a smaller range, clamping normalized scalars to
# MAX_NORMALIZED_SCALAR would change scalars outside of the range.
_MIN_RANGE_SHARE = 1 / 64


@dataclass(frozen=True)
class BrickLevel:
    """A level of bricks, including invisible bricks.

    visible_bounds: float32 [z, y, x, 2, 3], the lowest and the highest corner (x, y, z) of the box around all places in
        the brick where the field, halo included, is not transparent. Corners are in cells from the brick's lowest
        corner, 0 to BRICK_SIZE: at centres of cells (k + 1/2), or at faces of the brick or the volume. Both corners are
        equal if nothing is visible.
    errors: float64 [z, y, x], the error that the brick may cause in a pixel, in the measure's unit. It is
        RAY_ERROR_FACTOR times the larger of two errors: the error of the worst node in the brick or its halo, and the
        error of the sub-voxel variation along a segment as long as such a node (kernel `subvoxel.cpp`). At level 0,
        which shows every voxel, it is 0.
    step_errors: float64 [z, y, x], the error of cells twice as large: the root mean square, over the brick's volume, of
        the errors of nodes one level *above*. Where it would be 0, it is the largest step error of the neighbouring
        bricks, because these bricks may be visible in the halo. At level 0, the square of the error of the sub-voxel
        variation along a segment as long as such a cell is added to the mean square. The step error is never less than
        the estimate from differences between voxels along that segment.
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
    """A volume divided into bricks. levels[l] holds the bricks of level l; the last level is a single brick.

    scalar_range: the range to which texels of level 0 are normalized. It is the part of the volume's range in which the
        transfer function changes, or the whole range if it is constant.
    volume_range: the volume's smallest and largest scalar.
    pieces: the transfer function as a table by normalized scalars.
    light_grid: the light that reaches each place.
    ranges: float64 [z, y, x, 2], the smallest and the largest scalar of each brick of level 0, halo included; infinity
        and minus infinity if there is none. Bricks that nothing was read of may have the range of all numbers.
    are_cut: bool [z, y, x], whether a part of each brick of level 0 may be outside of the mask; None without a mask.
    """

    levels: tuple[BrickLevel, ...]
    pyramid: Pyramid
    transfer: TransferFunction
    scalar_range: tuple[float, float]
    volume_range: tuple[float, float]
    pieces: PiecewiseTransfer
    ranges: Float64
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
    kept: KeptArrays = NOT_KEPT,
    ranges: Float64 | None = None,
    **options: Any,
) -> Bricks:
    """Build the bricks of all levels, and their pyramid. The result does not depend on `num_threads`.

    The pyramid has no nodes of the levels up to STREAMED_LEVELS: their statistics are gathered as they are built, and
    their means are recomputed from voxels for drawing.

    light_grid, and options (spec, error, shading): as in `build_pyramid`. has_lit_labels: whether samples of labels are
    lit. kept: the entry in which the same bricks were kept, or are kept now. ranges: Bricks.ranges of the same voxels
    with any transfer function, if they are known. Raises InputError if the volume's file was changed.
    """
    options |= {"light_grid": light_grid}
    with kept.making() as arrays:
        if arrays is not None:
            pyramid = restore_pyramid(arrays, volume, transfer, **options)
            levels, are_cut, ranges = _restored_levels(arrays), arrays.get("are_cut"), arrays["ranges"]
        else:
            options |= {"ranges": ranges}
            pyramid, levels, are_cut, ranges = _build(
                volume, transfer, options, num_threads, has_lit_labels=has_lit_labels
            )
            masked = {} if are_cut is None else {"are_cut": are_cut}
            kept.keep(pyramid_arrays(pyramid) | _level_arrays(levels) | {"ranges": ranges} | masked)
    volume_range = volume.value_range()
    scalar_range = _scalar_range(transfer, *volume_range)
    pieces = make_piecewise_transfer(transfer.curve(volume.finest_spacing), *scalar_range)
    return Bricks(tuple(levels), pyramid, transfer, scalar_range, volume_range, pieces, ranges, light_grid, are_cut)


def _build(
    volume: Volume, transfer: TransferFunction, options: dict[str, Any], num_threads: int, *, has_lit_labels: bool
) -> tuple[Pyramid, list[BrickLevel], Bools | None, Float64]:
    """Build the pyramid and the levels of bricks from the voxels; the others are Bricks.are_cut and Bricks.ranges.

    options: the options of `build_pyramid`.
    """
    statistics = [NodeStatistics.empty(volume, level) for level in range(1, STREAMED_LEVELS + 1)]
    streamed = [each.sums for each in statistics]
    pyramid = build_pyramid(volume, transfer, num_threads=num_threads, streamed=streamed, **options)
    volume_range = volume.value_range()
    num_levels = max(1, pyramid.num_levels - BRICK_LEVELS + 1)
    for number in range(STREAMED_LEVELS + 1, num_levels + 1):
        statistics.append(_gather_stored_level(pyramid, number, num_threads))
    shape = (*brick_grid_shape(volume, 0), 2)
    ranges = np.broadcast_to([-math.inf, math.inf], shape) if options["ranges"] is None else options["ranges"]
    ranges = ranges.copy()
    bounds, (variation, steps, differences) = _measure_voxels(
        pyramid, transfer, volume_range, ranges, has_lit_labels=has_lit_labels, num_threads=num_threads
    )
    ranges.flags.writeable = False
    are_cut = _clear_masked(bounds, volume) if volume.mask is not None else None
    if has_lit_labels:  # the light of labels changes up to three voxels away from their borders
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
    return pyramid, levels, are_cut, ranges


def _level_arrays(levels: Sequence[BrickLevel]) -> dict[str, Array]:
    """Return the arrays of levels of bricks by names, from which `_restored_levels` makes the levels again."""
    names = [field.name for field in fields(BrickLevel)]
    return {f"{name}_of_{number}": getattr(each, name) for number, each in enumerate(levels) for name in names}


def _restored_levels(arrays: Mapping[str, Array]) -> list[BrickLevel]:
    """Return the levels of bricks from the arrays that `_level_arrays` returned."""
    names = [field.name for field in fields(BrickLevel)]
    num = sum(name.startswith(f"{names[0]}_of_") for name in arrays)
    return [BrickLevel(*(arrays[f"{name}_of_{number}"] for name in names)) for number in range(num)]


def _clear_masked(bounds: Float32, volume: Volume) -> Bools:
    """Clear the visible bounds of bricks of level 0 outside of the volume's mask, and return Bricks.are_cut.

    bounds: float32 [z, y, x, 2, 3], as in BrickLevel.
    """
    assert volume.mask is not None and volume.mask_grid is not None
    lows = BRICK_SIZE * grid_cells(bounds.shape[:3]).astype(np.float64) - 0.5
    are_met, are_inside = meet_mask(volume.mask.values, volume.mask_grid.from_index, lows, lows + BRICK_SIZE)
    bounds.reshape(-1, 2, 3)[~are_met] = 0.0
    return ~are_inside.reshape(bounds.shape[:3])


def _scalar_range(transfer: TransferFunction, low: float, high: float) -> tuple[float, float]:
    """Return Bricks.scalar_range for a volume whose scalars lie between `low` and `high`; never an empty range.

    It spans the scalars at which the transfer function changes, and no more: in a narrower range, texels have more
    digits.
    """
    points = np.column_stack([transfer.colors * transfer.extinctions[:, None], transfer.extinctions])
    changing = np.flatnonzero(np.any(points[1:] != points[:-1], axis=1))
    first, last = low, high
    if len(changing):
        start, end = float(transfer.values[changing[0]]), float(transfer.values[changing[-1] + 1])
        # Halves of ranges are always finite.
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
    width = max(1.0, abs(low))  # the range grows towards 0, so that neither end overflows
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
    """Return, for each brick, the root mean square over its children, up to eight bricks: float64 [z, y, x].

    Bricks at the border count as whole bricks.
    """
    largest = float(of_brick.max()) or 1.0  # squares of errors of scalars may overflow
    squares, nums = (reduce_blocks(np.add, each, 2) for each in ((of_brick / largest) ** 2, np.ones_like(of_brick)))
    return np.asarray(largest * np.sqrt(squares / nums))


def _measure_voxels(
    pyramid: Pyramid,
    transfer: TransferFunction,
    volume_range: tuple[float, float],
    ranges: Float64,
    *,
    has_lit_labels: bool,
    num_threads: int,
) -> tuple[Float32, Float64]:
    """Measure the bricks of level 0 with the kernel `measure_voxel_bricks`; return visible bounds and three measures.

    Bounds are float32 [z, y, x, 2, 3]. Measures are float64 [3, z, y, x]: the largest sub-voxel variation of a brick,
    the variation that sets its steps, and the estimate from differences between voxels.

    ranges: Bricks.ranges as far as they are known; the others are found.
    """
    volume, lighting = pyramid.volume, pyramid.classifier.lighting
    shape = brick_grid_shape(volume, 0)
    bounds, measures = np.zeros((*shape, 2, 3), np.float32), np.zeros((3, *shape))
    if pyramid.of == "scalar":
        curve = make_scalar_curve(volume_range)
    elif volume.colors is not None:  # voxels that are colours have no sub-voxel variation
        curve = make_transfer_table(np.zeros(1), np.zeros((1, 4)))
    else:
        brightest = lighting.light[3] + lighting.light[4] if lighting else 1.0
        curve = make_channel_curve(transfer, volume.finest_spacing, pyramid.measure == "rms", brightest, volume_range)
    voxels, breakpoints = voxels_of(volume, pyramid.classifier), pyramid.classifier.breakpoints
    measure = kernels().measure_voxel_bricks.partial(
        voxels=voxels, breakpoints=breakpoints, curve=curve, shown=volume.are_shown, are_lit=has_lit_labels,
        bounds=bounds, measures=measures, ranges=ranges,
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
        measures *= volume_range[1] / 2 - volume_range[0] / 2  # halves are used, as the width of the range may overflow
        measures *= 2
    return bounds, measures


def _cell_error_scale(pyramid: Pyramid, number: int) -> float:
    """Return the ratio between the error of a node that the border does not cut and the root of the node's variance.

    number: the level of the node.
    """
    return float(error_scale(pyramid.volume, pyramid.measure, 8.0**number))


def _parts(num: int) -> list[slice]:
    return [slice(start, min(start + _BRICKS_PER_TASK, num)) for start in range(0, num, _BRICKS_PER_TASK)]
