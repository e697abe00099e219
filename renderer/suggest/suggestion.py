"""Hold a suggestion, and change it: hide outliers, apply a colormap, round colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import attrgetter

import numpy as np

from renderer.scene import (
    ClipSpec,
    ColormapSpec,
    ControlPoint,
    LabelsSpec,
    LightSpec,
    ShadingSpec,
    TransferSpec,
    colormap_points,
)
from renderer.statistics import OutlierValue, Statistics, VoxelSample, format_number
from renderer.suggest.palette import FIELD_COLORMAP, FIELD_ENDS, in_8_bits

# Outliers are transparent: values farther outside the range of all other values than a margin, which is this part of
# the range, or half of the gap to the nearest outlier if that is less.
_OUTLIER_MARGIN = 0.02
# A background is visible if its opacity, for a length of about 1 % of the volume's diagonal, is more than this.
LEAST_OPACITY = 1e-3


@dataclass(frozen=True)
class ShownLayer:
    """A layer that is shown: its values, and its share of the picture.

    name: the name of the material, in words.
    ranges: pairs of the lowest and the highest value, in data units.
    voxels: the share of all voxels that have these values.
    share: the share of the picture that the layer has.
    target: the share of the picture that the layer was to have.
    """

    name: str
    ranges: tuple[tuple[float, float], ...]
    voxels: float
    share: float
    target: float


@dataclass(frozen=True)
class Suggestion:
    """A transfer function that shows the content of a volume, and why it was chosen.

    kind: the kind of data.
    reason: the signs by which the kind was recognised, a clause without a full stop.
    transfer: the transfer function, with its unit of length.
    notes: a comment for each control point, mostly empty.
    shading: the light; None if the data have no surfaces, or with `light`.
    outlier_notes: clauses on outliers, and on other things that are not shown.
    clip: planes that clip away the surroundings of the object, and a box to look into it.
    visible: the layers of values that the pictures of a turntable show.
    light: the light of the whole scene, which matter scatters; None with `shading`.
    """

    kind: str
    reason: str
    transfer: TransferSpec
    notes: tuple[str, ...]
    shading: ShadingSpec | None
    outlier_notes: tuple[str, ...] = ()
    clip: tuple[ClipSpec, ...] = ()
    visible: tuple[ShownLayer, ...] = ()
    light: LightSpec | None = None


def with_colormap(suggestion: Suggestion, colormap: str | None) -> Suggestion:
    """Return the suggestion with a colormap in place of its colours, and with the same opacities.

    colormap: the name of the colormap; None leaves the suggestion as it is.
    """
    mapping, points = suggestion.transfer.mapping, suggestion.transfer.points
    if colormap is None:
        return suggestion
    if isinstance(mapping, LabelsSpec):
        table = colormap_points(colormap, max(2, len(mapping.values)))
        return _with_mapping(suggestion, replace(mapping, colors=tuple(zip(mapping.values, table, strict=False))))
    if not isinstance(mapping, ColormapSpec):
        low, high = points[0].value, points[-1].value
        span = (low, high) if low < high else (low - max(1.0, abs(low)), low + max(1.0, abs(low)))
        # A point between two points of the same opacity has no effect, as the colormap gives the colours.
        runs = [list(run) for _, run in groupby(points, attrgetter("opacity"))]
        ends = [end for run in runs for end in ((run[0], run[-1]) if len(run) > 1 else run)]
        mapping = ColormapSpec(colormap, span, tuple((point.value, point.opacity) for point in ends))
    return replace(_with_mapping(suggestion, replace(mapping, colormap=colormap)), notes=())


def _with_mapping(suggestion: Suggestion, mapping: tuple[ControlPoint, ...] | ColormapSpec | LabelsSpec) -> Suggestion:
    return replace(suggestion, transfer=replace(suggestion.transfer, mapping=mapping))


def with_logarithmic_scale(suggestion: Suggestion, colormap: str | None) -> Suggestion:
    """Turn a suggestion for logarithms to base 10 into one for the values, with a colormap on a logarithmic scale."""
    mapping = with_colormap(suggestion, colormap or FIELD_COLORMAP).transfer.mapping
    assert isinstance(mapping, ColormapSpec)
    first, last = mapping.range
    if colormap is None:  # the ends of the colormap are not used
        low, high = FIELD_ENDS
        whole = (last - first) / (high - low)
        first, last = first - low * whole, last + (1 - high) * whole

    def value(logarithm: float) -> float:
        return float(f"{10.0 ** min(max(logarithm, -300.0), 308.0):.4g}")

    mapping = replace(
        mapping,
        range=(value(first), value(last)),
        opacity=tuple((value(at), opacity) for at, opacity in mapping.opacity),
        scale="log",
    )
    visible = tuple(
        replace(layer, ranges=tuple((value(low), value(high)) for low, high in layer.ranges))
        for layer in suggestion.visible
    )
    return replace(_with_mapping(suggestion, mapping), notes=(), visible=visible)


def with_8_bit_colors(suggestion: Suggestion) -> Suggestion:
    """Round the colours to `#rrggbb`, as a scene file has them, so that suggestion and file draw the same picture."""
    points, labels = suggestion.transfer.points, suggestion.transfer.labels
    if labels is not None and isinstance(labels.colors, tuple):
        colors = tuple((label, in_8_bits(color)) for label, color in labels.colors)
        return _with_mapping(suggestion, replace(labels, colors=colors))
    if not points:
        return suggestion
    return _with_mapping(suggestion, tuple(replace(point, color=in_8_bits(point.color)) for point in points))


def hide_outliers(suggestion: Suggestion, statistics: Statistics, sample: VoxelSample) -> Suggestion:
    """Return the suggestion for all values of a volume, with the outliers transparent.

    suggestion: a suggestion for the values without outliers. statistics: the statistics of all values. sample: a sample
    normalised to the range of the values without outliers.
    """
    below = (-sample.normalize(outlier.last) for outlier in statistics.outliers if outlier.last < sample.minimum)
    above = (sample.normalize(outlier.value) - 1 for outlier in statistics.outliers if outlier.value > sample.maximum)
    margins = [min((_OUTLIER_MARGIN, *(gap / 2 for gap in gaps))) for gaps in (below, above)]
    low = sample.round_value(sample.denormalize(-margins[0]), margins[0])
    high = sample.round_value(sample.denormalize(1 + margins[1]), margins[1])
    num = statistics.num_voxels
    outlier_notes = tuple(
        f"{outlier.num} of {num} voxels {'is' if outlier.num == 1 else 'are'} {_values_text(outlier)}, far from "
        "all neighbours: taken for noise, and transparent"
        for outlier in statistics.outliers
    )
    suggestion = replace(suggestion, outlier_notes=(*outlier_notes, *suggestion.outlier_notes))
    mapping = suggestion.transfer.mapping
    if isinstance(mapping, LabelsSpec):  # labels that a scene does not name are not shown in any case
        return suggestion
    points: Sequence[ControlPoint]
    if isinstance(mapping, ColormapSpec):
        points = [ControlPoint(at, (0.0, 0.0, 0.0), opacity) for at, opacity in mapping.opacity]
    else:
        points = suggestion.transfer.points
    if statistics.maximum > high:
        points = _transparent_above(points, high)
    if statistics.minimum < low:
        points = _mirrored(_transparent_above(_mirrored(points), -low))
    if isinstance(mapping, ColormapSpec):
        opacity = tuple((point.value, point.opacity) for point in points)
        return _with_mapping(suggestion, replace(mapping, opacity=opacity))
    return with_points(suggestion, points)


def with_points(suggestion: Suggestion, points: Sequence[ControlPoint]) -> Suggestion:
    """Return the suggestion with `points` as its control points; those that it had before keep their notes."""
    named = dict(zip(suggestion.transfer.points, suggestion.notes, strict=False))
    return replace(_with_mapping(suggestion, tuple(points)), notes=tuple(named.get(point, "") for point in points))


def _values_text(outlier: OutlierValue) -> str:
    low, high = format_number(outlier.value), format_number(outlier.last)
    return low if outlier.value == outlier.last else f"{low} to {high}"


def _mirrored(points: Sequence[ControlPoint]) -> list[ControlPoint]:
    return [replace(point, value=-point.value) for point in reversed(points)]


def _transparent_above(points: Sequence[ControlPoint], end: float) -> list[ControlPoint]:
    """Return control points with the same opacities up to the value `end`, and with an opacity of 0 above it."""
    below = [point for point in points if point.value < end]
    above = points[len(below) :]
    if not any(point.opacity for point in (*below[-1:], *above)):
        return below or [replace(points[0], value=end)]
    at = [point.value for point in points]
    r, g, b = (float(np.interp(end, at, part)) for part in zip(*(point.color for point in points), strict=True))
    opacity = float(f"{np.interp(end, at, [point.opacity for point in points]):.3g}")
    return [*below, ControlPoint(end, (r, g, b), opacity), ControlPoint(end, (r, g, b), 0.0)]


def transparent_between(points: Sequence[ControlPoint], first: float, last: float) -> list[ControlPoint]:
    """Return control points with an opacity of 0 from the value `first` to `last`, and the same opacities elsewhere."""
    return [*_transparent_above(points, first), *_mirrored(_transparent_above(_mirrored(points), -last))]
