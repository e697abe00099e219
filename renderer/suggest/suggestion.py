"""Choose a transfer function that shows what is in a volume, and give the reason in words.

Labels, or the kind of data (`recognition.py`) or a wish (`wishes.py`), give a preset. Planes cut away what is not the
object (`separation.py`), and densities are solved for what the picture shows (`visibility.py`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from renderer.errors import InputError
from renderer.scene import (
    MAX_CUTS,
    ColormapSpec,
    ControlPoint,
    CutSpec,
    PlaneSpec,
    ShadingSpec,
    SplatSpec,
    TransferSpec,
    Vector,
)
from renderer.suggest import features, presets
from renderer.suggest.features import VoxelSample
from renderer.suggest.histogram import Statistics
from renderer.suggest.labels import background_label, distinct_values, label_mapping, label_reason, label_values
from renderer.suggest.opacity import format_number, format_percent, opacity_from_depth, opacity_unit_length
from renderer.suggest.presets import Choice, Preset
from renderer.suggest.recognition import hounsfield_zero, offset_text, recognise
from renderer.suggest.separation import Plane, are_beyond, corner_box, separating_planes
from renderer.suggest.visibility import Visibility, cast_rays, measure_visibility, solve_depths
from renderer.suggest.wishes import LABELS_WISH, WISHES, Wish, choose_by_word, imported_transfer
from renderer.volume import Bools, Float64, Volume

NO_WISH = Wish()


@dataclass(frozen=True)
class ShownLayer:
    """Values that are shown.

    name: what they are, in words. ranges: from low to high, in data units. voxels: their part of the voxels. share: of
        what the picture shows. target: what was asked for.
    """

    name: str
    ranges: tuple[tuple[float, float], ...]
    voxels: float
    share: float
    target: float


@dataclass(frozen=True)
class Suggestion:
    """A transfer function that shows what is in a volume, and why it was chosen.

    kind: the kind of data. reason: the signs by which it was recognised, a clause without a full stop.
    transfer: the transfer function, with its unit. notes: a comment for each of its points, mostly empty.
    shading: None where the data have no surfaces.
    is_categorical: the values are labels, and no value between two labels means anything. splat: how to draw; None
        for the default.
    outlier_notes: a clause for each outlier or nodata value that is not shown.
    cuts: planes that cut away what is not the object, and a box to look into it.
    visible: what the picture shows, over a turntable.
    """

    kind: str
    reason: str
    transfer: TransferSpec
    notes: tuple[str, ...]
    shading: ShadingSpec | None
    is_categorical: bool = False
    splat: SplatSpec | None = None
    outlier_notes: tuple[str, ...] = ()
    cuts: tuple[CutSpec, ...] = ()
    visible: tuple[ShownLayer, ...] = ()


def suggest(volume: Volume, statistics: Statistics, wish: Wish = NO_WISH) -> Suggestion:
    """Return a transfer function for a volume.

    statistics: of the volume (`renderer.suggest.histogram.compute_statistics`). Raises InputError for a preset that
    cannot be read, or does not suit the volume.
    """
    if statistics.minimum == statistics.maximum:
        return _with_colormap(_constant_suggestion(volume, float(statistics.minimum)), wish.colormap)
    if all(0 <= outlier.value < _MAX_OUTLYING_LABEL for outlier in statistics.outliers):
        sample = features.sample_volume(volume, statistics)
        if statistics.without_outliers is None or label_values(volume, statistics, sample) is not None:
            return _suggest_from(volume, statistics, sample, wish)
    others = statistics.without_outliers
    assert others is not None, statistics.outliers
    sample = features.sample_volume(volume, others)
    nonfinite_fill = suggest_nonfinite_fill(volume, others)
    if nonfinite_fill is not None:
        sample = features.sample_volume(volume, others, sample.normalize(nonfinite_fill))
    return hide_outliers(_suggest_from(volume, others, sample, wish), statistics, sample)


def _suggest_from(volume: Volume, statistics: Statistics, sample: VoxelSample, wish: Wish) -> Suggestion:
    """Return a suggestion from the statistics of the values to show and a sample of their range."""
    values = _wished_labels(volume, statistics, sample, wish)
    if values is not None:
        return _label_suggestion(volume, sample, values, wish.colormap)
    zero = hounsfield_zero(statistics)
    if wish.preset is not None and wish.preset not in WISHES:
        return _imported_suggestion(sample, zero, wish.preset)

    def choose(sample: VoxelSample) -> Choice:
        if wish.preset is not None:
            return choose_by_word(wish.preset, sample, zero)
        return recognise(sample, statistics, zero, is_float=volume.values.dtype.kind == "f")

    choice, planes = choose(sample), list[Plane]()
    if choice.preset.is_scan:
        planes = separating_planes(sample, _are_parts(sample, choice.preset))
    if planes:  # what is cut away is none of the materials
        sample = features.without(sample, are_beyond(sample, planes))
        again = choose(sample)
        choice = again if again.kind == choice.kind else choice
    return _with_colormap(_chosen_suggestion(choice, sample, planes, volume.centre), wish.colormap)


def _wished_labels(volume: Volume, statistics: Statistics, sample: VoxelSample, wish: Wish) -> Sequence[float] | None:
    """Return the values of labels, if the volume has such and nothing else is wished, or if they are wished."""
    if wish.preset is None:
        return label_values(volume, statistics, sample)
    if wish.preset != LABELS_WISH:
        return None
    found = distinct_values(volume, statistics)
    if found is None:
        raise InputError("too many values for labels", where=volume.name, got="--preset labels")
    return found


def _imported_suggestion(sample: VoxelSample, zero: float | None, preset: str) -> Suggestion:
    transfer = imported_transfer(preset, sample, zero)
    assert transfer.imported is not None and not isinstance(transfer.mapping, ColormapSpec)
    light = transfer.imported.shading
    shading = replace(presets.SHADING, **light, occlusion=0.0) if light else presets.SHADING
    points = tuple(
        replace(point, value=float(f"{point.value:.9g}"), opacity=round(point.opacity, 6)) for point in transfer.mapping
    )
    left_out = tuple(f"not imported: {clause}" for clause in transfer.imported.left_out)
    reason = f"values and opacities are those of {transfer.imported.name}{offset_text(zero)}"
    transfer = replace(transfer, mapping=points)
    kind = f"shown as --preset {preset}"
    return Suggestion(kind, reason, transfer, ("",) * len(points), shading, outlier_notes=left_out)


def _label_suggestion(volume: Volume, sample: VoxelSample, values: Sequence[float], colormap: str | None) -> Suggestion:
    outside = background_label(sample, values)
    mapping, notes, unit = label_mapping(sample, values, outside, colormap)
    reason = label_reason(sample, values, outside)
    shading = presets.flip_light(presets.SHADING) if outside == values[-1] else presets.SHADING
    if len(values) == 2:
        return Suggestion("mask", reason, TransferSpec(mapping, unit), notes, shading)
    # A volume that stays in its file may be larger than memory, and splats would need it there.
    has_splats = volume.source is None or volume.values.nbytes <= _MAX_BYTES_FOR_SPLATS
    splat = SplatSpec(footprint="gaussian") if has_splats else None
    shading = replace(shading, occlusion=0.0)  # splats have none
    return Suggestion("labels", reason, TransferSpec(mapping, unit), notes, shading, is_categorical=True, splat=splat)


# Outlying labels are smaller than this, and not negative.
_MAX_OUTLYING_LABEL = 2**16
# The largest volume in a file that is drawn with splats, which need several times its memory.
_MAX_BYTES_FOR_SPLATS = 1 << 30

# Outliers and nodata values

# Values further from the range of the others than this part of the range are transparent.
_OUTLIER_MARGIN = 0.02


def hide_outliers(suggestion: Suggestion, statistics: Statistics, sample: VoxelSample) -> Suggestion:
    """Return a suggestion for the values without outliers, with the outliers transparent.

    statistics: of all values. sample: with the range of the values without outliers.
    """
    low, high = (sample.round_value(sample.denormalize(end)) for end in (-_OUTLIER_MARGIN, 1 + _OUTLIER_MARGIN))
    num = int(statistics.counts.sum())
    outlier_notes = tuple(
        f"{outlier.num} of {num} voxels {'is' if outlier.num == 1 else 'are'} {format_number(outlier.value)}, far from "
        f"all others: taken for {'a fill value' if outlier.is_nodata else 'an outlier'}, and transparent"
        for outlier in statistics.outliers
    )
    mapping, notes = suggestion.transfer.mapping, suggestion.notes
    points: Sequence[ControlPoint] = (
        [ControlPoint(at, (0.0, 0.0, 0.0), opacity) for at, opacity in mapping.opacity]
        if isinstance(mapping, ColormapSpec)
        else mapping
    )
    named = dict(zip(points, notes, strict=False))
    if max(outlier.value for outlier in statistics.outliers) > high:
        points = _transparent_above(points, high)
    if min(outlier.value for outlier in statistics.outliers) < low:
        points = _mirrored(_transparent_above(_mirrored(points), -low))
    if isinstance(mapping, ColormapSpec):
        mapping = replace(mapping, opacity=tuple((point.value, point.opacity) for point in points))
    else:
        mapping, notes = tuple(points), tuple(named.get(point, "") for point in points)
    transfer = replace(suggestion.transfer, mapping=mapping)
    return replace(suggestion, transfer=transfer, notes=notes, outlier_notes=outlier_notes)


def _mirrored(points: Sequence[ControlPoint]) -> list[ControlPoint]:
    return [replace(point, value=-point.value) for point in reversed(points)]


def _transparent_above(points: Sequence[ControlPoint], end: float) -> list[ControlPoint]:
    """Return the points with an opacity of 0 above `end`."""
    below = [point for point in points if point.value < end]
    above = points[len(below) :]
    if not any(point.opacity for point in (*below[-1:], *above)):
        return below or [replace(points[0], value=end)]
    at = [point.value for point in points]
    r, g, b = (float(np.interp(end, at, part)) for part in zip(*(point.color for point in points), strict=True))
    opacity = float(f"{np.interp(end, at, [point.opacity for point in points]):.3g}")
    return [*below, ControlPoint(end, (r, g, b), opacity), ControlPoint(end, (r, g, b), 0.0)]


# NaN and infinities


def suggest_nonfinite_fill(volume: Volume, statistics: Statistics) -> float | None:
    """Return the value for NaN and infinities, from the statistics of the others; None if the lowest value serves.

    volume: read with `nonfinite: lowest`.
    """
    statistics = statistics.without_outliers or statistics
    low, high = float(statistics.minimum), float(statistics.maximum)
    if low == high:  # a mask by NaN
        return 0.0 if low else None
    sample = features.sample_volume(volume, statistics)
    if label_values(volume, statistics, sample) is not None:
        return _nonfinite_label(sample, low)
    if low < 0 < high and features.is_about_zero(sample):
        return 0.0
    if low < 0 < high and features.is_level_set_interior(sample.with_inverted_range(), 1 - sample.normalize(0.0)):
        return high
    background = features.find_background(sample)
    if not (background.is_there and background.has_much_below):
        return None
    return sample.round_value(sample.denormalize(background.middle))


def _nonfinite_label(sample: VoxelSample, low: float) -> float | None:
    """Return the label at the border if it has more voxels there than NaN has; else a label that no voxel has."""
    is_known = features.faces(sample.is_valid)
    values, counts = np.unique(features.faces(sample.normalized)[is_known], return_counts=True)
    if counts.max(initial=0) > np.count_nonzero(~is_known):
        outside = float(values[counts.argmax()])
        return sample.denormalize(outside) if outside > 0 else None
    return 0.0 if low > 0 else None


# From a preset to a transfer function

# A ray along the diagonal is covered by about two thirds.
_CONSTANT_OPACITY = 0.02


def _constant_suggestion(volume: Volume, value: float) -> Suggestion:
    unit = opacity_unit_length(float(np.linalg.norm(volume.spacing * volume.shape_xyz)))
    reason = f"every voxel is {format_number(value)}, so that there is nothing to tell apart"
    point = ControlPoint(value, (1.0, 0.93, 0.80), _CONSTANT_OPACITY)
    return Suggestion("constant volume", reason, TransferSpec((point,), unit), ("",), None)


def _chosen_suggestion(choice: Choice, sample: VoxelSample, planes: Sequence[Plane], centre: Float64) -> Suggestion:
    """Return the suggestion of a preset.

    sample: without what the planes cut away. centre: of the volume, in the world.
    """
    kind, reason, preset = choice
    unit = opacity_unit_length(sample.diagonal)
    knots = sorted({at for layer in preset.layers for at, _ in layer.knots})
    rays = cast_rays(sample)
    solved = solve_depths(rays, preset.layers, preset.coverage, by_area=not preset.is_scan)
    visible = _shown_layers(sample, preset, measure_visibility(rays, preset.layers, solved))
    depths = solved @ np.stack([layer.weights(np.array(knots)) for layer in preset.layers])
    where, colors = [at for at, _ in preset.colors], np.array([color for _, color in preset.colors])
    points: dict[float, tuple[ControlPoint, str]] = {}
    gaps = np.diff(knots, prepend=-math.inf, append=math.inf)
    for at, depth, gap in zip(knots, depths.tolist(), np.minimum(gaps[:-1], gaps[1:]).tolist(), strict=True):
        value = sample.round_value(sample.denormalize(at), gap)
        r, g, b = (float(np.interp(at, where, colors[:, k])) for k in range(3))
        point = ControlPoint(value, (r, g, b), opacity_from_depth(depth, unit, sample.diagonal))
        peaking = [
            f"{shown.name}: {format_percent(shown.share)} of the picture"
            for layer, shown in zip(preset.layers, visible, strict=True)
            if max(layer.knots, key=itemgetter(1))[0] == at
        ]
        if value not in points or point.opacity > points[value][0].opacity:
            points[value] = point, ", ".join(peaking)
    mapping, notes = zip(*(points[value] for value in sorted(points)), strict=True)
    cuts = tuple(_cut(plane, centre, sample.diagonal) for plane in planes)
    if preset.is_closed:
        reason += "; its outside hides what is inside, so that a corner is cut out"
        cuts = (*cuts[: MAX_CUTS - 1], _corner_cut(sample, preset, centre))
    transfer = TransferSpec(mapping, unit)
    return Suggestion(kind, reason, transfer, notes, preset.shading, cuts=cuts, visible=visible)


def _shown_layers(sample: VoxelSample, preset: Preset, visibility: Visibility) -> tuple[ShownLayer, ...]:
    """Return the values of each layer of a preset, and what is seen of them."""

    def in_data(low: float, high: float) -> tuple[float, float]:
        ends = (min(max(end, 0.0), 1.0) for end in (low, high))
        one, other = sorted(sample.round_value(sample.denormalize(end)) for end in ends)
        return one, other

    found, total = [], sum(layer.share for layer in preset.layers)
    for layer, share in zip(preset.layers, visibility.shares.tolist(), strict=True):
        voxels = float(np.mean(layer.weights(sample.normalized) >= _MIN_PART_WEIGHT))
        ranges = tuple(in_data(*ends) for ends in layer.ranges())
        found.append(ShownLayer(layer.name, ranges, voxels, share, layer.share / total))
    return tuple(found)


# What is thinner than half of the lowest layer is not a part of anything.
_MIN_PART_WEIGHT = 0.5


def _are_parts(sample: VoxelSample, preset: Preset) -> Bools:
    """Return which of the sample's voxels are parts of something, and not its edges."""
    weights = np.max([layer.weights(sample.normalized) for layer in preset.layers], axis=0)
    return np.asarray(weights >= _MIN_PART_WEIGHT)


