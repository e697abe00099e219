"""What pictures are made of: splats of the octree's cells, or bricks. What the frame loop, the schedules and the sweeps
need to know of a footprint, and no more, so that none of them asks which one it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from renderer.bricks import BrickBatch
from renderer.draw import CellEdges
from renderer.splats import SplatBatch
from renderer.view import View

# In which order a rasteriser draws, uint32 [k] of the batch, and its share of the picture; the shares' sum is 1.
Orders = Sequence[tuple[float, npt.NDArray[np.uint32]]]

# Told the name of a step that has just been done.
Lap = Callable[[str], object]


class LOD(Protocol):
    """What is drawn at a tolerance, from any side.

    num_cells: of the cut, each of which is a splat or a brick. splats: what a rasteriser takes. edges: lines of an
    overlay.
    """

    @property
    def tolerance(self) -> float: ...

    @property
    def num_cells(self) -> int: ...

    @property
    def splats(self) -> SplatBatch | BrickBatch: ...

    @property
    def edges(self) -> CellEdges | None: ...

    def orders(self, view: View) -> Orders:
        """What of it can be seen in a view, as the rasteriser takes it; the same splats in each order."""

    def workload(self, orders: Orders, view: View) -> tuple[float, float]:
        """What drawing it in these orders costs: the number of splats, and that of pixels looked at, each as often."""


class Primitive(Protocol):
    """A footprint's way from tolerances to details.

    A film on a budget of time goes through *sizes*, which rise as tolerances fall; what they count is the family's.
    few: a size at which a frame shows what it is. growth: from one size to the next that is worth trying, and the most
    that one goes at once; step: the most where a little time is wanted, so that the film does not pop.
    """

    @property
    def initial_size(self) -> float: ...

    @property
    def size_ratio(self) -> float: ...

    @property
    def small_size_ratio(self) -> float: ...

    def make_lod(self, tolerance: float, lap: Lap) -> LOD:
        """Cut at a tolerance, and made ready for the rasteriser."""

    def num_cells(self, tolerance: float) -> int:
        """Of the cut at a tolerance."""

    def work(self, tolerance: float) -> float:
        """How much is drawn at a tolerance, in cells or samples: in the whole, it rises as the tolerance falls."""

    def tolerance_for_cells(self, num_cells: float) -> float:
        """The tolerance of the finest cut with at most so many cells."""

    def tolerance_for_size(self, size: float) -> float:
        """The tolerance of the finest detail of at most this size."""

    def lod_size(self, tolerance: float, num_cells: int) -> float:
        """Of a detail at a tolerance, which has so many cells; at least 1."""

    def has_more_cells(self, tolerance: float, num_cells: float) -> bool:
        """Whether the cut at a tolerance has more cells than so many, or than some more, without making it.

        False where the cut is made at once, so that there is no use in asking.
        """
