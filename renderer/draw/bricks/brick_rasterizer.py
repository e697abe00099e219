"""Rasterise bricks by kernels, on several threads.

    pixel grid -> its tiles, with the bricks over each -> bricks front to back, on several threads
    -> the next, finer grid, where neighbouring pixels differ

Layers on one grid of voxels are drawn together, as one set of bricks. Layers on different grids are mixed in slabs of
depth, or their light is added if the scene's light only adds up. The picture is the same bytes on every machine, and
for any number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np

from renderer.bricks import BrickBatch, ScreenSampling, ray_positions
from renderer.draw.bricks.antialiasing import antialias
from renderer.draw.bricks.bands import plan_bands
from renderer.draw.bricks.brick_cache import BrickCache, BrickView, drawn_bytes, needed_bytes
from renderer.draw.bricks.extremum import search_of
from renderer.draw.bricks.field import field_of
from renderer.draw.bricks.grid import RayGrid, make_grid
from renderer.draw.bricks.light import fog_ramp, radiance_cells
from renderer.draw.bricks.mixture import make_mixture
from renderer.draw.bricks.subsampling import grid_size, refine_grid, upsample
from renderer.draw.rasterizer import BrickMemory, Rasterizer, RayColors
from renderer.kernels import AtlasTexels, Grid, LayerBricks, RaySetup, ThreadPool, kernels
from renderer.scene import FACE_DEPTH
from renderer.system import MemoryShare
from renderer.view import View
from renderer.volume import Float32, Float64, Int64, UInt32

# The tasks that a band is divided into, for each thread. A task draws neighbouring tiles, which have bricks in common.
_TASKS_PER_THREAD = 4
# The alpha at which rays end if light only adds up: no ray reaches it. It is finite, because kernels mark places
# without a ray by an infinite alpha.
_NO_END = float(np.finfo(np.float32).max)
# Bytes of each atlas, in the order of `needed_bytes`, by the `id` of the BrickLayers whose bricks they hold.
Shares = dict[int, list[int]]


class BrickRasterizer(Rasterizer):
    """A rasteriser of bricks. Use it as a context manager, or call `release`."""

    device = "the processor"

    def __init__(self, *, num_threads: int = 2, memory: MemoryShare | None = None) -> None:
        self.threads = ThreadPool(num_threads)
        self._memory = memory or MemoryShare()
        self.caches: dict[int, BrickCache] = {}  # by the `id` of the BrickLayers whose bricks they hold

    def release(self) -> None:
        """Free the bricks, and end the threads."""
        self.release_bricks()
        self.threads.release()

    def release_bricks(self) -> None:
        """Free the bricks."""
        for cache in self.caches.values():
            cache.release()
        self.caches.clear()

    def upload(self, batches: Sequence[BrickBatch], orders: Sequence[UInt32], view: View) -> bool:
        """Upload the bricks `batch[order]` of all batches, and return whether any of them was missing."""
        of_batches = zip(self._caches_of(batches), batches, orders, strict=True)
        uploaded = [cache.upload(batch, order, view) for cache, batch, order in of_batches]
        return any(uploaded)

    def rasterize(
        self, batches: Sequence[BrickBatch], orders: Sequence[UInt32], view: View, colors: RayColors | None = None
    ) -> Float32:
        """Composite `batch[order]` of all batches, each front to back, over nothing.

        colors: the function that colours rays which gather something other than light; None for rays of light.
        Returns float32 [height, width, 4], premultiplied RGBA, in linear light if matter scatters it.
        If light only adds up, alpha is the value that it would
        have with absorption, or the brightest channel if that is more, at most 1.
        """
        caches = self._caches_of(batches)
        views = [
            cache.begin_frame(batch, order, view) for cache, batch, order in zip(caches, batches, orders, strict=True)
        ]
        sampling = _finest([batch.screen_sampling for batch in batches])
        is_additive = batches[0].bricks.is_additive
        is_linear = batches[0].bricks.light is not None
        parts = [_part_alone(*each) for each in zip(caches, views, strict=True)]
        if sum(len(order) > 0 for order in orders) > 1 and not is_additive:
            parts = [_mixed_part(caches, views, sampling.termination_alpha)]
        finish = _additive_colors if is_additive else colors or _same_colors
        image = finish(self._draw_ladder(parts, sampling, view, is_linear=is_linear), None)
        if sampling.strides[-1] == 1:
            draw_rays = partial(self._draw_rays, parts, view, finish)
            antialias(image, sampling, draw_rays, self.threads, is_linear=is_linear)
        return image

    def _draw_ladder(self, parts: Sequence[_Part], sampling: ScreenSampling, view: View, *, is_linear: bool) -> Float32:
        """Draw one ray a pixel, or fewer, from the coarsest pixel grid to the finest: float32 [h, w, 4].

        is_linear: whether colours are linear light.
        """
        columns, rows = grid_size(view.size, sampling.strides[0])
        image = np.zeros((rows, columns, 4), np.float32)
        self._draw_parts(parts, RayGrid(image.reshape(-1, 4), (rows, columns), stride=sampling.strides[0]))
        for coarse, stride in pairwise(sampling.strides):
            columns, rows = grid_size(view.size, stride)
            image, places = refine_grid(
                image, coarse // stride, sampling.difference_threshold, (columns, rows), self.threads,
                is_linear=is_linear,
            )  # fmt: skip
            self._draw_parts(parts, RayGrid(image.reshape(-1, 4), (rows, columns), places, stride=stride))
        stride = sampling.strides[-1]
        return image if stride == 1 else upsample(image, stride, view.size, self.threads)

    def _draw_rays(
        self,
        parts: Sequence[_Part],
        view: View,
        finish: RayColors,
        pixels: Int64,
        across: int,
        *,
        is_scattered: bool = False,
    ) -> Float32:
        """Draw several rays in pixels; the function DrawRays, after the first three parameters."""
        width, first_row = view.size[0], int(pixels[0]) // view.size[0]
        num_rows = int(pixels[-1]) // width + 1 - first_row
        places = np.full((num_rows, width), -1, np.int32)
        places.reshape(-1)[pixels - first_row * width] = np.arange(len(pixels), dtype=np.int32) * across**2
        rays = np.zeros((len(pixels) * across**2, 4), np.float32)
        self._draw_parts(parts, RayGrid(rays, (num_rows, width), places, 1, across, is_scattered, first_row))
        return finish(rays, ray_positions(pixels, width, across, is_scattered=is_scattered))

    def _caches_of(self, batches: Sequence[BrickBatch]) -> list[BrickCache]:
        """Return the caches of the layers of batches, which share the memory, and free the caches of other layers."""
        shown = {id(batch.bricks): batch for batch in batches}
        for number in [number for number in self.caches if number not in shown]:  # caches of another frame or film
            self.caches.pop(number).release()
        # Caches keep the kind of their texels as long as they live, so that a zoom does not make all bricks again.
        keep = {
            number: self.caches[number].keeps_voxels if number in self.caches else batch.keeps_voxels
            for number, batch in shown.items()
        }
        drawn = {number: drawn_bytes(batch, keeps_voxels=keep[number]) for number, batch in shown.items()}
        if not all(number in self.caches and _have_room(self.caches[number], drawn[number]) for number in shown):
            needed = {number: needed_bytes(batch.bricks, keeps_voxels=keep[number]) for number, batch in shown.items()}
            limit = self._memory.num_bytes() if self.brick_memory is None else self.brick_memory.limit
            self.brick_memory = BrickMemory(sum(map(sum, needed.values())), limit)
            shares = share_memory(drawn, needed, limit)
            if not self._fit(drawn, shares, limit):
                self.release_bricks()
            for number in shares.keys() - self.caches.keys():
                self.caches[number] = BrickCache(
                    shown[number].bricks, self.threads, shares[number], keeps_voxels=keep[number]
                )
        return [self.caches[id(batch.bricks)] for batch in batches]

    def _fit(self, drawn: Shares, shares: Shares, limit: int) -> bool:
        """Return whether the caches can stay, and new ones be added for other layers.

        All caches together must take at most `limit`. No atlas may have less than half of the bytes that it could have
        for the bricks that are drawn.
        """
        taken = [self.caches[number].num_bytes if number in self.caches else own for number, own in shares.items()]
        return sum(map(sum, taken)) <= limit and not any(
            2 * has < min(of_atlas, could_have)
            for number, cache in self.caches.items()
            for has, of_atlas, could_have in zip(cache.num_bytes, drawn[number], shares[number], strict=True)
        )

    def _draw_parts(self, parts: Sequence[_Part], grid_of_rays: RayGrid) -> None:
        """Draw parts of a picture over the same rays, one after another, each in bands whose bricks have slots."""
        self.num_rays += grid_of_rays.num_rays
        for part in parts:
            grid = make_grid(part.rectangles_px, grid_of_rays, is_mixture=len(part.views) > 1)
            bands, first_use = plan_bands(grid.starts, grid.numbers, len(part.members), part.have_slots)
            part.plan(first_use)
            for tiles, met, next_use in bands:
                num_tasks = min(len(tiles), _TASKS_PER_THREAD * self.threads.num) if self.threads.num > 1 else 1
                with part.placed(met, next_use) as placed:
                    draw = part.make_kernel(grid, placed)
                    tasks = [partial(draw, tiles=few) for few in np.array_split(tiles, max(1, num_tasks))]
                    self.threads.map(lambda task: task(), tasks)


def _finest(samplings: Sequence[ScreenSampling]) -> ScreenSampling:
    """Return a sampling whose every setting is at least as fine as that of each of some samplings."""
    finest = min(samplings, key=lambda each: (each.strides, each.difference_threshold))
    return replace(
        finest,
        termination_transmittance=min(each.termination_transmittance for each in samplings),
        contrast_threshold=min(each.contrast_threshold for each in samplings),
        spread_threshold=min(each.spread_threshold for each in samplings),
        is_scouted=any(each.is_scouted for each in samplings),
    )


def _same_colors(rays: Float32, _positions_px: Float64 | None) -> Float32:
    return rays


def _additive_colors(rays: Float32, _positions_px: Float64 | None) -> Float32:
    """Set the alpha of rays whose light only adds up: 1 - exp(-optical depth), or the brightest channel if it is more.

    rays: float32 [..., 4], light and optical depth, changed in place.
    """
    brightest = np.minimum(rays[..., :3].max(axis=-1), np.float32(1))
    rays[..., 3] = np.maximum(-np.expm1(-rays[..., 3]), brightest)
    return rays


def share_memory(drawn: Shares, needed: Shares, limit: int) -> Shares:
    """Share memory among the atlases of caches: first for the bricks of this picture, then for all visible bricks.

    drawn, needed: the bytes for the bricks of this picture, and for all visible bricks. limit: the bytes to share.
    """
    of_drawn = share_out([each for own in drawn.values() for each in own], limit)
    of_all = [each for own in needed.values() for each in own]
    missing = [max(0, each - has) for each, has in zip(of_all, of_drawn, strict=True)]
    shares = iter(np.add(of_drawn, share_out(missing, limit - sum(of_drawn))).tolist())
    return {number: [next(shares) for _ in own] for number, own in drawn.items()}


def share_out(needs: Sequence[int], total: int) -> list[int]:
    """Share a total among some needs. No share exceeds its need, and all shares that fall short are equal."""
    shares, left = [0] * len(needs), total
    for num_before, number in enumerate(sorted(range(len(needs)), key=needs.__getitem__)):
        shares[number] = min(needs[number], left // (len(needs) - num_before))
        left -= shares[number]
    return shares


def _have_room(cache: BrickCache, drawn: Sequence[int]) -> bool:
    return all(each <= has for each, has in zip(drawn, cache.num_bytes, strict=True))


class _DrawTiles(Protocol):
    """A function that draws some tiles, int64 [n]."""

    def __call__(self, *, tiles: Int64) -> None: ...


class _Part(NamedTuple):
    """A part of a picture that one kernel draws: the bricks of one view, or of several views that are mixed.

    members, rectangles_px: as in Mixture.
    make_kernel: returns the function that draws tiles, from the grid and, for each view, the texels that
        `BrickCache.placed` returns.
    """

    caches: Sequence[BrickCache]
    views: Sequence[BrickView]
    members: Int64
    rectangles_px: Float64
    make_kernel: Callable[[Grid, Sequence[Sequence[AtlasTexels]]], _DrawTiles]

    def have_slots(self, members: Int64, times: int) -> bool:
        """Return whether there are slots for `times` as many bricks as `members` has. members: numbers of bricks."""
        of_views = zip(self.caches, self.views, self._by_view(members), strict=True)
        return all(cache.have_slots(view, self.members[each, 1], times) for cache, view, each in of_views)

    def plan(self, first_use: Int64) -> None:
        """Note which band of the next picture meets each brick first. first_use: int64 [members]; -1 for none."""
        for k, (cache, view) in enumerate(zip(self.caches, self.views, strict=True)):
            of_view, by_number = self.members[:, 0] == k, np.full(len(view.order), -1, np.int64)
            by_number[self.members[of_view, 1]] = first_use[of_view]
            cache.plan(view, by_number)

    @contextmanager
    def placed(self, members: Int64, next_use: Int64) -> Iterator[list[list[AtlasTexels]]]:
        """Give places to bricks while they are drawn, and return their texels for each view, as `BrickCache.placed`.

        members: int64 [n], numbers of bricks of this part. next_use: as in Band.
        """
        by_member = np.full(len(self.members), -1, np.int64)
        by_member[members] = next_use
        with ExitStack() as stack:
            yield [
                stack.enter_context(cache.placed(view, self.members[each, 1], by_member[each]))
                for cache, view, each in zip(self.caches, self.views, self._by_view(members), strict=True)
            ]

    def _by_view(self, members: Int64) -> list[Int64]:
        """Divide bricks by their views; the bricks of a view are sorted by their numbers in it."""
        found = [members[self.members[members, 0] == k] for k in range(len(self.views))]
        return [each[np.argsort(self.members[each, 1])] for each in found]


def _part_alone(cache: BrickCache, brick_view: BrickView) -> _Part:
    batch, numbers = brick_view.batch, np.arange(len(brick_view.order))

    def make_kernel(grid: Grid, placed: Sequence[Sequence[AtlasTexels]]) -> _DrawTiles:
        if batch.extremes is not None:
            return kernels().draw_extremes.partial(
                grid=grid, rays=brick_view.rays, boxes=brick_view.boxes,
                tops=batch.extremes.tops[brick_view.order], voxels=placed[0][0],
                rules=search_of(batch, brick_view.view),
            )  # fmt: skip
        bricks = _layer_bricks(cache, brick_view, placed[0], brick_view.rays, batch.model_unit)
        is_additive = batch.bricks.is_additive
        alpha = _NO_END if is_additive else batch.screen_sampling.termination_alpha
        return kernels().draw_tiles.partial(grid=grid, bricks=bricks, termination_alpha=alpha, is_additive=is_additive)

    members = np.column_stack([np.zeros_like(numbers), numbers])
    return _Part([cache], [brick_view], members, brick_view.rectangles_px, make_kernel)


def _mixed_part(caches: Sequence[BrickCache], views: Sequence[BrickView], termination_alpha: float) -> _Part:
    mixture = make_mixture(views)

    def make_kernel(grid: Grid, placed: Sequence[Sequence[AtlasTexels]]) -> _DrawTiles:
        of_views = zip(caches, views, placed, mixture.rays, strict=True)
        return kernels().draw_mixture.partial(
            grid=grid, groups=[_layer_bricks(*each, mixture.unit) for each in of_views], members=mixture.members,
            depths=mixture.depths, termination_alpha=termination_alpha,
        )  # fmt: skip

    return _Part(caches, views, mixture.members, mixture.rectangles_px, make_kernel)


def _layer_bricks(
    cache: BrickCache, brick_view: BrickView, placed: Sequence[AtlasTexels], rays: RaySetup, unit: float
) -> LayerBricks:
    """Return the bricks of a view as kernels take them.

    placed: the texels of each layer, as `BrickCache.placed` returns them. unit: the world length of the rays' model
    unit.
    """
    layers = brick_view.batch.bricks.layers
    fields = [
        field_of(layer, of_layer, cache.means.texels, brick_view)
        for layer, of_layer in zip(layers, placed, strict=True)
    ]
    return LayerBricks(
        rays=rays,
        spacings_per_model_unit=unit / brick_view.batch.cut.volume.finest_spacing,
        boxes=brick_view.boxes,
        is_mean=brick_view.is_mean,
        have_faces=brick_view.have_faces,
        face_depth=FACE_DEPTH * brick_view.batch.cut.volume.finest_spacing,
        radiance=radiance_cells(brick_view.batch.bricks),
        fog=fog_ramp(brick_view.view, brick_view.batch.cut.volume),
        fields=fields,
    )
