"""Rasterise without OpenGL what needs none: bricks, by the compiled loops of `cpu_bricks`."""

from __future__ import annotations

from types import TracebackType

import numpy as np
import numpy.typing as npt

from renderer.bricks import BrickBatch
from renderer.draw.cpu.bricks import CPUBrickRenderer
from renderer.draw.gl.raster import CPU_RENDERER_NAME, Image
from renderer.draw.overlay import CellEdges
from renderer.splats import SplatBatch
from renderer.view import View


class CPURasterizer:
    """As GLRasterizer, for scenes that do not need OpenGL (`Scene.needs_opengl`): it has nothing but bricks."""

    renderer_name = CPU_RENDERER_NAME

    def __init__(self, *, num_threads: int = 2) -> None:
        self._bricks = CPUBrickRenderer(num_threads)

    def __enter__(self) -> CPURasterizer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    def release(self) -> None:
        """As in GLRasterizer."""
        self._bricks.release()

    def forget(self) -> None:
        """As in GLRasterizer."""
        self._bricks.forget()

    def upload(self, batch: SplatBatch | BrickBatch, order: npt.NDArray[np.uint32], view: View) -> bool:
        """As in GLRasterizer."""
        assert isinstance(batch, BrickBatch)
        return self._bricks.upload(batch, order, view)

    def rasterize(self, batch: SplatBatch | BrickBatch, order: npt.NDArray[np.uint32], view: View) -> Image:
        """As in GLRasterizer."""
        assert isinstance(batch, BrickBatch)
        return self._bricks.draw(batch, order, view)

    def rasterize_edges(self, edges: CellEdges, view: View) -> Image:
        """What such scenes do not have; never called."""
        raise AssertionError("lines need OpenGL")
