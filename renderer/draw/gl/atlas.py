"""Bricks in a 3D texture.

The texture grows up to MAX_ATLAS_BYTES, so that the largest texture of a device is no limit. On a device with less
memory it stays smaller.

The slot of a brick depends on all that was drawn before, and the image must not. Therefore the texture's sides are
powers of two, of which the slots leave little unused, and the shader reads the texture at multiples of 2^-12 of a
texel: with at most MAX_ATLAS_SIDE = 2^11 texels along a side float32 holds these exactly, and so their quotients with
the side, wherever the brick is.
"""

from __future__ import annotations

import math
from typing import Any

import moderngl
import numpy as np

from renderer.bricks import PADDED_BRICK_SIZE
from renderer.draw import brick_cache
from renderer.draw.brick_cache import Atlas
from renderer.draw.constants import MAX_ATLAS_SIDE
from renderer.errors import RenderError
from renderer.volume import Float32, Int64

Size = tuple[int, int, int]

_MIN_SIDE = 64  # texels


class GLAtlas(Atlas):
    """An atlas on the device, linearly filtered. largest_side: of 3D textures on the device, in texels.

    Raises RenderError where the smallest texture is too large for the device, and moderngl.Error where its context is
    lost.
    """

    def __init__(self, context: Any, largest_side: int, num_channels: int, num_keys: int) -> None:
        self._context = context
        self._texture_sizes = _texture_sizes(num_channels, largest_side)
        if not self._texture_sizes:
            raise RenderError(
                "this device cannot draw bricks: its 3D textures are too small",
                got=f"at most {largest_side} texels a side",
                expected=f"{_MIN_SIDE} or more",
                hint="other footprints than splat.footprint: integrated need no 3D textures",
            )
        super().__init__(num_channels, num_keys, _num_slots(self._texture_sizes[-1]))
        self.size = self._texture_sizes[0]  # texels along x, y and z
        self.texture: Any = None

    def corners(self, slots: Int64) -> Int64:
        """Return the first texels (x, y, z) of slots, halo included: int64 [n, 3]."""
        x, y, _ = (side // PADDED_BRICK_SIZE for side in self.size)
        return np.column_stack([slots % x, slots // x % y, slots // (x * y)]) * PADDED_BRICK_SIZE

    def release(self) -> None:
        """Free the texture."""
        self.texture = None
        self._context.gc()
        self._resize(0)

    def _grow(self, num: int) -> None:
        """Make the smallest texture with twice as many slots, or the largest one; the bricks are lost."""
        self.release()
        while self.texture is None:
            sizes = self._texture_sizes
            self.size = next((size for size in sizes if _num_slots(size) >= 2 * num), sizes[-1])
            self.texture = self._try_make_texture()
        self._resize(_num_slots(self.size))
        self.texture.filter = moderngl.LINEAR, moderngl.LINEAR
        self.texture.repeat_x = self.texture.repeat_y = self.texture.repeat_z = False

    def _write(self, slots: Int64, texels: Float32) -> None:
        for corner, brick in zip(self.corners(slots).tolist(), texels, strict=True):
            self.texture.write(brick, viewport=(*corner, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE))

    def _try_make_texture(self) -> Any:
        """Return a texture of this size, or None where the device may have memory for a smaller one."""
        if (error_before := self._context.error) != "GL_NO_ERROR":  # which is reported once, and is not this texture's
            raise moderngl.Error(error_before)
        room = f"{_num_bytes(self.size, self.num_channels) >> 20} MiB, for {_num_slots(self.size)} bricks"
        texture = self._context.texture3d(self.size, self.num_channels, dtype="f4")
        failure = self._context.error
        if failure == "GL_NO_ERROR":
            return texture
        texture.release()
        if failure != "GL_OUT_OF_MEMORY":
            raise moderngl.Error(failure)
        self._texture_sizes = self._texture_sizes[: self._texture_sizes.index(self.size)]
        if not self._texture_sizes:
            raise RenderError(
                "the device has no memory for a batch of bricks",
                got=f"not even {room}",
                hint="other programs may be using it; other footprints than splat.footprint: integrated need less",
            )
        self.max_slots = _num_slots(self._texture_sizes[-1])
        return None


def _texture_sizes(num_channels: int, largest_side: int) -> list[Size]:
    """Return all sizes of textures, small ones first: one side after the other is doubled, up to MAX_ATLAS_BYTES."""
    sizes: list[Size] = []
    size = _MIN_SIDE, _MIN_SIDE, _MIN_SIDE
    while max(size) <= min(largest_side, MAX_ATLAS_SIDE):
        sizes.append(size)
        x, y, z = size
        size = (2 * x, y, z) if x == z else (x, 2 * y, z) if y == z else (x, y, 2 * z)
        if _num_bytes(size, num_channels) > brick_cache.MAX_ATLAS_BYTES:
            break
    return sizes


def _num_slots(size: Size) -> int:
    return math.prod(side // PADDED_BRICK_SIZE for side in size)


def _num_bytes(size: Size, num_channels: int) -> int:
    return 4 * num_channels * math.prod(size)
