"""Compute the number of cells of a cut as a function of its tolerance, exactly and without making any cut.

A node is a leaf if its error is below the tolerance. So it is split at every tolerance up to its *split threshold*, the
smallest of its own error and the errors of all nodes that contain it. A cut at tolerance t has

    1 + sum over the nodes with a split threshold >= t of (visible children - 1)

cells, a number that never falls as t falls. From a node to its children, split thresholds never rise, so that the
search ends at nodes with thresholds below a limit: the finest cut of at most n cells takes memory and time in
proportion to n.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import numpy as np

from renderer.pyramid.cut import node_errors, num_visible_voxels, root_cells, visible_children
from renderer.pyramid.pyramid import Pyramid
from renderer.scene import MIN_TOLERANCE
from renderer.volume import Float64, Int64


@dataclass(frozen=True)
class CutSizes:
    """A table of the sizes of all cuts of at most `max_cells` cells.

    split_thresholds: float64 [n], strictly falling, at least MIN_TOLERANCE.
    counts: int64 [n + 1], not falling; counts[k] is the size at tolerances above split_thresholds[k], up to
        split_thresholds[k - 1].
    tolerance_limit: the largest tolerance at which the cut has more than `max_cells` cells, or is unknown; 0 without
        such a tolerance.
    num_cells_at_zero: the number of cells at tolerance 0; None if it is more than `max_cells`, or unknown.
    max_cells: the largest size of a cut in the table.
    """

    split_thresholds: Float64
    counts: Int64
    tolerance_limit: float
    num_cells_at_zero: int | None
    max_cells: int

    def finest_within(self, num_cells: int) -> float:
        """Return the tolerance of the finest cut of at most `num_cells` cells, from 1 to `max_cells`.

        The tolerance is 0, or at least MIN_TOLERANCE, as in scenes. Raises ValueError if `num_cells` is not from 1 to
        `max_cells`.
        """
        if not 1 <= num_cells <= self.max_cells:
            raise ValueError(f"sizes of other cuts: got {num_cells}, expected 1 to {self.max_cells}")
        if self.num_cells_at_zero is not None and self.num_cells_at_zero <= num_cells:
            return 0.0
        last = int(np.searchsorted(self.counts, num_cells, side="right")) - 1
        above = self.split_thresholds[last] if last < len(self.split_thresholds) else self.tolerance_limit
        up_to = self.split_thresholds[last - 1] if last > 0 else sys.float_info.max
        return _round_tolerance(float(above), float(up_to))


def cut_sizes(pyramid: Pyramid, max_cells: int, *, finest_level: int, finest_level_at_zero: int) -> CutSizes:
    """Return the sizes of all cuts of at most `max_cells` cells (at least 1).

    Cuts for which the pyramid was not built, as their tolerance is too small, count as too large.

    finest_level, finest_level_at_zero: the finest level of the cells drawn at tolerances above 0, and at 0. Raises
    ValueError if the pyramid has no cells of these levels.
    """
    finest = min(finest_level, finest_level_at_zero)
    if finest < pyramid.finest_cut.level:
        raise ValueError(f"no pyramid for this level: got {finest}, expected at least {pyramid.finest_cut.level}")
    if pyramid.finest_cut.tolerance > 0:
        just_below = math.nextafter(pyramid.finest_cut.tolerance, 0.0)
        return _collect_thresholds(pyramid, max_cells, finest_level, just_below)
    at_zero = found = _collect_thresholds(pyramid, max_cells, finest_level_at_zero, -math.inf)
    if finest_level != finest_level_at_zero:
        found = _collect_thresholds(pyramid, max_cells, finest_level, 0.0)
    num_cells_at_zero = int(at_zero.counts[-1]) if at_zero.tolerance_limit < 0 else None
    is_positive = found.split_thresholds > 0
    counts = found.counts[np.append(True, is_positive)]
    limit = max(found.tolerance_limit, 0.0)
    return CutSizes(found.split_thresholds[is_positive], counts, limit, num_cells_at_zero, max_cells)


def _collect_thresholds(pyramid: Pyramid, max_cells: int, finest_level: int, limit: float) -> CutSizes:
    """Collect split thresholds above a limit, level by level. The number of cells at tolerance 0 stays None.

    limit: only thresholds above this number are collected; a negative limit includes thresholds of 0. The limit rises
        whenever there are more than `max_cells` cells.
    """
    nodes, cells = root_cells(pyramid)
    parent_thresholds = np.full(len(nodes), np.inf)
    found = CutSizes(np.empty(0), np.array([len(nodes)]), limit, None, max_cells)
    for number in range(pyramid.num_levels, finest_level, -1):
        level = pyramid.levels[number - 1]
        errors = node_errors(pyramid, nodes, cells, number)
        errors[errors < MIN_TOLERANCE] = 0.0  # no tolerance other than 0 is that small
        thresholds = np.minimum(errors, parent_thresholds)
        is_split = thresholds > found.tolerance_limit
        nodes, cells, thresholds = nodes[is_split], cells[is_split], thresholds[is_split]
        num_children = np.bitwise_count(level.masks[nodes]) if number > 1 else num_visible_voxels(pyramid, cells)
        found = _merge_level(found, thresholds, num_children.astype(np.int64) - 1)
        if number > 1:
            is_split = thresholds > found.tolerance_limit
            parent_thresholds = np.repeat(thresholds[is_split], num_children[is_split])
            nodes, cells = visible_children(nodes[is_split], cells[is_split], level)
    return found


def _merge_level(found: CutSizes, thresholds: Float64, num_more: Int64) -> CutSizes:
    """Return a table of sizes with the split nodes of a further level added.

    thresholds: [n], the split threshold of each node. num_more: [n], the number of each node's children, less 1.
    """
    falling, where = np.unique(-np.concatenate([found.split_thresholds, thresholds]), return_inverse=True)
    more = np.bincount(where, np.concatenate([np.diff(found.counts), num_more]))
    counts = found.counts[0] + np.append(0, np.cumsum(more)).astype(np.int64)
    num_within = int(np.searchsorted(counts, found.max_cells, side="right")) - 1
    limit = -float(falling[num_within]) if num_within < len(falling) else found.tolerance_limit
    return CutSizes(-falling[:num_within], counts[: num_within + 1], limit, None, found.max_cells)


def _round_tolerance(above: float, up_to: float) -> float:
    """Return a tolerance above `above` (>= 0) and at most `up_to`, with few digits if possible."""
    middle = 2 * above or 1.0 if up_to == sys.float_info.max else math.sqrt(above or up_to / 4) * math.sqrt(up_to)
    for digits in range(17):
        rounded = float(f"{middle:.{digits}e}")
        if above < rounded <= up_to and rounded >= MIN_TOLERANCE:
            return rounded
    return up_to
