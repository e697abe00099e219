"""Bricks on the device: a 3D texture of places for so many of them, and which brick is where.

Bricks stay until their place is needed: those that were drawn longest ago go first. The texture grows to what a film
needs, up to MOST_BYTES, so that neither a volume's size nor the largest texture of a device is a limit; on a device
that has less memory it stays smaller, and bricks come and go more often.

Where a brick lies depends on all that was drawn before, and a picture must not. So the texture's sides are powers of
two, of which the places leave little over, and the shader looks up places that are multiples of 2^-12 of a texel: with
at most 2^11 texels along a side float32 holds these exactly, and their products with the side, wherever the brick is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from renderer.brick_kernels import SIDE
from renderer.errors import ContextLostError, RenderError

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]
Texels = Callable[[Int64], Float32]  # of the bricks with these keys: float32 [n, SIDE, SIDE, SIDE(, 4)]

MOST_BYTES = 256 << 20
_LEAST_SIDE, _LARGEST_SIDE = 64, 2048  # texels
# Bricks that are made ready at a time, before they go to the device.
_AT_ONCE = 256


class Atlas:
    """A texture with the bricks of one kind; keys are numbers from 0 up, below `num_keys`, that the caller gives them.

    num_channels: 1 or 4, float32. Filtering is linear. Raises RenderError for a device that cannot hold the smallest
    texture.
    """

    def __init__(self, context: Any, num_channels: int, num_keys: int) -> None:
        self._context, self.num_channels = context, num_channels
        self._places = np.full(num_keys, -1, np.int64)  # of each key; -1: not on the device
        self._keys = np.empty(0, np.int64)  # of each place; -1: free
        self._last_used = np.empty(0, np.int64)
        self._time = 0
        largest_side = int(context.info["GL_MAX_3D_TEXTURE_SIZE"])
        self._sizes = list(_sizes(num_channels, largest_side))
        if not self._sizes:
            raise RenderError(
                "this device cannot draw bricks: its 3D textures are too small",
                got=f"at most {largest_side} texels a side",
                expected=f"{_LEAST_SIDE} or more",
                hint="other footprints than splat.footprint: integrated need no 3D textures",
            )
        self.size = self._sizes[0]  # texels along x, y and z
        self.texture: Any = None

    @property
    def most_places(self) -> int:
        """How many bricks the device may hold."""
        return _num_places(self._sizes[-1])

    def reserve(self, num: int) -> None:
        """Make room for so many bricks, or as many as there may be; whoever draws fewer at a time keeps the others."""
        if min(num, self.most_places) > len(self._keys):
            self._grow(num)

    def num_missing(self, keys: Int64) -> int:
        """How many of these bricks are not on the device."""
        return int(np.count_nonzero(self._places[keys] < 0))

    def place(self, keys: Int64, texels: Texels) -> Int64:
        """int64 [n, 3]: the first texel (x, y, z), apron and all, of each of these bricks, of which there is room for.

        Those that are not on the device are asked for and written there.
        """
        self._time += 1
        missing = keys[self._places[keys] < 0]
        self._last_used[self._places[keys[self._places[keys] >= 0]]] = self._time
        if len(missing):
            free = np.argsort(self._last_used, kind="stable")[: len(missing)]
            gone = self._keys[free]
            self._places[gone[gone >= 0]] = -1
            self._keys[free] = -1
            for first in range(0, len(missing), _AT_ONCE):
                part, places = missing[first : first + _AT_ONCE], free[first : first + _AT_ONCE]
                for corner, content in zip(self._corners(places).tolist(), texels(part), strict=True):
                    self.texture.write(content, viewport=(*corner, SIDE, SIDE, SIDE))
                self._places[part], self._keys[places], self._last_used[places] = places, part, self._time
        return self._corners(self._places[keys])

    def release(self) -> None:
        """Give the texture back."""
        if self.texture is not None:
            self.texture.release()
            self.texture = None
        self._places[:] = -1
        self._keys, self._last_used = np.empty(0, np.int64), np.empty(0, np.int64)

    def _made(self) -> Any:
        """A texture of this size; None where the device has no memory for it, but perhaps for a smaller one."""
        room = f"{_num_bytes(self.size, self.num_channels) >> 20} MiB, for {_num_places(self.size)} bricks"
        try:
            texture = self._context.texture3d(self.size, self.num_channels, dtype="f4")
        except moderngl.Error as error:
            raise ContextLostError(  # which of the two, nobody can tell
                "the device has no room for the bricks of a picture, or its context was lost",
                got=f"{room}: {error}",
                hint="if it is the room, a larger error.tolerance needs fewer",
            ) from error
        error_name = self._context.error
        if error_name == "GL_NO_ERROR":
            return texture
        texture.release()
        if error_name != "GL_OUT_OF_MEMORY":
            raise ContextLostError("OpenGL made no texture for bricks, or its context was lost", got=error_name)
        self._sizes = self._sizes[: self._sizes.index(self.size)]
        if not self._sizes:
            raise RenderError(
                "the device has no memory for a batch of bricks",
                got=f"not even {room}",
                hint="other programs may be using it; other footprints than splat.footprint: integrated need less",
            )
        return None

    def _corners(self, places: Int64) -> Int64:
        x, y, _ = (side // SIDE for side in self.size)
        return np.column_stack([places % x, places // x % y, places // (x * y)]) * SIDE

    def _grow(self, num: int) -> None:
        """A texture with room for so many, and some more; what was in the old one is gone."""
        self.release()
        while self.texture is None:
            self.size = _size_for(num, self._sizes)
            self.texture = self._made()
        num = _num_places(self.size)
        self._keys, self._last_used = np.full(num, -1, np.int64), np.zeros(num, np.int64)
        self.texture.filter = moderngl.LINEAR, moderngl.LINEAR
        self.texture.repeat_x = self.texture.repeat_y = self.texture.repeat_z = False


def _sizes(num_channels: int, largest_side: int) -> Iterator[tuple[int, int, int]]:
    """All that a texture may have, small ones first: one side after the other is doubled. MOST_BYTES is no limit
    of the first."""
    size = _LEAST_SIDE, _LEAST_SIDE, _LEAST_SIDE
    while max(size) <= min(largest_side, _LARGEST_SIDE):
        yield size
        x, y, z = size
        size = (2 * x, y, z) if x == z else (x, 2 * y, z) if y == z else (x, y, 2 * z)
        if _num_bytes(size, num_channels) > MOST_BYTES:
            return


def _size_for(num: int, sizes: Sequence[tuple[int, int, int]]) -> tuple[int, int, int]:
    """The smallest with room for so many bricks, and as many more; the last one where there is none."""
    return next((size for size in sizes if _num_places(size) >= 2 * num), sizes[-1])


def most_atlas_bytes(num_channels: int, num_keys: int) -> int:
    """What an atlas takes at most of that many bricks."""
    return _num_bytes(_size_for(num_keys, list(_sizes(num_channels, _LARGEST_SIDE))), num_channels) if num_keys else 0


def _num_places(size: tuple[int, int, int]) -> int:
    return math.prod(side // SIDE for side in size)


def _num_bytes(size: tuple[int, int, int], num_channels: int) -> int:
    return 4 * num_channels * math.prod(size)
