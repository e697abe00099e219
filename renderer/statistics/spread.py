"""Measure how values spread around a middle: near 0, as noise in a statistical map, or with a long tail."""

from __future__ import annotations

import numpy as np

from renderer.statistics.voxel_sample import SAME, VoxelSample
from renderer.volume import Float64

# The distance from the middle of a normal distribution, in standard deviations, within which 70 % of the values lie.
# Most values of a statistical map, such as t or z, are noise with such a distribution.
_SIGMAS_OF_70_PERCENT = 1.036
# In a statistical map, the distance from the middle within which 70 % of the values lie is between these multiples of
# the distance within which 30 % lie. A normal distribution has 2.69, a map with a few active places 2.7, an orbital
# 115, seismic waves 3.4, a distance field 1.9, uniform values 2.3.
_NORMAL_RATIOS = (2.45, 3.2)
# The noise of a statistical map ends this many standard deviations from its middle: 6 of 100,000 voxels are outside.
_MAP_NOISE_SIGMAS = 4.0
# A voxel of a statistical map stands out from noise if it is farther than this from the middle, in standard deviations.
# In noise alone, one of two million voxels is.
_OUTSTANDING_SIGMAS = 5.0
# Values are a statistical map only if at least this many sampled voxels stand out from noise.
_MIN_OUTSTANDING = 8


def is_about_zero(sample: VoxelSample) -> bool:
    """Return whether the median of the valid values is near the data value 0, compared with their spread."""
    shares = sample.normalized[sample.is_valid]
    return abs(float(np.median(shares)) - sample.normalize(0.0)) < float(np.std(shares)) / 2


def noise_reach(sample: VoxelSample, middle: float) -> float:
    """Return the distance from `middle` beyond which a value of a statistical map is hardly noise, normalised.

    Returns 0 for other volumes. middle: the value that a statistical map has where nothing was found. Voxels whose
    value is exactly the middle lie outside the mapped object, and do not count. A volume is a statistical map if
    its noise has a normal distribution, and some voxels stand out from it.
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
    """Return the largest distance, outliers left out, divided by the median distance. distances: positive, [n]."""
    return float(np.percentile(distances, 99.8)) / float(np.median(distances)) if distances.size else 1.0
