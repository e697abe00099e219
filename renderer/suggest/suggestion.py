"""Choose a transfer function that shows what is in a volume, and give the reason in words.

The kind of data is recognised from the values alone: labels, computed tomography in Hounsfield units, values on both
    sides of a background, an object brighter or darker than its background, or a volume filled to its border. Each kind
    has a preset (`renderer.suggest.presets`), whose opacities are then calibrated (`renderer.suggest.opacity`).
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
from renderer.suggest.features import Background, VoxelSample
from renderer.suggest.histogram import Statistics
from renderer.suggest.labels import background_label, distinct_values, label_mapping, label_reason, label_values
from renderer.suggest.opacity import format_number, format_percent, opacity_from_depth, opacity_unit_length
from renderer.suggest.presets import Preset
from renderer.suggest.separation import Plane, corner_box, separating_planes
from renderer.suggest.visibility import Visibility, cast_rays, measure_visibility, solve_depths
from renderer.suggest.wishes import LABELS_WISH, WISHES, Scan, Wish, imported_transfer
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
    if wish.preset is not None:
        return _wished_suggestion(sample, zero, wish, volume.centre)
    if zero is not None:
        reason = f"air lies near {zero - 1000:g} and soft tissue near {zero:g}{_offset_text(zero)}"
        kind, preset = "CT in Hounsfield units", presets.ct_preset(sample, zero)
    else:
        kind, reason, preset = _recognise(volume, statistics, sample, features.find_background(sample))
    return _with_colormap(_preset_suggestion(kind, reason, sample, preset, volume.centre), wish.colormap)


def _offset_text(zero: float | None) -> str:
    return f", stored with {zero:g} added" if zero else ""


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


def _wished_suggestion(sample: VoxelSample, zero: float | None, wish: Wish, centre: Float64) -> Suggestion:
    """Return the suggestion of a word, of a preset, or of a file."""
    background, is_dark = features.find_background(sample), False
    if zero is None and background.is_there and background.below > background.above:
        turned = sample.with_inverted_range()
        background, is_dark = features.find_background(turned), True
    scan = Scan(turned if is_dark else sample, background, zero)
    assert wish.preset is not None
    kind, word = f"shown as --preset {wish.preset}", WISHES.get(wish.preset)
    if word is not None:
        preset = word(scan).with_inverted_range() if is_dark else word(scan)
        reason = "by Hounsfield units" + _offset_text(zero) if zero is not None else "by the materials of the values"
        return _with_colormap(_preset_suggestion(kind, reason, sample, preset, centre), wish.colormap)
    transfer = imported_transfer(wish.preset, Scan(sample, background, zero))
    assert transfer.imported is not None and not isinstance(transfer.mapping, ColormapSpec)
    light = transfer.imported.shading
    shading = replace(presets.SHADING, **light, occlusion=0.0) if light else presets.SHADING
    points = tuple(
        replace(point, value=float(f"{point.value:.9g}"), opacity=round(point.opacity, 6)) for point in transfer.mapping
    )
    left_out = tuple(f"not imported: {clause}" for clause in transfer.imported.left_out)
    reason = f"values and opacities are those of {transfer.imported.name}{_offset_text(zero)}"
    transfer = replace(transfer, mapping=points)
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


# Signs of the other kinds

# Outlying labels are smaller than this, and not negative.
_MAX_OUTLYING_LABEL = 2**16
# The largest volume in a file that is drawn with splats, which need several times its memory.
_MAX_BYTES_FOR_SPLATS = 1 << 30

# Fields have a smaller ratio of second to first differences.
_SMOOTH = 0.58
# Floats with such a tail spread over orders of magnitude.
_HEAVY_TAIL = 25.0
# Two phases have at least this part of the variance between them: a normal distribution has 0.64, a uniform one 0.75.
_TWO_PHASE_SEPARATION = 0.85
# A filled volume shows values above this percentile.
_FILLED_PERCENTILE = 60.0


def _recognise(
    volume: Volume, statistics: Statistics, sample: VoxelSample, background: Background
) -> tuple[str, str, Preset]:
    """Return the kind, the reason and the preset of data that are neither labels nor Hounsfield units."""
    if not background.is_there or background.above + background.below == 0:
        return _filled_volume_preset(statistics, sample)
    if background.has_much_below and background.has_much_above:
        middle = sample.round_value(sample.denormalize(background.middle))
        away = max(background.high - background.middle, 0.04)
        reason = f"values lie on both sides of a background near {middle:.12g}"
        return "field with two signs", reason, presets.diverging_preset(sample, background.middle, away)
    if background.below > background.above:
        turned = sample.with_inverted_range()
        kind, reason, preset = _object_preset(volume, turned, features.find_background(turned))
        return f"{kind}, dark in a bright background", reason, preset.with_inverted_range()
    return _object_preset(volume, sample, background)


def _object_preset(volume: Volume, sample: VoxelSample, background: Background) -> tuple[str, str, Preset]:
    """Return the kind, the reason and the preset of an object brighter than its background."""
    is_smooth = features.second_difference_ratio(sample, background.high) < _SMOOTH
    near = f"the background is near {sample.round_value(sample.denormalize(background.middle)):.12g}"
    is_float = volume.values.dtype.kind == "f"
    if is_float and presets.tail_ratio(sample, background.high, origin=background.middle) > _HEAVY_TAIL:
        kind, reason = "field with a long tail", "the largest values are many times those in the middle"
    elif is_smooth and presets.has_nested_levels(sample, background.high):
        kind, reason = "smooth field", "the levels of the values lie inside one another"
    else:
        preset = presets.materials_preset(sample, background)
        return "scan without an absolute scale", f"{near} and what stands out from it has edges", preset
    return kind, f"{near} and {reason}", presets.field_preset(sample, background.high, origin=background.middle)


def _filled_volume_preset(statistics: Statistics, sample: VoxelSample) -> tuple[str, str, Preset]:
    """Return the kind, the reason and the preset of a volume without a background."""
    low, high = float(statistics.minimum), float(statistics.maximum)
    shares = sample.normalized[sample.is_valid]
    if low < 0 < high:
        zero = sample.normalize(0.0)
        if features.is_about_zero(sample):
            preset = presets.diverging_preset(sample, zero, 1.2 * float(np.std(shares)))
            return "field with two signs", "values lie on both sides of 0 and fill the volume to its border", preset
        if features.is_level_set_interior(sample.with_inverted_range(), 1 - zero):
            preset = presets.level_set_preset(1 - zero).with_inverted_range()
            return "level set", "negative values lie inside of positive ones", preset
        if features.is_level_set_interior(sample, zero):
            return "level set", "positive values lie inside of negative ones", presets.level_set_preset(zero)
    bottom, top = np.percentile(shares, (0.01, 99.99)).tolist()
    threshold = features.otsu_threshold(shares, bottom, top, _TWO_PHASE_SEPARATION)
    if threshold is not None:
        preset = presets.two_phase_preset(sample, threshold)
        return "two phases", "there is no background, and values gather in two groups", preset
    first = float(np.percentile(shares, _FILLED_PERCENTILE))
    preset = presets.field_preset(sample, first, origin=float(sample.normalized.min()))
    return "filled volume", "there is no background; the upper 40% of the values are shown", preset


# Computed tomography

# The stored value of 0 Hounsfield units: 0, or an offset that makes 12 bits positive.
_HOUNSFIELD_ZEROS = (0.0, 1024.0, 1000.0)


def hounsfield_zero(statistics: Statistics) -> float | None:
    """Return the stored value of water if the values are Hounsfield units, perhaps with 1000 or 1024 added; else None.

    In a scan, air and lungs (-1100 to -700) and soft tissue (-150 to 150) are much more frequent than the values
    between them (-600 to -300), and something is denser. Values below -1100 are padding around the scanner's circle.
    """
    low, high = float(statistics.minimum), float(statistics.maximum)
    for zero in _HOUNSFIELD_ZEROS:
        if (zero == 0) != (low < -200) or not 150 < high - zero < 40_000 or low - zero < -9000:
            continue
        if zero and high > 5200:
            continue
        values = statistics.bins - zero
        air, between, soft = (
            float(statistics.counts[(values >= a) & (values < b)].sum()) / (b - a)
            for a, b in ((-1100, -700), (-600, -300), (-150, 150))
        )
        if zero and not _is_narrow(statistics, values):
            continue
        if min(air, soft) > 1.5 * between and soft * 300 > 0.01 * float(statistics.counts.sum()):
            return zero
    return None


def _is_narrow(statistics: Statistics, values: Float64) -> bool:
    """Return whether soft tissue has a narrow peak, as on an absolute scale: half of -300 to 300 lies within 150."""
    counts = [float(statistics.counts[(values >= a) & (values < a + 50)].sum()) for a in range(-300, 300, 50)]
    widest = max(sum(counts[k : k + 3]) for k in range(len(counts) - 2))
    return widest > 0.5 * sum(counts) > 0


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


def _preset_suggestion(kind: str, reason: str, sample: VoxelSample, preset: Preset, centre: Float64) -> Suggestion:
    """Return the suggestion of a preset. centre: of the volume, in the world."""
    unit = opacity_unit_length(sample.diagonal)
    knots = sorted({at for layer in preset.layers for at, _ in layer.knots})
    planes = separating_planes(sample, _are_parts(sample, preset)) if preset.is_scan else []
    rays = cast_rays(sample, planes)
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
