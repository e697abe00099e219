"""Turn stored numbers into values by a slope and an intercept, or into bytes."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.volume import Array


def scaled_type(stored: np.dtype[Any]) -> np.dtype[Any]:
    """Return the type of scaled values: float32 if stored values have at most 16 bits or are float32, else float64."""
    is_short = stored.itemsize <= 2 or stored.newbyteorder("=") == np.float32
    return np.dtype(np.float32 if is_short else np.float64)


def scaled(values: Array, slope: float, intercept: float) -> Array:
    """Return `slope * values + intercept` in the type of `scaled_type`; for slope 1 and intercept 0, the same array."""
    if (slope, intercept) == (1.0, 0.0):
        return values
    found = np.empty(values.shape, scaled_type(values.dtype))
    with np.errstate(over="ignore", invalid="ignore"):  # values too large become infinite, and are refused later
        for plane, target in zip(values, found, strict=True):  # plane by plane: a volume in float64 takes much memory
            target[...] = plane.astype(np.float64) * slope + intercept
    return found


def bytes_of(values: Array) -> memoryview:
    """Return the memory of a contiguous array, byte by byte."""
    return memoryview(values.reshape(-1).view(np.uint8))  # type: ignore[arg-type]
