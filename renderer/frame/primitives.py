"""Make the level of detail at a tolerance, as splats of octree cells or as bricks that are integrated along rays.

The frame loop, the budgets and the sweeps use `Primitive` and `LOD` alone, so that they work for every footprint. A
film with a budget of time moves through *sizes*, which rise as tolerances fall: numbers of cells for splats, ratios of
errors for bricks.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count, repeat
from typing import Any, ClassVar

import numpy as np

from renderer.bricks import (
    BRICK_LEVELS,
    RAY_ERROR_FACTOR,
    BrickBatch,
    BrickCut,
    ScreenSampling,
    brick_cut_sizes,
    cut_bricks,
    extremes_at,
    make_brick_batch,
)
from renderer.draw import Lines, make_edges, make_outline
from renderer.frame.stage import Stage, finest_level_at
from renderer.pyramid import Cut, CutSizes, cut_pyramid, cut_sizes, root_error
from renderer.scene import MAX_LEVEL, MIN_TOLERANCE
from renderer.splats import SplatBatch, make_splats, samples_across_at
from renderer.view import View, blended_orders, model_view, total_square_area_px, visible_bricks, visible_order
from renderer.volume import UInt32

# Draw orders, each with its share of the picture and, for each batch, the indices of its elements, uint32 [k]. The
# shares add up to 1.
Orders = Sequence[tuple[float, Sequence[UInt32]]]
# A function that is called with the name of a step that has just ended.
Lap = Callable[[str], object]
# A function that returns the orders of a view. See `LOD.orders`.
OrderFinder = Callable[[View], Orders]

# The seconds to draw an empty frame, by a software renderer on two cores.
_TYPICAL_FRAME_SECONDS = 5e-3
# The seconds to draw a splat or a brick, besides the time for its pixels, by a software renderer on two cores.
TYPICAL_CELL_SECONDS = 1e-6
# The seconds to draw a pixel of a splat, or a sample of a ray in a brick, by a software renderer on two cores.
_TYPICAL_PIXEL_SECONDS = 8e-9

# Sizes of cuts are computed for up to this many times the number of cells asked for, because later requests are mostly
# for more cells.
_LOOK_AHEAD = 4

# The largest size of a level of detail of bricks, which is the error of the whole volume as one cell divided by the
# tolerance. Finer tolerances count as 0.
_MAX_BRICK_SIZE = 2e6
# The cost of each pixel that a brick covers, besides the cost of its samples, in samples, on a software renderer.
_PER_PIXEL = 6.5
# Drawing every `stride`-th pixel along both axes takes `stride^-_STRIDE_EXPONENT` of the time for all pixels; the
# exponent is below 2, as pixels are drawn in groups. It was fitted, with _DIFFERING_SHARE and _THRESHOLD_EXPONENT, to
# scans of an engine and a bonsai, whose times are predicted within a factor of 1.4; a shaded chest CT takes up to 1.8
# times as long as predicted.
_STRIDE_EXPONENT = 1.1
# The predicted share of the pixels of a finer grid that are drawn, because the coarser grid is not smooth there:
# `_DIFFERING_SHARE difference_threshold^-_THRESHOLD_EXPONENT`.
_DIFFERING_SHARE = 0.1
# The exponent, as -_THRESHOLD_EXPONENT, of the threshold in the predicted share of pixels that are drawn.
_THRESHOLD_EXPONENT = 0.5
# The predicted cost of several rays in pixels, by the time of one ray a pixel: `_ANTIALIASED_SHARE
# contrast_threshold^-_CONTRAST_EXPONENT side^-_SIDE_EXPONENT`, with the side of a square picture of as many pixels, by
# _FITTED_SIDE. It was fitted to an engine, a bonsai, labels and a head with sides of 128 to 512 pixels and tolerances
# from 0.02 to 0.3, where this cost is 0.1 to 9. The times of half of them are within a factor of 1.25 of the predicted
# ones, the worst within 2.3.
_ANTIALIASED_SHARE = 0.12
# The exponent, as -_CONTRAST_EXPONENT, of the threshold in the predicted cost of several rays in pixels.
_CONTRAST_EXPONENT = 0.8
# The exponent, as -_SIDE_EXPONENT, of the picture's side in the predicted cost of several rays in pixels: a smaller
# picture has more edges for each pixel.
_SIDE_EXPONENT = 0.75
# The side, in pixels, of a picture whose predicted cost of several rays has the factor _ANTIALIASED_SHARE.
_FITTED_SIDE = 512
# The largest cost of several rays in pixels, where nearly all pixels of the object have 16.
_MAX_ANTIALIASED_SHARE = 6.0
# The number of additional scattered rays for each pixel, in a picture that has any: every third pixel gets one.
_SCOUTS = 1 / 3
# The cost of all bricks is estimated from about this many of them, or fewer.
_MAX_SAMPLED_BRICKS = 4096


@dataclass(frozen=True)
class LOD(ABC):
    """A level of detail: the cells drawn at a tolerance, from any view.

    batches: the splats or bricks of each group of layers on one grid of voxels.
    lines: the edges and outlines to draw over the picture.
    orders: a function that returns the elements that are visible in a view, in the orders in which they are drawn; all
        orders have the same elements.
    """

    tolerance: float
    batches: Sequence[Any]
    lines: Sequence[Lines]
    orders: OrderFinder

    @property
    def num_cells(self) -> int:
        """Return the number of cells in the cut, each a splat or a brick."""
        return sum(map(len, self.batches))

    @abstractmethod
    def num_pixels(self, orders: Orders, view: View) -> float:
        """Return the number of pixels, or samples, that are drawn in the given orders."""

    def typical_seconds(self, orders: Orders, view: View) -> float:
        """Return the time to draw the given orders on a software renderer with two cores."""
        num_cells = sum(len(of_batch) for _, order in orders for of_batch in order)
        return (
            _TYPICAL_FRAME_SECONDS
            + TYPICAL_CELL_SECONDS * num_cells
            + _TYPICAL_PIXEL_SECONDS * self.num_pixels(orders, view)
        )


@dataclass(frozen=True)
class SplatLOD(LOD):
    """A level of detail of splats, in a single batch."""

    batches: Sequence[SplatBatch]

    def num_pixels(self, orders: Orders, view: View) -> float:
        """Return the number of samples in the squares around the footprints of all splats, over all orders."""
        batch = self.batches[0]
        camera = model_view(batch, view.magnified(batch.samples_across))
        return len(orders) * total_square_area_px(batch, orders[0][1][0], camera)


@dataclass(frozen=True)
class BrickLOD(LOD):
    """A level of detail of bricks."""

    batches: Sequence[BrickBatch]

    def num_pixels(self, orders: Orders, view: View) -> float:
        """Return the estimated number of samples that rays take in bricks."""
        return sum(num_samples(*each, view) for each in zip(self.batches, orders[0][1], strict=True))


class Primitive(ABC):
    """The base class of objects that turn a tolerance into a level of detail, for one footprint.

    lod_type: the class of the levels of detail.
    levels_above: the number of octree levels from the cells in a cut to the elements that are drawn: 0 for splats, more
        for bricks of cells.
    initial_size: the size of a level of detail with which a search on a budget of time begins, enough to show the
        content of a frame.
    size_ratio: the factor from one size worth trying to the next, which is also the largest change of the size at once.
    """

    lod_type: ClassVar[type[LOD]]
    levels_above: ClassVar[int]
    initial_size: ClassVar[float]
    size_ratio: ClassVar[float]

    def __init__(self, stage: Stage) -> None:
        self._stage, self._annotation = stage, stage.scene.annotation
        self._sizes: CutSizes | None = None

    def make_lod(self, tolerance: float, lap: Lap) -> LOD:
        """Cut at a tolerance, and prepare the cut for the rasteriser."""
        cuts, batches, orders = self._prepare(tolerance, lap)
        lap("primitives")
        lines = [make_edges(cut, self.levels_above) for cut in cuts if self._annotation.octree]
        lines += [make_outline(cut.volume) for cut in cuts if self._annotation.bounds]
        if lines:
            lap("edges")
        return self.lod_type(tolerance, batches, lines, orders)

    def _finest_levels(self, tolerance: float) -> list[int]:
        """Return the finest level of cells that are drawn at a tolerance, for each group."""
        return [finest_level_at(self._stage, tolerance, number) for number in range(len(self._stage.groups))]

    @abstractmethod
    def _prepare(self, tolerance: float, lap: Lap) -> tuple[Sequence[Cut | BrickCut], Sequence[Any], OrderFinder]:
        """Make the cuts at a tolerance and call `lap("cut")`; return the cuts, the batches, and `LOD.orders`."""

    @abstractmethod
    def work(self, tolerance: float) -> float:
        """Return the work of drawing at a tolerance, in cells or samples. It mostly rises as the tolerance falls."""

    @abstractmethod
    def tolerance_for_cells(self, num_cells: float) -> float:
        """Return the tolerance of the finest cut with at most `num_cells` cells."""

    @abstractmethod
    def tolerance_for_size(self, size: float) -> float:
        """Return the tolerance of the finest level of detail whose size is at most `size`."""

    @abstractmethod
    def lod_size(self, tolerance: float, num_cells: int) -> float:
        """Return the size, at least 1, of the level of detail at a tolerance, which has `num_cells` cells."""

    def has_more_cells(self, tolerance: float, num_cells: float) -> bool:
        """Return whether the cut at a tolerance has more than about `num_cells` cells, without making the cut.

        It is always False if cuts are so quick to make that a test is not worth it.
        """
        return False


def make_primitive(stage: Stage) -> SplatPrimitive | BrickPrimitive:
    """Return the object that makes the levels of detail of the scene's footprint."""
    if stage.scene.needs_opengl:
        return SplatPrimitive(stage)
    return ExtremumPrimitive(stage) if stage.scene.mode.is_extremum else BrickPrimitive(stage)


