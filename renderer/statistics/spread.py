"""Measure how values spread around a middle: near 0, as noise in a statistical map, or with a long tail."""

from __future__ import annotations

import numpy as np

from renderer.statistics.voxel_sample import SAME, VoxelSample
from renderer.volume import Float64

# The values of a statistical map, such as t or z, are noise with a normal distribution around a middle: the 30 % of the
# values that are nearest to it lie within 0.385 standard deviations, 70 % within 1.036.
_SIGMAS_OF_70_PERCENT = 1.036
# The least and the largest ratio of these two distances in a statistical map; a normal distribution has 2.69. A map
# with a few active places has 2.7, an orbital 115, seismic waves 3.4, a distance field 1.9, uniform values 2.3.
_NORMAL_RATIOS = (2.45, 3.2)
# Noise ends this many standard deviations from the middle: 6 of 100,000 voxels are outside.
_MAP_NOISE_SIGMAS = 4.0
# The least distance from the middle, in standard deviations, of a voxel that stands out from noise. In noise alone, one
# of two million voxels does.
_OUTSTANDING_SIGMAS = 5.0
# The least number of sampled voxels that stand out in a statistical map.
_MIN_OUTSTANDING = 8


def is_about_zero(sample: VoxelSample) -> bool:
    """Return whether the median of the valid values is near the data value 0, compared with their spread."""
    shares = sample.normalized[sample.is_valid]
    return abs(float(np.median(shares)) - sample.normalize(0.0)) < float(np.std(shares)) / 2


def noise_reach(sample: VoxelSample, middle: float) -> float:
    """Return how far noise reaches from the middle of a statistical map, normalised; 0 for other volumes.

    Voxels whose value is exactly the middle lie outside the mapped object, and do not count. A map needs some voxels
    that stand out.
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
    """Return the largest of some positive distances, outliers left out, divided by their median."""
    return float(np.percentile(distances, 99.8)) / float(np.median(distances)) if distances.size else 1.0
