"""Suggest how to show a volume that is in memory, and give the reason in words.

Labels, or the kind of data (`recognition.py`) or a wish (`wishes.py`), give a preset. Planes clip away what is not the
object (`separation.py`), and densities are solved for what the picture shows (`opacity_calibration.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter

import numpy as np

from renderer.errors import InputError
from renderer.looks import linear_in_extinction
from renderer.readers import are_colors
from renderer.scene import (
    ControlPoint,
    LayerSpec,
    Scene,
    TransferSpec,
    VolumeSpec,
)
from renderer.suggest import features
from renderer.suggest.channels import ReadVolume
from renderer.suggest.features import VoxelSample
from renderer.suggest.fill_value import suggest_fill
from renderer.suggest.histogram import Statistics, compute_statistics
from renderer.suggest.label_choice import NO_LABELS, KnownLabels, table_of
from renderer.suggest.label_volume import distinct_values, label_suggestion, label_values
from renderer.suggest.opacity import format_number, format_percent, opacity_from_depth, opacity_unit_length
from renderer.suggest.opacity_calibration import cast_rays, measure_visibility, solve_depths
from renderer.suggest.padding import without_padding
from renderer.suggest.presets import Choice, Preset
from renderer.suggest.recognition import hounsfield_zero, logarithmic_choice, recognise
from renderer.suggest.separation import Plane, are_beyond, clip_specs, corner_box, separating_planes
from renderer.suggest.suggestion import (
    ShownLayer,
    Suggestion,
    hide_outliers,
    with_8_bit_colors,
    with_colormap,
    with_logarithmic_scale,
)
from renderer.suggest.wishes import LABELS_WISH, WISHES, Wish, choose_by_word, imported_suggestion
from renderer.volume import Float64, Volume

NO_WISH = Wish()
# Tells what is known of the labels of a volume.
KnowLabels = Callable[[], KnownLabels]
_COLORS = "voxels that are colours"
# The opacity of a voxel is its alpha.
_ALPHA_POINTS = tuple(
    ControlPoint(value, (r, g, b), opacity)
    for value, (r, g, b, opacity) in linear_in_extinction([(0.0, (1.0, 1.0, 1.0, 0.0)), (255.0, (1.0, 1.0, 1.0, 1.0))])
)


@dataclass(frozen=True)
class VolumeSuggestion:
    """A suggestion for a volume whose voxels are no longer in memory.

    volume: which voxels. has_absent: whether any of them has no data. layers: of its channels, if each is to be seen;
        the suggestion is then that of the first.
    weight: as in `renderer.scene.LayerSpec`.
    """

    volume: VolumeSpec
    suggestion: Suggestion
    has_absent: bool
    layers: tuple[LayerSpec, ...] = ()
    weight: float = 1.0

    def applied_to(self, scene: Scene) -> Scene:
        """Return a scene of the volume with what is suggested; its own planes stay where it has some."""
        found, transfer = self.suggestion, self.suggestion.transfer
        if self.layers:
            volume = self.layers[0].volume
            return replace(scene, volume=volume, transfer_function=transfer, volumes=self.layers, blend="add")
        scene = replace(scene, volume=self.volume)
        clip = scene.clip or found.clip
        return replace(scene, transfer_function=transfer, shading=found.shading, clip=clip)


def read_in_colors(
    volume: VolumeSpec, found: Volume, read: ReadVolume, wish: Wish = NO_WISH
) -> tuple[VolumeSpec, Volume, Statistics]:
    """Return a volume with its voxels and their statistics; without a wish, voxels that are colours as such, with the
    opacities of alpha where that varies. found: what was read of it."""
    component = volume.component
    if component is None and wish == NO_WISH and are_colors(found.values.dtype, found.channels):
        component = "color"
    if component == "color" and len(found.channels) == 4:
        alpha = read(replace(volume, component="color_alpha"))
        low, high = alpha.value_range()
        if low < high:
            component, found = "color_alpha", alpha
    if component not in (volume.component, "color_alpha"):
        found = read(replace(volume, component=component))
    return replace(volume, component=component), found, compute_statistics(found.values, found.source)


def suggest_read(
    volume: VolumeSpec, found: Volume, statistics: Statistics, wish: Wish, known: KnowLabels | None = None
) -> VolumeSuggestion:
    """Suggest how to show a volume that is in memory. Raises as `suggest`.

    known: as of `suggest`; None for what the volume, and a table beside it, tell.
    """
    if volume.has_colors:
        suggestion = _color_suggestion(found, statistics, wish)
    else:
        suggestion = suggest(found, statistics, wish, known or partial(_labels_in_table, volume, found))
    if volume.component == "color_alpha" and wish == NO_WISH:
        reason = "of the 4 components the last is alpha, which says how opaque each voxel is"
        suggestion = Suggestion(_COLORS, reason, TransferSpec(_ALPHA_POINTS), (), None)
    return VolumeSuggestion(volume, with_8_bit_colors(suggestion), found.num_absent > 0)


def _labels_in_table(spec: VolumeSpec, volume: Volume) -> KnownLabels:
    return KnownLabels((), {label.value: label for label in table_of(spec, volume)})


def _color_suggestion(volume: Volume, statistics: Statistics, wish: Wish) -> Suggestion:
    """Return a suggestion for colours by their luminance; what the wish colours is multiplied by them."""
    found = suggest(volume, statistics, Wish(wish.colormap, wish.preset or "surface"))
    transfer = found.transfer
    if wish == NO_WISH and transfer.points:
        white = tuple(replace(point, color=(1.0, 1.0, 1.0)) for point in transfer.points)
        transfer = replace(transfer, mapping=white)
    reason = f"{len(volume.channels)} components, and opacities go with luminance"
    shading = found.shading and replace(found.shading, specular=0.0)
    return replace(found, kind=_COLORS, reason=reason, transfer=transfer, shading=shading)


# Outlying labels are smaller than this, and not negative.
_MAX_OUTLYING_LABEL = 2**16
# The opacity of a constant volume: a ray along the diagonal is covered by about two thirds.
_CONSTANT_OPACITY = 0.02
# One that has a shape, by voxels without data, is this deep to light, as a cube of its size.
_MASK_DEPTH = 3.0


def suggest(
    volume: Volume, statistics: Statistics, wish: Wish = NO_WISH, known: KnowLabels = lambda: NO_LABELS
) -> Suggestion:
    """Return a transfer function for a volume.

    statistics: of the volume (`renderer.suggest.histogram.compute_statistics`). known: returns what is known of its
    labels, if it has some: those of other steps in time, and a table. Raises InputError for a preset that cannot be
    read, or does not suit the volume.
    """
    if statistics.minimum == statistics.maximum:
        return with_colormap(_constant_suggestion(volume, float(statistics.minimum)), wish.colormap)
    others = statistics.without_outliers
    shown = others or statistics
    sample = features.sample_volume(volume, shown)
    if others is not None and (features.is_noise(sample) or _are_far_labels(volume, statistics)):
        others, shown = None, statistics
        sample = features.sample_volume(volume, shown)
    fill = None if sample.is_valid.all() else suggest_fill(volume, shown)
    if fill is not None:
        sample = features.sample_volume(volume, shown, sample.normalize(fill))
    suggestion = _suggest_from(volume, shown, sample, wish, known)
    return suggestion if others is None else hide_outliers(suggestion, statistics, sample)


def _are_far_labels(volume: Volume, statistics: Statistics) -> bool:
    """Return whether the outliers are labels, as all values are."""
    if not all(0 <= outlier.value < _MAX_OUTLYING_LABEL for outlier in statistics.outliers):
        return False
    return label_values(volume, statistics, features.sample_volume(volume, statistics)) is not None


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
    """Return a suggestion from the statistics of the values to show and a sample of their range."""
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
        return with_logarithmic_scale(_chosen_suggestion(choice, logarithms, []), wish.colormap)
    choose = partial(choose_by_word, word=word) if word else partial(recognise, is_float=is_float)
    choice, planes = choose(sample, zero), list[Plane]()
    if choice.preset.is_scan:
        planes = separating_planes(sample, choice.preset.covers(sample.normalized))
    if planes:  # what is clipped away is none of the materials
        sample = features.without(sample, are_beyond(sample, planes))
        again = choose(sample, zero)
        choice = again if again.kind == choice.kind else choice
    return with_colormap(_chosen_suggestion(choice, sample, planes), wish.colormap)


def _chosen_suggestion(choice: Choice, sample: VoxelSample, planes: Sequence[Plane]) -> Suggestion:
    """Return the suggestion of a preset. sample: without what the planes clip away."""
    kind, reason, preset = choice
    rays = cast_rays(sample)
    solved = solve_depths(rays, preset.layers, preset.coverage, by_area=not preset.is_scan)
    visible = _shown_layers(sample, preset, measure_visibility(rays, preset.layers, solved).shares)
    mapping, notes = _control_points(sample, preset, solved, visible)
    corner = None
    if preset.is_closed:
        reason += "; its outside hides what is inside, so that a corner is clipped"
        corner = corner_box(sample, preset.covers(sample.normalized))
    clip = clip_specs(planes, corner, sample.centre, sample.diagonal)
    transfer = TransferSpec(mapping, opacity_unit_length(sample.diagonal))
    return Suggestion(kind, reason, transfer, notes, preset.shading, clip=clip, visible=visible)


def _control_points(
    sample: VoxelSample, preset: Preset, solved: Float64, visible: Sequence[ShownLayer]
) -> tuple[tuple[ControlPoint, ...], tuple[str, ...]]:
    """Return a point for each knot of layers and of colours, and a note on what it shows if a layer peaks there.

    solved: the optical depths of the layers, as from `solve_depths`.
    """
    knots = sorted({at for curve in (preset.colors, *(layer.knots for layer in preset.layers)) for at, _ in curve})
    depths = solved @ np.stack([layer.weights(np.array(knots)) for layer in preset.layers])
    at_colors, colors = zip(*preset.colors, strict=True)
    channels = [np.interp(knots, at_colors, channel).tolist() for channel in zip(*colors, strict=True)]
    gaps = np.diff(knots, prepend=-math.inf, append=math.inf)
    peaks = [max(layer.knots, key=itemgetter(1))[0] for layer in preset.layers]
    points: dict[float, tuple[ControlPoint, str]] = {}
    nearest = np.minimum(gaps[:-1], gaps[1:]).tolist()
    for at, depth, gap, *color in zip(knots, depths.tolist(), nearest, *channels, strict=True):
        value, (r, g, b) = sample.round_value(sample.denormalize(at), gap), color
        point = ControlPoint(value, (r, g, b), opacity_from_depth(depth, sample.diagonal))
        shown = [layer for layer, peak in zip(visible, peaks, strict=True) if peak == at]
        note = ", ".join(f"{layer.name}: {format_percent(layer.share)} of the picture" for layer in shown)
        if value not in points or point.opacity > points[value][0].opacity:
            points[value] = point, note
    found = [points[value] for value in sorted(points)]
    # The first point is the look of all that is below it, too.
    if found[0][0].opacity > 0 and not any(layer.knots[0][1] for layer in preset.layers):
        found.insert(0, (replace(found[0][0], opacity=0.0), ""))
    mapping, notes = zip(*found, strict=True)
    return mapping, notes


def _shown_layers(sample: VoxelSample, preset: Preset, shares: Float64) -> tuple[ShownLayer, ...]:
    """Return the values of each layer of a preset, and what is seen of them."""

    def in_data(low: float, high: float) -> tuple[float, float]:
        one, other = sorted(sample.round_value(sample.denormalize(min(max(end, 0.0), 1.0))) for end in (low, high))
        return one, other

    found, total = [], sum(layer.share for layer in preset.layers)
    for layer, share in zip(preset.layers, shares.tolist(), strict=True):
        voxels = float(np.mean(layer.covers(sample.normalized)))
        ranges = tuple(in_data(*ends) for ends in layer.ranges())
        found.append(ShownLayer(layer.name, ranges, voxels, share, layer.share / total))
    return tuple(found)
