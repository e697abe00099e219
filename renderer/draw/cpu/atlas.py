"""Bricks in memory, one after the other, for loops on the processor."""

from __future__ import annotations

import numpy as np

from renderer.bricks import PADDED_BRICK_SIZE
from renderer.draw import brick_atlas
from renderer.draw.brick_atlas import Atlas, Float32, Int64, brick_bytes


class CPUAtlas(Atlas):
    """As in Atlas. texels: float32 [places * PADDED_BRICK_SIZE^3 * num_channels].

    is_planar: a brick has one channel after the other, and not one texel after the other: of scalars with gradients
    the scalars are looked up more often.
    """

    def __init__(self, num_channels: int, num_keys: int, *, is_planar: bool = False) -> None:
        super().__init__(num_channels, num_keys)
        self._is_planar = is_planar
        self.texels = np.empty(0, np.float32)

    @property
    def max_slots(self) -> int:
        """How many bricks there may be."""
        return _max_slots(self.num_channels, len(self._places))

    def texel_offsets(self, places: Int64) -> Int64:
        """int64 [n]: where in `texels` places begin, apron and all."""
        return places * (PADDED_BRICK_SIZE**3 * self.num_channels)

    def release(self) -> None:
        """Give the memory back."""
        self.texels = np.empty(0, np.float32)
        self._resize(0)

    def _grow(self, num: int) -> None:
        """As many as there may be, at once: they take no memory until they are used, where making room later would take
        twice as much for as long as a copy takes."""
        self.texels = np.empty(self.max_slots * PADDED_BRICK_SIZE**3 * self.num_channels, np.float32)
        self._resize(self.max_slots)

    def _write(self, places: Int64, content: Float32) -> None:
        if self._is_planar and self.num_channels > 1:
            content = np.moveaxis(content, -1, 1)
        self.texels.reshape(-1, PADDED_BRICK_SIZE**3 * self.num_channels)[places] = content.reshape(len(places), -1)


def max_atlas_bytes(num_channels: int, num_keys: int) -> int:
    """What an atlas takes at most of that many bricks."""
    return _max_slots(num_channels, num_keys) * brick_bytes(num_channels)


def _max_slots(num_channels: int, num_keys: int) -> int:
    return min(num_keys, max(1, brick_atlas.MOST_BYTES // brick_bytes(num_channels)))
