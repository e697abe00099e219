"""The bricks of a frame as both brick rasterisers read them: one array for each quantity, front to back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.bricks import BRICK_SIZE, BrickBatch
from renderer.view import View, screen_rectangles

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class BrickView:
    """Some bricks of a batch in a view, front to back. Positions are in index space, relative to the volume's centre.

    is_mean: bool [n], the bricks above level 0. keys: int64 [n], numbers of bricks: those of level 0 are counted on
    their own, those of all other levels one level after the other. rectangles_px: float64 [n, 4], as
    `screen_rectangles` returns them. bounds: float64 [n, 2, 3], visible bounds. corners: float64 [n, 3], the lowest
    corner of each brick's first cell. cells_per_voxel: float64 [n]. steps: float64 [n], in cells.
    """

    batch: BrickBatch
    order: npt.NDArray[np.uint32]
    view: View
    is_mean: npt.NDArray[np.bool_]
    keys: npt.NDArray[np.int64]
    rectangles_px: Float64
    bounds: Float64
    corners: Float64
    cells_per_voxel: Float64
    steps: Float64


def make_brick_view(batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> BrickView:
    """Return the bricks `batch[order]`, uint32 [n], in a view."""
    cut, centre = batch.cut, batch.cut.volume.centre_index
    levels = cut.levels[order].astype(np.int64)
    first_voxels = cut.cells[order].astype(np.int64) * BRICK_SIZE << levels[:, None]
    return BrickView(
        batch,
        order,
        view,
        is_mean=levels > 0,
        keys=_keys(batch, order),
        rectangles_px=screen_rectangles(batch, order, view),
        bounds=cut.visible_bounds[order] - centre,
        corners=first_voxels - 0.5 - centre,
        cells_per_voxel=np.ldexp(1.0, -levels),
        steps=batch.steps[order],
    )


def _keys(batch: BrickBatch, chosen: npt.NDArray[np.uint32]) -> npt.NDArray[np.int64]:
    """Return the keys of bricks, int64 [n], as in BrickView."""
    keys = np.empty(len(chosen), np.int64)
    levels, cells = batch.cut.levels[chosen], batch.cut.cells[chosen]
    first = 0
    for number, level in enumerate(batch.bricks.levels):
        grid = level.visible_bounds.shape[:3]
        is_here = levels == number
        keys[is_here] = first + np.ravel_multi_index(tuple(cells[is_here, ::-1].T), grid)
        first += int(np.prod(grid)) if number > 0 else 0
    return keys
