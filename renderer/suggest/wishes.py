"""Steer a suggestion by a word, such as `bone` or `glow`; this file has a function for each word.

The meaning of a word depends on the scan: a range of Hounsfield units in computed tomography, else a material.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from renderer.scene import Color, colormap_points
from renderer.statistics import VoxelSample, find_background, foreground_threshold, material_edges, otsu_threshold
from renderer.suggest.field_presets import glow_preset
from renderer.suggest.layer import Layer
from renderer.suggest.presets import OPAQUE_COVERAGE, RAMP, SHADING, STONE, Choice, Preset, opaque_preset
from renderer.suggest.recognition import offset_text


@dataclass(frozen=True)
class Wish:
    """A wish by which a user steers a suggestion.

    colormap: the name of a colormap that replaces the suggested colours.
    preset: a word of WISHES or LABELS_WISH, the name of a preset, or a file of another program; `file#NAME` picks one
        of its transfer functions.
    """

    colormap: str | None = None
    preset: str | None = None


@dataclass(frozen=True)
class Materials:
    """The materials of a scan; a user's word selects the ones that are shown.

    ends: the normalised values at which materials begin and end, ascending.
    sample: a sample of the scan.
    zero: the stored value of 0 Hounsfield units; None for values in other units.
    """

    ends: tuple[float, ...]
    sample: VoxelSample
    zero: float | None

    def at(self, hounsfield: float, otherwise: float) -> float:
        """Return the normalised value of `hounsfield` Hounsfield units, or `otherwise` for a scan in other units."""
        return otherwise if self.zero is None else self.sample.normalize(hounsfield + self.zero)

    def named(self, in_hounsfield: str, otherwise: str) -> str:
        """Return the name `in_hounsfield` for a material of a scan in Hounsfield units, otherwise `otherwise`."""
        return otherwise if self.zero is None else in_hounsfield


# No wish of a user: the values of the volume alone decide how it is shown.
NO_WISH = Wish()

_SKIN = (0.91, 0.72, 0.60)
_BONE = (0.97, 0.93, 0.84)
_BLOOD = (0.85, 0.22, 0.16)
_BRAIN = (0.90, 0.70, 0.66)
_VEIL = (0.45, 0.52, 0.66)
# Opacities of a picture like an X-ray are solved so that the rays that meet anything have this mean opacity.
_XRAY_COVERAGE = 0.4


def _surface(scan: Materials, color: Color = STONE) -> Preset:
    first, second, *_ = scan.ends
    low, full = scan.at(-400, first), scan.at(-200, first + RAMP * (second - first))
    return opaque_preset("the surface", low, full, color, is_scan=True)


def _bone(scan: Materials) -> Preset:
    *_, first, top = scan.ends
    low, full = scan.at(180, first), scan.at(400, first + RAMP * (top - first))
    return opaque_preset(_densest_name(scan, "bone and contrast medium"), low, full, _BONE, is_scan=True)


def _vessels(scan: Materials) -> Preset:
    *others, first, top = scan.ends
    low, full, high = scan.at(130, first), scan.at(220, first + RAMP * (top - first)), scan.at(600, top)
    vessels = Layer(_densest_name(scan, "contrast medium and bone"), ((low, 0.0), (full, 1.0)), share=0.85)
    colors = ((low, _VEIL), (full, _BLOOD), (high, _BONE))
    shading = replace(SHADING, specular=0.2)
    begin = scan.at(-200, others[0] if others else low)
    if begin >= low:  # there is nothing around the object
        return Preset((vessels,), colors, OPAQUE_COVERAGE, shading, is_scan=True)
    veil = Layer("the surroundings", ((begin, 0.0), ((begin + low) / 2, 1.0), (low, 1.0), (full, 0.0)), share=0.15)
    return Preset((veil, vessels), colors, OPAQUE_COVERAGE, shading, is_scan=True)


def _densest_name(scan: Materials, in_hounsfield: str) -> str:
    """Return the name of the densest material, or of the object if the object is a single material."""
    return scan.named(in_hounsfield, "the densest material" if len(scan.ends) > 2 else "the object")


def _brain(scan: Materials) -> Preset:
    ends = scan.ends
    has_middle = len(ends) > 3
    low, high = (ends[1], ends[2]) if has_middle else (ends[0], 1.0)
    low, high = scan.at(5, low), scan.at(70, high)
    ramp = RAMP * (high - low)
    knots = ((low, 0.0), (low + ramp, 1.0), (high, 1.0), (high + ramp / 2, 0.0))
    name = scan.named("soft tissue", "the middle material" if has_middle else "the object")
    return Preset((Layer(name, knots),), ((low, _BRAIN),), OPAQUE_COVERAGE, is_scan=True)


def _xray(scan: Materials) -> Preset:
    first, top = scan.at(-600, scan.ends[0]), scan.ends[-1]
    layer = Layer("all that stands out", ((first, 0.0), (first + 0.05 * (top - first), 0.1), (top, 1.0)))
    return Preset((layer,), ((first, (1.0, 1.0, 1.0)),), _XRAY_COVERAGE, None)


def _glow(scan: Materials) -> Preset:
    palette: Sequence[Color] = colormap_points("inferno", 12)[-8:]
    levels = np.linspace(scan.ends[0], scan.ends[-1], 8).tolist()
    return glow_preset([(level,) for level in zip(levels, palette, strict=True)])


# The words that steer a suggestion, each with the function that makes a preset from a scan's materials.
WISHES: dict[str, Callable[[Materials], Preset]] = {
    "bone": _bone,
    "vessels": _vessels,
    "skin": partial(_surface, color=_SKIN),
    "brain": _brain,
    "xray": _xray,
    "surface": _surface,
    "glow": _glow,
}


def choose_by_word(sample: VoxelSample, zero: float | None, *, word: str) -> Choice:
    """Return the preset for `word`, which is one of WISHES, and a volume.

    zero: the stored value of 0 Hounsfield units; None for values in other units.
    """
    background = find_background(sample)
    is_dark = zero is None and background.is_there and background.below > background.above
    if is_dark:
        sample = sample.with_inverted_range()
        background = find_background(sample)
    if background.is_there:
        first = foreground_threshold(sample, background)
    else:
        first = otsu_threshold(sample.normalized, 0.0, 1.0) or 0.5
    preset = WISHES[word](Materials(material_edges(sample, first), sample, zero))
    reason = "by the materials of the values" if zero is None else f"by Hounsfield units{offset_text(zero)}"
    return Choice(f"shown as --preset {word}", reason, preset.with_inverted_range() if is_dark else preset)


# The word by which a user has values shown as labels, also where they are not recognised as labels.
LABELS_WISH = "labels"
