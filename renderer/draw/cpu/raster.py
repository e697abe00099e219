"""Rasterise bricks by kernels, on several threads.

    pixel grid -> its tiles, with the bricks over each -> bricks front to back, on several threads
    -> the next, finer grid, where neighbouring pixels differ

The bricks of layers on one grid of voxels are drawn as one. Others are mixed, in slabs of depth, or added where nothing
is absorbed. The picture is the same bytes on every machine, and for any number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from renderer.bricks import BrickBatch
from renderer.draw.brick_cache import BrickCache, BrickView
from renderer.draw.cpu.extremum import search_of
from renderer.draw.cpu.field import field_of
from renderer.draw.cpu.grid import make_grid
from renderer.draw.cpu.mixture import make_mixture
from renderer.draw.rasterizer import Rasterizer
from renderer.draw.subsampling import grid_size, refine_grid, upsample
from renderer.kernels import ThreadPool, kernels
from renderer.scene import FACE_DEPTH
from renderer.view import RaySetup, View
from renderer.volume import Bools, Float32, Float64, Int64, UInt32

# Each task draws neighbouring tiles, which have bricks in common.
_TASKS_PER_THREAD = 4
# Of rays through what absorbs nothing; infinite is what is found where no ray is.
_NO_END = float(np.finfo(np.float32).max)


class BrickRasterizer(Rasterizer):
    """A rasteriser of bricks. Use as a context manager, or call `release`."""

    device = "the processor"

    def __init__(self, *, num_threads: int = 2) -> None:
        self.threads = ThreadPool(num_threads)
        self.caches: dict[int, BrickCache] = {}  # by the identities of layers, which they hold

    def release(self) -> None:
        """Free the bricks, and end the threads."""
        for cache in self.caches.values():
            cache.release()
        self.threads.release()

    def upload(self, batches: Sequence[BrickBatch], orders: Sequence[UInt32], view: View) -> bool:
        """Upload the bricks `batch[order]` of all batches, and return whether any of them was missing."""
        shown = [id(batch.bricks) for batch in batches]
        for number in [number for number in self.caches if number not in shown]:  # of another film
            self.caches.pop(number).release()
        pairs = zip(batches, orders, strict=True)
        uploaded = [self._cache_of(batch).upload(batch, order, view) for batch, order in pairs]
        return any(uploaded)

    def rasterize(self, batches: Sequence[BrickBatch], orders: Sequence[UInt32], view: View) -> Float32:
        """Composite `batch[order]` of all batches, each front to back, over nothing.

        Returns float32 [height, width, 4], premultiplied RGBA. Where nothing is absorbed, alpha is what absorption
        would give, or the brightest channel if that is more, at most 1.
        """
        caches = [self._cache_of(batch) for batch in batches]
        views = [
            cache.begin_frame(batch, order, view) for cache, batch, order in zip(caches, batches, orders, strict=True)
        ]
        samplings = [batch.screen_sampling for batch in batches]
        finest = min(samplings, key=lambda each: (each.strides, each.difference_threshold))
        least = min(each.termination_transmittance for each in samplings)
        sampling = replace(finest, termination_transmittance=least)  # as fine as all of them
        is_additive = batches[0].bricks.is_additive
        parts = [_part_alone(*each) for each in zip(caches, views, strict=True)]
        if sum(len(order) > 0 for order in orders) > 1 and not is_additive:
            parts = [_mixed_part(caches, views, sampling.termination_alpha)]
        columns, rows = grid_size(view.size, sampling.strides[0])
        image, is_drawn = np.zeros((rows, columns, 4), np.float32), np.ones((rows, columns), np.bool_)
        self._draw_parts(parts, sampling.strides[0], is_drawn, image)
        for coarse, stride in pairwise(sampling.strides):
            image, is_drawn = refine_grid(
                image, coarse // stride, sampling.difference_threshold, grid_size(view.size, stride), self.threads
            )
            self._draw_parts(parts, stride, is_drawn, image)
        stride = sampling.strides[-1]
        image = image if stride == 1 else upsample(image, stride, view.size, self.threads)
        if is_additive:
            brightest = np.minimum(image[..., :3].max(axis=2), np.float32(1))
            image[..., 3] = np.maximum(-np.expm1(-image[..., 3]), brightest)
        return image

    def _cache_of(self, batch: BrickBatch) -> BrickCache:
        """Return the cache of a batch's layers."""
        number = id(batch.bricks)
        if number not in self.caches:
            self.caches[number] = BrickCache(batch.bricks, self.threads)
        return self.caches[number]

    def _draw_parts(self, parts: Sequence[_Part], stride: int, is_drawn: Bools, image: Float32) -> None:
        """Draw parts of a picture, one under the other, each in bands of tiles whose bricks have slots at once."""
        for part in parts:
            grid = make_grid(part.rectangles_px, stride, is_drawn, image, is_mixture=len(part.views) > 1)
            starts, numbers = grid["starts"], grid["numbers"]
            bands = [np.flatnonzero(np.diff(starts))]
            while bands:
                tiles = bands.pop()
                met = np.zeros(len(part.members), np.bool_)
                for tile in tiles:
                    met[numbers[starts[tile] : starts[tile + 1]]] = True
                met_of_views = [
                    np.sort(part.members[met & (part.members[:, 0] == k), 1]) for k in range(len(part.views))
                ]
                if tiles.size > 1 and not all(map(BrickCache.have_slots, part.caches, part.views, met_of_views)):
                    bands += reversed(np.array_split(tiles, 2))
                    continue
                draw = part.make_kernel(
                    grid, list(map(BrickCache.upload_bricks, part.caches, part.views, met_of_views))
                )
                num_tasks = min(len(tiles), _TASKS_PER_THREAD * self.threads.num) if self.threads.num > 1 else 1
                tasks = [partial(draw, tiles=few) for few in np.array_split(tiles, max(1, num_tasks))]
                self.threads.map(lambda task: task(), tasks)


