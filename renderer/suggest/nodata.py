"""Find values far from all others: nodata values, as in netCDF and GIS data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

# In ranges of the other values.
_MIN_OUTLIER_DISTANCE = 3.0
# A far value is nodata if so many voxels have it.
_MIN_NODATA_FRACTION = 1e-3
# Common nodata values of GIS, netCDF, CF and of types.
_NODATA_VALUES = (-999.0, -9999.0, -99999.0, -32767.0, -32768.0, -(2.0**31), 1e20, 9.969209968386869e36)
_LARGEST_FLOATS = tuple(float(np.finfo(name).max) for name in ("f4", "f8"))
# At either end at most so many values are set aside.
MAX_OUTLIERS_PER_END = 2


@dataclass(frozen=True)
class OutlierValue:
    """A value far from all others, that `num` voxels have: nodata; or isolated voxels, from `value` to `last`."""

    value: int | float
    num: int
    is_nodata: bool
    last: int | float


@dataclass(frozen=True)
class ValueCluster:
    """A cluster of neighbouring values, from `low` to `high`, both included, that `num` voxels have."""

    low: int | float
    high: int | float
    num: int


# The outliers, and the range of the other values.
OutlierSplit = tuple[tuple[OutlierValue, ...], float, float]


def find_outliers(
    lowest: Sequence[ValueCluster], highest: Sequence[ValueCluster], num_groups: int, num_voxels: int
) -> OutlierSplit | None:
    """Return as many outliers as possible at both ends; None if no value is an outlier.

    lowest, highest: the outermost clusters of values, from either end inwards. num_groups: of all values.
    """
    splits = sorted(product(range(MAX_OUTLIERS_PER_END + 1), repeat=2), key=sum, reverse=True)
    for a, b in splits:
        if a + b == 0 or a + b >= num_groups:
            continue
        low, high = lowest[a].low, highest[b].high
        outer = [*lowest[:a], *highest[:b]]
        gap = min(max(low - group.high, group.low - high) for group in outer)
        is_far = gap > _MIN_OUTLIER_DISTANCE * (high - low) > 0
        if is_far and all(_is_nodata(group, num_voxels) for group in outer):
            return tuple(OutlierValue(g.low, g.num, True, g.high) for g in outer), low, high
    return None


def _is_nodata(group: ValueCluster, num_voxels: int) -> bool:
    if group.low != group.high:
        return False
    is_known = any(math.isclose(group.low, value, rel_tol=1e-6) for value in _NODATA_VALUES)
    is_known |= any(math.isclose(abs(group.low), value, rel_tol=1e-6) for value in _LARGEST_FLOATS)
    return is_known or group.num >= max(2, _MIN_NODATA_FRACTION * num_voxels)
