"""Bricks, through which the field itself is integrated: the integrated footprint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from renderer.bricks import (
    RAY_ERROR_FACTOR,
    BrickBatch,
    BrickCut,
    Bricks,
    ScreenSampling,
    brick_cut_sizes,
    cut_bricks,
    make_brick_batch,
    num_bricks_at,
)
from renderer.draw import CellEdges, make_brick_edges
from renderer.frame.primitives import Lap, Orders
from renderer.pyramid import CutSizes, root_error
from renderer.scene import MIN_TOLERANCE, ShadingSpec
from renderer.view import View, model_view, visible_bricks

Float64 = npt.NDArray[np.float64]

# Where a film on a budget of time ends: beyond tolerances so much smaller than the error of the whole as one cell,
# there is only 0.
_MAX_SIZE = 2e6
# What a pixel under a brick costs beside the samples of its way, in samples, on a software renderer.
_PER_PIXEL = 6.5
# Of the time for all pixels the first lattice takes `stride^-_STRIDE_EXPONENT` (pixels are drawn in groups, of which
# few are needed), and the one after it as much of the share that differs, `_DIFFERING_SHARE spread^-_SPREAD_EXPONENT`.
# Fitted to the engine and the bonsai, where the time is within a factor of 1.4 of it; of a shaded chest CT it is up to
# 1.8 times as long.
_STRIDE_EXPONENT, _DIFFERING_SHARE, _SPREAD_EXPONENT = 1.1, 0.1, 0.5
# Bricks that are looked at, about, to know what all of them cost.
_MAX_SAMPLED_BRICKS = 4096


@dataclass(frozen=True)
class BrickLOD:
    """A cut of the bricks."""

    tolerance: float
    splats: BrickBatch
    edges: CellEdges | None = None

    @property
    def num_cells(self) -> int:
        """How many bricks it has."""
        return len(self.splats)

    def orders(self, view: View) -> Orders:
        """As in Detail: front to back. There is one, for bricks do not overlap."""
        return [(1.0, visible_bricks(self.splats, view))]

    def workload(self, orders: Orders, view: View) -> tuple[float, float]:
        """As in Detail; pixels are samples of the field."""
        ((_, order),) = orders
        return len(order), num_samples(self.splats, order, view)


class BrickPrimitive:
    """As in Family; a size is how many times smaller than the error of the whole volume as one cell the tolerance is.

    finest_level, finest_level_at_zero: of the cells in bricks drawn at tolerances above 0, and at 0.
    voxel_px: as in Stage. largest_change: what the measure says of all that a pixel can change by: 1, but for errors of
        the scalar the volume's range.
    """

    initial_size: ClassVar[float] = 60
    size_ratio: ClassVar[float] = 16  # the number of samples grows with about the cube root
    small_size_ratio: ClassVar[float] = 2

    def __init__(
        self,
        bricks: Bricks,
        shading: ShadingSpec | None,
        *,
        finest_level: int,
        finest_level_at_zero: int,
        voxel_px: float,
        largest_change: float,
        with_edges: bool,
    ) -> None:
        self._bricks, self._shading, self._voxel_px, self._with_edges = bricks, shading, voxel_px, with_edges
        self._largest_change = largest_change
        self._finest_level, self._finest_level_at_zero = finest_level, finest_level_at_zero
        self._largest_error = RAY_ERROR_FACTOR * root_error(bricks.pyramid) or 1.0
        self._sizes: CutSizes | None = None

    def make_lod(self, tolerance: float, lap: Lap) -> BrickLOD:
        """As in Family."""
        cut = self._cut(tolerance)
        lap("cut")
        batch = self._batch(cut, tolerance)
        lap("splats")
        edges = None
        if self._with_edges:
            edges = make_brick_edges(cut)
            lap("edges")
        return BrickLOD(tolerance, batch, edges)

    def num_cells(self, tolerance: float) -> int:
        """As in Family."""
        return num_bricks_at(self._bricks, tolerance, self._finest_level_at(tolerance))

    def work(self, tolerance: float) -> float:
        """As in Family: samples, of one ray for every column of cells."""
        batch = self._batch(self._cut(tolerance), tolerance)
        return float((_cells_in_bounds(batch.cut) / batch.steps).sum())

    def tolerance_for_cells(self, num_cells: float) -> float:
        """As in Family."""
        if self._sizes is None:
            self._sizes = brick_cut_sizes(
                self._bricks, finest_level=self._finest_level, finest_level_at_zero=self._finest_level_at_zero
            )
        return self._sizes.finest_within(max(1, int(min(num_cells, self._sizes.max_cells)))).tolerance

    def tolerance_for_size(self, size: float) -> float:
        """As in Family; of few digits, to be written down."""
        tolerance = float(f"{self._largest_error / max(size, 1.0):.2g}") if size < _MAX_SIZE else 0.0
        return tolerance if tolerance >= MIN_TOLERANCE else 0.0

    def lod_size(self, tolerance: float, num_cells: int) -> float:
        """As in Family."""
        return _MAX_SIZE if tolerance * _MAX_SIZE <= self._largest_error else max(1.0, self._largest_error / tolerance)

    def has_more_cells(self, tolerance: float, num_cells: float) -> bool:
        """As in Family: bricks are so few that they are cut at once."""
        return False

    def _cut(self, tolerance: float) -> BrickCut:
        return cut_bricks(self._bricks, tolerance, finest_level=self._finest_level_at(tolerance))

    def _finest_level_at(self, tolerance: float) -> int:
        return self._finest_level if tolerance > 0 else self._finest_level_at_zero

    def _batch(self, cut: BrickCut, tolerance: float) -> BrickBatch:
        return make_brick_batch(
            cut,
            self._bricks,
            tolerance=tolerance,
            pixel_tolerance=tolerance / self._largest_change,
            shading=self._shading,
            voxel_px=self._voxel_px,
        )


def num_samples(batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> float:
    """How many samples of the field a picture of `batch[order]` takes, of which each pixel costs some; an estimate.

    A box of the volume V, in parallel projection along d, covers the area A = sum of |face . d| over three of its
    faces, and the ways through it have the mean length V / A: its samples follow from volumes alone. In perspective
    they are those of the projection along the ray to its middle, at the scale of that place.
    """
    if len(order) == 0:
        return 0.0
    chosen = order[:: max(1, len(order) // _MAX_SAMPLED_BRICKS)]
    cut, camera = batch.cut, model_view(batch, view)
    low, high = cut.visible_bounds[chosen, 0], cut.visible_bounds[chosen, 1]
    model_from_index = cut.volume.world_from_index[:3, :3] / batch.model_unit
    in_view_from_index = camera.view_from_model[:, :3] @ model_from_index
    centres = ((low + high) / 2 - cut.volume.centre_index) @ in_view_from_index.T + camera.view_from_model[:, 3]
    edges = in_view_from_index * (high - low)[:, None, :]  # columns: the edges of each box
    faces = np.cross(edges[:, :, [1, 2, 0]], edges[:, :, [2, 0, 1]], axis=1)
    directions, scale_px = np.broadcast_to([0.0, 0.0, -1.0], centres.shape), np.full(len(chosen), camera.scale_px)
    if camera.perspective:
        # The eye may be in a box, whose middle is then nowhere in particular: as if it were half a box in front of it.
        distances = np.maximum(np.linalg.norm(centres, axis=1), np.linalg.norm(edges.sum(axis=2), axis=1) / 2)
        directions, scale_px = centres / distances[:, None], camera.scale_px / distances
    areas = np.abs(np.einsum("nij,ni->nj", faces, directions)).sum(axis=1)
    volumes = np.abs(np.einsum("ni,ni->n", faces[:, :, 0], edges[:, :, 0]))
    cells_per_length = np.linalg.norm(np.linalg.solve(in_view_from_index, directions.T), axis=0)
    cells_per_length = cells_per_length / np.exp2(cut.levels[chosen])
    num_pixels = np.minimum(areas * scale_px**2, float(np.prod(view.size)))
    depths = np.divide(volumes, areas, out=np.zeros_like(areas), where=areas > 0)
    samples = num_pixels * (depths * cells_per_length / batch.steps[chosen] + _PER_PIXEL)
    return float(samples.mean()) * len(order) * _subsampling_cost_share(batch.screen_sampling)


def _subsampling_cost_share(screen_sampling: ScreenSampling) -> float:
    """Of the time that a picture takes whose pixels are all drawn."""
    first, *others = screen_sampling.strides
    share = first**-_STRIDE_EXPONENT
    for stride in others:
        share += (
            min(1.0, _DIFFERING_SHARE * screen_sampling.difference_threshold**-_SPREAD_EXPONENT)
            * stride**-_STRIDE_EXPONENT
        )
    return float(share)


def _cells_in_bounds(cut: BrickCut) -> Float64:
    """float64 [n]: the volume of each box in cells of its brick's level."""
    return np.asarray((cut.visible_bounds[:, 1] - cut.visible_bounds[:, 0]).prod(axis=1) / np.exp2(3.0 * cut.levels))
