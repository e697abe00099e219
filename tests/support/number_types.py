"""The types of voxels, and values from one of their limits to the other."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Random = np.random.Generator

INTEGERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
# A type of each kind for which kernels have loops of their own. Integers of 8 and 16 bits have tables, and types of
# these sizes share a loop.
TYPES = ("int8", "uint16", "float16", "int64", "float32", "float64")
LARGEST = float(np.finfo(np.float64).max)


def limits(dtype: str) -> tuple[float, float]:
    kind = np.iinfo(dtype) if dtype in INTEGERS else np.finfo(dtype)
    return kind.min, kind.max


def spread(dtype: str, rng: Random) -> Array:
    """Return random values over the whole range of a type, [3, 4, 5], with both limits among them."""
    low, high = limits(dtype)
    values = rng.integers(low, high, (3, 4, 5), dtype, endpoint=True) if dtype in INTEGERS else None
    if values is None:
        values = (rng.uniform(-1, 1, (3, 4, 5)) * float(high)).astype(dtype)
    values[0, 0, :2] = low, high
    return values


RANGES = [(-LARGEST, LARGEST), (-1.7e308, 1.7e308), (0.0, 1e-310), (1e6 - 1e-2, 1e6 + 1e-2), (1e15, 1e15 + 8), (0, 255)]


def random_ranges(num_cases: int) -> Iterator[Array]:
    for case in range(num_cases):
        low, high = RANGES[case % len(RANGES)]
        rng = np.random.default_rng(case)
        yield 2 * (low / 2 + (high / 2 - low / 2) * rng.random(1000))
        yield spread(TYPES[case % len(TYPES)], rng)
