"""A volume to a transfer function that shows what is in it, and the reason in words.

First the kind of data is recognised, by the values alone: labels, computed tomography in Hounsfield units, values on
both sides of a background, an object brighter or darker than its background, a volume that is filled. Each has its
preset (`renderer.suggest.presets`), whose amounts are exposed like a photograph (`renderer.suggest.opacity`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from renderer.scene import ColormapSpec, ControlPoint, ShadingSpec, SplatSpec, TransferSpec
from renderer.suggest import presets
from renderer.suggest.features import (
    ONE_SIDED_RATIO,
    Background,
    VoxelSample,
    find_background,
    has_much_below,
    is_about_zero,
    otsu_threshold,
    sample_volume,
    second_difference_ratio,
)
from renderer.suggest.histogram import Statistics
from renderer.suggest.labels import background_label, label_mapping, label_reason, label_values
from renderer.suggest.level_sets import is_level_set_interior
from renderer.suggest.nonfinite import suggest_nonfinite_fill
from renderer.suggest.opacity import calibrate_layer_depth, format_number, opacity_from_depth, opacity_unit_length
from renderer.suggest.presets import Preset
from renderer.volume import Float64, Volume


@dataclass(frozen=True)
class Suggestion:
    """kind: what the data are taken for. reason: by which signs, a clause without a full stop.
    transfer: the transfer function, with its unit. notes: a word about each of its points, mostly empty.
    shading: or None where there are no surfaces.
    is_categorical: the values are names, and none is between two of them. splat: how to draw; None as ever.
    far: of each value that is far from all others and is not shown, what it was taken for, a clause."""

    kind: str
    reason: str
    transfer: TransferSpec
    notes: tuple[str, ...]
    shading: ShadingSpec | None
    is_categorical: bool = False
    splat: SplatSpec | None = None
    outlier_notes: tuple[str, ...] = ()


def suggest(volume: Volume, statistics: Statistics, colormap: str | None = None) -> Suggestion:
    """A transfer function for a volume whose statistics (`renderer.suggest.histogram.compute_statistics`) are known.

    colormap: a name to take the colours from, in place of those that suit the kind of data.
    """
    if statistics.minimum == statistics.maximum:
        return _constant(volume, float(statistics.minimum), colormap)
    if all(0 <= far.value < _MAX_OUTLYING_LABEL for far in statistics.outliers):
        sample = sample_volume(volume, statistics)
        if statistics.without_outliers is None or label_values(volume, statistics, sample) is not None:
            return _suggest_from(volume, statistics, sample, colormap)
    others = statistics.without_outliers
    assert others is not None, statistics.outliers
    sample = sample_volume(volume, others)
    nonfinite_fill = suggest_nonfinite_fill(volume, others)
    if nonfinite_fill is not None:
        sample = sample_volume(volume, others, sample.normalize(nonfinite_fill))
    return hide_outliers(_suggest_from(volume, others, sample, colormap), statistics, sample)


def _suggest_from(volume: Volume, statistics: Statistics, sample: VoxelSample, colormap: str | None) -> Suggestion:
    """statistics: of what is to be seen. sample: with that in its range."""
    values = label_values(volume, statistics, sample)
    if values is not None:
        outside = background_label(sample, values)
        mapping, notes, unit = label_mapping(sample, values, outside, colormap)
        reason = label_reason(sample, values, outside)
        shading = presets.flip_light(presets.SHADING) if outside == values[-1] else presets.SHADING
        transfer = TransferSpec(mapping, unit)
        if len(values) == 2:
            return Suggestion("mask", reason, transfer, notes, shading)
        # What stays in its file may be larger than memory, which splats would need.
        splat = None
        if volume.source is None or volume.values.nbytes <= _MOST_BYTES_OF_SPLATS:
            splat = SplatSpec(footprint="gaussian")
        return Suggestion("labels", reason, transfer, notes, shading, is_categorical=True, splat=splat)
    zero = hounsfield_zero(statistics)
    if zero is not None:
        where = "" if zero == 0 else f", stored with {zero:g} added"
        reason = f"air lies near {zero - 1000:g} and soft tissue near {zero:g}{where}"
        preset = presets.ct_preset(sample, zero)
        return _suggestion_from_preset("CT in Hounsfield units", reason, sample, preset, colormap)
    kind, reason, preset = _recognise(volume, statistics, sample, find_background(sample))
    return _suggestion_from_preset(kind, reason, sample, preset, colormap)


# Signs of the other kinds

# Labels are smaller than this, and not negative, where they are far from all others.
_MAX_OUTLYING_LABEL = 2**16
# Of volumes in files; splats of larger ones would take several times as much.
_MOST_BYTES_OF_SPLATS = 1 << 30

# Fields are smoother than this; real numbers are more often computed than measured.
_SMOOTH, _SMOOTH_FLOAT = 0.45, 0.8
# Real numbers of such a tail spread over orders of magnitude.
_HEAVY_TAIL = 25.0
# Two phases have at least this part of the variance between them: 0.64 for one normal distribution, 0.75 for even
# values.
_TWO_PHASE_SEPARATION = 0.85
# A filled volume shows values above this percentile.
_FILLED_PERCENTILE = 60.0


def _recognise(
    volume: Volume, statistics: Statistics, sample: VoxelSample, background: Background
) -> tuple[str, str, Preset]:
    if not background.is_there or background.above + background.below == 0:
        return _filled_volume_preset(statistics, sample)
    if has_much_below(background) and background.above > ONE_SIDED_RATIO * background.below:
        middle = sample.round_value(sample.denormalize(background.middle))
        away = max(background.high - background.middle, 0.04)
        reason = f"values lie on both sides of a background near {middle:.12g}"
        return "field with two signs", reason, presets.diverging_preset(sample, background.middle, away)
    if background.below > background.above:
        turned = sample.with_inverted_range()
        kind, reason, preset = _object_preset(volume, turned, find_background(turned))
        return f"{kind}, dark in a bright background", reason, preset.with_inverted_range()
    return _object_preset(volume, sample, background)


def _object_preset(volume: Volume, sample: VoxelSample, background: Background) -> tuple[str, str, Preset]:
    """What stands out above the background."""
    rough = second_difference_ratio(sample, background.high)
    near = f"the background is near {sample.round_value(sample.denormalize(background.middle)):.12g}"
    is_float = volume.values.dtype.kind == "f"
    if is_float and presets.tail_ratio(sample, background.high, origin=background.middle) > _HEAVY_TAIL:
        preset = presets.ramp_preset(sample, background.high, origin=background.middle)
        return "field with a long tail", f"{near} and the largest values are many times those in the middle", preset
    if rough < (_SMOOTH_FLOAT if is_float else _SMOOTH):
        preset = presets.ramp_preset(sample, background.high, origin=background.middle)
        return "smooth data", f"{near} and values change smoothly", preset
    return (
        "scan without an absolute scale",
        f"{near} and what stands out from it has edges",
        presets.materials_preset(sample, background),
    )


def _filled_volume_preset(statistics: Statistics, sample: VoxelSample) -> tuple[str, str, Preset]:
    """No background: the volume is full to its border."""
    low, high = float(statistics.minimum), float(statistics.maximum)
    if low < 0 < high and is_about_zero(sample):
        preset = presets.diverging_preset(
            sample, sample.normalize(0.0), 1.2 * float(np.std(sample.normalized[sample.is_valid]))
        )
        return "field with two signs", "values lie on both sides of 0 and fill the volume to its border", preset
    if low < 0 < high:
        zero = sample.normalize(0.0)
        if is_level_set_interior(sample.with_inverted_range(), 1 - zero):
            return (
                "level set",
                "negative values lie inside of positive ones",
                presets.level_set_preset(1 - zero).with_inverted_range(),
            )
        if is_level_set_interior(sample, zero):
            return "level set", "positive values lie inside of negative ones", presets.level_set_preset(zero)
    shares = sample.normalized[sample.is_valid]
    found = otsu_threshold(shares, *np.percentile(shares, (0.01, 99.99)).tolist())
    if found is not None and found.separation > _TWO_PHASE_SEPARATION:
        return (
            "two phases",
            "there is no background, and values gather in two groups",
            presets.two_phase_preset(sample, found),
        )
    first = float(np.percentile(shares, _FILLED_PERCENTILE))
    preset = presets.ramp_preset(sample, first, origin=float(sample.normalized.min()))
    return "filled volume", "there is no background; the upper 40% of the values are shown", preset


# Computed tomography

# What CT scanners write as 0 Hounsfield units: 0, or what makes their 12 bits positive.
_HOUNSFIELD_ZEROS = (0.0, 1024.0, 1000.0)


def hounsfield_zero(statistics: Statistics) -> float | None:
    """The data value of water if the values are those of a CT scan in Hounsfield units, stored as they are or with 1000
    or 1024 added; else None.

    Of a scan, air and lungs (-1100 to -700) and soft tissue (-150 to 150) are much more frequent than what is between
    (-600 to -300), and there is something denser. What lies below -1100 is padding around the scanner's circle.
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
    """Whether soft tissue has a narrow peak, as only an absolute scale gives it: half of -300 to 300 within 150."""
    counts = [float(statistics.counts[(values >= a) & (values < a + 50)].sum()) for a in range(-300, 300, 50)]
    widest = max(sum(counts[k : k + 3]) for k in range(len(counts) - 2))
    return widest > 0.5 * sum(counts) > 0


