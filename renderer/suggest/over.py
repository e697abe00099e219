"""Suggest how to show a volume over another one, which becomes a translucent shell around it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from renderer.readers import ReadVolume
from renderer.scene import Color, VolumeSpec, raise_problems, volume_extent, volume_problems
from renderer.statistics import VoxelSample, sample_volume
from renderer.suggest.label_look import number_sample
from renderer.suggest.opacity_calibration import balance, depths_along
from renderer.suggest.palette import to_lab
from renderer.suggest.separation import Plane, are_beyond
from renderer.suggest.suggestion import Suggestion, with_8_bit_colors, with_colormap
from renderer.suggest.turntable_rays import cast_through
from renderer.suggest.volume_suggestion import VolumeSuggestion, read_in_colors, suggest_read
from renderer.suggest.wishes import NO_WISH, Wish
from renderer.transfer import make_transfer_function
from renderer.volume import Float64

# The share of the picture that the upper of two volumes gets, on the rays that meet both volumes.
UPPER_SHARE = 2 / 3
# A translucent shell is invisible at gradients below the first of these percentiles of its volume's gradients, and
# fully visible above the second. Only visible voxels count.
_SHELL_PERCENTILES = (60, 98)
# The gradients between which a shell fades in if it shows all gradients alike: no gradient is below 0.
_EVERY_GRADIENT = (-1.0, 0.0)
# A colour counts as grey if its chroma, in CIELAB, is at most this.
_MAX_GREY_CHROMA = 15.0
_WARM = (1.0, 0.68, 0.36)
_GREY = (1.0, 1.0, 1.0)
# The weights of red, green and blue in the luminance of a colour.
_LUMINANCE = (0.2126, 0.7152, 0.0722)


def suggest_over(
    volume: VolumeSpec, under: VolumeSpec, read: ReadVolume, *, wish: Wish = NO_WISH, under_wish: Wish = NO_WISH
) -> tuple[VolumeSuggestion, VolumeSuggestion]:
    """Suggest how to show a volume over the volume `under`, each at its position in the world, with weights for both.

    read: reads the voxels of one channel at one step in time. wish, under_wish: the wishes for the upper and the
    lower volume. Raises InputError for a volume that cannot be read or drawn, and for a wished preset that cannot be
    read or does not suit the volume.
    """
    (upper, above), (lower, below) = _suggest(volume, read, wish), _suggest(under, read, under_wish)
    if wish == NO_WISH and not upper.volume.has_colors and _has_grey(upper.suggestion):
        upper = replace(upper, suggestion=_tinted(upper.suggestion, _WARM))
    if under_wish == NO_WISH and not (lower.suggestion.transfer.labels or lower.volume.has_colors):
        lower = replace(lower, suggestion=_tinted(lower.suggestion, _GREY))
    ends = _shell_ends(lower, below)
    factors = replace(below, normalized=np.interp(_gradients(below), ends, (0.0, 1.0)))
    *rays, of_factors = cast_through([above, below, factors])
    weights = np.stack(
        [
            depths_along(each.suggestion.transfer, sample, of_sample, above.diagonal)
            for each, sample, of_sample in ((upper, above, rays[0]), (lower, below, rays[1]))
        ]
    )
    weights[1] *= np.nan_to_num((of_factors.values[:, :-1] + of_factors.values[:, 1:]) / 2)
    are_both = weights.any(axis=2).all(axis=0)
    if not are_both.any():
        return upper, lower
    of_upper, of_lower = (float(f"{weight:.2g}") for weight in balance(weights[:, are_both], UPPER_SHARE))
    if (shading := lower.suggestion.shading) is not None:  # a translucent shell casts no shadow
        is_even = ends == _EVERY_GRADIENT or lower.volume.has_colors
        points = None if is_even else ((ends[0], 0.0), (ends[1], 1.0))
        shading = replace(shading, occlusion=0.0, gradient_opacity=points)
        lower = replace(lower, suggestion=replace(lower.suggestion, shading=shading))
    return replace(upper, weight=of_upper), replace(lower, weight=of_lower)


def _suggest(spec: VolumeSpec, read: ReadVolume, wish: Wish) -> tuple[VolumeSuggestion, VoxelSample]:
    """Return the suggestion for a volume beside another one, and a sample of the part that clip planes leave.

    The suggestion keeps its clip planes, but no box: a box would cut the other volume, too. It states no shares of the
    picture, because the other volume changes them.
    """
    volume = read(spec)
    raise_problems(volume_problems(volume_extent(volume), volume.name))
    if volume.num_times > 1 and spec.time is None:
        spec = replace(spec, time="auto")
    spec, volume, statistics = read_in_colors(spec, volume, read, wish)
    found = suggest_read(spec, volume, statistics, wish)
    if statistics.minimum == statistics.maximum:  # values cannot be normalised by a range of 0
        statistics = replace(statistics, minimum=statistics.minimum - max(1, abs(statistics.minimum)))
    sample, suggestion = sample_volume(volume, statistics), found.suggestion
    if (labels := suggestion.transfer.labels) is not None:
        sample = number_sample(sample, labels.values)
    planes = tuple(each for each in suggestion.clip if each.plane is not None)
    notes = () if suggestion.visible else suggestion.notes
    found = replace(found, suggestion=replace(suggestion, clip=planes, notes=notes, visible=()))
    at = [(np.array(each.plane.point) - sample.centre, np.array(each.plane.normal)) for each in planes if each.plane]
    return found, replace(sample, is_valid=sample.is_valid & ~are_beyond(sample, [Plane(*each) for each in at]))


def _gradients(sample: VoxelSample) -> Float64:
    """Return the magnitude of the gradient at each voxel of a sample, float64 [z, y, x], in data units a world unit."""
    spacing = np.array(sample.spacing) / sample.strides
    along_z = np.gradient(sample.normalized, sample.spacing[0], axis=0) if len(sample.normalized) > 1 else 0.0
    left, right, down, up = sample.neighbours
    squares = along_z**2 + ((right - left) / (2 * spacing[2])) ** 2 + ((up - down) / (2 * spacing[1])) ** 2
    return np.asarray(np.sqrt(squares) * abs(sample.maximum - sample.minimum))


def _shell_ends(found: VolumeSuggestion, sample: VoxelSample) -> tuple[float, float]:
    """Return the gradient at which a shell begins to show, and the gradient from which on it shows fully.

    Labels, and data without surfaces, are shown at every gradient.
    """
    suggestion = found.suggestion
    transfer = make_transfer_function(suggestion.transfer, min(sample.spacing))
    values = sample.minimum + (sample.maximum - sample.minimum) * sample.normalized
    gradients = _gradients(sample)[sample.is_valid & (transfer.classify(values)[1] > 0)]
    if suggestion.transfer.labels or suggestion.shading is None or not gradients.size:
        return _EVERY_GRADIENT
    low, high = (float(f"{each:.3g}") for each in np.percentile(gradients, _SHELL_PERCENTILES))
    return (low, high) if low < high else _EVERY_GRADIENT


def _has_grey(suggestion: Suggestion) -> bool:
    points = suggestion.transfer.points
    if not points:
        return False
    chroma = np.hypot(*to_lab(np.array([point.color for point in points])).T[1:])
    return bool(chroma.min() <= _MAX_GREY_CHROMA)


def _tinted(suggestion: Suggestion, tint: Color) -> Suggestion:
    """Return the suggestion with all colours in the hue of `tint`, as bright as before; a colormap becomes grey."""
    given = suggestion.transfer.points
    if not given:
        return with_colormap(suggestion, "gray")
    bright = [min(1.0, float(np.dot(point.color, _LUMINANCE))) for point in given]
    colors = [(tint[0] * part, tint[1] * part, tint[2] * part) for part in bright]
    points = tuple(replace(point, color=color) for point, color in zip(given, colors, strict=True))
    return with_8_bit_colors(replace(suggestion, transfer=replace(suggestion.transfer, mapping=points)))
