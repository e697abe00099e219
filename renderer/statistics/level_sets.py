"""Recognise level sets: fields made for their surface at 0, such as signed distances.

One sign at the border and some of the other inside is not enough: a temperature field with one cold place and a scan
with an overshooting edge have that, too.
"""

from __future__ import annotations

import numpy as np

from renderer.statistics.voxel_sample import VoxelSample
from renderer.volume import Bools, Float64

# The smallest share of the border that has one sign, in a level set.
_MIN_ONE_SIGN_FRACTION = 0.97
# The smallest chance that the neighbour of a voxel inside is inside, too. Noise crosses 0 in single voxels; a ball
# reaches this from a radius of 4 voxels on.
_MIN_COHERENCE = 0.5
# The largest ratio of the upper to the lower quartile of the gradients in a distance. It is near 1: a distance has the
# same gradient everywhere, except where two surfaces are equally far. In a smooth random field it is 1.8.
_MAX_GRADIENT_RATIO = 1.4
# The largest median gradient inside of a distance, compared with the median gradient of the whole. A distance is not
# steeper inside, but a room that gets warmer upwards may have ice in it.
_MAX_INNER_STEEPNESS = 2.0
# The smallest share of the voxels that is inside, in other level sets.
_MIN_INSIDE_FRACTION = 0.03
# The smallest share of the voxels that is inside, compared with the share of the border that is. The valleys of a
# random field are as frequent at the border as elsewhere.
_MIN_INSIDE_RATIO = 4.0
# The smallest median depth inside, compared with the one outside. An edge overshoots by 9 % at most (Gibbs), and by
# half of this in the median.
_MIN_INSIDE_DEPTH = 0.05


def is_level_set_interior(sample: VoxelSample, border: float) -> bool:
    """Return whether the voxels above `border` are the inside of a level set, which the others surround."""
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
    """Return the probability that a neighbour of a voxel above `above` is above it, too: low for noise, high for
    objects."""
    return float(np.mean((sample.neighbours > above)[:, sample.normalized > above]))


def _is_distance(sample: VoxelSample, within: Bools) -> bool:
    """Return whether the gradient is even, for lengths in world units or in voxels."""
    axes = [axis for axis in range(3) if sample.normalized.shape[axis] > 1]
    changes = {axis: np.gradient(sample.normalized, axis=axis) for axis in axes}
    return any(
        _has_even_gradients(np.sqrt(sum((changes[axis] / lengths[axis]) ** 2 for axis in axes)), within)
        for lengths in (sample.spacing, sample.strides)
    )


def _has_even_gradients(gradients: Float64, within: Bools) -> bool:
    low, middle, high = np.percentile(gradients, (25, 50, 75)).tolist()
    return bool(0 < high < _MAX_GRADIENT_RATIO * low and np.median(gradients[within]) <= _MAX_INNER_STEEPNESS * middle)
