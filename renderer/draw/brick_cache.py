"""Keep the texels of bricks in slots of atlases, and evict those that were drawn longest ago.

An atlas has up to MAX_ATLAS_BYTES. The size of a volume is therefore no limit: with less memory bricks are made more
often. One atlas holds the scalars of level 0, another the means of the levels above.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from renderer.bricks import (
    BRICK_SIZE,
    MIN_BRICKS_PER_THREAD,
    PADDED_BRICK_SIZE,
    BrickBatch,
    Bricks,
    MeanCache,
    mean_texels,
    scalar_texels,
)
from renderer.kernels import ThreadPool
from renderer.view import RaySetup, View, ray_setup, screen_rectangles
from renderer.volume import Bools, Float32, Float64, Int64, UInt32

MAX_ATLAS_BYTES = 256 << 20
# Bricks whose texels are made at a time before they are written.
_UPLOAD_BATCH = 256
# Floats behind the last texel that loads of whole rows touch.
_READ_BEHIND = 2


class Atlas:
    """A store of bricks of one kind, in slots. The caller gives each brick a key, a number from 0 to `num_keys` - 1.

    num_channels: 1 or 4, float32. max_slots: the number of bricks that it may hold.
    has_gradients: a brick of 4 channels has all its scalars first, which are read more often than their gradients.
    texels: float32 [slots * PADDED_BRICK_SIZE^3 * num_channels], brick after brick.
    """

    def __init__(self, num_channels: int, num_keys: int, *, has_gradients: bool = False) -> None:
        self._has_gradients, self._brick_floats = has_gradients, PADDED_BRICK_SIZE**3 * num_channels
        fitting = max(1, MAX_ATLAS_BYTES // (4 * self._brick_floats))
        self.num_channels, self.max_slots = num_channels, min(num_keys, fitting)
        self.texels = np.empty(0, np.float32)
        self._slot_from_key = np.full(num_keys, -1, np.int64)  # -1: not in the atlas
        self._key_from_slot = np.empty(0, np.int64)  # -1: free
        self._last_used = np.empty(0, np.int64)
        self._use_counter = 0

    def texel_offsets(self, slots: Int64) -> Int64:
        """Return where the bricks in these slots begin in `texels`, halo included: int64 [n]."""
        return slots * self._brick_floats

    def reserve(self) -> None:
        """Make all slots: those that are unused take no memory, and growing later would need a copy of all texels."""
        if not len(self.texels):
            self.texels = np.empty(self.max_slots * self._brick_floats + _READ_BEHIND, np.float32)
            self._resize(self.max_slots)

    def release(self) -> None:
        """Free the memory."""
        self.texels = np.empty(0, np.float32)
        self._resize(0)

    def num_missing(self, keys: Int64) -> int:
        """Return how many of these bricks are not in the atlas."""
        return int(np.count_nonzero(self._slot_from_key[keys] < 0))

    def upload(self, keys: Int64, make_texels: Callable[[Int64], Float32]) -> Int64:
        """Upload the bricks that are missing, and return the slots of all: int64 [n].

        keys: int64 [n], all different, at most as many as there are slots. make_texels: returns the texels of missing
        bricks, float32 [m, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE(, 4)], from their indices in `keys`.
        Where it raises, the bricks that were written before stay, and the others are not in the atlas.
        """
        self._use_counter += 1
        slots = self._slot_from_key[keys]
        missing = np.flatnonzero(slots < 0)
        self._last_used[slots[slots >= 0]] = self._use_counter  # first, so that none of them is evicted
        if len(missing):
            free = np.argsort(self._last_used, kind="stable")[: len(missing)]
            evicted = self._key_from_slot[free]
            self._slot_from_key[evicted[evicted >= 0]] = -1
            self._key_from_slot[free] = -1
            for first in range(0, len(missing), _UPLOAD_BATCH):
                part, into = missing[first : first + _UPLOAD_BATCH], free[first : first + _UPLOAD_BATCH]
                self._write(into, make_texels(part))
                self._slot_from_key[keys[part]], self._key_from_slot[into] = into, keys[part]
                self._last_used[into] = self._use_counter
        return self._slot_from_key[keys]

    def _write(self, slots: Int64, texels: Float32) -> None:
        """Write the texels of bricks to their slots."""
        bricks = self.texels[:-_READ_BEHIND].reshape(-1, self._brick_floats)
        if self._has_gradients and self.num_channels > 1:
            texels = texels.reshape(len(slots), -1, self.num_channels)
            bricks[slots, : texels.shape[1]] = texels[..., 0]
            bricks[slots, texels.shape[1] :] = texels[..., 1:].reshape(len(slots), -1)
        else:
            bricks[slots] = texels.reshape(len(slots), -1)

    def _resize(self, num: int) -> None:
        """Note that there are `num` slots now, all of them free."""
        self._slot_from_key[:] = -1
        self._key_from_slot, self._last_used = np.full(num, -1, np.int64), np.zeros(num, np.int64)


class BrickView(NamedTuple):
    """A view of the bricks `batch[order]`, front to back. Positions are in index space, from the volume's centre.

    keys: int64 [n], their numbers: level 0 is counted on its own, all other levels one after the other.
    is_mean: bool [n], whether they are above level 0.
    rectangles_px: float64 [n, 4], as `screen_rectangles` returns them.
    boxes: float64 [n, 11]: the lowest [3] and the highest corner [3] of the visible bounds, the lowest corner of the
        first cell [3], cells per voxel, and the length of a step in cells.
    """

    batch: BrickBatch
    order: UInt32
    view: View
    rays: RaySetup
    keys: Int64
    is_mean: Bools
    rectangles_px: Float64
    boxes: Float64


def make_brick_view(batch: BrickBatch, order: UInt32, view: View) -> BrickView:
    """Return the bricks `batch[order]`, uint32 [n], in a view."""
    cut, centre = batch.cut, batch.cut.volume.centre_index
    levels, cells = cut.levels[order].astype(np.int64), cut.cells[order].astype(np.int64)
    grids = np.array([level.errors.shape for level in batch.bricks.levels])
    sizes = grids.prod(axis=1)
    first_keys = np.cumsum(sizes) - sizes - sizes[0]
    first_keys[0] = 0
    (x, y, z), (_, num_rows, num_columns) = cells.T, grids[levels].T
    first_corners = (cells * BRICK_SIZE << levels[:, None]) - 0.5 - centre
    bounds = (cut.visible_bounds[order] - centre).reshape(-1, 6)
    return BrickView(
        batch,
        order,
        view,
        ray_setup(cut.volume, batch.model_unit, view),
        first_keys[levels] + (z * num_rows + y) * num_columns + x,
        levels > 0,
        screen_rectangles(batch, order, view),
        np.column_stack([bounds, first_corners, np.ldexp(1.0, -levels), batch.steps[order]]),
    )


class BrickCache:
    """A cache of the bricks of one volume, in an atlas of scalars and one of means.

    threads: compute the texels of bricks, and draw; `release` ends them. atlases: of scalars and of means.
    """

    def __init__(self, num_threads: int) -> None:
        self.threads = ThreadPool(num_threads)
        self._bricks: Bricks | None = None
        self.atlases: tuple[Atlas, ...] = ()
        self._means = MeanCache(self.threads)
        self._brick_view: BrickView | None = None  # the last one: it may be uploaded and then drawn

    def upload(self, batch: BrickBatch, order: UInt32, view: View) -> bool:
        """Upload the bricks `batch[order]`, and return whether any of them was missing.

        Do nothing where there are not enough slots: then bricks are uploaded while they are drawn.
        """
        brick_view = self._prepare(batch, order, view)
        keys = [(atlas, brick_view.keys[is_chosen]) for atlas, is_chosen in self._parts(brick_view)]
        has_room = all(len(of_atlas) <= atlas.max_slots for atlas, of_atlas in keys)
        if not has_room or not any(atlas.num_missing(of_atlas) for atlas, of_atlas in keys):
            return False
        self._means.begin(is_enabled=False)
        list(self.upload_groups(brick_view))
        return True

    def begin_frame(self, batch: BrickBatch, order: UInt32, view: View) -> BrickView:
        """Return the bricks `batch[order]` as they are drawn, front to back."""
        brick_view = self._prepare(batch, order, view)
        has_room = np.count_nonzero(brick_view.is_mean) <= self.atlases[1].max_slots
        self._means.begin(is_enabled=not has_room)
        return brick_view

    def upload_groups(self, brick_view: BrickView) -> Iterator[tuple[slice, list[tuple[Atlas, Int64, Int64]]]]:
        """Upload all bricks in groups, all of which have slots at once.

        Yield each group before the next one is uploaded, and for scalars and for means the atlas, the numbers of the
        bricks in it, int64 [n], and their slots.
        """
        start, parts = 0, self._parts(brick_view)
        while start < len(brick_view.order):
            fits = [np.cumsum(is_chosen[start:]) <= atlas.max_slots for atlas, is_chosen in parts]
            group = slice(start, start + int(np.count_nonzero(fits[0] & fits[1])))
            uploaded = []
            for atlas, is_chosen in parts:
                numbers = np.flatnonzero(is_chosen[group]) + start
                make_texels = partial(self._make_texels, brick_view, numbers)
                uploaded.append((atlas, numbers, atlas.upload(brick_view.keys[numbers], make_texels)))
            yield group, uploaded
            start = group.stop

    def _evict_bricks(self) -> None:
        """Free the memory of all bricks."""
        for atlas in self.atlases:
            atlas.release()
        self.atlases, self._bricks, self._brick_view, self._means = (), None, None, MeanCache(self.threads)

    def release(self) -> None:
        """Free the bricks, and end the threads."""
        self._evict_bricks()
        self.threads.release()

    def _prepare(self, batch: BrickBatch, order: UInt32, view: View) -> BrickView:
        """Invalidate the bricks of another volume, and reserve slots for all bricks of a frame if possible."""
        num_channels = 4 if batch.shading else 1
        if self._bricks is not batch.bricks or self.atlases[0].num_channels != num_channels:
            self._evict_bricks()
            num_scalars, *nums = (level.errors.size for level in batch.bricks.levels)
            self.atlases = Atlas(num_channels, num_scalars, has_gradients=True), Atlas(4, sum(nums))
            self._bricks = batch.bricks
        last = self._brick_view
        if last is None or not (last.batch is batch and last.order is order and last.view is view):
            last = self._brick_view = make_brick_view(batch, order, view)
        for atlas, is_chosen in self._parts(last):
            if is_chosen.any():
                atlas.reserve()
        return last

    def _parts(self, brick_view: BrickView) -> list[tuple[Atlas, Bools]]:
        """Return the atlases of scalars and of means, and which bricks each holds."""
        return list(zip(self.atlases, (~brick_view.is_mean, brick_view.is_mean), strict=True))

    def _make_texels(self, brick_view: BrickView, numbers: Int64, missing: Int64) -> Float32:
        """Compute the texels of the bricks `numbers[missing]`, which belong in one atlas."""
        chosen = brick_view.order[numbers[missing]]
        batch, levels, cells = brick_view.batch, brick_view.batch.cut.levels[chosen], brick_view.batch.cut.cells[chosen]
        if levels[0] == 0:
            make = partial(scalar_texels, batch.bricks, lit=batch.shading is not None)
            return self.threads.map_concatenated(make, cells, MIN_BRICKS_PER_THREAD)
        texels = np.empty((len(cells), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, 4), np.float32)
        for level in sorted(set(levels.tolist())):  # np.unique would import masked arrays
            texels[levels == level] = mean_texels(batch.bricks, level, cells[levels == level], self._means)
        return texels
