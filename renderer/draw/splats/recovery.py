"""Continue after an OpenGL context is lost: make a new context, and draw the image again."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence

from renderer.draw.rasterizer import Rasterizer, RayColors
from renderer.draw.splats.splat_rasterizer import SplatRasterizer
from renderer.errors import ContextLostError, RenderError
from renderer.splats import SplatBatch
from renderer.view import View
from renderer.volume import Float32, UInt32


class RecoveringRasterizer(Rasterizer):
    """A rasteriser of splats that makes another one when its context is lost; used like a SplatRasterizer.

    An image whose context was lost is drawn again, to the same bytes, because no image depends on earlier ones.
    `rasterize` raises ContextLostError if the new context is lost, too; or if no new context can be made on the same
    device and driver, because others would draw other bytes: then it raises the error for every later image as well.
    make: a function that returns a new rasteriser.
    """

    def __init__(self, make: Callable[[], SplatRasterizer] = SplatRasterizer) -> None:
        self._make, self._current, self._num_lost = make, make(), 0
        self._last_loss: ContextLostError | None = None  # the error of the last loss, if no context is left
        self.device = self._current.device

    def release(self) -> None:
        """Free the current context."""
        self._current.release()

    @property
    def notes(self) -> Sequence[str]:
        times = "once" if self._num_lost == 1 else f"{self._num_lost} times"
        return [f"OpenGL's context was lost {times}, and the unfinished pictures were drawn again"] * (
            self._num_lost > 0
        )

    def rasterize(
        self, batches: Sequence[SplatBatch], orders: Sequence[UInt32], view: View, colors: RayColors | None = None
    ) -> Float32:
        """Draw splats, as `SplatRasterizer.rasterize`."""
        if self._last_loss is not None:
            raise self._last_loss
        try:
            return self._current.rasterize(batches, orders, view)
        except ContextLostError as lost:
            self._current.release()  # first, because memory may not suffice for two contexts
            self._current = self._make_replacement(lost)
            self._num_lost += 1
        return self._current.rasterize(batches, orders, view)

    def _make_replacement(self, lost: ContextLostError) -> SplatRasterizer:
        """Return a new rasteriser on the same device. If none can be made, raise `lost`."""
        with contextlib.suppress(RenderError):
            replacement = self._make()
            if replacement.device == self.device:
                return replacement
            replacement.release()
        self._last_loss = lost
        raise lost
