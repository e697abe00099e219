"""Values that lie far from all others: what stands for missing voxels in netCDF and GIS data, and single outliers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from renderer.suggest.percentiles import Counts

# Times the range of the others.
_MIN_OUTLIER_DISTANCE = 3.0
# Up to that part of the voxels are outliers, and from that part on a value was filled in.
_MAX_OUTLIER_FRACTION, _MIN_NODATA_FRACTION = 1e-5, 1e-3
# Values that stand for missing ones wherever there are any: of GIS, netCDF, CF and of types.
_NODATA_VALUES = (-999.0, -9999.0, -99999.0, -32767.0, -32768.0, -(2.0**31), 1e20, 9.969209968386869e36)
_LARGEST = (float(np.finfo(np.float32).max), float(np.finfo(np.float64).max))
_KNOWN_NODATA_VALUES = (*_NODATA_VALUES, *_LARGEST, *(-value for value in _LARGEST))
# So many values are set aside at either end at most: a fill value and an outlier.
MAX_OUTLIERS_PER_END = 2


@dataclass(frozen=True)
class OutlierValue:
    """One value, which `num` voxels have. is_nodata: it was filled in; else these are outliers."""

    value: int | float
    num: int
    is_nodata: bool


@dataclass(frozen=True)
class ValueCluster:
    """Neighbouring values, from `low` to `high`, both included, that `num` voxels have."""

    low: int | float
    high: int | float
    num: int


@dataclass(frozen=True)
class OutlierSplit:
    """far: values far from the others, which are from `low` to `high`."""

    outliers: tuple[OutlierValue, ...]
    low: int | float
    high: int | float


def end_cluster_ranks(counts: Counts) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """For either end, from there inwards: the ranks at which its groups of values begin and end. counts: by group."""
    stops = np.cumsum(counts[counts > 0]).tolist()
    pairs = list(zip([0, *stops], [stop - 1 for stop in stops], strict=False))
    return pairs[: MAX_OUTLIERS_PER_END + 1], pairs[: -MAX_OUTLIERS_PER_END - 2 : -1]


def find_outliers(
    lowest: Sequence[ValueCluster], highest: Sequence[ValueCluster], num_groups: int, num_voxels: int
) -> OutlierSplit | None:
    """The most values at both ends that are far from the rest; None where there are none.

    lowest, highest: the outermost groups of values, from either end inwards; num_groups: of all values.
    """
    ways = sorted(product(range(MAX_OUTLIERS_PER_END + 1), repeat=2), key=sum, reverse=True)
    for a, b in ways:
        if a + b == 0 or a + b >= num_groups:
            continue
        low, high = lowest[a].low, highest[b].high
        outer = [*lowest[:a], *highest[:b]]
        least = _MIN_OUTLIER_DISTANCE * (high - low)
        if least > 0 and all(
            max(low - group.high, group.low - high) > least and _is_outlying(group, num_voxels) for group in outer
        ):
            return OutlierSplit(tuple(OutlierValue(g.low, g.num, _is_nodata(g, num_voxels)) for g in outer), low, high)
    return None


def _is_outlying(group: ValueCluster, num_voxels: int) -> bool:
    is_few = group.num <= max(1, _MAX_OUTLIER_FRACTION * num_voxels)
    return group.low == group.high and (is_few or _is_nodata(group, num_voxels))


def _is_nodata(group: ValueCluster, num_voxels: int) -> bool:
    is_known = any(math.isclose(group.low, value, rel_tol=1e-6) for value in _KNOWN_NODATA_VALUES)
    return is_known or group.num >= max(2, _MIN_NODATA_FRACTION * num_voxels)
