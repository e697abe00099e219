"""What the commands draw with, on as many threads as this process may use."""

from __future__ import annotations

import os

from hsplat_cli.cores import num_cores
from renderer.raster_gl import GLRasterizer
from renderer.raster_lasting import LastingRasterizer


def open_rasterizer() -> GLRasterizer:
    """For pictures that need not outlive a lost context."""
    return GLRasterizer(num_threads=num_drawing_threads())


def open_lasting_rasterizer() -> LastingRasterizer:
    """For films."""
    return LastingRasterizer(open_rasterizer)


def num_drawing_threads() -> int:
    """Threads that draw one picture on the processor: as many as Mesa's software renderer takes."""
    wanted = os.environ.get("LP_NUM_THREADS", "")
    return max(1, int(wanted)) if wanted.isascii() and wanted.isdecimal() and len(wanted) < 4 else num_cores()
