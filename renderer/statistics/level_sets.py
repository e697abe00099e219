"""Recognise level sets: fields made for their surface at 0, such as signed distances.

Values of one sign at the border and of the other sign inside do not make a level set: they also occur in a temperature
field with one cold place, and in a scan with an overshooting edge.
"""

from __future__ import annotations

import numpy as np

from renderer.statistics.voxel_sample import VoxelSample
from renderer.volume import Bools, Float64

# In a level set, more than this share of the border's voxels have the same sign.
_MIN_ONE_SIGN_FRACTION = 0.97
# In a level set, the neighbour of a voxel inside the surface is inside, too, with at least this probability. In noise,
# single voxels are inside; a ball of at least 4 voxels in radius reaches this probability.
_MIN_COHERENCE = 0.5
# In a distance field, the ratio of the upper to the lower quartile of the gradients is less than this: a distance has
# the same gradient everywhere, except where two surfaces are equally far. In a smooth random field the ratio is 1.8.
_MAX_GRADIENT_RATIO = 1.4
# In a distance field, the median gradient inside the surface is at most this many times the median gradient of the
# whole field. A distance is not steeper inside, but a temperature field that gets warmer upwards is, if it has ice
# inside.
_MAX_INNER_STEEPNESS = 2.0
# In a level set that is no distance field, at least this share of the voxels are inside the surface.
_MIN_INSIDE_FRACTION = 0.03
# In a level set that is no distance field, the share of voxels inside the surface is at least this many times as large
# among all voxels as among the border's voxels. The valleys of a random field are as frequent at the border as
# elsewhere.
_MIN_INSIDE_RATIO = 4.0
# In a level set that is no distance field, the median difference between the values inside and the surface's value is
# at least this part of the median difference outside. A smaller difference may be ringing: an edge overshoots by 9 % at
# most (Gibbs), and by half of this in the median.
_MIN_INSIDE_DEPTH = 0.05


def is_level_set_interior(sample: VoxelSample, border: float) -> bool:
    """Return whether the voxels above `border` are the inside of a level set, and the other voxels surround it."""
    within, around = (sample.normalized > border) & sample.is_valid, (sample.normalized <= border) & sample.is_valid
    if not within.any() or not around.any():
        return False
    at_border, share = float(np.mean(sample.valid_values()[0] > border)), float(np.mean(within))
    if at_border >= 1 - _MIN_ONE_SIGN_FRACTION or _coherence(sample, border) < _MIN_COHERENCE:
        return False
    if _is_distance(sample, within):
        return True
    deep = float(np.median(sample.normalized[within])) - border
    high = border - float(np.median(sample.normalized[around]))
    return share >= max(_MIN_INSIDE_FRACTION, _MIN_INSIDE_RATIO * at_border) and deep >= _MIN_INSIDE_DEPTH * high


def _coherence(sample: VoxelSample, above: float) -> float:
    """Return the probability that a neighbour of a voxel inside the surface is inside, too. It is low in noise.

    above: the normalised value of the surface; voxels with higher values are inside.
    """
    return float(np.mean((sample.neighbours > above)[:, sample.normalized > above]))


def _is_distance(sample: VoxelSample, within: Bools) -> bool:
    """Return whether a field is a distance to a surface: whether gradients are about equal everywhere.

    Distances may be in world units or in voxels. within: which voxels are inside the surface, bool [z, y, x].
    """
    axes = [axis for axis in range(3) if sample.normalized.shape[axis] > 1]
    changes = {axis: np.gradient(sample.normalized, axis=axis) for axis in axes}
    return any(
        _has_even_gradients(np.sqrt(sum((changes[axis] / lengths[axis]) ** 2 for axis in axes)), within)
        for lengths in (sample.spacing, sample.strides)
    )


def _has_even_gradients(gradients: Float64, within: Bools) -> bool:
    low, middle, high = np.percentile(gradients, (25, 50, 75)).tolist()
    return bool(0 < high < _MAX_GRADIENT_RATIO * low and np.median(gradients[within]) <= _MAX_INNER_STEEPNESS * middle)
