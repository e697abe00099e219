"""Whether a field is a level set: one whose surface at 0 is what it was made for, as a signed distance's is.

That a field has one sign at the border and some of the other within says little: a temperature with one cold place and
a scan with an edge that overshoots have that, too.
"""

from __future__ import annotations

import numpy as np

from renderer.suggest.features import Mask, VoxelSample, coherence
from renderer.volume import Float64

# The border of a level set has one sign, here and there excepted.
_MIN_ONE_SIGN_FRACTION = 0.97
# Noise that crosses 0 does so in single voxels; the neighbours of a ball's voxels are mostly in it from 4 voxels on.
_COHERENT = 0.5
# A distance changes alike wherever it is measured, but near what is equally far from two surfaces: its gradients'
# quartiles have a ratio near 1, where those of a smooth random field have one of 1.8. It is no steeper inside, either:
# a room that gets warmer upwards may have a place with ice in it.
_MAX_GRADIENT_RATIO, _MAX_INNER_STEEPNESS = 1.4, 2.0
# Other fields must have that part of their voxels inside, and so many times more often than at the border: the valleys
# of a random field are as frequent there as anywhere.
_LEAST_INSIDE, _MIN_INSIDE_RATIO = 0.03, 4.0
# And they must be as deep inside, in the median, by what they are outside: an edge that overshoots does so by 9% at
# most (Gibbs), and by half of that in the median.
_LEAST_DEPTH = 0.05


def is_level_set_interior(sample: VoxelSample, border: float) -> bool:
    """Whether the voxels above the share `border` are the inside of a level set, which the others are around."""
    within, around = (sample.normalized > border) & sample.is_valid, (sample.normalized <= border) & sample.is_valid
    if not within.any() or not around.any():
        return False
    at_border, share = float(np.mean(sample.border_values() > border)), float(np.mean(within))
    if at_border >= 1 - _MIN_ONE_SIGN_FRACTION or coherence(sample, border) < _COHERENT:
        return False
    if _is_distance(sample, within):
        return True
    deep = float(np.median(sample.normalized[within])) - border
    high = border - float(np.median(sample.normalized[around]))
    return share >= max(_LEAST_INSIDE, _MIN_INSIDE_RATIO * at_border) and deep >= _LEAST_DEPTH * high


def _is_distance(sample: VoxelSample, within: Mask) -> bool:
    """Whether the values change alike everywhere, for lengths in world units or in voxels."""
    axes = [axis for axis in range(3) if sample.normalized.shape[axis] > 1]
    changes = {axis: np.gradient(sample.normalized, axis=axis) for axis in axes}
    return any(
        _has_even_gradients(np.sqrt(sum((changes[axis] / lengths[axis]) ** 2 for axis in axes)), within)
        for lengths in (sample.spacing, sample.strides)
    )


def _has_even_gradients(gradients: Float64, within: Mask) -> bool:
    low, middle, high = np.percentile(gradients, (25, 50, 75)).tolist()
    return bool(0 < high < _MAX_GRADIENT_RATIO * low and np.median(gradients[within]) <= _MAX_INNER_STEEPNESS * middle)
