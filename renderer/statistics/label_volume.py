"""Recognise volumes whose values are labels: masks, segmentations, connected components."""

from __future__ import annotations

import numpy as np

from renderer.scene import MAX_LABELS
from renderer.statistics.histogram import Statistics
from renderer.statistics.voxel_sample import SAME, VoxelSample, faces
from renderer.volume import Bools, Volume, iter_slabs

# A volume with at most this many different values, all whole numbers, is a volume of labels.
_MAX_CERTAIN_LABELS = 3
# A volume with many values is a volume of labels only if, for voxels outside the background, at least this share of
# neighbours have the voxel's own value, or if its labels are small. In scans the share is up to 0.6.
_MIN_EQUAL_NEIGHBOURS = 0.75
# The smallest share of equal neighbours in a volume of small labels, each of which has a few voxels in one place.
_MIN_EQUAL_NEIGHBOURS_OF_SMALL = 0.45
# The largest variance of the positions of a small label's voxels, as a part of the variance of all voxels' positions:
# labels have 0.02 to 0.3, the values of a scan 0.6 to 1.
_MAX_SCATTER_OF_SMALL = 0.5
# In a volume of at most this many labels, neighbours may differ by small steps, as in a map of grades.
_MAX_GRADED_LABELS = 16
# A volume with many values is no volume of labels if, of all neighbours with unequal values, more than this share
# differ by one or two, as in a smooth field.
_MAX_SMALL_STEPS = 0.6
# A volume is no volume of labels if more than this share of its values mostly occur in transitions between two other
# values, as in clipped images and at smoothed edges.
_MAX_TRANSITION_FRACTION = 0.5
# The largest integer up to which float64, in which labels are compared, has all integers.
_MAX_EXACT = 2**53


def label_values(volume: Volume, statistics: Statistics, sample: VoxelSample) -> list[float] | None:
    """Return the values of a volume of labels, ascending; None for other volumes."""
    is_piecewise = is_piecewise_constant(sample)
    if len(np.unique(sample.normalized)) > _MAX_CERTAIN_LABELS and not is_piecewise:
        return None
    found = distinct_values(volume, statistics)
    if found is None or not all(value == int(value) and abs(value) <= _MAX_EXACT for value in found):
        return None
    if len(found) > _MAX_CERTAIN_LABELS:
        if not is_piecewise or _transition_value_fraction(sample) > _MAX_TRANSITION_FRACTION:
            return None
        two_levels = 2.5 / (found[-1] - found[0])
        if len(found) > _MAX_GRADED_LABELS and _small_step_fraction(sample, two_levels) > _MAX_SMALL_STEPS:
            return None
    return found


def is_piecewise_constant(sample: VoxelSample) -> bool:
    """Return whether most voxels outside the background have neighbours of the same value, or lie in small pieces."""
    are_outside = np.abs(sample.normalized - border_mode(sample)) > SAME
    are_equal = np.abs(sample.neighbours[:, are_outside] - sample.normalized[are_outside]) <= SAME
    equal = np.mean(are_equal) if are_equal.size else 1
    if _MIN_EQUAL_NEIGHBOURS_OF_SMALL <= equal < _MIN_EQUAL_NEIGHBOURS:
        return _scatter(sample, are_outside) <= _MAX_SCATTER_OF_SMALL
    return bool(equal >= _MIN_EQUAL_NEIGHBOURS)


def _scatter(sample: VoxelSample, are_outside: Bools) -> float:
    """Return the variance of the positions of voxels with one value, as a part of the variance of all positions.

    Only the voxels `are_outside`, outside the background, count. The result is low for labels and about 1 for scans.
    """
    _, number, counts = np.unique(sample.normalized[are_outside], return_inverse=True, return_counts=True)
    places = np.argwhere(are_outside).T * np.array(sample.spacing)[:, None]
    means = [(np.bincount(number, at) / counts)[number] for at in places]
    within = sum(float(np.var(at - mean)) for at, mean in zip(places, means, strict=True))
    return within / max(float(np.var(places, axis=1).sum()), 1e-300)


def _transition_value_fraction(sample: VoxelSample) -> float:
    """Return the share of the distinct values that are transitions: most of their voxels lie between two neighbours.

    Such a voxel's value lies strictly between those of its two neighbours along x or along y. Blurred edges of an
    image have such values. A label has none, since its voxels lie side by side.
    """
    here, (left, right, down, up) = sample.normalized, sample.neighbours
    passed = ((left < here) & (here < right)) | ((left > here) & (here > right))
    passed |= ((down < here) & (here < up)) | ((down > here) & (here > up))
    _, number, counts = np.unique(here, return_inverse=True, return_counts=True)
    return float(np.mean(np.bincount(number.ravel(), passed.ravel()) > counts / 2))


def _small_step_fraction(sample: VoxelSample, step: float) -> float:
    """Return, of all neighbours with unequal values, the share that differ by at most `step`, a normalised value."""
    differences = np.abs(sample.neighbours - sample.normalized)
    unequal = differences[differences > SAME]
    return float(np.mean(unequal <= step)) if unequal.size else 0.0


def distinct_values(volume: Volume, statistics: Statistics) -> list[float] | None:
    """Return all different values of a volume that lie in the range of `statistics`, ascending.

    Returns None if there are more values than a volume may have labels.
    """
    if statistics.bin_width == 1.0 and volume.values.dtype.kind in "iu":
        counted: list[float] = statistics.bins[statistics.counts > 0].tolist()
        return counted if len(counted) <= MAX_LABELS else None
    found: set[float] = set()
    for plane in iter_slabs(volume.values, volume.source, 1):
        values = np.unique(plane)
        found.update(values[(values >= statistics.minimum) & (values <= statistics.maximum)].astype(float).tolist())
        if len(found) > MAX_LABELS:
            return None
    return sorted(found)


def border_mode(sample: VoxelSample) -> float:
    """Return the normalised value that is most frequent on the faces of a volume."""
    values, counts = np.unique(faces(sample.normalized), return_counts=True)
    return float(values[counts.argmax()])
