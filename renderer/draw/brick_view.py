"""The bricks of a frame as both brick rasterisers read them: one record for each brick, front to back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.bricks import BRICK_SIZE, BrickBatch
from renderer.view import View, screen_rectangles

# Positions are in index space, relative to the volume's centre.
BRICK = np.dtype(
    [
        ("key", "i8"),  # its number: level 0 is counted on its own, all other levels one after the other
        ("is_mean", "?"),  # is above level 0
        ("rectangle_px", "f8", 4),  # as `screen_rectangles` returns it
        ("box_low", "f8", 3),  # the corners of its visible bounds
        ("box_high", "f8", 3),
        ("first_corner", "f8", 3),  # the lowest corner of its first cell
        ("cells_per_voxel", "f8"),
        ("step_cells", "f8"),
        ("texel_offset", "i8"),  # where it begins in the atlas; CPU only
    ],
    align=True,
)


class BrickView(NamedTuple):
    """The bricks `batch[order]` in a view, front to back. bricks: BRICK [n]."""

    batch: BrickBatch
    order: npt.NDArray[np.uint32]
    view: View
    bricks: npt.NDArray[np.void]


def make_brick_view(batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> BrickView:
    """Return the bricks `batch[order]`, uint32 [n], in a view."""
    cut, centre = batch.cut, batch.cut.volume.centre_index
    levels, bounds = cut.levels[order].astype(np.int64), cut.visible_bounds[order] - centre
    bricks = np.zeros(len(order), BRICK)
    first_key = 0
    for number, level in enumerate(batch.bricks.levels):
        grid = level.visible_bounds.shape[:3]
        is_here = levels == number
        bricks["key"][is_here] = first_key + np.ravel_multi_index(tuple(cut.cells[order][is_here, ::-1].T), grid)
        first_key += int(np.prod(grid)) if number > 0 else 0
    bricks["is_mean"] = levels > 0
    bricks["rectangle_px"] = screen_rectangles(batch, order, view)
    bricks["box_low"], bricks["box_high"] = bounds[:, 0], bounds[:, 1]
    bricks["first_corner"] = (cut.cells[order].astype(np.int64) * BRICK_SIZE << levels[:, None]) - 0.5 - centre
    bricks["cells_per_voxel"] = np.ldexp(1.0, -levels)
    bricks["step_cells"] = batch.steps[order]
    return BrickView(batch, order, view, bricks)
