"""Measure how the values are spread around a middle: around 0, as noise in a map of statistics, or with a long tail."""

from __future__ import annotations

import numpy as np

from renderer.statistics.voxel_sample import SAME, VoxelSample
from renderer.volume import Float64

# The values of a map of statistics, such as t or z, are noise around a middle, with a normal distribution: the 30 %
# that are nearest reach 0.385 standard deviations, 70 % reach 1.036.
_SIGMAS_OF_70_PERCENT = 1.036
# The least and the largest ratio of both in such a map; the exact one is 2.69. It is 2.7 in a map with a few active
# places, 115 in an orbital, 3.4 in seismic waves, 1.9 in a distance, 2.3 in uniform values.
_NORMAL_RATIOS = (2.45, 3.2)
# Noise ends this many standard deviations from the middle: 6 of 100,000 voxels are outside.
_MAP_NOISE_SIGMAS = 4.0
# The least distance, in standard deviations, of a voxel that stands out from noise. In noise alone one of two million
# voxels does.
_OUTSTANDING_SIGMAS = 5.0
# The least number of sampled voxels that stand out in a map of statistics.
_MIN_OUTSTANDING = 8


def is_about_zero(sample: VoxelSample) -> bool:
    """Return whether the median of the valid values is near the data value 0, compared with their spread."""
    shares = sample.normalized[sample.is_valid]
    return abs(float(np.median(shares)) - sample.normalize(0.0)) < float(np.std(shares)) / 2


def noise_reach(sample: VoxelSample, middle: float) -> float:
    """Return how far noise reaches from the middle of a map of statistics, normalised; 0 where there is no such map.

    Voxels of exactly the middle lie outside of the object of the map, and do not count. Some voxels must stand out.
    """
    distances = np.abs(sample.normalized[sample.is_valid] - middle)
    distances = distances[distances > SAME]
    if not distances.size:
        return 0.0
    near, far = np.percentile(distances, (30, 70)).tolist()
    sigma = far / _SIGMAS_OF_70_PERCENT
    is_normal = _NORMAL_RATIOS[0] * near < far < _NORMAL_RATIOS[1] * near
    stands_out = np.count_nonzero(distances > _OUTSTANDING_SIGMAS * sigma) >= _MIN_OUTSTANDING
    return _MAP_NOISE_SIGMAS * sigma if is_normal and stands_out else 0.0


def tail_ratio(distances: Float64) -> float:
    """Return the largest of positive distances, without outliers, divided by their median."""
    return float(np.percentile(distances, 99.8)) / float(np.median(distances)) if distances.size else 1.0
