"""Define the interface that the rasterisers of splats and of bricks have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar

from renderer.kernels import ThreadPool
from renderer.view import View
from renderer.volume import Float32, Float64, UInt32

R = TypeVar("R", bound="Rasterizer")
# A function that turns the amounts gathered by rays into premultiplied RGBA of the same shape. It takes float32 [n, 4]
# with the rays' positions in the picture, float64 [n, 2], in pixels; or float32 [h, w, 4] of a whole picture with None.
RayColors = Callable[[Float32, Float64 | None], Float32]


class BrickMemory(NamedTuple):
    """The memory for the bricks of a scene, in bytes.

    needed: for all visible bricks. limit: the most that bricks may take; with less than `needed`, some are made again.
    """

    needed: int
    limit: int


class Rasterizer(Protocol):
    """A rasteriser: it draws sorted elements of one footprint, those of one SplatBatch or of BrickBatches.

    Use it as a context manager, or call `release`.
    device: the name of the device that draws; the bytes of pictures depend on it.
    threads: the threads that draw, which may also work on the drawn pictures.
    num_rays: the number of rays through pictures so far; 0 for splats.
    brick_memory: the memory of the bricks of the last scene; None for splats, and before anything is drawn.
    notes: sentences for the user about the drawing so far.
    """

    device: str
    threads: ThreadPool = ThreadPool()
    num_rays: int = 0
    brick_memory: BrickMemory | None = None

    @property
    def notes(self) -> Sequence[str]:
        return ()

    def __enter__(self: R) -> R:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def release(self) -> None:
        """Free all memory and devices that the rasteriser holds."""

    def upload(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> bool:
        """Prepare the data of `batch[order]` that later pictures share; return whether any data were missing.

        Pictures do not depend on whether this was called. Splats share no data.
        """
        return False

    def rasterize(
        self, batches: Sequence[Any], orders: Sequence[UInt32], view: View, colors: RayColors | None = None
    ) -> Float32:
        """Composite `batch[order]` of all batches, splats back to front and bricks front to back, over nothing.

        colors: the function that colours rays in a mode that shows a number in place of light, which needs bricks.
        Returns float32 [height, width, 4], premultiplied RGBA.
        """
