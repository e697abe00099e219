"""Find an even medium around an object, such as water or resin in a dish. It counts as background, too."""

from __future__ import annotations

import numpy as np

from renderer.statistics.background import Background, shortest_interval
from renderer.statistics.coarse_cells import are_deep
from renderer.statistics.voxel_sample import VoxelSample

# The number of voxels along each axis of a block of voxels. A medium is found by the means of blocks, which are less
# noisy than voxels.
_SIDE = 4
# A block of voxels counts as whole if more than this share of its voxels are visible.
_MIN_WHOLE = 0.97
# There is a medium only if whole blocks hold at least this share of the visible voxels: a medium is bulky.
_MIN_BULK = 0.7
# There is a medium only if there are at least this many whole blocks of voxels.
_MIN_BLOCKS = 64
# There is a medium only if at least this share of the whole blocks have means near the medium's value. In 13 bulky
# scans without a medium it is 0.02 to 0.65.
_MIN_SHARE = 0.7
# The mean of a block is near the medium's value if it differs by less than this part of the contrast between medium and
# background.
_NEAR = 0.1
# There is a medium only if the shortest interval that holds half of the blocks' means is at most this part of the
# contrast between medium and background. In 13 bulky scans without a medium it is 0.12 to 1.6.
_MAX_WIDTH = 0.1
# A medium is around an object only if at least this share of the voxels that are denser than the medium lie deep inside
# the visible part.
_MIN_ENCLOSED = 0.4
# A medium is around an object only if at least this share of the visible voxels are denser than the medium.
_MIN_OBJECT = 1e-3
# The range of a medium's values ends this many standard deviations of its noise from its middle.
_NOISE_SIGMAS = 5.0


def find_medium(sample: VoxelSample, background: Background, first: float) -> Background | None:
    """Return the range of values of an even medium that surrounds an object; None without such a medium.

    first: the normalised value above which voxels are visible.
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
