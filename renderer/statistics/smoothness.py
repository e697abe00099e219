"""Tell smooth fields, scans and noise apart by the differences between neighbouring voxels."""

from __future__ import annotations

import math

import numpy as np

from renderer.statistics.voxel_sample import VoxelSample

# A field is smooth if the ratio of second to first differences between neighbours is less than this.
_SMOOTH = 0.58
# Values are nothing but noise if the correlation of neighbouring voxels is less than this. In the noisiest of 20 scans
# it is 0.7.
_MIN_CORRELATION = 0.3


def is_smooth(sample: VoxelSample, low: float, high: float = math.inf) -> bool:
    """Return whether the values from `low` to `high` belong to a smooth field.

    The mean second difference along x, divided by the mean first difference, is about 0.2 in a smooth field, 0.5 to 0.8
    at the edges of a scan, and 1.7 in noise.
    """
    chosen = (sample.normalized > low) & (sample.normalized < high)
    before, after = sample.neighbours[0][chosen], sample.neighbours[1][chosen]
    first = float(np.abs(after - before).sum())
    second = float(np.abs(before + after - 2 * sample.normalized[chosen]).sum())
    return second < _SMOOTH * first


def is_noise(sample: VoxelSample) -> bool:
    """Return whether the values are nothing but noise: whether neighbours along x are hardly correlated."""
    here, beside = (values - sample.normalized.mean() for values in (sample.normalized, sample.neighbours[1]))
    return float((here * beside).mean()) < _MIN_CORRELATION * float(here.var())
