"""Turn a preset into control points: solve its densities for a volume, and note each layer's share of the picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from operator import itemgetter

import numpy as np

from renderer.scene import ControlPoint, TransferSpec
from renderer.statistics import VoxelSample, format_percent
from renderer.suggest.opacity import opacity_from_depth, opacity_unit_length
from renderer.suggest.opacity_calibration import measure_visibility, solve_depths
from renderer.suggest.presets import Choice, Preset
from renderer.suggest.separation import Plane, clip_specs, corner_box
from renderer.suggest.suggestion import ShownLayer, Suggestion
from renderer.suggest.turntable_rays import cast_rays
from renderer.volume import Float64


def preset_suggestion(choice: Choice, sample: VoxelSample, planes: Sequence[Plane]) -> Suggestion:
    """Return a volume's suggestion from a preset: control points whose opacities are solved for the volume.

    sample: a sample of the volume without the voxels that `planes` clip away.
    """
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
    """Return the control points of a preset, and a note for each: which layer has its largest weight there, if any.

    There is a point at each value where a layer's weight or the colour changes its slope. solved: the optical depths of
    the layers, from `solve_depths`. visible: each layer's share of the picture.
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
    # All values below the first point look as it does, so another point makes them transparent.
    if found[0][0].opacity > 0 and not any(layer.knots[0][1] for layer in preset.layers):
        found.insert(0, (replace(found[0][0], opacity=0.0), ""))
    mapping, notes = zip(*found, strict=True)
    return mapping, notes


def _shown_layers(sample: VoxelSample, preset: Preset, shares: Float64) -> tuple[ShownLayer, ...]:
    """Return the values that each layer of a preset shows, with the layer's share of the picture."""

    def in_data(low: float, high: float) -> tuple[float, float]:
        one, other = sorted(sample.round_value(sample.denormalize(min(max(end, 0.0), 1.0))) for end in (low, high))
        return one, other

    found, total = [], sum(layer.share for layer in preset.layers)
    for layer, share in zip(preset.layers, shares.tolist(), strict=True):
        voxels = float(np.mean(layer.covers(sample.normalized)))
        ranges = tuple(in_data(*ends) for ends in layer.ranges())
        found.append(ShownLayer(layer.name, ranges, voxels, share, layer.share / total))
    return tuple(found)
