"""Recognise volumes whose values are labels (masks, segmentations, connected components), and colour them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise

import numpy as np

from renderer.scene import Color, ColormapSpec, ControlPoint
from renderer.suggest import features
from renderer.suggest.features import VoxelSample
from renderer.suggest.histogram import Statistics
from renderer.suggest.opacity import format_number, opacity_from_depth, opacity_unit_length
from renderer.suggest.palette import distinct_colors
from renderer.suggest.presets import OPAQUE_COVERAGE
from renderer.suggest.visibility import CRISP_SURFACE_DEPTH, Layer, cast_rays, solve_depths
from renderer.volume import Bools, Volume, iter_slabs

_MAX_LABELS = 4096
# Up to this many values are always labels. More are, if at least this part of the neighbours of voxels outside the
# background have the voxel's own value; scans have up to 0.6.
_MAX_CERTAIN_LABELS, _MIN_EQUAL_NEIGHBOURS = 3, 0.75
# Labels of a few voxels each have fewer equal neighbours, but lie in one place: 0.02 to 0.3 of all scatter; the values
# of a scan 0.6 to 1.
_MIN_EQUAL_NEIGHBOURS_OF_SMALL, _MAX_SCATTER_OF_SMALL = 0.45, 0.5
# More values than this are a smooth field if this part of the unequal neighbours differ by one or two.
_MAX_GRADED_LABELS, _MAX_SMALL_STEPS = 16, 0.6
# If more of the values than this only occur in transitions, the data are a clipped image or a smoothed edge.
_MAX_TRANSITION_FRACTION = 0.5

_PALETTE: tuple[Color, ...] = (
    (0.90, 0.47, 0.29),
    (0.29, 0.56, 0.85),
    (0.91, 0.77, 0.28),
    (0.37, 0.71, 0.42),
    (0.69, 0.42, 0.78),
    (0.31, 0.77, 0.77),
    (0.85, 0.34, 0.48),
    (0.60, 0.66, 0.29),
    (0.54, 0.48, 0.85),
    (0.79, 0.60, 0.42),
)
_BLACK: Color = (0.0, 0.0, 0.0)
# Up to this many labels have colours that are as different as possible; more share those of a colormap.
_MAX_DISTINCT_COLORS, _MANY_LABELS_COLORMAP = 255, "glasbey"

# A label encloses smaller ones if it covers this part of their projections, along all three axes.
_ENCLOSING_COVERAGE = 0.85
# Its part of the picture, compared with that of another label.
_ENCLOSING_SHARE = 0.4


def label_values(volume: Volume, statistics: Statistics, sample: VoxelSample) -> list[float] | None:
    """Return the values of a volume of labels, ascending; None for other volumes."""
    is_piecewise = _is_piecewise_constant(sample)
    if len(np.unique(sample.normalized)) > _MAX_CERTAIN_LABELS and not is_piecewise:
        return None
    found = distinct_values(volume, statistics)
    if found is None or (len(found) > 2 and not all(value == int(value) for value in found)):
        return None
    if len(found) > _MAX_CERTAIN_LABELS:
        if not is_piecewise or features.transition_value_fraction(sample) > _MAX_TRANSITION_FRACTION:
            return None
        two_levels = 2.5 / (found[-1] - found[0])
        if len(found) > _MAX_GRADED_LABELS and features.small_step_fraction(sample, two_levels) > _MAX_SMALL_STEPS:
            return None
    return found


def label_reason(sample: VoxelSample, values: Sequence[float], outside: float) -> str:
    """Return the signs by which the values are labels, a clause."""
    pieces = ", in separate pieces" if _is_piecewise_constant(sample) else ""
    return f"there are {len(values)} values{pieces}, and {format_number(outside)} is the background"


def _is_piecewise_constant(sample: VoxelSample) -> bool:
    outside = _border_mode(sample)
    equal = features.equal_neighbour_fraction(sample, outside)
    if equal < _MIN_EQUAL_NEIGHBOURS:
        return equal >= _MIN_EQUAL_NEIGHBOURS_OF_SMALL and features.scatter(sample, outside) <= _MAX_SCATTER_OF_SMALL
    return True


def distinct_values(volume: Volume, statistics: Statistics) -> list[float] | None:
    """Return every value in the range of the statistics, ascending; None if there are too many."""
    if statistics.bin_width == 1.0 and volume.values.dtype.kind in "iu":
        counted: list[float] = statistics.bins[statistics.counts > 0].tolist()
        return counted if len(counted) <= _MAX_LABELS else None
    found: set[float] = set()
    for plane in iter_slabs(volume.values, volume.source, 1):
        values = np.unique(plane)
        found.update(values[(values >= statistics.minimum) & (values <= statistics.maximum)].astype(float).tolist())
        if len(found) > _MAX_LABELS:
            return None
    return sorted(found)


def background_label(sample: VoxelSample, values: Sequence[float]) -> float:
    """Return the label around the object: the most frequent one at the volume's border."""
    at = sample.denormalize(_border_mode(sample))
    return min(values, key=lambda value: abs(value / 2 - at / 2))


