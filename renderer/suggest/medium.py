"""Find an even medium around an object, such as water or resin in a dish: it is background, too."""

from __future__ import annotations

import numpy as np

from renderer.suggest.features import Background, VoxelSample, shortest_interval
from renderer.suggest.separation import are_deep

# Means of blocks of so many voxels along each axis tell the medium from noise.
_SIDE = 4
# Blocks that are visible by at least this part are whole. In a bulky medium they have at least this part of what is
# visible.
_MIN_WHOLE, _MIN_BULK, _MIN_BLOCKS = 0.97, 0.7, 64
# In an even medium at least this part of their means are within this part of the contrast to the background, and half
# of them within the last part. 13 bulky scans have widths of 0.12 to 1.6, and shares of 0.02 to 0.65.
_MIN_SHARE, _NEAR, _MAX_WIDTH = 0.7, 0.1, 0.1
# It is around the object: at least this part of what is denser lies deep inside, and there is at least this part.
_MIN_ENCLOSED, _MIN_OBJECT = 0.4, 1e-3
_NOISE_SIGMAS = 5.0


def find_medium(sample: VoxelSample, background: Background, first: float) -> Background | None:
    """Return an even medium that surrounds an object within the background, like a background; None without one.

    first: the normalised value at which what is visible begins.
    """
    is_visible = sample.normalized > first
    nz, ny, nx = (num // _SIDE for num in is_visible.shape)
    blocks = sample.normalized[: nz * _SIDE, : ny * _SIDE, : nx * _SIDE].reshape(nz, _SIDE, ny, _SIDE, nx, _SIDE)
    is_whole = (blocks > first).mean(axis=(1, 3, 5)) > _MIN_WHOLE
    if is_whole.sum() < max(_MIN_BLOCKS, _MIN_BULK * is_visible.sum() / _SIDE**3):
        return None
    means, noise = blocks.mean(axis=(1, 3, 5))[is_whole], blocks.std(axis=(1, 3, 5))[is_whole]
    low, high = shortest_interval(np.sort(means), 0.5)
    middle = (low + high) / 2
    contrast = middle - background.middle
    is_near = np.abs(means - middle) < _NEAR * contrast
    if high - low > _MAX_WIDTH * contrast or is_near.mean() < _MIN_SHARE:
        return None
    reach = _NOISE_SIGMAS * max(float(np.median(noise[is_near])), (high - low) / 2)
    is_denser = sample.normalized > middle + max(reach, 2 * _NEAR * contrast)
    share = float(is_denser.sum() / is_visible.sum())
    if share < _MIN_OBJECT or are_deep(sample, is_visible)[is_denser].mean() < _MIN_ENCLOSED:
        return None
    return Background(middle, middle - reach, middle + reach, True, 0.0, share)
