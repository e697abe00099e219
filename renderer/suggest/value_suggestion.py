"""Suggest a transfer function for the values of a volume, and give the reason in words.

The values are labels, or a preset is chosen, by the kind of data (`recognition.py`) or by a wish (`wishes.py`). Planes
clip away the surroundings of the object (`separation.py`), and densities are solved for the picture
(`opacity_calibration.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from renderer.errors import InputError
from renderer.scene import ControlPoint, TransferSpec
from renderer.statistics import (
    NO_LABELS,
    KnownLabels,
    Statistics,
    VoxelSample,
    distinct_values,
    fill_with_background,
    format_number,
    hounsfield_zero,
    is_noise,
    label_values,
    sample_volume,
    suggest_fill,
    without_padding,
)
from renderer.suggest.imported_look import imported_suggestion
from renderer.suggest.label_look import label_suggestion
from renderer.suggest.opacity import opacity_from_depth, opacity_unit_length
from renderer.suggest.preset_points import preset_suggestion
from renderer.suggest.recognition import logarithmic_choice, recognise
from renderer.suggest.separation import Plane, are_beyond, separating_planes
from renderer.suggest.suggestion import Suggestion, hide_outliers, with_colormap, with_logarithmic_scale
from renderer.suggest.wishes import LABELS_WISH, NO_WISH, WISHES, Wish, choose_by_word
from renderer.volume import Volume

# A function without parameters that returns what is known of a volume's labels.
KnowLabels = Callable[[], KnownLabels]

# Outliers may be labels only if they are smaller than this.
_MAX_OUTLYING_LABEL = 2**16
# The opacity of a constant volume, with which a ray along the diagonal has an opacity of about two thirds.
_CONSTANT_OPACITY = 0.02
# The optical depth of a constant volume that has a shape, because a part of it has no data: the depth along the side of
# a cube that is as large as the part with data.
_MASK_DEPTH = 3.0


def suggest(
    volume: Volume, statistics: Statistics, wish: Wish = NO_WISH, known: KnowLabels = lambda: NO_LABELS
) -> Suggestion:
    """Return a suggestion for a volume: a transfer function, a light and clip planes, with the reason in words.

    statistics: the statistics of the volume, from `compute_statistics`. known: returns the labels of other steps in
    time, and a table of labels; called only for a volume of labels. Raises InputError for a preset that cannot be read,
    or does not suit the volume.
    """
    if statistics.minimum == statistics.maximum:
        return with_colormap(_constant_suggestion(volume, float(statistics.minimum)), wish.colormap)
    others = statistics.without_outliers
    shown = others or statistics
    sample = sample_volume(volume, shown)
    if others is not None and (is_noise(sample) or _are_far_labels(volume, statistics)):
        others, shown = None, statistics
        sample = sample_volume(volume, shown)
    fill = None if sample.is_valid.all() else suggest_fill(volume, shown)
    if fill is not None:
        sample = sample_volume(volume, shown, sample.normalize(fill))
    suggestion = _suggest_from(volume, shown, sample, wish, known)
    return suggestion if others is None else hide_outliers(suggestion, statistics, sample)


def _are_far_labels(volume: Volume, statistics: Statistics) -> bool:
    """Return whether all values of a volume are labels, including the values that count as outliers."""
    if not all(0 <= outlier.value < _MAX_OUTLYING_LABEL for outlier in statistics.outliers):
        return False
    return label_values(volume, statistics, sample_volume(volume, statistics)) is not None


def _constant_suggestion(volume: Volume, value: float) -> Suggestion:
    diagonal = float(np.linalg.norm(volume.spacing * volume.shape_xyz))
    unit, opacity = opacity_unit_length(diagonal), _CONSTANT_OPACITY
    kind, reason = "constant volume", f"every voxel is {format_number(value)}, so that there is nothing to tell apart"
    if volume.num_absent:
        kind, reason = "mask", f"every voxel with data is {format_number(value)}"
        side = float(np.cbrt(np.prod(volume.spacing) * (volume.values.size - volume.num_absent)))
        opacity = opacity_from_depth(_MASK_DEPTH * diagonal / 100 / side, diagonal)
    point = ControlPoint(value, (1.0, 0.93, 0.80), opacity)
    return Suggestion(kind, reason, TransferSpec((point,), unit), ("",), None)


def _suggest_from(
    volume: Volume, statistics: Statistics, sample: VoxelSample, wish: Wish, known: KnowLabels
) -> Suggestion:
    """Return the suggestion for the values in a range: as labels, by a preset that is wished for, or by their kind.

    statistics: the statistics of the values to show. sample: a sample normalised to the range of these values.
    """
    word = wish.preset
    if word in (None, LABELS_WISH):
        values = distinct_values(volume, statistics) if word else label_values(volume, statistics, sample)
        if values is not None:
            return with_colormap(label_suggestion(volume, sample, values, known()), wish.colormap)
        if word:
            raise InputError("too many values for labels", where=volume.name, got="--preset labels")
    zero, sample = hounsfield_zero(statistics), without_padding(sample)
    if word is not None and word not in WISHES:
        return imported_suggestion(sample, zero, word)
    is_float = isinstance(statistics.minimum, float)
    if found := logarithmic_choice(sample) if is_float and word is None and zero is None else None:
        logarithms, choice = found
        return with_logarithmic_scale(preset_suggestion(choice, logarithms, []), wish.colormap)
    choose = (
        partial(choose_by_word, word=word) if word else partial(recognise, is_float=is_float, unit=volume.value_unit)
    )
    choice, planes = choose(sample, zero), list[Plane]()
    if choice.preset.is_scan:
        planes = separating_planes(sample, choice.preset.covers(sample.normalized))
    if planes:  # voxels that the planes clip away count as no material
        sample = fill_with_background(sample, are_beyond(sample, planes))
        again = choose(sample, zero)
        choice = again if again.kind == choice.kind else choice
    return with_colormap(preset_suggestion(choice, sample, planes), wish.colormap)