def _cut(plane: Plane, centre: Float64, diagonal: float) -> CutSpec:
    normal = _rounded(plane.normal, 1.0)
    return CutSpec(plane=PlaneSpec(_rounded(plane.point + centre, diagonal), normal))


def _corner_cut(sample: VoxelSample, preset: Preset, centre: Float64) -> CutSpec:
    low, high = corner_box(sample, _are_parts(sample, preset))
    return CutSpec(box=(_rounded(low + centre, sample.diagonal), _rounded(high + centre, sample.diagonal)))


def _rounded(vector: Float64, extent: float) -> Vector:
    """Return a vector in the world, rounded to about a thousandth of an extent."""
    decimals = 3 - math.floor(math.log10(extent))
    x, y, z = (round(at, decimals) + 0.0 for at in vector.tolist())
    return x, y, z


def _with_colormap(suggestion: Suggestion, colormap: str | None) -> Suggestion:
    """Return the suggestion with its points replaced by a colormap with the same opacities."""
    points = suggestion.transfer.mapping
    if colormap is None or isinstance(points, ColormapSpec):
        return suggestion
    low, high = points[0].value, points[-1].value
    span = (low, high) if low < high else (low - max(1.0, abs(low)), low + max(1.0, abs(low)))
    mapping = ColormapSpec(colormap, span, tuple((point.value, point.opacity) for point in points))
    return replace(suggestion, transfer=replace(suggestion.transfer, mapping=mapping), notes=())
