"""Bricks drawn by compiled loops, where OpenGL would be software, too, and slower.

    lattice of nodes -> its tiles, with the boxes that lie over each -> boxes front to back, on several threads
    -> the next, finer lattice, where the nodes differ

What is drawn is what `gl_bricks` draws. It is quicker than Mesa's llvmpipe, whose shaders go through eight or sixteen
pixels in step: what one of them needs, all wait for, and where few are drawn most lanes are idle.
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from renderer.bricks import BrickBatch
from renderer.draw.brick_store import BrickCache
from renderer.draw.brick_view import BrickView
from renderer.draw.cpu.atlas import CPUAtlas
from renderer.draw.cpu.march import Boxes, Float64, Int64, Rays, bin_bricks, draw_tiles
from renderer.draw.cpu.sample import Field, Float32
from renderer.draw.subsampling import interpolated, num_nodes, refined
from renderer.scene import ShadingSpec
from renderer.threads import ThreadPool
from renderer.transfer import toward_light
from renderer.view import View, ray_setup

# Nodes along a tile's sides, where every pixel is one, and where few are. Tiles of 16 draw each brick more often, tiles
# of 64 share their rays with no cache.
TILE_SIDE, SUBSAMPLED_TILE_SIDE = 32, 16
# Tasks of a thread, each of tiles side by side, which have bricks in common.
_TASKS_EACH = 4
# Of a rectangle's edges; the shaders have the same.
_ROUNDING_PX = 2e-3


class CPUBrickRenderer:
    """Draws on so many threads; pictures do not depend on their number. `release` ends them."""

    def __init__(self, num_threads: int) -> None:
        self._threads = ThreadPool(num_threads)
        self._store = BrickCache(partial(CPUAtlas, is_planar=True), CPUAtlas, self._threads)

    def upload(self, batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> bool:
        """Make those bricks of `batch[order]` ready that are not; whether there were any."""
        return self._store.upload(batch, order, view)

    def draw(self, batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> Float32:
        """Composite `batch[order]`, front to back: float32 [height, width, 4], premultiplied RGBA over nothing."""
        picture = self._store.begin(batch, order, view)
        self._store.begin_frame(picture)
        strides = batch.screen_sampling.strides
        columns, rows = num_nodes(view.size, strides[0])
        image, is_drawn = np.zeros((rows, columns, 4), np.float32), np.ones((rows, columns), np.bool_)
        self._draw_boxes(picture, strides[0], is_drawn, image)
        for coarse, stride in pairwise(strides):
            shape = num_nodes(view.size, stride)
            image, is_drawn = refined(
                image, coarse // stride, batch.screen_sampling.difference_threshold, shape, self._threads
            )
            self._draw_boxes(picture, stride, is_drawn, image)
        return image if strides[-1] == 1 else interpolated(image, strides[-1], view.size, self._threads)

    def forget(self) -> None:
        """Let go of bricks."""
        self._store.forget()

    def release(self) -> None:
        """Let go of bricks, and end the threads."""
        self.forget()
        self._threads.release()

    def _draw_boxes(self, picture: BrickView, stride: int, is_drawn: npt.NDArray[np.bool_], image: Float32) -> None:
        """Group by group, as many as there is room for, each behind what has been drawn before."""
        start = 0
        while start < len(picture.order):
            end = self._store.end_of_group(picture, start, len(picture.order))
            self._draw_group(picture, slice(start, end), stride, is_drawn, image)
            start = end

    def _draw_group(
        self, picture: BrickView, group: slice, stride: int, is_drawn: npt.NDArray[np.bool_], image: Float32
    ) -> None:
        """Some boxes behind what is in the image."""
        boxes, field = self._boxes(picture, group), self._field(picture)
        rows, columns = is_drawn.shape
        rectangles = _grid_windows(picture.rectangles_px[group], stride, (columns, rows))
        side = TILE_SIDE if stride == 1 else SUBSAMPLED_TILE_SIDE
        starts, numbers = _tile_bins(rectangles, side, (columns, rows))
        tiles = np.flatnonzero(starts[1:] > starts[:-1])
        opaque = np.float32(picture.batch.screen_sampling.termination_alpha)
        rays = _rays(picture)

        def draw(some: Int64) -> None:
            draw_tiles(
                some, side, stride, opaque, rays, boxes, rectangles, starts, numbers, field, is_drawn, image
            )  # fmt: skip

        num_tasks = min(len(tiles), _TASKS_EACH * self._threads.num) if self._threads.num > 1 else 1
        self._threads.map(draw, np.array_split(tiles, max(1, num_tasks)))

    def _boxes(self, picture: BrickView, group: slice) -> Boxes:
        """What the loops are told of bricks, which are made ready."""
        keys, texel_offsets = picture.keys[group], np.empty(len(picture.keys[group]), np.int64)
        for atlas, is_chosen, texels in self._store.kinds(picture):
            chosen = is_chosen[group]
            texel_offsets[chosen] = atlas.texel_offsets(atlas.place(keys[chosen], texels))
        return Boxes(
            picture.bounds[group],
            picture.corners[group],
            picture.cells_per_voxel[group],
            picture.steps[group],
            picture.is_mean[group],
            texel_offsets,
        )

    def _field(self, picture: BrickView) -> Field:
        batch = picture.batch
        (scalars, _, _), (means, _, _) = self._store.kinds(picture)
        shading = batch.shading or ShadingSpec()
        x, y, z = toward_light(shading).astype(np.float32)
        return Field(
            scalars.texels,
            means.texels,
            np.float32(batch.spacings_per_model_unit),
            batch.bricks.pieces.rows.reshape(-1),
            batch.bricks.pieces.guide,
            batch.shading is not None,
            (x, y, z),
            np.float32(shading.ambient),
            np.float32(shading.diffuse),
        )


def _rays(picture: BrickView) -> Rays:
    batch, view = picture.batch, picture.view
    frame = ray_setup(batch.cut.volume, batch.model_unit, view)
    center_px = view.size[0] / 2, view.size[1] / 2
    return Rays(frame.origins, frame.directions, float(frame.slope_per_px), float(frame.start), center_px)


def _grid_windows(rectangles_px: Float64, stride: int, shape: tuple[int, int]) -> Int64:
    """int64 [n, 4]: left, top, right and bottom of the nodes in rectangles, half-open, and of those that rounding may
    have put outside. Node 0 is the centre of pixel 0. shape: columns and rows of the lattice."""
    most = np.array(shape)
    low = np.clip(np.ceil((rectangles_px[:, :2] - 0.5 - _ROUNDING_PX) / stride), 0, most)
    high = np.clip(np.floor((rectangles_px[:, 2:] - 0.5 + _ROUNDING_PX) / stride) + 1, low, most)
    return np.hstack([low, high]).astype(np.int64)


def _tile_bins(rectangles: Int64, side: int, shape: tuple[int, int]) -> tuple[Int64, Int64]:
    """As `bin_bricks` has them: where the boxes of each tile begin, and their numbers. shape: as in `_grid_windows`."""
    columns, rows = (-(-n // side) for n in shape)
    starts, numbers = np.empty(columns * rows + 1, np.int64), np.empty(8 * len(rectangles), np.int64)
    num = bin_bricks(rectangles, side, columns, starts, numbers)
    if num > len(numbers):
        numbers = np.empty(num, np.int64)
        bin_bricks(rectangles, side, columns, starts, numbers)
    return starts, numbers
