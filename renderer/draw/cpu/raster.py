"""Rasterise bricks without OpenGL, by kernels.

    pixel grid -> its tiles, with the bricks over each -> bricks front to back, on several threads
    -> the next, finer grid, where neighbouring pixels differ

The picture is the one that `renderer.draw.gl.bricks` draws. On the CPU these loops are faster than Mesa's llvmpipe,
whose shaders process neighbouring pixels in step: all of them wait for the slowest, and where few pixels are drawn most
lanes are idle. Here rays that miss a brick take no lane, and the others are sorted.
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np

from renderer.bricks import PADDED_BRICK_SIZE, BrickBatch
from renderer.draw import brick_cache
from renderer.draw.brick_cache import Atlas, BrickCache, BrickView
from renderer.draw.cpu.extremum import search_of
from renderer.draw.cpu.field import field_of
from renderer.draw.cpu.grid import make_grid
from renderer.draw.rasterizer import Rasterizer
from renderer.draw.subsampling import grid_size, refine_grid, upsample
from renderer.kernels import ThreadPool, kernels
from renderer.splats import SplatBatch
from renderer.view import View
from renderer.volume import Bools, Float32, Int64, UInt32

CPU_RENDERER_NAME = "no OpenGL: drawn on the processor"

# Each task draws neighbouring tiles, which have bricks in common.
_TASKS_PER_THREAD = 4
# Floats behind the last texel that loads of whole rows touch.
_READ_BEHIND = 2


class CPUAtlas(Atlas):
    """An atlas in memory, brick after brick. texels: float32 [slots * PADDED_BRICK_SIZE^3 * num_channels].

    has_gradients: a brick of 4 channels has all its scalars first, which are read more often than their gradients.
    """

    def __init__(self, num_channels: int, num_keys: int, *, has_gradients: bool = False) -> None:
        self._has_gradients, self._brick_floats = has_gradients, PADDED_BRICK_SIZE**3 * num_channels
        fitting = max(1, brick_cache.MAX_ATLAS_BYTES // (4 * self._brick_floats))
        super().__init__(num_channels, num_keys, min(num_keys, fitting))
        self.texels = np.empty(0, np.float32)

    def texel_offsets(self, slots: Int64) -> Int64:
        """Return where the bricks in these slots begin in `texels`, halo included: int64 [n]."""
        return slots * self._brick_floats

    def release(self) -> None:
        """Free the memory."""
        self.texels = np.empty(0, np.float32)
        self._resize(0)

    def _grow(self, num: int) -> None:
        """Make all slots at once: unused ones take no memory, and growing later would need a copy of all texels."""
        self.texels = np.empty(self.max_slots * self._brick_floats + _READ_BEHIND, np.float32)
        self._resize(self.max_slots)

    def _write(self, slots: Int64, texels: Float32) -> None:
        bricks = self.texels[:-_READ_BEHIND].reshape(-1, self._brick_floats)
        if self._has_gradients and self.num_channels > 1:
            texels = texels.reshape(len(slots), -1, self.num_channels)
            bricks[slots, : texels.shape[1]] = texels[..., 0]
            bricks[slots, texels.shape[1] :] = texels[..., 1:].reshape(len(slots), -1)
        else:
            bricks[slots] = texels.reshape(len(slots), -1)


class CPURasterizer(Rasterizer):
    """A rasteriser of bricks, for scenes that do not need OpenGL (`Scene.needs_opengl`); used like a GLRasterizer.

    The images do not depend on the number of threads. Use as a context manager, or call `release`.
    """

    device = CPU_RENDERER_NAME

    def __init__(self, *, num_threads: int = 2) -> None:
        self.cache = BrickCache(partial(CPUAtlas, has_gradients=True), CPUAtlas, num_threads)

    @property
    def threads(self) -> ThreadPool:
        return self.cache.threads

    def release(self) -> None:
        """Free the bricks, and end the threads."""
        self.cache.release()

    def upload(self, batch: SplatBatch | BrickBatch, order: UInt32, view: View) -> bool:
        """Upload the bricks `batch[order]`, and return whether any of them was missing."""
        return self.cache.upload(batch, order, view)

    def rasterize(self, batch: SplatBatch | BrickBatch, order: UInt32, view: View) -> Float32:
        """Composite `batch[order]`, front to back: float32 [height, width, 4], premultiplied RGBA over nothing."""
        assert isinstance(batch, BrickBatch)
        brick_view = self.cache.begin_frame(batch, order, view)
        sampling = batch.screen_sampling
        columns, rows = grid_size(view.size, sampling.strides[0])
        image, is_drawn = np.zeros((rows, columns, 4), np.float32), np.ones((rows, columns), np.bool_)
        self._draw_bricks(brick_view, sampling.strides[0], is_drawn, image)
        for coarse, stride in pairwise(sampling.strides):
            image, is_drawn = refine_grid(
                image, coarse // stride, sampling.difference_threshold, grid_size(view.size, stride), self.threads
            )
            self._draw_bricks(brick_view, stride, is_drawn, image)
        stride = sampling.strides[-1]
        return image if stride == 1 else upsample(image, stride, view.size, self.threads)

    def _draw_bricks(self, brick_view: BrickView, stride: int, is_drawn: Bools, image: Float32) -> None:
        """Composite groups of bricks that have slots at once under the image, front to back."""
        num = len(brick_view.order)
        texel_offsets = np.empty(num, np.int64)
        for group, uploaded in self.cache.upload_groups(brick_view, num):
            for atlas, numbers, slots in uploaded:
                texel_offsets[numbers] = atlas.texel_offsets(slots)
            rectangles_px, boxes = brick_view.rectangles_px[group], brick_view.boxes[group]
            offsets = texel_offsets[group]
            grid = make_grid(rectangles_px, stride, is_drawn, image)
            batch, (scalars, means) = brick_view.batch, self.cache.atlases
            if batch.extremes is None:
                fields = [field_of(batch, scalars.texels, means.texels, offsets)]
                bricks = {"rays": brick_view.rays, "spacings_per_model_unit": np.float32(batch.spacings_per_model_unit), "boxes": boxes, "is_mean": brick_view.is_mean[group], "fields": fields}
                draw = kernels().draw_tiles.partial(
                    grid=grid, bricks=bricks, termination_alpha=batch.screen_sampling.termination_alpha, is_additive=False
                )
            else:
                tops, search = batch.extremes.tops[brick_view.order[group]], search_of(batch, brick_view.view)
                draw = kernels().draw_extremes.partial(
                    grid=grid, rays=brick_view.rays, boxes=boxes, texel_offsets=offsets, tops=tops, scalars=scalars.texels, **search)
            tiles = np.flatnonzero(np.diff(grid["starts"]))
            num_tasks = min(len(tiles), _TASKS_PER_THREAD * self.threads.num) if self.threads.num > 1 else 1
            tasks = [partial(draw, tiles=part) for part in np.array_split(tiles, max(1, num_tasks))]
            self.threads.map(lambda task: task(), tasks)
