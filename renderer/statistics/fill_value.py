"""Choose the value by which voxels without data are filled, so that they look like the surroundings of the object."""

from __future__ import annotations

import numpy as np

from renderer.statistics.background import find_background
from renderer.statistics.histogram import Statistics
from renderer.statistics.label_volume import label_values
from renderer.statistics.level_sets import is_level_set_interior
from renderer.statistics.spread import is_about_zero
from renderer.statistics.voxel_sample import VoxelSample, faces, sample_volume
from renderer.volume import Volume


def suggest_fill(volume: Volume, statistics: Statistics) -> float | None:
    """Return the value that voxels without data count as; None for the lowest value of the volume.

    statistics: the statistics of the voxels with data.
    """
    low, high = float(statistics.minimum), float(statistics.maximum)
    sample = sample_volume(volume, statistics)
    if label_values(volume, statistics, sample) is not None:
        return _surrounding_label(sample, low)
    if low < 0 < high and is_about_zero(sample):
        return 0.0
    if low < 0 < high and is_level_set_interior(sample.with_inverted_range(), 1 - sample.normalize(0.0)):
        return high
    background = find_background(sample)
    if not (background.is_there and background.has_much_below):
        return None
    return sample.round_value(sample.denormalize(background.middle))


def _surrounding_label(sample: VoxelSample, low: float) -> float | None:
    """Return the most frequent label at the border, or 0, which is no label, if more voxels there have no data.

    low: the lowest label. Returns None if the most frequent label is the lowest one, or in place of 0 if 0 may be a
    label.
    """
    is_known = faces(sample.is_valid)
    values, counts = np.unique(faces(sample.normalized)[is_known], return_counts=True)
    if counts.max(initial=0) > np.count_nonzero(~is_known):
        outside = float(values[counts.argmax()])
        return sample.denormalize(outside) if outside > 0 else None
    return 0.0 if low > 0 else None
