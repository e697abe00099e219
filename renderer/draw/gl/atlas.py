"""Bricks on the device: a 3D texture of places for so many of them.

It grows up to MOST_BYTES, so that the largest texture of a device is no limit; on one that has less memory it stays
smaller.

Where a brick lies depends on all that was drawn before, and a picture must not. So the texture's sides are powers of
two, of which the places leave little over, and the shader looks up places that are multiples of 2^-12 of a texel: with
at most 2^11 texels along a side float32 holds these exactly, and their products with the side, wherever the brick is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import moderngl
import numpy as np

from renderer.bricks import PADDED_BRICK_SIZE
from renderer.draw import brick_atlas
from renderer.draw.brick_atlas import Atlas, Float32, Int64
from renderer.errors import ContextLostError, RenderError

_MIN_SIDE, _MAX_SIDE = 64, 2048  # texels


class GLAtlas(Atlas):
    """As in Atlas. Filtering is linear. Raises RenderError for a device that cannot hold the smallest texture."""

    def __init__(self, context: Any, num_channels: int, num_keys: int) -> None:
        super().__init__(num_channels, num_keys)
        self._context = context
        largest_side = int(context.info["GL_MAX_3D_TEXTURE_SIZE"])
        self._sizes = list(_sizes(num_channels, largest_side))
        if not self._sizes:
            raise RenderError(
                "this device cannot draw bricks: its 3D textures are too small",
                got=f"at most {largest_side} texels a side",
                expected=f"{_MIN_SIDE} or more",
                hint="other footprints than splat.footprint: integrated need no 3D textures",
            )
        self.size = self._sizes[0]  # texels along x, y and z
        self.texture: Any = None

    @property
    def max_slots(self) -> int:
        """How many bricks the device may hold."""
        return _num_slots(self._sizes[-1])

    def corners(self, places: Int64) -> Int64:
        """int64 [n, 3]: the first texels (x, y, z), apron and all, of places."""
        x, y, _ = (side // PADDED_BRICK_SIZE for side in self.size)
        return np.column_stack([places % x, places // x % y, places // (x * y)]) * PADDED_BRICK_SIZE

    def release(self) -> None:
        """Give the texture back."""
        if self.texture is not None:
            self.texture.release()
            self.texture = None
        self._resize(0)

    def _grow(self, num: int) -> None:
        """A texture with room for so many, and some more; what was in the old one is gone."""
        self.release()
        while self.texture is None:
            self.size = _texture_size_for(num, self._sizes)
            self.texture = self._made()
        self._resize(_num_slots(self.size))
        self.texture.filter = moderngl.LINEAR, moderngl.LINEAR
        self.texture.repeat_x = self.texture.repeat_y = self.texture.repeat_z = False

    def _write(self, places: Int64, content: Float32) -> None:
        for corner, brick in zip(self.corners(places).tolist(), content, strict=True):
            self.texture.write(brick, viewport=(*corner, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE))

    def _made(self) -> Any:
        """A texture of this size; None where the device has no memory for it, but perhaps for a smaller one."""
        room = f"{_num_bytes(self.size, self.num_channels) >> 20} MiB, for {_num_slots(self.size)} bricks"
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


def _sizes(num_channels: int, largest_side: int) -> Iterator[tuple[int, int, int]]:
    """All that a texture may have, small ones first: one side after the other is doubled. MOST_BYTES is no limit
    of the first."""
    size = _MIN_SIDE, _MIN_SIDE, _MIN_SIDE
    while max(size) <= min(largest_side, _MAX_SIDE):
        yield size
        x, y, z = size
        size = (2 * x, y, z) if x == z else (x, 2 * y, z) if y == z else (x, y, 2 * z)
        if _num_bytes(size, num_channels) > brick_atlas.MOST_BYTES:
            return


def _texture_size_for(num: int, sizes: Sequence[tuple[int, int, int]]) -> tuple[int, int, int]:
    """The smallest with room for so many bricks, and as many more; the last one where there is none."""
    return next((size for size in sizes if _num_slots(size) >= 2 * num), sizes[-1])


def _num_slots(size: tuple[int, int, int]) -> int:
    return math.prod(side // PADDED_BRICK_SIZE for side in size)


def _num_bytes(size: tuple[int, int, int], num_channels: int) -> int:
    return 4 * num_channels * math.prod(size)
