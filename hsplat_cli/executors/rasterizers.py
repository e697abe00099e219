"""Opens the rasterisers of the commands, on as many threads as this process may use."""

from __future__ import annotations

from functools import partial

from renderer import draw
from renderer.cores import num_drawing_threads


def open_rasterizer(*, needs_opengl: bool) -> draw.GLRasterizer | draw.CPURasterizer:
    """Open a rasteriser for pictures that need not outlive a lost context; as `renderer.draw.open_rasterizer`."""
    return draw.open_rasterizer(needs_opengl=needs_opengl, num_threads=num_drawing_threads())


def open_recovering_rasterizer(*, needs_opengl: bool) -> draw.RecoveringRasterizer:
    """Open a rasteriser for films; as `open_rasterizer`."""
    return draw.RecoveringRasterizer(partial(open_rasterizer, needs_opengl=needs_opengl))
