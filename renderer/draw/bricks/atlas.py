"""Keep the texels of bricks in slots of a fixed share of memory, and decide which bricks stay.

The size of a volume is no limit: with less memory, bricks are made more often.

Means and colours are made before they are drawn, in bands of tiles whose bricks fit into the slots. The brick whose
next use is farthest away is evicted: L. A. Belady, "A study of replacement algorithms for a virtual-storage computer",
IBM Systems Journal 5 (1966): no other order of eviction has to make fewer bricks again. The bands are known beforehand,
and the next picture is assumed to have the same bands. If the least recently used brick were evicted instead, each
brick would be evicted just before it is needed.

Scalars are made by the kernels that draw, when a ray meets a brick. Bricks stay that a ray has met in this picture or
in the one before. A brick without a slot is made again for each tile.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple, Protocol

import numpy as np

from renderer.bricks import MIN_BRICKS_PER_THREAD
from renderer.kernels import ThreadPool
from renderer.volume import Bools, Float32, Int64

# A thread makes the texels of at most this many bricks before it writes them to the atlas.
_UPLOAD_BATCH = 64
# The number of floats of padding behind the last texel: kernels load whole rows and may read so far beyond it.
_READ_BEHIND = 2
# The offset of a brick whose texels are missing, as in `atlas.h`.
MISSING = -2
# The number of the next use of a brick for which it is not known: larger than the number of any known use.
_NEVER = 1 << 62
# The number of the last picture of a slot whose brick no ray has met: two less than the number of any picture.
_NEVER_MET = -2


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
    are_met: bool [n], whether a ray has met each brick. Who draws them writes it.
    """

    offsets: Int64
    free: Int64
    are_met: Bools


class Atlas:
    """A store of bricks of one kind, each in a slot. The caller gives each brick a key, from 0 to `num_keys` - 1.

    brick_floats: the float32 numbers, or other words of four bytes, of the texels of a brick.
    max_slots: the most bricks that the atlas holds, at least 1. num_bytes: the memory that the atlas may take.
    threads: the threads that make texels and write them; None for the calling thread.
    texels: float32 [slots * brick_floats], brick after brick.
    """

    def __init__(self, brick_floats: int, num_keys: int, num_bytes: int, threads: ThreadPool | None = None) -> None:
        self._threads, self.brick_floats = threads or ThreadPool(), brick_floats
        self.max_slots = min(num_keys, max(1, num_bytes // (4 * brick_floats)))
        self.texels = np.empty(0, np.float32)
        self._slot_from_key = np.full(num_keys, -1, np.int64)  # -1 for a brick that is not in the atlas
        self._key_from_slot = np.empty(0, np.int64)  # -1 for a free slot
        self._next_use = np.empty(0, np.int64)
        # The number of the upload that last used each slot. Of bricks without a known next use, the one with the lowest
        # number is evicted.
        self._last_used = np.empty(0, np.int64)
        self._use_counter = 0
        # The number of the picture in which a ray last met the brick in each slot.
        self._last_met = np.empty(0, np.int64)
        self._picture = 0

    def reserve(self, num: int = 0) -> None:
        """Make `max_slots` slots, or `num` if that is more; bricks are lost if slots are made. Unused slots take no
        memory."""
        if not len(self.texels) or num > self.max_slots:
            self.max_slots = max(num, self.max_slots)
            self.texels = np.empty(self.max_slots * self.brick_floats + _READ_BEHIND, np.float32)
            self._resize(self.max_slots)

    def release(self) -> None:
        """Free the memory of the atlas."""
        self.texels = np.empty(0, np.float32)
        self._resize(0)

    def num_missing(self, keys: Int64) -> int:
        """Return how many of these bricks are not in the atlas."""
        return int(np.count_nonzero(self._slot_from_key[keys] < 0))

    def begin_picture(self) -> None:
        """Begin another picture."""
        self._picture += 1

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
        with self._lent(keys, free) as placed:
            yield placed
        into = self._slot_from_key[keys]
        self._last_used[into], self._last_met[into] = self._use_counter, self._picture
        self._next_use[into] = _NEVER if next_use is None else next_use

    @contextmanager
    def offered(self, keys: Int64) -> Iterator[Placed]:
        """Offer free places to some bricks while they are drawn, of which there may be more than slots.

        Bricks stay that a ray has met in this picture or in the one before. Others are evicted if any of `keys` are
        missing, at most one for each. keys: int64 [n], all different. If the block raises, the missing bricks remain
        missing.
        """
        free = np.empty(0, np.int64)
        if num_missing := self.num_missing(keys):
            free = np.flatnonzero(self._last_met < self._picture - 1)
            free = free[np.argsort(self._last_met[free], kind="stable")[:num_missing]]
        self._evict(free)  # now, as kernels that draw these bricks again must not find them in slots that others take
        with self._lent(keys, free) as placed:
            yield placed
        met = self._slot_from_key[keys[placed.are_met]]
        self._last_met[met[met >= 0]] = self._picture

    @contextmanager
    def _lent(self, keys: Int64, free: Int64) -> Iterator[Placed]:
        """Lend free slots to bricks, and note in the end which brick is in each. free: int64 [m], slots."""
        slots = self._slot_from_key[keys]
        offsets = np.where(slots < 0, MISSING, slots * self.brick_floats)
        placed = Placed(offsets, free * self.brick_floats, np.zeros(len(keys), np.bool_))
        try:
            yield placed
        except BaseException:
            self._evict(free)
            raise
        has_place = placed.offsets >= 0
        into, kept = placed.offsets[has_place] // self.brick_floats, keys[has_place]
        self._evict(into[self._key_from_slot[into] != kept])
        self._slot_from_key[kept], self._key_from_slot[into] = into, kept

    def fill(self, placed: Placed, write: WriteTexels) -> None:
        """Make all missing texels of bricks, on several threads, in the first free places."""
        missing = np.flatnonzero(placed.offsets == MISSING)
        free = placed.free[: len(missing)]
        bricks = self.texels[:-_READ_BEHIND].reshape(-1, self.brick_floats)
        num = max(MIN_BRICKS_PER_THREAD, min(-(-len(missing) // self._threads.num), _UPLOAD_BATCH))

        def add(first: int) -> None:
            part = slice(first, first + num)
            write(missing[part], free[part] // self.brick_floats, bricks)

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
        self._last_met = np.full(num, _NEVER_MET, np.int64)
