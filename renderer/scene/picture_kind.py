"""The kind of pictures from which output files are made: their size, background and bit depth."""

from __future__ import annotations

from typing import NamedTuple

from renderer.scene.motion import Motion, value_at
from renderer.scene.schema import Color

# The colours of a background at its top and at its bottom.
Gradient = tuple[Color, Color]
# The background of a picture; None is transparent.
Background = Color | Gradient | None


class PictureKind(NamedTuple):
    """A kind of pictures, from which output files are made: their size, background and bit depth.

    size: (width, height). depth: the bits of a channel, 8 or 16 for whole numbers, 32 for floats.
    dpi: the resolution that files state, in pixels per inch; None if they state none.
    """

    size: tuple[int, int]
    background: Background | Motion[Background]
    depth: int
    dpi: float | None = None

    def at(self, frame: int) -> PictureKind:
        """Return this kind of pictures with its background at a frame."""
        return self._replace(background=self.background_at(frame))

    def background_at(self, frame: int) -> Background:
        """Return the background as it is at a frame."""
        return value_at(self.background, frame)

    @property
    def name(self) -> str:
        """Return a name that no other kind has: `256 x 256, transparent, 8 bits`."""
        width, height = self.size
        behind = f"background {self.background}"
        return f"{width} x {height}, {'transparent' if self.background is None else behind}, {self.depth} bits"

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (height, width, channels) of the pictures, which are RGB, or RGBA if the background is transparent."""
        width, height = self.size
        return height, width, 4 if self.background is None else 3
