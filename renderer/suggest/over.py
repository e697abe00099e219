"""Suggest how to show a volume over another one: the one underneath becomes a translucent shell around it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from renderer.scene import ColormapSpec, VolumeSpec
from renderer.suggest.features import VoxelSample, sample_volume
from renderer.suggest.labels import border_mode
from renderer.suggest.opacity_calibration import Layer, TurntableRays, balance, cast_through, step_weights
from renderer.suggest.palette import to_lab
from renderer.suggest.presets import SHADING
from renderer.suggest.separation import Plane, are_beyond
from renderer.suggest.suggestion import Suggestion, with_8_bit_colors
from renderer.suggest.volume_suggestion import NO_WISH, VolumeSuggestion, read_with_statistics, suggest_read
from renderer.suggest.wishes import Wish
from renderer.transfer import make_transfer_function
from renderer.volume import Float32, Float64, Volume

# The part of what is seen that the upper volume has, on the rays that meet both.
UPPER_SHARE = 2 / 3
# Percentiles of the gradients of what is visible between which a shell fades in.
_SHELL_PERCENTILES = (60, 98)
# Colours that all have less chroma than this, in CIELAB, are taken for grey.
_MAX_GREY_CHROMA = 15.0
_WARM, _GREY = (1.0, 0.68, 0.36), (1.0, 1.0, 1.0)
_LUMINANCE = (0.2126, 0.7152, 0.0722)


def suggest_over(
    volume: VolumeSpec, under: VolumeSpec, read: Callable[[VolumeSpec], Volume], *, wish: Wish = NO_WISH
) -> tuple[VolumeSuggestion, VolumeSuggestion]:
    """Suggest how to show a volume and the one underneath, each in its place in the world, with weights.

    wish: for the upper one. Parameters and errors are else those of `suggest_for`.
    """
    (upper, above), (lower, below) = _suggest(volume, read, wish), _suggest(under, read, NO_WISH)
    if not (wish.colormap or wish.preset or _largest_chroma(upper.suggestion) > _MAX_GREY_CHROMA):
        upper = replace(upper, suggestion=_tinted(upper.suggestion, _WARM))
    if not lower.suggestion.is_categorical:
        lower = replace(lower, suggestion=_tinted(lower.suggestion, _GREY))
    samples = [above, below]
    ends = _shell_ends(lower, below)
    if ends is not None:
        samples.append(replace(below, normalized=np.interp(_gradients(below), ends, (0.0, 1.0))))
    first, second, *factors = cast_through(samples)
    weights = np.stack([_weights(upper, above, first, above.diagonal), _weights(lower, below, second, above.diagonal)])
    if ends is not None:
        weights[1] *= np.nan_to_num((factors[0].values[:, :-1] + factors[0].values[:, 1:]) / 2)
    are_both = weights.any(axis=2).all(axis=0)
    if not are_both.any():
        return upper, lower
    shares = [float(f"{weight:.2g}") for weight in balance(weights[:, are_both], UPPER_SHARE)]
    return replace(upper, weight=shares[0]), replace(_as_shell(lower, ends), weight=shares[1])


def _suggest(
    spec: VolumeSpec, read: Callable[[VolumeSpec], Volume], wish: Wish
) -> tuple[VolumeSuggestion, VoxelSample]:
    """Return what is suggested for a volume and holds beside another one, too; and a sample of what it shows."""
    volume, statistics = read_with_statistics(spec, read)
    found = suggest_read(spec, volume, statistics, wish)
    if statistics.minimum == statistics.maximum:  # a sample needs a range
        statistics = replace(statistics, minimum=statistics.minimum - max(1, abs(statistics.minimum)))
    sample, suggestion = sample_volume(volume, statistics), found.suggestion
    planes = tuple(each for each in suggestion.clip if each.plane is not None)
    if suggestion.is_categorical and spec.nodata == "auto":  # nothing is interpolated between labels and background
        found = replace(found, volume=replace(spec, nodata=(round(sample.denormalize(border_mode(sample))),)))
        suggestion = replace(suggestion, shading=SHADING, splat=None)
    notes = () if suggestion.visible else suggestion.notes
    found = replace(found, suggestion=replace(suggestion, clip=planes, notes=notes, visible=()))
    at = [(np.array(each.plane.point) - sample.centre, np.array(each.plane.normal)) for each in planes if each.plane]
    return found, replace(sample, is_valid=sample.is_valid & ~are_beyond(sample, [Plane(*each) for each in at]))


def _weights(found: VolumeSuggestion, sample: VoxelSample, rays: TurntableRays, unit: float) -> Float32:
    """Return the optical depths of the steps of rays. unit: the length that theirs are given in."""
    transfer = make_transfer_function(found.suggestion.transfer, min(sample.spacing))
    at, depths = map(sample.normalize, transfer.values.tolist()), (transfer.extinctions * unit / 100).tolist()
    rays = rays._replace(is_interpolated=not found.suggestion.is_categorical)
    return np.asarray(step_weights(rays, [Layer("", tuple(zip(at, depths, strict=True)))])[0])


def _gradients(sample: VoxelSample) -> Float64:
    """Return the magnitudes of gradients, in data units by world units, float64 [z, y, x]."""
    spacing = np.array(sample.spacing) / sample.strides
    along_z = np.gradient(sample.normalized, sample.spacing[0], axis=0) if len(sample.normalized) > 1 else 0.0
    left, right, down, up = sample.neighbours
    squares = along_z**2 + ((right - left) / (2 * spacing[2])) ** 2 + ((up - down) / (2 * spacing[1])) ** 2
    return np.asarray(np.sqrt(squares) * abs(sample.maximum - sample.minimum))


def _shell_ends(found: VolumeSuggestion, sample: VoxelSample) -> tuple[float, float] | None:
    """Return the gradients from and to which a shell fades in; None for labels, and for what has no surfaces."""
    suggestion = found.suggestion
    if suggestion.is_categorical or suggestion.shading is None:
        return None
    transfer = make_transfer_function(suggestion.transfer, min(sample.spacing))
    values = sample.minimum + (sample.maximum - sample.minimum) * sample.normalized
    is_seen = sample.is_valid & (transfer.classify(values)[1] > 0)
    if not is_seen.any():
        return None
    low, high = np.percentile(_gradients(sample)[is_seen], _SHELL_PERCENTILES).tolist()
    return (float(f"{low:.3g}"), float(f"{high:.3g}")) if low < high else None


def _as_shell(found: VolumeSuggestion, ends: tuple[float, float] | None) -> VolumeSuggestion:
    """Return a translucent volume: without shadows inside, and with its surfaces alone, if it has some."""
    shading = found.suggestion.shading
    if shading is None:
        return found
    factors = None if ends is None else ((ends[0], 0.0), (ends[1], 1.0))
    shading = replace(shading, occlusion=0.0, gradient_opacity=factors)
    return replace(found, suggestion=replace(found.suggestion, shading=shading))


def _largest_chroma(suggestion: Suggestion) -> float:
    """Return the largest chroma of what is not transparent; that of a colormap counts as large."""
    mapping = suggestion.transfer.mapping
    if isinstance(mapping, ColormapSpec):
        return 100.0
    colors = np.array([point.color for point in mapping if point.opacity > 0] or [(0.0, 0.0, 0.0)])
    return float(np.hypot(*to_lab(colors).T[1:]).max())


def _tinted(suggestion: Suggestion, tint: tuple[float, float, float]) -> Suggestion:
    """Return the suggestion with colours of one hue that are as bright as its own; colormaps become grey."""
    mapping = suggestion.transfer.mapping
    if isinstance(mapping, ColormapSpec):
        return replace(suggestion, transfer=replace(suggestion.transfer, mapping=replace(mapping, name="gray")))
    points = []
    for point in mapping:
        red, green, blue = (min(1.0, float(np.dot(point.color, _LUMINANCE))) * part for part in tint)
        points.append(replace(point, color=(red, green, blue)))
    return with_8_bit_colors(replace(suggestion, transfer=replace(suggestion.transfer, mapping=tuple(points))))