# Values that are far from all others

# Of the range of the others, beyond which nothing is shown.
_OUTLIER_MARGIN = 0.02


def hide_outliers(suggestion: Suggestion, statistics: Statistics, sample: VoxelSample) -> Suggestion:
    """The suggestion for the others, of which `sample` is, with nothing shown where the far values are."""
    ends = [sample.round_value(sample.denormalize(share)) for share in (-_OUTLIER_MARGIN, 1 + _OUTLIER_MARGIN)]
    values = [far.value for far in statistics.outliers]
    below = ends[0] if min(values) < ends[0] else None
    above = ends[1] if max(values) > ends[1] else None
    num = int(statistics.counts.sum())
    told = tuple(
        f"{far.num} of {num} voxels {'is' if far.num == 1 else 'are'} {format_number(far.value)}, far from all others: "
        f"taken for {'a fill value' if far.is_nodata else 'an outlier'}, and transparent"
        for far in statistics.outliers
    )
    mapping = suggestion.transfer.mapping
    if isinstance(mapping, ColormapSpec):
        steps = _cut([ControlPoint(at, (0.0, 0.0, 0.0), opacity) for at, opacity in mapping.opacity], below, above)
        cut = replace(mapping, opacity=tuple((point.value, point.opacity) for point in steps))
        return replace(suggestion, transfer=replace(suggestion.transfer, mapping=cut), outlier_notes=told)
    points = _cut(mapping, below, above)
    named = dict(zip(mapping, suggestion.notes, strict=False))
    notes = tuple(named.get(point, "") for point in points)
    return replace(
        suggestion, transfer=replace(suggestion.transfer, mapping=tuple(points)), notes=notes, outlier_notes=told
    )


