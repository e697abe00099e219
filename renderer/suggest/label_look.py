"""Suggest how to show a volume of labels: a colour for each label, and translucent labels around others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from renderer.scene import Color, LabelsSpec, TransferSpec, counted, join_some
from renderer.statistics import (
    SAME,
    KnownLabels,
    VoxelSample,
    border_mode,
    count_labels,
    format_number,
    is_piecewise_constant,
)
from renderer.suggest.layer import Layer
from renderer.suggest.opacity import opacity_from_depth, opacity_unit_length
from renderer.suggest.opacity_calibration import solve_depths
from renderer.suggest.palette import colors_by_label
from renderer.suggest.presets import OPAQUE_COVERAGE, SHADING, STONE
from renderer.suggest.suggestion import ShownLayer, Suggestion
from renderer.suggest.turntable_rays import TurntableRays, cast_rays
from renderer.volume import Bools, Float64, Volume

# The light on labels. It has no occlusion, because occlusion is computed for whole voxels and would show the stairs in
# a label's surface.
_SHADING = replace(SHADING, ambient=0.45, diffuse=0.6, occlusion=0.0)
# The least optical depth, along 1 % of the volume's diagonal, of a label that does not enclose others. With it, the
# label's surface looks solid.
_SOLID_DEPTH = 6.0
# The densities of up to this many labels are solved one by one; more labels all have the same density.
_MAX_SOLVED = 10
# A label encloses others if, along each axis, its projection covers more than this share of the projections of all
# smaller labels.
_ENCLOSING_COVERAGE = 0.85
# The share of the picture that an enclosing label gets, compared with a label that does not enclose others.
_ENCLOSING_SHARE = 0.4


def _background_label(sample: VoxelSample, values: Sequence[float]) -> float | None:
    """Return the most frequent label at the volume's border; None if voxels without data are more frequent there."""
    mode = border_mode(sample)
    at_border = sample.denormalize(mode)
    nearest = min(values, key=lambda value: abs(value / 2 - at_border / 2))
    return nearest if abs(sample.normalize(nearest) - mode) <= SAME else None


def label_suggestion(volume: Volume, sample: VoxelSample, values: Sequence[float], known: KnownLabels) -> Suggestion:
    """Return the suggestion for labels: each label except the background has a colour and an opacity.

    The background is the most frequent label at the volume's border, if voxels have data there. A table of labels
    applies as in a scene: it gives names and colours, and says which labels are hidden or translucent. known: the
    labels of all steps in time, and their table.
    """
    voxels = count_labels(volume)
    outside = _background_label(sample, values)
    pieces = ", in separate pieces" if is_piecewise_constant(sample) else ""
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
    transfer = TransferSpec(_labels_with_table(solved, known), opacity_unit_length(sample.diagonal))
    kind = "mask" if len(present) == 1 else "labels"
    notes = _hidden_note(hidden, known) if hidden else ()
    return Suggestion(kind, reason, transfer, (), _SHADING, outlier_notes=notes, visible=visible)


def _labels_with_table(solved: Mapping[int, float], known: KnownLabels) -> LabelsSpec:
    """Return the labels that are shown, with the colours, names and translucency that a table gives them.

    solved: the opacity of each label that is shown.
    """
    given = {value: label.opacity for value, label in known.table.items() if label.opacity and label.opacity < 1}
    in_table = {value: label.color for value, label in known.table.items() if label.color is not None}
    alone = dict.fromkeys(solved, STONE) if len(solved) == 1 else {}
    return labels_with_looks(
        {value: given.get(value, opacity) for value, opacity in solved.items()},
        colors_by_label(solved) | alone | in_table,
        known.names,
    )


def labels_with_looks(
    opacities: Mapping[int, float], colors: Mapping[int, Color], names: Mapping[int, str]
) -> LabelsSpec:
    """Return a scene's labels, with colours, opacities and names: the labels that `opacities` has, in that order.

    colors: the colour of each label; names: the names of some labels. Labels without an opacity are ignored.
    """
    named = tuple((value, names[value]) for value in opacities if value in names)
    different = {*opacities.values()}
    return LabelsSpec(
        colors=tuple((value, colors[value]) for value in opacities),
        opacity=different.pop() if len(different) == 1 else tuple(opacities.items()),
        show=tuple(opacities),
        names=named or None,
    )


def _hidden_note(hidden: Sequence[int], known: KnownLabels) -> tuple[str, ...]:
    """Return a note that names the labels that a table of labels hides."""
    names = join_some([known.names.get(value, f"label {value}") for value in hidden])
    return (f"the table of labels hides {names}",)


def number_sample(sample: VoxelSample, shown: Sequence[int]) -> VoxelSample:
    """Return a sample in which the shown labels, ascending, have the numbers 1, 2, ... and all others have 0."""
    at = np.array([sample.normalize(value) for value in shown])
    number = np.minimum(np.searchsorted(at, sample.normalized - SAME), len(at) - 1)
    numbers = np.where(np.abs(at[number] - sample.normalized) <= SAME, number + 1, 0)
    return replace(sample, normalized=numbers / len(at), minimum=0.0, maximum=float(len(at)), is_interpolated=False)


def _solve_label_depths(sample: VoxelSample, rays: TurntableRays, num: int) -> Float64:
    """Return the optical depth of each label along 1 % of the volume's diagonal, float64 [num].

    sample: a sample of the labels' numbers, from `number_sample`. num: the number of labels.
    """
    first = 0.5 / num
    all_alike = Layer("", ((first, 0.0), (first, 1.0)), min_depth=_SOLID_DEPTH)
    layers = _layers(sample, num) if num <= _MAX_SOLVED else [all_alike]
    return np.resize(solve_depths(rays, layers, OPAQUE_COVERAGE), num)


def _visible_shares(rays: TurntableRays, depths: Float64) -> Float64:
    """Return each label's share of the picture.

    rays: rays through the sample of the labels' numbers. depths: each label's optical depth, along 1 % of the diagonal.
    """
    number = np.rint(np.nan_to_num(rays.values) * len(depths)).astype(np.int64)
    taken = 100 * rays.step * np.append(0.0, depths)[number]
    visible = np.exp(taken - np.cumsum(taken, axis=1)) * -np.expm1(-taken)
    shares = np.bincount(number.ravel(), visible.ravel(), len(depths) + 1)[1:]
    return np.asarray(shares / max(float(shares.sum()), 1e-12))


def _layers(sample: VoxelSample, num: int) -> list[Layer]:
    """Return a layer for each label: opaque, or translucent if it encloses smaller labels.

    sample: a sample of the labels' numbers.
    """
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
    """Return whether a label's projection, `shadow`, covers most of the union of other labels' projections."""
    together = np.any(others, axis=0)
    return int((shadow & together).sum()) > _ENCLOSING_COVERAGE * int(together.sum())
