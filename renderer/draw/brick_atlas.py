"""Which bricks are where they are drawn, and in which place: what atlases on a device and in memory have in common.

Bricks stay until their place is needed: those that were drawn longest ago go first. An atlas grows to what a film
needs, up to MOST_BYTES, so that a volume's size is no limit; with less memory bricks come and go more often.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from renderer.bricks import PADDED_BRICK_SIZE

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]
Texels = Callable[
    [Int64], Float32
]  # of the bricks with these keys: float32 [n, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE(, 4)]

MOST_BYTES = 256 << 20
# Bricks that are made ready at a time, before they get their places.
_AT_ONCE = 256


class Atlas(ABC):
    """Places for bricks of one kind; keys are numbers from 0 up, below `num_keys`, that the caller gives them.

    num_channels: 1 or 4, float32.
    """

    def __init__(self, num_channels: int, num_keys: int) -> None:
        self.num_channels = num_channels
        self._places = np.full(num_keys, -1, np.int64)  # of each key; -1: none
        self._keys = np.empty(0, np.int64)  # of each place; -1: free
        self._last_used = np.empty(0, np.int64)
        self._time = 0

    @property
    @abstractmethod
    def max_slots(self) -> int:
        """How many bricks there may be."""

    @abstractmethod
    def _grow(self, num: int) -> None:
        """Make room for so many, or as many as there may be; `_resize` is told how many these are."""

    @abstractmethod
    def _write(self, places: Int64, content: Float32) -> None:
        """Put bricks where they belong."""

    @abstractmethod
    def release(self) -> None:
        """Give the memory back."""

    def reserve(self, num: int) -> None:
        """Make room for so many bricks, or as many as there may be; whoever draws fewer at a time keeps the others."""
        if min(num, self.max_slots) > len(self._keys):
            self._grow(num)

    def num_missing(self, keys: Int64) -> int:
        """How many of these bricks have no place."""
        return int(np.count_nonzero(self._places[keys] < 0))

    def place(self, keys: Int64, texels: Texels) -> Int64:
        """int64 [n]: the places of these bricks, int64 [n] keys, all different and no more than there is room for.

        Those that have none are asked for; where `texels` raises, those made before stay, and the others have no place.
        """
        self._time += 1
        here = self._places[keys]
        missing, here = keys[here < 0], here[here >= 0]
        self._last_used[here] = self._time  # first: what is drawn now does not make room
        if len(missing):
            free = np.argsort(self._last_used, kind="stable")[: len(missing)]
            gone = self._keys[free]
            self._places[gone[gone >= 0]] = -1
            self._keys[free] = -1
            for first in range(0, len(missing), _AT_ONCE):
                part, places = missing[first : first + _AT_ONCE], free[first : first + _AT_ONCE]
                self._write(places, texels(part))
                self._places[part], self._keys[places], self._last_used[places] = places, part, self._time
        return self._places[keys]

    def _resize(self, num: int) -> None:
        """There are so many places now, all of them free."""
        self._places[:] = -1
        self._keys, self._last_used = np.full(num, -1, np.int64), np.zeros(num, np.int64)


def brick_bytes(num_channels: int) -> int:
    """What a brick takes."""
    return 4 * num_channels * PADDED_BRICK_SIZE**3
