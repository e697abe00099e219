"""Means of the levels that a pyramid for bricks does not store: made from voxels when a brick is drawn.

Of a brick and its apron, 18^3 cells, the voxels are classified and averaged block by block, by what builds pyramids:
the means are those that it would have stored, bit for bit.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.bricks.kernels import BRICK_SIZE, HALO, PADDED_BRICK_SIZE
from renderer.jit import jit
from renderer.pyramid import (
    BLOCK_SIZE,
    BLOCKS_PER_TASK,
    NODE_OFFSETS,
    Pyramid,
    Scratch,
    classify_blocks,
    opacities_to_depths,
    store_scaled,
    visible_blocks,
)
from renderer.threads import ThreadPool
from renderer.transfer import raw_voxels

Array = npt.NDArray[Any]
Float32 = npt.NDArray[np.float32]
Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]
UInt64 = npt.NDArray[np.uint64]


# What a cache of made bricks may take.
MAX_CACHE_BYTES = 256 << 20
# Bricks that are worth a thread.
MIN_BRICKS_PER_THREAD = 8


class MeanCache:
    """Bricks that were made, for pictures of more bricks than the device holds: they would be made again for each.

    What the last two pictures did not need goes first. What they did stays: of bricks that are asked for in turns, and
    are too many, those that were asked for longest ago would be the next. threads: that make them.
    """

    def __init__(self, threads: ThreadPool | None = None) -> None:
        self._threads = threads or ThreadPool()
        self._kept: dict[tuple[int, ...], Array] = {}  # stored means by level and cell
        self._last_used: dict[tuple[int, ...], int] = {}  # the number of the picture, longest ago first
        self._picture, self._num_bytes, self._is_used = 0, 0, False

    def begin(self, *, is_enabled: bool) -> None:
        """Another picture begins, which has more bricks than the device holds, or not."""
        self._picture, self._is_used = self._picture + 1, is_enabled
        if not is_enabled:
            self._kept.clear()
            self._last_used.clear()
            self._num_bytes = 0

    def get(self, pyramid: Pyramid, level: int, cells: Int32) -> Array:
        """As `recompute_means`."""
        if not self._is_used:
            return self._made(pyramid, level, cells)
        keys = [(level, *cell) for cell in cells.tolist()]
        missing = [k for k, key in enumerate(keys) if key not in self._kept]
        made = dict(zip(missing, self._made(pyramid, level, cells[missing]), strict=True))
        means = np.stack([made[k] if k in made else self._kept[key] for k, key in enumerate(keys)])
        for k, key in enumerate(keys):
            if k not in made:
                del self._last_used[key]
                self._last_used[key] = self._picture  # at the end
        for k, brick in made.items():
            self._keep(keys[k], brick)
        return means

    def _made(self, pyramid: Pyramid, level: int, cells: Int32) -> Array:
        return self._threads.map_concatenated(partial(recompute_means, pyramid, level), cells, MIN_BRICKS_PER_THREAD)

    def _keep(self, key: tuple[int, ...], made: Array) -> None:
        """Keep a brick if there is room."""
        while self._num_bytes + made.nbytes > MAX_CACHE_BYTES:
            oldest = next(iter(self._last_used), None)
            if oldest is None or self._last_used[oldest] >= self._picture - 1:
                return
            self._num_bytes -= self._kept.pop(oldest).nbytes
            del self._last_used[oldest]
        self._kept[key] = made.copy()  # not a view of all that was made with it
        self._num_bytes += made.nbytes
        self._last_used[key] = self._picture


def recompute_means(pyramid: Pyramid, level: int, cells: Int32) -> Array:
    """float16 or float32 [n, 18, 18, 18, 4]: the means that would be stored of bricks of level 1 or 2 at `cells` [n, 3]
    (x, y, z) and of the cells around them; 0 where nothing is visible.

    Raises InputError where the volume's file was changed.
    """
    means = np.zeros((len(cells), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, 4), np.float32)
    num_blocks = (-(-(PADDED_BRICK_SIZE << level) // BLOCK_SIZE)) ** 3  # of a brick, at most
    num_at_once = max(1, BLOCKS_PER_TASK // num_blocks)
    scratch = Scratch.empty(num_at_once * num_blocks, None)
    for first in range(0, len(cells), num_at_once):
        part = slice(first, first + num_at_once)
        pyramid.volume.require_unchanged()
        _average_voxels(pyramid, level, BRICK_SIZE * cells[part].astype(np.int64) - HALO, scratch, means[part])
    pyramid.volume.require_unchanged()
    if pyramid.max_depth is not None:
        visible = means[..., 3] > 0
        depths = means[visible]
        opacities_to_depths(depths, pyramid.max_depth)
        means[visible] = depths
    stored: Array = np.empty(means.shape, pyramid.levels[0].means.dtype)
    store_scaled(means, 1 / pyramid.mean_unit, stored)
    return stored


def _average_voxels(pyramid: Pyramid, level: int, corners: Int64, scratch: Scratch, out: Float32) -> None:
    """The means of cells from each of `corners` [n, 3] (x, y, z) on, averaged as the pyramid has them, to `out`
    [n, 18, 18, 18, 4]."""
    raw = raw_voxels(pyramid.volume)
    starts, extents = np.empty((2, scratch.nodes[2][0].shape[0], 3), np.uint64)
    bricks = np.empty(len(starts), np.int64)
    num = _list_blocks(corners, level, raw.shape, starts, extents, bricks)
    visible = np.flatnonzero(visible_blocks(raw, pyramid.mean_classifier, starts[:num], extents[:num]))
    starts, extents, bricks = starts[visible], extents[visible], bricks[visible]
    scratch = scratch.first(len(visible))
    classify_blocks(raw, pyramid.mean_classifier, starts, extents, scratch.voxels, scratch.nodes)
    _copy_nodes(scratch.nodes[level - 1][0], (starts.astype(np.int64) >> level) - corners[bricks], bricks, out)


@jit
def _list_blocks(
    corners: Int64, level: int, shape: tuple[int, int, int], starts: UInt64, extents: UInt64, bricks: Int64
) -> int:
    """The blocks that cover 18^3 cells from each of `corners` [n, 3] on, as far as a volume of this shape [z, y, x] has
    them: their first voxels and extents [., 3] (x, y, z), and the numbers of their bricks [.]; how many they are."""
    num = 0
    first, end = np.empty(3, np.int64), np.empty(3, np.int64)
    for i in range(len(corners)):
        for axis in range(3):
            first[axis] = max(corners[i, axis], 0) << level
            end[axis] = min((corners[i, axis] + PADDED_BRICK_SIZE) << level, shape[2 - axis])
        for z in range(first[2], end[2], BLOCK_SIZE):
            for y in range(first[1], end[1], BLOCK_SIZE):
                for x in range(first[0], end[0], BLOCK_SIZE):
                    starts[num, 0], starts[num, 1], starts[num, 2] = x, y, z
                    extents[num, 0] = min(end[0] - x, BLOCK_SIZE)
                    extents[num, 1] = min(end[1] - y, BLOCK_SIZE)
                    extents[num, 2] = min(end[2] - z, BLOCK_SIZE)
                    bricks[num] = i
                    num += 1
    return num


@jit
def _copy_nodes(nodes: Float32, places: Int64, bricks: Int64, out: Float32) -> None:
    """Nodes [g, n, 4] of groups whose first cells belong to `places` [g, 3] (x, y, z) of `bricks` [g] to `out`
    [., z, y, x, 4], as far as they fit."""
    side = 4 if nodes.shape[1] == 64 else 2
    place = NODE_OFFSETS[:4] if side == 4 else NODE_OFFSETS[4:]
    for g in range(len(nodes)):
        of_brick = out[bricks[g]]
        x0, y0, z0 = places[g, 0], places[g, 1], places[g, 2]
        for z in range(min(side, PADDED_BRICK_SIZE - z0)):
            for y in range(min(side, PADDED_BRICK_SIZE - y0)):
                for x in range(min(side, PADDED_BRICK_SIZE - x0)):
                    of_brick[z0 + z, y0 + y, x0 + x] = nodes[g, place[x] + 2 * place[y] + 4 * place[z]]
