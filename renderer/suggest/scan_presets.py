"""Choose layers and colours for scans: computed tomography, several materials, and closed objects."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from renderer.scene import Color
from renderer.statistics import VoxelSample, are_deep, material_edges, otsu_threshold
from renderer.suggest.layer import Layer
from renderer.suggest.presets import DEFAULT_COVERAGE, OPAQUE_COVERAGE, RAMP, SHADING, STONE, Preset

T = TypeVar("T")

# The weights of soft tissue and bone in computed tomography, and the colours, at values in Hounsfield units:
# translucent soft tissue is shown around opaque bone; lungs and air are not shown.

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
# The least value of bone, metal and contrast agents, in Hounsfield units.
_BONE_THRESHOLD = 250.0
# A scan has bone if more than this share of its voxels are bone, metal or contrast agents.
_MIN_BONE_FRACTION = 3e-4


def ct_preset(sample: VoxelSample, zero: float) -> Preset:
    """Return the preset of a CT scan; `zero` is the stored value of 0 Hounsfield units."""
    has_bone = float(np.mean(sample.normalized > sample.normalize(_BONE_THRESHOLD + zero))) > _MIN_BONE_FRACTION

    def normalized(points: Iterable[tuple[float, T]]) -> tuple[tuple[float, T], ...]:
        return tuple((sample.normalize(hounsfield + zero), each) for hounsfield, each in points)

    tissue = Layer("soft tissue", normalized(_TISSUE), share=0.3)
    bone = Layer("bone", normalized(_BONE), share=0.7)
    return Preset((tissue, bone) if has_bone else (tissue,), normalized(_CT_COLORS), is_scan=True)


# The colours of scans without Hounsfield units, whose materials stand out from a background.

# Thin matter around an object, such as leaves, skin and noise: a neutral colour, as a saturated one looks like smoke.
_MIST = (0.70, 0.72, 0.74)
# Soft matter, shells, pots and casings: a colour between that of wood and that of flesh, which suits all of them.
_TAN = (0.76, 0.57, 0.45)
_IVORY = (0.97, 0.94, 0.88)
# For scans of one, two and three materials: each material's name, colour, and share of the picture, from the thinnest
# material to the densest.
_MATERIALS: dict[int, tuple[tuple[str, Color, float], ...]] = {
    1: (("the object", STONE, 1.0),),
    2: (("the thinner material", _TAN, 0.4), ("the denser material", _IVORY, 0.6)),
    3: (
        ("the thinnest material", _MIST, 0.15),
        ("the middle material", _TAN, 0.35),
        ("the densest material", _IVORY, 0.4),
    ),
}


def materials_preset(sample: VoxelSample, first: float) -> Preset:
    """Return the preset of one to three materials, the first of which begins at the normalised value `first`."""
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
    coverage = OPAQUE_COVERAGE if len(ranges) == 1 else DEFAULT_COVERAGE
    return Preset(tuple(layers), tuple(colors), coverage, is_scan=True)


# A closed object is solid, with its densest material outside, such as fat around a head in magnetic resonance. The
# hidden inside has the same values as the outside, so that no opacity can show it.

# An object is closed only if at least this share of its visible voxels lies deep inside. Brains have 0.29 to 0.41, but
# no denser material outside; a pot with a tree has 0.24.
_MIN_SOLID = 0.27
# An object is closed only if it has an inner material: at least this share of the material's voxels lies deep inside.
_MIN_INNER = 0.35
# An object is closed only if the share of voxels that lie deep inside is at least this many times as large for its
# inner material as for its densest material, which lies outside.
_MIN_INNER_RATIO = 2.0
# The colours of a closed object at four values: where the object begins, at its second material, at its densest
# material, and at the largest value.
_CLIP_COLORS = ((0.34, 0.22, 0.19), (0.82, 0.64, 0.55), (0.96, 0.87, 0.79), (1.0, 0.99, 0.96))
# The light on a closed object, which a box cuts open. Most of the light is ambient, so that all faces of the cut are
# about equally bright.
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