def _cut(points: Sequence[ControlPoint], below: float | None, above: float | None) -> list[ControlPoint]:
    """The points with an opacity of 0 below and above these values."""
    cut = list(points) if above is None else _transparent_above(points, above)
    if below is None:
        return cut
    return _mirrored(_transparent_above(_mirrored(cut), -below))


def _mirrored(points: Sequence[ControlPoint]) -> list[ControlPoint]:
    return [replace(point, value=-point.value) for point in reversed(points)]


def _transparent_above(points: Sequence[ControlPoint], end: float) -> list[ControlPoint]:
    kept = [point for point in points if point.value < end]
    later = points[len(kept) :]
    if not any(point.opacity for point in (*kept[-1:], *later)):
        return kept or [replace(points[0], value=end)]
    before, after = kept[-1] if kept else later[0], later[0] if later else kept[-1]
    way = (end - before.value) / (after.value - before.value) if after.value > before.value else 0.0
    r, g, b = (float(u + (v - u) * way) for u, v in zip(before.color, after.color, strict=True))
    opacity = float(f"{before.opacity + (after.opacity - before.opacity) * way:.3g}")
    return [*kept, ControlPoint(end, (r, g, b), opacity), ControlPoint(end, (r, g, b), 0.0)]


# From a preset to a transfer function

