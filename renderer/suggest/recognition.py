"""Recognise the kind of data from the values alone, and choose the preset that suits it.

Kinds are computed tomography in Hounsfield units, values on both sides of a background, an object brighter or darker
than its background, and a volume filled to its border.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from renderer.statistics import (
    Background,
    VoxelSample,
    find_background,
    find_medium,
    foreground_threshold,
    has_nested_levels,
    is_about_zero,
    is_level_set_interior,
    is_smooth,
    noise_reach,
    otsu_threshold,
    tail_ratio,
)
from renderer.suggest.field_presets import diverging_preset, field_preset
from renderer.suggest.presets import Choice, opaque_preset, two_phase_preset
from renderer.suggest.scan_presets import ct_preset, materials_preset

# In a smooth field with two signs, values nearer to the middle of the background than this part of the range of values
# are transparent.
_MIN_AWAY = 0.015
# In a noisy field with two signs, values nearer to the middle of the background than this part of the range of values
# are transparent.
_MIN_AWAY_OF_NOISE = 0.025
# A field has a long tail, with floats that spread over orders of magnitude, if the ratio of its largest values to its
# median is more than this.
_HEAVY_TAIL = 25.0
# An object has at least this share of the voxels above the background. With fewer voxels above the background, values
# may be shown by their logarithms.
_MIN_TAIL = 0.01
# Values are shown by their logarithms only if the ratio of their upper to their lower quartile is at least this. In
# noise it is 1.2.
_MIN_MIDDLE_RATIO = 3.0
# Values are shown by their logarithms only if the ratio of their 99.9th to their 1st percentile is at least this. In
# noise it is 2.
_MIN_RATIO = 1000.0
# Values form two phases only if a threshold divides them into two classes with at least this share of the variance
# between the classes. A normal distribution has 0.64, a uniform one 0.75.
_TWO_PHASE_SEPARATION = 0.85
# A field has two signs only if the farthest value of the weaker sign is more than this part as far from 0 as the
# farthest value of the stronger sign. A weaker sign with smaller values is noise.
_MIN_SECOND_SIGN = 0.2
# In a field with two signs that fills the volume, values are shown from a distance from 0 on that is at most this part
# of the distance of the farthest value.
_MOST_AWAY = 0.75
# In a volume without a background, the values above this percentile are shown.
_FILLED_PERCENTILE = 60.0


def recognise(sample: VoxelSample, zero: float | None, *, is_float: bool, unit: str = "") -> Choice:
    """Recognise the kind of data by values that are no labels, and return the preset for this kind.

    zero: the stored value of 0 Hounsfield units; None for values in other units. is_float: whether the values are
    floats. unit: the unit of the values, if the file states one.
    """
    if zero is not None:
        reason = f"air lies near {zero - 1000:g} and soft tissue near {zero:g}{offset_text(zero)}"
        return Choice("CT in Hounsfield units", reason, ct_preset(sample, zero))
    background = find_background(sample)
    if not background.is_there or background.above + background.below == 0:
        return _filled_volume_preset(sample)
    if background.has_much_below and background.has_much_above:
        middle = sample.round_value(sample.denormalize(background.middle))
        floor = _MIN_AWAY if is_smooth(sample, background.high) else _MIN_AWAY_OF_NOISE
        away = max(background.high - background.middle, floor)
        reason = f"values lie on both sides of a background near {middle:.12g}"
        return _two_signs_choice(sample, background.middle, away, reason)
    if background.below > background.above:
        turned = sample.with_inverted_range()
        kind, reason, preset = _object_preset(turned, find_background(turned), is_float, unit)
        return Choice(f"{kind}, dark in a bright background", reason, preset.with_inverted_range())
    return _object_preset(sample, background, is_float, unit)


def logarithmic_choice(sample: VoxelSample) -> tuple[VoxelSample, Choice] | None:
    """Return the logarithms of values that span many orders of magnitude, with a preset; None for other values."""
    background = find_background(sample)
    if sample.minimum < 0 or (background.is_there and background.above >= _MIN_TAIL):
        return None
    shares = sample.shares(sample.normalized[sample.is_valid])
    if not (shares > 0).any():
        return None
    smallest, low, first, third, top = np.percentile(shares[shares > 0], (0.01, 1, 25, 75, 99.9)).tolist()
    if third < _MIN_MIDDLE_RATIO * first or top < _MIN_RATIO * low:
        return None
    logarithms = sample.with_logarithms(smallest)
    background = find_background(logarithms)
    begin = float(np.percentile(logarithms.normalized[sample.is_valid], _FILLED_PERCENTILE))
    begin = background.high if background.is_there else begin
    reason = f"the values span {math.log10(top / low):.0f} orders of magnitude, and few are near the largest"
    preset = field_preset(logarithms, begin, origin=0.0)
    return logarithms, Choice("density over many orders of magnitude", reason, preset)


def _object_preset(sample: VoxelSample, background: Background, is_float: bool, unit: str) -> Choice:
    """Return the preset for an object brighter than its background. unit: as in `recognise`."""
    visible = sample.normalized[sample.normalized > background.high]
    near = f"the background is near {sample.round_value(sample.denormalize(background.middle)):.12g}"
    if is_float and tail_ratio(visible - background.middle) > _HEAVY_TAIL:
        kind, reason = "field with a long tail", "the largest values are many times those in the middle"
    elif is_smooth(sample, background.high) and has_nested_levels(sample, background.high):
        kind, reason = "smooth field", "the levels of the values lie inside one another"
    else:
        reason, first = f"{near}, and what stands out from it has edges", foreground_threshold(sample, background)
        if medium := find_medium(sample, background, first):
            reason = f"{near}, an even medium near {sample.round_value(sample.denormalize(medium.middle)):.12g}"
            reason, first = f"{reason} is in it, and an object in this", foreground_threshold(sample, medium)
        kind = f"scan in {unit}" if unit else "scan without an absolute scale"
        return Choice(kind, reason, materials_preset(sample, first))
    preset = field_preset(sample, background.high, origin=background.middle)
    return Choice(kind, f"{near}, and {reason}", preset)


def _two_signs_choice(sample: VoxelSample, middle: float, away: float, reason: str) -> Choice:
    """Return the preset of a field with values on both sides of `middle`.

    Values are shown from the distance `away` from the middle on; in a statistical map, from the end of its noise on.
    """
    if noise := noise_reach(sample, middle):
        away = noise
        reach = sample.round_value(sample.denormalize(middle + noise) - sample.denormalize(middle))
        reason = f"{reason}, and those up to {reach:.3g} from it are noise, from which others stand out"
    return Choice("field with two signs", reason, diverging_preset(sample, middle, away))


def _filled_volume_preset(sample: VoxelSample) -> Choice:
    """Return the preset for a volume without a background, which the object fills."""
    shares, zero = sample.normalized[sample.is_valid], sample.normalize(0.0)
    if 0 < zero < 1:
        weaker, stronger = sorted((zero, 1 - zero))
        if is_about_zero(sample) and weaker > _MIN_SECOND_SIGN * stronger:
            reason = "values lie on both sides of 0 and fill the volume to its border"
            away = min(1.2 * float(np.std(shares)), _MOST_AWAY * stronger)
            return _two_signs_choice(sample, zero, away, reason)
        if is_level_set_interior(sample.with_inverted_range(), 1 - zero):
            preset = opaque_preset("inside", 1 - zero, min(1.02 - zero, 1.0)).with_inverted_range()
            return Choice("level set", "negative values lie inside of positive ones", preset)
        if is_level_set_interior(sample, zero):
            preset = opaque_preset("inside", zero, min(zero + 0.02, 1.0))
            return Choice("level set", "positive values lie inside of negative ones", preset)
    bottom, top = np.percentile(shares, (0.01, 99.99)).tolist()
    threshold = otsu_threshold(shares, bottom, top, _TWO_PHASE_SEPARATION)
    if threshold is not None:
        preset = two_phase_preset(sample, threshold)
        return Choice("two phases", "there is no background, and values gather in two groups", preset)
    first = float(np.percentile(shares, _FILLED_PERCENTILE))
    if not is_smooth(sample, first):
        middle = otsu_threshold(shares, bottom, top) or first
        reason = "there is no background, and values next to each other differ"
        # Nothing lies around an object that fills the volume, so no planes are looked for that clip surroundings away.
        return Choice("filled scan", reason, replace(materials_preset(sample, middle), is_scan=False))
    preset = field_preset(sample, first, origin=float(sample.normalized.min()))
    return Choice("filled volume", "there is no background; the upper 40% of the values are shown", preset)


def offset_text(zero: float | None) -> str:
    """Return a clause on the number `zero` that is added to Hounsfield units in a file; empty if none is added."""
    return f", stored with {zero:g} added" if zero else ""
