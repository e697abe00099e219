"""Find padding: voxels of one value, mostly 0, that enclose the scanned box and its air.

Brain templates and resampled scans have it. Padding is no background: the air inside it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from renderer.statistics.background import Background, background_at, fill_with_noise, find_background
from renderer.statistics.voxel_sample import SAME, ValueRange, VoxelSample, faces, sample_volume
from renderer.volume import Array, Bools, Float64, Volume

# Voxels of one value are padding only if at least this share of the border's voxels have the value.
_MIN_OF_BORDER = 0.5
# Voxels of one value are padding only if at most this share of all voxels have the value: the corners around a ball
# that touches the border are 0.48 of the voxels.
_MAX_OF_VOXELS = 0.35
# Padding has at most this median thickness at each face, as a part of the volume's side. Around a ball it is 0.15.
_MAX_THICKNESS = 0.1
# At least this share of the voxels inside padding are air. In a brain template, a quarter are.
_MIN_AIR = 0.1
# Air inside padding is at most at this position in the range of the values inside padding, from 0 to 1. A background
# with higher values may be an object that fills its box. The air of a brain template is at 0.05.
_MAX_AIR_VALUE = 0.25
# There is an object inside padding and air if at least this share of the voxels inside padding are denser than air.
_MIN_OBJECT = 0.01
# Only a volume with at least this many samples along each axis may have padding. Thinner volumes have no inside.
_MIN_SIDE = 8
# The percentiles between which the range of a volume's values is measured, so that a few outliers do not count.
_RANGE_OF_ALL = (0.01, 99.99)
# The percentiles between which the range of the values inside padding is measured. The upper end leaves out more values
# than for a whole volume, because edges may have more outliers.
_RANGE_BEHIND = (0.01, 99.9)


def without_padding(sample: VoxelSample) -> VoxelSample:
    """Return a sample in which padding has the values of the air that it encloses, noise included.

    A sample without padding, or with padding that is not darker than the air, is returned unchanged.
    """
    values, counts = np.unique(faces(sample.normalized)[faces(sample.is_valid)], return_counts=True)
    is_thin = min(sample.normalized.shape) < _MIN_SIDE
    if is_thin or not counts.size or counts.max() < _MIN_OF_BORDER * counts.sum():
        return sample
    padding = float(values[counts.argmax()])
    has_value = np.abs(sample.normalized - padding) <= SAME
    behind = _values_behind(sample, has_value) if has_value.mean() <= _MAX_OF_VOXELS else None
    if behind is None:
        return sample
    border, is_padding = behind
    inside = sample.normalized[sample.is_valid & ~is_padding]
    air = background_at(replace(sample, is_valid=sample.is_valid & ~is_padding), border, inside)
    if not _is_air(air, inside) or padding >= air.low:
        return sample
    noise = border[(border >= air.low) & (border <= air.high)]
    filled = fill_with_noise(sample.normalized, is_padding, noise)
    neighbours = fill_with_noise(sample.neighbours, np.abs(sample.neighbours - padding) <= SAME, noise)
    return replace(sample, normalized=filled, neighbours=neighbours)


def background_value(volume: Volume) -> float | None:
    """Return the value of the background of a volume; None if it has no background.

    A background lies near one end of the range of values: a value in the middle that fills the border is an object.
    """
    low, high = volume.value_range()
    if low == high or volume.is_labels:
        return None
    sample = without_padding(sample_volume(volume, ValueRange(low, high)))
    background = find_background(sample)
    first, last = np.percentile(sample.normalized[sample.is_valid], _RANGE_OF_ALL).tolist()
    place = (background.middle - first) / max(last - first, SAME)
    is_lowest = background.below < background.above and place < _MAX_AIR_VALUE
    is_highest = background.above < background.below and place > 1 - _MAX_AIR_VALUE
    is_outside = background.is_there and (is_lowest or is_highest)
    return sample.round_value(sample.denormalize(background.middle)) if is_outside else None


def _is_air(air: Background, inside: Float64) -> bool:
    """Return whether a background that was found inside padding is air around an object.

    inside: the normalised values of all voxels inside padding, [n].
    """
    low, high = np.percentile(inside, _RANGE_BEHIND).tolist()
    share = float(np.mean((inside >= air.low) & (inside <= air.high)))
    is_dark = air.middle - low < _MAX_AIR_VALUE * (high - low)
    return air.is_there and share >= _MIN_AIR and is_dark and air.above >= _MIN_OBJECT


def _values_behind(sample: VoxelSample, has_value: Bools) -> tuple[Float64, Bools] | None:
    """Return the values just inside padding, the same number from each face, [n], and which voxels are padding.

    has_value: which voxels have the value of padding, bool [z, y, x]. Returns None if the padding is too thick.
    """
    values, is_padding = list[Array](), np.zeros_like(has_value)
    for axis in range(3):
        for step in (1, -1):
            turned = np.moveaxis(has_value, axis, 0)[::step]
            depths = np.where(turned.all(axis=0), len(turned), turned.argmin(axis=0))
            if np.median(depths) > _MAX_THICKNESS * len(turned):
                return None
            np.moveaxis(is_padding, axis, 0)[::step][...] |= np.arange(len(turned))[:, None, None] < depths
            at = np.minimum(depths + (depths > 0), len(turned) - 1)[None]
            found = np.take_along_axis(np.moveaxis(sample.normalized, axis, 0)[::step], at, axis=0)[0]
            values.append(found[depths < len(turned)])
    num = max(map(len, values))
    return np.concatenate([each[np.arange(num) * len(each) // num] for each in values if len(each)]), is_padding