# About two thirds of a diagonal's light are held back.
_CONSTANT_OPACITY = 0.02


def _constant(volume: Volume, value: float, colormap: str | None) -> Suggestion:
    unit = opacity_unit_length(float(np.linalg.norm(volume.spacing * volume.shape_xyz)))
    reason = f"every voxel is {format_number(value)}, so that there is nothing to tell apart"
    points = [ControlPoint(value, (1.0, 0.93, 0.80), _CONSTANT_OPACITY)]
    return _from_points("constant volume", reason, Preset((), (), None), points, ("",), unit, colormap)


def _suggestion_from_preset(
    kind: str, reason: str, sample: VoxelSample, preset: Preset, colormap: str | None
) -> Suggestion:
    unit = opacity_unit_length(sample.diagonal)
    knots = sorted({at for layer in preset.layers for at, _ in layer.knots})
    depths = np.zeros(len(knots))
    for layer in preset.layers:
        at, weights = np.array(layer.knots, np.float64).T
        depths += calibrate_layer_depth(sample, layer) * np.interp(knots, at, weights)
    if not depths.max() > 0:  # nothing that was looked for is in the sample
        low, high = sorted((sample.minimum, sample.maximum))
        plain = Preset((), (), None)
        return _from_points(kind, reason, plain, _ramp_over(low, high), ("", ""), unit, colormap)
    where, colors = [at for at, _ in preset.colors], np.array([color for _, color in preset.colors])
    points: dict[float, ControlPoint] = {}
    notes: dict[float, str] = {}
    gaps = np.diff(knots, prepend=-math.inf, append=math.inf)
    nearest = np.minimum(gaps[:-1], gaps[1:])
    for at, depth, gap in zip(knots, depths.tolist(), nearest.tolist(), strict=True):
        value = sample.round_value(sample.denormalize(at), gap)
        r, g, b = (float(np.interp(at, where, colors[:, k])) for k in range(3))
        points[value] = ControlPoint(value, (r, g, b), opacity_from_depth(depth, unit, sample.diagonal))
        starting = [layer.name for layer in preset.layers if layer.name and _peak_position(layer.knots) == at]
        notes[value] = ", ".join(starting)
    ordered = sorted(points)
    told = tuple(notes[value] for value in ordered)
    return _from_points(kind, reason, preset, [points[value] for value in ordered], told, unit, colormap)


def _ramp_over(low: float, high: float) -> list[ControlPoint]:
    """For values so odd that no sign of theirs led anywhere."""
    return [ControlPoint(low, (0.0, 0.0, 0.0), 0.0), ControlPoint(high, (1.0, 0.93, 0.80), 0.3)]


def _from_points(
    kind: str,
    reason: str,
    preset: Preset,
    points: Sequence[ControlPoint],
    notes: tuple[str, ...],
    unit: float,
    colormap: str | None,
) -> Suggestion:
    if colormap is None:
        return Suggestion(kind, reason, TransferSpec(tuple(points), unit), notes, preset.shading)
    low, high = points[0].value, points[-1].value
    span = (low, high) if low < high else (low - max(1.0, abs(low)), low + max(1.0, abs(low)))
    mapping = ColormapSpec(colormap, span, tuple((point.value, point.opacity) for point in points))
    return Suggestion(kind, reason, TransferSpec(mapping, unit), (), preset.shading)


def _peak_position(knots: tuple[tuple[float, float], ...]) -> float:
    """Where a layer first has all its weight."""
    most = max(weight for _, weight in knots)
    return next(at for at, weight in knots if weight == most)
