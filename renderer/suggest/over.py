"""Suggest how to show a volume over another one: the one underneath becomes a translucent shell around it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from renderer.scene import ColormapSpec, ShadingSpec, VolumeSpec
from renderer.suggest.features import VoxelSample, sample_volume
from renderer.suggest.opacity_calibration import Layer, balance, cast_through
from renderer.suggest.palette import to_lab
from renderer.suggest.separation import Plane, are_beyond
from renderer.suggest.suggestion import Suggestion, with_8_bit_colors
from renderer.suggest.volume_suggestion import NO_WISH, VolumeSuggestion, read_with_statistics, suggest_read
from renderer.suggest.wishes import Wish
from renderer.transfer import make_transfer_function
from renderer.volume import Volume

# The part of what is seen that the upper volume has, on the rays that meet both.
_SHARE = 2 / 3
# Colours of which none has more of a hue than this, in CIELAB, are taken for grey.
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
    rays, layers = cast_through([above, below]), []
    for found, sample in ((upper, above), (lower, below)):
        transfer = make_transfer_function(found.suggestion.transfer, min(sample.spacing))
        at = [sample.normalize(value) for value in transfer.values.tolist()]
        layers.append(Layer("", tuple(zip(at, (transfer.extinctions * above.diagonal / 100).tolist(), strict=True))))
    kept = (upper.suggestion.is_categorical, lower.suggestion.is_categorical)
    rays = [each._replace(is_interpolated=not is_label) for each, is_label in zip(rays, kept, strict=True)]
    weights = [float(f"{weight:.2g}") for weight in balance(rays, layers, _SHARE)]
    is_grey = not wish.colormap and not wish.preset and _chroma(upper.suggestion) <= _MAX_GREY_CHROMA
    shown = [_tinted(upper.suggestion, _WARM) if is_grey else upper.suggestion, lower.suggestion]
    if not lower.suggestion.is_categorical:
        shown[1] = _tinted(lower.suggestion, _GREY)
    found = [replace(each, suggestion=_beside_another(new, weight), weight=weight)
             for each, new, weight in zip((upper, lower), shown, weights, strict=True)]
    return found[0], found[1]


def _suggest(
    spec: VolumeSpec, read: Callable[[VolumeSpec], Volume], wish: Wish
) -> tuple[VolumeSuggestion, VoxelSample]:
    """Return the suggestion for a volume alone, and a sample of what it shows."""
    volume, statistics = read_with_statistics(spec, read)
    found = suggest_read(spec, volume, statistics, wish)
    if statistics.minimum == statistics.maximum:  # a sample needs a range
        statistics = replace(statistics, minimum=statistics.minimum - max(1, abs(statistics.minimum)))
    sample = sample_volume(volume, statistics)
    at = [(each.plane.point, each.plane.normal) for each in found.suggestion.clip if each.plane is not None]
    beyond = are_beyond(sample, [Plane(np.array(point) - sample.centre, np.array(normal)) for point, normal in at])
    return found, replace(sample, is_valid=sample.is_valid & ~beyond)


def _chroma(suggestion: Suggestion) -> float:
    """Return the largest chroma of what is not transparent; that of a colormap counts as large."""
    mapping = suggestion.transfer.mapping
    if isinstance(mapping, ColormapSpec):
        return 100.0
    colors = np.array([point.color for point in mapping if point.opacity > 0] or [(0.0, 0.0, 0.0)])
    return float(np.hypot(*to_lab(colors).T[1:]).max())


def _tinted(suggestion: Suggestion, tint: tuple[float, float, float]) -> Suggestion:
    """Return the suggestion with colours of one hue that are as bright as its own."""
    mapping = suggestion.transfer.mapping
    if isinstance(mapping, ColormapSpec):
        return replace(suggestion, transfer=replace(suggestion.transfer, mapping=replace(mapping, name="gray")))
    points = []
    for point in mapping:
        red, green, blue = (min(1.0, np.dot(point.color, _LUMINANCE)) * part for part in tint)
        points.append(replace(point, color=(red, green, blue)))
    return with_8_bit_colors(replace(suggestion, transfer=replace(suggestion.transfer, mapping=tuple(points))))


def _beside_another(suggestion: Suggestion, weight: float) -> Suggestion:
    """Return the suggestion without what holds only for a volume alone: shares, a corner, splats; and inner shadows."""
    shading = suggestion.shading
    if shading is not None and weight < 1:
        shading = replace(shading, occlusion=0.0)
    return replace(
        suggestion, shading=shading, splat=None, visible=(),
        notes=() if suggestion.visible else suggestion.notes,
        clip=tuple(each for each in suggestion.clip if each.plane is not None),
    )
