"""Compute the number of bricks of a cut as a function of its tolerance, without making any cut.

As in `renderer.pyramid.cut_size`, a brick is split at every tolerance up to its *split threshold*, the least of its
error and the split thresholds of the bricks around it. It is in the cut at tolerances above its own threshold, up to
that of its parent, if anything in it may be visible:

    bricks at t = number of visible ones whose parent's threshold is at least t - number of those whose own is

This may fall a little as t falls: the halo of a brick is wider than those of its children, so that together they may
show less of their surroundings.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.bricks.bricks import Bricks
from renderer.pyramid import CutSizes
from renderer.scene import MIN_TOLERANCE

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


def brick_cut_sizes(bricks: Bricks, *, finest_level: int, finest_level_at_zero: int) -> CutSizes:
    """Return the sizes of all cuts; each of `counts` is the largest size of that cut and of all coarser ones.

    finest_level, finest_level_at_zero: of the cells drawn at tolerances above 0, and at 0.
    """
    at_zero = _count_at_thresholds(bricks, finest_level_at_zero)[1].max(initial=0)
    thresholds, counts = _count_at_thresholds(bricks, finest_level)
    is_step = thresholds >= MIN_TOLERANCE
    thresholds, counts = thresholds[is_step], np.maximum.accumulate(counts[np.append(True, is_step)])
    most = max(int(counts[-1]), int(at_zero))
    return CutSizes(thresholds, counts, 0.0, most, max(most, 1))


def _count_at_thresholds(bricks: Bricks, finest_level: int) -> tuple[Float64, Int64]:
    """Return CutSizes.split_thresholds, float64 [n], with those of 0, and CutSizes.counts, int64 [n + 1]."""
    of_parents, own = [], []  # thresholds of visible bricks
    parent_thresholds = np.full((1, 1, 1), np.inf)
    for number in range(len(bricks.levels) - 1, -1, -1):
        level = bricks.levels[number]
        visible = (level.visible_bounds[..., 1, :] > level.visible_bounds[..., 0, :]).all(axis=-1)
        thresholds = np.full(parent_thresholds.shape, -1.0)
        if number > finest_level:
            thresholds = np.minimum(level.errors, parent_thresholds)
        of_parents.append(parent_thresholds[visible])
        own.append(thresholds[visible])
        if number <= finest_level:
            break
        children = np.ix_(*(np.arange(n) // 2 for n in bricks.levels[number - 1].errors.shape))
        parent_thresholds = thresholds[children]
    begin, end = np.sort(np.concatenate(of_parents)), np.sort(np.concatenate(own))
    steps = np.unique(np.concatenate([begin, end]))[::-1]
    steps = steps[(steps >= 0) & (steps < np.inf)]
    num_begun, num_ended = (len(sorted_) - np.searchsorted(sorted_, steps) for sorted_ in (begin, end))
    return steps, np.array([np.count_nonzero(begin == np.inf), *(num_begun - num_ended)], np.int64)
