"""Describe a preset: the layers of values and the colours that suit a kind of data.

Values are normalised to the volume's range, as in `renderer.statistics.VoxelSample`. A preset does not say how dense
its layers are: `opacity_calibration.py` solves this.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from renderer.scene import Color, ShadingSpec
from renderer.statistics import VoxelSample
from renderer.suggest.layer import Layer
from renderer.suggest.opacity_calibration import CRISP_SURFACE_DEPTH
from renderer.volume import Bools, Float64

# Opacities of a scan are solved so that the rays that meet anything have this mean opacity.
DEFAULT_COVERAGE = 0.94
# The opacity of a single opaque surface is solved so that the rays that meet the surface have this mean opacity.
OPAQUE_COVERAGE = 0.97

# The light on surfaces. Occlusion dims the ambient light, so that surfaces facing away from the lamp have contrast,
# too. The lamp is above and in front, on the side that a turntable shows first.
SHADING = ShadingSpec(ambient=0.7, diffuse=0.55, light=(0.5, -0.8, 1.0), occlusion=0.8)

# The colour of an object of a single material.
STONE = (0.86, 0.83, 0.76)
# The weight of a material rises from 0 at the lowest value of its range to 1 at this part of the range.
RAMP = 0.35


@dataclass(frozen=True)
class Preset:
    """A preset: the layers, colours and light that suit a kind of data.

    layers: the layers, whose sum is the extinction.
    colors: pairs (normalised value, colour), ascending; colours are linear between them.
    coverage: the mean opacity that the rays that meet anything are to have.
    shading: the light on surfaces; None for data without surfaces.
    is_scan: whether the data are a scan of an object, perhaps with a table or the like around it.
    is_closed: whether the object's outside hides its inside, so that a corner is clipped.
    """

    layers: tuple[Layer, ...]
    colors: tuple[tuple[float, Color], ...]
    coverage: float = DEFAULT_COVERAGE
    shading: ShadingSpec | None = SHADING
    is_scan: bool = False
    is_closed: bool = False

    def covers(self, values: Float64) -> Bools:
        """Return which normalised values are parts of a layer, and not of edges between layers."""
        return np.asarray(np.any([layer.covers(values) for layer in self.layers], axis=0))

    def with_inverted_range(self) -> Preset:
        """Return the preset for inverted values: a normalised value v looks as 1 - v does in this preset."""
        layers = tuple(
            replace(layer, knots=tuple((1 - at, weight) for at, weight in reversed(layer.knots)))
            for layer in self.layers
        )
        colors = tuple((1 - at, color) for at, color in reversed(self.colors))
        shading = None if self.shading is None else flip_light(self.shading)
        return replace(self, layers=layers, colors=colors, shading=shading)


class Choice(NamedTuple):
    """A preset that was chosen for a volume.

    kind: the kind of the volume's data.
    reason: the signs by which this kind was recognised, a clause.
    preset: the preset.
    """

    kind: str
    reason: str
    preset: Preset


def flip_light(shading: ShadingSpec) -> ShadingSpec:
    """Return the light for objects darker than their surroundings, with its direction reversed, as their gradients are.

    A light whose direction is a word, such as the camera's, stays.
    """
    if isinstance(shading.light, str):
        return shading
    x, y, z = shading.light
    return replace(shading, light=(-x, -y, -z))


def two_phase_preset(sample: VoxelSample, threshold: float) -> Preset:
    """Return the preset for a volume that two phases fill, such as stone and pores. It shows the upper phase.

    threshold: the lowest normalised value of the upper phase.
    """
    inside, extent = sample.normalized[sample.normalized >= threshold], 1 - threshold
    full = float(np.clip(np.median(inside), threshold + 0.05 * extent, 1 - 0.05 * extent))
    return opaque_preset("the upper phase", threshold, full)


def opaque_preset(name: str, first: float, full: float, color: Color = STONE, *, is_scan: bool = False) -> Preset:
    """Return the preset of one opaque material, whose weight rises from 0 at the value `first` to 1 at `full`."""
    layer = Layer(name, ((first, 0.0), (max(full, first + 1e-6), 1.0)), min_depth=CRISP_SURFACE_DEPTH)
    return Preset((layer,), ((first, color),), OPAQUE_COVERAGE, is_scan=is_scan)
