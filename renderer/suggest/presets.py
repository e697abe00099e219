"""What a kind of data should look like: layers of values, and colours. One function for each kind.

Values are shares of the volume's range, as in `renderer.suggest.features`; amounts are left to
`renderer.suggest.opacity`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from renderer.scene import Color, ShadingSpec, colormap_points
from renderer.suggest.features import Background, OtsuThreshold, VoxelSample, coherence, otsu_threshold
from renderer.suggest.opacity import Layer, covered_ray_fraction
from renderer.volume import Float64

# Mean opacities of rays through a layer: one that is hardly there, one to look through, one to look at; and of those
# through a field, which is dense here and thin there.
FAINT_COVERAGE, TRANSLUCENT_COVERAGE, OPAQUE_COVERAGE, _FIELD_COVERAGE = 0.25, 0.5, 0.85, 0.65
# Optical depth of 1% of the diagonal at which a surface is crisp.
CRISP_SURFACE_DEPTH = 0.8

# Colours of a scan's layers, from the thinnest to the densest material.
_VEIL_COLOR, _GLASS_COLOR, _CORE_COLOR = (0.30, 0.48, 0.75), (0.95, 0.62, 0.38), (1.0, 0.93, 0.80)
_HULL_COLOR, _FLESH_COLOR = (0.46, 0.58, 0.92), (0.80, 0.62, 0.54)

# A smooth field, from where it is hardly visible on: the lowest part of this colormap is too dark to be seen on black.
_FIELD_COLORMAP, _DARKEST = "inferno", 0.3
_NUM_STEPS = 8

_NEGATIVE, _POSITIVE = ((0.16, 0.40, 0.92), (0.62, 0.87, 1.0)), ((0.90, 0.25, 0.16), (1.0, 0.85, 0.55))


# Half of the light comes from everywhere, so that what turns away from the lamp is still seen; the lamp hangs above
# and in front, on the side that a turntable shows first. Where surfaces of both signs are lit by it, less of it.
SHADING = ShadingSpec(ambient=0.5, diffuse=0.6, light=(0.5, -0.8, 1.0))
_FAINT_SHADING = replace(SHADING, ambient=0.75, diffuse=0.35)


@dataclass(frozen=True)
class Preset:
    """layers: their sum is the extinction. colors: (share, colour), ascending; linear between. shading: or None where
    there are no surfaces."""

    layers: tuple[Layer, ...]
    colors: tuple[tuple[float, Color], ...]
    shading: ShadingSpec | None = SHADING

    def with_inverted_range(self) -> Preset:
        """The same for values with high for low."""
        layers = tuple(
            replace(layer, knots=tuple((1 - at, weight) for at, weight in reversed(layer.knots)))
            for layer in self.layers
        )
        colors = tuple((1 - at, color) for at, color in reversed(self.colors))
        return Preset(layers, colors, None if self.shading is None else flip_light(self.shading))


def flip_light(shading: ShadingSpec) -> ShadingSpec:
    """The same light for surfaces inside of which values are lower: gradients point the other way there."""
    x, y, z = shading.light
    return replace(shading, light=(-x, -y, -z))


# Computed tomography, in Hounsfield units. Soft tissue is glass around solid bone; lungs and air are left out.

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
# Bone, metal or a contrast agent is there from this part of the voxels on.
_LEAST_BONE = 3e-4


def ct_preset(sample: VoxelSample, zero: float) -> Preset:
    """A CT scan; `zero` is the data value of 0 Hounsfield units."""
    has_bone = float(np.mean(sample.normalized > sample.normalize(_BONE_THRESHOLD + zero))) > _LEAST_BONE

    def at(hounsfield: float) -> float:
        return sample.normalize(hounsfield + zero)

    tissue = Layer(
        "soft tissue", tuple((at(v), w) for v, w in _TISSUE), TRANSLUCENT_COVERAGE if has_bone else OPAQUE_COVERAGE
    )
    bone = Layer("bone", tuple((at(v), w) for v, w in _BONE), OPAQUE_COVERAGE, CRISP_SURFACE_DEPTH)
    layers = (tissue, bone) if has_bone else (tissue,)
    return Preset(layers, tuple((at(v), color) for v, color in _CT_COLORS))


# Scans: materials that stand out from a background.

# Values beyond this percentile are outliers.
_TOP = 99.99
# A veil of thin material must be that coherent, have that many voxels by those inside of it (edges have fewer), and be
# that well told from what is below.
_VEIL_COHERENCE, _VEIL_SHARE, _VEIL_SEPARATION = 0.8, 0.3, 0.72


# A denser material that covers this part of the thinner one, with less than this part of its voxels, is a shell around
# it, such as the fat around a head in an MRI: it is to be seen through.
_SHELL_COVERAGE, _THIN, _SHELL = 0.75, 0.8, 0.65


def materials_preset(sample: VoxelSample, background: Background) -> Preset:
    """Two materials above a background, or one, and around them a veil of thinner material where there is some."""
    shares = sample.normalized
    top = float(np.percentile(shares, _TOP))
    found = otsu_threshold(shares, float(shares.min()), top)
    first = max(found.threshold if found else 0.0, background.high)
    top = max(top, first + 1e-6)
    upper = otsu_threshold(shares, first, top)
    veil = _veil(sample, background, first)
    if upper is None:
        return _one_material(shares, first)
    body, core = _median(shares, first, upper.threshold), _median(shares, upper.threshold, 1.0)
    layers = [
        Layer(
            "the thinner material",
            ((first, 0.0), (body, 1.0), (upper.threshold, 1.0), (core, 0.0)),
            TRANSLUCENT_COVERAGE,
        ),
        Layer("the denser material", ((upper.threshold, 0.0), (core, 1.0)), OPAQUE_COVERAGE, CRISP_SURFACE_DEPTH),
    ]
    hull = _HULL_COLOR if veil is None else _GLASS_COLOR
    if _is_shell(sample, first, upper.threshold, layers):
        layers[1], hull = replace(layers[1], coverage=_SHELL, min_depth=0.0), _FLESH_COLOR
    colors = [(first, hull), (upper.threshold, hull), (core, _CORE_COLOR)]
    if veil is not None:
        middle = _median(shares, veil.threshold, first)
        layers.insert(
            0, Layer("a veil", ((veil.threshold, 0.0), (middle, 1.0), (first, 1.0), (body, 0.0)), FAINT_COVERAGE)
        )
        colors = [(veil.threshold, _VEIL_COLOR), (first, _VEIL_COLOR), (body, hull), *colors[1:]]
    return Preset(tuple(layers), tuple(colors))


def _is_shell(sample: VoxelSample, first: float, second: float, layers: Sequence[Layer]) -> bool:
    inner = int(np.count_nonzero((sample.normalized >= first) & (sample.normalized < second)))
    outer = int(np.count_nonzero(sample.normalized >= second))
    return outer < _THIN * inner and covered_ray_fraction(sample, layers[1]) > _SHELL_COVERAGE * covered_ray_fraction(
        sample, layers[0]
    )


def _one_material(shares: Float64, first: float) -> Preset:
    middle = max(_median(shares, first, 1.0), first + 1e-6)
    return Preset(
        (Layer("the object", ((first, 0.0), (middle, 1.0)), OPAQUE_COVERAGE, CRISP_SURFACE_DEPTH),),
        ((first, _CORE_COLOR),),
    )


def _veil(sample: VoxelSample, background: Background, first: float) -> OtsuThreshold | None:
    found = otsu_threshold(sample.normalized, float(sample.normalized.min()), first)
    if found is None or found.threshold <= background.high or found.separation < _VEIL_SEPARATION:
        return None
    inside = int(np.count_nonzero(sample.normalized >= first))
    around = int(np.count_nonzero(sample.normalized >= found.threshold)) - inside
    return found if around >= _VEIL_SHARE * inside and coherence(sample, found.threshold) >= _VEIL_COHERENCE else None


def _median(shares: Float64, low: float, high: float) -> float:
    """Of the values from `low` to `high`, and between them."""
    inside = shares[(shares >= low) & (shares <= high)]
    middle = float(np.median(inside)) if inside.size else (low + high) / 2
    return min(max(middle, low + 0.05 * (high - low)), high - 0.05 * (high - low))


# Fields: no materials, but values that rise from the background to a peak.

# From the middle of the object to its top there are so many times more than from the background to the middle: then
# the steps of the ramp are even in ratio.
_LONG_TAIL = 12.0


def ramp_preset(sample: VoxelSample, first: float, *, origin: float) -> Preset:
    """Ever denser and brighter from the share `first` on. `origin` is the value from which ratios are counted."""
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
    """How far the values above the share `first` reach from `origin`, by how far their median does."""
    visible = sample.normalized[sample.normalized > first] - origin
    if visible.size == 0 or float(np.median(visible)) <= 0:
        return 1.0
    return float(np.percentile(visible, 99.8)) / float(np.median(visible))


# Of what is on both sides of a value, nothing is seen up to this part of the way to the strongest.
_MIN_DEAD_ZONE = 0.15


def diverging_preset(sample: VoxelSample, middle: float, quiet: float) -> Preset:
    """Both sides of the share `middle`, blue and red; up to `quiet` away from it nothing is visible."""
    distance = np.abs(sample.normalized - middle)
    loud = distance[distance > quiet]
    top = max(float(np.percentile(loud, 99.5)) if loud.size else 1.0, quiet * 1.01 + 1e-6)
    quiet = max(quiet, _MIN_DEAD_ZONE * top)
    away = np.linspace(quiet, top, 5)
    weights = np.linspace(0.0, 1.0, 5) ** 2
    below = [(middle - d, w) for d, w in zip(away.tolist(), weights.tolist(), strict=True)]
    above = [(middle + d, w) for d, w in zip(away.tolist(), weights.tolist(), strict=True)]
    layer = Layer("strong values on either side", (*reversed(below), *above), _FIELD_COVERAGE)
    colors = [(middle - top, _NEGATIVE[1]), (middle - quiet, _NEGATIVE[0])]
    colors += [(middle + quiet, _POSITIVE[0]), (middle + top, _POSITIVE[1])]
    return Preset((layer,), tuple(colors), _FAINT_SHADING)


def level_set_preset(border: float) -> Preset:
    """All that is above a share, solid."""
    layer = Layer("inside", ((border, 0.0), (min(border + 0.02, 1.0), 1.0)), OPAQUE_COVERAGE, CRISP_SURFACE_DEPTH)
    return Preset((layer,), ((border, _CORE_COLOR),))


def two_phase_preset(sample: VoxelSample, found: OtsuThreshold) -> Preset:
    """The upper of two phases that fill the volume."""
    upper = _median(sample.normalized, found.threshold, 1.0)
    layer = Layer("the upper phase", ((found.threshold, 0.0), (upper, 1.0)), OPAQUE_COVERAGE, CRISP_SURFACE_DEPTH)
    return Preset((layer,), ((found.threshold, _GLASS_COLOR), (upper, _CORE_COLOR)))
