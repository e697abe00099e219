"""Find the linear relation by which values of one volume become values of another.

It is needed because magnetic resonance has no absolute scale of values.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from renderer.errors import InputError
from renderer.scene import format_value
from renderer.statistics.background import find_background
from renderer.statistics.classes import foreground_threshold
from renderer.statistics.histogram import compute_statistics
from renderer.statistics.label_volume import label_values
from renderer.statistics.padding import without_padding
from renderer.statistics.voxel_sample import sample_volume
from renderer.volume import Float64, Volume

# The percentiles at which the values of two volumes are matched.
_PERCENTILES = range(10, 100, 10)


@dataclass(frozen=True)
class ValueLine:
    """A linear relation by which values of a reference become values of a scan: value * scale + shift."""

    scale: float
    shift: float

    def __call__(self, value: float) -> float:
        """Return the value of the scan that corresponds to a value of the reference."""
        return float(f"{self.scale * value + self.shift:.9g}")

    def __str__(self) -> str:
        """Return the relation as text, such as `times 1.83, plus 12`."""
        return f"times {self.scale:.4g}, {'minus' if self.shift < 0 else 'plus'} {abs(self.shift):.4g}"


def match_values(reference: Volume, scan: Volume) -> ValueLine:
    """Return the linear relation by which values of the reference become values of the scan.

    Deciles of the values that are not background serve as landmarks, as in L. G. Nyul and J. K. Udupa, "On
    Standardizing the MR Image Intensity Scale", Magn. Reson. Med. 42 (1999). The slope is the median of the slopes of
    the lines through any two deciles (Theil and Sen), so that a lesion or a bright coil changes it little. Raises
    InputError for a volume without contrast, of labels or of colours.
    """
    before, after = _landmarks(reference), _landmarks(scan)
    slopes = [
        (after[j] - after[i]) / (before[j] - before[i])
        for i, j in combinations(range(len(before)), 2)
        if before[i] < before[j]
    ]
    scale = float(np.median(slopes)) if slopes else 0.0
    if not 0 < scale < np.inf:
        raise _no_contrast(scan if slopes else reference, "values that hardly differ")
    return ValueLine(scale, float(np.median(after - scale * before)))


def _landmarks(volume: Volume) -> Float64:
    statistics = compute_statistics(volume.values, volume.source)
    shown = statistics.without_outliers or statistics
    if shown.minimum == shown.maximum:
        raise _no_contrast(volume, f"{format_value(shown.minimum)} in every voxel")
    sample = sample_volume(volume, shown)
    if volume.colors is not None or label_values(volume, shown, sample) is not None:
        raise _no_contrast(volume, "labels" if volume.colors is None else "colours")
    sample = without_padding(sample)
    background, values = find_background(sample), sample.normalized[sample.is_valid]
    if background.is_there and background.below > background.above:
        values = values[values < background.low]
    elif background.is_there:
        values = values[values > foreground_threshold(sample, background)]
    return np.array([sample.denormalize(each) for each in np.percentile(values, _PERCENTILES).tolist()])


def _no_contrast(volume: Volume, got: str) -> InputError:
    return InputError("nothing to match", where=volume.name, got=got, expected="the values of a scan, with contrast")