def _border_mode(sample: VoxelSample) -> float:
    values, counts = np.unique(features.faces(sample.normalized), return_counts=True)
    return float(values[counts.argmax()])


def label_mapping(
    sample: VoxelSample, values: Sequence[float], outside: float, colormap: str | None
) -> tuple[tuple[ControlPoint, ...] | ColormapSpec, tuple[str, ...], float]:
    """Return the points or the colormap, a comment for each point, and the unit of the opacities.

    Every label but `outside` has a colour and an opacity, with steps half-way between the labels.
    """
    unit = opacity_unit_length(sample.diagonal)

    def opacities(layers: Sequence[Layer]) -> list[float]:
        depths = solve_depths(cast_rays(sample, is_interpolated=False), layers, OPAQUE_COVERAGE)
        return [opacity_from_depth(depth, unit, sample.diagonal) for depth in depths.tolist()]

    ends = [values[0], *(low / 2 + high / 2 for low, high in pairwise(values)), values[-1]]
    between = dict(zip(values, pairwise(ends), strict=True))
    # Normalised; the outermost labels have no end on one side.
    regions = {
        value: (sample.normalize(low) - (value == values[0]), sample.normalize(high) + (value == values[-1]))
        for value, (low, high) in between.items()
    }
    shown = [value for value in values if value != outside]
    if len(shown) <= len(_PALETTE):
        found = opacities(_layers(sample, [regions[value] for value in shown]))
    else:
        knots = tuple((at, float(value != outside)) for value in values for at in regions[value])
        found = opacities([Layer("", knots, min_depth=CRISP_SURFACE_DEPTH)]) * len(shown)
    if colormap is not None or len(shown) > _MAX_DISTINCT_COLORS:
        steps: list[tuple[float, float]] = []
        for is_shown, labels in groupby(values, lambda value: value != outside):
            first, *_, last = (at for value in labels for at in between[value])
            steps += [(at, found[0] if is_shown else 0.0) for at in (first, last)]
        return ColormapSpec(colormap or _MANY_LABELS_COLORMAP, (values[0], values[-1]), tuple(steps)), (), unit
    colors = distinct_colors(_PALETTE, len(shown))
    styles = dict(zip(shown, zip(colors, found, strict=True), strict=True)) | {outside: (_BLACK, 0.0)}
    points = tuple(ControlPoint(at, *styles[value]) for value in values for at in between[value])
    names = [f"label {format_number(value)}" if value != outside else "the background" for value in values]
    return points, tuple(word for name in names for word in (name, "")), unit


def _layers(sample: VoxelSample, regions: Sequence[tuple[float, float]]) -> list[Layer]:
    """Return a layer for each label from its (low, high), normalised: opaque, but translucent around smaller labels."""
    parts = [(sample.normalized > low) & (sample.normalized < high) for low, high in regions]
    shadows = [[np.asarray(part.any(axis=axis)) for axis in range(3)] for part in parts]
    areas = [sum(int(shadow.sum()) for shadow in of_label) for of_label in shadows]
    layers = []
    for (low, high), own, area in zip(regions, shadows, areas, strict=True):
        smaller = [other for other, other_area in zip(shadows, areas, strict=True) if 0 < other_area < area]
        is_around = bool(smaller) and all(_covers(own[axis], [other[axis] for other in smaller]) for axis in range(3))
        share, min_depth = (_ENCLOSING_SHARE, 0.0) if is_around else (1.0, CRISP_SURFACE_DEPTH)
        layers.append(Layer("", ((low, 0.0), (low, 1.0), (high, 1.0), (high, 0.0)), share, min_depth))
    return layers


def _covers(shadow: Bools, others: Sequence[Bools]) -> bool:
    """Return whether a projection covers most of the union of the others."""
    together = np.any(others, axis=0)
    return int((shadow & together).sum()) > _ENCLOSING_COVERAGE * int(together.sum())
