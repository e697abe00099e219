"""Recognise volumes whose values are labels (masks, segmentations, connected components), and colour them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from renderer.scene import MAX_LABELS, LabelsSpec, TransferSpec, counted, join_some
from renderer.suggest.features import SAME, VoxelSample, faces
from renderer.suggest.histogram import Statistics
from renderer.suggest.label_choice import KnownLabels, choose_labels, count_labels
from renderer.suggest.opacity import format_number, opacity_from_depth, opacity_unit_length
from renderer.suggest.opacity_calibration import Layer, TurntableRays, cast_rays, solve_depths
from renderer.suggest.presets import OPAQUE_COVERAGE, SHADING, STONE
from renderer.suggest.suggestion import ShownLayer, Suggestion
from renderer.volume import Bools, Float64, Volume, iter_slabs

# Occlusion, which is found for voxels, would show the stairs of a label.
_SHADING = replace(SHADING, ambient=0.45, diffuse=0.6, occlusion=0.0)
# The optical depth of 1 % of the diagonal of a label that is not around others: its surface looks solid.
_SOLID_DEPTH = 6.0
# Each of up to this many labels has a density of its own.
_MAX_SOLVED = 10
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

# A label encloses smaller ones if it covers this part of their projections, along all three axes.
_ENCLOSING_COVERAGE = 0.85
# Its part of the picture, compared with that of another label.
_ENCLOSING_SHARE = 0.4

# Larger integers are rounded in float64, as which values are found here.
_MAX_EXACT = 2**53


def label_values(volume: Volume, statistics: Statistics, sample: VoxelSample) -> list[float] | None:
    """Return the values of a volume of labels, ascending; None for other volumes."""
    is_piecewise = _is_piecewise_constant(sample)
    if len(np.unique(sample.normalized)) > _MAX_CERTAIN_LABELS and not is_piecewise:
        return None
    found = distinct_values(volume, statistics)
    if found is None or not all(value == int(value) and abs(value) <= _MAX_EXACT for value in found):
        return None
    if len(found) > _MAX_CERTAIN_LABELS:
        if not is_piecewise or _transition_value_fraction(sample) > _MAX_TRANSITION_FRACTION:
            return None
        two_levels = 2.5 / (found[-1] - found[0])
        if len(found) > _MAX_GRADED_LABELS and _small_step_fraction(sample, two_levels) > _MAX_SMALL_STEPS:
            return None
    return found


def _is_piecewise_constant(sample: VoxelSample) -> bool:
    are_outside = np.abs(sample.normalized - border_mode(sample)) > SAME
    are_equal = np.abs(sample.neighbours[:, are_outside] - sample.normalized[are_outside]) <= SAME
    equal = np.mean(are_equal) if are_equal.size else 1
    if _MIN_EQUAL_NEIGHBOURS_OF_SMALL <= equal < _MIN_EQUAL_NEIGHBOURS:
        return _scatter(sample, are_outside) <= _MAX_SCATTER_OF_SMALL
    return bool(equal >= _MIN_EQUAL_NEIGHBOURS)


def _scatter(sample: VoxelSample, are_outside: Bools) -> float:
    """Return the variance of the places of voxels with one value, as a part of that of all outside the background.

    Low for labels, about 1 for scans.
    """
    _, number, counts = np.unique(sample.normalized[are_outside], return_inverse=True, return_counts=True)
    places = np.argwhere(are_outside).T * np.array(sample.spacing)[:, None]
    means = [(np.bincount(number, at) / counts)[number] for at in places]
    within = sum(float(np.var(at - mean)) for at, mean in zip(places, means, strict=True))
    return within / max(float(np.var(places, axis=1).sum()), 1e-300)


def _transition_value_fraction(sample: VoxelSample) -> float:
    """Return the part of the distinct values most of whose voxels lie strictly between their neighbours along x or y.

    The edges of an image have such values; the voxels of a label lie side by side.
    """
    here, (left, right, down, up) = sample.normalized, sample.neighbours
    passed = ((left < here) & (here < right)) | ((left > here) & (here > right))
    passed |= ((down < here) & (here < up)) | ((down > here) & (here > up))
    _, number, counts = np.unique(here, return_inverse=True, return_counts=True)
    return float(np.mean(np.bincount(number.ravel(), passed.ravel()) > counts / 2))


def _small_step_fraction(sample: VoxelSample, step: float) -> float:
    """Return the part of the unequal neighbours that differ by at most `step`, normalised."""
    differences = np.abs(sample.neighbours - sample.normalized)
    unequal = differences[differences > SAME]
    return float(np.mean(unequal <= step)) if unequal.size else 0.0


def distinct_values(volume: Volume, statistics: Statistics) -> list[float] | None:
    """Return every value in the range of the statistics, ascending; None if there are too many."""
    if statistics.bin_width == 1.0 and volume.values.dtype.kind in "iu":
        counted: list[float] = statistics.bins[statistics.counts > 0].tolist()
        return counted if len(counted) <= MAX_LABELS else None
    found: set[float] = set()
    for plane in iter_slabs(volume.values, volume.source, 1):
        values = np.unique(plane)
        found.update(values[(values >= statistics.minimum) & (values <= statistics.maximum)].astype(float).tolist())
        if len(found) > MAX_LABELS:
            return None
    return sorted(found)


def border_mode(sample: VoxelSample) -> float:
    """Return the normalised value that is most frequent on the faces of a volume."""
    values, counts = np.unique(faces(sample.normalized), return_counts=True)
    return float(values[counts.argmax()])


def _background_label(sample: VoxelSample, values: Sequence[float]) -> float | None:
    """Return the label that is most frequent at the border; None if what fills voxels without data is no label."""
    mode = border_mode(sample)
    at_border = sample.denormalize(mode)
    nearest = min(values, key=lambda value: abs(value / 2 - at_border / 2))
    return nearest if abs(sample.normalize(nearest) - mode) <= SAME else None


def label_suggestion(volume: Volume, sample: VoxelSample, values: Sequence[float], known: KnownLabels) -> Suggestion:
    """Return the suggestion for labels: every one but the background has a colour and an opacity.

    The background is the most frequent label at the volume's border, if voxels have data there. What a table says holds
    as in a scene: names, colours, and which labels are hidden or translucent. known: the table, and labels of other
    steps in time.
    """
    voxels = count_labels(volume)
    outside = _background_label(sample, values)
    pieces = ", in separate pieces" if _is_piecewise_constant(sample) else ""
    around = "voxels around them have no data" if outside is None else f"{format_number(outside)} is the background"
    reason = f"there are {len(values)} values{pieces}, and {around}"
    present = sorted({*map(int, values), *known.present} - ({int(outside)} if outside is not None else set()))
    if num_elsewhere := len({*present} - {*map(int, values)}):
        reason += f"; {counted(num_elsewhere, 'more label')} in other steps"
    hidden = [value for value in present if (label := known.table.get(value)) and label.opacity == 0]
    shown = [value for value in present if value not in hidden] or present
    numbered = number_sample(sample, shown)
    rays = cast_rays(numbered)
    depths = _solve_label_depths(numbered, rays, len(shown))
    solved = {
        value: opacity_from_depth(depth, sample.diagonal) for value, depth in zip(shown, depths.tolist(), strict=True)
    }
    shares = _visible_shares(rays, depths)
    visible = tuple(
        ShownLayer(
            known.names.get(value, ""),
            ((value, value),),
            voxels.get(value, 0) / volume.values.size,
            share,
            1 / len(shown),
        )
        for value, share in zip(shown, shares.tolist(), strict=True)
    )
    mapping = _with_table(LabelsSpec(opacity=tuple(solved.items()), show=tuple(shown)), known)
    transfer = TransferSpec(mapping, opacity_unit_length(sample.diagonal))
    kind = "mask" if len(present) == 1 else "labels"
    notes = _hidden_note(hidden, known) if hidden else ()
    return Suggestion(kind, reason, transfer, (), _SHADING, outlier_notes=notes, visible=visible)


def _with_table(labels: LabelsSpec, known: KnownLabels) -> LabelsSpec:
    """Return labels that are shown with the colours, the names and the translucency that a table gives them."""
    assert labels.show is not None and isinstance(labels.opacity, tuple)
    given = {value: label.opacity for value, label in known.table.items() if label.opacity and label.opacity < 1}
    opacities = {key: given.get(key, opacity) for key, opacity in labels.opacity if isinstance(key, int)}
    colors = () if len(opacities) > 1 else tuple((each, STONE) for each in opacities if not _has_color(known, each))
    spec = replace(labels, colors=colors, opacity=tuple(opacities.items()))
    return choose_labels(spec, KnownLabels([*opacities], known.table), "", [])


def _has_color(known: KnownLabels, value: int) -> bool:
    return value in known.table and known.table[value].color is not None


def _hidden_note(hidden: Sequence[int], known: KnownLabels) -> tuple[str, ...]:
    """Return a clause on the labels that a table hides."""
    names = join_some([known.names.get(value, f"label {value}") for value in hidden])
    return (f"the table of labels hides {names}",)


def number_sample(sample: VoxelSample, shown: Sequence[int]) -> VoxelSample:
    """Return a sample with the numbers of labels that are shown, ascending, for their values; 0 for all others."""
    at = np.array([sample.normalize(value) for value in shown])
    number = np.minimum(np.searchsorted(at, sample.normalized - SAME), len(at) - 1)
    numbers = np.where(np.abs(at[number] - sample.normalized) <= SAME, number + 1, 0)
    return replace(sample, normalized=numbers / len(at), minimum=0.0, maximum=float(len(at)), is_interpolated=False)


def _solve_label_depths(sample: VoxelSample, rays: TurntableRays, num: int) -> Float64:
    """Return the optical depth of each label, float64 [num], as `solve_depths`. sample: of their numbers."""
    first = 0.5 / num
    all_alike = Layer("", ((first, 0.0), (first, 1.0)), min_depth=_SOLID_DEPTH)
    layers = _layers(sample, num) if num <= _MAX_SOLVED else [all_alike]
    return np.resize(solve_depths(rays, layers, OPAQUE_COVERAGE), num)


def _visible_shares(rays: TurntableRays, depths: Float64) -> Float64:
    """Return the part of what is seen that each label has. rays: of their numbers."""
    number = np.rint(np.nan_to_num(rays.values) * len(depths)).astype(np.int64)
    taken = 100 * rays.step * np.append(0.0, depths)[number]
    visible = np.exp(taken - np.cumsum(taken, axis=1)) * -np.expm1(-taken)
    shares = np.bincount(number.ravel(), visible.ravel(), len(depths) + 1)[1:]
    return np.asarray(shares / max(float(shares.sum()), 1e-12))


def _layers(sample: VoxelSample, num: int) -> list[Layer]:
    """Return a layer for each label: opaque, but translucent around smaller labels. sample: of their numbers."""
    parts = [np.rint(sample.normalized * num) == number for number in range(1, num + 1)]
    shadows = [[np.asarray(part.any(axis=axis)) for axis in range(3)] for part in parts]
    areas = [sum(int(shadow.sum()) for shadow in of_label) for of_label in shadows]
    layers = []
    for number, (own, area) in enumerate(zip(shadows, areas, strict=True), 1):
        smaller = [other for other, other_area in zip(shadows, areas, strict=True) if 0 < other_area < area]
        is_around = bool(smaller) and all(_covers(own[axis], [other[axis] for other in smaller]) for axis in range(3))
        share, min_depth = (_ENCLOSING_SHARE, 0.0) if is_around else (1.0, _SOLID_DEPTH)
        low, high = (number - 0.5) / num, (number + 0.5) / num
        layers.append(Layer("", ((low, 0.0), (low, 1.0), (high, 1.0), (high, 0.0)), share, min_depth))
    return layers


def _covers(shadow: Bools, others: Sequence[Bools]) -> bool:
    """Return whether a projection covers most of the union of the others."""
    together = np.any(others, axis=0)
    return int((shadow & together).sum()) > _ENCLOSING_COVERAGE * int(together.sum())
