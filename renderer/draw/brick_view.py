"""A picture's bricks as a drawer is told of them, and their texels by number."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from renderer.bricks import (
    BRICK_SIZE,
    MIN_BRICKS_PER_THREAD,
    PADDED_BRICK_SIZE,
    BrickBatch,
    MeanCache,
    mean_texels,
    scalar_texels,
)
from renderer.threads import ThreadPool
from renderer.view import View, screen_rectangles

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class BrickView:
    """Some bricks of a batch in a view, front to back; index space relative to the volume's centre.

    is_mean: bool [n], those above level 0. keys: int64 [n], numbers of bricks; those of level 0 by themselves, those of
    all others one level after the other. rectangles_px: float64 [n, 4], as `screen_rectangles` has them.
    bounds: float64 [n, 2, 3], of the boxes. corners: float64 [n, 3], the lowest corner of each brick's first cell.
    cells_per_voxel, steps: float64 [n], the latter in cells.
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

    def is_of(self, batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> bool:
        """Whether it was made from these very objects."""
        return self.batch is batch and self.order is order and self.view is view


def make_brick_view(batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> BrickView:
    """Of the bricks `order`, uint32 [n], of a batch."""
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
    """int64 [n], as in BrickView."""
    keys = np.empty(len(chosen), np.int64)
    levels, cells = batch.cut.levels[chosen], batch.cut.cells[chosen]
    first = 0
    for level, here in enumerate(batch.bricks.levels):
        grid = here.visible_bounds.shape[:3]
        is_here = levels == level
        keys[is_here] = first + np.ravel_multi_index(tuple(cells[is_here, ::-1].T), grid)
        first += int(np.prod(grid)) if level > 0 else 0
    return keys


def _cells(keys: npt.NDArray[np.int64], grid: tuple[int, ...]) -> npt.NDArray[np.int32]:
    """int32 [n, 3]: x, y, z of bricks by their numbers in a grid."""
    z, y, x = np.unravel_index(keys, grid)
    return np.column_stack([x, y, z]).astype(np.int32)


def scalar_texels_by_key(batch: BrickBatch, threads: ThreadPool, keys: npt.NDArray[np.int64]) -> Float32:
    """Texels of bricks of level 0, by their keys: float32 [n, p, p, p(, 4)], p = PADDED_BRICK_SIZE."""
    cells = _cells(keys, batch.bricks.levels[0].visible_bounds.shape[:3])
    return threads.map_concatenated(
        partial(scalar_texels, batch.bricks, lit=batch.shading is not None), cells, MIN_BRICKS_PER_THREAD
    )  # fmt: skip


def mean_texels_by_key(batch: BrickBatch, made: MeanCache, keys: npt.NDArray[np.int64]) -> Float32:
    """Texels of bricks above level 0, by their keys: float32 [n, p, p, p, 4], p = PADDED_BRICK_SIZE."""
    texels = np.empty((len(keys), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, 4), np.float32)
    first = 0
    for level, here in enumerate(batch.bricks.levels[1:], 1):
        grid = here.visible_bounds.shape[:3]
        is_here = (keys >= first) & (keys < first + int(np.prod(grid)))
        if is_here.any():
            texels[is_here] = mean_texels(batch.bricks, level, _cells(keys[is_here] - first, grid), made)
        first += int(np.prod(grid))
    return texels
