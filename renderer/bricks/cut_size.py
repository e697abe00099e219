"""How many bricks a cut has, as a function of its tolerance, without making any cut.

As in `renderer.pyramid.cut_size`, a brick is divided at every tolerance up to its *division*, the least of its largest
error and the divisions of the bricks around it. It is in the cut at tolerances above its own division and up to that of
the brick around it, if anything may be seen in it:

    bricks at t = number of visible ones whose parent's division is at least t - number of those whose own is

This can fall a little as t falls, where the parts of a brick show less of their surroundings than the whole does, whose
apron is wider.
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
    """The sizes of all cuts: what each of `counts` tells of is the largest of that cut and those coarser than it.

    finest_level, finest_level_at_zero: of the cells drawn at tolerances above 0, and at 0.
    """
    at_zero = _count_at_thresholds(bricks, finest_level_at_zero)[1].max(initial=0)
    divisions, counts = _count_at_thresholds(bricks, finest_level)
    is_step = divisions >= MIN_TOLERANCE
    divisions, counts = divisions[is_step], np.maximum.accumulate(counts[np.append(True, is_step)])
    most = max(int(counts[-1]), int(at_zero))
    return CutSizes(divisions, counts, 0.0, most, max(most, 1))


def _count_at_thresholds(bricks: Bricks, finest_level: int) -> tuple[Float64, Int64]:
    """float64 [n], int64 [n + 1], as divisions and counts in CutSizes, and with divisions of 0."""
    above, below = [], []  # of visible bricks: the divisions of their parents, and their own
    around = np.full((1, 1, 1), np.inf)
    for number in range(len(bricks.levels) - 1, -1, -1):
        level = bricks.levels[number]
        visible = (level.visible_bounds[..., 1, :] > level.visible_bounds[..., 0, :]).all(axis=-1)
        divisions = np.minimum(level.errors, around) if number > finest_level else np.full(around.shape, -1.0)
        above.append(around[visible])
        below.append(divisions[visible])
        if number <= finest_level:
            break
        around = _repeat_for_children(divisions, bricks.levels[number - 1].errors.shape)
    begin, end = np.concatenate(above), np.concatenate(below)
    steps = np.unique(np.concatenate([begin, end]))[::-1]
    steps = steps[(steps >= 0) & (steps < np.inf)]
    counts = [np.count_nonzero(begin == np.inf), *(_count_at_least(begin, steps) - _count_at_least(end, steps))]
    return steps, np.array(counts, np.int64)


def _count_at_least(values: Float64, least: Float64) -> Int64:
    """int64 [n]: how many of the values are at least each of `least`."""
    return np.asarray(len(values) - np.searchsorted(np.sort(values), least))


def _repeat_for_children(values: Float64, shape: tuple[int, ...]) -> Float64:
    """[z, y, x]: those of the bricks around the bricks of the level below, which has this shape."""
    z, y, x = (np.arange(n) // 2 for n in shape)
    return np.asarray(values[np.ix_(z, y, x)])
