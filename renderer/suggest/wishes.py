"""Steer a suggestion: by a word, such as `bone` or `glow`, each a function here; or by a preset or a file.

What a word means depends on the scan: a range of Hounsfield units in computed tomography, else a material.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import Problem, SceneError, closest_match
from renderer.scene import TRANSFER_FUNCTION_SECTION, Color, TransferSpec, colormap_points, schema
from renderer.suggest import features
from renderer.suggest.classes import foreground_threshold, material_edges, top_value
from renderer.suggest.features import Background, VoxelSample, otsu_threshold
from renderer.suggest.presets import OPAQUE_COVERAGE, RAMP, SHADING, STONE, Choice, Preset, glow_preset, opaque_preset
from renderer.suggest.recognition import offset_text
from renderer.suggest.visibility import Layer


@dataclass(frozen=True)
class Wish:
    """What a suggestion shall be.

    colormap: the name of a colormap that replaces its colours. preset: a word of WISHES or LABELS_WISH, the name of a
        preset, or a file of another program, of whose transfer functions #NAME picks one.
    """

    colormap: str | None = None
    preset: str | None = None


@dataclass(frozen=True)
class Scan:
    """What is known of a volume. zero: the stored value of 0 Hounsfield units, if the values are such."""

    sample: VoxelSample
    background: Background
    zero: float | None

    def ends(self) -> tuple[float, ...]:
        """Return the ends of its materials, ascending, normalised."""
        if self.background.is_there:
            return material_edges(self.sample, foreground_threshold(self.sample, self.background))
        return material_edges(self.sample, otsu_threshold(self.sample.normalized, 0.0, 1.0) or 0.5)

    def at(self, hounsfield: float, otherwise: float) -> float:
        """Return the normalised value of Hounsfield units, or another value where it has none."""
        return otherwise if self.zero is None else self.sample.normalize(hounsfield + self.zero)


_SKIN, _BONE, _BLOOD, _BRAIN = (0.91, 0.72, 0.60), (0.97, 0.93, 0.84), (0.85, 0.22, 0.16), (0.90, 0.70, 0.66)
_VEIL = (0.45, 0.52, 0.66)
_XRAY_COVERAGE = 0.4


def _surface(scan: Scan, color: Color) -> Preset:
    first, second, *_ = scan.ends()
    low, high = scan.at(-400, first), scan.at(-200, first + RAMP * (second - first))
    return replace(opaque_preset("the surface", low, high, color), is_scan=True)


def _bone(scan: Scan) -> Preset:
    *_, first, top = scan.ends()
    low, high = scan.at(180, first), scan.at(400, first + RAMP * (top - first))
    return replace(opaque_preset("bone", low, high, _BONE), is_scan=True)


def _vessels(scan: Scan) -> Preset:
    begin, first, top = (scan.ends()[k] for k in (0, -2, -1))
    low, full, high = scan.at(130, first), scan.at(220, first + RAMP * (top - first)), scan.at(600, top)
    begin = scan.at(-200, begin)
    veil = Layer("what is around", ((begin, 0.0), ((begin + low) / 2, 1.0), (low, 1.0), (full, 0.0)), share=0.15)
    vessels = Layer("vessels", ((low, 0.0), (full, 1.0)), share=0.85)
    colors = ((low, _VEIL), (full, _BLOOD), (high, _BONE))
    return Preset((veil, vessels), colors, OPAQUE_COVERAGE, replace(SHADING, specular=0.2), is_scan=True)


def _brain(scan: Scan) -> Preset:
    ends = scan.ends()
    low, high = (ends[1], ends[2]) if len(ends) > 3 else (ends[0], ends[-1])
    low, high = scan.at(5, low), scan.at(70, high)
    ramp = RAMP * (high - low)
    knots = ((low, 0.0), (low + ramp, 1.0), (high, 1.0), (high + ramp / 2, 0.0))
    return Preset((Layer("the brain", knots),), ((low, _BRAIN),), OPAQUE_COVERAGE, is_scan=True)


def _xray(scan: Scan) -> Preset:
    first, *_, top = scan.ends()
    first = scan.at(-600, first)
    layer = Layer("what is dense", ((first, 0.0), (first + 0.05 * (top - first), 0.1), (top, 1.0)))
    return Preset((layer,), ((0.0, (1.0, 1.0, 1.0)),), _XRAY_COVERAGE, None)


def _glow(scan: Scan) -> Preset:
    first, *_, top = scan.ends()
    palette: Sequence[Color] = colormap_points("inferno", 12)[-8:]
    return glow_preset([(level,) for level in zip(np.linspace(first, top, 8).tolist(), palette, strict=True)])


WISHES: dict[str, Callable[[Scan], Preset]] = {
    "bone": _bone,
    "vessels": _vessels,
    "skin": lambda scan: _surface(scan, _SKIN),
    "brain": _brain,
    "xray": _xray,
    "surface": lambda scan: _surface(scan, STONE),
    "glow": _glow,
}


def choose_by_word(word: str, sample: VoxelSample, zero: float | None) -> Choice:
    """Return the preset of a word of WISHES. zero: the stored value of 0 Hounsfield units, if the values are such."""
    background = features.find_background(sample)
    is_dark = zero is None and background.is_there and background.below > background.above
    if is_dark:
        sample = sample.with_inverted_range()
        background = features.find_background(sample)
    preset = WISHES[word](Scan(sample, background, zero))
    reason = "by the materials of the values" if zero is None else f"by Hounsfield units{offset_text(zero)}"
    return Choice(f"shown as --preset {word}", reason, preset.with_inverted_range() if is_dark else preset)


# Takes the values for labels, although they do not look like some.
LABELS_WISH = "labels"


def imported_transfer(wish: str, sample: VoxelSample, zero: float | None) -> TransferSpec:
    """Return the transfer function of a preset or a file. Raises SceneError where it cannot be read.

    Shares become the range of the values above the middle of the background. Others are shifted by the stored value of
    0 Hounsfield units.
    """
    file, _, name = wish.partition("#")
    given: dict[str, Any] = {"import": file} | ({"name": name} if name else {})
    if zero:
        given["shift"] = zero
    found, problems = _parsed(given)
    if [problem.path for problem in problems] == ["range"]:  # its values are shares
        ends = (features.find_background(sample).middle, top_value(sample))
        span = [sample.round_value(sample.denormalize(end)) for end in ends]
        found, problems = _parsed({**given, "range": span, "shift": 0.0})
    if problems:
        raise SceneError([_at_option(problem, wish) for problem in problems])
    return found


def _parsed(given: dict[str, Any]) -> tuple[TransferSpec, list[Problem]]:
    problems: list[Problem] = []
    return TRANSFER_FUNCTION_SECTION.read(schema.TreeNode(given, "", problems)), problems


def _at_option(problem: Problem, wish: str) -> Problem:
    expected, hint = problem.expected, problem.hint
    if problem.path == "name" and "#" not in wish:
        hint = f"--preset {wish}#NAME picks one"
    elif not Path(wish.partition("#")[0]).suffix:
        close = closest_match(wish, (*WISHES, LABELS_WISH)) if hint is None else None
        expected = f"{', '.join(WISHES)} or {LABELS_WISH}; a file; or a preset, {expected}"
        hint = f"did you mean {close}?" if close else hint
    return replace(problem, path="", location=f"--preset {wish}", expected=expected, hint=hint)
