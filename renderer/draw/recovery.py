"""Continue after a GL context is lost: draw the image again with a new context."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from typing import TypeVar

from renderer.bricks import BrickBatch
from renderer.draw.cpu.raster import CPURasterizer
from renderer.draw.gl.raster import GLRasterizer
from renderer.draw.rasterizer import Rasterizer
from renderer.errors import ContextLostError, RenderError
from renderer.kernels import ThreadPool
from renderer.splats import SplatBatch
from renderer.system import num_drawing_threads
from renderer.view import View
from renderer.volume import Float32, UInt32

Result = TypeVar("Result")


def open_rasterizer(*, needs_opengl: bool) -> Rasterizer:
    """Open the rasteriser of OpenGL; where there is no OpenGL and nothing needs it, the one of the processor.

    needs_opengl: as in Scene.
    Raises RenderError where there is no OpenGL and it is needed.
    """
    num_threads = num_drawing_threads()
    try:
        return GLRasterizer(num_threads=num_threads)
    except RenderError:
        if needs_opengl:
            raise
        return CPURasterizer(num_threads=num_threads)


class RecoveringRasterizer(Rasterizer):
    """A rasteriser that makes another one when its context is lost; used like a GLRasterizer.

    An image whose context was lost is drawn again, to the same bytes, because no image depends on those before it.
    Raises ContextLostError where the new context is lost, too, where none can be made, or only one of another device or
    driver, which would draw other bytes; without a new context it does so from then on. make: returns a new rasteriser.
    """

    def __init__(self, make: Callable[[], Rasterizer] = GLRasterizer) -> None:
        self._make, self._current, self._num_lost = make, make(), 0
        self._last_loss: ContextLostError | None = None  # after which there is no context
        self.device = self._current.device

    @property
    def threads(self) -> ThreadPool:
        return self._current.threads

    def release(self) -> None:
        """Free the current context."""
        self._current.release()

    @property
    def notes(self) -> Sequence[str]:
        """Return notes for the user."""
        times = "once" if self._num_lost == 1 else f"{self._num_lost} times"
        return [f"OpenGL's context was lost {times}, and what it had was drawn again"] * (self._num_lost > 0)

    def upload(self, batch: SplatBatch | BrickBatch, order: UInt32, view: View) -> bool:
        """Upload bricks, as `GLRasterizer.upload`."""
        return self._with_recovery(lambda gl: gl.upload(batch, order, view))

    def rasterize(self, batch: SplatBatch | BrickBatch, order: UInt32, view: View) -> Float32:
        """Draw splats or bricks, as `GLRasterizer.rasterize`."""
        return self._with_recovery(lambda gl: gl.rasterize(batch, order, view))

    def _with_recovery(self, draw: Callable[[Rasterizer], Result]) -> Result:
        if self._last_loss is not None:
            raise self._last_loss
        try:
            return draw(self._current)
        except ContextLostError as lost:
            self._current.release()  # first, because memory may not suffice for two
            self._current = self._make_replacement(lost)
            self._num_lost += 1
        return draw(self._current)

    def _make_replacement(self, lost: ContextLostError) -> Rasterizer:
        """Return a new rasteriser of the same device. Where none can be made, raise `lost`."""
        with contextlib.suppress(RenderError):
            replacement = self._make()
            if replacement.device == self.device:
                return replacement
            replacement.release()
        self._last_loss = lost
        raise lost