class _Part(NamedTuple):
    """A part of a picture that one kernel draws: the bricks of one view, or of several that are mixed.

    members, rectangles_px: as in Mixture. make_kernel: returns what draws tiles, from the grid and from where texels
        begin, of each view, as `BrickCache.upload_bricks` returns it.
    """

    caches: Sequence[BrickCache]
    views: Sequence[BrickView]
    members: Int64
    rectangles_px: Float64
    make_kernel: Callable[[dict[str, Any], Sequence[Int64]], Callable[..., None]]


def _part_alone(cache: BrickCache, brick_view: BrickView) -> _Part:
    batch, numbers = brick_view.batch, np.arange(len(brick_view.order))

    def make_kernel(grid: dict[str, Any], offsets: Sequence[Int64]) -> Callable[..., None]:
        if batch.extremes is not None:
            return kernels().draw_extremes.partial(
                grid=grid, rays=brick_view.rays, boxes=brick_view.boxes, texel_offsets=offsets[0][0],
                tops=batch.extremes.tops[brick_view.order], scalars=cache.scalars[0].texels,
                **search_of(batch, brick_view.view),
            )  # fmt: skip
        bricks = _layer_bricks(cache, brick_view, offsets[0], brick_view.rays, batch.model_unit)
        is_additive = batch.bricks.is_additive
        alpha = _NO_END if is_additive else batch.screen_sampling.termination_alpha
        return kernels().draw_tiles.partial(grid=grid, bricks=bricks, termination_alpha=alpha, is_additive=is_additive)

    members = np.column_stack([np.zeros_like(numbers), numbers])
    return _Part([cache], [brick_view], members, brick_view.rectangles_px, make_kernel)


def _mixed_part(caches: Sequence[BrickCache], views: Sequence[BrickView], termination_alpha: float) -> _Part:
    mixture = make_mixture(views)

    def make_kernel(grid: dict[str, Any], offsets: Sequence[Int64]) -> Callable[..., None]:
        of_views = zip(caches, views, offsets, mixture.rays, strict=True)
        return kernels().draw_mixture.partial(
            grid=grid, groups=[_layer_bricks(*each, mixture.unit) for each in of_views], members=mixture.members,
            depths=mixture.depths, termination_alpha=termination_alpha,
        )  # fmt: skip

    return _Part(caches, views, mixture.members, mixture.rectangles_px, make_kernel)


def _layer_bricks(
    cache: BrickCache, brick_view: BrickView, offsets: Int64, rays: RaySetup, unit: float
) -> dict[str, Any]:
    """Return the bricks of a view as kernels take them: LayerBricks in kernels.h.

    offsets: as `BrickCache.upload_bricks` returns them. unit: the world length of the rays' model unit.
    """
    layers = brick_view.batch.bricks.layers
    fields = [
        field_of(layer, atlas.texels, cache.means.texels, of_layer, brick_view)
        for layer, atlas, of_layer in zip(layers, cache.scalars, offsets, strict=True)
    ]
    return {
        "rays": rays, "spacings_per_model_unit": np.float32(unit / brick_view.batch.cut.volume.finest_spacing),
        "boxes": brick_view.boxes, "is_mean": brick_view.is_mean, "fields": fields,
        "have_faces": brick_view.have_faces, "face_depth": FACE_DEPTH * brick_view.batch.cut.volume.finest_spacing,
    }  # fmt: skip
