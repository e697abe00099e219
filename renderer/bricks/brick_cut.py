"""Find the cut of bricks, which are drawn at a tolerance, and the number of bricks as a function of the tolerance.

As in `renderer.pyramid.cut_size`, a brick is split at every tolerance up to its *split threshold*, the smallest of its
error and the errors of all bricks that contain it. It is in the cut at tolerances above its own threshold, up to its
parent's threshold, if anything in it may be visible:

    bricks at t = P(t) - Q(t)

Here, P(t) is the number of visible bricks whose parent's threshold is at least t, and Q(t) the number of visible bricks
whose own threshold is at least t. The number of bricks may fall a little as t falls: the halo of a brick is wider than
the halos of its children, which may therefore show less of their surroundings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from renderer.bricks.brick_layers import BrickLayers
from renderer.bricks.bricks import BrickLevel, Bricks
from renderer.bricks.layout import BRICK_LEVELS, BRICK_SIZE
from renderer.pyramid import CutSizes, subdivide
from renderer.scene import MIN_TOLERANCE
from renderer.volume import Bools, Float64, Int32, Int64, UInt8, Volume

# The type of a function that tests bricks by their visible bounds, float64 [n, 2, 3] as in BrickCut, and returns
# bool [n].
BoundsTest = Callable[[Float64], Bools]


@dataclass(frozen=True)
class BrickCut:
    """A cut of bricks, coarse levels first, in Morton order within a level. The index of a brick is its id.

    levels: uint8 [n], the level of the cells of each brick.
    cells: int32 [n, 3], the place (x, y, z) of each brick, in widths of a brick, BRICK_SIZE << level voxels.
    visible_bounds: float64 [n, 2, 3], the lowest and the highest corner (x, y, z) of the box around everything that may
        be visible in each brick, in index coordinates.
    step_errors: float64 [n], the error of cells twice as large as the cells of each brick, as in BrickLevel.
    volume: the volume that was cut.
    """

    levels: UInt8
    cells: Int32
    visible_bounds: Float64
    step_errors: Float64
    volume: Volume

    def __len__(self) -> int:
        return len(self.levels)


def cut_bricks(
    bricks: Bricks | BrickLayers, tolerance: float, *, finest_level: int = 0, are_split: BoundsTest | None = None
) -> BrickCut:
    """Return the coarsest bricks whose errors are below `tolerance` (in the measure's unit), none below `finest_level`.

    Bricks in which nothing is visible at their level are left out. are_split: tells which bricks are split down to
    voxels at every tolerance; None if no brick is.
    """
    cells, leaves = np.zeros((1, 3), np.int32), []
    for number in range(len(bricks.levels) - 1, -1, -1):
        (x, y, z), level = cells.T, bricks.levels[number]
        is_leaf = level.errors[z, y, x] < (tolerance if number > finest_level else math.inf)
        if are_split is not None and number > 0:
            is_leaf &= ~are_split(_visible_bounds(level, number, cells))
        drawn = cells[is_leaf & level.is_visible[z, y, x]]
        x, y, z = drawn.T
        bounds = _visible_bounds(level, number, drawn)
        leaves.append((np.full(len(drawn), number, np.uint8), drawn, bounds, level.step_errors[z, y, x]))
        top = number + BRICK_LEVELS
        cells = subdivide(cells[~is_leaf], top, top - 1, bricks.volume.shape_xyz)
    levels, drawn, bounds, step_errors = map(np.concatenate, zip(*leaves, strict=True))
    for array in (levels, drawn, bounds, step_errors):
        array.flags.writeable = False
    return BrickCut(levels, drawn, bounds, step_errors, bricks.volume)


def _visible_bounds(level: BrickLevel, number: int, cells: Int32) -> Float64:
    """Return the visible bounds of bricks of a level, as in BrickCut."""
    x, y, z = cells.T
    return np.asarray((BRICK_SIZE * cells[:, None] + level.visible_bounds[z, y, x]) * 2.0**number - 0.5)


def brick_cut_sizes(
    bricks: Sequence[Bricks | BrickLayers], *, finest_levels: Sequence[int], finest_levels_at_zero: Sequence[int]
) -> CutSizes:
    """Return the sizes of all cuts, for the bricks of several groups of layers together.

    Sizes may fall a little as cuts get finer. An entry of `counts` is therefore the largest size of its cut and of all
    coarser cuts.

    finest_levels, finest_levels_at_zero: the finest level of the cells of each group that are drawn at tolerances above
        0, and at 0.
    """
    at_zero = _count_at_thresholds(bricks, finest_levels_at_zero)[1].max(initial=0)
    thresholds, counts = _count_at_thresholds(bricks, finest_levels)
    is_step = thresholds >= MIN_TOLERANCE
    thresholds, counts = thresholds[is_step], np.maximum.accumulate(counts[np.append(True, is_step)])
    most = max(int(counts[-1]), int(at_zero))
    return CutSizes(thresholds, counts, 0.0, most, max(most, 1))


def _count_at_thresholds(bricks: Sequence[Bricks | BrickLayers], finest_levels: Sequence[int]) -> tuple[Float64, Int64]:
    """Return the thresholds at which the number of bricks changes, and the numbers of bricks, as in CutSizes.

    Returns float64 [n], which may include a threshold of 0, and int64 [n + 1].
    """
    found = [_visible_thresholds(*each) for each in zip(bricks, finest_levels, strict=True)]
    begin, end = (np.sort(np.concatenate(each)) for each in zip(*found, strict=True))
    steps = np.sort(np.concatenate([begin, end]))[::-1]
    is_new = np.append(True, steps[1:] != steps[:-1])  # without np.unique, which would import masked arrays
    steps = steps[is_new & (steps >= 0) & (steps < np.inf)]
    num_begun, num_ended = (len(sorted_) - np.searchsorted(sorted_, steps) for sorted_ in (begin, end))
    return steps, np.array([np.count_nonzero(begin == np.inf), *(num_begun - num_ended)], np.int64)


def _visible_thresholds(bricks: Bricks | BrickLayers, finest_level: int) -> tuple[Float64, Float64]:
    """Return the split thresholds of the parents of visible bricks, and of these bricks themselves: float64 [n]."""
    of_parents, own = [], []
    parent_thresholds = np.full((1, 1, 1), np.inf)
    for number in range(len(bricks.levels) - 1, -1, -1):
        level = bricks.levels[number]
        thresholds = np.full(parent_thresholds.shape, -1.0)
        if number > finest_level:
            thresholds = np.minimum(level.errors, parent_thresholds)
        of_parents.append(parent_thresholds[level.is_visible])
        own.append(thresholds[level.is_visible])
        if number <= finest_level:
            break
        children = np.ix_(*(np.arange(n) // 2 for n in bricks.levels[number - 1].errors.shape))
        parent_thresholds = thresholds[children]
    return np.concatenate(of_parents), np.concatenate(own)
