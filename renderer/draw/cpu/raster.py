"""Rasterise bricks by kernels, on several threads.

    pixel grid -> its tiles, with the bricks over each -> bricks front to back, on several threads
    -> the next, finer grid, where neighbouring pixels differ

The picture is the same bytes on every machine, and for any number of threads.
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np

from renderer.bricks import BrickBatch
from renderer.draw.brick_cache import BrickCache, BrickView
from renderer.draw.cpu.extremum import search_of
from renderer.draw.cpu.field import field_of
from renderer.draw.cpu.grid import make_grid
from renderer.draw.rasterizer import Rasterizer
from renderer.draw.subsampling import grid_size, refine_grid, upsample
from renderer.kernels import kernels
from renderer.view import View
from renderer.volume import Bools, Float32, UInt32

# Each task draws neighbouring tiles, which have bricks in common.
_TASKS_PER_THREAD = 4


class BrickRasterizer(Rasterizer):
    """A rasteriser of bricks. Use as a context manager, or call `release`."""

    device = "the processor"

    def __init__(self, *, num_threads: int = 2) -> None:
        self.cache = BrickCache(num_threads)
        self.threads = self.cache.threads

    def release(self) -> None:
        """Free the bricks, and end the threads."""
        self.cache.release()

    def upload(self, batch: BrickBatch, order: UInt32, view: View) -> bool:
        """Upload the bricks `batch[order]`, and return whether any of them was missing."""
        return self.cache.upload(batch, order, view)

    def rasterize(self, batch: BrickBatch, order: UInt32, view: View) -> Float32:
        """Composite `batch[order]`, front to back: float32 [height, width, 4], premultiplied RGBA over nothing."""
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
        texel_offsets = np.empty(len(brick_view.order), np.int64)
        for group, uploaded in self.cache.upload_groups(brick_view):
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
