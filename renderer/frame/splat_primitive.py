"""Cells of the octree as splats: the gaussian and the gouraud footprint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from renderer.draw import CellEdges, make_cell_edges
from renderer.frame.primitives import Lap, Orders
from renderer.pyramid import Cut, CutSizes, Pyramid, cut_pyramid, cut_sizes
from renderer.scene import SplatSpec
from renderer.splats import SplatBatch, make_splats
from renderer.view import OrderBlending, View, model_view, total_square_area_px, visible_orders

# Sizes of cuts are looked up to so many times the number of cells that is asked for, because more will be.
_LOOK_AHEAD = 4


@dataclass(frozen=True)
class SplatLOD:
    """A cut of the pyramid as splats.

    order, turning: how they are sorted. lattice: the cut, without its cells where only `boxes` needs them.
    """

    tolerance: float
    splats: SplatBatch
    lattice: Cut
    order: str
    turning: OrderBlending
    edges: CellEdges | None = None

    @property
    def num_cells(self) -> int:
        """How many cells it has, each of which is a splat."""
        return len(self.splats)

    def orders(self, view: View) -> Orders:
        """As in Detail: back to front."""
        return visible_orders(self.splats, self.lattice, view, self.order, self.turning)

    def workload(self, orders: Orders, view: View) -> tuple[float, float]:
        """As in Detail; pixels are those around the footprints."""
        num_pixels = len(orders) * total_square_area_px(self.splats, orders[0][1], model_view(self.splats, view))
        return sum(len(order) for _, order in orders), num_pixels


class SplatPrimitive:
    """As in Family; a size is a number of cells.

    finest_level, finest_level_at_zero: of the cells drawn at tolerances above 0, and at 0.
    """

    initial_size: ClassVar[float] = 1000
    size_ratio: ClassVar[float] = 4
    small_size_ratio: ClassVar[float] = 4

    def __init__(
        self,
        pyramid: Pyramid,
        spec: SplatSpec,
        turning: OrderBlending,
        *,
        finest_level: int,
        finest_level_at_zero: int,
        with_edges: bool,
    ) -> None:
        self._pyramid, self._spec, self._turning, self._with_edges = pyramid, spec, turning, with_edges
        self._finest_level, self._finest_level_at_zero = finest_level, finest_level_at_zero
        self._sizes: CutSizes | None = None

    def make_lod(self, tolerance: float, lap: Lap) -> SplatLOD:
        """As in Family."""
        cut, spec = self._cut(tolerance), self._spec
        lap("cut")
        splats = make_splats(cut, spec)
        lap("splats")
        edges = None
        if self._with_edges:
            edges = make_cell_edges(cut)
            lap("edges")
        lattice = cut if spec.order == "boxes" else cut.without_cells()  # nothing else needs them again
        return SplatLOD(tolerance, splats, lattice, spec.order, self._turning, edges)

    def num_cells(self, tolerance: float) -> int:
        """As in Family."""
        return len(self._cut(tolerance))

    def work(self, tolerance: float) -> float:
        """As in Family: the cells."""
        return self.num_cells(tolerance)

    def tolerance_for_cells(self, num_cells: float) -> float:
        """As in Family."""
        most = max(1, int(min(num_cells, self._pyramid.volume.values.size)))
        sizes = self._sizes_to(most)
        return sizes.finest_within(min(most, sizes.max_cells)).tolerance

    def tolerance_for_size(self, size: float) -> float:
        """As in Family."""
        return self.tolerance_for_cells(size)

    def lod_size(self, tolerance: float, num_cells: int) -> float:
        """As in Family."""
        return max(num_cells, 1)

    def has_more_cells(self, tolerance: float, num_cells: float) -> bool:
        """As in Family."""
        most = int(min(num_cells, self._pyramid.volume.values.size))
        sizes = self._sizes_to(max(1, most // _LOOK_AHEAD))
        return sizes.num_cells_at_zero is None if tolerance == 0 else tolerance <= sizes.tolerance_limit

    def _cut(self, tolerance: float) -> Cut:
        finest_level = self._finest_level if tolerance > 0 else self._finest_level_at_zero
        return cut_pyramid(self._pyramid, tolerance, finest_level=finest_level)

    def _sizes_to(self, num_cells: int) -> CutSizes:
        if self._sizes is None or (self._sizes.max_cells < num_cells and self._sizes.num_cells_at_zero is None):
            self._sizes = cut_sizes(
                self._pyramid,
                _LOOK_AHEAD * num_cells,
                finest_level=self._finest_level,
                finest_level_at_zero=self._finest_level_at_zero,
            )
        return self._sizes
