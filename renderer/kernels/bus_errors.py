"""Make reads beyond the end of a mapped file give zeros and not raise SIGBUS (sources/base/bus_errors.cpp)."""

from __future__ import annotations

import mmap
import sys
from functools import cache

import numpy as np
import numpy.typing as npt

from renderer.kernels.binding import kernels

# The largest number of mapped regions of memory that can be guarded at the same time.
_MOST = 64


@cache
def guarded_regions() -> npt.NDArray[np.int64]:
    """Return the table of guarded regions of memory, which the caller fills in; it is empty except on Linux.

    A guarded region maps a file: reads beyond the end of the file give zeros there. The table is int64 [n, 4]. A row
    has the address of the region's first byte, the address after its last byte (0 if the row is free), the file's
    descriptor, and the file's length. Both addresses are on page borders. The address after the last byte must be set
    last, as it makes the row valid. The table lives as long as the process.
    """
    regions = np.zeros((_MOST if sys.platform == "linux" else 0, 4), np.int64)
    if len(regions):
        kernels().guard_regions(regions=regions, page_size=mmap.PAGESIZE)
    return regions
