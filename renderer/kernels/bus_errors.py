"""Reads beyond the end of a mapped file give zeros, where they would raise SIGBUS (sources/bus_errors.cpp)."""

from __future__ import annotations

import mmap
import sys
from functools import cache

import numpy as np
import numpy.typing as npt

from renderer.kernels.binding import kernels

# The number of regions that can be guarded at once.
_MOST = 64


@cache
def guarded_regions() -> npt.NDArray[np.int64]:
    """Return the regions that are guarded, for the caller to fill; none on systems without the handler.

    They are int64 [n, 4]: the addresses of the first byte and beyond the last, whole pages, 0 for a free region; the
    descriptor and the length of the file. Set the second number last. They live as long as the process.
    """
    regions = np.zeros((_MOST if sys.platform == "linux" else 0, 4), np.int64)
    if len(regions):
        kernels().guard_regions(regions=regions, page_size=mmap.PAGESIZE)
    return regions
