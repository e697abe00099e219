"""Bricks on the device: a 3D texture of places for so many of them, and which brick is where.

Bricks stay until their place is needed: those that were drawn longest ago go first. The texture grows to what a film
needs, up to MOST_BYTES, so that neither a volume's size nor the largest texture of a device is a limit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from renderer.bricks import APRON, BRICK
from renderer.errors import RenderError

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]
Texels = Callable[[Int64], Float32]  # of the bricks with these keys: float32 [n, SIDE, SIDE, SIDE(, 4)]

SIDE = BRICK + 2 * APRON  # texels of a brick along each axis

MOST_BYTES = 256 << 20
_FEWEST_PLACES = 64
# Bricks that are made ready at a time, before they go to the device.
_AT_ONCE = 256


class Atlas:
    """A texture with the bricks of one kind; keys are numbers from 0 up, below `num_keys`, that the caller gives them.

    num_channels: 1 or 4, float32. Filtering is linear.
    """

    def __init__(self, context: Any, num_channels: int, num_keys: int) -> None:
        self._context, self.num_channels = context, num_channels
        self._places = np.full(num_keys, -1, np.int64)  # of each key; -1: not on the device
        self._keys = np.empty(0, np.int64)  # of each place; -1: free
        self._last_used = np.empty(0, np.int64)
        self._time = 0
        self._side = min(int(context.info["GL_MAX_3D_TEXTURE_SIZE"]), 2048) // SIDE  # places along an axis, at most
        self._shape = (1, 1, 1)  # places along x, y, z
        self.texture: Any = None

    @property
    def most_places(self) -> int:
        """How many bricks the device may hold."""
        return int(min(MOST_BYTES // (4 * self.num_channels * SIDE**3), self._side**3))

    @property
    def size(self) -> tuple[int, int, int]:
        """Texels along x, y and z."""
        x, y, z = self._shape
        return x * SIDE, y * SIDE, z * SIDE

    def place(self, keys: Int64, texels: Texels) -> Int64:
        """int64 [n, 3]: the first texel (x, y, z), apron and all, of each of these bricks, at most `most_places`.

        Those that are not on the device are asked for and written there.
        """
        self._time += 1
        if len(keys) > len(self._keys):
            self._grow(len(keys))
        missing = keys[self._places[keys] < 0]
        self._last_used[self._places[keys[self._places[keys] >= 0]]] = self._time
        if len(missing):
            free = np.argsort(self._last_used, kind="stable")[: len(missing)]
            gone = self._keys[free]
            self._places[gone[gone >= 0]] = -1
            self._places[missing], self._keys[free], self._last_used[free] = free, missing, self._time
            for first in range(0, len(missing), _AT_ONCE):
                part = missing[first : first + _AT_ONCE]
                corners = self._corners(self._places[part])
                for corner, content in zip(corners.tolist(), texels(part), strict=True):
                    self.texture.write(content, viewport=(*corner, SIDE, SIDE, SIDE))
        return self._corners(self._places[keys])

    def release(self) -> None:
        """Give the texture back."""
        if self.texture is not None:
            self.texture.release()
            self.texture = None

    def _corners(self, places: Int64) -> Int64:
        x, y, _ = self._shape
        return np.column_stack([places % x, places // x % y, places // (x * y)]) * SIDE

    def _grow(self, num: int) -> None:
        """A texture with room for so many, and some more; what was in the old one is gone."""
        self.release()
        num = min(max(2 * num, _FEWEST_PLACES), self.most_places)
        side = min(round(num ** (1 / 3) + 0.5), self._side)
        self._shape = side, side, min(-(-num // side**2), self._side)
        num = side * side * self._shape[2]
        self._places[:] = -1
        self._keys, self._last_used = np.full(num, -1, np.int64), np.zeros(num, np.int64)
        try:
            self.texture = self._context.texture3d(self.size, self.num_channels, dtype="f4")
        except moderngl.Error as error:
            raise RenderError(
                "the device has no room for the bricks of a picture",
                got=f"{num} bricks, {num * SIDE**3 * 4 * self.num_channels >> 20} MiB: {error}",
                hint="a larger error.tolerance needs fewer",
            ) from error
        self.texture.filter = moderngl.LINEAR, moderngl.LINEAR
        self.texture.repeat_x = self.texture.repeat_y = self.texture.repeat_z = False
