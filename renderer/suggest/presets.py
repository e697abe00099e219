"""Presets: the layers of values and the colours that suit a kind of data, one function for each kind.

Values are normalised to the volume's range, as in `renderer.suggest.features`. `renderer.suggest.opacity_calibration`
finds how dense the layers are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from renderer.scene import Color, ShadingSpec, colormap_points
from renderer.suggest.classes import material_edges, otsu_threshold, top_value
from renderer.suggest.features import VoxelSample
from renderer.suggest.opacity_calibration import CRISP_SURFACE_DEPTH, Layer
from renderer.suggest.palette import FIELD_COLORMAP, FIELD_DARKEST
from renderer.suggest.separation import are_deep
from renderer.volume import Bools, Float64

T = TypeVar("T")

# Mean opacities of the rays that meet anything: of scans, of shells in a field, and of a single opaque surface.
_COVERAGE, _SHELL_COVERAGE, _GLOW_COVERAGE, OPAQUE_COVERAGE = 0.94, 0.8, 0.65, 0.97

# Ambient light, which occlusion dims, shows surfaces that face away from the lamp, too. The lamp is above and in front,
# on the side that a turntable shows first.
SHADING = ShadingSpec(ambient=0.7, diffuse=0.55, light=(0.5, -0.8, 1.0), occlusion=0.8)


@dataclass(frozen=True)
class Preset:
    """A set of layers and colours for a kind of data.

    layers: their sum is the extinction. colors: (normalised value, colour), ascending; linear between. coverage: the
        mean opacity of the rays that meet anything. is_scan: of an object, perhaps with a table or the like around it.
        is_closed: the object's outside hides its inside, so that a corner is clipped.
    """

    layers: tuple[Layer, ...]
    colors: tuple[tuple[float, Color], ...]
    coverage: float = _COVERAGE
    shading: ShadingSpec | None = SHADING
    is_scan: bool = False
    is_closed: bool = False

    def covers(self, values: Float64) -> Bools:
        """Return which normalised values are parts of a layer, and not edges."""
        return np.asarray(np.any([layer.covers(values) for layer in self.layers], axis=0))

    def with_inverted_range(self) -> Preset:
        """Return the preset for values with the range inverted."""
        layers = tuple(
            replace(layer, knots=tuple((1 - at, weight) for at, weight in reversed(layer.knots)))
            for layer in self.layers
        )
        colors = tuple((1 - at, color) for at, color in reversed(self.colors))
        shading = None if self.shading is None else flip_light(self.shading)
        return replace(self, layers=layers, colors=colors, shading=shading)


class Choice(NamedTuple):
    """A preset that was chosen. kind: of the data. reason: the signs by which it was recognised, a clause."""

    kind: str
    reason: str
    preset: Preset


def flip_light(shading: ShadingSpec) -> ShadingSpec:
    """Return the light for surfaces with lower values inside, where gradients point the other way."""
    if isinstance(shading.light, str):
        return shading
    x, y, z = shading.light
    return replace(shading, light=(-x, -y, -z))


# Computed tomography, in Hounsfield units: translucent soft tissue around opaque bone, without lungs and air.

_TISSUE = ((-300.0, 0.0), (-100.0, 0.5), (30.0, 1.0), (140.0, 1.0), (300.0, 0.0))
_BONE = ((150.0, 0.0), (350.0, 0.6), (900.0, 1.0))
_CT_COLORS = (
    (-300.0, (0.78, 0.52, 0.36)),
    (-100.0, (0.90, 0.68, 0.46)),
    (30.0, (0.78, 0.36, 0.28)),
    (140.0, (0.85, 0.42, 0.30)),
    (300.0, (0.96, 0.87, 0.70)),
    (900.0, (1.0, 0.98, 0.94)),
)
_BONE_THRESHOLD = 250.0
# A scan has bone, metal or a contrast agent if at least this part of its voxels is so dense.
_MIN_BONE_FRACTION = 3e-4


def ct_preset(sample: VoxelSample, zero: float) -> Preset:
    """Return the preset of a CT scan; `zero` is the stored value of 0 Hounsfield units."""
    has_bone = float(np.mean(sample.normalized > sample.normalize(_BONE_THRESHOLD + zero))) > _MIN_BONE_FRACTION

    def normalized(points: Iterable[tuple[float, T]]) -> tuple[tuple[float, T], ...]:
        return tuple((sample.normalize(hounsfield + zero), each) for hounsfield, each in points)

    tissue = Layer("soft tissue", normalized(_TISSUE), share=0.3)
    bone = Layer("bone", normalized(_BONE), share=0.7)
    return Preset((tissue, bone) if has_bone else (tissue,), normalized(_CT_COLORS), is_scan=True)


# Scans: materials that stand out from a background.

_BLUE, _CLAY, _SAND = (0.36, 0.50, 0.86), (0.80, 0.47, 0.34), (0.91, 0.68, 0.42)
_IVORY, STONE = (0.98, 0.95, 0.88), (0.86, 0.83, 0.76)
# By the number of materials, from the thinnest to the densest: names, colours, and shares of the picture.
_MATERIALS: dict[int, tuple[tuple[str, Color, float], ...]] = {
    1: (("the object", STONE, 1.0),),
    2: (("the thinner material", _CLAY, 0.4), ("the denser material", _IVORY, 0.6)),
    3: (
        ("the thinnest material", _BLUE, 0.25),
        ("the middle material", _SAND, 0.35),
        ("the densest material", _IVORY, 0.4),
    ),
}
# A material begins to show at the end of the one below it and is in full from this part of its range on.
RAMP = 0.35


def materials_preset(sample: VoxelSample, first: float) -> Preset:
    """Return the preset of one to three materials, which begin at a normalised value."""
    ends = material_edges(sample, first)
    if _is_closed(sample, ends):
        return _closed_preset(sample, ends)
    ranges = list(pairwise(ends))
    full = [low + RAMP * (high - low) for low, high in ranges]
    layers, colors = [], []
    for k, (name, color, share) in enumerate(_MATERIALS[len(ranges)]):
        low, high = ranges[k]
        above = [(high, 1.0), (full[k + 1], 0.0)] if k + 1 < len(ranges) else []
        layers.append(Layer(name, ((low, 0.0), (full[k], 1.0), *above), share))
        colors += [(at, color) for at, _ in (layers[-1].knots[1], *above[:1])]
    coverage = OPAQUE_COVERAGE if len(ranges) == 1 else _COVERAGE
    return Preset(tuple(layers), tuple(colors), coverage, is_scan=True)


# A closed object: solid, with its densest material outside, such as fat around a head in magnetic resonance. What it
# hides has the same values as the rest, so that no opacity shows it.

# At least these parts of what is visible, and of the innermost material, lie deep inside; of the densest material, at
# most one half of the latter. Brains have 0.29 to 0.41, but no denser material outside; a pot with a tree has 0.24.
_MIN_SOLID, _MIN_INNER, _MIN_INNER_RATIO = 0.27, 0.35, 2.0
_CLIP_COLORS = ((0.28, 0.15, 0.13), (0.74, 0.50, 0.41), (0.98, 0.86, 0.74), (1.0, 1.0, 0.97))
# Most of the light is ambient, so that no face of the clip box is much darker than another.
_CLIP_SHADING = replace(SHADING, ambient=0.9, diffuse=0.3, occlusion=0.6)


def _is_closed(sample: VoxelSample, ends: Sequence[float]) -> bool:
    values = sample.normalized
    deep = are_deep(sample, values > ends[0])

    def part_inside(low: float, high: float) -> float:
        chosen = (values >= low) & (values < high)
        return float(deep[chosen].mean()) if chosen.any() else 0.0

    *others, densest = (part_inside(*pair) for pair in pairwise((*ends[:-1], math.inf)))
    inner = max(others, default=0.0)
    return part_inside(ends[0], math.inf) >= _MIN_SOLID and inner >= max(_MIN_INNER, _MIN_INNER_RATIO * densest)


def _closed_preset(sample: VoxelSample, ends: Sequence[float]) -> Preset:
    first, *between, last, top = ends
    second = between[0] if between else otsu_threshold(sample.normalized, first, last) or (first + last) / 2
    layer = Layer("the object", ((first, 0.0), (second, 1.0)), min_depth=3.0)
    colors = tuple(zip((first, second, last, top), _CLIP_COLORS, strict=True))
    return Preset((layer,), colors, OPAQUE_COVERAGE, _CLIP_SHADING, is_scan=True, is_closed=True)


# Fields: no materials, but values that rise from the background to a peak. Thin shells show them at some levels.

_NUM_SHELLS = 4
# The lowest shell lies at this part of the way to the second. Shells are as wide as this part of their distance, but
# not so narrow that steps of 8 bits show.
_FIRST_SHELL, _SHELL_WIDTH, _MIN_SHELL_WIDTH = 0.6, 0.36, 0.012
# Shells are thin, and so dense; from 40 on they look the same, but a frame takes up to 1.4 times as long.
_MAX_SHELL_DEPTH = 12.0
# Surfaces that a ray crosses more often than this hide all others.
_MAX_CROSSINGS = 3.0
# A level inside another is crossed at most this part as often.
_MAX_NESTED_RATIO = 0.85
# Up to twice this tail ratio, levels are at even steps.
_SHORT_TAIL = 4.0


def has_nested_levels(sample: VoxelSample, first: float) -> bool:
    """Return whether the levels above `first` lie inside one another, as in a smooth field: the higher, the smaller.

    The levels of a material are all at its surface.
    """
    top = top_value(sample)
    found = [_crossings(sample, first + (top - first) * part) for part in (0.15, 0.4, 0.65, 0.9)]
    return found[0] < _MAX_CROSSINGS and all(high < _MAX_NESTED_RATIO * low for low, high in pairwise(found))


def _crossings(sample: VoxelSample, level: float) -> float:
    """Return how often a ray through the volume crosses a level, in the mean."""
    changes = (sample.neighbours > level) != (sample.normalized > level)
    num_y, num_x = (n * stride for n, stride in zip(sample.normalized.shape[1:], sample.strides[1:], strict=True))
    return float(changes[:2].mean() * num_x + changes[2:].mean() * num_y) / 2


def field_preset(sample: VoxelSample, first: float, *, origin: float) -> Preset:
    """Return the preset of a field that rises from `first` on; ratios are counted from `origin`."""
    levels = origin + _shell_levels(sample.normalized - origin, first - origin, _NUM_SHELLS)
    palette = colormap_points(FIELD_COLORMAP, 256)
    colors = [palette[int(255 * at)] for at in np.linspace(FIELD_DARKEST, 1.0, _NUM_SHELLS)]
    return _shells_preset(sample, [(level,) for level in zip(levels.tolist(), colors, strict=True)])


def _shell_levels(distances: Float64, first: float, num: int) -> Float64:
    """Return levels from a first distance to the largest ones.

    They are at even steps of the distances, or nearly of their logarithms where few are much larger than the others.
    """
    visible = distances[distances > first]
    top = max(float(np.percentile(visible, 99.8)) if visible.size else 1.0, first * 1.01 + 1e-6)
    power = 1 / max(1.0, math.log2(tail_ratio(visible) / _SHORT_TAIL))
    low, high = max(first, top * 1e-6) ** power, top**power
    steps = (np.arange(num) + _FIRST_SHELL) / num
    return np.asarray((low + (high - low) * steps) ** (1 / power))


# From the middle outwards.
_NEGATIVE = ((0.62, 0.84, 1.0), (0.34, 0.62, 0.98), (0.16, 0.42, 0.92))
_POSITIVE = ((1.0, 0.80, 0.62), (0.98, 0.52, 0.34), (0.90, 0.25, 0.16))


def diverging_preset(sample: VoxelSample, middle: float, dead_zone: float) -> Preset:
    """Return the preset of values on both sides of `middle`, blue below and red above, transparent within
    `dead_zone` of it."""
    away = _shell_levels(np.abs(sample.normalized - middle), dead_zone, len(_POSITIVE))
    pairs = zip(away.tolist(), _NEGATIVE, _POSITIVE, strict=True)
    return _shells_preset(sample, [((middle - at, blue), (middle + at, red)) for at, blue, red in pairs])


def _shells_preset(sample: VoxelSample, shells: Sequence[tuple[tuple[float, Color], ...]]) -> Preset:
    """Return the preset of thin shells, each at one or two (normalised value, colour), which are equally dense."""
    found = [shell for shell in shells if 0 < max(_crossings(sample, at) for at, _ in shell) < _MAX_CROSSINGS]
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
    """Return the preset of a field that gets denser from the first to the last shell, each as in `_shells_preset`."""
    weights = np.linspace(0.0, 1.0, len(shells)) ** 2
    knots = sorted((at, weight) for shell, weight in zip(shells, weights.tolist(), strict=True) for at, _ in shell)
    colors = sorted(level for shell in shells for level in shell)
    return Preset((Layer("the strong values", tuple(knots)),), tuple(colors), _GLOW_COVERAGE, None)


def tail_ratio(distances: Float64) -> float:
    """Return the largest of positive distances, without outliers, divided by their median."""
    return float(np.percentile(distances, 99.8)) / float(np.median(distances)) if distances.size else 1.0


def two_phase_preset(sample: VoxelSample, threshold: float) -> Preset:
    """Return the preset of the upper of two phases that fill the volume."""
    inside, extent = sample.normalized[sample.normalized >= threshold], 1 - threshold
    full = float(np.clip(np.median(inside), threshold + 0.05 * extent, 1 - 0.05 * extent))
    return opaque_preset("the upper phase", threshold, full)


def opaque_preset(name: str, first: float, full: float, color: Color = STONE, *, is_scan: bool = False) -> Preset:
    """Return the preset of one material, opaque: it begins at a normalised value and is in full from another one on."""
    layer = Layer(name, ((first, 0.0), (max(full, first + 1e-6), 1.0)), min_depth=CRISP_SURFACE_DEPTH)
    return Preset((layer,), ((first, color),), OPAQUE_COVERAGE, is_scan=is_scan)