class SplatPrimitive(Primitive):
    """A primitive that draws cells of the octree as splats. The size of a level of detail is its number of cells."""

    lod_type, levels_above = SplatLOD, 0
    initial_size = 1000
    size_ratio = 4

    def __init__(self, stage: Stage) -> None:
        super().__init__(stage)
        self._pyramid = stage.layers[0].pyramid

    def work(self, tolerance: float) -> float:
        return len(self._cut(tolerance))

    def tolerance_for_cells(self, num_cells: float) -> float:
        most = max(1, int(min(num_cells, self._pyramid.volume.values.size)))
        sizes = self._sizes_to(most)
        return sizes.finest_within(min(most, sizes.max_cells))

    def tolerance_for_size(self, size: float) -> float:
        return self.tolerance_for_cells(size)

    def lod_size(self, tolerance: float, num_cells: int) -> float:
        return max(num_cells, 1)

    def has_more_cells(self, tolerance: float, num_cells: float) -> bool:
        most = int(min(num_cells, self._pyramid.volume.values.size))
        sizes = self._sizes_to(max(1, most // _LOOK_AHEAD))
        return sizes.num_cells_at_zero is None if tolerance == 0 else tolerance <= sizes.tolerance_limit

    def _cut(self, tolerance: float) -> Cut:
        return cut_pyramid(self._pyramid, tolerance, finest_level=finest_level_at(self._stage, tolerance))

    def _prepare(self, tolerance: float, lap: Lap) -> tuple[Sequence[Cut], Sequence[SplatBatch], OrderFinder]:
        cut, splat, blending = self._cut(tolerance), self._stage.scene.splat, self._stage.order_blending
        lap("cut")
        cell_px = self._stage.resolutions[0].voxel_px * 2.0 ** int(cut.levels.min(initial=MAX_LEVEL))
        across = samples_across_at(tolerance, cell_px, splat)
        batch, cells = make_splats(cut, splat, samples_across=across), cut if splat.order == "boxes" else None

        def orders(view: View) -> Orders:
            if splat.order == "depth":
                return [(share, [order]) for share, order in blended_orders(batch, view, blending)]
            return [(1.0, [visible_order(batch, view, cells=cells)])]

        return [cut], [batch], orders

    def _sizes_to(self, num_cells: int) -> CutSizes:
        if self._sizes is None or (self._sizes.max_cells < num_cells and self._sizes.num_cells_at_zero is None):
            (finest_level,), (at_zero,) = self._finest_levels(1.0), self._finest_levels(0.0)
            most = _LOOK_AHEAD * num_cells
            self._sizes = cut_sizes(self._pyramid, most, finest_level=finest_level, finest_level_at_zero=at_zero)
        return self._sizes


class BrickPrimitive(Primitive):
    """A primitive that draws cells as bricks, for the integrated footprint.

    One order is enough, because bricks do not overlap. The size of a level of detail is the error of the whole volume
    as one cell, divided by the tolerance.
    """

    lod_type, levels_above = BrickLOD, BRICK_LEVELS
    initial_size = 60
    size_ratio = 16  # the number of samples grows with about the cube root of the size

    def __init__(self, stage: Stage) -> None:
        super().__init__(stage)
        self._bricks = [group.bricks for group in stage.groups if group.bricks is not None]
        errors = [layer.weight * root_error(layer.bricks.pyramid) for each in self._bricks for layer in each.layers]
        self._largest_error = RAY_ERROR_FACTOR * max(errors) or 1.0

    def work(self, tolerance: float) -> float:
        """Return the number of samples that rays along an axis would take, one ray through each column of cells."""
        samples = 0.0
        for batch in map(self._batch, self._cuts(tolerance), count(), repeat(tolerance)):
            low, high = batch.cut.visible_bounds[:, 0], batch.cut.visible_bounds[:, 1]
            cells = (high - low).prod(axis=1) / np.exp2(3.0 * batch.cut.levels)
            samples += float((cells / batch.steps).sum())
        return samples

    def tolerance_for_cells(self, num_cells: float) -> float:
        if self._sizes is None:
            self._sizes = brick_cut_sizes(
                self._bricks, finest_levels=self._finest_levels(1.0), finest_levels_at_zero=self._finest_levels(0.0)
            )
        return self._sizes.finest_within(max(1, int(min(num_cells, self._sizes.max_cells))))

    def tolerance_for_size(self, size: float) -> float:
        """Return the tolerance of a level of detail of a size, rounded to two digits so that records are short."""
        tolerance = float(f"{self._largest_error / max(size, 1.0):.2g}") if size < _MAX_BRICK_SIZE else 0.0
        return tolerance if tolerance >= MIN_TOLERANCE else 0.0

    def lod_size(self, tolerance: float, num_cells: int) -> float:
        if tolerance * _MAX_BRICK_SIZE <= self._largest_error:
            return _MAX_BRICK_SIZE
        return max(1.0, self._largest_error / tolerance)

    def _prepare(self, tolerance: float, lap: Lap) -> tuple[Sequence[BrickCut], Sequence[BrickBatch], OrderFinder]:
        cuts = self._cuts(tolerance)
        lap("cut")
        batches = [self._batch(cut, number, tolerance) for number, cut in enumerate(cuts)]
        return cuts, batches, lambda view: [(1.0, [self._order(batch, view) for batch in batches])]

    def _tolerance(self, number: int, tolerance: float) -> float:
        """Return the tolerance at which a group of layers is drawn; the mode of a projection may multiply it."""
        projection = self._stage.groups[number].projection
        return tolerance if projection is None else projection.tolerance_factor * tolerance

    def _cuts(self, tolerance: float) -> list[BrickCut]:
        of_groups = zip(self._bricks, self._finest_levels(tolerance), self._stage.near_faces(), strict=True)
        return [
            cut_bricks(bricks, 0.0)
            if self._stage.draws_voxels_only(number)
            else cut_bricks(bricks, self._tolerance(number, tolerance), finest_level=level, are_split=near_faces)
            for number, (bricks, level, near_faces) in enumerate(of_groups)
        ]

    def _batch(self, cut: BrickCut, number: int, tolerance: float) -> BrickBatch:
        tolerance, voxel_px = self._tolerance(number, tolerance), self._stage.resolutions[number].voxel_px
        return make_brick_batch(cut, self._bricks[number], tolerance=tolerance, voxel_px=voxel_px)

    def _order(self, batch: BrickBatch, view: View) -> UInt32:
        return visible_bricks(batch, view)


class ExtremumPrimitive(BrickPrimitive):
    """A primitive that draws bricks of level 0, in which rays look for their most extreme scalar.

    The tolerance has no effect on the cut; bricks that would change a pixel by less than it are passed over.
    """

    def __init__(self, stage: Stage) -> None:
        super().__init__(stage)
        self._all = [layer.extreme_bricks for layer in stage.layers if layer.extreme_bricks is not None]

    def _cuts(self, tolerance: float) -> list[BrickCut]:
        return [batch.cut for batch in self._all]

    def _batch(self, cut: BrickCut, number: int, tolerance: float) -> BrickBatch:
        return extremes_at(self._all[number], tolerance, self._stage.resolutions[number].voxel_px)

    def _order(self, batch: BrickBatch, view: View) -> UInt32:
        """Return the visible bricks, those with the largest upper bounds first.

        They come front to back if the extremum is coloured by its depth, or if something is clipped.
        """
        order, extremes = visible_bricks(batch, view), batch.extremes
        assert extremes is not None
        is_sorted = not (extremes.by_depth or view.clip or batch.bricks.clip)
        return order[np.argsort(-extremes.tops[order], kind="stable")] if is_sorted else order


def num_samples(batch: BrickBatch, order: UInt32, view: View) -> float:
    """Estimate the number of samples for a picture of `batch[order]`, with _PER_PIXEL more for each pixel of a brick.

    A box of volume V, projected in parallel along a direction d, covers the area A = sum of |face . d| over three of
    its faces, and rays through it have the mean length V / A inside it: the number of samples follows from volumes
    alone. In perspective, a box is projected along the ray to its middle, at the scale there.
    """
    if len(order) == 0:
        return 0.0
    chosen = order[:: max(1, len(order) // _MAX_SAMPLED_BRICKS)]
    cut, camera = batch.cut, model_view(batch, view)
    low, high = cut.visible_bounds[chosen, 0], cut.visible_bounds[chosen, 1]
    model_from_index = cut.volume.world_from_index[:3, :3] / batch.model_unit
    in_view_from_index = camera.view_from_model[:, :3] @ model_from_index
    centres = ((low + high) / 2 - cut.volume.centre_index) @ in_view_from_index.T + camera.view_from_model[:, 3]
    edges = in_view_from_index * (high - low)[:, None, :]  # the columns are the edges of each box
    faces = np.cross(edges[:, :, [1, 2, 0]], edges[:, :, [2, 0, 1]], axis=1)
    directions, scale_px = np.broadcast_to([0.0, 0.0, -1.0], centres.shape), np.full(len(chosen), camera.scale_px)
    if camera.perspective:
        # From an eye inside of a box, the direction to its middle is arbitrary: the eye counts as half a box away.
        distances = np.maximum(np.linalg.norm(centres, axis=1), np.linalg.norm(edges.sum(axis=2), axis=1) / 2)
        directions, scale_px = centres / distances[:, None], camera.scale_px / distances
    areas = np.abs(np.einsum("nij,ni->nj", faces, directions)).sum(axis=1)
    volumes = np.abs(np.einsum("ni,ni->n", faces[:, :, 0], edges[:, :, 0]))
    cells_per_length = np.linalg.norm(np.linalg.solve(in_view_from_index, directions.T), axis=0)
    cells_per_length = cells_per_length / np.exp2(cut.levels[chosen])
    num_pixels = np.minimum(areas * scale_px**2, float(np.prod(view.size)))
    depths = np.divide(volumes, areas, out=np.zeros_like(areas), where=areas > 0)
    samples = num_pixels * (depths * cells_per_length / batch.steps[chosen] + _PER_PIXEL)
    return float(samples.mean()) * len(order) * _cost_of_lattices(batch.screen_sampling, view.size)


def _cost_of_lattices(screen_sampling: ScreenSampling, size: tuple[int, int]) -> float:
    """Return the predicted time of a picture of a size, divided by that of the picture with one ray in each pixel."""
    first, *others = screen_sampling.strides
    share = first**-_STRIDE_EXPONENT
    for stride in others:
        differing = min(1.0, _DIFFERING_SHARE * screen_sampling.difference_threshold**-_THRESHOLD_EXPONENT)
        share += differing * stride**-_STRIDE_EXPONENT
    if screen_sampling.strides[-1] == 1:
        share += _SCOUTS * screen_sampling.is_scouted
        side = math.sqrt(math.prod(size)) / _FITTED_SIDE
        several = _ANTIALIASED_SHARE * screen_sampling.contrast_threshold**-_CONTRAST_EXPONENT * side**-_SIDE_EXPONENT
        share += min(several, _MAX_ANTIALIASED_SHARE)
    return float(share)
