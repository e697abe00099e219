"""Say what all rasterisers have in common, whatever draws."""

from __future__ import annotations

from typing import Protocol, TypeVar

from renderer.bricks import BrickBatch
from renderer.kernels import ThreadPool
from renderer.splats import SplatBatch
from renderer.view import View
from renderer.volume import Float32, UInt32

R = TypeVar("R", bound="Rasterizer")


class Rasterizer(Protocol):
    """A rasteriser of sorted splats or bricks, as float32 [height, width, 4], premultiplied RGBA over nothing.

    Use it as a context manager, or call `release`. device: what draws, on which the bytes depend.
    """

    device: str

    def __enter__(self: R) -> R:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    @property
    def threads(self) -> ThreadPool:
        """Return its threads, which also work on what it has drawn."""

    def release(self) -> None:
        """Free all that it holds."""

    def upload(self, batch: SplatBatch | BrickBatch, order: UInt32, view: View) -> bool:
        """Place what later pictures of `batch[order]` share where it is drawn, and return whether any was missing.

        Pictures do not depend on it.
        """

    def rasterize(self, batch: SplatBatch | BrickBatch, order: UInt32, view: View) -> Float32:
        """Composite `batch[order]`, splats back to front and bricks front to back."""
