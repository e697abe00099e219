"""Keep the bricks of layers in atlases: one for each layer's scalars of level 0, and one for the means of the levels
above."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import NamedTuple

import numpy as np

from renderer.bricks import (
    BRICK_SIZE,
    NO_LIGHT,
    PADDED_BRICK_SIZE,
    BrickBatch,
    BrickLayer,
    BrickLayers,
    color_texels,
    fill_scalar_texels,
    mean_texels,
    texel_rules,
)
from renderer.draw.bricks.atlas import Atlas
from renderer.kernels import AtlasTexels, RaySetup, TexelRules, ThreadPool
from renderer.transfer import toward_light
from renderer.view import View, are_near_faces, ray_setup, screen_rectangles
from renderer.volume import Bools, Float32, Float64, Int32, Int64, UInt32

# The number of floats of the texels of a brick of means: (tau c, tau) of each cell.
_MEAN_FLOATS = 4 * PADDED_BRICK_SIZE**3


class BrickView(NamedTuple):
    """The bricks `batch[order]` in a view, front to back. Positions are in voxels, relative to the volume's centre.

    keys: int64 [n], the bricks' keys in their atlas. Bricks of level 0 are numbered from 0 on, and those of all higher
        levels together from 0 on.
    is_mean: bool [n], whether a brick is above level 0 and so holds means.
    have_faces: bool [n], whether a brick of level 0 is near a face that clipping cuts and that is lit by its own
        normal.
    rectangles_px: float64 [n, 4], as `screen_rectangles` returns them.
    boxes: float64 [n, 11]: the lowest [3] and the highest corner [3] of the visible bounds, the lowest corner of the
        first cell [3], the cells along a voxel's side, and the length of a step in cells.
    """

    batch: BrickBatch
    order: UInt32
    view: View
    rays: RaySetup
    keys: Int64
    is_mean: Bools
    have_faces: Bools
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
    rays, steps = ray_setup(cut.volume, batch.model_unit, view, batch.bricks.clip), batch.steps[order]
    have_faces = np.zeros(len(order), np.bool_)
    if rays.clip is not None and any(layer.lights_faces for layer in batch.bricks.layers):
        have_faces = are_near_faces(rays.clip, cut.volume, cut.visible_bounds[order]) & (levels == 0)
        steps = np.where(have_faces, np.minimum(steps, batch.face_step), steps)
    return BrickView(
        batch,
        order,
        view,
        rays,
        first_keys[levels] + (z * num_rows + y) * num_columns + x,
        levels > 0,
        have_faces,
        screen_rectangles(batch, order, view),
        np.column_stack([bounds, first_corners, np.ldexp(1.0, -levels), steps]),
    )


def needed_bytes(bricks: BrickLayers, *, keeps_voxels: bool) -> list[int]:
    """Return the bytes of all visible bricks in each atlas of a BrickCache: each layer's atlas of scalars, then the one
    of means. keeps_voxels: as in BrickCache."""
    scalars = [
        int(np.count_nonzero(layer.bricks.levels[0].is_visible)) * 4 * layer.texel_floats(keeps_voxels=keeps_voxels)
        for layer in bricks.layers
    ]
    num_means = sum(int(np.count_nonzero(level.is_visible)) for level in bricks.levels[1:])
    return [*scalars, num_means * 4 * _MEAN_FLOATS]


def drawn_bytes(batch: BrickBatch, *, keeps_voxels: bool) -> list[int]:
    """Return the bytes that the bricks of a batch take in each atlas, in the order of `needed_bytes`.

    keeps_voxels: as in BrickCache.
    """
    is_mean = batch.cut.levels > 0
    x, y, z = batch.cut.cells[~is_mean].T
    scalars = [
        int(np.count_nonzero(layer.bricks.levels[0].is_visible[z, y, x]))
        * 4
        * layer.texel_floats(keeps_voxels=keeps_voxels)
        for layer in batch.bricks.layers
    ]
    return [*scalars, int(np.count_nonzero(is_mean)) * 4 * _MEAN_FLOATS]


class BrickCache:
    """A cache of the bricks of layers on one grid of voxels: an atlas for each layer's scalars, and one for all means.

    threads: the threads that compute the texels of bricks.
    num_bytes: the memory that each atlas may take, in the order of `needed_bytes`.
    keeps_voxels: whether texels of level 0 are voxels where they can be; otherwise they are scalars, with light also
        gradients.
    scalars: an atlas for each layer, with its bricks of level 0.
    means: an atlas for the bricks of the levels above, with means over all layers.
    """

    def __init__(
        self, bricks: BrickLayers, threads: ThreadPool, num_bytes: Sequence[int], *, keeps_voxels: bool
    ) -> None:
        num_scalars, *nums = (level.errors.size for level in bricks.levels)
        self.scalars = [
            Atlas(layer.texel_floats(keeps_voxels=keeps_voxels), num_scalars, each, threads)
            for layer, each in zip(bricks.layers, num_bytes[:-1], strict=True)
        ]
        self.means = Atlas(_MEAN_FLOATS, sum(nums), num_bytes[-1], threads)
        self.num_bytes, self.keeps_voxels = num_bytes, keeps_voxels
        self._rules = [
            None if layer.bricks.volume.colors is not None else _rules_of(layer, keeps_voxels=keeps_voxels)
            for layer in bricks.layers
        ]
        self._brick_view: BrickView | None = None  # the last view, kept because `upload` and drawing both need it
        self._parts: list[_AtlasPart] = []  # of this view

    def upload(self, batch: BrickBatch, order: UInt32, view: View) -> bool:
        """Upload the bricks `batch[order]`, and return whether any of them was missing.

        Do nothing if there are not enough slots: bricks are then uploaded while the picture is drawn.
        """
        brick_view = self._prepare(batch, order, view)
        keys = [(part.atlas, brick_view.keys[part.is_in]) for part in self._parts]
        has_room = all(len(of_atlas) <= atlas.max_slots for atlas, of_atlas in keys)
        if not has_room or not any(atlas.num_missing(of_atlas) for atlas, of_atlas in keys):
            return False
        with self.placed(brick_view, np.arange(len(order)), makes_all=True):
            return True

    def begin_frame(self, batch: BrickBatch, order: UInt32, view: View) -> BrickView:
        """Return the view of the bricks `batch[order]` for a frame, front to back."""
        for atlas in (*self.scalars, self.means):
            atlas.begin_picture()
        return self._prepare(batch, order, view)

    def plan(self, brick_view: BrickView, next_use: Int64) -> None:
        """Note when the next picture uses each brick of the view. next_use: int64 [n], the first band; -1 for none."""
        for part in self._parts_of(brick_view):
            if part.rules is not None:
                continue
            is_used = part.is_in & (next_use >= 0)
            part.atlas.plan(brick_view.keys[is_used], next_use[is_used])

    def have_slots(self, brick_view: BrickView, numbers: Int64, times: int) -> bool:
        """Return whether there are slots for `times` as many bricks as `numbers` has: numbers of bricks in the view.

        Only bricks of means and of colours need slots: kernels make others also without.
        """
        parts = [part for part in self._parts_of(brick_view) if part.rules is None]
        return all(times * np.count_nonzero(part.is_in[numbers]) <= part.atlas.max_slots for part in parts)

    @contextmanager
    def placed(
        self, brick_view: BrickView, numbers: Int64, next_use: Int64 | None = None, *, makes_all: bool = False
    ) -> Iterator[list[AtlasTexels]]:
        """Give places to the bricks with these numbers in the view while they are drawn; return the texels of layers.

        Means and colours are made now. Kernels make the scalars of a brick when a ray meets it, or all are made now.
        The texels of a layer have the offsets of all bricks of the view: -1 for a brick that was not asked for, or in
        which the layer shows nothing. A brick of means has its offset, in the atlas of means, in the first layer.

        next_use: the next uses of these bricks, as in `Atlas.placed`. makes_all: whether to make all texels now.
        """
        *of_layers, of_means = self._parts_of(brick_view)
        offsets = np.full((len(self.scalars), len(brick_view.order)), -1, np.int64)
        found = list[AtlasTexels]()
        with ExitStack() as stack:
            stack.enter_context(of_means.made(offsets[0], numbers, next_use))
            for part, row in zip(of_layers, offsets, strict=True):
                if part.rules is None or makes_all:
                    found.append(stack.enter_context(part.made(row, numbers, next_use)))
                else:
                    found.append(stack.enter_context(part.offered(row, numbers)))
            yield found

    def release(self) -> None:
        """Free the memory of all bricks."""
        for atlas in (*self.scalars, self.means):
            atlas.release()
        self._brick_view = None

    def _prepare(self, batch: BrickBatch, order: UInt32, view: View) -> BrickView:
        """Return the view of the bricks `batch[order]`; the kept one, if it is of the same objects."""
        last = self._brick_view
        if last is None or not (last.batch is batch and last.order is order and last.view is view):
            last = self._brick_view = make_brick_view(batch, order, view)
            self._parts = self._make_parts(last)
        return last

    def _parts_of(self, brick_view: BrickView) -> list[_AtlasPart]:
        """Return the bricks of a view in each atlas."""
        return self._parts if brick_view is self._brick_view else self._make_parts(brick_view)

    def _make_parts(self, brick_view: BrickView) -> list[_AtlasPart]:
        layers, is_mean = brick_view.batch.bricks.layers, brick_view.is_mean
        cells = np.ascontiguousarray(brick_view.batch.cut.cells[brick_view.order])
        parts = list[_AtlasPart]()
        for atlas, layer, rules in zip(self.scalars, layers, self._rules, strict=True):
            is_shown = ~is_mean
            if len(layers) > 1:
                x, y, z = cells[is_shown].T
                is_shown[is_shown] = layer.bricks.levels[0].is_visible[z, y, x]
            write = partial(_write_voxels, layer, rules, cells)
            parts.append(_AtlasPart(atlas, brick_view.keys, is_shown, cells, layer, rules, write))
        means = _AtlasPart(
            self.means, brick_view.keys, is_mean, cells, layers[0], None, partial(_write_means, brick_view, cells)
        )
        return [*parts, means]


class _AtlasPart(NamedTuple):
    """The bricks of a view in one atlas.

    keys: int64 [n], the keys of the bricks of the view, as in BrickView.
    is_in: bool [n], which bricks of the view the atlas is for. cells: int32 [n, 3], the places of all bricks.
    layer: the layer of an atlas of scalars. rules: the rules by which kernels make its texels; None if they do not.
    write: a function that takes numbers of bricks in the view, and then what WriteTexels takes.
    """

    atlas: Atlas
    keys: Int64
    is_in: Bools
    cells: Int32
    layer: BrickLayer
    rules: TexelRules | None
    write: Callable[[Int64, Int64, Int64, Float32], None]

    @contextmanager
    def made(self, row: Int64, numbers: Int64, next_use: Int64 | None) -> Iterator[AtlasTexels]:
        """Make all missing texels now, and return all texels as kernels take them.

        row: the offsets of all bricks of the view, to which those of the bricks in `numbers` are written. next_use: as
        in `BrickCache.placed`.
        """
        are_in = self.is_in[numbers]
        chosen = numbers[are_in]
        if not len(chosen):
            yield self._texels(row)
            return
        self.atlas.reserve(len(chosen))
        with self.atlas.placed(self.keys[chosen], None if next_use is None else next_use[are_in]) as placed:
            self.atlas.fill(placed, partial(self.write, chosen))
            row[chosen] = placed.offsets
            yield self._texels(row)

    @contextmanager
    def offered(self, row: Int64, numbers: Int64) -> Iterator[AtlasTexels]:
        """Return all texels as kernels take them, which make the missing ones of the bricks in `numbers`.

        row: as in `made`. Raises InputError if the volume's file was changed.
        """
        chosen = numbers[self.is_in[numbers]]
        if len(chosen):
            self.atlas.reserve()
        self.layer.bricks.volume.require_unchanged()
        with self.atlas.offered(self.keys[chosen]) as placed:
            row[chosen] = placed.offsets
            texels = self._texels(row, placed.free)
            yield texels
            self.layer.bricks.volume.require_unchanged()
            placed.offsets[:], placed.are_met[:] = row[chosen], texels.are_met[chosen]

    def _texels(self, row: Int64, free: Int64 | None = None) -> AtlasTexels:
        """Return texels as kernels take them. free: the free positions for missing ones; None if kernels make none."""
        return AtlasTexels(
            texels=self.atlas.texels,
            offsets=row,
            rules=self.rules,
            cells=self.cells,
            free=np.empty(0, np.int64) if free is None else free,
            num_taken=np.zeros(1, np.int64),
            are_met=np.zeros(len(row), np.bool_),
        )


def _write_voxels(
    layer: BrickLayer,
    rules: TexelRules | None,
    cells: Int32,
    among: Int64,
    chosen: Int64,
    slots: Int64,
    texels: Float32,
) -> None:
    """Write the texels of bricks of level 0 of a layer. rules: None if voxels are colours."""
    of_bricks = cells[among[chosen]]
    if rules is None:
        texels[slots] = color_texels(layer.bricks.pyramid, of_bricks).reshape(len(slots), -1)
    else:
        fill_scalar_texels(layer.bricks, rules, of_bricks, slots, texels)


def _write_means(
    brick_view: BrickView, cells: Int32, among: Int64, chosen: Int64, slots: Int64, texels: Float32
) -> None:
    """Write the texels of bricks of means: the sum over all layers of weight times mean."""
    numbers = among[chosen]
    levels = brick_view.batch.cut.levels[brick_view.order[numbers]]
    sums = np.zeros((len(numbers), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, 4), np.float32)
    for level in sorted(set(levels.tolist())):  # np.unique would import masked arrays, which takes time
        at = np.flatnonzero(levels == level)
        for layer in brick_view.batch.bricks.layers:
            means = mean_texels(layer.bricks, level, cells[numbers[at]])
            sums[at] += np.float32(layer.weight) * means
    texels[slots] = sums.reshape(len(slots), -1)


def _rules_of(layer: BrickLayer, *, keeps_voxels: bool) -> TexelRules:
    """Return the rules by which the texels of a layer's bricks of level 0 are made."""
    shading = layer.shading
    is_turned = shading is not None and shading.light != "camera"
    return texel_rules(
        layer.bricks,
        lit=shading is not None,
        toward_light=toward_light(shading) if shading and is_turned else NO_LIGHT,
        kept=layer.voxel_texels if keeps_voxels else None,
    )
