"""What the commands draw with, on as many threads as this process may use."""

from __future__ import annotations

import os
from functools import partial

from hsplat_cli.terminal import num_cores
from renderer.draw import CPURasterizer, GLRasterizer, RecoveringRasterizer
from renderer.errors import RenderError


def open_rasterizer(*, needs_opengl: bool) -> GLRasterizer | CPURasterizer:
    """For pictures that need not outlive a lost context. needs_opengl: as in Scene; of any of them.

    Raises RenderError where there is no OpenGL, and one of them needs it.
    """
    try:
        return GLRasterizer(num_threads=num_drawing_threads())
    except RenderError:
        if needs_opengl:
            raise
        return CPURasterizer(num_threads=num_drawing_threads())


def open_recovering_rasterizer(*, needs_opengl: bool) -> RecoveringRasterizer:
    """For films; as `open_rasterizer`."""
    return RecoveringRasterizer(partial(open_rasterizer, needs_opengl=needs_opengl))


def num_drawing_threads() -> int:
    """Threads that draw one picture on the processor: as many as Mesa's software renderer takes."""
    wanted = os.environ.get("LP_NUM_THREADS", "")
    return max(1, int(wanted)) if wanted.isascii() and wanted.isdecimal() and len(wanted) < 4 else num_cores()
