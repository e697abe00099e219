"""Bricks in memory, one after the other, for compiled loops."""

from __future__ import annotations

import numpy as np

from renderer.bricks import PADDED_BRICK_SIZE
from renderer.draw.brick_cache import Atlas, Float32, Int64, max_slots_in_memory


class CPUAtlas(Atlas):
    """An atlas in memory. texels: float32 [slots * PADDED_BRICK_SIZE^3 * num_channels].

    is_planar: a brick stores one channel after the other, and not one texel after the other. Scalars are read more
    often than their gradients.
    """

    def __init__(self, num_channels: int, num_keys: int, *, is_planar: bool = False) -> None:
        super().__init__(num_channels, num_keys)
        self._is_planar = is_planar
        self.texels = np.empty(0, np.float32)

    @property
    def max_slots(self) -> int:
        """The number of bricks that the atlas may hold."""
        return max_slots_in_memory(self.num_channels, len(self._slot_from_key))

    def texel_offsets(self, slots: Int64) -> Int64:
        """Return where the bricks in these slots begin in `texels`, halo included: int64 [n]."""
        return slots * (PADDED_BRICK_SIZE**3 * self.num_channels)

    def release(self) -> None:
        """Free the memory."""
        self.texels = np.empty(0, np.float32)
        self._resize(0)

    def _grow(self, num: int) -> None:
        """Make all slots at once: unused ones take no memory, and growing later would need a copy of all texels."""
        self.texels = np.empty(self.max_slots * PADDED_BRICK_SIZE**3 * self.num_channels, np.float32)
        self._resize(self.max_slots)

    def _write(self, slots: Int64, texels: Float32) -> None:
        if self._is_planar and self.num_channels > 1:
            texels = np.moveaxis(texels, -1, 1)
        self.texels.reshape(-1, PADDED_BRICK_SIZE**3 * self.num_channels)[slots] = texels.reshape(len(slots), -1)
