"""Guards mapped volumes against files that become shorter: zeros are read, in place of a signal that kills.

A read beyond the end of a mapped file raises SIGBUS, in the middle of a kernel. `renderer.kernels` maps zeros there, so
that the kernel ends; `renderer` checks the file after it has read, and raises InputError.
"""

from __future__ import annotations

import mmap
import os
import weakref
from typing import Any

import numpy as np

from renderer.kernels import guarded_regions
from renderer.volume.arrays import Array
from renderer.volume.mapped_file import MappedFile


def guard_mapping(file: MappedFile, values: Array) -> None:
    """Make `values`, of any strides, read as zeros where their file has become shorter, for as long as they live.

    Does nothing on systems without such a handler.
    """
    regions = guarded_regions()
    free = np.flatnonzero(regions[:, 1] == 0)
    if not free.size:
        return
    try:
        descriptor = os.open(file.path, os.O_RDONLY)
    except OSError:  # gone, which the next check finds
        return
    status = os.fstat(descriptor)
    if (status.st_dev, status.st_ino) != file.state[:2]:  # replaced, which it finds, too
        os.close(descriptor)
        return
    begin, end = np.lib.array_utils.byte_bounds(values)
    region = regions[free[0]]
    region[[0, 2, 3]] = begin & -mmap.PAGESIZE, descriptor, file.state[2]
    region[1] = -(-end // mmap.PAGESIZE) * mmap.PAGESIZE  # last: the handler uses regions with an end
    root: Any = values
    while isinstance(root, np.ndarray):
        root = root.base
    weakref.finalize(root, _release_region, region)


def _release_region(region: Array) -> None:
    region[1] = 0
    os.close(int(region[2]))
