"""Choose the value that stands for NaN and infinities, so that a suggested transfer function does not show it."""

from __future__ import annotations

import numpy as np

from renderer.suggest.features import VoxelSample, faces, find_background, has_much_below, is_about_zero, sample_volume
from renderer.suggest.histogram import Statistics
from renderer.suggest.labels import label_values
from renderer.suggest.level_sets import is_level_set_interior
from renderer.volume import Volume


def suggest_nonfinite_fill(volume: Volume, statistics: Statistics) -> float | None:
    """Return the value for NaN and infinities, from the statistics of the others; None if the lowest value serves.

    volume: read with `nonfinite: lowest`.
    """
    statistics = statistics.without_outliers or statistics
    low, high = float(statistics.minimum), float(statistics.maximum)
    if low == high:  # a mask by NaN
        return 0.0 if low else None
    sample = sample_volume(volume, statistics)
    if label_values(volume, statistics, sample) is not None:
        return _nonfinite_label(sample, low)
    if low < 0 < high and is_about_zero(sample):
        return 0.0
    if low < 0 < high and is_level_set_interior(sample.with_inverted_range(), 1 - sample.normalize(0.0)):
        return high
    background = find_background(sample)
    if not (background.is_there and has_much_below(background)):
        return None
    return sample.round_value(sample.denormalize(background.middle))


def _nonfinite_label(sample: VoxelSample, low: float) -> float | None:
    """Return the label at the border if it has more voxels there than NaN has; else a label that no voxel has."""
    is_known = faces(sample.is_valid)
    values, counts = np.unique(faces(sample.normalized)[is_known], return_counts=True)
    if counts.max(initial=0) > np.count_nonzero(~is_known):
        outside = float(values[counts.argmax()])
        return sample.denormalize(outside) if outside > 0 else None
    return 0.0 if low > 0 else None
