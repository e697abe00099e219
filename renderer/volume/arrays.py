"""Name the types of arrays by their elements, and reduce blocks of arrays. Docstrings give the shapes of arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Bools = npt.NDArray[np.bool_]
Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]
UInt8 = npt.NDArray[np.uint8]
UInt16 = npt.NDArray[np.uint16]
UInt32 = npt.NDArray[np.uint32]
UInt64 = npt.NDArray[np.uint64]


def reduce_blocks(reduction: np.ufunc, array: Array, sizes: npt.ArrayLike) -> Array:
    """Return an array in which each block of another array is reduced to one element.

    sizes: the size of blocks, or a size for each axis. The last blocks along an axis may be smaller.
    """
    for axis, size in enumerate(np.broadcast_to(sizes, array.ndim).tolist()):
        array = reduction.reduceat(array, np.arange(0, array.shape[axis], size), axis)
    return array
