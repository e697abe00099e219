"""How many cells a cut has, as a function of its tolerance: exactly, and without making any cut.

A node is divided at every tolerance that is not above its own error nor above that of any node around it: at those up
to its *division*, the least of these errors (a node is a leaf when its error is below the tolerance). So a cut at
tolerance t has

    1 + sum over the nodes with division >= t of (visible children - 1)

cells, which never falls as t falls. Going down the pyramid, divisions never rise, so that nodes which are too many
already need not be followed: the finest cut of at most n cells is found with memory and time in proportion to n.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.pyramid.cut import node_errors, num_visible_voxels, visible_children
from renderer.pyramid.pyramid import Pyramid
from renderer.scene import MIN_TOLERANCE

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


class CutSize(NamedTuple):
    """A tolerance and the number of cells in its cut."""

    tolerance: float
    num_cells: int


@dataclass(frozen=True)
class CutSizes:
    """All cuts of at most `max_cells` cells.

    split_thresholds: float64 [n], falling, each different and at least MIN_TOLERANCE.
    counts: int64 [n + 1], not falling; the cut has counts[k] cells at tolerances above divisions[k] and up to
        divisions[k - 1].
    tolerance_limit: tolerances up to it have more than `max_cells` cells, or no pyramid; 0 where no tolerance above 0
    has. num_cells_at_zero: cells at tolerance 0; None where they are more than `max_cells`, or unknown.
    """

    split_thresholds: Float64
    counts: Int64
    tolerance_limit: float
    num_cells_at_zero: int | None
    max_cells: int

    def finest_within(self, num_cells: int) -> CutSize:
        """The finest cut of at most so many cells, which are at least 1 and at most `max_cells`.

        Its tolerance is one that a scene can have, by frame, too: 0 or from MIN_TOLERANCE on.
        """
        if not 1 <= num_cells <= self.max_cells:
            raise ValueError(f"sizes of other cuts: got {num_cells}, expected 1 to {self.max_cells}")
        if self.num_cells_at_zero is not None and self.num_cells_at_zero <= num_cells:
            return CutSize(0.0, self.num_cells_at_zero)
        last = int(np.searchsorted(self.counts, num_cells, side="right")) - 1
        above = self.split_thresholds[last] if last < len(self.split_thresholds) else self.tolerance_limit
        up_to = self.split_thresholds[last - 1] if last > 0 else sys.float_info.max
        return CutSize(_round_tolerance(float(above), float(up_to)), int(self.counts[last]))


def cut_sizes(pyramid: Pyramid, max_cells: int, *, finest_level: int, finest_level_at_zero: int) -> CutSizes:
    """The sizes of all cuts of at most `max_cells` cells (at least 1).

    Of a pyramid that was built for tolerances from a least one on, those of its cuts, as if others had too many.

    finest_level, finest_level_at_zero: of the cells drawn at tolerances above 0, and at 0. Raises ValueError where the
    pyramid has no cells of these levels.
    """
    finest = min(finest_level, finest_level_at_zero)
    if finest < pyramid.finest_level:
        raise ValueError(f"no pyramid for this level: got {finest}, expected at least {pyramid.finest_level}")
    if pyramid.min_tolerance > 0:
        just_below = math.nextafter(pyramid.min_tolerance, 0.0)
        return CutSizes(
            *_collect_thresholds(pyramid, max_cells, finest_level, tolerance_limit=just_below), None, max_cells
        )
    at_zero = _collect_thresholds(pyramid, max_cells, finest_level_at_zero, tolerance_limit=-math.inf)
    num_cells_at_zero = int(at_zero.counts[-1]) if at_zero.tolerance_limit < 0 else None
    found = (
        at_zero
        if finest_level == finest_level_at_zero
        else _collect_thresholds(pyramid, max_cells, finest_level, tolerance_limit=0.0)
    )
    is_positive = found.split_thresholds > 0
    counts = found.counts[np.append(True, is_positive)]
    return CutSizes(
        found.split_thresholds[is_positive], counts, max(found.tolerance_limit, 0.0), num_cells_at_zero, max_cells
    )


class _CutSizeSteps(NamedTuple):
    """As in CutSizes, of tolerances above `beyond`, which may be negative; and divisions may be 0."""

    split_thresholds: Float64
    counts: Int64
    tolerance_limit: float


def _collect_thresholds(pyramid: Pyramid, max_cells: int, finest_level: int, tolerance_limit: float) -> _CutSizeSteps:
    """Down the levels, following the nodes that are divided at a tolerance above `beyond`, which rises meanwhile."""
    num_roots = len(pyramid.levels[-1].errors)
    nodes, cells = np.arange(num_roots), np.zeros((num_roots, 3), np.int32)
    around = np.full(num_roots, np.inf)  # the divisions of the parents
    found = _CutSizeSteps(np.empty(0), np.array([num_roots]), tolerance_limit)
    for number in range(pyramid.num_levels, finest_level, -1):
        level = pyramid.levels[number - 1]
        errors = node_errors(pyramid, nodes, cells, number)
        errors[errors < MIN_TOLERANCE] = 0.0  # no other tolerance is that small
        divisions = np.minimum(errors, around)
        is_kept = divisions > found.tolerance_limit
        nodes, cells, divisions = nodes[is_kept], cells[is_kept], divisions[is_kept]
        num_children = np.bitwise_count(level.masks[nodes]) if number > 1 else num_visible_voxels(pyramid, cells)
        found = _merge_level(found, divisions, num_children.astype(np.int64) - 1, max_cells)
        if number > 1:
            is_kept = divisions > found.tolerance_limit
            around = np.repeat(divisions[is_kept], num_children[is_kept])
            nodes, cells = visible_children(nodes[is_kept], cells[is_kept], level.masks, level.first_children)
    return found


def _merge_level(found: _CutSizeSteps, divisions: Float64, num_more: Int64, max_cells: int) -> _CutSizeSteps:
    """With nodes of one level more, each of which has `num_more` children besides the one that takes its place."""
    falling, where = np.unique(-np.concatenate([found.split_thresholds, divisions]), return_inverse=True)
    more = np.bincount(where, np.concatenate([np.diff(found.counts), num_more]))
    counts = found.counts[0] + np.append(0, np.cumsum(more)).astype(np.int64)
    num_kept = int(np.searchsorted(counts, max_cells, side="right")) - 1
    beyond = -float(falling[num_kept]) if num_kept < len(falling) else found.tolerance_limit
    return _CutSizeSteps(-falling[:num_kept], counts[: num_kept + 1], beyond)


def _round_tolerance(above: float, up_to: float) -> float:
    """A tolerance above the one (>= 0) and not above the other, of few digits where there is room for it."""
    middle = 2 * above or 1.0 if up_to == sys.float_info.max else math.sqrt(above or up_to / 4) * math.sqrt(up_to)
    for digits in range(17):
        rounded = float(f"{middle:.{digits}e}")
        if above < rounded <= up_to and rounded >= MIN_TOLERANCE:
            return rounded
    return up_to
