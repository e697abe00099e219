"""Guard mapped volumes against files that become shorter: zeros are read, instead of a signal that ends the process.

A read beyond the end of a mapped file raises SIGBUS, in the middle of a kernel. `renderer.kernels` then maps zeros
there, so that the kernel ends. `renderer` checks the file after the kernel, and raises InputError.
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
    """Let `values` be read as zeros wherever their file has become shorter, for as long as they live.

    It does nothing on systems without a handler for the signal. values: the mapped array, with any strides.
    """
    regions = guarded_regions()
    free = np.flatnonzero(regions[:, 1] == 0)
    if not free.size:
        return
    try:
        descriptor = os.open(file.path, os.O_RDONLY)
    except OSError:  # the file is gone, which the next check finds
        return
    status = os.fstat(descriptor)
    if (status.st_dev, status.st_ino) != file.state[:2]:  # the file was replaced, which the next check finds
        os.close(descriptor)
        return
    begin, end = np.lib.array_utils.byte_bounds(values)
    region = regions[free[0]]
    region[[0, 2, 3]] = begin & -mmap.PAGESIZE, descriptor, file.state[2]
    region[1] = -(-end // mmap.PAGESIZE) * mmap.PAGESIZE  # set last, as the handler uses regions that have an end
    root: Any = values
    while isinstance(root, np.ndarray):
        root = root.base
    weakref.finalize(root, _release_region, region)


def _release_region(region: Array) -> None:
    region[1] = 0
    os.close(int(region[2]))
