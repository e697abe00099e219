"""The atlas of bricks on devices that are smaller than most: it stays smaller, and says so where it cannot be."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
import pytest

from renderer.bricks import PADDED_BRICK_SIZE
from renderer.draw import brick_cache
from renderer.draw.gl.atlas import GLAtlas
from renderer.errors import ContextLostError, InputError, RenderError


class Texture:
    """Of so many bytes in the device's memory."""

    def __init__(self, device: Device, num_bytes: int) -> None:
        self.device, self.num_bytes = device, num_bytes
        device.used += num_bytes

    def write(self, content: Any, viewport: tuple[int, ...]) -> None:
        """Nobody looks at it."""

    def release(self) -> None:
        self.device.used -= self.num_bytes
        self.num_bytes = 0

    __del__ = release


class Device:
    """What an Atlas needs of a GL context, with so much memory."""

    def __init__(self, num_bytes: int) -> None:
        self.num_bytes, self.used = num_bytes, 0
        self.complaint = self.complaint_of_textures = "GL_NO_ERROR"

    def texture3d(self, size: tuple[int, int, int], num_channels: int, dtype: str) -> Texture:
        texture = Texture(self, 4 * num_channels * int(np.prod(size)))
        self.complaint = self.complaint_of_textures
        if self.used > self.num_bytes:
            self.complaint = "GL_OUT_OF_MEMORY"
        return texture

    def gc(self) -> None:
        """Textures free themselves."""

    @property
    def error(self) -> str:
        """The last complaint, once."""
        complaint, self.complaint = self.complaint, "GL_NO_ERROR"
        return complaint


def zeros(keys: Any) -> Any:
    return np.zeros((len(keys), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, 4), np.float32)


def test_a_device_with_little_memory_holds_fewer_bricks() -> None:
    device = Device(20 << 20)
    atlas = GLAtlas(device, 2048, 4, 4000)
    atlas.reserve(1000)
    assert atlas.size == (128, 128, 64)  # 16 MiB; what was too large is given back
    assert device.used == 16 << 20
    assert atlas.max_slots == 7 * 7 * 3
    first = atlas.upload(np.arange(147), zeros)
    assert len(np.unique(atlas.corners(first), axis=0)) == 147
    atlas.reserve(1000)  # is not tried again
    assert np.array_equal(atlas.upload(np.arange(147), pytest.fail), first)


def test_a_device_without_memory_for_a_batch() -> None:
    device = Device(1 << 20)
    atlas = GLAtlas(device, 2048, 4, 4000)
    with pytest.raises(RenderError) as raised:
        atlas.reserve(30)
    assert str(raised.value) == (
        "the device has no memory for a batch of bricks\n"
        "  got: not even 4 MiB, for 27 bricks\n"
        "  hint: other programs may be using it; other footprints than splat.footprint: integrated need less"
    )
    assert not isinstance(raised.value, ContextLostError)  # another context would not help
    assert device.used == 0


def test_a_device_with_small_textures() -> None:
    with pytest.raises(RenderError) as raised:
        GLAtlas(Device(1 << 30), 32, 4, 4000)
    assert str(raised.value) == (
        "this device cannot draw bricks: its 3D textures are too small\n"
        "  got: at most 32 texels a side\n"
        "  expected: 64 or more\n"
        "  hint: other footprints than splat.footprint: integrated need no 3D textures"
    )
    assert GLAtlas(Device(1 << 30), 64, 4, 4000).max_slots == 27


def test_little_room_by_choice_is_room_for_some(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(brick_cache, "MAX_ATLAS_BYTES", 1 << 10)
    assert GLAtlas(Device(1 << 30), 2048, 4, 4000).max_slots == 27


def test_what_failed_before_is_not_taken_for_a_lack_of_room() -> None:
    """The picture would lack something, and nobody would know."""
    device = Device(1 << 30)
    atlas = GLAtlas(device, 2048, 4, 4000)
    device.complaint = "GL_OUT_OF_MEMORY"
    with pytest.raises(moderngl.Error, match=r"^GL_OUT_OF_MEMORY$"):
        atlas.reserve(1000)
    atlas.reserve(1000)
    assert atlas.max_slots > 1000


def test_a_lost_context() -> None:
    device = Device(1 << 30)
    device.complaint_of_textures = "GL_INVALID_OPERATION"
    with pytest.raises(moderngl.Error, match=r"^GL_INVALID_OPERATION$"):
        GLAtlas(device, 2048, 1, 4000).reserve(1)
    assert device.used == 0


def test_bricks_that_could_not_be_made_are_not_there() -> None:
    """After an error in the middle of a batch they are asked for again."""
    atlas = GLAtlas(Device(1 << 30), 2048, 4, 4000)
    atlas.reserve(1000)

    def fail_late(keys: Any) -> Any:
        if keys[0] > 0:
            raise InputError("the file became shorter")
        return zeros(keys)

    with pytest.raises(InputError):
        atlas.upload(np.arange(600), fail_late)
    asked = []

    def note(keys: Any) -> Any:
        asked.extend(keys.tolist())
        return zeros(keys)

    atlas.upload(np.arange(600), note)
    assert asked == list(range(256, 600))
