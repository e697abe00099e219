"""Make reads beyond the end of a mapped file give zeros and not raise SIGBUS (sources/base/bus_errors.cpp)."""

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
    """Return the guarded regions, for the caller to fill in; none on systems without the handler.

    Regions are int64 [n, 4]: the address of the first byte, and the address after the last byte, which is 0 for a free
    region; both are on page borders. Then come the file's descriptor and its length. Set the second number last. The
    array lives as long as the process.
    """
    regions = np.zeros((_MOST if sys.platform == "linux" else 0, 4), np.int64)
    if len(regions):
        kernels().guard_regions(regions=regions, page_size=mmap.PAGESIZE)
    return regions
