"""Choose layers and colours for fields: thin shells at some values, or a glow that is denser at higher values.

A field has no materials: its values rise smoothly from the background to a peak.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from renderer.scene import Color, colormap_points
from renderer.statistics import MAX_CROSSINGS, VoxelSample, crossings, tail_ratio
from renderer.suggest.layer import Layer
from renderer.suggest.palette import FIELD_COLORMAP, FIELD_ENDS
from renderer.suggest.presets import SHADING, Preset
from renderer.volume import Float64

# Opacities of shells are solved so that the rays that meet any shell have this mean opacity.
_SHELL_COVERAGE = 0.8
# Opacities of a glow are solved so that the rays that meet anything have this mean opacity.
_GLOW_COVERAGE = 0.65
# The number of shells of a field with one sign.
_NUM_SHELLS = 4
# The distance of the lowest shell from the value at which the field begins, as a part of the distance between two
# neighbouring shells, in values.
_FIRST_SHELL = 0.6
# The width of a shell in values, as a part of the distance between two neighbouring shells.
_SHELL_WIDTH = 0.36
# The smallest width of a shell, as a part of the volume's range of values. In narrower shells, the steps of 8-bit
# values would show.
_MIN_SHELL_WIDTH = 0.012
# The largest optical depth of a shell, along 1 % of the volume's diagonal. Shells are thin, and therefore dense. With a
# bound of 40, pictures look the same, but a frame takes up to 1.4 times as long.
_MAX_SHELL_DEPTH = 12.0
# The shells of a field are at even steps of its values if the largest values are at most twice this number times the
# median; otherwise, shells at low values are closer together.
_SHORT_TAIL = 4.0


def field_preset(sample: VoxelSample, first: float, *, origin: float) -> Preset:
    """Return the preset that shows a field as thin shells, or as a glow.

    first: the normalised value above which the field is shown. origin: the normalised value from which other values'
    distances are measured; if few distances are much larger than the others, shells are at even ratios of distances.
    """
    levels = origin + _shell_levels(sample.normalized - origin, first - origin, _NUM_SHELLS)
    palette = colormap_points(FIELD_COLORMAP, 256)
    colors = [palette[int(255 * at)] for at in np.linspace(*FIELD_ENDS, _NUM_SHELLS)]
    return _shells_preset(sample, [(level,) for level in zip(levels.tolist(), colors, strict=True)])


def _shell_levels(distances: Float64, first: float, num: int) -> Float64:
    """Return the distances of `num` shells from the origin of a field, between `first` and the largest distance.

    distances: the distances of all values from the origin. Shells are at even steps of the distance. If few distances
    are much larger than the others, shells are nearly at even steps of the distance's logarithm.
    """
    visible = distances[distances > first]
    top = max(float(np.percentile(visible, 99.8)) if visible.size else 1.0, first * 1.01 + 1e-6)
    power = 1 / max(1.0, math.log2(tail_ratio(visible) / _SHORT_TAIL))
    low, high = max(first, top * 1e-6) ** power, top**power
    steps = (np.arange(num) + _FIRST_SHELL) / num
    return np.asarray((low + (high - low) * steps) ** (1 / power))


# The colours of the shells below the middle of a field with two signs, from the middle outwards.
_NEGATIVE = ((0.62, 0.84, 1.0), (0.34, 0.62, 0.98), (0.16, 0.42, 0.92))
# The colours of the shells above the middle of a field with two signs, from the middle outwards.
_POSITIVE = ((1.0, 0.80, 0.62), (0.98, 0.52, 0.34), (0.90, 0.25, 0.16))


def diverging_preset(sample: VoxelSample, middle: float, dead_zone: float) -> Preset:
    """Return the preset of a field with two signs: blue shells below the value `middle`, and red shells above it.

    Values whose distance from the middle is less than `dead_zone` are transparent. Both are normalised.
    """
    away = _shell_levels(np.abs(sample.normalized - middle), dead_zone, len(_POSITIVE))
    pairs = zip(away.tolist(), _NEGATIVE, _POSITIVE, strict=True)
    return _shells_preset(sample, [((middle - at, blue), (middle + at, red)) for at, blue, red in pairs])


def _shells_preset(sample: VoxelSample, shells: Sequence[tuple[tuple[float, Color], ...]]) -> Preset:
    """Return the preset of thin shells, each with an equal share of the picture.

    shells: for each shell, one or two pairs (normalised value, colour). A shell that no ray crosses, or that rays cross
    too often, is left out; if fewer than two shells remain, the preset is a glow.
    """
    found = [shell for shell in shells if 0 < max(crossings(sample, at) for at, _ in shell) < MAX_CROSSINGS]
    if len(found) < 2:
        return glow_preset(shells)
    gap = min(abs(other[0][0] - one[0][0]) for one, other in pairwise(shells))
    width = max(_SHELL_WIDTH * gap, min(_MIN_SHELL_WIDTH, 0.9 * gap)) / 2
    layers, colors = [], []
    for shell in found:
        knots = [(at + step * width, 1.0 - abs(step)) for at, _ in sorted(shell) for step in (-1, 0, 1)]
        layers.append(Layer("a shell" if len(shell) == 1 else "two shells", tuple(knots), max_depth=_MAX_SHELL_DEPTH))
        colors += [(at + step * width, color) for at, color in shell for step in (-1, 1)]
    return Preset(tuple(layers), tuple(sorted(colors)), _SHELL_COVERAGE, replace(SHADING, two_sided=True))


def glow_preset(shells: Sequence[tuple[tuple[float, Color], ...]]) -> Preset:
    """Return the preset of a glow: matter that gets denser from the first to the last level of a field.

    shells: for each level, one or two pairs (normalised value, colour).
    """
    weights = np.linspace(0.0, 1.0, len(shells)) ** 2
    knots = sorted((at, weight) for shell, weight in zip(shells, weights.tolist(), strict=True) for at, _ in shell)
    colors = sorted(level for shell in shells for level in shell)
    return Preset((Layer("the strong values", tuple(knots)),), tuple(colors), _GLOW_COVERAGE, None)
