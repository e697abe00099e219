"""Keep the texels of bricks in slots of atlases, and evict the bricks whose next use is farthest away.

Each atlas has a fixed share of memory. The size of a volume is no limit: with less memory, bricks are made more often.
One atlas holds the scalars of level 0, another the means of the levels above.

L. A. Belady, "A study of replacement algorithms for a virtual-storage computer", IBM Systems Journal 5 (1966): no other
order of eviction has to make fewer bricks again. A picture is drawn in bands that are known beforehand, and the next
picture is assumed to have the same bands. If not all bricks fit, as many stay as there is room for. If the least
recently used brick were evicted instead, each brick would be evicted just before it is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np

from renderer.bricks import (
    BRICK_SIZE,
    MIN_BRICKS_PER_THREAD,
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
from renderer.kernels import AtlasTexels, RaySetup, TexelRules, ThreadPool
from renderer.transfer import toward_light
from renderer.view import View, are_near_faces, ray_setup, screen_rectangles
from renderer.volume import Bools, Float32, Float64, Int32, Int64, UInt32

# A thread makes the texels of at most this many bricks before it writes them to the atlas.
_UPLOAD_BATCH = 64
# The number of floats of padding behind the last texel: kernels load whole rows and may read so far beyond it.
_READ_BEHIND = 2
# The offset of a brick whose texels are missing, as in `atlas.h`.
MISSING = -2
# The number of the next use of a brick for which it is not known: larger than the number of any known use.
_NEVER = 1 << 62


class WriteTexels(Protocol):
    """A function that writes the texels of bricks to slots of an atlas."""

    def __call__(self, chosen: Int64, slots: Int64, texels: Float32) -> None:
        """Write the texels of the bricks that are `chosen`, int64 [m], among those that a caller asked for.

        slots: int64 [m], the slot of each brick. texels: float32 [slots, floats], the texels of all slots.
        """


class Placed(NamedTuple):
    """The places of bricks in an atlas.

    offsets: int64 [n], the position of each brick's first texel, or MISSING. Who makes missing texels writes their
        positions here.
    free: int64 [m], the positions for missing texels, in the order in which they are to be taken.
    """

    offsets: Int64
    free: Int64


class Atlas:
    """A store of bricks of one kind, each in a slot. The caller gives each brick a key, from 0 to `num_keys` - 1.

    num_channels: the float32 numbers of a texel, 1 or 4. max_slots: the most bricks that the atlas holds, at least 1.
    num_bytes: the memory that the atlas may take.
    threads: the threads that make texels and write them; None for the calling thread.
    texels: float32 [slots * PADDED_BRICK_SIZE^3 * num_channels], brick after brick.
    """

    def __init__(self, num_channels: int, num_keys: int, num_bytes: int, threads: ThreadPool | None = None) -> None:
        self._threads, self._brick_floats = threads or ThreadPool(), PADDED_BRICK_SIZE**3 * num_channels
        fitting = max(1, num_bytes // brick_bytes(num_channels))
        self.num_channels, self.max_slots = num_channels, min(num_keys, fitting)
        self.texels = np.empty(0, np.float32)
        self._slot_from_key = np.full(num_keys, -1, np.int64)  # -1 for a brick that is not in the atlas
        self._key_from_slot = np.empty(0, np.int64)  # -1 for a free slot
        self._next_use = np.empty(0, np.int64)
        # The number of the upload that last used each slot. Of bricks without a known next use, the one with the lowest
        # number is evicted.
        self._last_used = np.empty(0, np.int64)
        self._use_counter = 0

    def reserve(self, num: int = 0) -> None:
        """Make `max_slots` slots, or `num` if that is more; bricks are lost if slots are made. Unused slots take no
        memory."""
        if not len(self.texels) or num > self.max_slots:
            self.max_slots = max(num, self.max_slots)
            self.texels = np.empty(self.max_slots * self._brick_floats + _READ_BEHIND, np.float32)
            self._resize(self.max_slots)

    def release(self) -> None:
        """Free the memory of the atlas."""
        self.texels = np.empty(0, np.float32)
        self._resize(0)

    def num_missing(self, keys: Int64) -> int:
        """Return how many of these bricks are not in the atlas."""
        return int(np.count_nonzero(self._slot_from_key[keys] < 0))

    def plan(self, keys: Int64, next_use: Int64) -> None:
        """Note when the bricks of `keys` are used next. All other bricks of the atlas count as not used any more.

        next_use: int64 [n], numbers of bands, which ascend in time.
        """
        slots = self._slot_from_key[keys]
        self._next_use[:] = _NEVER
        self._next_use[slots[slots >= 0]] = next_use[slots >= 0]

    @contextmanager
    def placed(self, keys: Int64, next_use: Int64 | None = None) -> Iterator[Placed]:
        """Give places to some bricks while they are drawn. Bricks that have a place in the end stay in the atlas.

        keys: int64 [n], all different; at most as many as there are slots. next_use: int64 [n], the numbers of the
        bricks' next uses; None if they are not known. If the block raises, the missing bricks remain missing.
        """
        self._use_counter += 1
        slots = self._slot_from_key[keys]
        num_missing = int(np.count_nonzero(slots < 0))
        free = np.empty(0, np.int64)
        if num_missing:
            self._next_use[slots[slots >= 0]] = -1  # so that none of these bricks is evicted
            free = np.lexsort((self._last_used, -self._next_use))[:num_missing]
        found = Placed(np.where(slots < 0, MISSING, slots * self._brick_floats), free * self._brick_floats)
        try:
            yield found
        except BaseException:
            self._evict(free)
            raise
        has_place = found.offsets >= 0
        into, kept = found.offsets[has_place] // self._brick_floats, keys[has_place]
        self._evict(into[self._key_from_slot[into] != kept])
        self._slot_from_key[kept], self._key_from_slot[into] = into, kept
        self._last_used[into] = self._use_counter
        self._next_use[into] = _NEVER if next_use is None else next_use[has_place]

    def fill(self, placed: Placed, write: WriteTexels) -> None:
        """Make all missing texels of bricks, on several threads, in the first free places."""
        missing = np.flatnonzero(placed.offsets == MISSING)
        free = placed.free[: len(missing)]
        bricks = self.texels[:-_READ_BEHIND].reshape(-1, self._brick_floats)
        num = max(MIN_BRICKS_PER_THREAD, min(-(-len(missing) // self._threads.num), _UPLOAD_BATCH))

        def add(first: int) -> None:
            part = slice(first, first + num)
            write(missing[part], free[part] // self._brick_floats, bricks)

        self._threads.map(add, range(0, len(missing), num))
        placed.offsets[missing] = free

    def _evict(self, slots: Int64) -> None:
        """Make slots free."""
        evicted = self._key_from_slot[slots]
        self._slot_from_key[evicted[evicted >= 0]] = -1
        self._key_from_slot[slots] = -1

    def _resize(self, num: int) -> None:
        """Make room for `num` slots, all of them free."""
        self._slot_from_key[:] = -1
        self._key_from_slot, self._last_used = np.full(num, -1, np.int64), np.zeros(num, np.int64)
        self._next_use = np.full(num, _NEVER, np.int64)


def brick_bytes(num_channels: int) -> int:
    """Return the number of bytes that the texels of a brick take."""
    return 4 * PADDED_BRICK_SIZE**3 * num_channels


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


def needed_bytes(bricks: BrickLayers) -> list[int]:
    """Return the bytes of all visible bricks in each atlas of a BrickCache: each layer's atlas of scalars, then the one
    of means."""
    scalars = [
        int(np.count_nonzero(layer.bricks.levels[0].is_visible)) * brick_bytes(_num_channels(layer))
        for layer in bricks.layers
    ]
    num_means = sum(int(np.count_nonzero(level.is_visible)) for level in bricks.levels[1:])
    return [*scalars, num_means * brick_bytes(4)]


def drawn_bytes(batch: BrickBatch) -> list[int]:
    """Return the bytes that the bricks of a batch take in each atlas, in the order of `needed_bytes`."""
    is_mean = batch.cut.levels > 0
    x, y, z = batch.cut.cells[~is_mean].T
    scalars = [
        int(np.count_nonzero(layer.bricks.levels[0].is_visible[z, y, x])) * brick_bytes(_num_channels(layer))
        for layer in batch.bricks.layers
    ]
    return [*scalars, int(np.count_nonzero(is_mean)) * brick_bytes(4)]


def _num_channels(layer: BrickLayer) -> int:
    """Return the numbers in a texel of level 0: 1, a scalar, or 4 if the layer is lit or has voxels of colours."""
    return 4 if layer.shading or layer.bricks.volume.colors is not None else 1


class BrickCache:
    """A cache of the bricks of layers on one grid of voxels: an atlas for each layer's scalars, and one for all means.

    threads: the threads that compute the texels of bricks.
    num_bytes: the memory that each atlas may take, in the order of `needed_bytes`.
    scalars: an atlas for each layer, with its bricks of level 0.
    means: an atlas for the bricks of the levels above, with means over all layers.
    """

    def __init__(self, bricks: BrickLayers, threads: ThreadPool, num_bytes: Sequence[int]) -> None:
        num_scalars, *nums = (level.errors.size for level in bricks.levels)
        self.scalars = [
            Atlas(_num_channels(layer), num_scalars, each, threads)
            for layer, each in zip(bricks.layers, num_bytes[:-1], strict=True)
        ]
        self.means = Atlas(4, sum(nums), num_bytes[-1], threads)
        self.num_bytes = num_bytes
        self._rules = [None if layer.bricks.volume.colors is not None else _rules_of(layer) for layer in bricks.layers]
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
        return self._prepare(batch, order, view)

    def plan(self, brick_view: BrickView, next_use: Int64) -> None:
        """Note when the next picture uses each brick of the view. next_use: int64 [n], the first band; -1 for none."""
        for part in self._parts_of(brick_view):
            is_used = part.is_in & (next_use >= 0)
            part.atlas.plan(brick_view.keys[is_used], next_use[is_used])

    def have_slots(self, brick_view: BrickView, numbers: Int64, times: int) -> bool:
        """Return whether there are slots for `times` as many bricks as `numbers` has: numbers of bricks in the view."""
        parts = self._parts_of(brick_view)
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
        parts = self._parts_of(brick_view)
        offsets = np.full((len(self.scalars), len(brick_view.order)), -1, np.int64)
        free, places = [np.empty(0, np.int64) for _ in offsets], list[tuple[Placed, Int64, Int64]]()
        with ExitStack() as stack:
            for layer, part in enumerate(parts):
                are_in, row = part.is_in[numbers], offsets[layer % len(offsets)]
                of_atlas, used = numbers[are_in], None if next_use is None else next_use[are_in]
                if not len(of_atlas):
                    continue
                part.atlas.reserve(len(of_atlas))
                placed = stack.enter_context(part.atlas.placed(brick_view.keys[of_atlas], used))
                if makes_all or part.rules is None:
                    part.atlas.fill(placed, partial(part.write, of_atlas))
                else:
                    free[layer] = placed.free
                row[of_atlas] = placed.offsets
                places.append((placed, row, of_atlas))
            volumes = [part.layer.bricks.volume for part, of_part in zip(parts, free, strict=False) if len(of_part)]
            for volume in volumes:
                volume.require_unchanged()
            yield [part.texels(*each) for part, *each in zip(parts, offsets, free, strict=False)]
            for volume in volumes:
                volume.require_unchanged()
            for placed, row, of_atlas in places:
                placed.offsets[:] = row[of_atlas]

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
            parts.append(_AtlasPart(atlas, is_shown, cells, layer, rules, write))
        return [
            *parts,
            _AtlasPart(self.means, is_mean, cells, layers[0], None, partial(_write_means, brick_view, cells)),
        ]


class _AtlasPart(NamedTuple):
    """The bricks of a view in one atlas.

    is_in: bool [n], which bricks of the view the atlas is for. cells: int32 [n, 3], the places of all bricks.
    layer: the layer of an atlas of scalars. rules: the rules by which kernels make its texels; None if they do not.
    write: a function that takes numbers of bricks in the view, and then what WriteTexels takes.
    """

    atlas: Atlas
    is_in: Bools
    cells: Int32
    layer: BrickLayer
    rules: TexelRules | None
    write: Callable[[Int64, Int64, Int64, Float32], None]

    def texels(self, offsets: Int64, free: Int64) -> AtlasTexels:
        """Return the texels as kernels take them. offsets, free: as in the record AtlasTexels."""
        rules = self.rules if len(free) else None
        return AtlasTexels(self.atlas.texels, offsets, rules, self.cells, free, np.zeros(1, np.int64))


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


def _rules_of(layer: BrickLayer) -> TexelRules:
    """Return the rules by which the texels of a layer's bricks of level 0 are made."""
    shading = layer.shading
    is_turned = shading is not None and shading.light != "camera"
    return texel_rules(
        layer.bricks, lit=shading is not None, toward_light=toward_light(shading) if shading and is_turned else NO_LIGHT
    )
