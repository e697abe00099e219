"""Presets: the layers of values and the colours that suit a kind of data, one function for each kind.

Values are normalised to the volume's range, as in `renderer.suggest.features`. `renderer.suggest.opacity` finds how
dense the layers are.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from renderer.scene import Color, ShadingSpec, colormap_points
from renderer.suggest.features import Background, VoxelSample, coherence, otsu_threshold
from renderer.suggest.opacity import Layer, covered_ray_fraction
from renderer.volume import Float64

T = TypeVar("T")

# Mean opacities of the rays through a layer: a faint one, a translucent one, an opaque one, and a field that is dense
# in some places and thin in others.
FAINT_COVERAGE, TRANSLUCENT_COVERAGE, OPAQUE_COVERAGE, _FIELD_COVERAGE = 0.25, 0.5, 0.85, 0.65
# A surface looks crisp from this optical depth for 1% of the diagonal.
CRISP_SURFACE_DEPTH = 0.8

# Colours of a scan's layers, from the thinnest to the densest material.
_VEIL_COLOR, _GLASS_COLOR, _CORE_COLOR = (0.30, 0.48, 0.75), (0.95, 0.62, 0.38), (1.0, 0.93, 0.80)
_HULL_COLOR, _FLESH_COLOR = (0.46, 0.58, 0.92), (0.80, 0.62, 0.54)

# The lowest part of this colormap is too dark to be seen on black, so smooth fields begin above it.
_FIELD_COLORMAP, _DARKEST = "inferno", 0.3
_NUM_STEPS = 8

_NEGATIVE, _POSITIVE = ((0.16, 0.40, 0.92), (0.62, 0.87, 1.0)), ((0.90, 0.25, 0.16), (1.0, 0.85, 0.55))


# Half of the light is ambient, so that surfaces that face away from the lamp stay visible. The lamp is above and in
# front, on the side that a turntable shows first. Fields with two signs get less directed light.
SHADING = ShadingSpec(ambient=0.5, diffuse=0.6, light=(0.5, -0.8, 1.0))
_FAINT_SHADING = replace(SHADING, ambient=0.75, diffuse=0.35)


@dataclass(frozen=True)
class Preset:
    """A set of layers and colours for a kind of data.

    layers: their sum is the extinction. colors: (normalised value, colour), ascending; linear between. shading: None
        where the data have no surfaces.
    """

    layers: tuple[Layer, ...]
    colors: tuple[tuple[float, Color], ...]
    shading: ShadingSpec | None = SHADING

    def with_inverted_range(self) -> Preset:
        """Return the preset for values with the range inverted."""
        layers = tuple(
            replace(layer, knots=tuple((1 - at, weight) for at, weight in reversed(layer.knots)))
            for layer in self.layers
        )
        colors = tuple((1 - at, color) for at, color in reversed(self.colors))
        return Preset(layers, colors, None if self.shading is None else flip_light(self.shading))


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

    tissue = Layer("soft tissue", normalized(_TISSUE), TRANSLUCENT_COVERAGE if has_bone else OPAQUE_COVERAGE)
    bone = Layer("bone", normalized(_BONE), OPAQUE_COVERAGE, CRISP_SURFACE_DEPTH)
    return Preset((tissue, bone) if has_bone else (tissue,), normalized(_CT_COLORS))


# Scans: materials that stand out from a background.

# Values above this percentile are outliers.
_TOP_PERCENTILE = 99.99
# A veil of thin material has at least this coherence, this many voxels for each one inside it (edges have fewer), and
# this separation from what is below.
_VEIL_COHERENCE, _VEIL_SHARE, _VEIL_SEPARATION = 0.8, 0.3, 0.72


# A denser material that covers this part of the thinner one, with less than this part of its voxels, is a shell around
# it, such as the fat around a head in an MRI. It gets this coverage, to be seen through.
_SHELL_COVERAGE, _MAX_SHELL_VOXEL_RATIO, _SHELL_LAYER_COVERAGE = 0.75, 0.8, 0.65


def materials_preset(sample: VoxelSample, background: Background) -> Preset:
    """Return the preset of one or two materials above a background, and of a veil of thinner material around them,
    if any."""
    shares = sample.normalized
    top = float(np.percentile(shares, _TOP_PERCENTILE))
    first = max(otsu_threshold(shares, float(shares.min()), top) or 0.0, background.high)
    top = max(top, first + 1e-6)
    second = otsu_threshold(shares, first, top)
    if second is None:
        middle = max(_median(shares, first, 1.0), first + 1e-6)
        return Preset((_opaque_layer("the object", first, middle),), ((first, _CORE_COLOR),))
    body, core = _median(shares, first, second), _median(shares, second, 1.0)
    thin_knots = ((first, 0.0), (body, 1.0), (second, 1.0), (core, 0.0))
    thin = Layer("the thinner material", thin_knots, TRANSLUCENT_COVERAGE)
    dense = _opaque_layer("the denser material", second, core)
    veil = _veil_threshold(sample, background, first)
    hull = _HULL_COLOR if veil is None else _GLASS_COLOR
    if _is_shell(sample, first, second, (thin, dense)):
        dense, hull = replace(dense, coverage=_SHELL_LAYER_COVERAGE, min_depth=0.0), _FLESH_COLOR
    colors = ((second, hull), (core, _CORE_COLOR))
    if veil is None:
        return Preset((thin, dense), ((first, hull), *colors))
    veil_knots = ((veil, 0.0), (_median(shares, veil, first), 1.0), (first, 1.0), (body, 0.0))
    layers = (Layer("a veil", veil_knots, FAINT_COVERAGE), thin, dense)
    return Preset(layers, ((veil, _VEIL_COLOR), (first, _VEIL_COLOR), (body, hull), *colors))


def _opaque_layer(name: str, first: float, full: float) -> Layer:
    return Layer(name, ((first, 0.0), (full, 1.0)), OPAQUE_COVERAGE, CRISP_SURFACE_DEPTH)


def _is_shell(sample: VoxelSample, first: float, second: float, layers: Sequence[Layer]) -> bool:
    """Return whether the denser material is a shell around the thinner one."""
    inner = int(np.count_nonzero((sample.normalized >= first) & (sample.normalized < second)))
    outer = int(np.count_nonzero(sample.normalized >= second))
    thin, dense = (covered_ray_fraction(sample, layer) for layer in layers)
    return outer < _MAX_SHELL_VOXEL_RATIO * inner and dense > _SHELL_COVERAGE * thin


def _veil_threshold(sample: VoxelSample, background: Background, first: float) -> float | None:
    """Return the threshold of a veil around what is above `first`, or None."""
    shares = sample.normalized
    found = otsu_threshold(shares, float(shares.min()), first, _VEIL_SEPARATION)
    if found is None or found <= background.high:
        return None
    inside, around = int(np.count_nonzero(shares >= first)), int(np.count_nonzero((shares >= found) & (shares < first)))
    return found if around >= _VEIL_SHARE * inside and coherence(sample, found) >= _VEIL_COHERENCE else None


def _median(shares: Float64, low: float, high: float) -> float:
    """Return the median of the values from `low` to `high`, kept away from both ends."""
    inside = shares[(shares >= low) & (shares <= high)]
    middle = float(np.median(inside)) if inside.size else (low + high) / 2
    return min(max(middle, low + 0.05 * (high - low)), high - 0.05 * (high - low))


# Fields: no materials, but values that rise from the background to a peak.

# Ramps with a larger tail ratio have knots at equal ratios.
_LONG_TAIL = 12.0


def ramp_preset(sample: VoxelSample, first: float, *, origin: float) -> Preset:
    """Return the preset of a field that gets denser and brighter from `first` on; ratios are counted from `origin`."""
    shares = sample.normalized
    visible = shares[shares > first]
    top = float(np.percentile(visible, 99.8)) if visible.size else 1.0
    top = max(top, first + 1e-6)
    steps = np.linspace(0.0, 1.0, _NUM_STEPS)
    weights = steps**2
    if tail_ratio(sample, first, origin=origin) > _LONG_TAIL:
        begin = max(first - origin, (top - origin) * 1e-6)
        knots = origin + begin * ((top - origin) / begin) ** steps
        name, weights = "even steps in ratio", steps**3
    else:
        knots = first + (top - first) * steps
        name = ""
    layer = Layer(name, tuple(zip(knots.tolist(), weights.tolist(), strict=True)), _FIELD_COVERAGE)
    palette = colormap_points(_FIELD_COLORMAP, 256)
    picked = (_DARKEST + (1 - _DARKEST) * steps) * 255
    return Preset((layer,), tuple(zip(knots.tolist(), [palette[int(at)] for at in picked], strict=True)))


def tail_ratio(sample: VoxelSample, first: float, *, origin: float) -> float:
    """Return the distance of the largest values above `first` from `origin`, divided by that of their median."""
    visible = sample.normalized[sample.normalized > first] - origin
    if visible.size == 0 or float(np.median(visible)) <= 0:
        return 1.0
    return float(np.percentile(visible, 99.8)) / float(np.median(visible))


# Values nearer to the middle than this part of the largest distance are transparent.
_MIN_DEAD_ZONE = 0.15


def diverging_preset(sample: VoxelSample, middle: float, dead_zone: float) -> Preset:
    """Return the preset of values on both sides of `middle`, blue below and red above, transparent within
    `dead_zone` of it."""
    distance = np.abs(sample.normalized - middle)
    visible = distance[distance > dead_zone]
    top = max(float(np.percentile(visible, 99.5)) if visible.size else 1.0, dead_zone * 1.01 + 1e-6)
    dead_zone = max(dead_zone, _MIN_DEAD_ZONE * top)
    away, weights = np.linspace(dead_zone, top, 5), np.linspace(0.0, 1.0, 5) ** 2
    at = np.concatenate([middle - away[::-1], middle + away]).tolist()
    knots = tuple(zip(at, np.concatenate([weights[::-1], weights]).tolist(), strict=True))
    layer = Layer("strong values on either side", knots, _FIELD_COVERAGE)
    colors = [(middle - top, _NEGATIVE[1]), (middle - dead_zone, _NEGATIVE[0])]
    colors += [(middle + dead_zone, _POSITIVE[0]), (middle + top, _POSITIVE[1])]
    return Preset((layer,), tuple(colors), _FAINT_SHADING)


def level_set_preset(border: float) -> Preset:
    """Return the preset of an opaque inside: all values above `border`."""
    return Preset((_opaque_layer("inside", border, min(border + 0.02, 1.0)),), ((border, _CORE_COLOR),))


def two_phase_preset(sample: VoxelSample, threshold: float) -> Preset:
    """Return the preset of the upper of two phases that fill the volume."""
    upper = _median(sample.normalized, threshold, 1.0)
    layer = _opaque_layer("the upper phase", threshold, upper)
    return Preset((layer,), ((threshold, _GLASS_COLOR), (upper, _CORE_COLOR)))
